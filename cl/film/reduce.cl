#include "path/tile.cl"

// How many floats a sample has.
#ifndef CHANNELS
#define CHANNELS 3
#endif

// What is summed up of a sample.
#ifdef SQUARES
#define SUMMED(value) ((value) * (value))
#else
#define SUMMED(value) (value)
#endif

// Adds up the repetitions of each tile and puts the sums into one pass of the film.
//
// One work-item does one pixel of one group of slots; `groups` holds the first slot of each group. `samples`
// is the path buffer, in which the pass begins at plane `first_plane`. `film` and `pending` have CHANNELS
// planes of sums, and one of the number of samples. A tile whose repetitions take several steps is kept in
// `pending` until its last one, so that the film shows finished tiles only. A sample with a float that is not
// finite counts as zero, and is counted. Tiles with any of `replace_flags` replace what is in the
// film, others are added to it.
__kernel void reduce(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, TRACED_PARAMETERS, COUNTERS_PARAMETERS,
                     REDUCTION_PARAMETERS) {
    uint tile_pixels = params.tile_size * params.tile_size;
    uint group = (uint)get_global_id(0) / tile_pixels;
    if (group >= group_total)
        return;
    __global const Slot *slot = &slots[groups[group]];
    uint in_tile = (uint)get_global_id(0) % tile_pixels;
    TilePixel at = {in_tile % params.tile_size, in_tile / params.tile_size};
    uint x = slot->tile_x + at.x * slot->pixel_step, y = slot->tile_y + at.y * slot->pixel_step;
    if (x >= params.width || y >= params.height)
        return;

    uint count = slot->group_count;
    uint begin = slot->group_first * tile_pixels + tile_place(&params, at) * count;
    // Loops over the channels are unrolled by order: else PoCL leaves the sums in memory, and the whole
    // kernel takes four to eight times as long.
    float sum[CHANNELS] = {0.0f};
    uint bad = 0u;
    for (uint i = begin; i < begin + count; i++) {
        float value[CHANNELS];
        int finite = 1;
#pragma unroll
        for (uint channel = 0u; channel < CHANNELS; channel++) {
            value[channel] = samples[(first_plane + channel) * params.buffer_stride + i];
            // x - x is 0 for finite numbers alone.
            finite &= value[channel] - value[channel] == 0.0f;
        }
        bad += !finite;
#pragma unroll
        for (uint channel = 0u; channel < CHANNELS; channel++)
            sum[channel] += finite ? SUMMED(value[channel]) : 0.0f;
    }
    if (bad)
        atomic_add(&counters[COUNTER_NONFINITE], bad);

    uint pixels = params.width * params.height;
    uint pixel = y * params.width + x;
    uint flags = slot->flags;
    for (uint plane = 0u; plane <= CHANNELS; plane++) {
        uint place = plane * pixels + pixel;
        float value = plane < CHANNELS ? sum[plane] : (float)count;
        value += flags & SLOT_FIRST ? 0.0f : pending[place];
        if (flags & SLOT_LAST)
            film[place] = value + (flags & replace_flags ? 0.0f : film[place]);
        else
            pending[place] = value;
    }
}
