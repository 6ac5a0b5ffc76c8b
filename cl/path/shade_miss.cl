#include "scene/light.cl"
#include "shading/medium.cl"

// Radiance from far away for a path whose ray left the scene, weighted against light sampling of the
// environment. Its end. The variant MEDIA serves scenes with transparent bodies: from inside one that is
// open, a ray leaves through an endless stretch of its medium, as a shadow ray to the environment does.
INLINE void shade_miss_path(const Params *params, const Emitters *emitters, const State *state, uint path,
                            uint result) {
    uint stride = STRIDE(state);
    Vec3 direction = load3(state->rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 throughput = load3(state->paths + PATH_THROUGHPUT_R * stride, stride, path);
#ifdef MEDIA
    uint medium = load_medium_stack(state, path).entry[0];
    throughput = mul(throughput, transmittance(emitters->materials, medium, INFINITY));
#endif
    float bsdf_pdf = state->paths[PATH_BSDF_PDF * stride + path];
    float light_pdf;
    Vec3 arriving = eval_environment(params, emitters, direction, &light_pdf);
    float weight = bsdf_pdf > 0.0f ? mis_weight(MAX(bsdf_pdf, 1e-30f), light_pdf) : 1.0f;
    accumulate(state, result, mul(throughput, scale(weight, arriving)));
}

#ifndef BLOCKS
__kernel void shade_miss(const Params params, const uint count, __global const uint *list,
                         __global const Material *materials, __global const float *environment_image,
                         __global const float *environment_pdf, __global float *rays, __global float *paths,
                         __global float *radiance) {
    State state = {rays, paths, 0, 0, radiance, params.path_stride, params.buffer_stride};
    Emitters emitters = {materials, 0, environment_image, 0, 0, environment_pdf};
    uint item = (uint)get_global_id(0);
    int listed = item < count;
    uint path = listed ? list[item] : state.stride - 1u;
    shade_miss_path(&params, &emitters, &state, path,
                    listed ? params.first_path + path : state.radiance_stride - 1u);
}
#endif
