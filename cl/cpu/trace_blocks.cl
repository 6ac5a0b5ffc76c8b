// The path tracer for CPUs under PoCL and Intel's runtime: one kernel, in which every work-item takes a block
// of paths from the camera to their ends. The stages are those of the wavefront, as loops over the block, so
// that its state never leaves the nearest caches, and no list goes by way of the host. Where a stage is
// straight-line code, LLVM runs the loop in SIMD lanes. In which order they follow each other, and when, is
// declared for both in incpt/core/stages.py; the functions that it names stand here in that order.
//
// Paths move together twice for each ray, so that loops go over neighbours: before the ray those that are
// still alive, to the planes in which they are traced; behind it those that have hit something, back to their
// own.

#define BLOCKS
// There is nothing but what is tested without a tree.
#if defined(BRUTE_FORCE) && defined(TOP_LEVEL_ONLY)
#define BRUTE_FORCE_ONLY
#endif
#include "path/tangents.cl"
#include "path/setup_surface.cl"
#include "path/shade_light.cl"
#include "path/shade_miss.cl"
#include "cpu/interleaved.cl"
#ifdef CUTOUTS
#include "cpu/cutouts.cl"
#endif
#include "path/generate.cl"
#include "path/sample_lights.cl"
#include "path/shade_medium.cl"
#include "cpu/packets.cl"
#include "cpu/meet_lights.cl"
#include "path/shade.cl"
#ifdef AOVS
#include "path/write_aovs.cl"
#endif
#ifdef CHANGES
#include "path/touch_lights.cl"
#endif
#ifdef BRUTE_FORCE
#include "cpu/brute_force.cl"
#endif

// The planes of a path up to this one outlive its ray.
#ifdef MEDIA
#define LAST_CARRIED PATH_MEDIUM_1
#else
#define LAST_CARRIED PATH_RESULT
#endif

// One ray of all paths of a block. Loops take their bounds out of it beforehand, since what they write might
// change it for all that the compiler knows.
typedef struct {
    uint number; // 0: it comes from the camera
    // How many paths of the block, from its first place on, are looked at: all those of the ray before; from
    // trace_rays on those that follow this one; from setup_surfaces on those that have hit something.
    uint count;
    // What it has led paths to: nothing, an opaque surface, or a boundary or the inside of a medium. Behind
    // setup_surfaces those on surfaces stand in front, and those in media follow.
    Subset misses, surfaces, media;
#ifdef SHAPED_LIGHTS
    Subset lights; // paths that end on one
#endif
} BlockRay;

// Starts the paths of a block. With params.listed their places stand in a list.
STAGE void start_paths(const Block *block) {
    const uint first = block->first, size = block->size;
    __local uint *list = UINT_PLANES(block->memory, LIST);
    for (uint i = 0; i < size; i++)
        list[i] = block->params->listed ? block->places[first + i] : first + i;
    LANES
    for (int i = 0; i < (int)size; i++) {
        generate_path(block->params, block->slots, &block->state, i, list[i]);
        store_result(&block->state, i, i);
        store3(block->state.radiance, BLOCK_STRIDE, i, vec3(0.0f, 0.0f, 0.0f));
    }
}

// Moves the live ones of `count` paths to where they are traced, kind after kind; returns how many they are.
STAGE uint compact_live(const Block *block, uint count, Subset *kinds) {
    const State *from = &block->state, *to = &block->traced;
    subsets_by_kind(block, from, from->rays, CLASS_LIVE, count, kinds);
    uint live = 0;
    for (uint kind = 0; kind < RAY_KINDS; kind++) {
        for (uint p = 0; p < RAY_PLANES; p++)
            compact_plane(to->rays + p * BLOCK_STRIDE + live, from->rays + p * BLOCK_STRIDE, &kinds[kind]);
        for (uint p = 0; p <= LAST_CARRIED; p++)
            compact_plane(to->paths + p * BLOCK_STRIDE + live, from->paths + p * BLOCK_STRIDE, &kinds[kind]);
#ifdef LIGHT_TREE
        compact_plane(to->paths + PATH_NORMAL * BLOCK_STRIDE + live, from->paths + PATH_NORMAL * BLOCK_STRIDE,
                      &kinds[kind]);
#endif
        live += kinds[kind].count;
    }
    return live;
}

