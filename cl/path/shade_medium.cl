#include "shading/dielectric.cl"

// What happens where a ray ends on a transparent body, or inside one: absorption on the way, then the
// boundary of nested dielectrics. A path that turns out to stand on an opaque surface is passed on to
// `shade` by its class. Straight-line code of scalars, so that PoCL runs it in SIMD lanes. The variant
// SMOOTH_MEDIA serves scenes without rough transparent bodies.

// What a rough boundary scatters of the light sample that `sample_lights` left; that stays for `opaque`
// surfaces. Whether it asks for a shadow ray.
INLINE int light_boundary(__global const Material *materials, const State *state, uint path,
                          const Boundary *boundary, Frame frame, Vec3 wo, Vec3 geometric, Vec3 throughput,
                          uint near, uint far, int opaque) {
    uint stride = STRIDE(state);
    Vec3 position = load3(state->hits + HIT_POSITION_X * stride, stride, path);
    float offset = state->hits[HIT_OFFSET * stride + path];
    Vec3 to_light = load3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path);
    float light_pdf = state->shadows[SHADOW_PDF * stride + path];
    BsdfValue value = eval_rough_boundary(boundary, wo, to_local(frame, to_light));
    float above = dot(geometric, to_light);
    int lit = (light_pdf > 0.0f) & (value.pdf > 0.0f) & (above * dot(frame.normal, to_light) > 0.0f);
    light_pdf = lit ? light_pdf : 1.0f;
    float weight = mis_weight(light_pdf, value.pdf) / light_pdf;
    Vec3 passed =
        transmittance(materials, above > 0.0f ? near : far, state->shadows[SHADOW_DISTANCE * stride + path]);
    Vec3 light = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
    Vec3 arriving = mul(mul(mul(throughput, value.f_cos), scale(weight, light)), passed);
    Vec3 origin = along(position, above > 0.0f ? offset : -offset, geometric);
    store3(state->shadows + SHADOW_ORIGIN_X * stride, stride, path, origin);
    store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, select(opaque, light, arriving));
    return lit;
}

