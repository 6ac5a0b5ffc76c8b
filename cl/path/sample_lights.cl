#include "path/state.cl"
#include "scene/light.cl"
#include "path/chosen_light.cl"

#ifdef LIGHT_SAMPLING
// Where shadow rays start; see layout.SurfacePlane for RISE.
INLINE Starts starts_of(const Surface *surface) {
    Starts starts;
    starts.position = surface->position;
    starts.above = scale(surface->offset, surface->geometric);
    starts.below = scale(-1.0f, starts.above);
#ifndef FLAT
    float rise = surface->rise, side = rise < 0.0f ? -1.0f : 1.0f;
    starts.above = scale(side, starts.above);
    starts.below = select(rise != 0.0f, along(starts.above, rise, surface->geometric), starts.below);
#endif
    return starts;
}

// Chooses a light for a path that stands on a surface: a direction, the radiance that comes along it when
// nothing is in the way, and its density. This is a stage of its own, because all kinds of surfaces share it,
// and because PoCL vectorises small kernels that it would not vectorise as parts of a large one.
INLINE void sample_lights_path(const Params *params, const Shading *shading, const Emitters *emitters,
                               const State *state, uint path) {
    Surface surface = load_surface(state, path);
    Path p = load_path(state, path);
    uint seed = pixel_seed(p.pixel, params->seed);
    Uniform2 uv = uniform_2d(seed, p.sample, PAIR_LIGHT(p.ray));
    float choice = uniform_2d(seed, p.sample, PAIR_CHOICE(p.ray)).v;
    const Starts starts = starts_of(&surface);
#ifdef LIGHT_TREE
    LightSample light =
        sample_tree_light(params, shading, emitters, &starts, uv, choice, load_chosen_light(state, path));
#else
    LightSample light = sample_light(params, shading, emitters, &starts, uv, choice);
#endif
    store_light_sample(state, path, &light);
}

#ifndef BLOCKS
__kernel void sample_lights(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, EMITTERS_PARAMETERS,
                            PATH_STATE_PARAMETERS) {
    RETURN_IF_GROUP_IS_IDLE(lengths[length_place])
    const State state = STATE_OF(params);
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    const Shading shading = {SHADING_ARGUMENTS};
    sample_lights_path(&params, &shading, &emitters, &state,
                       listed_path(&params, lengths[length_place], list).path);
}
#endif
#endif
