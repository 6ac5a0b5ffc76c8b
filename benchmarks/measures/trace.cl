// Traversal alone: no more is read and written than a ray and its distance. `rays` holds origin and direction
// in six planes; a limit of infinity asks for whatever is nearest. Included after bvh.cl, or after
// trace_blocks.cl where that is what traces.

#ifdef BLOCKS

// A block of rays, in the planes of state where paths have theirs.
STAGE void load_rays(const Block *block, __local float *planes, uint path_class, uint first, uint size,
                     uint count, __global const float *given) {
    for (uint p = 0; p < 6; p++)
        for (uint i = 0; i < size; i++)
            planes[p * BLOCK_STRIDE + i] = given[p * count + first + i];
    for (uint i = 0; i < size; i++) {
        store_bits(block->state.paths, PATH_CLASS * BLOCK_STRIDE + i, path_class);
        block->results[i] = i;
    }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_closest(const uint count, __global const float *given, __global const float *limits, BLOCK_PARAMETERS,
              __global float *distances, const uint from_camera) {
    Block block = BLOCK(0, 0);
    const uint first = (uint)get_group_id(0) * BLOCK_PATHS, size = MIN(count - first, BLOCK_PATHS);
    load_rays(&block, block.state.rays, CLASS_LIVE, first, size, count, given);
    trace_rays(&block, size, from_camera != 0);
    for (uint i = 0; i < size; i++) {
        const uint met = load_bits(block.state.hits, HIT_OBJECT * BLOCK_STRIDE + i) != NO_INDEX;
        distances[first + block.results[i]] =
            met ? block.state.hits[HIT_DISTANCE * BLOCK_STRIDE + i] : INFINITY;
    }
}

// 1 where something is nearer than the limit, else 0.
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_any(const uint count, __global const float *given, __global const float *limits, BLOCK_PARAMETERS,
          __global float *distances) {
    Block block = BLOCK(0, 0);
    const uint first = (uint)get_group_id(0) * BLOCK_PATHS, size = MIN(count - first, BLOCK_PATHS);
    const State *state = &block.state;
    load_rays(&block, state->shadows, CLASS_SHADOW, first, size, count, given);
    for (uint i = 0; i < size; i++) {
        state->shadows[SHADOW_DISTANCE * BLOCK_STRIDE + i] = limits[first + i];
        store3(state->shadows + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, i, vec3(1.0f, 1.0f, 1.0f));
        store3(state->radiance, BLOCK_STRIDE, i, vec3(0.0f, 0.0f, 0.0f));
    }
    trace_shadows(&block, size);
    for (uint i = 0; i < size; i++)
        distances[first + i] = 1.0f - state->radiance[i];
}

#else

#define GEOMETRY_PARAMETERS                                                                                  \
    __global const Node *top_nodes, __global const TrianglePack *top_packs, __global const Node *nodes,      \
        __global const TrianglePack *packs, __global const Object *objects
#define GEOMETRY top_nodes, top_packs, nodes, packs, objects

INLINE bool trace_one(uint k, uint count, __global const float *rays, GEOMETRY_PARAMETERS, const bool any,
                      BvhHit *hit) {
    const Geometry geometry = {GEOMETRY, 0};
    const Vec3 origin = vec3(rays[k], rays[count + k], rays[2 * count + k]);
    const Vec3 direction = vec3(rays[3 * count + k], rays[4 * count + k], rays[5 * count + k]);
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

#endif
