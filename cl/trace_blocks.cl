// The path tracer for CPUs under PoCL: one kernel, in which every work-item takes a block of paths from the
// camera to their ends. The stages are those of the wavefront, as loops over the block, so that its state
// never leaves the nearest caches, and no list goes by way of the host. Where a stage is straight-line code,
// LLVM runs the loop in SIMD lanes.
//
// Rays are traced one by one, since their lanes are boxes and triangles. After each, the paths that hit
// something move together, so that the loops which follow go over neighbours.

#define BLOCKS
#include "describe.cl"
#include "escape.cl"
#include "generate.cl"
#include "illuminate.cl"
#include "medium_shade.cl"
#include "occlude.cl"
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

#ifdef FEW_ON_TOP
// Sorts the paths whose class has a bit by the largest component of their ray; `by_axis` has a row for each.
INLINE void sort_by_axis(const State *state, __local const float *rays, uint wanted, uint count,
                         __local uint *axes, __local uint *by_axis, uint *counts) {
    counts[0] = counts[1] = counts[2] = 0;
    LANES
    for (int i = 0; i < (int)count; i++)
        axes[i] = sweep_axis(rays, i);
    for (uint i = 0; i < count; i++) {
        uint axis = axes[i];
        by_axis[axis * BLOCK_PATHS + counts[axis]] = i;
        counts[axis] += (load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) & wanted) != 0u;
    }
}

INLINE void keep_swept(const Sweep *sweep, const State *state, uint place, uint path) {
    __local const float *planes = sweep->planes + place;
    uint triangle = as_uint(planes[SWEEP_PLACE * BLOCK_PATHS]);
    int met = triangle != NO_INDEX;
    uint pack = met ? triangle & ~NODE_PACK : 0u;
    uint object = sweep->packs[pack / BVH_WIDTH].object[pack % BVH_WIDTH];
    state->hits[HIT_DISTANCE * BLOCK_PATHS + path] = planes[SWEEP_LIMIT * BLOCK_PATHS];
    store_bits(state->hits, HIT_OBJECT * BLOCK_PATHS + path, met ? object : NO_INDEX);
    store_bits(state->hits, HIT_TRIANGLE * BLOCK_PATHS + path, triangle);
    store3(state->hits + HIT_POSITION_X * BLOCK_PATHS, BLOCK_PATHS, path,
           load3(planes + SWEEP_WEIGHT * BLOCK_PATHS, BLOCK_PATHS, 0));
}

// Traces the rays of the `count` live paths; returns how many hit something. Their places come to stand in
// `list`, the places of those that left the scene in `escaped`.
INLINE uint trace_rays(const Geometry *geometry, const Sweep *sweep, const State *state, uint count,
                       __local uint *list, __local uint *escaped, __local uint *by_axis,
                       uint *escaped_count) {
    uint counts[3];
    sort_by_axis(state, state->rays, CLASS_LIVE, count, (__local uint *)sweep->planes, by_axis, counts);
    for (uint axis = 0; axis < 3; axis++) {
        __local const uint *sorted = by_axis + axis * BLOCK_PATHS;
        float limit = INFINITY;
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            sweep_prepare(sweep, i, state->rays, sorted[i], axis, limit);
        for (uint first = 0; first < counts[axis]; first += SWEEP_WIDTH)
            sweep_rays(sweep, first, axis);
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            keep_swept(sweep, state, i, sorted[i]);
#ifndef ALL_ON_TOP
        for (uint i = 0; i < counts[axis]; i++)
            trace_path(geometry, state, sorted[i]);
#endif
    }
    uint hit_count = 0, missed = 0;
    for (uint i = 0; i < count; i++) {
        uint live = load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) & CLASS_LIVE;
        uint hit = load_bits(state->hits, HIT_OBJECT * BLOCK_PATHS + i) != NO_INDEX;
        list[hit_count] = i;
        escaped[missed] = i;
        hit_count += live & hit;
        missed += live & !hit;
    }
    *escaped_count = missed;
    return hit_count;
}
#else
INLINE uint trace_rays(const Geometry *geometry, const Sweep *sweep, const State *state, uint count,
                       __local uint *list, __local uint *escaped, __local uint *by_axis,
                       uint *escaped_count) {
    uint hit_count = 0, missed = 0;
    for (uint i = 0; i < count; i++) {
        if (!(load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) & CLASS_LIVE))
            continue;
        if (trace_path(geometry, state, i))
            list[hit_count++] = i;
        else
            escaped[missed++] = i;
    }
    *escaped_count = missed;
    return hit_count;
}
#endif

