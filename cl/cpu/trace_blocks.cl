// The path tracer for CPUs under PoCL and Intel's runtime: one kernel, in which every work-item takes a block
// of paths from the camera to their ends. The stages are those of the wavefront, as loops over the block, so
// that its state never leaves the nearest caches, and no list goes by way of the host. Where a stage is
// straight-line code, LLVM runs the loop in SIMD lanes.
//
// Before each ray the paths that live move together, behind it those that hit something, so that the loops
// which follow go over neighbours.

#define BLOCKS
#if defined(BRUTE_FORCE) && defined(TOP_LEVEL_ONLY)
#define BRUTE_FORCE_ONLY
#endif
#include "path/setup_surface.cl"
#include "path/shade_miss.cl"
#include "cpu/interleaved.cl"
#include "path/generate.cl"
#include "path/sample_lights.cl"
#include "path/shade_medium.cl"
#include "cpu/packets.cl"
#include "cpu/compaction.cl"
#include "path/shade.cl"
#include "cpu/brute_force.cl"
#include "path/trace.cl"

// Functions of their own: the compiler is quicker with several small ones, and a profiler tells them apart.
#define STAGE static __attribute__((noinline)) WIDE

// Which planes of a path outlive its ray.
#ifdef MEDIA
#define LAST_CARRIED PATH_MEDIUM_1
#else
#define LAST_CARRIED PATH_RESULT
#endif

// A work-item's block, and the scene.
//
// Before each ray those paths that are still alive come to stand in front, sorted by the largest component of
// their direction where rays are swept; behind it those that have hit something do. Rays and paths lie in
// one of two places: where shadow rays and the description of hits are kept else, while rays are traced, and
// in planes of their own.
typedef struct {
    const Params *params;
    __global const Slot *slots;
    Geometry geometry;
    Emitters emitters;
    __global const float *layers;
    BruteForce brute_force;
    State state;
    __local float *own_rays; // where rays and paths lie, but while rays are traced
    __local float *own_paths;
    __local uint *results; // the plane PATH_RESULT: where a path gathers
    __local uint *list;    // places of paths
    __local uint *words;   // of what is picked, as are the next three
    __local uint *rows;
    __local float *spare; // planes that stages use for themselves
} Block;

// There is room for rays and paths beside what is known of hits while rays are traced.
typedef char assert_room[SHADOW_PLANES + HIT_DISTANCE >= RAY_PLANES + LAST_CARRIED + 1 ? 1 : -1];

INLINE void place_paths(Block *block, __local float *rays, __local float *paths) {
    block->state.rays = rays;
    block->state.paths = paths;
    block->results = (__local uint *)paths + PATH_RESULT * BLOCK_STRIDE;
}

// Starts the paths from place `first` of the path buffer on.
STAGE void start_paths(const Block *block, uint first, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++) {
        generate_path(block->params, block->slots, &block->state, i, first + i);
        block->results[i] = i;
        store3(block->state.radiance, BLOCK_STRIDE, i, vec3(0.0f, 0.0f, 0.0f));
    }
}

#ifdef BRUTE_FORCE
#define LIVE_KINDS 3 // by the largest component of the direction
#else
#define LIVE_KINDS 1
#endif

// Which of `count` paths have a bit in their class, by the kinds of their rays; in the lanes.
STAGE void subsets_by_axis(const Block *block, __local const float *rays, uint wanted, uint count,
                           Subset *kinds) {
    __local uint *keys = (__local uint *)block->spare;
    LANES
    for (int i = 0; i < (int)count; i++) {
        uint meant = (load_bits(block->state.paths, PATH_CLASS * BLOCK_STRIDE + i) & wanted) != 0u;
#ifdef BRUTE_FORCE
        uint kind = bvh_main_axis(load3(rays + 3 * BLOCK_STRIDE, BLOCK_STRIDE, i));
#else
        uint kind = 0u;
#endif
        keys[i] = meant ? kind : NO_INDEX;
    }
    for (uint kind = 0; kind < LIVE_KINDS; kind++)
        kinds[kind] = subset_where(keys, kind, count, block->rows + kind * BLOCK_STRIDE);
}

