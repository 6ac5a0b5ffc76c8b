#include "path/state.cl"

// Auxiliary values of the first hit, from rays through pixel centres: `surface` has seven planes (shading
// normal, distance along the ray in metres, base colour) over the pixels; a miss has distance infinity.
__kernel void first_hits(const Params params, const uint pixels, __global const Material *materials,
                         __global const float *hits, __global const float *paths, __global float *surface,
                         __global uint *object_ids) {
    uint path = (uint)get_global_id(0);
    uint stride = params.path_stride;
    if (path >= params.path_count || !(((__global const uint *)paths)[PATH_CLASS * stride + path]))
        return;
    uint pixel = ((__global const uint *)paths)[PATH_PIXEL * stride + path];
    uint object = ((__global const uint *)hits)[HIT_OBJECT * stride + path];
    int missed = object == NO_INDEX;
    uint material = missed ? 0u : ((__global const uint *)hits)[HIT_MATERIAL * stride + path];
    __global const float *color = materials[material].base_color;
    Vec3 nothing = vec3(0.0f, 0.0f, 0.0f);
    object_ids[pixel] = object;
    store3(surface, pixels, pixel,
           select(missed, nothing, load3(hits + HIT_SHADING_X * stride, stride, path)));
    surface[3u * pixels + pixel] = missed ? INFINITY : hits[HIT_DISTANCE * stride + path];
    store3(surface + 4u * pixels, pixels, pixel, select(missed, nothing, vec3(color[0], color[1], color[2])));
}
