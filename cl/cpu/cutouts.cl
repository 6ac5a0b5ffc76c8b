#include "cpu/interleaved.cl"
#include "path/coverage.cl"

// Rays that go on behind hits which do not cover (path/coverage.cl), in a block of paths: those of a block
// are asked, and those that go on are listed and traced again, until none does.

#ifdef CUTOUTS
// Keys of the first `count` paths: 1 where a ray goes on behind its hit, of those that have the key 1.
INLINE void keep_passing(const Block *block, const State *state, __local const float *hits,
                         __local const float *rays, uint count, uint layer, int is_shadow) {
    __local uint *keys = UINT_PLANES(block->memory, KEYS);
    LANES
    for (int i = 0; i < (int)count; i++) {
        const Path path = load_path(state, i);
        const RawHit hit = load_hit(hits, i);
        const Vec3 direction = load_ray(rays, BLOCK_STRIDE, i).direction;
        int passes = passes_hit(block->params, &block->geometry, &block->shading, &path, &hit, direction,
                                layer, is_shadow);
        keys[i] = keys[i] & (uint)passes;
    }
}

// Lists the paths with the key 1; returns how many they are.
INLINE uint list_passing(const Block *block, uint count) {
    const Subset passing =
        subset_where(UINT_PLANES(block->memory, KEYS), 1u, count, UINT_PLANES(block->memory, SUBSETS));
    list_subset(UINT_PLANES(block->memory, LIST), &passing, 0);
    return passing.count;
}

// Follows the rays of the first `count` paths, whose nearest hits are found, up to hits that cover. Rays keep
// their origins, and hits their distances from there.
STAGE void pass_cutouts(const Block *block, uint count) {
    const State *traced = &block->traced;
    __local float *hits = PLANES(block->memory, RAW_HITS);
    __local float *travelled = PLANES(block->memory, TRAVELLED);
    __local uint *keys = UINT_PLANES(block->memory, KEYS);
    __local const uint *list = UINT_PLANES(block->memory, LIST);
    for (uint i = 0; i < count; i++) {
        keys[i] = 1u;
        travelled[i] = 0.0f;
    }
    keep_passing(block, traced, hits, traced->rays, count, 0u, 0);
    uint passing = list_passing(block, count);
    if (passing == 0)
        return;
    for (uint layer = 1u; passing > 0; layer++) {
        LANES
        for (int k = 0; k < (int)passing; k++) {
            const uint i = list[k];
            const RawHit hit = load_hit(hits, i);
            const Ray ray = load_ray(traced->rays, BLOCK_STRIDE, i);
            travelled[i] += hit.distance;
            store3(traced->rays + RAY_ORIGIN_X * BLOCK_STRIDE, BLOCK_STRIDE, i,
                   behind_hit(&block->geometry, &hit, ray.direction));
        }
        interleaved_nearest(block, count, passing);
        if (layer == MOST_LAYERS)
            break;
        keep_passing(block, traced, hits, traced->rays, count, layer, 0);
        passing = list_passing(block, count);
    }
    LANES
    for (int i = 0; i < (int)count; i++) {
        const Ray ray = load_ray(traced->rays, BLOCK_STRIDE, i);
        store3(traced->rays + RAY_ORIGIN_X * BLOCK_STRIDE, BLOCK_STRIDE, i,
               along(ray.origin, -travelled[i], ray.direction));
        hits[RAW_HIT_DISTANCE * BLOCK_STRIDE + i] += travelled[i];
    }
}

#ifdef LIGHT_SAMPLING
// Traces the shadow rays of the first `count` paths that ask for one, and adds what they bring.
STAGE void trace_shadows_through_cutouts(const Block *block, uint count) {
    const State *state = &block->state;
    __local float *hits = PLANES(block->memory, SHADOW_HITS);
    __local float *limits = state->shadows + SHADOW_DISTANCE * BLOCK_STRIDE;
    __local uint *keys = UINT_PLANES(block->memory, KEYS);
    __local const uint *list = UINT_PLANES(block->memory, LIST);
    LANES
    for (int i = 0; i < (int)count; i++) {
        keys[i] = (load_class(state, i) & CLASS_SHADOW) != 0u;
        store_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + i, NO_INDEX);
    }
    uint left = list_passing(block, count);
    for (uint layer = 0u; left > 0; layer++) {
        interleaved_nearest_shadow(block, count, left);
        for (uint k = 0; k < left; k++) {
            const uint i = list[k];
            if (load_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + i) == NO_INDEX)
                accumulate(state, load_result(state, i), load_light_sample(state, i).radiance);
        }
        if (layer == MOST_LAYERS)
            break;
        keep_passing(block, state, hits, state->shadows, count, layer, 1);
        left = list_passing(block, count);
        LANES
        for (int k = 0; k < (int)left; k++) {
            const uint i = list[k];
            const RawHit hit = load_hit(hits, i);
            const Ray ray = load_ray(state->shadows, BLOCK_STRIDE, i);
            limits[i] -= hit.distance;
            store3(state->shadows + SHADOW_ORIGIN_X * BLOCK_STRIDE, BLOCK_STRIDE, i,
                   behind_hit(&block->geometry, &hit, ray.direction));
        }
    }
}
#endif
#endif