// Finds the nearest hits of the live ones of `count` paths; returns how many they are. They come to stand in
// front. `from_camera` tells whether neighbours go much the same way.
STAGE uint trace_nearest(const Block *block, uint count, bool from_camera) {
    Subset kinds[RAY_KINDS];
    const uint live = compact_live(block, count, kinds);
#ifdef BRUTE_FORCE
    brute_force_nearest(block, live, kinds);
#endif
#ifndef BRUTE_FORCE_ONLY
    __local uint *list = UINT_PLANES(block->memory, LIST);
    uint listed = live;
#ifdef PACKETS
    if (from_camera)
        listed = packet_nearest(block, live);
    else
#endif
        for (uint i = 0; i < live; i++)
            list[i] = i;
    interleaved_nearest(block, live, listed);
#endif
    return live;
}

#define KEY_MISS 0
#define KEY_SURFACE 1
#define KEY_MEDIUM 2
#define KEY_LIGHT 3

#ifdef SHAPED_LIGHTS
// Whether a ray ends on a light.
INLINE uint is_light_hit(uint object) { return ((object & LIGHT_HIT) != 0u) & (object != NO_INDEX); }

#ifndef LIGHT_TREE
// One light after the other, for all rays: those that meet it before all else end there.
STAGE void meet_lights(const Block *block, const BlockRay *ray) {
    const State *traced = &block->traced;
    __local float *hits = PLANES(block->memory, RAW_HITS);
    __local float *distances = hits + RAW_HIT_DISTANCE * BLOCK_STRIDE;
    __local uint *objects = (__local uint *)hits + RAW_HIT_OBJECT * BLOCK_STRIDE;
    const uint count = ray->count, from_camera = ray->number == 0;
    for (uint k = block->params->sun_count; k < block->params->shaped_count; k++) {
        const ShapedLight light = load_shaped_light(block->params, &block->emitters, k);
        if (!may_be_met(light.flags, from_camera, 0.0f))
            continue;
        LANES
        for (int i = 0; i < (int)count; i++) {
            float pdf = traced->paths[PATH_BSDF_PDF * BLOCK_STRIDE + i];
            float limit = objects[i] == NO_INDEX ? INFINITY : distances[i];
            float distance = distance_to_shaped_light(&light, load_ray(traced->rays, BLOCK_STRIDE, i));
            int nearer =
                may_be_met(light.flags, from_camera, pdf) & (distance * (1.0f - LIGHT_AHEAD) < limit);
            distances[i] = nearer ? distance : distances[i];
            objects[i] = nearer ? LIGHT_HIT | k : objects[i];
        }
    }
}
#endif
#endif

// Sorts paths by what their rays have met.
STAGE void classify_hits(const Block *block, BlockRay *ray) {
    __local uint *keys = UINT_PLANES(block->memory, KEYS), *words = UINT_PLANES(block->memory, SUBSETS);
    const uint count = ray->count;
    LANES
    for (int i = 0; i < (int)count; i++) {
        uint object = load_raw_hit(block, i).object;
        uint hit = object != NO_INDEX;
#ifdef MEDIA
        uint medium = hit_class(&block->geometry, block->shading.materials, object,
                                is_in_medium(&block->traced, i)) == CLASS_MEDIUM;
        keys[i] = hit ? (medium ? KEY_MEDIUM : KEY_SURFACE) : KEY_MISS;
#else
        keys[i] = hit ? KEY_SURFACE : KEY_MISS;
#endif
#ifdef SHAPED_LIGHTS
        keys[i] = is_light_hit(object) ? KEY_LIGHT : keys[i];
#endif
    }
    ray->misses = subset_where(keys, KEY_MISS, count, words);
    ray->surfaces = subset_where(keys, KEY_SURFACE, count, words + BLOCK_STRIDE);
#ifdef MEDIA
    ray->media = subset_where(keys, KEY_MEDIUM, count, words + 2 * BLOCK_STRIDE);
#endif
#ifdef SHAPED_LIGHTS
    ray->lights = subset_where(keys, KEY_LIGHT, count, words + 3 * BLOCK_STRIDE);
#endif
}

