// The path tracer for CPUs under PoCL and Intel's runtime: one kernel, in which every work-item takes a block
// of paths from the camera to their ends. The stages are those of the wavefront, as loops over the block, so
// that its state never leaves the nearest caches, and no list goes by way of the host. Where a stage is
// straight-line code, LLVM runs the loop in SIMD lanes.
//
// After each ray the paths that hit something move together, so that the loops which follow go over
// neighbours.

#define BLOCKS
#include "describe.cl"
#include "escape.cl"
#include "flights.cl"
#include "generate.cl"
#include "illuminate.cl"
#include "medium_shade.cl"
#include "shade.cl"
#include "sweep.cl"
#include "trace.cl"

// The iterations are independent of each other, in whatever order. LLVM knows it from a note on the function
// call in the loop, which is lost where an argument is a constant or not used.
#ifdef __clang__
#define LANES _Pragma("clang loop vectorize(assume_safety) vectorize_width(16) interleave(disable)")
#else
#define LANES
#endif

// Functions of their own: the compiler is quicker with several small ones, and a profiler tells them apart.
#define STAGE static __attribute__((noinline)) WIDE

#if defined(FEW_ON_TOP) && defined(ALL_ON_TOP)
#define ALL_SWEPT
#endif

// A work-item's block, and the scene.
typedef struct {
    const Params *params;
    __global const Slot *slots;
    Geometry geometry;
    Emitters emitters;
    __global const float *layers;
    Sweep sweep;
    State state;
    __local uint *results; // the plane PATH_RESULT: where a path gathers
    __local uint *list;    // places of paths, as are the next two
    __local uint *escaped;
    __local uint *by_axis; // three rows
    __local float *spare;  // planes that stages use for themselves; those of `sweep`
} Block;

// Starts the paths from place `first` of the path buffer on.
STAGE void start_paths(const Block *block, uint first, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++) {
        generate_path(block->params, block->slots, &block->state, i, first + i);
        block->results[i] = i;
        store3(block->state.radiance, BLOCK_STRIDE, i, vec3(0.0f, 0.0f, 0.0f));
    }
}

// Puts the places of the paths of a class into `list`; returns how many they are.
STAGE uint list_paths(const Block *block, uint count, uint wanted, __local uint *list) {
    uint listed = 0;
    for (uint i = 0; i < count; i++) {
        list[listed] = i;
        listed += (load_bits(block->state.paths, PATH_CLASS * BLOCK_STRIDE + i) & wanted) != 0u;
    }
    return listed;
}

#ifdef FEW_ON_TOP
// Sorts the paths whose class has a bit by the largest component of their ray; `by_axis` has a row for each.
STAGE void sort_by_axis(const Block *block, __local const float *rays, uint wanted, uint count,
                        uint *counts) {
    __local uint *axes = (__local uint *)block->spare;
    counts[0] = counts[1] = counts[2] = 0;
    LANES
    for (int i = 0; i < (int)count; i++)
        axes[i] = sweep_axis(rays, i);
    for (uint i = 0; i < count; i++) {
        uint axis = axes[i];
        block->by_axis[axis * BLOCK_STRIDE + counts[axis]] = i;
        counts[axis] += (load_bits(block->state.paths, PATH_CLASS * BLOCK_STRIDE + i) & wanted) != 0u;
    }
}

