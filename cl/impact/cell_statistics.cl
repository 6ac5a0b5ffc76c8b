#include "impact/cell.cl"
#include "impact/pair.cl"

// Statistics of pairs, pooled over the pixels of a cell that have one class:
//
//     measure_cells  sums over cells
//     pool_cells     variances and covariance, from as many cells around as it takes, and what follows from
//     them spread_cells   interpolates along rows, see impact/cell.cl find_spans     where anything changes

// `cell_sums` has CellSum for each class.
__kernel WIDE void measure_cells(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS,
                                 CELL_SUMS_PARAMETERS) {
    CELL_COLUMNS(columns, CLASSES * CELL_SUM_PLANES);
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height;
    EACH_ROW(y, patch)
    EACH_COLUMN(x, patch) {
        const size_t pixel = y * width + x;
        const Pair p = load_pair(pairs, pixels, pixel);
        const Spread spread = spread_of(&p, anchor_sums[3u * pixels + pixel]);
        const PairSpread pair_spread = pair_spread_of(&p);
        float values[CELL_SUM_PLANES];
        values[CELL_SUM_SAMPLES] = sample_count(&p);
        values[CELL_SUM_PAIRS] = spread.pairs;
        values[CELL_SUM_FREEDOM_NEW] = spread.freedom_new;
        values[CELL_SUM_SQUARES_NEW] = spread.squares_new;
        values[CELL_SUM_NEW_MOMENT] = p.new_moment;
        values[CELL_SUM_SQUARES_OLD] = spread.squares_old;
        values[CELL_SUM_PRODUCTS] = spread.products;
        values[CELL_SUM_TOUCHED] = p.touched;
        values[CELL_SUM_FREEDOM_PAIRS] = pair_spread.freedom;
        values[CELL_SUM_PAIR_SQUARES_OLD] = pair_spread.squares_old;
        values[CELL_SUM_PAIR_PRODUCTS] = pair_spread.products;
        const ClassShares class = class_shares(labels[pixel]);
#pragma unroll
        for (uint i = 0u; i < CELL_SUM_PLANES; i++) {
            COLUMN(columns, i, x, patch) += class.first * values[i];
            COLUMN(columns, CELL_SUM_PLANES + i, x, patch) += class.second * values[i];
        }
    }
    store_cell_sums(columns, CLASSES * CELL_SUM_PLANES, &patch, width, height, cell_sums);
}

// How many samples of unchanged objects are enough, and the cells that are looked at around one for want of
// them. Objects that changed are small, and their samples differ by where they are less than from one sample
// to the next, so that all around are taken always.
#define ENOUGH_SAMPLES 300.0f

// Variances below this are rounding, and tell nothing of a correlation.
#define LEAST_VARIANCE 1e-8f
// The weight of old values may be larger than that of new ones, but not by much, since it is estimated.
#define MOST_OLD_WEIGHT 1.5f
// Variances are mixed with a guess that counts as so many degrees of freedom. It keeps the first samples of
// bright pixels from drowning others. Of unchanged objects it is relative to the square of the kept picture.
#define PRIOR_FREEDOM 4.0f
#define PRIOR_VARIANCE 0.5f

// Five cells in a row, or below each other, of which the middle one is a cell itself: how far away they are,
// and 1; both are 0 where there are none.
typedef struct {
    int distances[5];
    float counts[5];
} Five;

INLINE Five five_around(int place, int size, int distance) {
    Five five;
#pragma unroll
    for (int i = 0; i < 5; i++) {
        const int there = place + i - 2, is_there = (there >= 0) & (there < size);
        five.distances[i] = is_there ? (i - 2) * distance : 0;
        five.counts[i] = is_there ? 1.0f : 0.0f;
    }
    return five;
}

// Sums over a cell, over the eight around it, and over the sixteen around those.
typedef struct {
    float own, near, far;
} Rings;

INLINE Rings rings_of(__global const float *sums, size_t cell, const Five *down, const Five *across) {
    Rings rings = {sums[cell], 0.0f, 0.0f};
#pragma unroll
    for (int i = 0; i < 5; i++) {
#pragma unroll
        for (int j = 0; j < 5; j++) {
            const int is_far = (i == 0) | (i == 4) | (j == 0) | (j == 4), is_own = (i == 2) & (j == 2);
            const float value = sums[cell + down->distances[i] + across->distances[j]];
            const float counted = value * down->counts[i] * across->counts[j];
            rings.near += is_far | is_own ? 0.0f : counted;
            rings.far += is_far ? counted : 0.0f;
        }
    }
    return rings;
}

