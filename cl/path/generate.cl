#include "scene/camera.cl"
#include "scene/lens.cl"
#include "base/rng.cl"
#include "path/state.cl"
#include "path/tile.cl"

// Starts a path: the slot, the pixel and the sample index that the plan gives to its place among the paths of
// all slots, and its camera ray. Paths of a group of slots go pixel by pixel with the repetitions innermost.
INLINE void generate_path(const Params *params, __global const Slot *slots, const State *state, uint path,
                          uint place) {
    uint tile_pixels = params->tile_size * params->tile_size;
    __global const Slot *slot = &slots[quotient(place, tile_pixels)];
    uint group_count = slot->group_count;
    uint group_place = place - slot->group_first * tile_pixels;
    uint pixel_place = quotient(group_place, group_count);
    uint sample = slot->first_sample + (group_place - pixel_place * group_count);
    TilePixel at = tile_pixel(params, pixel_place);
    uint x = slot->tile_x + at.x * slot->pixel_step, y = slot->tile_y + at.y * slot->pixel_step;
    int inside_image = (x < params->width) & (y < params->height);

    uint pixel = y * params->width + x;
    Uniform2 jitter = uniform_2d(pixel_seed(pixel, params->seed), sample, PAIR_PIXEL);
    int center = params->pixel_center != 0u;
    float image_x = (float)x + (center ? 0.5f : jitter.u), image_y = (float)y + (center ? 0.5f : jitter.v);
#ifdef LENS
    Uniform2 aperture =
        sample_aperture(params, uniform_2d(pixel_seed(pixel, params->seed), sample, PAIR_LENS));
    aperture.u = center ? 0.0f : aperture.u;
    aperture.v = center ? 0.0f : aperture.v;
    Ray ray = lens_ray(params, image_x, image_y, aperture);
#else
    Ray ray;
    ray.origin = camera_position(params);
    ray.direction = camera_direction(params, image_x, image_y);
#endif
    Path p;
    p.throughput = vec3(1.0f, 1.0f, 1.0f);
    p.bsdf_pdf = 0.0f;
    p.pixel = pixel;
    p.sample = sample;
    p.bounces = p.passages = p.ray = 0u;
    store_ray(state, path, ray);
    store_path(state, path, &p);
    store_bits(state->paths, PATH_MEDIUM_0 * STRIDE(state) + path, params->camera_media[0]);
    store_bits(state->paths, PATH_MEDIUM_1 * STRIDE(state) + path, params->camera_media[1]);
    store_class(state, path, inside_image ? CLASS_LIVE : 0u);
}

#ifndef BLOCKS
// Starts the paths of a chunk. With params.listed their places stand in a list.
__kernel void generate(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, PLACES_PARAMETERS, PATH_STATE_PARAMETERS) {
    const State state = STATE_OF(params);
    uint k = (uint)get_global_id(0);
    int started = k < params.path_count;
    uint number = params.first_path + (started ? k : 0u),
         result = started ? number : state.radiance_stride - 1u;
    uint listed = places[params.listed ? number : 0u];
    generate_path(&params, slots, &state, started ? k : state.stride - 1u, params.listed ? listed : number);
    store3(radiance, state.radiance_stride, result, vec3(0.0f, 0.0f, 0.0f));
}
#endif