// The stage `intersect` up to what rays meet.
INLINE void trace_rays(const Block *block, BlockRay *ray) {
    ray->count = trace_nearest(block, ray->count, ray->number == 0);
#ifdef CUTOUTS
    pass_cutouts(block, ray->count);
#endif
#if defined(SHAPED_LIGHTS) && defined(LIGHT_TREE)
    meet_tree_lights(block, ray->count, ray->number == 0);
#elif defined(SHAPED_LIGHTS)
    meet_lights(block, ray);
#endif
    classify_hits(block, ray);
}

#ifdef AOVS
// Notes which of the paths have met something: what it is that they met will soon be forgotten.
STAGE void write_alpha(const Block *block, const BlockRay *ray) {
    const uint size = block->size, count = ray->count;
    __local const uint *keys = UINT_PLANES(block->memory, KEYS);
    __global float *alpha = block->path_buffer + SAMPLE_ALPHA * block->params->buffer_stride + block->first;
    for (uint i = 0; i < size; i++)
        alpha[i] = 0.0f;
    LANES
    for (int i = 0; i < (int)count; i++)
        alpha[load_result(&block->traced, i)] = keys[i] != KEY_MISS ? 1.0f : 0.0f;
}
#endif

#ifdef CHANGES
// Notes which paths have met something that changed, now that their rays are traced.
STAGE void touch_rays(const Block *block, const BlockRay *ray) {
    const State *traced = &block->traced;
    const Changes *changes = block->changes;
    const uint count = ray->count;
    __local const float *limits = PLANES(block->memory, RAW_HITS) + RAW_HIT_DISTANCE * BLOCK_STRIDE;
    for (uint box = 0; box < changes->change.box_count; box += BOXES_AT_ONCE) {
        LANES
        for (int i = 0; i < (int)count; i++)
            touch(changes, load_result(traced, i),
                  crosses_boxes(&changes->change, box, load_ray(traced->rays, BLOCK_STRIDE, i), limits[i]));
    }
    if (changes->change.has_objects) {
        LANES
        for (int i = 0; i < (int)count; i++)
            touch(changes, load_result(traced, i), is_changed(changes, load_raw_hit(block, i).object));
    }
}
#endif

#ifdef SHAPED_LIGHTS
// Adds what lights bring to the paths that end on them.
STAGE void shade_lights(const Block *block, const BlockRay *ray) {
    __local uint *list = UINT_PLANES(block->memory, LIST);
    const uint count = ray->lights.count;
    list_subset(list, &ray->lights, 0);
#ifdef LIGHT_TREE
    weigh_tree_lights(block, count);
#endif
    LANES
    for (int i = 0; i < (int)count; i++) {
        const RawHit hit = load_raw_hit(block, list[i]);
        shade_light_path(block->params, &block->shading, &block->emitters, &block->traced, list[i],
                         load_result(&block->traced, list[i]), hit.object & ~LIGHT_HIT, hit.distance);
    }
}
#endif

