// Traversal alone: no more is read and written than a ray and its distance. `rays` holds origin and direction
// in six planes; a limit of infinity asks for whatever is nearest. Included after bvh.cl.

#define GEOMETRY_PARAMETERS                                                                                  \
    __global const Node *top_nodes, __global const TrianglePack *top_packs, __global const Node *nodes,      \
        __global const TrianglePack *packs, __global const Object *objects
#define GEOMETRY top_nodes, top_packs, nodes, packs, objects

INLINE bool trace_one(uint k, uint count, __global const float *rays, GEOMETRY_PARAMETERS, const bool any,
                      BvhHit *hit) {
    const Geometry geometry = {GEOMETRY, 0};
    float origin[3], direction[3];
    for (uint i = 0; i < 3; i++) {
        origin[i] = rays[i * count + k];
        direction[i] = rays[(3 + i) * count + k];
    }
    return bvh_trace(&geometry, origin, direction, any, hit);
}

__kernel __attribute__((vec_type_hint(float8))) void
trace_closest(const uint count, __global const float *rays, __global const float *limits, GEOMETRY_PARAMETERS,
              __global float *distances) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    BvhHit hit;
    hit.distance = limits[k];
    const bool found = trace_one(k, count, rays, GEOMETRY, false, &hit);
    distances[k] = found ? hit.distance : INFINITY;
}

// 1 where something is nearer than the limit, else 0.
__kernel __attribute__((vec_type_hint(float8))) void trace_any(const uint count, __global const float *rays,
                                                               __global const float *limits,
                                                               GEOMETRY_PARAMETERS,
                                                               __global float *distances) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    BvhHit hit;
    hit.distance = limits[k];
    distances[k] = trace_one(k, count, rays, GEOMETRY, true, &hit) ? 1.0f : 0.0f;
}

#ifdef COUNT_VISITS
// How many nodes (of both levels) and packs of triangles each ray is tested against.
__kernel __attribute__((vec_type_hint(float8))) void
count_visits(const uint count, const uint any, __global const float *rays, __global const float *limits,
             GEOMETRY_PARAMETERS, __global uint *visits) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    BvhHit hit;
    hit.distance = limits[k];
    hit.visits = hit.tests = 0;
    if (any)
        trace_one(k, count, rays, GEOMETRY, true, &hit);
    else
        trace_one(k, count, rays, GEOMETRY, false, &hit);
    visits[2 * k] = hit.visits;
    visits[2 * k + 1] = hit.tests;
}
#endif