// Of a parallelogram ABCD the sweep leaves the weights of A, B and C, where that of B is against the others
// in the half ACD: as B is A + C - D, those of A, C and D follow.
INLINE void keep_swept(const Sweep *sweep, const State *state, uint place, uint path) {
    __local const float *planes = sweep->planes + place;
    uint index = as_uint(planes[SWEEP_PLACE * BLOCK_STRIDE]);
    int met = index != NO_INDEX;
    __global const Facet *facet = sweep->facets + (met ? index : 0u);
    Vec3 weight = load3(planes + SWEEP_WEIGHT * BLOCK_STRIDE, BLOCK_STRIDE, 0);
    float others = weight.x + weight.z;
    int second = ((weight.y < 0.0f) & (others > 0.0f)) | ((weight.y > 0.0f) & (others < 0.0f));
    weight = choose(second, vec3(weight.x + weight.y, weight.z + weight.y, -weight.y), weight);
    uint triangle = second ? facet->place[1] : facet->place[0];
    uint corner = second ? facet->turns >> 2 : facet->turns & 3u;
    state->hits[HIT_DISTANCE * BLOCK_STRIDE + path] = planes[SWEEP_LIMIT * BLOCK_STRIDE];
    store_bits(state->hits, HIT_OBJECT * BLOCK_STRIDE + path, met ? facet->object : NO_INDEX);
    store_bits(state->hits, HIT_TRIANGLE * BLOCK_STRIDE + path, met ? triangle : NO_INDEX);
    Vec3 turned = choose(corner == 1u, vec3(weight.z, weight.x, weight.y), weight);
    turned = choose(corner == 2u, vec3(weight.y, weight.z, weight.x), turned);
    store3(state->hits + HIT_POSITION_X * BLOCK_STRIDE, BLOCK_STRIDE, path, turned);
}

// What the rays of the live paths meet of the top level.
STAGE void sweep_nearest(const Block *block, uint count) {
    uint counts[3];
    sort_by_axis(block, block->state.rays, CLASS_LIVE, count, counts);
    for (uint axis = 0; axis < 3; axis++) {
        __local const uint *sorted = block->by_axis + axis * BLOCK_STRIDE;
        float limit = INFINITY;
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            sweep_prepare(&block->sweep, i, block->state.rays, sorted[i], axis, limit);
        for (uint first = 0; first < counts[axis]; first += SWEEP_WIDTH)
            sweep_rays(&block->sweep, first, axis);
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            keep_swept(&block->sweep, &block->state, i, sorted[i]);
    }
}
#endif

#ifndef ALL_SWEPT
// Makes the rays in these planes ready for `fly_to_nearest` and `fly_to_lights`.
STAGE void prepare_flights(const Block *block, __local const float *rays, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        flight_prepare(block->spare, rays, i);
}
#endif

// Traces the rays of the live ones of `count` paths; returns how many hit something. Their places come to
// stand in `list`, the places of those that left the scene in `escaped`.
STAGE uint trace_rays(const Block *block, uint count, uint *escaped_count) {
    const State *state = &block->state;
#ifdef FEW_ON_TOP
    sweep_nearest(block, count);
#endif
#ifndef ALL_SWEPT
    prepare_flights(block, state->rays, count);
    fly_to_nearest(&block->geometry, state, block->spare, block->list,
                   list_paths(block, count, CLASS_LIVE, block->list));
#endif
    uint hit_count = 0, missed = 0;
    for (uint i = 0; i < count; i++) {
        uint live = load_bits(state->paths, PATH_CLASS * BLOCK_STRIDE + i) & CLASS_LIVE;
        uint hit = load_bits(state->hits, HIT_OBJECT * BLOCK_STRIDE + i) != NO_INDEX;
        block->list[hit_count] = i;
        block->escaped[missed] = i;
        hit_count += live & hit;
        missed += live & !hit;
    }
    *escaped_count = missed;
    return hit_count;
}

STAGE void escape_paths(const Block *block, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        escape_path(block->params, &block->emitters, &block->state, block->escaped[i],
                    block->results[block->escaped[i]]);
}

#ifdef LIGHT_SAMPLING
#ifdef FEW_ON_TOP
INLINE void occlude_swept(const Sweep *sweep, const State *state, uint place, uint path, uint result) {
    int free = as_uint(sweep->planes[SWEEP_PLACE * BLOCK_STRIDE + place]) == NO_INDEX;
    Vec3 light = load3(state->shadows + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, path);
    gather(state, result, choose(free, light, vec3(0.0f, 0.0f, 0.0f)));
}

