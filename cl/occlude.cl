// Traces shadow rays, and adds to the path buffer the radiance of those that nothing is in the way of.

#include "bvh.cl"

// The hint keeps compilers from making SIMD lanes of work-items (Intel's would): the lanes are boxes and
// triangles.
__kernel __attribute__((vec_type_hint(float8))) void
occlude(const Params params, const uint count, __global const uint *list, __global const Node *top_nodes,
        __global const Node *nodes, __global const TrianglePack *packs, __global const Object *objects,
        __global const float *shadows, __global float *radiance) {
    if (get_global_id(0) >= count)
        return;
    const uint k = list[get_global_id(0)], stride = params.path_stride;
    BvhHit hit;
    hit.distance = shadows[SHADOW_DISTANCE * stride + k];
    if (bvh_trace(shadows + SHADOW_ORIGIN_X * stride + k, shadows + SHADOW_DIRECTION_X * stride + k, stride,
                  top_nodes, nodes, packs, objects, true, &hit))
        return;
    for (uint c = 0; c < 3; c++)
        radiance[c * params.buffer_stride + params.first_path + k] +=
            shadows[(SHADOW_RADIANCE_R + c) * stride + k];
}