// Moves the live ones of `count` paths to where they are traced, kind after kind; returns how many they are.
STAGE uint compact_live(Block *block, uint count, Subset *kinds) {
    State *state = &block->state;
    subsets_by_axis(block, state->rays, CLASS_LIVE, count, kinds);
    for (uint kind = 0; kind < LIVE_KINDS; kind++)
        if (kinds[kind].count == count)
            return count; // they are there already
    __local float *rays = state->shadows, *paths = rays + RAY_PLANES * BLOCK_STRIDE;
    uint live = 0;
    for (uint kind = 0; kind < LIVE_KINDS; kind++) {
        for (uint p = 0; p < RAY_PLANES; p++)
            compact_plane(rays + p * BLOCK_STRIDE + live, state->rays + p * BLOCK_STRIDE, &kinds[kind]);
        for (uint p = 0; p <= LAST_CARRIED; p++)
            compact_plane(paths + p * BLOCK_STRIDE + live, state->paths + p * BLOCK_STRIDE, &kinds[kind]);
        live += kinds[kind].count;
    }
    place_paths(block, rays, paths);
    return live;
}

#ifdef BRUTE_FORCE
// Weights of the corners A, B and C of a side of a parallelepiped; `at`: local coordinates.
INLINE Vec3 side_weights(uint turns, Vec3 at) {
    uint along = turns >> 4;
    float to_b = bvh_component(at, along & 3u), to_d = bvh_component(at, along >> 3 & 3u);
    to_b = along & 4u ? 1.0f - to_b : to_b;
    to_d = along & 32u ? 1.0f - to_d : to_d;
    return vec3(1.0f - to_b, to_b - to_d, to_d);
}

// Of a parallelogram ABCD the sweep leaves the weights of A, B and C, where that of B is against the others
// in the half ACD: as B is A + C - D, those of A, C and D follow.
INLINE void store_brute_force_hit(const BruteForce *brute_force, const State *state,
                                  __local const float *found, uint path) {
    uint place = load_bits(found, FOUND_PLACE * BLOCK_STRIDE + path);
    Vec3 weight = load3(found + FOUND_WEIGHT * BLOCK_STRIDE, BLOCK_STRIDE, path);
    int met = place != NO_INDEX;
    int side = met & ((place & FOUND_SIDE) != 0u);
    uint index = side ? place & ((1u << FOUND_AXIS_SHIFT) - 1u) : met ? place : 0u;
    int opposite = side & (bvh_component(weight, place >> FOUND_AXIS_SHIFT & 3u) > 0.5f);
    index += opposite ? 1u : 0u;
    __global const Quad *quad = brute_force->quads + index;
    uint turns = quad->turns;
    weight = select(side, side_weights(turns, weight), weight);
    float others = weight.x + weight.z;
    int second = ((weight.y < 0.0f) & (others > 0.0f)) | ((weight.y > 0.0f) & (others < 0.0f));
    weight = select(second, vec3(weight.x + weight.y, weight.z + weight.y, -weight.y), weight);
    uint triangle = second ? quad->place[1] : quad->place[0];
    uint corner = (second ? turns >> 2 : turns) & 3u;
    state->hits[HIT_DISTANCE * BLOCK_STRIDE + path] = found[FOUND_DISTANCE * BLOCK_STRIDE + path];
    store_bits(state->hits, HIT_OBJECT * BLOCK_STRIDE + path, met ? quad->object : NO_INDEX);
    store_bits(state->hits, HIT_TRIANGLE * BLOCK_STRIDE + path, met ? triangle : NO_INDEX);
    Vec3 turned = select(corner == 1u, vec3(weight.z, weight.x, weight.y), weight);
    turned = select(corner == 2u, vec3(weight.y, weight.z, weight.x), turned);
    store3(state->hits + HIT_POSITION_X * BLOCK_STRIDE, BLOCK_STRIDE, path, turned);
}

// What the rays of `count` paths meet of the top level.
STAGE void trace_brute_force(const Block *block, uint count, const Subset *kinds) {
    uint first = 0;
    for (uint axis = 0; axis < 3; axis++) {
        brute_force_nearest(&block->brute_force, block->state.rays + first, axis, kinds[axis].count,
                            block->spare + first);
        first += kinds[axis].count;
    }
    LANES
    for (int i = 0; i < (int)count; i++)
        store_brute_force_hit(&block->brute_force, &block->state, block->spare, i);
}
#endif

