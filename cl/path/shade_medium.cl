#include "path/surface_emission.cl"
#include "path/clamp.cl"
#include "shading/clear_wall.cl"
#include "shading/dielectric.cl"

// What happens where a ray ends on a transparent body, or inside one: absorption on the way, then the
// boundary of nested dielectrics. A path that turns out to stand on an opaque surface is passed on to
// `shade` by its class. This is straight-line code of scalars, so that PoCL runs it in SIMD lanes. The
// variant SMOOTH_MEDIA serves scenes without rough transparent bodies.

// The media on both sides of a boundary: on the side that the ray comes from, and beyond.
typedef struct {
    uint near, far;
} BoundaryMedia;

// Makes a shadow ray of the light that was sampled for a path at a rough boundary. A path on an `opaque`
// surface keeps the light sample, which `shade` needs. Returns whether the ray brings something.
INLINE int light_boundary(const Params *params, __global const Material *materials, const State *state,
                          uint path, const Path *p, const Boundary *boundary, Frame frame, Vec3 wo,
                          const Surface *surface, Vec3 throughput, BoundaryMedia media, int opaque) {
    LightSample light = load_light_sample(state, path);
    BsdfValue value = eval_rough_boundary(boundary, wo, to_local(frame, light.direction));
    float above = dot(surface->geometric, light.direction);
    int lit = (light.pdf > 0.0f) & (value.pdf > 0.0f) & (above * dot(frame.normal, light.direction) > 0.0f);
    float pdf = lit ? light.pdf : 1.0f;
    float weight = light_sampling_weight(pdf, value.pdf) / pdf;
    Vec3 passed = transmittance(materials, above > 0.0f ? media.near : media.far, light.distance);
    Vec3 arriving = mul(mul(mul(throughput, value.f_cos), scale(weight, light.radiance)), passed);
    arriving = CLAMPED(params, arriving, samples_indirect(p));
    float offset = above > 0.0f ? surface->offset : -surface->offset;
    store_shadow_ray(state, path, along(surface->position, offset, surface->geometric),
                     select(opaque, light.radiance, arriving));
    return lit;
}

