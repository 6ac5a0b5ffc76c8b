#include "cpu/interleaved.cl"
#include "path/light_choice.cl"
#include "path/light_search.cl"

// The light tree for blocks of paths: a few rays, or a few choices of lights, take turns, so that one does
// not wait for the outcome of its last node.

#ifdef LIGHT_TREE

// Choices under way: as many as the processor has in sight, a node each.
#define CHOICES_AT_ONCE 4

// Weighs the emissive triangles that paths have met, and chooses lights for those that go on.
STAGE void choose_block_lights(const Block *block, uint count) {
    const State *state = &block->state;
    const uint levels = block->params->light_levels;
#ifdef TRIANGLE_LIGHTS
    for (uint path = 0; path < count; path++) {
        const Surface surface = load_surface(state, path);
        weigh_met_triangle(block->params, &block->shading, &block->emitters, state, path, &surface);
    }
#endif
    LANES
    for (int i = 0; i < (int)count; i++)
        prepare_choice(block->params, &block->shading, state, i);
    for (uint first = 0; first < count; first += CHOICES_AT_ONCE) {
        Receiver receivers[CHOICES_AT_ONCE];
        LightWalk walks[CHOICES_AT_ONCE];
        uint paths[CHOICES_AT_ONCE];
        uint chosen = 0;
        for (uint path = first; path < MIN(first + CHOICES_AT_ONCE, count); path++) {
            paths[chosen] = path;
            if (begin_choice(state, path, receivers + chosen, walks + chosen))
                chosen++;
            else
                store_chosen_light(state, path, NO_INDEX, 1.0f);
        }
        for (uint level = 0; level < levels; level++)
            for (uint k = 0; k < chosen; k++)
                light_step(block->emitters.light_nodes, receivers + k, walks + k);
        for (uint k = 0; k < chosen; k++)
            store_chosen_light(state, paths[k], walks[k].node & ~NODE_LEAF, walks[k].chance);
    }
}

#ifdef SHAPED_LIGHTS

// Rays under way in the boxes of lights.
#define LIGHT_RAYS 8

typedef struct {
    InterleavedRay way; // its hit says no more than how far boxes are looked for
    Ray ray;
    LightSearch search;
} LightRay;

INLINE void start_light_ray(LightRay *one, const Block *block, __local const float *prepared,
                            __local const float *rays, uint path, LightSearch search) {
    one->search = search;
    one->ray = load_ray(rays, BLOCK_STRIDE, path);
    interleaved_start(&one->way, &block->geometry, prepared, rays, path, light_box_limit(search.limit));
    one->way.in.nodes = block->emitters.light_boxes;
}

// One node or light more; false when the ray is done.
INLINE bool turn_light_ray(LightRay *one, const Block *block, const bool any) {
    InterleavedRay *way = &one->way;
    do {
        if (way->height == 0)
            return false;
        way->height--;
    } while (!any && way->distance[way->height] > way->hit.distance);
    const uint reference = way->reference[way->height];
    if (!(reference & NODE_LEAF)) {
        interleaved_test_node(way, reference, any);
        return true;
    }
    if (!meet_light(block->params, &block->emitters, one->ray, reference & ~NODE_LEAF, &one->search))
        return true;
    way->hit.distance = light_box_limit(one->search.limit);
    return !any;
}

// What a ray of a traced path looks for.
INLINE LightSearch search_of_path(const Block *block, uint path, uint from_camera) {
    __local const float *hits = PLANES(block->memory, RAW_HITS);
    const uint object = load_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + path);
    const float pdf = block->traced.paths[PATH_BSDF_PDF * BLOCK_STRIDE + path];
    LightSearch search = {object == NO_INDEX ? INFINITY : hits[RAW_HIT_DISTANCE * BLOCK_STRIDE + path],
                          NO_INDEX, never_met(from_camera, pdf)};
    return search;
}

// What a shadow ray looks for.
INLINE LightSearch search_of_shadow(const Block *block, uint path) {
    const float limit = block->state.shadows[SHADOW_DISTANCE * BLOCK_STRIDE + path];
    LightSearch search = {limit * (1.0f - LIGHT_CLEAR), NO_INDEX, never_met(0, 1.0f)};
    return search;
}

// Ends the way of a ray: a path's hit is that on the light, or a shadow ray is dropped.
INLINE void end_light_ray(const LightRay *one, const Block *block, const bool any) {
    const uint path = one->way.path;
    if (one->search.nearest == NO_INDEX)
        return;
    if (any) {
        store_class(&block->state, path, load_class(&block->state, path) & ~CLASS_SHADOW);
        return;
    }
    __local float *hits = PLANES(block->memory, RAW_HITS);
    hits[RAW_HIT_DISTANCE * BLOCK_STRIDE + path] = one->search.limit;
    store_bits(hits, RAW_HIT_OBJECT * BLOCK_STRIDE + path, LIGHT_HIT | one->search.nearest);
}

// The next path from `*next` on whose ray looks for lights; false where there is none.
INLINE bool next_light_ray(LightRay *one, const Block *block, __local const float *prepared, uint count,
                           uint from_camera, const bool any, uint *next) {
    const State *state = any ? &block->state : &block->traced;
    while (any && *next < count && !(load_class(state, *next) & CLASS_SHADOW))
        (*next)++;
    if (*next >= count)
        return false;
    const uint path = (*next)++;
    start_light_ray(one, block, prepared, any ? state->shadows : state->rays, path,
                    any ? search_of_shadow(block, path) : search_of_path(block, path, from_camera));
    return true;
}

INLINE void trace_light_rays(const Block *block, __local const float *prepared, uint count, uint from_camera,
                             const bool any) {
    LightRay all[LIGHT_RAYS];
    LightRay *order[LIGHT_RAYS]; // those under way stand in front
    uint under_way = 0, next = 0;
    while (under_way < LIGHT_RAYS &&
           next_light_ray(all + under_way, block, prepared, count, from_camera, any, &next)) {
        order[under_way] = all + under_way;
        under_way++;
    }
    while (under_way > 0) {
        for (uint i = 0; i < under_way; i++) {
            LightRay *one = order[i];
            if (turn_light_ray(one, block, any))
                continue;
            end_light_ray(one, block, any);
            if (!next_light_ray(one, block, prepared, count, from_camera, any, &next))
                order[i] = order[--under_way];
        }
    }
}

// Rays that meet a light before all else end there.
STAGE void meet_tree_lights(const Block *block, uint count, uint from_camera) {
    __local float *prepared = PLANES(block->memory, PREPARED);
    prepare_rays(prepared, block->traced.rays, count);
    trace_light_rays(block, prepared, count, from_camera, false);
}

// Drops the shadow rays that a light is in the way of, as surfaces are.
STAGE void shade_by_tree_lights(const Block *block, uint count) {
    __local float *prepared = PLANES(block->memory, PREPARED_SHADOWS);
    prepare_rays(prepared, block->state.shadows, count);
    trace_light_rays(block, prepared, count, 0, true);
}

// Weighs the lights that paths end on.
STAGE void weigh_tree_lights(const Block *block, const uint count) {
    __local const uint *list = UINT_PLANES(block->memory, LIST);
    for (uint i = 0; i < count; i++) {
        const uint path = list[i];
        const uint light = load_raw_hit(block, path).object & ~LIGHT_HIT;
        weigh_met_shaped_light(block->params, &block->emitters, &block->traced, path,
                               load_ray(block->traced.rays, BLOCK_STRIDE, path).origin, light);
    }
}
#endif
#endif
