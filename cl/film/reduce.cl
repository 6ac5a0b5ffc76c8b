#include "path/tile.cl"

// Adds up the repetitions of each tile and puts the sums into the film.
//
// One work-item for each pixel of each group of slots; `groups` holds the first slot of each. Film and
// `pending` have four planes: sum of red, green, blue, and the number of samples. A tile whose repetitions
// take several steps is kept in `pending` until its last one, so that the film shows finished tiles only.
// Samples that are not finite count as black and are counted.
__kernel void reduce(const Params params, const uint group_total, __global const uint *groups,
                     __global const Slot *slots, __global const float *radiance, __global float *pending,
                     __global float *film, __global uint *nonfinite) {
    uint tile_pixels = params.tile_size * params.tile_size;
    uint group = (uint)get_global_id(0) / tile_pixels;
    if (group >= group_total)
        return;
    __global const Slot *slot = &slots[groups[group]];
    uint in_tile = (uint)get_global_id(0) % tile_pixels;
    TilePixel at = {in_tile % params.tile_size, in_tile / params.tile_size};
    uint x = slot->tile_x + at.x, y = slot->tile_y + at.y;
    if (x >= params.width || y >= params.height)
        return;

    uint count = slot->group_count;
    uint begin = slot->group_first * tile_pixels + tile_place(&params, at) * count;
    float sum[3] = {0.0f, 0.0f, 0.0f};
    uint bad = 0u;
    for (uint i = begin; i < begin + count; i++) {
        float r = radiance[i], g = radiance[params.buffer_stride + i],
              b = radiance[2u * params.buffer_stride + i];
        // x - x is 0 for finite numbers alone.
        int finite = (r - r == 0.0f) & (g - g == 0.0f) & (b - b == 0.0f);
        bad += !finite;
        sum[0] += finite ? r : 0.0f;
        sum[1] += finite ? g : 0.0f;
        sum[2] += finite ? b : 0.0f;
    }
    if (bad)
        atomic_add(nonfinite, bad);

    uint pixels = params.width * params.height;
    uint pixel = y * params.width + x;
    uint flags = slot->flags;
    for (uint plane = 0u; plane < 4u; plane++) {
        uint place = plane * pixels + pixel;
        float value = plane < 3u ? sum[plane] : (float)count;
        value += flags & SLOT_FIRST ? 0.0f : pending[place];
        if (flags & SLOT_LAST)
            film[place] = value + (flags & SLOT_REPLACE ? 0.0f : film[place]);
        else
            pending[place] = value;
    }
}