STAGE void shade_misses(const Block *block, const BlockRay *ray) {
    __local uint *list = UINT_PLANES(block->memory, LIST);
    const uint count = ray->misses.count;
    list_subset(list, &ray->misses, 0);
    LANES
    for (int i = 0; i < (int)count; i++)
        shade_miss_path(block->params, &block->shading, &block->emitters, &block->traced, list[i],
                        load_result(&block->traced, list[i]));
#ifdef SHAPED_LIGHTS
    for (uint k = 0; k < block->params->sun_count; k++) {
        LANES
        for (int i = 0; i < (int)count; i++)
            shade_sun_path(block->params, &block->shading, &block->emitters, &block->traced, list[i],
                           load_result(&block->traced, list[i]), k);
    }
#endif
}

// Moves a plane of all paths that have hit something, those on opaque surfaces in front.
INLINE void compact_hit_plane(const Block *block, __local float *to, __local const float *from,
                              const BlockRay *ray) {
#ifdef MEDIA
    __local float *moved = PLANES(block->memory, MOVED);
    compact_plane(moved, from, &ray->media);
#endif
    compact_plane(to, from, &ray->surfaces);
#ifdef MEDIA
    for (uint first = 0; first < ray->media.count; first += LANE_COUNT)
        store_lanes(to + ray->surfaces.count + first, load_lanes(moved + first));
#endif
}

// Moves the paths that have hit something back to their own planes; returns how many they are.
STAGE uint compact_hits(const Block *block, const BlockRay *ray) {
    const State *from = &block->traced, *to = &block->state;
    __local float *hits = PLANES(block->memory, RAW_HITS);
    for (uint p = RAY_DIRECTION_X; p <= RAY_DIRECTION_Z; p++)
        compact_hit_plane(block, to->rays + p * BLOCK_STRIDE, from->rays + p * BLOCK_STRIDE, ray);
    for (uint p = 0; p <= LAST_CARRIED; p++)
        compact_hit_plane(block, to->paths + p * BLOCK_STRIDE, from->paths + p * BLOCK_STRIDE, ray);
#ifdef LIGHT_TREE
    compact_hit_plane(block, to->paths + PATH_NORMAL * BLOCK_STRIDE, from->paths + PATH_NORMAL * BLOCK_STRIDE,
                      ray);
#endif
    for (uint p = 0; p < RAW_HIT_PLANES; p++)
        compact_hit_plane(block, hits + p * BLOCK_STRIDE, hits + p * BLOCK_STRIDE, ray);
#ifdef MEDIA
    return ray->surfaces.count + ray->media.count;
#else
    return ray->surfaces.count;
#endif
}

// What of the stage `intersect` is left, for paths that have hit something. A path's hit is read whole before
// its surface is written: the two share memory.
STAGE void setup_surfaces(const Block *block, BlockRay *ray) {
    const uint count = ray->count = compact_hits(block, ray);
    LANES
    for (int i = 0; i < (int)count; i++) {
        const RawHit hit = load_raw_hit(block, i);
        Surface surface = surface_at(&block->geometry, &hit);
#ifndef FLAT
        settle_rise(block->shading.materials, load_ray(block->state.rays, BLOCK_STRIDE, i).direction,
                    &surface);
#endif
        store_surface(&block->state, i, &surface);
    }
#ifdef TANGENTS
    LANES
    for (int i = 0; i < (int)count; i++) {
        Surface surface = load_surface(&block->state, i);
        set_tangents(block->geometry.objects, &block->shading, &surface);
        store_tangents(&block->state, i, &surface);
    }
#endif
}

#ifdef AOVS
// Fills the other auxiliary planes of the path buffer; those that have hit something stand in front.
STAGE void write_aovs(const Block *block, const BlockRay *ray) {
    const uint first = block->first, size = block->size, count = ray->count;
    const uint stride = block->params->buffer_stride;
    __global float *path_buffer = block->path_buffer;
    for (uint p = SAMPLE_ALBEDO_R; p < SAMPLE_ALPHA; p++)
        for (uint i = 0; i < size; i++)
            path_buffer[p * stride + first + i] = 0.0f;
    LANES
    for (int i = 0; i < (int)count; i++)
        write_aovs_path(&block->shading, &block->state, i, path_buffer, stride,
                        first + load_result(&block->state, i));
}
#endif