// Which shadow rays nothing in the top level is in the way of; returns how many. Their paths come to stand in
// `list`, or, where there is nothing but the top level, gather what they bring.
STAGE uint sweep_shadows(const Block *block, uint count) {
    uint counts[3], free = 0;
    __local const float *shadows = block->state.shadows;
    sort_by_axis(block, shadows, CLASS_SHADOW, count, counts);
    for (uint axis = 0; axis < 3; axis++) {
        __local const uint *sorted = block->by_axis + axis * BLOCK_STRIDE;
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            sweep_prepare(&block->sweep, i, shadows, sorted[i], axis,
                          shadows[SHADOW_DISTANCE * BLOCK_STRIDE + sorted[i]]);
        for (uint first = 0; first < counts[axis]; first += SWEEP_WIDTH)
            sweep_rays(&block->sweep, first, axis);
#ifdef ALL_SWEPT
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            occlude_swept(&block->sweep, &block->state, i, sorted[i], block->results[sorted[i]]);
#else
        for (uint i = 0; i < counts[axis]; i++) {
            block->list[free] = sorted[i];
            free += as_uint(block->sweep.planes[SWEEP_PLACE * BLOCK_STRIDE + i]) == NO_INDEX;
        }
#endif
    }
    return free;
}
#endif

// Traces the shadow rays that paths ask for, and adds what they bring.
STAGE void trace_shadows(const Block *block, uint count) {
#ifdef FEW_ON_TOP
    uint listed = sweep_shadows(block, count);
#else
    uint listed = list_paths(block, count, CLASS_SHADOW, block->list);
#endif
#ifndef ALL_SWEPT
    prepare_flights(block, block->state.shadows, count);
    fly_to_lights(&block->geometry, &block->state, block->spare, block->list, listed);
#endif
}
#endif

// What the places of paths that hit something are told apart by: opaque surfaces come to stand in front.
typedef struct {
    __local uint *surfaces;
    uint surface_count;
    __local uint *media;
    uint media_count;
    __local float *spare; // a plane
} Places;

// Moves a plane of all these paths to the front. Places grow, so that what is read is not overwritten yet.
INLINE void move_plane(__local float *plane, const Places *places) {
#ifdef MEDIA
    LANES
    for (int i = 0; i < (int)places->media_count; i++)
        places->spare[i] = plane[places->media[i]];
#endif
    LANES
    for (int i = 0; i < (int)places->surface_count; i++)
        plane[i] = plane[places->surfaces[i]];
#ifdef MEDIA
    LANES
    for (int i = 0; i < (int)places->media_count; i++)
        plane[places->surface_count + i] = places->spare[i];
#endif
}

STAGE void move_paths(const State *state, const Places *places) {
    for (uint p = RAY_DIRECTION_X; p <= RAY_DIRECTION_Z; p++)
        move_plane(state->rays + p * BLOCK_STRIDE, places);
    for (uint p = 0; p <= PATH_COUNTS; p++)
        move_plane(state->paths + p * BLOCK_STRIDE, places);
    move_plane(state->paths + PATH_RESULT * BLOCK_STRIDE, places);
    for (uint p = HIT_DISTANCE; p <= HIT_POSITION_Z; p++)
        move_plane(state->hits + p * BLOCK_STRIDE, places);
    move_plane(state->hits + HIT_OBJECT * BLOCK_STRIDE, places);
    move_plane(state->hits + HIT_TRIANGLE * BLOCK_STRIDE, places);
#ifdef MEDIA
    move_plane(state->paths + PATH_MEDIUM_0 * BLOCK_STRIDE, places);
    move_plane(state->paths + PATH_MEDIUM_1 * BLOCK_STRIDE, places);
#endif
}

#ifdef MEDIA
// Splits the `count` paths of places->surfaces into those on opaque surfaces and those at or in media.
STAGE void tell_apart(const Block *block, uint count, Places *places) {
    __local uint *classes = (__local uint *)places->spare;
    LANES
    for (int i = 0; i < (int)count; i++)
        classes[i] =
            surface_class(&block->geometry, block->emitters.materials, &block->state, places->surfaces[i]);
    places->surface_count = places->media_count = 0;
    for (uint i = 0; i < count; i++) {
        uint path = places->surfaces[i];
        uint opaque = classes[i] == CLASS_SURFACE;
        places->surfaces[places->surface_count] = path;
        places->media[places->media_count] = path;
        places->surface_count += opaque;
        places->media_count += !opaque;
    }
}
#endif

