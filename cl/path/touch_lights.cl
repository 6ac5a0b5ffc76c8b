#include "path/changes.cl"
#include "scene/light.cl"
#include "path/chosen_light.cl"

// 1 where a path that has hit a surface asks for a light that differs. This is asked before the path is
// shaded.
INLINE uint asks_for_changed_light(const Params *params, const Shading *shading, const Emitters *emitters,
                                   const State *state, uint path) {
    Path p = load_path(state, path);
    __global const Material *material = &shading->materials[load_surface(state, path).material];
    uint seed = pixel_seed(p.pixel, params->seed);
#ifdef LIGHT_TREE
    uint changed = is_changed_light(params, emitters, load_chosen_light(state, path));
#else
    float choice = uniform_2d(seed, p.sample, PAIR_CHOICE(p.ray)).v;
    uint changed = chooses_changed_light(params, emitters, choice);
#endif
    // As in shade_medium: only smooth boundaries need no light.
    int opaque = uniform_2d(seed, p.sample, PAIR_LUCK(p.ray)).v >= material->transmission;
#if TEXTURED(TRANSMISSION) || HAS_TRAIT(CLEAR_WALL)
    opaque = 1; // or may be
#endif
    int rough = material->roughness * material->roughness > MIN_ALPHA;
    int asks = (p.bounces <= params->max_bounces) & (opaque | rough);
    return changed & (uint)asks;
}

#ifndef BLOCKS
// For paths that have hit a surface and are not shaded yet.
__kernel void touch_lights(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, EMITTERS_PARAMETERS,
                           PATH_STATE_PARAMETERS, CHANGES_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    const Changes changes = {CHANGES_ARGUMENTS};
    touch(&changes, params.first_path + path,
          asks_for_changed_light(&params, &shading, &emitters, &state, path));
}
#endif