INLINE void shade_medium_path(const Params *params, const Shading *shading, const State *state, uint path,
                              uint result) {
    __global const Material *materials = shading->materials;
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Surface surface = load_surface(state, path);
    Path p = load_path(state, path);
    SurfaceMaterial material = surface_material(shading, &surface);
    uint seed = pixel_seed(p.pixel, params->seed);

    // Absorption on the way here.
    MediumStack before = load_medium_stack(state, path);
    Vec3 throughput = mul(p.throughput, transmittance(materials, before.entry[0], surface.distance));

    // A material that is partly transmissive is taken for opaque by chance.
    Uniform2 luck = uniform_2d(seed, p.sample, PAIR_LUCK(p.ray));
#if HAS_TRAIT(CLEAR_WALL)
    // Rays that a clear wall lets through have not ended on it.
    __global const Material *own = &shading->materials[surface.material];
    int clear = is_clear_wall(shading, own, surface.object);
    float mirrored = wall_share(own, FABS(dot(surface.geometric, direction)));
    float ended = 1.0f - own->transmission + mirrored;
    material.transmission = clear ? mirrored / MAX(ended, 1e-12f) : material.transmission;
#endif
    int opaque = luck.v >= material.transmission;
    float facing = orient_surface(&surface, direction, 1);
    Vec3 emitted = surface_emission(shading, &surface, &material, facing, p.bsdf_pdf);
    Vec3 found = CLAMPED(params, mul(throughput, emitted), finds_indirect(&p));
    accumulate(state, result, select(opaque, vec3(0.0f, 0.0f, 0.0f), found));

    // The media on both sides. A ray that leaves a body which it never entered has started inside of it.
    int outside = facing > 0.0f;
    MediumStack entered = before, left = before;
    enter_medium(&entered, materials, surface.material);
    int known = leave_medium(&left, surface.material);
    BoundaryMedia media;
    media.near = outside | known ? before.entry[0] : surface.material;
    media.far = outside ? entered.entry[0] : left.entry[0];
    int covered = media.near == media.far; // a body of higher priority hides this boundary
#if HAS_TRAIT(THIN_WALLED)
    // A wall encloses nothing: the same medium is on both sides.
    int thin = (shading->materials[surface.material].flags & MATERIAL_THIN_WALLED) != 0u;
    media.near = thin ? before.entry[0] : media.near;
    media.far = thin ? before.entry[0] : media.far;
    covered = thin ? 0 : covered;
#endif

    Vec3 wo;
    Frame frame = shading_frame(&surface, direction, &wo);
    Boundary boundary;
    float near_ior = medium_ior(materials, media.near), far_ior = medium_ior(materials, media.far);
#if HAS_TRAIT(DISPERSION)
    // Where colours part, the path follows one of them, by chance of what it carries of each.
    float near_spread = medium_spread(materials, media.near);
    float far_spread = medium_spread(materials, media.far);
    int part = (near_spread + far_spread > 0.0f) & (!opaque) & (!covered);
    float hue = uniform_2d(seed, p.sample, PAIR_CHANNEL(p.ray)).u;
    float channel = follow_channel(&throughput, hue, part);
    // No colour is faster than light in a vacuum.
    near_ior = MAX(near_ior + channel * near_spread, 1.0f);
    far_ior = MAX(far_ior + channel * far_spread, 1.0f);
#endif
    boundary.eta = far_ior / near_ior;
#if HAS_TRAIT(THIN_WALLED)
    boundary.thin = thin;
#if HAS_TRAIT(CLEAR_WALL)
    boundary.clear = clear;
#endif
    boundary.eta = thin ? material.ior / near_ior : boundary.eta;
#endif
#if HAS_TRAIT(SPECULAR_COLOR)
    boundary.tint = material.specular_color;
#endif
#if HAS_TRAIT(IRIDESCENCE)
    boundary.iridescence = material.iridescence;
    boundary.film.ior = material.iridescence_ior;
    boundary.film.thickness = material.iridescence_thickness;
#endif
    boundary.alpha = MAX(material.roughness * material.roughness, MIN_ALPHA);
    boundary.specular = material.specular;
    boundary.transmitted = material.base_color;
    Uniform2 choices = uniform_2d(seed, p.sample, PAIR_CHOICE(p.ray));
    uint path_class = 0u;

    BsdfSample next = sample_smooth_boundary(&boundary, wo, choices.u);
    int smooth = 1;
#ifndef SMOOTH_MEDIA
    boundary.gain =
        LERP(1.0f, rough_gain(&boundary, material.roughness, wo.z, shading->glass, shading->albedos),
             params->multiple_scattering);
    // Without a step in IOR there is nothing to scatter at, however rough the boundary is.
    smooth = (material.roughness * material.roughness <= MIN_ALPHA) | (FABS(boundary.eta - 1.0f) < 1e-5f);
#ifdef LIGHT_SAMPLING
    // Light sampling, where the boundary has a density for it.
    int scatters = (!covered) & (!smooth) & (!opaque) & (p.bounces <= params->max_bounces);
    int lit = light_boundary(params, materials, state, path, &p, &boundary, frame, wo, &surface, throughput,
                             media, opaque);
    path_class = scatters & lit ? CLASS_SHADOW : 0u;
#endif
    BsdfSample rough =
        sample_rough_boundary(&boundary, wo, uniform_2d(seed, p.sample, PAIR_DIRECTION(p.ray)), choices.u);
    next.wi = select(smooth, next.wi, rough.wi);
    next.weight = select(smooth, next.weight, rough.weight);
    next.pdf = smooth ? next.pdf : rough.pdf;
#endif
    next.wi = select(covered, scale(-1.0f, wo), next.wi);
    next.weight = select(covered, vec3(1.0f, 1.0f, 1.0f), next.weight);
    next.pdf = covered ? 0.0f : next.pdf;
    int reflected = next.wi.z > 0.0f;
    Vec3 next_direction = select(covered, direction, normalize(from_local(frame, next.wi)));
    float leaving = dot(surface.geometric, next_direction);
    int possible = (covered | smooth | (next.pdf > 0.0f)) & (reflected ? leaving > 0.0f : leaving < 0.0f);

    // Passages through smooth bodies and reflections inside them have a limit of their own; a covered
    // boundary counts as neither. A wall has no inside.
#if HAS_TRAIT(THIN_WALLED)
    int passage = smooth & !(reflected & (outside | thin));
#else
    int passage = smooth & !(reflected & outside);
#endif
    uint bounces = p.bounces + ((!covered) & (!passage));
    uint passages = p.passages + ((!covered) & passage);
    Vec3 carried = mul(throughput, next.weight);
    float survival = survival_probability(carried, p.bounces, params->roulette_depth);
    int survives = possible & (bounces <= params->max_bounces + 1u) & (p.ray < MOST_RAYS_IN_MEDIA) &
                   (largest(carried) > 0.0f) & (luck.u < survival);
    int may_pass = passages <= params->transmission_bounces;
    carried = scale(1.0f / survival, carried);

    MediumStack after;
#pragma unroll
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        uint crossed = outside ? entered.entry[i] : left.entry[i];
#if HAS_TRAIT(THIN_WALLED)
        crossed = thin ? before.entry[i] : crossed;
#endif
        after.entry[i] = opaque | reflected ? before.entry[i] : crossed;
    }
    Ray next_ray;
    next_ray.origin =
        along(surface.position, reflected ? surface.offset : -surface.offset, surface.geometric);
    next_ray.direction = select(opaque, direction, next_direction);
    path_class |= survives ? (may_pass ? CLASS_LIVE : CLASS_CUT_OFF) : 0u;
    p.throughput = select(opaque, throughput, carried);
    p.bsdf_pdf = opaque ? p.bsdf_pdf : next.pdf;
    p.bounces = opaque ? p.bounces : bounces;
    p.passages = opaque ? p.passages : passages;
    p.ray = opaque ? p.ray : p.ray + 1u;
    store_ray(state, path, next_ray);
    store_scattered(state, path, &p);
    store_medium_stack(state, path, &after);
    store_class(state, path, opaque ? CLASS_SURFACE : path_class);
}

// `shade` knows no media: for a path on an opaque surface inside of one, the light that its shadow ray will
// bring is absorbed beforehand.
INLINE void absorb_light(const Shading *shading, const State *state, uint path) {
    LightSample light = load_light_sample(state, path);
    uint medium = load_medium_stack(state, path).entry[0];
    Vec3 passed = transmittance(shading->materials, medium, light.distance);
    store_arriving(state, path, mul(passed, light.radiance));
}

#ifndef BLOCKS
__kernel void shade_medium(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, PATH_STATE_PARAMETERS,
                           COUNTERS_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const WorkItem item = listed_path(&params, lengths[length_place], list);
    shade_medium_path(&params, &shading, &state, item.path, item.result);
    if (load_class(&state, item.path) == CLASS_CUT_OFF)
        atomic_add(&counters[COUNTER_CUT_OFF], 1u);
#ifdef LIGHT_SAMPLING
    if (load_class(&state, item.path) == CLASS_SURFACE)
        absorb_light(&shading, &state, item.path);
#endif
}
#endif