#ifndef BRUTE_FORCE_ONLY
// Makes the rays in these planes ready for `interleaved_nearest` and `interleaved_any`.
STAGE void prepare_rays(const Block *block, __local const float *rays, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        prepare_ray(block->spare, rays, i);
}
#endif

// Traces the rays of the live ones of `count` paths; returns how many they are. They come to stand in front.
// `from_camera` tells whether neighbours go much the same way.
STAGE uint trace_rays(Block *block, uint count, bool from_camera) {
    Subset kinds[LIVE_KINDS];
    const uint live = compact_live(block, count, kinds);
#ifdef BRUTE_FORCE
    trace_brute_force(block, live, kinds);
#endif
#ifndef BRUTE_FORCE_ONLY
    uint listed = live;
#ifdef PACKETS
    if (from_camera)
        listed = packet_nearest(&block->geometry, &block->state, block->list, live);
    else
#endif
        for (uint i = 0; i < live; i++)
            block->list[i] = i;
    if (listed > 0)
        prepare_rays(block, block->state.rays, live);
    interleaved_nearest(&block->geometry, &block->state, block->spare, block->list, listed);
#endif
    return live;
}

// What rays have led paths to.
typedef struct {
    Subset misses, surfaces, media;
} RayEnds;

#define KEY_MISS 0
#define KEY_SURFACE 1
#define KEY_MEDIUM 2

STAGE void sort_by_ends(const Block *block, uint count, RayEnds *ends) {
    __local uint *keys = (__local uint *)block->spare;
    LANES
    for (int i = 0; i < (int)count; i++) {
        uint hit = load_bits(block->state.hits, HIT_OBJECT * BLOCK_STRIDE + i) != NO_INDEX;
#ifdef MEDIA
        uint medium =
            surface_class(&block->geometry, block->emitters.materials, &block->state, i) == CLASS_MEDIUM;
        keys[i] = hit ? (medium ? KEY_MEDIUM : KEY_SURFACE) : KEY_MISS;
#else
        keys[i] = hit ? KEY_SURFACE : KEY_MISS;
#endif
    }
    ends->misses = subset_where(keys, KEY_MISS, count, block->rows);
    ends->surfaces = subset_where(keys, KEY_SURFACE, count, block->rows + BLOCK_STRIDE);
#ifdef MEDIA
    ends->media = subset_where(keys, KEY_MEDIUM, count, block->rows + 2 * BLOCK_STRIDE);
#endif
}

STAGE void shade_misses(const Block *block, const Subset *misses) {
    list_subset(block->list, misses, 0);
    LANES
    for (int i = 0; i < (int)misses->count; i++)
        shade_miss_path(block->params, &block->emitters, &block->state, block->list[i],
                        block->results[block->list[i]]);
}

// Moves a plane of all paths that have hit something, those on opaque surfaces in front.
INLINE void compact_hit_plane(__local float *to, __local const float *from, const RayEnds *ends,
                              __local float *spare) {
#ifdef MEDIA
    compact_plane(spare, from, &ends->media);
#endif
    compact_plane(to, from, &ends->surfaces);
#ifdef MEDIA
    for (uint first = 0; first < ends->media.count; first += LANE_COUNT)
        store_lanes(to + ends->surfaces.count + first, load_lanes(spare + first));
#endif
}

// Moves those paths to their own planes; returns how many they are.
STAGE uint compact_hits(Block *block, const RayEnds *ends) {
    const State *state = &block->state;
    __local float *rays = block->own_rays, *paths = block->own_paths, *spare = block->spare;
    for (uint p = RAY_DIRECTION_X; p <= RAY_DIRECTION_Z; p++)
        compact_hit_plane(rays + p * BLOCK_STRIDE, state->rays + p * BLOCK_STRIDE, ends, spare);
    for (uint p = 0; p <= LAST_CARRIED; p++)
        compact_hit_plane(paths + p * BLOCK_STRIDE, state->paths + p * BLOCK_STRIDE, ends, spare);
    for (uint p = HIT_DISTANCE; p <= HIT_TRIANGLE; p++)
        if (p != HIT_MATERIAL)
            compact_hit_plane(state->hits + p * BLOCK_STRIDE, state->hits + p * BLOCK_STRIDE, ends, spare);
    place_paths(block, rays, paths);
#ifdef MEDIA
    return ends->surfaces.count + ends->media.count;
#else
    return ends->surfaces.count;
#endif
}