INLINE void pool_cell(__global const float *sums, __global float *cells, __global float *rules, uint total,
                      uint class, size_t cell, const Five *down, const Five *across) {
    const Rings samples_around = rings_of(sums + CELL_SUM_SAMPLES * total, cell, down, across);
    const float near_samples = samples_around.own + samples_around.near;
    const int takes_near = (class == 1u) | (samples_around.own < ENOUGH_SAMPLES);
    const int takes_far = (class == 1u) | (near_samples < ENOUGH_SAMPLES);
    float sum[CELL_SUM_PLANES];
#pragma unroll
    for (uint i = 0u; i < CELL_SUM_PLANES; i++) {
        const Rings rings = rings_of(sums + i * total, cell, down, across);
        sum[i] = rings.own + (takes_near ? rings.near : 0.0f) + (takes_near & takes_far ? rings.far : 0.0f);
    }

    const float freedom = sum[CELL_SUM_FREEDOM_NEW], pairs = sum[CELL_SUM_PAIRS];
    const float touched = sum[CELL_SUM_TOUCHED];
    const float new_variance = sum[CELL_SUM_SQUARES_NEW] / MAX(freedom, 1.0f);
    const float old_variance = sum[CELL_SUM_SQUARES_OLD] / MAX(pairs, 1.0f);
    const float covariance = MAX(sum[CELL_SUM_PRODUCTS] / MAX(pairs, 1.0f), 0.0f);
    const float new_moment = sum[CELL_SUM_NEW_MOMENT] / MAX(sum[CELL_SUM_SAMPLES], 1.0f);
    __global float *known = cells + class * CELL_PLANES * total + cell;
    known[CELL_NEW_VARIANCE * total] = new_variance;
    known[CELL_OLD_VARIANCE * total] = old_variance;
    known[CELL_COVARIANCE * total] = covariance;
    known[CELL_NEW_MOMENT * total] = new_moment;
    known[CELL_FREEDOM_NEW * total] = freedom;
    known[CELL_PAIRS * total] = pairs;
    known[CELL_TOUCHED * total] = touched;
    known[CELL_SAMPLES * total] = sum[CELL_SUM_SAMPLES];

    // Where nothing is known of old values, they count as new ones do.
    const float fitting = (covariance + LEAST_VARIANCE) / (old_variance + LEAST_VARIANCE);
    const float old_weight = pairs > 0.0f ? MIN(fitting, MOST_OLD_WEIGHT) : 1.0f;
    // What an object looked like before it changed is a good guess for its looks only if its samples go
    // together with the old ones: what moved has other surfaces in its place.
    const float resemblance = CLAMP(1.5f * old_weight - 0.5f, 0.0f, 1.0f);
    // What old values cover of the variance of new ones has to be measured as that is: both are nearly the
    // same where little changed.
    const float per_freedom = 1.0f / MAX(sum[CELL_SUM_FREEDOM_PAIRS], 1.0f);
    const float covered = 2.0f * sum[CELL_SUM_PAIR_PRODUCTS] - old_weight * sum[CELL_SUM_PAIR_SQUARES_OLD];
    const float known_share = freedom / (freedom + PRIOR_FREEDOM);
    const float variance =
        known_share * new_variance + (class == 1u ? (1.0f - known_share) * new_moment : 0.0f);
    // Pairs may be a few of all samples, among them the bright ones: then they seem to cover more than there
    // is, and pixels of no variance would outweigh all around them.
    const float pair_freedom = sum[CELL_SUM_FREEDOM_PAIRS];
    const float most_covered = variance * pair_freedom / (pair_freedom + PRIOR_FREEDOM);
    __global float *rule = rules + class * total + cell;
    const uint next = CLASSES * total;
    rule[RULE_OLD_WEIGHT * next] = old_weight;
    rule[RULE_BASE_SHARE * next] = class == 1u ? resemblance : 1.0f;
    rule[RULE_VARIANCE * next] = variance;
    rule[RULE_PRIOR * next] = class == 1u ? 0.0f : (1.0f - known_share) * PRIOR_VARIANCE;
    rule[RULE_COVERED * next] =
        MIN(known_share * per_freedom * covered, most_covered / MAX(old_weight, 1e-6f));
}

