#include "path/carried.cl"
#include "path/state.cl"
#include "path/shade_light.cl"
#include "scene/light.cl"
#include "path/clamp.cl"

// Radiance from far away for a path whose ray left the scene, weighted against light sampling of the
// environment. The path ends with it. The variant MEDIA serves scenes with transparent bodies: from inside
// one that is open, a ray leaves through an endless stretch of its medium, as a shadow ray to the environment
// does.
INLINE void shade_miss_path(const Params *params, const Shading *shading, const Emitters *emitters,
                            const State *state, uint path, uint result) {
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Path p = load_path(state, path);
    Vec3 throughput = carried_along(shading, state, path, p.throughput, INFINITY);
    float light_pdf;
    Vec3 arriving = eval_environment(params, emitters, direction, &light_pdf);
    float weight = bsdf_sampling_weight(p.bsdf_pdf, light_pdf);
    accumulate(state, result, CLAMPED(params, mul(throughput, scale(weight, arriving)), finds_indirect(&p)));
}

#ifndef BLOCKS
__kernel void shade_miss(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, EMITTERS_PARAMETERS,
                         PATH_STATE_PARAMETERS) {
    RETURN_IF_GROUP_IS_IDLE(lengths[length_place])
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    const WorkItem item = listed_path(&params, lengths[length_place], list);
    shade_miss_path(&params, &shading, &emitters, &state, item.path, item.result);
#ifdef SHAPED_LIGHTS
    for (uint light = 0u; light < params.sun_count; light++)
        shade_sun_path(&params, &shading, &emitters, &state, item.path, item.result, light);
#endif
}
#endif
