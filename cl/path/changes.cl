#include "path/state.cl"

// Which paths meet something that differs between two scenes. A path that meets nothing of it brings the same
// in both, to the bit: it is traced in one of them only.
//
// A segment of a path is a ray up to its hit, or up to infinity, and a shadow ray up to the light. What is
// elsewhere, has another shape, or has come or gone, is met by a segment that crosses a box around it. Where
// only the material of an object is another one, a hit on it is enough: a ray that ends elsewhere depends on
// shapes alone, and so do shadow rays, which any surface stops. A path is in a medium after a hit on its
// boundary only. Where a light differs, it is enough that a path chooses it.

// A loop over boxes would end vectorisation, so that there are two in a row, which is what an object makes
// that has moved.
#define BOXES_AT_ONCE 2u

// Whether a ray crosses box number `box` or the one after it between 0 and `limit`.
//
// By separating axes (Ericson, Real-Time Collision Detection, 5.3.3): a segment and a box are apart if they
// are along an axis of the box, or along one that is perpendicular to the segment and an axis of the box.
// That takes no division, and has no case apart for directions without a component. Boxes are padded by more
// than all rounding errors that decide whether and where a ray meets what is in them; those grow with the
// coordinates of both.
INLINE uint crosses_boxes(const Change *change, uint box, Ray ray, float limit) {
    Vec3 o = ray.origin, d = ray.direction;
    Vec3 end = along(o, MIN(limit, 1e30f), d), size = vec3(FABS(d.x), FABS(d.y), FABS(d.z));
    // The box around the ray is padded in place of those that it is tested against.
    float pad = change->padding * (change->reach + MAX(MAX(FABS(o.x), FABS(o.y)), FABS(o.z)));
    Vec3 first = vec3(MIN(o.x, end.x) - pad, MIN(o.y, end.y) - pad, MIN(o.z, end.z) - pad);
    Vec3 last = vec3(MAX(o.x, end.x) + pad, MAX(o.y, end.y) + pad, MAX(o.z, end.z) + pad);
    Vec3 slack = scale(pad, vec3(size.y + size.z, size.z + size.x, size.x + size.y));
    uint crossed = 0u;
#pragma unroll
    for (uint i = 0u; i < BOXES_AT_ONCE; i++) {
        const float *least = change->least[box + i], *greatest = change->greatest[box + i];
        Vec3 half_size = vec3(0.5f * (greatest[0] - least[0]), 0.5f * (greatest[1] - least[1]),
                              0.5f * (greatest[2] - least[2]));
        Vec3 center = vec3(0.5f * (greatest[0] + least[0]), 0.5f * (greatest[1] + least[1]),
                           0.5f * (greatest[2] + least[2]));
        Vec3 moment = cross(subtract(o, center), d);
        crossed |= (first.x <= greatest[0]) & (last.x >= least[0]) & (first.y <= greatest[1]) &
                   (last.y >= least[1]) & (first.z <= greatest[2]) & (last.z >= least[2]) &
                   (FABS(moment.x) <= slack.x + half_size.y * size.z + half_size.z * size.y) &
                   (FABS(moment.y) <= slack.y + half_size.z * size.x + half_size.x * size.z) &
                   (FABS(moment.z) <= slack.z + half_size.x * size.y + half_size.y * size.x);
    }
    return crossed;
}

// 1 where a hit on the object is enough. `object` may be NO_INDEX, or have the flag LIGHT_HIT.
INLINE uint is_changed(const Changes *changes, uint object) {
    return changes->changed_objects[INDEX_OR_0(object)] & INDEX_MASK(object) & 1u;
}

// Notes of the path at `place` that it has met something that changed, if `met` is 1.
INLINE void touch(const Changes *changes, uint place, uint met) { changes->touched[place] |= met; }

#ifndef BLOCKS
INLINE uint crosses_any_box(const Change *change, Ray ray, float limit) {
    uint crossed = 0u;
    for (uint box = 0u; box < change->box_count; box += BOXES_AT_ONCE)
        crossed |= crosses_boxes(change, box, ray, limit);
    return crossed;
}

// For paths whose rays are traced.
__kernel void touch_rays(LAUNCH_PARAMETERS, LIST_PARAMETERS, PATH_STATE_PARAMETERS, CHANGES_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Changes changes = {CHANGES_ARGUMENTS};
    const Surface surface = load_surface(&state, path);
    const Ray ray = load_ray(rays, state.stride, path);
    touch(&changes, params.first_path + path,
          crosses_any_box(&changes.change, ray, surface.distance) | is_changed(&changes, surface.object));
}

// For paths whose shadow rays are going to be traced.
__kernel void touch_shadow_rays(LAUNCH_PARAMETERS, LIST_PARAMETERS, PATH_STATE_PARAMETERS,
                                CHANGES_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Changes changes = {CHANGES_ARGUMENTS};
    touch(&changes, params.first_path + path,
          crosses_any_box(&changes.change, load_ray(shadows, state.stride, path),
                          shadows[SHADOW_DISTANCE * state.stride + path]));
}
#endif
