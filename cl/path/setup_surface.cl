#include "accel/bvh.cl"
#include "path/state.cl"

// What the surface is like where a ray met it: position, normals, material, rounding bound. Straight-line
// code of scalars, so that PoCL runs it in SIMD lanes.

// Scenes that need less have variants that do less: TOP_LEVEL_ONLY where every triangle lies in the packs of
// the top level, in world space, and FLAT where no mesh has normals.

// The unit vector along v, which is scaled before it is squared, because squares of very small or large
// components would leave the range of a float.
INLINE Vec3 safe_unit(Vec3 v) { return normalize(scale(bvh_scale(bvh_largest(v)), v)); }

// A normal of object space in world space: by the inverse transpose, which keeps the outside outside, also
// where the object is mirrored. Scaled before it is squared, because squares of very small or large
// components would leave the range of a float.
INLINE Vec3 world_normal(__global const Object *object, Vec3 normal) {
    __global const float *m = object->object_from_world;
    Vec3 v = vec3(m[0] * normal.x + m[4] * normal.y + m[8] * normal.z,
                  m[1] * normal.x + m[5] * normal.y + m[9] * normal.z,
                  m[2] * normal.x + m[6] * normal.y + m[10] * normal.z);
    return safe_unit(v);
}

INLINE Vec3 world_point(__global const Object *object, Vec3 p) {
    __global const float *m = object->world_from_object;
    return vec3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}

// A corner of the triangle in a lane of a pack.
INLINE Vec3 pack_vertex(__global const TrianglePack *pack, uint corner, uint lane) {
    return vec3(pack->vertex[3 * corner][lane], pack->vertex[3 * corner + 1][lane],
                pack->vertex[3 * corner + 2][lane]);
}

// How far along the unit normal a ray must start to be clear of the surface.
INLINE float offset_bound(__global const Object *object, Vec3 normal) {
    __global const float *error = object->position_error;
    return FABS(normal.x) * error[0] + FABS(normal.y) * error[1] + FABS(normal.z) * error[2];
}

// The interpolated normal on the geometric one's side; that itself where the face is flat, or where the
// normals of its corners cancel out.
INLINE Vec3 shading_normal(__global const Object *object, __global const float *normals, uint face,
                           Vec3 weight, Vec3 geometric) {
    int smooth = object->first_normal != NO_INDEX;
    __global const float *n = normals + (smooth ? object->first_normal + 9u * (size_t)face : 0u);
    Vec3 interpolated = vec3(weight.x * n[0] + weight.y * n[3] + weight.z * n[6],
                             weight.x * n[1] + weight.y * n[4] + weight.z * n[7],
                             weight.x * n[2] + weight.y * n[5] + weight.z * n[8]);
    smooth &= FABS(interpolated.x) + FABS(interpolated.y) + FABS(interpolated.z) >= 1e-6f;
    Vec3 shading = world_normal(object, select(smooth, interpolated, vec3(0.0f, 0.0f, 1.0f)));
    shading = select(dot(shading, geometric) < 0.0f, scale(-1.0f, shading), shading);
    return select(smooth, shading, geometric);
}

// How a position on a triangle moves by that much towards its centroid. A ray that starts just above one face
// but on the plane of its neighbour, which it must not miss, would slip out where the two meet.
INLINE Vec3 leave_edge(Vec3 centroid, float offset, Vec3 position) {
    Vec3 inwards = subtract(centroid, position);
    float share = offset / SQRT(dot(inwards, inwards));
    return along(position, share < 1.0f ? share : 0.0f, inwards);
}

// Fills in the planes of a hit of which `trace_path` has left the distance, the object, the place of the
// triangle, and the weights of its corners, up to a common factor, in place of the position.
INLINE void setup_surface_path(const Geometry *geometry, const State *state, uint path) {
    uint stride = STRIDE(state);
    __global const Object *object = geometry->objects + load_bits(state->hits, HIT_OBJECT * stride + path);
    uint place = load_bits(state->hits, HIT_TRIANGLE * stride + path);
#ifdef TOP_LEVEL_ONLY
    __global const TrianglePack *packs = geometry->top_packs;
#else
    int on_top = (place & NODE_PACK) != 0u;
    __global const TrianglePack *packs = on_top ? geometry->top_packs : geometry->packs;
#endif
    __global const TrianglePack *pack = packs + (place & ~NODE_PACK) / BVH_WIDTH;
    uint lane = place % BVH_WIDTH;
    uint face = pack->face[lane];
    Vec3 a = pack_vertex(pack, 0, lane), b = pack_vertex(pack, 1, lane), c = pack_vertex(pack, 2, lane);
    Vec3 weight = load3(state->hits + HIT_POSITION_X * stride, stride, path);
    weight = scale(1.0f / (weight.x + weight.y + weight.z), weight);
    Vec3 position = add(scale(weight.x, a), add(scale(weight.y, b), scale(weight.z, c)));
    Vec3 centroid = scale(1.0f / 3.0f, add(a, add(b, c)));
    Vec3 normal = bvh_normal(a, b, c);
    Vec3 geometric = scale(object->winding, safe_unit(normal));
#ifndef TOP_LEVEL_ONLY
    position = select(on_top, position, world_point(object, position));
    centroid = select(on_top, centroid, world_point(object, centroid));
    geometric = select(on_top, geometric, world_normal(object, normal));
#endif
    float offset = offset_bound(object, geometric);
    store3(state->hits + HIT_POSITION_X * stride, stride, path, leave_edge(centroid, offset, position));
    store3(state->hits + HIT_GEOMETRIC_X * stride, stride, path, geometric);
#ifdef FLAT
    store3(state->hits + HIT_SHADING_X * stride, stride, path, geometric);
#else
    store3(state->hits + HIT_SHADING_X * stride, stride, path,
           shading_normal(object, geometry->normals, face, weight, geometric));
#endif
    state->hits[HIT_OFFSET * stride + path] = offset;
    store_bits(state->hits, HIT_MATERIAL * stride + path, object->material);
    store_bits(state->hits, HIT_TRIANGLE * stride + path, face);
}
