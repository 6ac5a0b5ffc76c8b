#include "accel/bvh.cl"
#include "path/met_light.cl"

// What rays meet of lights that are objects of their own, by the boxes of the light tree. For rays one by
// one; those of a block take turns (cpu/meet_lights.cl).

#if defined(LIGHT_TREE) && defined(SHAPED_LIGHTS)
// What a ray looks for: how far, and lights without those that have any of these flags.
typedef struct {
    float limit;
    uint nearest; // the light that it has met so far; NO_INDEX: none
    uint never;   // of ShapedFlag
} LightSearch;

// Whether the ray meets a light nearer than what it has met.
INLINE bool meet_light(const Params *params, const Emitters *emitters, Ray ray, uint number,
                       LightSearch *search) {
    if (shaped_flags(params, emitters, number) & search->never)
        return false;
    const ShapedLight light = load_shaped_light(params, emitters, number);
    const float distance = distance_to_shaped_light(&light, ray);
    if (!(distance * (1.0f - LIGHT_AHEAD) < search->limit))
        return false;
    search->limit = distance;
    search->nearest = number;
    return true;
}

// The lights that rays never meet whose density is `bsdf_pdf`, see may_be_met.
INLINE uint never_met(int from_camera, float bsdf_pdf) {
    return SHAPED_POINT | SHAPED_SUN | (from_camera ? SHAPED_HIDDEN : 0u) |
           (bsdf_pdf > 0.0f ? SHAPED_SHADOWLESS : 0u);
}

// How far the boxes of lights are looked for: a little farther than the lights.
INLINE float light_box_limit(float limit) { return limit * (1.0f + 4.0f * LIGHT_AHEAD); }

#ifndef BLOCKS
// The nearest light; with `any` the first one that is found.
INLINE void search_lights(const Params *params, const Emitters *emitters, Ray world_ray, const bool any,
                          LightSearch *search) {
    __global const Node *nodes = emitters->light_boxes;
    const BvhRay ray = bvh_ray(world_ray);
    ulong stack[BVH_STACK_SIZE];
    uint height = 0, reference = 0;
    for (;;) {
        if (!(reference & NODE_LEAF)) {
            float8 entry;
            const uint lanes = bvh_boxes(&ray, nodes + reference, light_box_limit(search->limit), &entry);
            if (lanes) {
                reference = bvh_push(nodes + reference, lanes, entry, stack, &height);
                continue;
            }
        } else if (meet_light(params, emitters, world_ray, reference & ~NODE_LEAF, search) && any) {
            return;
        }
        const ulong limit = bvh_entry(NODE_EMPTY, light_box_limit(search->limit));
        do {
            if (height == 0)
                return;
        } while (stack[--height] > limit);
        reference = (uint)stack[height];
    }
}

// The light that a path's ray meets before `*distance`, with the distance to it; NO_INDEX: it meets none.
INLINE uint nearest_tree_light(const Params *params, const Emitters *emitters, const State *state, uint path,
                               float *distance) {
    const Path p = load_path(state, path);
    LightSearch search = {*distance, NO_INDEX, never_met(p.ray == 0u, p.bsdf_pdf)};
    search_lights(params, emitters, load_ray(state->rays, STRIDE(state), path), false, &search);
    *distance = search.limit;
    return search.nearest;
}

// Whether any light is in the way of a shadow ray.
INLINE bool any_tree_light_shades(const Params *params, const Emitters *emitters, Ray ray, float limit) {
    LightSearch search = {limit * (1.0f - LIGHT_CLEAR), NO_INDEX, never_met(0, 1.0f)};
    search_lights(params, emitters, ray, true, &search);
    return search.nearest != NO_INDEX;
}
#endif
#endif
