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
#include "trace.cl"

// The iterations are independent of each other, in whatever order. LLVM knows it from a note on the function
// call in the loop, which is lost where an argument is a constant or not used.
#ifdef __clang__
#define LANES _Pragma("clang loop vectorize(assume_safety) vectorize_width(16) interleave(disable)")
#else
#define LANES
#endif

// LLVM 14 keeps to registers of 256 bits unless it is told that the code needs wider ones.
#ifdef __AVX512F__
#define WIDE __attribute__((min_vector_width(512)))
#else
#define WIDE
#endif

// Traces the rays of the `count` live paths; returns how many hit something. Their places come to stand in
// `list`, their hits next to each other; the places of those that left the scene follow in `escaped`.
INLINE uint trace_rays(const Geometry *geometry, const State *state, uint count, __local uint *list,
                       __local uint *escaped, uint *escaped_count) {
    uint hit_count = 0, missed = 0;
    for (uint i = 0; i < count; i++) {
        if (!(load_bits(state->paths, PATH_CLASS * BLOCK_PATHS + i) & CLASS_LIVE))
            continue;
        if (trace_path(geometry, state, i, hit_count))
            list[hit_count++] = i;
        else
            escaped[missed++] = i;
    }
    *escaped_count = missed;
    return hit_count;
}

// Moves plane p of the paths in `list`, which is sorted, to the front.
INLINE void move_plane(__local float *plane, __local const uint *list, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        plane[i] = plane[list[i]];
}

INLINE void move_paths(const State *state, __local const uint *list, uint count) {
    for (uint p = RAY_DIRECTION_X; p <= RAY_DIRECTION_Z; p++)
        move_plane(state->rays + p * BLOCK_PATHS, list, count);
    for (uint p = 0; p < PATH_CLASS; p++)
        move_plane(state->paths + p * BLOCK_PATHS, list, count);
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_blocks(const Params params, __global const Slot *slots, __global const Node *top_nodes,
             __global const TrianglePack *top_packs, __global const Node *nodes,
             __global const TrianglePack *packs, __global const Object *objects,
             __global const Material *materials, __global const float *normals, __global const float *layers,
             __global const float *lights, __global const float *environment_image,
             __global const float *environment_marginal, __global const float *environment_conditional,
             __global const float *environment_pdf, __local float *rays, __local float *paths,
             __local float *hits, __local float *shadows, __local float *radiance, __local uint *list,
             __local uint *escaped, __global float *path_buffer) {
    const State state = {rays, paths, hits, shadows, radiance, BLOCK_PATHS, BLOCK_PATHS};
    const Geometry geometry = {top_nodes, top_packs, nodes, packs, objects, normals};
    const Emitters emitters = {
        materials, lights, environment_image, environment_marginal, environment_conditional, environment_pdf};
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
        count = trace_rays(&geometry, &state, count, list, escaped, &escaped_count);
        if (params.environment_color[0] + params.environment_color[1] + params.environment_color[2] > 0.0f) {
            LANES
            for (int i = 0; i < (int)escaped_count; i++)
                escape_path(&params, &emitters, &state, escaped[i], results[escaped[i]]);
        }
        move_paths(&state, list, count);
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
#ifdef LIGHT_SAMPLING
        LANES
        for (int i = 0; i < (int)count; i++)
            illuminate_path(&params, &emitters, &state, i);
#endif
#ifdef MEDIA
        uint surfaces = 0;
        for (uint i = 0; i < count; i++) {
            uint path_class = surface_class(materials, &state, i);
            if (path_class == CLASS_MEDIUM) {
                shade_medium_path(&params, materials, &state, i, results[i]);
                path_class = load_bits(paths, PATH_CLASS * BLOCK_PATHS + i);
            }
            if (path_class == CLASS_SURFACE)
                list[surfaces++] = i;
        }
        LANES
        for (int i = 0; i < (int)surfaces; i++)
            shade_path(&params, materials, layers, &state, list[i], results[list[i]]);
#else
        LANES
        for (int i = 0; i < (int)count; i++)
            shade_path(&params, materials, layers, &state, i, results[i]);
#endif
#ifdef LIGHT_SAMPLING
        for (uint i = 0; i < count; i++)
            if (load_bits(paths, PATH_CLASS * BLOCK_PATHS + i) & CLASS_SHADOW)
                occlude_path(&geometry, &state, i, results[i]);
#endif
    }
    for (uint c = 0; c < 3; c++)
        for (uint i = 0; i < size; i++)
            path_buffer[c * params.buffer_stride + first + i] = radiance[c * BLOCK_PATHS + i];
}
