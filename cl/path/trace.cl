#include "accel/bvh.cl"
#include "path/state.cl"

// Rays of single paths through the trees.

// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
#ifdef CLANG_CPU
#define TRACE_CALL static __attribute__((noinline))
#else
#define TRACE_CALL static inline
#endif

// The nearest hit of a path's ray. False, and object NO_INDEX, where the ray leaves the scene.
TRACE_CALL bool trace_path(const Geometry *geometry, const State *state, uint path, RawHit *hit) {
    return bvh_nearest(geometry, load_ray(state->rays, STRIDE(state), path), INFINITY, hit);
}

// Whether anything is in the way of a path's shadow ray.
TRACE_CALL bool is_occluded(const Geometry *geometry, const State *state, uint path) {
    // The first planes of a shadow ray are those of a ray.
    return bvh_any(geometry, load_ray(state->shadows, STRIDE(state), path),
                   state->shadows[SHADOW_DISTANCE * STRIDE(state) + path]);
}
