#include "camera.cl"
#include "rng.cl"

// Starts the paths of a chunk: for every path the slot, the pixel and the sample index that the plan gives
// it, and its camera ray. Paths of a group of slots go pixel by pixel with the repetitions innermost.
__kernel void generate(const Params params, __global const Slot *slots, __global float *rays,
                       __global float *paths, __global float *radiance) {
    uint stride = params.path_stride;
    uint k = (uint)get_global_id(0);
    int inside_chunk = k < params.path_count;
    uint path = inside_chunk ? k : stride - 1u;
    uint result = inside_chunk ? params.first_path + k : params.buffer_stride - 1u;

    uint tile_pixels = params.tile_size * params.tile_size;
    __global const Slot *slot = &slots[inside_chunk ? result / tile_pixels : 0u];
    uint group_count = slot->group_count;
    uint place = (inside_chunk ? result : 0u) - slot->group_first * tile_pixels;
    uint tile_pixel = place / group_count;
    uint sample = slot->first_sample + (place - tile_pixel * group_count);
    uint row = tile_pixel / params.tile_size;
    uint x = slot->tile_x + (tile_pixel - row * params.tile_size);
    uint y = slot->tile_y + row;
    int inside_image = inside_chunk & (x < params.width) & (y < params.height);

    uint pixel = y * params.width + x;
    Uniform2 jitter = uniform_2d(pixel_seed(pixel, params.seed), sample, PAIR_PIXEL);
    int center = params.pixel_center != 0u;
    Vec3 direction = camera_direction(&params, (float)x + (center ? 0.5f : jitter.u),
                                      (float)y + (center ? 0.5f : jitter.v));
    Vec3 position = vec3(params.camera.position[0], params.camera.position[1], params.camera.position[2]);

    __global uint *bits = (__global uint *)paths;
    store3(rays + RAY_ORIGIN_X * stride, stride, path, position);
    store3(rays + RAY_DIRECTION_X * stride, stride, path, direction);
    store3(paths + PATH_THROUGHPUT_R * stride, stride, path, vec3(1.0f, 1.0f, 1.0f));
    paths[PATH_BSDF_PDF * stride + path] = 0.0f;
    bits[PATH_PIXEL * stride + path] = pixel;
    bits[PATH_SAMPLE * stride + path] = sample;
    bits[PATH_COUNTS * stride + path] = 0u;
    bits[PATH_MEDIUM_0 * stride + path] = 0xffffffffu;
    bits[PATH_MEDIUM_1 * stride + path] = 0xffffffffu;
    bits[PATH_CLASS * stride + path] = inside_image ? CLASS_LIVE : 0u;
    store3(radiance, params.buffer_stride, result, vec3(0.0f, 0.0f, 0.0f));
}