#ifdef LIGHT_SAMPLING
#ifdef BRUTE_FORCE
// Planes of shadow rays that are swept: those of ShadowPlane up to the radiance that they bring, and where
// that is gathered.
#define SHADOW_RESULT SHADOW_PDF
#define SHADOW_FOUND (SHADOW_RESULT + 1 - FOUND_PLACE)

INLINE void add_unoccluded(const State *state, __local const float *rays, __local const float *found,
                           uint i) {
    int free = load_bits(found, FOUND_PLACE * BLOCK_STRIDE + i) == NO_INDEX;
    Vec3 light = load3(rays + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, i);
    accumulate(state, load_bits(rays, SHADOW_RESULT * BLOCK_STRIDE + i),
               select(free, light, vec3(0.0f, 0.0f, 0.0f)));
}

// Which shadow rays nothing in the top level is in the way of; returns how many. Their paths come to stand in
// `list`, or, where there is nothing but the top level, gather what they bring.
STAGE uint shadows_by_brute_force(const Block *block, uint count) {
    Subset kinds[3];
    const State *state = &block->state;
    __local float *rays = block->spare, *found = rays + SHADOW_FOUND * BLOCK_STRIDE;
    uint free = 0;
    subsets_by_axis(block, state->shadows, CLASS_SHADOW, count, kinds);
    for (uint axis = 0; axis < 3; axis++) {
        const Subset *subset = &kinds[axis];
        for (uint p = 0; p < SHADOW_PDF; p++)
            compact_plane(rays + p * BLOCK_STRIDE, state->shadows + p * BLOCK_STRIDE, subset);
        brute_force_any(&block->brute_force, rays, axis, subset->count, found);
#ifdef BRUTE_FORCE_ONLY
        compact_plane(rays + SHADOW_RESULT * BLOCK_STRIDE, (__local const float *)block->results, subset);
        LANES
        for (int i = 0; i < (int)subset->count; i++)
            add_unoccluded(state, rays, found, i);
#else
        __local uint *paths = (__local uint *)rays; // which are done with
        list_subset(paths, subset, 0);
        const Subset unmet = subset_where((__local const uint *)found + FOUND_PLACE * BLOCK_STRIDE, NO_INDEX,
                                          subset->count, block->words);
        compact_plane((__local float *)block->list + free, (__local const float *)paths, &unmet);
        free += unmet.count;
#endif
    }
    return free;
}
#endif

// Traces the shadow rays that paths ask for, and adds what they bring.
STAGE void trace_shadows(const Block *block, uint count) {
#ifdef BRUTE_FORCE
    uint listed = shadows_by_brute_force(block, count);
#else
    Subset subset;
    subsets_by_axis(block, block->state.shadows, CLASS_SHADOW, count, &subset);
    list_subset(block->list, &subset, 0);
    uint listed = subset.count;
#endif
#ifndef BRUTE_FORCE_ONLY
    prepare_rays(block, block->state.shadows, count);
    interleaved_any(&block->geometry, &block->state, block->spare, block->list, listed);
#endif
}
#endif

STAGE void setup_surfaces(const Block *block, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        setup_surface_path(&block->geometry, &block->state, i);
}

#ifdef MEDIA
// Media shade their paths from place `first` on. Those that stand on an opaque surface after all, by chance,
// are shaded as such.
STAGE void shade_media(const Block *block, uint first, uint count) {
    const State *state = &block->state;
#if defined(LIGHT_SAMPLING) && !defined(SMOOTH_MEDIA)
    LANES
    for (int i = first; i < (int)count; i++)
        sample_lights_path(block->params, &block->emitters, state, i);
#endif
    LANES
    for (int i = first; i < (int)count; i++)
        shade_medium_path(block->params, block->emitters.materials, state, i, block->results[i]);
    __local const uint *classes = (__local const uint *)state->paths + PATH_CLASS * BLOCK_STRIDE;
    const Subset subset = subset_where(classes + first, CLASS_SURFACE, count - first, block->words);
    __local uint *list = block->list;
    list_subset(list, &subset, first);
    const uint opaque = subset.count;
#ifdef LIGHT_SAMPLING
    LANES
    for (int i = 0; i < (int)opaque; i++)
        sample_lights_path(block->params, &block->emitters, state, list[i]);
    LANES
    for (int i = 0; i < (int)opaque; i++)
        absorb_light(block->emitters.materials, state, list[i]);
#endif
    LANES
    for (int i = 0; i < (int)opaque; i++)
        shade_path(block->params, block->emitters.materials, block->layers, state, list[i],
                   block->results[list[i]]);
}
#else
STAGE void finish_paths(const Block *block, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        finish_path(block->emitters.materials, &block->state, i, block->results[i]);
}
#endif

