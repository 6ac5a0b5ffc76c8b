#include "path/clamp.cl"
#include "path/carried.cl"
#include "path/state.cl"
#ifdef SHAPED_LIGHTS
#include "scene/shaped_light.cl"
#endif

// What happens where a ray ends on a light that is an object of its own, or goes on to a sun.

#ifdef SHAPED_LIGHTS
// Adds the radiance of a light that a path's ray has met in `distance`, weighted against light sampling. The
// path ends with it.
INLINE void shade_light_path(const Params *params, const Shading *shading, const Emitters *emitters,
                             const State *state, uint path, uint result, uint light_index, float distance) {
    Ray ray = load_ray(state->rays, STRIDE(state), path);
    Path p = load_path(state, path);
    Vec3 throughput = carried_along(shading, state, path, p.throughput, distance);
    ShapedLight light = load_shaped_light(params, emitters, light_index);
    Vec3 arriving = mul(throughput, shaped_radiance(&light, ray, distance, p.bsdf_pdf));
    accumulate(state, result, CLAMPED(params, arriving, finds_indirect(&p)));
}

// Adds the radiance of a sun, if the path's ray, which has left the scene, leads to it.
INLINE void shade_sun_path(const Params *params, const Shading *shading, const Emitters *emitters,
                           const State *state, uint path, uint result, uint light_index) {
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Path p = load_path(state, path);
    Vec3 throughput = carried_along(shading, state, path, p.throughput, INFINITY);
    ShapedLight light = load_shaped_light(params, emitters, light_index);
    Vec3 radiance = sun_radiance(&light, direction, p.ray == 0u, p.bsdf_pdf);
    accumulate(state, result, CLAMPED(params, mul(throughput, radiance), finds_indirect(&p)));
}

#ifndef LIGHT_TREE
// The light that a path's ray meets before `*distance`, with the distance to it; NO_INDEX: it meets none.
INLINE uint nearest_light(const Params *params, const Emitters *emitters, const State *state, uint path,
                          float *distance) {
    const Ray ray = load_ray(state->rays, STRIDE(state), path);
    const Path p = load_path(state, path);
    uint nearest = NO_INDEX;
    for (uint i = params->sun_count; i < params->shaped_count; i++) {
        const ShapedLight light = load_shaped_light(params, emitters, i);
        const float d = distance_to_shaped_light(&light, ray);
        if (may_be_met(light.flags, p.ray == 0u, p.bsdf_pdf) && d * (1.0f - LIGHT_AHEAD) < *distance) {
            nearest = i;
            *distance = d;
        }
    }
    return nearest;
}
#endif
#endif
