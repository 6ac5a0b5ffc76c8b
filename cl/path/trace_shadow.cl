#include "path/coverage.cl"
#include "path/trace.cl"
#include "path/light_search.cl"

// Traces shadow rays, and adds the radiance of those that nothing is in the way of to what paths have
// gathered. The hint keeps compilers from making SIMD lanes of work-items, as Intel's would: the lanes are
// boxes and triangles.
__kernel __attribute__((vec_type_hint(float8))) void trace_shadow(LAUNCH_PARAMETERS, LIST_PARAMETERS,
                                                                  GEOMETRY_PARAMETERS, SHADING_PARAMETERS,
                                                                  EMITTERS_PARAMETERS,
                                                                  PATH_STATE_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
#ifdef SHAPED_LIGHTS
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    const Ray shadow = load_ray(shadows, state.stride, path);
    const float limit = shadows[SHADOW_DISTANCE * state.stride + path];
#ifdef LIGHT_TREE
    if (any_tree_light_shades(&params, &emitters, shadow, limit))
        return;
#else
    if (any_light_shades(&params, &emitters, shadow, limit))
        return;
#endif
#endif
#ifdef CUTOUTS
    const Shading shading = {SHADING_ARGUMENTS};
    const Path p = load_path(&state, path);
    Ray ray = load_ray(shadows, state.stride, path);
    float left = shadows[SHADOW_DISTANCE * state.stride + path];
    RawHit hit;
    bool occluded = bvh_nearest(&geometry, ray, left, &hit);
    for (uint layer = 0u; occluded && layer < MOST_LAYERS; layer++) {
        if (!passes_hit(&params, &geometry, &shading, &p, &hit, ray.direction, layer, 1))
            break;
        left -= hit.distance;
        ray.origin = behind_hit(&geometry, &hit, ray.direction);
        occluded = bvh_nearest(&geometry, ray, left, &hit);
    }
#else
    const bool occluded = is_occluded(&geometry, &state, path);
#endif
    if (!occluded)
        accumulate(&state, params.first_path + path, load_light_sample(&state, path).radiance);
}
