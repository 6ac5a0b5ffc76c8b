#include "scene/light.cl"
#include "path/state.cl"

#ifdef LIGHT_SAMPLING
// Chooses a light for a path that stands on a surface: a direction, the radiance that comes along it when
// nothing is in the way, and its density. A stage of its own, since all surfaces share it, and since what
// PoCL vectorises it does in small kernels.
INLINE void sample_lights_path(const Params *params, const Emitters *emitters, const State *state,
                               uint path) {
    uint stride = STRIDE(state);
    Vec3 position = load3(state->hits + HIT_POSITION_X * stride, stride, path);
    uint seed = pixel_seed(load_bits(state->paths, PATH_PIXEL * stride + path), params->seed);
    uint sample = load_bits(state->paths, PATH_SAMPLE * stride + path);
    uint ray = (load_bits(state->paths, PATH_COUNTS * stride + path) >> 16) & 0xffu;
    Uniform2 uv = uniform_2d(seed, sample, PAIR_LIGHT(ray));
    float choice = uniform_2d(seed, sample, PAIR_CHOICE(ray)).v;
    LightSample light = sample_light(params, emitters, position, uv, choice);

    store3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path, light.direction);
    // A little short, so that the light's own surface is not in its way.
    state->shadows[SHADOW_DISTANCE * stride + path] = light.distance * 0.9999f;
    store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, light.radiance);
    state->shadows[SHADOW_PDF * stride + path] = light.pdf;
}

#ifndef BLOCKS
__kernel void sample_lights(const Params params, const uint count, __global const uint *list,
                            __global const float *lights, __global const float *environment_image,
                            __global const float *environment_marginal,
                            __global const float *environment_conditional,
                            __global const float *environment_pdf, __global float *hits,
                            __global float *paths, __global float *shadows) {
    State state = {0, paths, hits, shadows, 0, params.path_stride, params.buffer_stride};
    Emitters emitters = {
        0, lights, environment_image, environment_marginal, environment_conditional, environment_pdf};
    uint item = (uint)get_global_id(0);
    sample_lights_path(&params, &emitters, &state, item < count ? list[item] : state.stride - 1u);
}
#endif
#endif
