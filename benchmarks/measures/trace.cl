// Traversal alone: no more is read and written than a ray and its distance. `given` holds origins and
// directions in six planes; a limit of infinity asks for whatever is nearest. The text follows that of
// bvh.cl, or that of trace_blocks.cl where blocks trace.

#ifdef BLOCKS

// Puts a block of rays where the rays of paths stand, or where their shadow rays do.
STAGE void load_rays(const Block *block, __local float *planes, uint path_class, uint count,
                     __global const float *given) {
    for (uint p = 0; p < RAY_PLANES; p++)
        for (uint i = 0; i < block->size; i++)
            planes[p * BLOCK_STRIDE + i] = given[p * count + block->first + i];
    for (uint i = 0; i < block->size; i++) {
        store_class(&block->state, i, path_class);
        store_result(&block->state, i, i);
    }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_closest(RAYS_PARAMETERS, BLOCK_PARAMETERS, DISTANCES_PARAMETERS) {
    const Block block = BLOCK_OF(0, 0, 0, 0, 0, 0, count);
    load_rays(&block, block.state.rays, CLASS_LIVE, count, given);
    trace_nearest(&block, block.size, from_camera != 0);
    for (uint i = 0; i < block.size; i++) {
        const RawHit hit = load_raw_hit(&block, i);
        distances[block.first + load_result(&block.traced, i)] =
            hit.object == NO_INDEX ? INFINITY : hit.distance;
    }
}

// 1 where something is nearer than the limit, else 0.
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void trace_any(RAYS_PARAMETERS, BLOCK_PARAMETERS,
                                                                            DISTANCES_PARAMETERS) {
    const Block block = BLOCK_OF(0, 0, 0, 0, 0, 0, count);
    const State *state = &block.state;
    load_rays(&block, state->shadows, CLASS_SHADOW, count, given);
    for (uint i = 0; i < block.size; i++) {
        state->shadows[SHADOW_DISTANCE * BLOCK_STRIDE + i] = limits[block.first + i];
        store_arriving(state, i, vec3(1.0f, 1.0f, 1.0f));
        store3(state->radiance, BLOCK_STRIDE, i, vec3(0.0f, 0.0f, 0.0f));
    }
    BlockRay ray;
    ray.count = block.size;
    trace_shadows(&block, &ray);
    for (uint i = 0; i < block.size; i++)
        distances[block.first + i] = 1.0f - state->radiance[i];
}

#else

INLINE Ray given_ray(uint k, uint count, __global const float *given) {
    Ray ray;
    ray.origin = vec3(given[k], given[count + k], given[2 * count + k]);
    ray.direction = vec3(given[3 * count + k], given[4 * count + k], given[5 * count + k]);
    return ray;
}

__kernel __attribute__((vec_type_hint(float8))) void trace_closest(RAYS_PARAMETERS, GEOMETRY_PARAMETERS,
                                                                   DISTANCES_PARAMETERS) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    RawHit hit;
    distances[k] =
        bvh_nearest(&geometry, given_ray(k, count, given), limits[k], &hit) ? hit.distance : INFINITY;
}

// 1 where something is nearer than the limit, else 0.
__kernel __attribute__((vec_type_hint(float8))) void trace_any(RAYS_PARAMETERS, GEOMETRY_PARAMETERS,
                                                               DISTANCES_PARAMETERS) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    distances[k] = bvh_any(&geometry, given_ray(k, count, given), limits[k]) ? 1.0f : 0.0f;
}

#ifdef COUNT_VISITS
// How many nodes (of both levels) and packs of triangles each ray is tested against.
__kernel __attribute__((vec_type_hint(float8))) void count_visits(RAYS_PARAMETERS, GEOMETRY_PARAMETERS,
                                                                  VISITS_PARAMETERS) {
    const uint k = (uint)get_global_id(0);
    if (k >= count)
        return;
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    RawHit hit;
    hit.distance = limits[k];
    hit.visited_nodes = hit.visited_packs = 0;
    if (any_hit)
        bvh_trace(&geometry, given_ray(k, count, given), true, &hit);
    else
        bvh_trace(&geometry, given_ray(k, count, given), false, &hit);
    visits[2 * k] = hit.visited_nodes;
    visits[2 * k + 1] = hit.visited_packs;
}
#endif

#endif