// Goes over each class of each row of cells. `rules` has RulePlane for each class.
__kernel WIDE void pool_cells(PICTURE_PARAMETERS, CELL_SUMS_PARAMETERS, CELLS_PARAMETERS, RULES_PARAMETERS) {
    const uint in_row = cell_columns(width), rows = cell_rows(height), total = in_row * rows;
    const Patch patch = patch_of(in_row, CLASSES * rows, 1u);
    // Cells with two others on both sides are apart from the rest, so that those need not be asked.
    const size_t inner_left = CLAMP(2u, patch.left, patch.right);
    const size_t inner_right = CLAMP(MAX(in_row, 2u) - 2u, inner_left, patch.right);
    const Patch inner = narrowed(&patch, inner_left, inner_right);
    EACH_ROW(y, patch) {
        const uint class = (uint)y / MAX(rows, 1u), row = (uint)y - class * rows;
        const Five down = five_around((int)row, (int)rows, (int)in_row), across = five_around(2, 5, 1);
        __global const float *sums = cell_sums + class * CELL_SUM_PLANES * total;
        EACH_COLUMN(x, inner) {
            const size_t cell = row * in_row + x;
            pool_cell(sums, cells, rules, total, class, cell, &down, &across);
        }
        for (int outer = 0; outer < 2; outer++) {
            const Patch edge =
                narrowed(&patch, outer ? inner.right : patch.left, outer ? patch.right : inner.left);
            EACH_PIXEL(x, edge) {
                const Five cut = five_around((int)x, (int)in_row, 1);
                pool_cell(sums, cells, rules, total, class, row * in_row + x, &down, &cut);
            }
        }
    }
}

// Interpolates `plane_total` planes along the rows of cells: a float for each column of pixels.
__kernel WIDE void spread_cells(PICTURE_PARAMETERS, SPREADING_PARAMETERS) {
    const int columns = cell_columns(width), rows = cell_rows(height);
    const Patch patch = patch_of(width, plane_total * rows, 1u);
    EACH_ROW(y, patch)
    EACH_COLUMN(x, patch) {
        const float at = ((float)(int)x + 0.5f) * (1.0f / CELL_SIZE) - 0.5f;
        const int left = (int)FLOOR(at);
        const float first = cell_values[(int)y * columns + CLAMP(left, 0, columns - 1)];
        const float second = cell_values[(int)y * columns + CLAMP(left + 1, 0, columns - 1)];
        column_values[y * width + x] = first + (at - (float)left) * (second - first);
    }
}

// A work-item for each patch: its columns from the first to the last near which a sample met a change, or
// where there is none yet and the target may stand. A change is spread over 1 + 2 + 4 + 8 pixels, and depends
// on weights as far away again: four cells.
__kernel void find_spans(PICTURE_PARAMETERS, CELLS_PARAMETERS, HAS_TARGET_PARAMETERS, SPANS_PARAMETERS) {
    const Patch patch = patch_at(width, height, CELL_SIZE, (uint)get_global_id(0));
    if (patch.top >= height)
        return;
    const int around = 4, columns = cell_columns(width), rows = cell_rows(height), total = columns * rows;
    const int left = MAX((int)(patch.left / CELL_SIZE) - around, 0);
    const int right = MIN((int)((patch.right - 1u) / CELL_SIZE) + around, columns - 1);
    const int top = MAX((int)patch.row - around, 0), bottom = MIN((int)patch.row + around, rows - 1);
    int first = columns, last = -1;
    for (int row = top; row <= bottom; row++)
        for (int column = left; column <= right; column++) {
            __global const float *first_class = cells + row * columns + column;
            __global const float *second_class = first_class + CELL_PLANES * total;
            const float touched = first_class[CELL_TOUCHED * total] + second_class[CELL_TOUCHED * total];
            const float samples = first_class[CELL_SAMPLES * total] + second_class[CELL_SAMPLES * total];
            const int changes = (touched > 0.0f) | ((has_target > 0u) & (samples == 0.0f));
            first = changes ? MIN(first, column) : first;
            last = changes ? MAX(last, column) : last;
        }
    const int from = MAX((first - around) * (int)CELL_SIZE, (int)patch.left);
    const int to = MIN((last + around + 1) * (int)CELL_SIZE, (int)patch.right);
    __global uint *span = spans + 4u * patch.index;
    span[2] = span[0];
    span[3] = span[1];
    span[0] = last < 0 ? (uint)patch.right : (uint)from;
    span[1] = last < 0 ? (uint)patch.right : (uint)to;
}
