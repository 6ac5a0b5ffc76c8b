#include "accel/bvh.cl"
#include "path/state.cl"

// The rays of paths: the nearest hit of one, and whether anything is in the way of another.

// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
#ifdef CLANG_CPU
#define TRACE_CALL static __attribute__((noinline))
#else
#define TRACE_CALL static inline
#endif

// Leaves the nearest hit of a path's ray in its planes, as far as `setup_surface_path` needs it. False, and
// object NO_INDEX, where the ray leaves the scene.
TRACE_CALL bool trace_path(const Geometry *geometry, const State *state, uint path) {
    const uint stride = STRIDE(state);
    const Vec3 origin = load3(state->rays + RAY_ORIGIN_X * stride, stride, path);
    const Vec3 direction = load3(state->rays + RAY_DIRECTION_X * stride, stride, path);
    BvhHit hit;
    STATE float *hits = state->hits + path;
    hit.distance = INFINITY;
    bvh_trace(geometry, origin, direction, false, &hit);
    hits[HIT_DISTANCE * stride] = hit.distance;
    hits[HIT_OBJECT * stride] = as_float(hit.object);
    if (hit.object == NO_INDEX)
        return false;
    hits[HIT_TRIANGLE * stride] = as_float(hit.triangle);
    for (uint i = 0; i < 3; i++)
        hits[(HIT_POSITION_X + i) * stride] = hit.weight[i];
    return true;
}

// Which shading kernel a path waits for, if it has hit something.
INLINE uint surface_class(const Geometry *geometry, __global const Material *materials, const State *state,
                          uint path) {
    uint in_medium = load_bits(state->paths, PATH_MEDIUM_0 * STRIDE(state) + path) != NO_INDEX;
    uint object = load_bits(state->hits, HIT_OBJECT * STRIDE(state) + path);
    object = object == NO_INDEX ? 0u : object;
    uint transmissive = materials[geometry->objects[object].material].flags & MATERIAL_TRANSMISSIVE;
    return in_medium | transmissive ? CLASS_MEDIUM : CLASS_SURFACE;
}

// Whether anything is in the way of a path's shadow ray.
TRACE_CALL bool is_occluded(const Geometry *geometry, const State *state, uint path) {
    const uint stride = STRIDE(state);
    const Vec3 origin = load3(state->shadows + SHADOW_ORIGIN_X * stride, stride, path);
    const Vec3 direction = load3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path);
    BvhHit hit;
    hit.distance = state->shadows[SHADOW_DISTANCE * stride + path];
    return bvh_trace(geometry, origin, direction, true, &hit);
}
