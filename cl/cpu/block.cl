#include "accel/bvh.cl"
#include "cpu/compaction.cl"
#include "path/state.cl"

// A block of paths: what one work-item takes from the camera to the ends of the paths. Its memory is an arena
// of planes, which core/arena.py describes: what they mean, in which phase, and which of them share memory.

// Functions of their own: the compiler is quicker with several small ones, and a profiler tells them apart.
// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
#define STAGE static __attribute__((noinline)) WIDE

typedef struct {
    const Params *params;
    __global const Slot *slots;
    __global const uint *places;
    __global float *path_buffer;
    const Changes *changes; // `touched` begins with the first path of the block
    __global uint *counters;
    uint first, size; // the place of its first path in the path buffer, and how many paths it has
    Geometry geometry;
    Shading shading;
    Emitters emitters;
    BruteForce brute_force;
    State state;  // the paths between their rays
    State traced; // the paths while their rays are traced: rays and paths lie in other planes
    __local float *memory;
} Block;

// The planes of a region of the arena, and the same as unsigned integers.
#define PLANES(memory, region) ((memory) + ARENA_##region * BLOCK_STRIDE)
#define UINT_PLANES(memory, region) ((__local uint *)PLANES(memory, region))

// The place of the first path of a work-item's block, and how many of `path_count` paths it takes.
INLINE uint block_first(void) { return (uint)get_group_id(0) * BLOCK_PATHS; }
INLINE uint block_size(uint path_count) {
    return block_first() < path_count ? MIN(path_count - block_first(), BLOCK_PATHS) : 0;
}

// The block of a kernel with BLOCK_PARAMETERS.
#define BLOCK_OF(params, slots, places, path_buffer, changes, counters, path_count)                          \
    {params,                                                                                                 \
     slots,                                                                                                  \
     places,                                                                                                 \
     path_buffer,                                                                                            \
     changes,                                                                                                \
     counters,                                                                                               \
     block_first(),                                                                                          \
     block_size(path_count),                                                                                 \
     {GEOMETRY_ARGUMENTS},                                                                                   \
     {SHADING_ARGUMENTS},                                                                                    \
     {EMITTERS_ARGUMENTS},                                                                                   \
     {BRUTE_FORCE_ARGUMENTS},                                                                                \
     {PLANES(memory, RAYS), PLANES(memory, PATHS), PLANES(memory, SURFACES), PLANES(memory, SHADOWS),        \
      PLANES(memory, RADIANCE)},                                                                             \
     {PLANES(memory, TRACED_RAYS), PLANES(memory, TRACED_PATHS), 0, 0, PLANES(memory, RADIANCE)},            \
     memory}

// The place in the planes of radiance where a path gathers.
INLINE uint load_result(const State *state, uint path) {
    return load_bits(state->paths, PATH_RESULT * BLOCK_STRIDE + path);
}
INLINE void store_result(const State *state, uint path, uint result) {
    store_bits(state->paths, PATH_RESULT * BLOCK_STRIDE + path, result);
}

INLINE RawHit load_hit(__local const float *hits, uint path) {
    RawHit hit;
    hit.distance = hits[RAW_HIT_DISTANCE * BLOCK_STRIDE + path];
    hit.object = load_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + path);
    hit.triangle = load_bits(hits, RAW_HIT_TRIANGLE * BLOCK_STRIDE + path);
#pragma unroll
    for (uint i = 0; i < 3; i++)
        hit.weight[i] = hits[(RAW_HIT_WEIGHT_A + i) * BLOCK_STRIDE + path];
    return hit;
}

INLINE RawHit load_raw_hit(const Block *block, uint path) {
    return load_hit(PLANES(block->memory, RAW_HITS), path);
}

INLINE void store_hit(__local float *hits, uint path, const RawHit *hit) {
    hits[RAW_HIT_DISTANCE * BLOCK_STRIDE + path] = hit->distance;
    store_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + path, hit->object);
    store_bits(hits, RAW_HIT_TRIANGLE * BLOCK_STRIDE + path, hit->triangle);
#pragma unroll
    for (uint i = 0; i < 3; i++)
        hits[(RAW_HIT_WEIGHT_A + i) * BLOCK_STRIDE + path] = hit->weight[i];
}

INLINE void store_raw_hit(const Block *block, uint path, const RawHit *hit) {
    store_hit(PLANES(block->memory, RAW_HITS), path, hit);
}

// Traversals that keep the top level and the tree of an object on one stack: its size, with room for a whole
// node more, because all its children are written and the stack then grows by those that are met.
#define ONE_STACK_SIZE (BVH_TOP_STACK_SIZE + BVH_STACK_SIZE + 1 + BVH_WIDTH)
// Stands on that stack below the tree of an object: rays leave the space of the object there.
#define LEAVE_OBJECT NODE_EMPTY

// How far traversal of trees looks for the hit of a path. Brute force has left its nearest hit before.
INLINE float nearest_limit(const Block *block, uint path) {
#ifdef BRUTE_FORCE
    return PLANES(block->memory, RAW_HITS)[RAW_HIT_DISTANCE * BLOCK_STRIDE + path];
#else
    return INFINITY;
#endif
}

// Rays are sorted into subsets by the largest component of their direction where brute force tests them,
// because the axes of its tests follow from that. Elsewhere all rays are of one kind.
#ifdef BRUTE_FORCE
#define RAY_KINDS 3
#else
#define RAY_KINDS 1
#endif

// Which of `count` paths have a bit in their class, by the kinds of their `rays`; one subset for each kind.
STAGE void subsets_by_kind(const Block *block, const State *state, __local const float *rays, uint wanted,
                           uint count, Subset *kinds) {
    __local uint *keys = UINT_PLANES(block->memory, KEYS);
    LANES
    for (int i = 0; i < (int)count; i++) {
        uint meant = (load_class(state, i) & wanted) != 0u;
#ifdef BRUTE_FORCE
        uint kind = bvh_main_axis(load_ray(rays, BLOCK_STRIDE, i).direction);
#else
        uint kind = 0u;
#endif
        keys[i] = meant ? kind : NO_INDEX;
    }
    for (uint kind = 0; kind < RAY_KINDS; kind++)
        kinds[kind] =
            subset_where(keys, kind, count, UINT_PLANES(block->memory, SUBSETS) + kind * BLOCK_STRIDE);
}