STAGE void shade_surfaces(const Block *block, uint count) {
#ifdef LIGHT_SAMPLING
    LANES
    for (int i = 0; i < (int)count; i++)
        sample_lights_path(block->params, &block->emitters, &block->state, i);
#endif
    LANES
    for (int i = 0; i < (int)count; i++)
        shade_path(block->params, block->emitters.materials, block->layers, &block->state, i,
                   block->results[i]);
}

// Takes the paths of a block, from place `first` of the path buffer on, from their start to their end.
INLINE void trace_block(Block *block, uint first, uint count) {
    start_paths(block, first, count);
    for (uint ray = 0; count > 0; ray++) {
        count = trace_rays(block, count, ray == 0);
        RayEnds ends;
        sort_by_ends(block, count, &ends);
        const float *sky = block->params->environment_color;
        if (sky[0] + sky[1] + sky[2] > 0.0f)
            shade_misses(block, &ends.misses);
        count = compact_hits(block, &ends);
        setup_surfaces(block, count);
#ifdef MEDIA
        shade_media(block, ends.surfaces.count, count);
#else
        // Every ray is a scattering event, so that all paths end with the same one.
        if (ray > block->params->max_bounces) {
            finish_paths(block, count);
            return;
        }
#endif
        shade_surfaces(block, ends.surfaces.count);
#ifdef LIGHT_SAMPLING
        trace_shadows(block, count);
#endif
    }
}

// The parameters of a kernel over blocks, as `wavefront.block_arguments` gives them: the scene, and memory
// for a block.
#define BLOCK_PARAMETERS                                                                                     \
    __global const Node *top_nodes, __global const TrianglePack *top_packs, __global const Node *nodes,      \
        __global const TrianglePack *packs, __global const Object *objects,                                  \
        __global const Material *materials, __global const float *normals, __global const float *layers,     \
        __global const float *lights, __global const float *environment_image,                               \
        __global const float *environment_marginal, __global const float *environment_conditional,           \
        __global const float *environment_pdf, __local float *rays, __local float *paths,                    \
        __local float *shadows_and_hits, __local float *radiance, __local uint *list, __local uint *words,   \
        __local uint *rows, __local float *spare, __global const Quad *quads,                                \
        __global const Parallelepiped *parallelepipeds, __global const Cluster *clusters,                    \
        const uint cluster_count

#define BLOCK(params, slots)                                                                                 \
    {params,                                                                                                 \
     slots,                                                                                                  \
     {top_nodes, top_packs, nodes, packs, objects, normals},                                                 \
     {materials, lights, environment_image, environment_marginal, environment_conditional, environment_pdf}, \
     layers,                                                                                                 \
     {quads, parallelepipeds, clusters, cluster_count},                                                      \
     {rays, paths, shadows_and_hits + SHADOW_PLANES * BLOCK_STRIDE, shadows_and_hits, radiance},             \
     rays,                                                                                                   \
     paths,                                                                                                  \
     (__local uint *)paths + PATH_RESULT * BLOCK_STRIDE,                                                     \
     list,                                                                                                   \
     words,                                                                                                  \
     rows,                                                                                                   \
     spare}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_blocks(const Params params, __global const Slot *slots, BLOCK_PARAMETERS, __global float *path_buffer) {
    Block block = BLOCK(&params, slots);
    const uint first = (uint)get_group_id(0) * BLOCK_PATHS;
    const uint size = first < params.path_count ? MIN(params.path_count - first, BLOCK_PATHS) : 0;
    trace_block(&block, first, size);
    for (uint c = 0; c < 3; c++)
        for (uint i = 0; i < size; i++)
            path_buffer[c * params.buffer_stride + first + i] = radiance[c * BLOCK_STRIDE + i];
}