#ifdef LIGHT_SAMPLING
// Traces the shadow rays that paths ask for, and adds what they bring.
#ifdef FEW_ON_TOP
INLINE void occlude_swept(const Sweep *sweep, const State *state, uint place, uint path, uint result) {
    int free = as_uint(sweep->planes[SWEEP_PLACE * BLOCK_PATHS + place]) == NO_INDEX;
    Vec3 light = load3(state->shadows + SHADOW_RADIANCE_R * BLOCK_PATHS, BLOCK_PATHS, path);
    gather(state, result, choose(free, light, vec3(0.0f, 0.0f, 0.0f)));
}

INLINE void trace_shadows(const Geometry *geometry, const Sweep *sweep, const State *state, uint count,
                          __local const uint *results, __local uint *by_axis) {
    uint counts[3];
    sort_by_axis(state, state->shadows, CLASS_SHADOW, count, (__local uint *)sweep->planes, by_axis, counts);
    for (uint axis = 0; axis < 3; axis++) {
        __local const uint *sorted = by_axis + axis * BLOCK_PATHS;
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            sweep_prepare(sweep, i, state->shadows, sorted[i], axis,
                          state->shadows[SHADOW_DISTANCE * BLOCK_PATHS + sorted[i]]);
        for (uint first = 0; first < counts[axis]; first += SWEEP_WIDTH)
            sweep_rays(sweep, first, axis);
#ifdef ALL_ON_TOP
        LANES
        for (int i = 0; i < (int)counts[axis]; i++)
            occlude_swept(sweep, state, i, sorted[i], results[sorted[i]]);
#else
        for (uint i = 0; i < counts[axis]; i++)
            if (as_uint(sweep->planes[SWEEP_PLACE * BLOCK_PATHS + i]) == NO_INDEX)
                occlude_path(geometry, state, sorted[i], results[sorted[i]]);
#endif
    }
}
#else
INLINE void trace_shadows(const Geometry *geometry, const Sweep *sweep, const State *state, uint count,
                          __local const uint *results, __local uint *by_axis) {
    for (uint i = 0; i < count; i++)
        if (load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) & CLASS_SHADOW)
            occlude_path(geometry, state, i, results[i]);
}
#endif
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

INLINE void move_paths(const State *state, const Places *places) {
    for (uint p = RAY_DIRECTION_X; p <= RAY_DIRECTION_Z; p++)
        move_plane(state->rays + p * BLOCK_PATHS, places);
    for (uint p = 0; p <= PATH_COUNTS; p++)
        move_plane(state->paths + p * BLOCK_PATHS, places);
    move_plane(state->paths + PATH_RESULT * BLOCK_PATHS, places);
    for (uint p = HIT_DISTANCE; p <= HIT_POSITION_Z; p++)
        move_plane(state->hits + p * BLOCK_PATHS, places);
    move_plane(state->hits + HIT_OBJECT * BLOCK_PATHS, places);
    move_plane(state->hits + HIT_TRIANGLE * BLOCK_PATHS, places);
#ifdef MEDIA
    move_plane(state->paths + PATH_MEDIUM_0 * BLOCK_PATHS, places);
    move_plane(state->paths + PATH_MEDIUM_1 * BLOCK_PATHS, places);
#endif
}