STAGE void describe_hits(const Block *block, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        describe_path(&block->geometry, &block->state, i);
}

#ifdef MEDIA
// Media shade their paths from place `first` on. Those that stand on an opaque surface after all, by chance,
// are shaded as such.
STAGE void shade_media(const Block *block, uint first, uint count) {
    const State *state = &block->state;
#if defined(LIGHT_SAMPLING) && !defined(SMOOTH_MEDIA)
    LANES
    for (int i = first; i < (int)count; i++)
        illuminate_path(block->params, &block->emitters, state, i);
#endif
    LANES
    for (int i = first; i < (int)count; i++)
        shade_medium_path(block->params, block->emitters.materials, state, i, block->results[i]);
    __local uint *list = block->list;
    uint opaque = 0;
    for (uint i = first; i < count; i++) {
        list[opaque] = i;
        opaque += load_bits(state->paths, PATH_CLASS * BLOCK_STRIDE + i) == CLASS_SURFACE;
    }
#ifdef LIGHT_SAMPLING
    LANES
    for (int i = 0; i < (int)opaque; i++)
        illuminate_path(block->params, &block->emitters, state, list[i]);
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
        illuminate_path(block->params, &block->emitters, &block->state, i);
#endif
    LANES
    for (int i = 0; i < (int)count; i++)
        shade_path(block->params, block->emitters.materials, block->layers, &block->state, i,
                   block->results[i]);
}

// Takes the paths of a block, from place `first` of the path buffer on, from their start to their end.
INLINE void trace_block(const Block *block, uint first, uint count) {
    start_paths(block, first, count);
    for (uint ray = 0; count > 0; ray++) {
        uint escaped_count;
        count = trace_rays(block, count, &escaped_count);
        const float *sky = block->params->environment_color;
        if (sky[0] + sky[1] + sky[2] > 0.0f)
            escape_paths(block, escaped_count);

        Places places = {block->list, count, block->escaped, 0, block->spare};
#ifdef MEDIA
        tell_apart(block, count, &places);
#endif
        move_paths(&block->state, &places);
        describe_hits(block, count);
#ifdef MEDIA
        shade_media(block, places.surface_count, count);
#else
        // Every ray is a scattering event, so that all paths end with the same one.
        if (ray > block->params->max_bounces) {
            finish_paths(block, count);
            return;
        }
#endif
        shade_surfaces(block, places.surface_count);
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
        __local float *hits, __local float *shadows, __local float *radiance, __local uint *list,            \
        __local uint *escaped, __local uint *by_axis, __local float *spare, __global const Facet *facets,    \
        __global const Cluster *clusters, const uint cluster_count

#define BLOCK(params, slots)                                                                                 \
    {params,                                                                                                 \
     slots,                                                                                                  \
     {top_nodes, top_packs, nodes, packs, objects, normals},                                                 \
     {materials, lights, environment_image, environment_marginal, environment_conditional, environment_pdf}, \
     layers,                                                                                                 \
     {facets, clusters, cluster_count, spare},                                                               \
     {rays, paths, hits, shadows, radiance},                                                                 \
     (__local uint *)paths + PATH_RESULT * BLOCK_STRIDE,                                                     \
     list,                                                                                                   \
     escaped,                                                                                                \
     by_axis,                                                                                                \
     spare}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_blocks(const Params params, __global const Slot *slots, BLOCK_PARAMETERS, __global float *path_buffer) {
    const Block block = BLOCK(&params, slots);
    const uint first = (uint)get_group_id(0) * BLOCK_PATHS;
    const uint size = first < params.path_count ? MIN(params.path_count - first, BLOCK_PATHS) : 0;
    trace_block(&block, first, size);
    for (uint c = 0; c < 3; c++)
        for (uint i = 0; i < size; i++)
            path_buffer[c * params.buffer_stride + first + i] = radiance[c * BLOCK_STRIDE + i];
}