#ifdef LIGHT_TREE
STAGE void choose_lights(const Block *block, const BlockRay *ray) { choose_block_lights(block, ray->count); }
#endif

#if defined(CHANGES) && (defined(TRIANGLE_LIGHTS) || defined(SHAPED_LIGHTS))
// As touch_rays, of the lights that paths ask for, before they are shaded.
STAGE void touch_lights(const Block *block, const BlockRay *ray) {
    const State *state = &block->state;
    const Changes *changes = block->changes;
    const uint count = ray->count;
    LANES
    for (int i = 0; i < (int)count; i++)
        touch(changes, load_result(state, i),
              asks_for_changed_light(block->params, &block->shading, &block->emitters, state, i));
}
#endif

#ifdef MEDIA
// Shades the paths that have met a medium or are inside of one. Those that turn out to stand on an opaque
// surface are shaded as such. Lights are sampled for those that need it: at a smooth boundary none do, so
// that paths on opaque surfaces get their sample when they are known.
STAGE void shade_media(const Block *block, const BlockRay *ray) {
    const State *state = &block->state;
    const uint first = ray->surfaces.count, count = ray->count;
#if defined(LIGHT_SAMPLING) && !defined(SMOOTH_MEDIA)
    LANES
    for (int i = first; i < (int)count; i++)
        sample_lights_path(block->params, &block->shading, &block->emitters, state, i);
#endif
    LANES
    for (int i = first; i < (int)count; i++)
        shade_medium_path(block->params, &block->shading, state, i, load_result(state, i));
    __local const uint *classes = (__local const uint *)state->paths + PATH_CLASS * BLOCK_STRIDE;
    __local uint *words = UINT_PLANES(block->memory, SUBSETS);
    const uint cut_off = subset_where(classes + first, CLASS_CUT_OFF, count - first, words).count;
    if (cut_off)
        atomic_add(&block->counters[COUNTER_CUT_OFF], cut_off);
    const Subset subset = subset_where(classes + first, CLASS_SURFACE, count - first, words);
    __local uint *list = UINT_PLANES(block->memory, LIST);
    list_subset(list, &subset, first);
    const uint opaque = subset.count;
#ifdef LIGHT_SAMPLING
#ifdef SMOOTH_MEDIA
    LANES
    for (int i = 0; i < (int)opaque; i++)
        sample_lights_path(block->params, &block->shading, &block->emitters, state, list[i]);
#endif
    LANES
    for (int i = 0; i < (int)opaque; i++)
        absorb_light(&block->shading, state, list[i]);
#endif
    LANES
    for (int i = 0; i < (int)opaque; i++)
        shade_path(block->params, &block->shading, state, list[i], load_result(state, list[i]));
}
#endif

// Shades the paths on opaque surfaces, with lights that are sampled here.
STAGE void shade_surfaces(const Block *block, const BlockRay *ray) {
    const uint count = ray->surfaces.count;
#ifdef LIGHT_SAMPLING
    LANES
    for (int i = 0; i < (int)count; i++)
        sample_lights_path(block->params, &block->shading, &block->emitters, &block->state, i);
#endif
    LANES
    for (int i = 0; i < (int)count; i++)
        shade_path(block->params, &block->shading, &block->state, i, load_result(&block->state, i));
}

#ifndef MEDIA
STAGE void finish_paths(const Block *block, BlockRay *ray) {
    const uint count = ray->count;
    LANES
    for (int i = 0; i < (int)count; i++)
        finish_path(block->params, &block->shading, &block->state, i, load_result(&block->state, i));
    ray->count = 0;
}
#endif

