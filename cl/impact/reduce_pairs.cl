#include "path/tile.cl"

// Adds what pairs of paths have brought to the sums of their pixels, see layout.PairPlane.
//
// One work-item does one pixel of one group of slots, as in film/reduce.cl. `partner_of_path` says of each
// path where its radiance in the old scene stands among `partner_radiance`: NO_INDEX where it met nothing
// that changed, so that it is the same; NO_PARTNER where it did, but was not traced there, because its slot
// is SINGLE. In such a slot no sample counts as a pair: those that met no change are not like the others. No
// pixel may be in two groups of a launch.
__kernel void reduce_pairs(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, TRACED_PARAMETERS, PAIRS_PARAMETERS,
                           OLD_VALUES_PARAMETERS) {
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
    uint pixels = params.width * params.height, pixel = y * params.width + x;
    float kept = anchor_sums[3u * pixels + pixel];
    float per_kept = kept > 0.0f ? 1.0f / kept : 0.0f;
    float anchor[3];
#pragma unroll
    for (uint c = 0u; c < 3u; c++)
        anchor[c] = anchor_sums[c * pixels + pixel] * per_kept;

    uint single = slot->flags & SLOT_SINGLE, count = slot->group_count;
    uint begin = slot->group_first * tile_pixels + tile_place(&params, at) * count;
    float new_sum[6] = {0.0f}, old_sum[6] = {0.0f};
    float new_moment = 0.0f, old_moment = 0.0f, joint_moment = 0.0f;
    uint touched = 0u, odd_count = 0u, bad = 0u;
    for (uint i = 0u; i < count; i++) {
        uint place = partner_of_path[begin + i];
        uint odd = (slot->first_sample + i + x + y + x / 4u + y / 4u) & 1u;
        int traced_twice = (place != NO_INDEX) & (place != NO_PARTNER);
        touched += place != NO_INDEX;
        odd_count += odd;
        float new_value[3], old_value[3];
        int finite = 1, old_finite = 1;
#pragma unroll
        for (uint c = 0u; c < 3u; c++) {
            new_value[c] = samples[c * params.buffer_stride + begin + i];
            old_value[c] = traced_twice ? partner_radiance[c * partner_stride + place] : new_value[c];
            // x - x is 0 for finite numbers alone.
            finite &= new_value[c] - new_value[c] == 0.0f;
            old_finite &= old_value[c] - old_value[c] == 0.0f;
        }
        bad += !finite + (traced_twice & !old_finite);
        float even_share = odd ? 0.0f : 1.0f, odd_share = odd ? 1.0f : 0.0f;
#pragma unroll
        for (uint c = 0u; c < 3u; c++) {
            float a = (finite ? new_value[c] : 0.0f) - anchor[c];
            float b = (old_finite ? old_value[c] : 0.0f) - anchor[c];
            new_sum[c] += even_share * a;
            new_sum[3u + c] += odd_share * a;
            old_sum[c] += even_share * b;
            old_sum[3u + c] += odd_share * b;
            new_moment += a * a;
            old_moment += b * b;
            joint_moment += a * b;
        }
    }
    if (bad)
        atomic_add(nonfinite, bad);

    __global float *sums = pairs + pixel;
#pragma unroll
    for (uint c = 0u; c < 6u; c++) {
        sums[(PAIR_NEW_R_0 + c) * pixels] += new_sum[c];
        sums[(PAIR_OLD_R_0 + c) * pixels] += single ? 0.0f : old_sum[c];
    }
    float odd = (float)odd_count, even = (float)(count - odd_count);
    sums[PAIR_SAMPLES_0 * pixels] += even;
    sums[PAIR_SAMPLES_1 * pixels] += odd;
    sums[PAIR_PAIRS_0 * pixels] += single ? 0.0f : even;
    sums[PAIR_PAIRS_1 * pixels] += single ? 0.0f : odd;
    sums[PAIR_NEW_MOMENT * pixels] += new_moment * (1.0f / 3.0f);
    sums[PAIR_OLD_MOMENT * pixels] += single ? 0.0f : old_moment * (1.0f / 3.0f);
    sums[PAIR_JOINT_MOMENT * pixels] += single ? 0.0f : joint_moment * (1.0f / 3.0f);
    sums[PAIR_TOUCHED * pixels] += (float)touched;
}
