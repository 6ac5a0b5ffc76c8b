#include "impact/cell.cl"
#include "impact/rules.cl"

// The squared slope of the display curve at a radiance, from a table with SLOPES_PER_OCTAVE entries for each
// power of two: the exponent and the first bits behind it are the place in the table.
INLINE float squared_slope(__global const float *slopes, float radiance) {
    const int place = (int)(as_uint(MAX(radiance, 0.0f)) / ((1u << 23) / SLOPES_PER_OCTAVE)) -
                      (int)(SLOPE_FIRST_OCTAVE * SLOPES_PER_OCTAVE);
    return slopes[CLAMP(place, 0, (int)(SLOPE_OCTAVES * SLOPES_PER_OCTAVE) - 1)];
}

// Sums over the columns of tiles `row_count` pixels high, which sum_columns then adds up: layout.TileSum.
__kernel WIDE void tile_columns(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, CELLS_PARAMETERS,
                                RULES_PARAMETERS, SLOPES_PARAMETERS, SHOWN_IMAGE_PARAMETERS,
                                SHOWN_SHARES_PARAMETERS, TILE_COLUMNS_PARAMETERS) {
    const Patch strip = patch_of(width, height, row_count);
    const size_t pixels = (size_t)width * height,
                 plane = (size_t)width * ((height + row_count - 1u) / row_count);
    const uint in_row = cell_columns(width), total = cell_count(width, height);
    EACH_ROW(y, strip) {
        const int begins = y == strip.top;
        const uint cell_row = (uint)y / CELL_SIZE * in_row;
        EACH_COLUMN(x, strip) {
            const size_t pixel = y * width + x;
            const Pair p = load_pair(pairs, pixels, pixel);
            const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
            const Spread spread = spread_of(&p, anchor.samples);
            const PairSpread pair_spread = pair_spread_of(&p);
            const uint cell = cell_row + (uint)x / CELL_SIZE, class = class_of(labels[pixel]);
            const float variance = shown_variance(&p, &anchor, cells, rules, total, cell, class);
            const float samples = sample_count(&p), pair_total = pair_count(&p);
            const Vec3 light = vec3_at(shown_image + 4u * pixel);
            const float weight = squared_slope(slopes, (light.x + light.y + light.z) * (1.0f / 3.0f));
            // Of samples without a partner the squares are taken off as they are on average.
            const float among_pairs = p.new_moment * pair_total / MAX(samples, 1.0f);
            float values[TILE_SUM_PLANES];
            values[TILE_SUM_SAMPLES] = samples;
            values[TILE_SUM_PAIRS] = pair_total;
            values[TILE_SUM_TOUCHED] = p.touched;
            values[TILE_SUM_KEPT] = anchor.samples;
            values[TILE_SUM_FREEDOM_NEW] = spread.freedom_new;
            values[TILE_SUM_FREEDOM_PAIRS] = pair_spread.freedom;
            values[TILE_SUM_SQUARES_NEW] = weight * spread.squares_new;
            values[TILE_SUM_SQUARES_OLD] = weight * pair_spread.squares_old;
            values[TILE_SUM_PRODUCTS] = weight * pair_spread.products;
            values[TILE_SUM_SQUARES_KEPT] = weight * spread.squares_old;
            values[TILE_SUM_DIFFERENCES] =
                weight * MAX(among_pairs + p.old_moment - 2.0f * p.joint_moment, 0.0f);
            values[TILE_SUM_ERROR] = weight * variance;
            // Far from a change nothing is known of shares.
            const float noise = change_variance(&p, &anchor, cells, rules, total, cell, class);
            values[TILE_SUM_NOISE] = weight * noise;
            values[TILE_SUM_SHOWN_NOISE] = noise > 0.0f ? weight * noise * shown_shares[pixel] : 0.0f;
            __global float *column = columns + strip.row * width + x;
#pragma unroll
            for (uint i = 0u; i < TILE_SUM_PLANES; i++)
                column[i * plane] = values[i] + (begins ? 0.0f : column[i * plane]);
        }
    }
}
