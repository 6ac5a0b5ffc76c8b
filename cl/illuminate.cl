#include "light.cl"

// Chooses a light for each path that stands on a surface: a direction, the radiance that comes along it when
// nothing is in the way, and its density. A stage of its own, since all surfaces share it, and since what
// PoCL vectorises it does in small kernels.
__kernel void illuminate(const Params params, const uint count, __global const uint *list,
                         __global const float *lights, __global const float *environment_image,
                         __global const float *environment_marginal,
                         __global const float *environment_conditional, __global const float *environment_pdf,
                         __global const float *hits, __global const float *paths, __global float *shadows) {
    uint stride = params.path_stride;
    uint item = (uint)get_global_id(0);
    uint path = item < count ? list[item] : stride - 1u;
    __global const uint *bits = (__global const uint *)paths;
    Emitters emitters;
    emitters.lights = lights;
    emitters.image = environment_image;
    emitters.marginal = environment_marginal;
    emitters.conditional = environment_conditional;
    emitters.texel_pdf = environment_pdf;

    Vec3 position = load3(hits + HIT_POSITION_X * stride, stride, path);
    uint seed = pixel_seed(bits[PATH_PIXEL * stride + path], params.seed);
    uint sample = bits[PATH_SAMPLE * stride + path];
    uint ray = (bits[PATH_COUNTS * stride + path] >> 16) & 0xffu;
    Uniform2 uv = uniform_2d(seed, sample, PAIR_LIGHT(ray));
    float choice = uniform_2d(seed, sample, PAIR_CHOICE(ray)).v;
    LightSample light = sample_light(&params, &emitters, position, uv, choice);

    store3(shadows + SHADOW_DIRECTION_X * stride, stride, path, light.direction);
    // A little short, so that the light's own surface is not in its way.
    shadows[SHADOW_DISTANCE * stride + path] = light.distance * 0.9999f;
    store3(shadows + SHADOW_RADIANCE_R * stride, stride, path, light.radiance);
    shadows[SHADOW_PDF * stride + path] = light.pdf;
}