#ifdef MEDIA
// Splits the `count` paths of places->surfaces into those on opaque surfaces and those at or in media.
INLINE void tell_apart(const Geometry *geometry, __global const Material *materials, const State *state,
                       uint count, Places *places) {
    __local uint *classes = (__local uint *)places->spare;
    LANES
    for (int i = 0; i < (int)count; i++)
        classes[i] = surface_class(geometry, materials, state, places->surfaces[i]);
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

// Media shade their paths from place `first` on. Those that stand on an opaque surface after all, by chance,
// are shaded as such.
INLINE void shade_media(const Params *params, const Emitters *emitters, __global const float *layers,
                        const State *state, uint first, uint count, __local const uint *results,
                        __local uint *list) {
#if defined(LIGHT_SAMPLING) && !defined(SMOOTH_MEDIA)
    LANES
    for (int i = first; i < (int)count; i++)
        illuminate_path(params, emitters, state, i);
#endif
    LANES
    for (int i = first; i < (int)count; i++)
        shade_medium_path(params, emitters->materials, state, i, results[i]);
    uint opaque = 0;
    for (uint i = first; i < count; i++) {
        list[opaque] = i;
        opaque += load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) == CLASS_SURFACE;
    }
#ifdef LIGHT_SAMPLING
    LANES
    for (int i = 0; i < (int)opaque; i++)
        illuminate_path(params, emitters, state, list[i]);
    LANES
    for (int i = 0; i < (int)opaque; i++)
        absorb_light(emitters->materials, state, list[i]);
#endif
    LANES
    for (int i = 0; i < (int)opaque; i++)
        shade_path(params, emitters->materials, layers, state, list[i], results[list[i]]);
}
#endif

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_blocks(const Params params, __global const Slot *slots, __global const Node *top_nodes,
             __global const TrianglePack *top_packs, __global const Node *nodes,
             __global const TrianglePack *packs, __global const Object *objects,
             __global const Material *materials, __global const float *normals, __global const float *layers,
             __global const float *lights, __global const float *environment_image,
             __global const float *environment_marginal, __global const float *environment_conditional,
             __global const float *environment_pdf, __local float *rays, __local float *paths,
             __local float *hits, __local float *shadows, __local float *radiance, __local uint *list,
             __local uint *escaped, __local uint *by_axis, __local float *swept,
             __global const float *top_bounds, const uint top_pack_count, __global float *path_buffer) {
    const State state = {rays, paths, hits, shadows, radiance, BLOCK_PATHS, BLOCK_PATHS};
    const Geometry geometry = {top_nodes, top_packs, nodes, packs, objects, normals};
    const Emitters emitters = {
        materials, lights, environment_image, environment_marginal, environment_conditional, environment_pdf};
    const Sweep sweep = {top_packs, top_bounds, top_pack_count, swept};
    const uint first = (uint)get_group_id(0) * BLOCK_PATHS;
    const uint size = first < params.path_count ? MIN(params.path_count - first, BLOCK_PATHS) : 0;
    __local uint *results = (__local uint *)paths + PATH_RESULT * BLOCK_PATHS;

    LANES
    for (int i = 0; i < (int)size; i++) {
        generate_path(&params, slots, &state, i, first + i);
        store_bits(paths, PATH_RESULT * BLOCK_PATHS + i, i);
        store3(radiance, BLOCK_PATHS, i, vec3(0.0f, 0.0f, 0.0f));
    }
    uint count = size;
    for (uint ray = 0; count > 0; ray++) {
        uint escaped_count;
        count = trace_rays(&geometry, &sweep, &state, count, list, escaped, by_axis, &escaped_count);
        if (params.environment_color[0] + params.environment_color[1] + params.environment_color[2] > 0.0f) {
            LANES
            for (int i = 0; i < (int)escaped_count; i++)
                escape_path(&params, &emitters, &state, escaped[i], results[escaped[i]]);
        }
        Places places = {list, count, escaped, 0, swept};
#ifdef MEDIA
        tell_apart(&geometry, materials, &state, count, &places);
#endif
        move_paths(&state, &places);
        LANES
        for (int i = 0; i < (int)count; i++)
            describe_path(&geometry, &state, i);

#ifndef MEDIA
        // Every ray is a scattering event, so that all paths end with the same one.
        if (ray > params.max_bounces) {
            LANES
            for (int i = 0; i < (int)count; i++)
                finish_path(materials, &state, i, results[i]);
            break;
        }
#endif
        const uint surfaces = places.surface_count;
#ifdef MEDIA
        shade_media(&params, &emitters, layers, &state, surfaces, count, results, list);
#endif
#ifdef LIGHT_SAMPLING
        LANES
        for (int i = 0; i < (int)surfaces; i++)
            illuminate_path(&params, &emitters, &state, i);
#endif
        LANES
        for (int i = 0; i < (int)surfaces; i++)
            shade_path(&params, materials, layers, &state, i, results[i]);
#ifdef LIGHT_SAMPLING
        trace_shadows(&geometry, &sweep, &state, count, results, by_axis);
#endif
    }
    for (uint c = 0; c < 3; c++)
        for (uint i = 0; i < size; i++)
            path_buffer[c * params.buffer_stride + first + i] = radiance[c * BLOCK_PATHS + i];
}
