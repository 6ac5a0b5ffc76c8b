#include "light.cl"
#include "medium.cl"

// Radiance from far away for the paths whose ray left the scene, weighted against light sampling of the
// environment. Their end. The variant MEDIA serves scenes with transparent bodies: from inside one that is
// open, a ray leaves through an endless stretch of its medium, as a shadow ray to the environment does.
__kernel void escape(const Params params, const uint count, __global const uint *list,
                     __global const Material *materials, __global const float *environment_image,
                     __global const float *environment_pdf, __global const float *rays,
                     __global const float *paths, __global float *radiance) {
    uint stride = params.path_stride;
    uint item = (uint)get_global_id(0);
    int listed = item < count;
    uint path = listed ? list[item] : stride - 1u;
    uint result = listed ? params.first_path + path : params.buffer_stride - 1u;
    Emitters emitters;
    emitters.image = environment_image;
    emitters.texel_pdf = environment_pdf;

    Vec3 direction = load3(rays + RAY_DIRECTION_X * stride, stride, path);
    Vec3 throughput = load3(paths + PATH_THROUGHPUT_R * stride, stride, path);
#ifdef MEDIA
    uint medium = load_medium_stack((__global const uint *)paths, stride, path).entry[0];
    throughput = times(throughput, transmittance(materials, medium, INFINITY));
#endif
    float bsdf_pdf = paths[PATH_BSDF_PDF * stride + path];
    float light_pdf;
    Vec3 arriving = eval_environment(&params, &emitters, direction, &light_pdf);
    float weight = bsdf_pdf > 0.0f ? mis_weight(MAX(bsdf_pdf, 1e-30f), light_pdf) : 1.0f;
    Vec3 gathered = load3(radiance, params.buffer_stride, result);
    arriving = times(throughput, scaled(weight, arriving));
    store3(radiance, params.buffer_stride, result, add(gathered, arriving));
}
