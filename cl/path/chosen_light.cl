#include "path/state.cl"
#ifdef LIGHT_TREE
#include "scene/light_tree.cl"

// The light that a path has chosen, between the stages `choose_lights` and `sample_lights`.

// The choice waits in the planes of the shadow ray, which it is made for.
INLINE void store_chosen_light(const State *state, uint path, uint number, float chance) {
    store_bits(state->shadows, SHADOW_DISTANCE * STRIDE(state) + path, number);
    state->shadows[SHADOW_PDF * STRIDE(state) + path] = chance;
}

INLINE ChosenLight load_chosen_light(const State *state, uint path) {
    ChosenLight chosen;
    chosen.number = load_bits(state->shadows, SHADOW_DISTANCE * STRIDE(state) + path);
    chosen.chance = state->shadows[SHADOW_PDF * STRIDE(state) + path];
    return chosen;
}
#endif
