#include "scene/light.cl"
#include "path/state.cl"

// What happens where a ray ends on an opaque surface: the path gathers what is emitted there, asks for a
// shadow ray towards a light, and goes on in a direction that the material chooses.
//
//   L_o(wo) = L_e(wo) + integral of f(wo, wi) L_i(wi) cos(wi) d wi
//
// with the integral estimated by light sampling (`sample_lights` has chosen a light) and by BSDF sampling
// (the next ray, whose emission counts at its end), combined by multiple importance sampling. Straight-line
// code of scalars, so that PoCL runs it in SIMD lanes.

// The path's end: rays after which no path goes on gather emission only.
INLINE void finish_path(__global const Material *materials, const State *state, uint path, uint result) {
    uint stride = STRIDE(state);
    __global const Material *material = &materials[load_bits(state->hits, HIT_MATERIAL * stride + path)];
    Vec3 direction = load3(state->rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 geometric = load3(state->hits + HIT_GEOMETRIC_X * stride, stride, path);
    Vec3 throughput = load3(state->paths + PATH_THROUGHPUT_R * stride, stride, path);
    Vec3 emitted =
        emitted_radiance(material, -dot(geometric, direction), state->hits[HIT_DISTANCE * stride + path],
                         state->paths[PATH_BSDF_PDF * stride + path]);
    accumulate(state, result, mul(throughput, emitted));
    store_bits(state->paths, PATH_CLASS * stride + path, 0u);
}

INLINE void shade_path(const Params *params, __global const Material *materials, __global const float *layers,
                       const State *state, uint path, uint result) {
    uint stride = STRIDE(state);

    // Where the ray ended.
    uint material_index = load_bits(state->hits, HIT_MATERIAL * stride + path);
    __global const Material *material = &materials[material_index];
    Vec3 direction = load3(state->rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 position = load3(state->hits + HIT_POSITION_X * stride, stride, path);
    Vec3 geometric = load3(state->hits + HIT_GEOMETRIC_X * stride, stride, path);
    Vec3 shading = load3(state->hits + HIT_SHADING_X * stride, stride, path);
    float distance = state->hits[HIT_DISTANCE * stride + path];
    float offset = state->hits[HIT_OFFSET * stride + path];
    Vec3 throughput = load3(state->paths + PATH_THROUGHPUT_R * stride, stride, path);
    float bsdf_pdf = state->paths[PATH_BSDF_PDF * stride + path];
    uint counts = load_bits(state->paths, PATH_COUNTS * stride + path);
    uint bounces = counts & 0xffu;
    uint ray = (counts >> 16) & 0xffu;

    float facing = -dot(geometric, direction);
    Vec3 emitted = emitted_radiance(material, facing, distance, bsdf_pdf);
    accumulate(state, result, mul(throughput, emitted));

    // The surface as seen along the ray: both normals on its side.
    float side = facing > 0.0f ? 1.0f : -1.0f;
    geometric = scale(side, geometric);
    shading = scale(side, shading);
    shading = select(dot(shading, direction) < -1e-4f, shading, geometric);
    Frame frame = frame_of(shading);
    Vec3 wo = to_local(frame, scale(-1.0f, direction));
    wo.z = MAX(wo.z, 1e-4f);
    Surface surface = surface_of(material, layers + material_index * (ALBEDO_TABLE_SIZE + 1u));
    Vec3 origin = along(position, offset, geometric);
    int scatters = bounces <= params->max_bounces;

    uint seed = pixel_seed(load_bits(state->paths, PATH_PIXEL * stride + path), params->seed);
    uint sample = load_bits(state->paths, PATH_SAMPLE * stride + path);
    Uniform2 choices = uniform_2d(seed, sample, PAIR_CHOICE(ray));
    uint path_class = 0u;

    // Light sampling: a shadow ray, if the light's side of the surface is the ray's side.
#ifdef LIGHT_SAMPLING
    Vec3 to_light = load3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path);
    float light_pdf = state->shadows[SHADOW_PDF * stride + path];
    BsdfValue towards_light = eval_surface(&surface, wo, to_local(frame, to_light));
    int lit = scatters & (light_pdf > 0.0f) & (towards_light.pdf > 0.0f) & (dot(geometric, to_light) > 0.0f);
    light_pdf = lit ? light_pdf : 1.0f;
    float light_weight = mis_weight(light_pdf, towards_light.pdf) / light_pdf;
    Vec3 arriving = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
    arriving = mul(mul(throughput, towards_light.f_cos), scale(light_weight, arriving));
    store3(state->shadows + SHADOW_ORIGIN_X * stride, stride, path, origin);
    store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, arriving);
    path_class = (lit & (largest(arriving) > 0.0f)) ? CLASS_SHADOW : 0u;
#endif

    // BSDF sampling: the next ray.
    BsdfSample next = sample_surface(&surface, wo, uniform_2d(seed, sample, PAIR_DIRECTION(ray)), choices.u);
    Vec3 next_direction = from_local(frame, next.wi);
    throughput = mul(throughput, next.weight);
    int goes_on = scatters & (next.pdf > 0.0f) & (dot(geometric, next_direction) > 0.0f);

    // Russian roulette: a path that carries little may end, one that survives stands for those that did not.
    float survival = survival_probability(throughput, bounces, params->roulette_depth);
    float luck = uniform_2d(seed, sample, PAIR_LUCK(ray)).u;
    goes_on = goes_on & (luck < survival) & (largest(throughput) > 0.0f);
    throughput = scale(1.0f / survival, throughput);

    store3(state->rays + RAY_ORIGIN_X * stride, stride, path, origin);
    store3(state->rays + RAY_DIRECTION_X * stride, stride, path, normalize(next_direction));
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, throughput);
    state->paths[PATH_BSDF_PDF * stride + path] = next.pdf;
    store_bits(state->paths, PATH_COUNTS * stride + path, counts + 0x10001u);
    store_bits(state->paths, PATH_CLASS * stride + path, path_class | (goes_on ? CLASS_LIVE : 0u));
}

#ifndef BLOCKS
// The variant EMISSION_ONLY serves rays after which no path goes on.
__kernel void shade(const Params params, const uint count, __global const uint *list,
                    __global const Material *materials, __global const float *layers, __global float *hits,
                    __global float *rays, __global float *paths, __global float *shadows,
                    __global float *radiance) {
    State state = {rays, paths, hits, shadows, radiance, params.path_stride, params.buffer_stride};
    uint item = (uint)get_global_id(0);
    int listed = item < count;
    uint path = listed ? list[item] : state.stride - 1u;
    uint result = listed ? params.first_path + path : state.radiance_stride - 1u;
#ifdef EMISSION_ONLY
    finish_path(materials, &state, path, result);
#else
    shade_path(&params, materials, layers, &state, path, result);
#endif
}
#endif
