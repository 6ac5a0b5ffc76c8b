#include "path/chosen_light.cl"
#ifdef SHAPED_LIGHTS
#include "scene/shaped_light.cl"
#endif

// The density of lights that rays have met, by the light tree.

#ifdef LIGHT_TREE
INLINE uint load_normal(const State *state, uint path) {
    return load_bits(state->paths, PATH_NORMAL * STRIDE(state) + path);
}

INLINE float load_bsdf_pdf(const State *state, uint path) {
    return state->paths[PATH_BSDF_PDF * STRIDE(state) + path];
}

// Weighs a light that a path's ray has met with the chance of choosing it from where the ray came, `from`.
// Only the proportion of both densities counts, and that of light sampling is known but for this factor: it
// stays, and the other one is divided. With a chance of 0 no sample could have found the light.
INLINE void weigh_met_light(const Params *params, const Emitters *emitters, const State *state, uint path,
                            Vec3 from, uint trail, float factor) {
    const Receiver receiver = receiver_at(from, load_normal(state, path));
    const float chance =
        factor * params->tree_probability * chance_of_light(params, emitters, &receiver, trail);
    const float pdf = load_bsdf_pdf(state, path);
    state->paths[PATH_BSDF_PDF * STRIDE(state) + path] = chance > 0.0f ? pdf / chance : 0.0f;
}

#ifdef SHAPED_LIGHTS
// The same of a light that is an object of its own, for a ray that starts at `origin`.
INLINE void weigh_met_shaped_light(const Params *params, const Emitters *emitters, const State *state,
                                   uint path, Vec3 origin, uint light) {
    if (load_bsdf_pdf(state, path) > 0.0f)
        weigh_met_light(params, emitters, state, path, origin,
                        shaped_bits(params, emitters, SHAPED_TRAIL, light), 1.0f);
}

#endif
#endif
