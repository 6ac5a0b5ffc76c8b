#include "cpu/lanes.cl"
#include "path/tile.cl"

// Pixels next to each other that a work-item does: on CPUs in SIMD lanes, whose sums stay in the nearest
// cache.
#ifdef CLANG_CPU
#define RUN 64u
#else
#define RUN 1u
#endif

// What the samples of a pixel bring in this launch.
enum {
    NEW_SUMS = 0, // red, green and blue of one half, then of the other
    OLD_SUMS = 6,
    NEW_SQUARES = 12,
    OLD_SQUARES,
    PRODUCTS,
    TOUCHED_COUNT,
    ODD_COUNT,
    BAD_COUNT,
    RUN_PLANES
};

// Adds what pairs of paths have brought to the sums of their pixels, see layout.PairPlane.
//
// One work-item does a run of pixels in a row of one group of slots. `partner_of_path` says of each path
// where its radiance in the old scene stands among `partner_radiance`: NO_INDEX where it met nothing that
// changed, so that it is the same; NO_PARTNER where it did, but was not traced there, because its slot is
// SINGLE. In such a slot no sample counts as a pair: those that met no change are not like the others. A
// radiance with a float that is not finite counts as black, and is counted. No pixel may be in two groups of
// a launch.
__kernel WIDE void reduce_pairs(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, TRACED_PARAMETERS, COUNTERS_PARAMETERS,
                                PAIRS_PARAMETERS, OLD_VALUES_PARAMETERS) {
    const uint runs = (params.tile_size + RUN - 1u) / RUN, item = (uint)get_global_id(0);
    const uint group = item / (params.tile_size * runs);
    if (group >= group_total)
        return;
    __global const Slot *slot = &slots[groups[group]];
    const uint row = item / runs % params.tile_size, first = item % runs * RUN, step = slot->pixel_step;
    const uint x = slot->tile_x + first * step, y = slot->tile_y + row * step;
    if (x >= params.width || y >= params.height)
        return;
    const size_t length = MIN(MIN(RUN, params.tile_size - first), (params.width - x + step - 1u) / step);
    const size_t pixels = (size_t)params.width * params.height, pixel = (size_t)y * params.width + x;
    const uint count = slot->group_count, tile_pixels = params.tile_size * params.tile_size;

    float anchor[3][RUN], sums[RUN_PLANES][RUN];
    uint places[RUN];
    LANES
    for (size_t i = 0u; i < length; i++) {
        const TilePixel at = {first + (uint)i, row};
        places[i] = slot->group_first * tile_pixels + tile_place(&params, at) * count;
        const float kept = anchor_sums[3u * pixels + pixel + i * step];
        const float per_kept = kept > 0.0f ? 1.0f / kept : 0.0f;
#pragma unroll
        for (size_t c = 0u; c < 3u; c++)
            anchor[c][i] = anchor_sums[c * pixels + pixel + i * step] * per_kept;
#pragma unroll
        for (size_t plane = 0u; plane < RUN_PLANES; plane++)
            sums[plane][i] = 0.0f;
    }
    for (uint sample = 0u; sample < count; sample++) {
        const uint index = slot->first_sample + sample;
        LANES
        for (size_t i = 0u; i < length; i++) {
            const uint path = places[i] + sample, partner = partner_of_path[path];
            const int traced_twice = (partner != NO_INDEX) & (partner != NO_PARTNER);
            const uint partner_place = traced_twice ? partner : 0u;
            const uint at_x = x + (uint)i * step;
            const float odd = (float)(int)((index + at_x + y + at_x / 4u + y / 4u) & 1u), even = 1.0f - odd;
            float new_value[3], old_value[3];
            int finite = 1, old_finite = 1;
#pragma unroll
            for (uint c = 0u; c < 3u; c++) {
                const float in_new = samples[c * params.buffer_stride + path];
                const float in_old = partner_radiance[c * partner_stride + partner_place];
                new_value[c] = in_new;
                old_value[c] = traced_twice ? in_old : in_new;
                // x - x is 0 for finite numbers alone.
                finite &= new_value[c] - new_value[c] == 0.0f;
                old_finite &= old_value[c] - old_value[c] == 0.0f;
            }
            float new_squares = 0.0f, old_squares = 0.0f, products = 0.0f;
#pragma unroll
            for (uint c = 0u; c < 3u; c++) {
                const float a = (finite ? new_value[c] : 0.0f) - anchor[c][i];
                const float b = (old_finite ? old_value[c] : 0.0f) - anchor[c][i];
                sums[NEW_SUMS + c][i] += even * a;
                sums[NEW_SUMS + 3u + c][i] += odd * a;
                sums[OLD_SUMS + c][i] += even * b;
                sums[OLD_SUMS + 3u + c][i] += odd * b;
                new_squares += a * a;
                old_squares += b * b;
                products += a * b;
            }
            sums[NEW_SQUARES][i] += new_squares * (1.0f / 3.0f);
            sums[OLD_SQUARES][i] += old_squares * (1.0f / 3.0f);
            sums[PRODUCTS][i] += products * (1.0f / 3.0f);
            sums[TOUCHED_COUNT][i] += partner != NO_INDEX ? 1.0f : 0.0f;
            sums[ODD_COUNT][i] += odd;
            sums[BAD_COUNT][i] += (finite ? 0.0f : 1.0f) + ((traced_twice & !old_finite) ? 1.0f : 0.0f);
        }
    }

    const float paired = slot->flags & SLOT_SINGLE ? 0.0f : 1.0f;
    __global float *planes = pairs + pixel;
    LANES
    for (size_t i = 0u; i < length; i++) {
        const size_t place = i * step;
#pragma unroll
        for (size_t c = 0u; c < 6u; c++) {
            planes[(PAIR_NEW_R_0 + c) * pixels + place] += sums[NEW_SUMS + c][i];
            planes[(PAIR_OLD_R_0 + c) * pixels + place] += paired * sums[OLD_SUMS + c][i];
        }
        const float odd = sums[ODD_COUNT][i], even = (float)(int)count - odd;
        planes[PAIR_SAMPLES_0 * pixels + place] += even;
        planes[PAIR_SAMPLES_1 * pixels + place] += odd;
        planes[PAIR_PAIRS_0 * pixels + place] += paired * even;
        planes[PAIR_PAIRS_1 * pixels + place] += paired * odd;
        planes[PAIR_NEW_MOMENT * pixels + place] += sums[NEW_SQUARES][i];
        planes[PAIR_OLD_MOMENT * pixels + place] += paired * sums[OLD_SQUARES][i];
        planes[PAIR_JOINT_MOMENT * pixels + place] += paired * sums[PRODUCTS][i];
        planes[PAIR_TOUCHED * pixels + place] += sums[TOUCHED_COUNT][i];
    }
    float bad = 0.0f;
    for (size_t i = 0u; i < length; i++)
        bad += sums[BAD_COUNT][i];
    if (bad > 0.0f)
        atomic_add(&counters[COUNTER_NONFINITE], (uint)bad);
}
