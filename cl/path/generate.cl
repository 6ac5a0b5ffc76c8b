#include "scene/camera.cl"
#include "base/rng.cl"
#include "path/state.cl"
#include "path/tile.cl"

// Starts a path: the slot, the pixel and the sample index that the plan gives to its place in the path
// buffer, and its camera ray. Paths of a group of slots go pixel by pixel with the repetitions innermost.
INLINE void generate_path(const Params *params, __global const Slot *slots, const State *state, uint path,
                          uint place) {
    uint stride = STRIDE(state);
    uint tile_pixels = params->tile_size * params->tile_size;
    __global const Slot *slot = &slots[quotient(place, tile_pixels)];
    uint group_count = slot->group_count;
    uint group_place = place - slot->group_first * tile_pixels;
    uint pixel_place = quotient(group_place, group_count);
    uint sample = slot->first_sample + (group_place - pixel_place * group_count);
    TilePixel at = tile_pixel(params, pixel_place);
    uint x = slot->tile_x + at.x, y = slot->tile_y + at.y;
    int inside_image = (x < params->width) & (y < params->height);

    uint pixel = y * params->width + x;
    Uniform2 jitter = uniform_2d(pixel_seed(pixel, params->seed), sample, PAIR_PIXEL);
    int center = params->pixel_center != 0u;
    Vec3 direction = camera_direction(params, (float)x + (center ? 0.5f : jitter.u),
                                      (float)y + (center ? 0.5f : jitter.v));
    Vec3 position = vec3(params->camera.position[0], params->camera.position[1], params->camera.position[2]);

    store3(state->rays + RAY_ORIGIN_X * stride, stride, path, position);
    store3(state->rays + RAY_DIRECTION_X * stride, stride, path, direction);
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, vec3(1.0f, 1.0f, 1.0f));
    state->paths[PATH_BSDF_PDF * stride + path] = 0.0f;
    store_bits(state->paths, PATH_PIXEL * stride + path, pixel);
    store_bits(state->paths, PATH_SAMPLE * stride + path, sample);
    store_bits(state->paths, PATH_COUNTS * stride + path, 0u);
    store_bits(state->paths, PATH_MEDIUM_0 * stride + path, 0xffffffffu);
    store_bits(state->paths, PATH_MEDIUM_1 * stride + path, 0xffffffffu);
    store_bits(state->paths, PATH_CLASS * stride + path, inside_image ? CLASS_LIVE : 0u);
}

#ifndef BLOCKS
// Starts the paths of a chunk.
__kernel void generate(const Params params, __global const Slot *slots, __global float *rays,
                       __global float *paths, __global float *radiance) {
    State state = {rays, paths, 0, 0, radiance, params.path_stride, params.buffer_stride};
    uint k = (uint)get_global_id(0);
    int listed = k < params.path_count;
    uint result = listed ? params.first_path + k : state.radiance_stride - 1u;
    generate_path(&params, slots, &state, listed ? k : state.stride - 1u, listed ? result : 0u);
    store3(radiance, state.radiance_stride, result, vec3(0.0f, 0.0f, 0.0f));
}
#endif
