#include "path/surface_emission.cl"
#include "path/clamp.cl"
#include "shading/layers.cl"

// What happens where a ray ends on an opaque surface: the path gathers what is emitted there, asks for a
// shadow ray towards a light, and goes on in a direction that the material chooses.
//
//   L_o(wo) = L_e(wo) + integral of f(wo, wi) L_i(wi) cos(wi) d wi
//
// The integral is estimated by light sampling (`sample_lights` has chosen a light) and by BSDF sampling (the
// next ray, whose emission counts at its end), combined by multiple importance sampling. This is
// straight-line code of scalars, so that PoCL runs it in SIMD lanes.

// The end of paths on rays after which no path goes on: they gather emission only.
INLINE void finish_path(const Params *params, const Shading *shading, const State *state, uint path,
                        uint result) {
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Surface surface = load_surface(state, path);
    Path p = load_path(state, path);
    float facing = -dot(surface.geometric, direction);
    SurfaceMaterial material = surface_material(shading, &surface);
    Vec3 emitted = surface_emission(shading, &surface, &material, facing, p.bsdf_pdf);
    accumulate(state, result, CLAMPED(params, mul(p.throughput, emitted), finds_indirect(&p)));
    store_class(state, path, 0u);
}

// Whether a ray in this direction, which is wi in the frame of the surface, leaves it on the side that it
// scatters to, and where it starts. That is the side that the path has come to, and the other one where light
// is transmitted diffusely. Where smooth normals pretend a surface above the face, a ray may go below the
// plane of the face, and starts up there, else it would meet the face (J. Hanika, Hacking the Shadow
// Terminator, Ray Tracing Gems II, 2021).
INLINE int leaves_surface(const Surface *surface, Vec3 direction, Vec3 wi, Vec3 *origin) {
    float above = dot(surface->geometric, direction);
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    float offset = above > 0.0f ? surface->offset : -surface->offset;
    int leaves = above * wi.z > 0.0f;
#else
    float offset = surface->offset;
    int leaves = above > 0.0f;
#endif
#ifndef FLAT
    int from_above = (!leaves) & (wi.z > 0.0f) & (surface->rise > 0.0f);
    offset = from_above ? surface->offset + surface->rise : offset;
    leaves |= from_above;
#endif
    *origin = along(surface->position, offset, surface->geometric);
    return leaves;
}

#ifdef LIGHT_SAMPLING
// Makes a shadow ray of the light that was sampled for the path, if the surface scatters it to the path.
// Returns CLASS_SHADOW where the ray brings something, else 0.
INLINE uint light_surface(const Params *params, const State *state, uint path, const Path *p,
                          const LayeredBsdf *bsdf, Frame frame, Vec3 wo, const Surface *surface,
                          int scatters) {
    LightSample light = load_light_sample(state, path);
    Vec3 wi = to_local(frame, light.direction);
    BsdfValue value = eval_bsdf(bsdf, wo, wi);
    Vec3 origin;
    int leaves = leaves_surface(surface, light.direction, wi, &origin);
    int lit = scatters & (light.pdf > 0.0f) & (value.pdf > 0.0f) & leaves;
    float pdf = lit ? light.pdf : 1.0f;
    float weight = light_sampling_weight(pdf, value.pdf) / pdf;
    Vec3 arriving = mul(mul(p->throughput, value.f_cos), scale(weight, light.radiance));
    arriving = CLAMPED(params, arriving, samples_indirect(p));
    store_shadow_ray(state, path, origin, arriving);
    return (lit & (largest(arriving) > 0.0f)) ? CLASS_SHADOW : 0u;
}
#endif

INLINE void shade_path(const Params *params, const Shading *shading, const State *state, uint path,
                       uint result) {
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Surface surface = load_surface(state, path);
    Path p = load_path(state, path);
    SurfaceMaterial material = surface_material(shading, &surface);

#ifdef MATTE
    int mirrors = 0;
#else
    int mirrors = (material.metallic > 0.0f) | (material.specular > 0.0f);
#if HAS_TRAIT(CLEARCOAT) && !defined(COAT_NORMALS)
    mirrors |= material.clearcoat > 0.0f;
#endif
#endif
    float facing = orient_surface(&surface, direction, mirrors);
    Vec3 emitted = surface_emission(shading, &surface, &material, facing, p.bsdf_pdf);
    accumulate(state, result, CLAMPED(params, mul(p.throughput, emitted), finds_indirect(&p)));

    Vec3 wo;
    Frame frame = shading_frame(&surface, direction, &wo);
    AlbedoTables tables = {shading->layers + surface.material * LAYER_SIZE, shading->albedos,
                           shading->stretched};
    LayeredBsdf bsdf =
        layered_bsdf(&material, tables, params->multiple_scattering, to_local(frame, COAT_NORMAL(&surface)));
    int scatters = p.bounces <= params->max_bounces;
    uint seed = pixel_seed(p.pixel, params->seed);
    Uniform2 choices = uniform_2d(seed, p.sample, PAIR_CHOICE(p.ray));
    uint path_class = 0u;
#ifdef LIGHT_SAMPLING
    path_class = light_surface(params, state, path, &p, &bsdf, frame, wo, &surface, scatters);
#endif

    // BSDF sampling: the next ray.
    BsdfSample next = sample_bsdf(&bsdf, wo, uniform_2d(seed, p.sample, PAIR_DIRECTION(p.ray)), choices.u);
    Vec3 next_direction = from_local(frame, next.wi);
    Vec3 throughput = mul(p.throughput, next.weight);
    Ray next_ray;
    int leaves = leaves_surface(&surface, next_direction, next.wi, &next_ray.origin);
    int goes_on = scatters & (next.pdf > 0.0f) & leaves;

    // Russian roulette: a path that carries little may end, and one that survives stands for those that
    // ended.
    float survival = survival_probability(throughput, p.bounces, params->roulette_depth);
    float luck = uniform_2d(seed, p.sample, PAIR_LUCK(p.ray)).u;
    goes_on = goes_on & (luck < survival) & (largest(throughput) > 0.0f);

    next_ray.direction = normalize(next_direction);
    p.throughput = scale(1.0f / survival, throughput);
    p.bsdf_pdf = next.pdf;
    p.bounces++;
    p.ray++;
    store_ray(state, path, next_ray);
    store_scattered(state, path, &p);
    store_class(state, path, path_class | (goes_on ? CLASS_LIVE : 0u));
}

#ifndef BLOCKS
// The variant EMISSION_ONLY serves rays after which no path goes on.
__kernel void shade(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, PATH_STATE_PARAMETERS) {
    RETURN_IF_GROUP_IS_IDLE(lengths[length_place])
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const WorkItem item = listed_path(&params, lengths[length_place], list);
#ifdef EMISSION_ONLY
    finish_path(&params, &shading, &state, item.path, item.result);
#else
    shade_path(&params, &shading, &state, item.path, item.result);
#endif
}
#endif
