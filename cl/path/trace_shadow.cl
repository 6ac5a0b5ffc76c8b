// Traces shadow rays, and adds to the path buffer the radiance of those that nothing is in the way of.

#include "path/trace.cl"

INLINE void trace_shadow_path(const Geometry *geometry, const State *state, uint path, uint result) {
    if (!is_occluded(geometry, state, path))
        accumulate(state, result,
                   load3(state->shadows + SHADOW_RADIANCE_R * STRIDE(state), STRIDE(state), path));
}

#ifndef BLOCKS
// The hint keeps compilers from making SIMD lanes of work-items (Intel's would): the lanes are boxes and
// triangles.
__kernel __attribute__((vec_type_hint(float8))) void
trace_shadow(const Params params, const uint count, __global const uint *list, __global const Node *top_nodes,
             __global const TrianglePack *top_packs, __global const Node *nodes,
             __global const TrianglePack *packs, __global const Object *objects, __global float *shadows,
             __global float *radiance) {
    if (get_global_id(0) >= count)
        return;
    const uint path = list[get_global_id(0)];
    const State state = {0, 0, 0, shadows, radiance, params.path_stride, params.buffer_stride};
    const Geometry geometry = {top_nodes, top_packs, nodes, packs, objects, 0};
    trace_shadow_path(&geometry, &state, path, params.first_path + path);
}
#endif
