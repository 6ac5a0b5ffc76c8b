#include "dielectric.cl"

// What happens where a ray ends on a transparent body, or inside one: absorption on the way, then the
// boundary of nested dielectrics. A path that turns out to stand on an opaque surface is passed on to
// `shade` by its class. Rarer and full of branches, so it stands apart from `shade` and is not vectorised.
INLINE void shade_medium_path(const Params *params, __global const Material *materials, const State *state,
                              uint path, uint result) {
    uint stride = state->stride;
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
    throughput = times(throughput, transmittance(materials, before.entry[0], distance));
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, throughput);

    // Opaque, or taken for opaque by chance where the material is partly transmissive.
    Uniform2 luck = uniform_2d(seed, sample, PAIR_LUCK(ray));
    if (luck.v >= material->transmission) {
#ifdef LIGHT_SAMPLING
        // `shade` knows no media: the light that its shadow ray will bring is absorbed beforehand.
        Vec3 passed =
            transmittance(materials, before.entry[0], state->shadows[SHADOW_DISTANCE * stride + path]);
        Vec3 light = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
        store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, times(passed, light));
#endif
        store_bits(state->paths, PATH_CLASS * stride + path, CLASS_SURFACE);
        return;
    }
    float facing = -inner(geometric, direction);
    Vec3 emitted = emitted_radiance(material, facing, distance, bsdf_pdf);
    gather(state, result, times(throughput, emitted));

    // The media on both sides. A ray that leaves a body which it never entered started inside of it.
    MediumStack after = before;
    uint near = before.entry[0];
    if (facing > 0.0f)
        enter_medium(&after, materials, hit_material);
    else if (!leave_medium(&after, hit_material))
        near = hit_material;
    uint far = after.entry[0];
    int covered = near == far; // a body of higher priority hides this boundary
    int outside = facing > 0.0f;

    float side = facing > 0.0f ? 1.0f : -1.0f;
    geometric = scaled(side, geometric);
    shading = scaled(side, shading);
    if (inner(shading, direction) > -1e-4f)
        shading = geometric;
    Frame frame = frame_of(shading);
    Vec3 wo = to_local(frame, scaled(-1.0f, direction));
    wo.z = max(wo.z, 1e-4f);
    Boundary boundary;
    boundary.eta = medium_ior(materials, far) / medium_ior(materials, near);
    boundary.alpha = max(material->roughness * material->roughness, MIN_ALPHA);
    boundary.specular = material->specular;
    boundary.transmitted = material_vec3(material->base_color);
    // Without a step in IOR there is nothing to scatter at, however rough.
    int smooth = material->roughness * material->roughness <= MIN_ALPHA || fabs(boundary.eta - 1.0f) < 1e-5f;
    Uniform2 choices = uniform_2d(seed, sample, PAIR_CHOICE(ray));
    uint path_class = 0u;

    // Light sampling, where a rough boundary has a density for it.
#ifdef LIGHT_SAMPLING
    if (!covered && !smooth && bounces <= params->max_bounces) {
        Vec3 to_light = load3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path);
        float light_pdf = state->shadows[SHADOW_PDF * stride + path];
        Vec3 wi = to_local(frame, to_light);
        BsdfValue value = eval_rough_boundary(&boundary, wo, wi);
        float above = inner(geometric, to_light);
        if (light_pdf > 0.0f && value.pdf > 0.0f && above * wi.z > 0.0f) {
            Vec3 arriving = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
            float weight = mis_weight(light_pdf, value.pdf) / light_pdf;
            arriving = times(times(throughput, value.f_cos), scaled(weight, arriving));
            arriving = times(arriving, transmittance(materials, above > 0.0f ? near : far,
                                                     state->shadows[SHADOW_DISTANCE * stride + path]));
            store3(state->shadows + SHADOW_ORIGIN_X * stride, stride, path,
                   along(position, above > 0.0f ? offset : -offset, geometric));
            store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, arriving);
            path_class |= CLASS_SHADOW;
        }
    }
#endif

    BsdfSample next;
    if (covered) {
        next.wi = scaled(-1.0f, wo);
        next.weight = vec3(1.0f, 1.0f, 1.0f);
        next.pdf = 0.0f;
    } else if (smooth) {
        next = sample_smooth_boundary(&boundary, wo, choices.u);
    } else {
        next = sample_rough_boundary(&boundary, wo, uniform_2d(seed, sample, PAIR_DIRECTION(ray)), choices.u);
    }
    int reflected = next.wi.z > 0.0f;
    Vec3 next_direction = covered ? direction : unit(from_local(frame, next.wi));
    float leaving = inner(geometric, next_direction);
    int possible = (covered || smooth || next.pdf > 0.0f) && (reflected ? leaving > 0.0f : leaving < 0.0f);

    // Passages and inner reflections of smooth bodies have a budget of their own; a covered boundary is none.
    int passage = smooth && !(reflected && outside);
    bounces += !covered && !passage;
    passages += !covered && passage;
    throughput = times(throughput, next.weight);
    float survival = survival_probability(throughput, counts & 0xffu, params->roulette_depth);
    int goes_on = possible && bounces <= params->max_bounces + 1u &&
                  passages <= params->transmission_bounces && ray < 250u && largest(throughput) > 0.0f &&
                  luck.u < survival;

    if (!reflected)
        store_medium_stack(state, path, &after);
    store3(state->rays + RAY_ORIGIN_X * stride, stride, path,
           along(position, reflected ? offset : -offset, geometric));
    store3(state->rays + RAY_DIRECTION_X * stride, stride, path, next_direction);
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, scaled(1.0f / survival, throughput));
    state->paths[PATH_BSDF_PDF * stride + path] = next.pdf;
    store_bits(state->paths, PATH_COUNTS * stride + path, bounces | (passages << 8) | ((ray + 1u) << 16));
    store_bits(state->paths, PATH_CLASS * stride + path, path_class | (goes_on ? CLASS_LIVE : 0u));
}

#ifndef BLOCKS
__kernel void medium_shade(const Params params, const uint count, __global const uint *list,
                           __global const Material *materials, __global float *hits, __global float *rays,
                           __global float *paths, __global float *shadows, __global float *radiance) {
    State state = {rays, paths, hits, shadows, radiance, params.path_stride, params.buffer_stride};
    if (get_global_id(0) >= count)
        return;
    uint path = list[get_global_id(0)];
    shade_medium_path(&params, materials, &state, path, params.first_path + path);
}
#endif