INLINE void shade_medium_path(const Params *params, __global const Material *materials, const State *state,
                              uint path, uint result) {
    uint stride = STRIDE(state);
    uint hit_material = load_bits(state->hits, HIT_MATERIAL * stride + path);
    __global const Material *material = &materials[hit_material];
    Vec3 direction = load3(state->rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 position = load3(state->hits + HIT_POSITION_X * stride, stride, path);
    Vec3 geometric = load3(state->hits + HIT_GEOMETRIC_X * stride, stride, path);
    Vec3 shading = load3(state->hits + HIT_SHADING_X * stride, stride, path);
    float distance = state->hits[HIT_DISTANCE * stride + path];
    float offset = state->hits[HIT_OFFSET * stride + path];
    Vec3 throughput = load3(state->paths + PATH_THROUGHPUT_R * stride, stride, path);
    float bsdf_pdf = state->paths[PATH_BSDF_PDF * stride + path];
    uint counts = load_bits(state->paths, PATH_COUNTS * stride + path);
    uint bounces = counts & 0xffu, passages = (counts >> 8) & 0xffu, ray = (counts >> 16) & 0xffu;
    uint seed = pixel_seed(load_bits(state->paths, PATH_PIXEL * stride + path), params->seed);
    uint sample = load_bits(state->paths, PATH_SAMPLE * stride + path);

    // Absorption on the way here.
    MediumStack before = load_medium_stack(state, path);
    throughput = mul(throughput, transmittance(materials, before.entry[0], distance));

    // Opaque, or taken for opaque by chance where the material is partly transmissive.
    Uniform2 luck = uniform_2d(seed, sample, PAIR_LUCK(ray));
    int opaque = luck.v >= material->transmission;
    float facing = -dot(geometric, direction);
    Vec3 emitted = emitted_radiance(material, facing, distance, bsdf_pdf);
    accumulate(state, result, select(opaque, vec3(0.0f, 0.0f, 0.0f), mul(throughput, emitted)));

    // The media on both sides. A ray that leaves a body which it never entered started inside of it.
    int outside = facing > 0.0f;
    MediumStack entered = before, left = before;
    enter_medium(&entered, materials, hit_material);
    int known = leave_medium(&left, hit_material);
    uint near = outside | known ? before.entry[0] : hit_material;
    uint far = outside ? entered.entry[0] : left.entry[0];
    int covered = near == far; // a body of higher priority hides this boundary

    float side = outside ? 1.0f : -1.0f;
    geometric = scale(side, geometric);
    shading = scale(side, shading);
    shading = select(dot(shading, direction) > -1e-4f, geometric, shading);
    Frame frame = frame_of(shading);
    Vec3 wo = to_local(frame, scale(-1.0f, direction));
    wo.z = MAX(wo.z, 1e-4f);
    Boundary boundary;
    boundary.eta = medium_ior(materials, far) / medium_ior(materials, near);
    boundary.alpha = MAX(material->roughness * material->roughness, MIN_ALPHA);
    boundary.specular = material->specular;
    boundary.transmitted = material_vec3(material->base_color);
    Uniform2 choices = uniform_2d(seed, sample, PAIR_CHOICE(ray));
    uint path_class = 0u;

    BsdfSample next = sample_smooth_boundary(&boundary, wo, choices.u);
    int smooth = 1;
#ifndef SMOOTH_MEDIA
    // Without a step in IOR there is nothing to scatter at, however rough.
    smooth = (material->roughness * material->roughness <= MIN_ALPHA) | (FABS(boundary.eta - 1.0f) < 1e-5f);
#ifdef LIGHT_SAMPLING
    // Light sampling, where the boundary has a density for it.
    int scatters = (!covered) & (!smooth) & (!opaque) & (bounces <= params->max_bounces);
    int lit = light_boundary(materials, state, path, &boundary, frame, wo, geometric, throughput, near, far,
                             opaque);
    path_class = scatters & lit ? CLASS_SHADOW : 0u;
#endif
    BsdfSample rough =
        sample_rough_boundary(&boundary, wo, uniform_2d(seed, sample, PAIR_DIRECTION(ray)), choices.u);
    next.wi = select(smooth, next.wi, rough.wi);
    next.weight = select(smooth, next.weight, rough.weight);
    next.pdf = smooth ? next.pdf : rough.pdf;
#endif
    next.wi = select(covered, scale(-1.0f, wo), next.wi);
    next.weight = select(covered, vec3(1.0f, 1.0f, 1.0f), next.weight);
    next.pdf = covered ? 0.0f : next.pdf;
    int reflected = next.wi.z > 0.0f;
    Vec3 next_direction = select(covered, direction, normalize(from_local(frame, next.wi)));
    float leaving = dot(geometric, next_direction);
    int possible = (covered | smooth | (next.pdf > 0.0f)) & (reflected ? leaving > 0.0f : leaving < 0.0f);

    // Passages and inner reflections of smooth bodies have a budget of their own; a covered boundary is none.
    int passage = smooth & !(reflected & outside);
    bounces += (!covered) & (!passage);
    passages += (!covered) & passage;
    Vec3 carried = mul(throughput, next.weight);
    float survival = survival_probability(carried, counts & 0xffu, params->roulette_depth);
    int goes_on = possible & (bounces <= params->max_bounces + 1u) &
                  (passages <= params->transmission_bounces) & (ray < 250u) & (largest(carried) > 0.0f) &
                  (luck.u < survival);
    carried = scale(1.0f / survival, carried);

    MediumStack after;
#pragma unroll
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        uint crossed = outside ? entered.entry[i] : left.entry[i];
        after.entry[i] = opaque | reflected ? before.entry[i] : crossed;
    }
    path_class |= goes_on ? CLASS_LIVE : 0u;
    uint new_counts = bounces | (passages << 8) | ((ray + 1u) << 16);
    store_medium_stack(state, path, &after);
    store3(state->rays + RAY_ORIGIN_X * stride, stride, path,
           along(position, reflected ? offset : -offset, geometric));
    store3(state->rays + RAY_DIRECTION_X * stride, stride, path, select(opaque, direction, next_direction));
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, select(opaque, throughput, carried));
    state->paths[PATH_BSDF_PDF * stride + path] = opaque ? bsdf_pdf : next.pdf;
    store_bits(state->paths, PATH_COUNTS * stride + path, opaque ? counts : new_counts);
    store_bits(state->paths, PATH_CLASS * stride + path, opaque ? CLASS_SURFACE : path_class);
}

// `shade` knows no media: for a path on an opaque surface inside of one, the light that its shadow ray will
// bring is absorbed beforehand.
INLINE void absorb_light(__global const Material *materials, const State *state, uint path) {
    uint stride = STRIDE(state);
    Vec3 passed = transmittance(materials, load_medium_stack(state, path).entry[0],
                                state->shadows[SHADOW_DISTANCE * stride + path]);
    Vec3 light = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
    store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, mul(passed, light));
}

#ifndef BLOCKS
__kernel void shade_medium(const Params params, const uint count, __global const uint *list,
                           __global const Material *materials, __global float *hits, __global float *rays,
                           __global float *paths, __global float *shadows, __global float *radiance) {
    State state = {rays, paths, hits, shadows, radiance, params.path_stride, params.buffer_stride};
    if (get_global_id(0) >= count)
        return;
    uint path = list[get_global_id(0)];
    shade_medium_path(&params, materials, &state, path, params.first_path + path);
#ifdef LIGHT_SAMPLING
    if (load_bits(paths, PATH_CLASS * state.stride + path) == CLASS_SURFACE)
        absorb_light(materials, &state, path);
#endif
}
#endif
