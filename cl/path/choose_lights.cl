#include "path/light_choice.cl"

#if defined(LIGHT_TREE) && !defined(BLOCKS)
// For paths on surfaces, opaque or not.
__kernel __attribute__((vec_type_hint(float8))) void choose_lights(LAUNCH_PARAMETERS, LIST_PARAMETERS,
                                                                   SHADING_PARAMETERS, EMITTERS_PARAMETERS,
                                                                   PATH_STATE_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    const Surface surface = load_surface(&state, path);
    weigh_met_triangle(&params, &shading, &emitters, &state, path, &surface);
    prepare_choice(&params, &shading, &state, path);
    Receiver receiver;
    LightWalk walk;
    const bool chooses = begin_choice(&state, path, &receiver, &walk);
    for (uint level = 0u; chooses && level < params.light_levels; level++)
        light_step(emitters.light_nodes, &receiver, &walk);
    store_chosen_light(&state, path, chooses ? walk.node & ~NODE_LEAF : NO_INDEX, walk.chance);
}
#endif