#ifdef LIGHT_SAMPLING
#ifdef CHANGES
// As touch_rays, of the shadow rays that are going to be traced.
STAGE void touch_shadow_rays(const Block *block, const BlockRay *ray) {
    const State *state = &block->state;
    const Changes *changes = block->changes;
    const uint count = ray->count;
    __local const float *limits = state->shadows + SHADOW_DISTANCE * BLOCK_STRIDE;
    for (uint box = 0; box < changes->change.box_count; box += BOXES_AT_ONCE) {
        LANES
        for (int i = 0; i < (int)count; i++) {
            int asked = (load_class(state, i) & CLASS_SHADOW) != 0u;
            Ray shadow = load_ray(state->shadows, BLOCK_STRIDE, i);
            // Where there is no shadow ray, its planes hold something else, which is slow to calculate with.
            Vec3 nothing = vec3(0.0f, 0.0f, 0.0f);
            shadow.origin = select(asked, shadow.origin, nothing);
            shadow.direction = select(asked, shadow.direction, nothing);
            uint crossed = crosses_boxes(&changes->change, box, shadow, asked ? limits[i] : 0.0f);
            touch(changes, load_result(state, i), asked ? crossed : 0u);
        }
    }
}
#endif

#if defined(SHAPED_LIGHTS) && !defined(LIGHT_TREE)
// Drops the shadow rays that a light is in the way of, as surfaces are.
STAGE void shade_by_lights(const Block *block, const BlockRay *ray) {
    const State *state = &block->state;
    __local const float *limits = state->shadows + SHADOW_DISTANCE * BLOCK_STRIDE;
    const uint count = ray->count;
    for (uint k = block->params->sun_count; k < block->params->shaped_count; k++) {
        const ShapedLight light = load_shaped_light(block->params, &block->emitters, k);
        if (!may_shade(light.flags))
            continue;
        LANES
        for (int i = 0; i < (int)count; i++) {
            uint path_class = load_class(state, i);
            int shaded = shaped_light_shades(&light, load_ray(state->shadows, BLOCK_STRIDE, i), limits[i]);
            store_class(state, i, shaded ? path_class & ~CLASS_SHADOW : path_class);
        }
    }
}
#endif

// Traces the shadow rays that paths ask for, and adds what they bring.
STAGE void trace_shadows(const Block *block, const BlockRay *ray) {
    const uint count = ray->count;
#if defined(SHAPED_LIGHTS) && defined(LIGHT_TREE)
    shade_by_tree_lights(block, count);
#elif defined(SHAPED_LIGHTS)
    shade_by_lights(block, ray);
#endif
#ifdef CUTOUTS
    trace_shadows_through_cutouts(block, count);
    return;
#endif
#ifdef BRUTE_FORCE
    uint listed = brute_force_any(block, count);
#else
    Subset subset;
    subsets_by_kind(block, &block->state, block->state.shadows, CLASS_SHADOW, count, &subset);
    list_subset(UINT_PLANES(block->memory, LIST), &subset, 0);
    uint listed = subset.count;
#endif
#ifndef BRUTE_FORCE_ONLY
    interleaved_any(block, count, listed);
#endif
}
#endif

// Takes the paths of a block from their start to their end.
INLINE void trace_block(const Block *block) {
    start_paths(block);
    BlockRay ray;
    ray.count = block->size;
    for (ray.number = 0; ray.count > 0; ray.number++) {
        STAGES_OF_RAY(block, &ray)
    }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
trace_blocks(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, PLACES_PARAMETERS, BLOCK_PARAMETERS, RADIANCE_PARAMETERS,
             CHANGES_PARAMETERS, COUNTERS_PARAMETERS) {
    const Changes changes = {change, changed_objects, touched + block_first()};
    const Block block = BLOCK_OF(&params, slots, places, path_buffer, &changes, counters, params.path_count);
    const uint first = block.first, size = block.size;
    trace_block(&block);
    for (uint c = 0; c < 3; c++)
        for (uint i = 0; i < size; i++)
            path_buffer[c * params.buffer_stride + first + i] = block.state.radiance[c * BLOCK_STRIDE + i];
}
