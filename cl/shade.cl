#include "light.cl"

// What happens where a ray ends on an opaque surface: the path gathers what is emitted there, asks for a
// shadow ray towards a light, and goes on in a direction that the material chooses.
//
//   L_o(wo) = L_e(wo) + integral of f(wo, wi) L_i(wi) cos(wi) d wi
//
// with the integral estimated by light sampling (`illuminate` has chosen a light) and by BSDF sampling (the
// next ray, whose emission counts at its end), combined by multiple importance sampling. Straight-line code
// of scalars, so that PoCL runs it in SIMD lanes. The variant EMISSION_ONLY serves rays after which no path
// goes on.
__kernel void shade(const Params params, const uint count, __global const uint *list,
                    __global const Material *materials, __global const float *layers,
                    __global const float *hits, __global float *rays, __global float *paths,
                    __global float *shadows, __global float *radiance) {
    uint stride = params.path_stride;
    uint item = (uint)get_global_id(0);
    int listed = item < count;
    uint path = listed ? list[item] : stride - 1u;
    uint result = listed ? params.first_path + path : params.buffer_stride - 1u;
    __global uint *bits = (__global uint *)paths;

    // Where the ray ended.
    uint material_index = ((__global const uint *)hits)[HIT_MATERIAL * stride + path];
    __global const Material *material = &materials[material_index];
    Vec3 direction = load3(rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 position = load3(hits + HIT_POSITION_X * stride, stride, path);
    Vec3 geometric = load3(hits + HIT_GEOMETRIC_X * stride, stride, path);
    Vec3 shading = load3(hits + HIT_SHADING_X * stride, stride, path);
    float distance = hits[HIT_DISTANCE * stride + path];
    float offset = hits[HIT_OFFSET * stride + path];
    Vec3 throughput = load3(paths + PATH_THROUGHPUT_R * stride, stride, path);
    float bsdf_pdf = paths[PATH_BSDF_PDF * stride + path];
    uint counts = bits[PATH_COUNTS * stride + path];
    uint bounces = counts & 0xffu;
    uint ray = (counts >> 16) & 0xffu;

    float facing = -inner(geometric, direction);
    Vec3 emitted = emitted_radiance(material, facing, distance, bsdf_pdf);
    Vec3 gathered = load3(radiance, params.buffer_stride, result);
    store3(radiance, params.buffer_stride, result, add(gathered, times(throughput, emitted)));

#ifdef EMISSION_ONLY
    bits[PATH_CLASS * stride + path] = 0u;
#else
    // The surface as seen along the ray: both normals on its side.
    float side = facing > 0.0f ? 1.0f : -1.0f;
    geometric = scaled(side, geometric);
    shading = scaled(side, shading);
    shading = choose(inner(shading, direction) < -1e-4f, shading, geometric);
    Frame frame = frame_of(shading);
    Vec3 wo = to_local(frame, scaled(-1.0f, direction));
    wo.z = MAX(wo.z, 1e-4f);
    Surface surface = surface_of(material, layers + material_index * (ALBEDO_TABLE_SIZE + 1u));
    Vec3 origin = along(position, offset, geometric);
    int scatters = bounces <= params.max_bounces;

    uint seed = pixel_seed(bits[PATH_PIXEL * stride + path], params.seed);
    uint sample = bits[PATH_SAMPLE * stride + path];
    Uniform2 choices = uniform_2d(seed, sample, PAIR_CHOICE(ray));
    uint path_class = 0u;

    // Light sampling: a shadow ray, if the light's side of the surface is the ray's side.
#ifdef LIGHT_SAMPLING
    Vec3 to_light = load3(shadows + SHADOW_DIRECTION_X * stride, stride, path);
    float light_pdf = shadows[SHADOW_PDF * stride + path];
    BsdfValue towards_light = eval_surface(&surface, wo, to_local(frame, to_light));
    int lit =
        scatters & (light_pdf > 0.0f) & (towards_light.pdf > 0.0f) & (inner(geometric, to_light) > 0.0f);
    light_pdf = lit ? light_pdf : 1.0f;
    float light_weight = mis_weight(light_pdf, towards_light.pdf) / light_pdf;
    Vec3 arriving = load3(shadows + SHADOW_RADIANCE_R * stride, stride, path);
    arriving = times(times(throughput, towards_light.f_cos), scaled(light_weight, arriving));
    store3(shadows + SHADOW_ORIGIN_X * stride, stride, path, origin);
    store3(shadows + SHADOW_RADIANCE_R * stride, stride, path, arriving);
    path_class = (lit & (largest(arriving) > 0.0f)) ? CLASS_SHADOW : 0u;
#endif

    // BSDF sampling: the next ray.
    BsdfSample next = sample_surface(&surface, wo, uniform_2d(seed, sample, PAIR_DIRECTION(ray)), choices.u);
    Vec3 next_direction = from_local(frame, next.wi);
    throughput = times(throughput, next.weight);
    int goes_on = scatters & (next.pdf > 0.0f) & (inner(geometric, next_direction) > 0.0f);

    // Russian roulette: a path that carries little may end, one that survives stands for those that did not.
    float survival = survival_probability(throughput, bounces, params.roulette_depth);
    float luck = uniform_2d(seed, sample, PAIR_LUCK(ray)).u;
    goes_on = goes_on & (luck < survival) & (largest(throughput) > 0.0f);
    throughput = scaled(1.0f / survival, throughput);

    store3(rays + RAY_ORIGIN_X * stride, stride, path, origin);
    store3(rays + RAY_DIRECTION_X * stride, stride, path, unit(next_direction));
    store3(paths + PATH_THROUGHPUT_R * stride, stride, path, throughput);
    paths[PATH_BSDF_PDF * stride + path] = next.pdf;
    bits[PATH_COUNTS * stride + path] = counts + 0x10001u;
    bits[PATH_CLASS * stride + path] = path_class | (goes_on ? CLASS_LIVE : 0u);
#endif
}
