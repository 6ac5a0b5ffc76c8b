#include "impact/columns.cl"
#include "impact/guides.cl"
#include "impact/pair.cl"

// Statistics of pairs, pooled over the pixels of a cell that have one class:
//
//     cell_columns  sums over its columns, which sum_columns then adds up
//     pool_cells    variances and covariance, from as many cells around as it takes
//     mark_patches  where anything changes

// `columns` has CELL_SUM_PLANES planes for each class, with a float for each column of each row of cells.
__kernel WIDE void cell_columns(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, COLUMNS_PARAMETERS) {
    const Patch strip = strip_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height, plane = column_plane(width, height, CELL_SIZE);
    for (size_t y = strip.top; y < strip.bottom; y++) {
        const int begins = y == strip.top;
        EACH_COLUMN(x, strip) {
            const size_t pixel = y * width + x;
            const Pair p = load_pair(pairs, pixels, pixel);
            const Spread spread = spread_of(&p);
            float values[CELL_SUM_PLANES];
            values[CELL_SUM_FREEDOM_NEW] = spread.freedom_new;
            values[CELL_SUM_SQUARES_NEW] = spread.squares_new;
            values[CELL_SUM_FREEDOM_PAIRS] = spread.freedom_pairs;
            values[CELL_SUM_SQUARES_OLD] = spread.squares_old;
            values[CELL_SUM_PRODUCTS] = spread.products;
            values[CELL_SUM_TOUCHED] = p.touched;
            const int class = class_of(labels[pixel]);
            __global float *column = columns + strip.index * width + x;
#pragma unroll
            for (uint i = 0u; i < CELL_SUM_PLANES; i++) {
                add_to_column(&column[i * plane], begins, class ? 0.0f : values[i]);
                add_to_column(&column[(CELL_SUM_PLANES + i) * plane], begins, class ? values[i] : 0.0f);
            }
        }
    }
}

// How many degrees of freedom are enough, and the cells that are looked at around one for want of them.
#define ENOUGH_FREEDOM 300.0f
#define MOST_CELLS_AROUND 2

// Sums of one kind over the cells up to `around` from a place.
INLINE float cells_around(__global const float *sums, int columns, int rows, int column, int row,
                          int around) {
    float sum = 0.0f;
    for (int y = MAX(row - around, 0); y <= MIN(row + around, rows - 1); y++)
        for (int x = MAX(column - around, 0); x <= MIN(column + around, columns - 1); x++)
            sum += sums[y * columns + x];
    return sum;
}

// A work-item for each class of each cell.
__kernel void pool_cells(PICTURE_PARAMETERS, CELLS_PARAMETERS) {
    uint total = cell_count(width, height);
    uint class = (uint)get_global_id(0) / total, cell = (uint)get_global_id(0) % total;
    if (class > 1u)
        return;
    int columns = cells_in_row(width), rows = total / columns;
    int column = cell % columns, row = cell / columns;
    __global const float *sums = cell_sums + class * CELL_SUM_PLANES * total;
    int around = 0;
    float freedom = sums[CELL_SUM_FREEDOM_NEW * total + cell];
    while (freedom < ENOUGH_FREEDOM && around < MOST_CELLS_AROUND)
        freedom = cells_around(sums + CELL_SUM_FREEDOM_NEW * total, columns, rows, column, row, ++around);
    float sum[CELL_SUM_PLANES];
    for (uint i = 0u; i < CELL_SUM_PLANES; i++)
        sum[i] = cells_around(sums + i * total, columns, rows, column, row, around);

    float per_pair = 1.0f / MAX(sum[CELL_SUM_FREEDOM_PAIRS], 1.0f);
    float new_variance = sum[CELL_SUM_SQUARES_NEW] / MAX(freedom, 1.0f);
    float old_variance = sum[CELL_SUM_SQUARES_OLD] * per_pair;
    float most = SQRT(new_variance * old_variance);
    __global float *known = cells + class * CELL_PLANES * total + cell;
    known[CELL_NEW_VARIANCE * total] = new_variance;
    known[CELL_OLD_VARIANCE * total] = old_variance;
    known[CELL_COVARIANCE * total] = CLAMP(sum[CELL_SUM_PRODUCTS] * per_pair, 0.0f, most);
    known[CELL_FREEDOM_NEW * total] = freedom;
    known[CELL_FREEDOM_PAIRS * total] = sum[CELL_SUM_FREEDOM_PAIRS];
    known[CELL_TOUCHED * total] = sum[CELL_SUM_TOUCHED];
}

// Whether a sample that met a change is behind what is known of a cell.
INLINE int is_changed(__global const float *cells, uint total, uint cell) {
    return (cells[CELL_TOUCHED * total + cell] > 0.0f) |
           (cells[(CELL_PLANES + CELL_TOUCHED) * total + cell] > 0.0f);
}

// Whether any cell is changed that is nearer than `distance` pixels to a patch.
INLINE int is_near_change(__global const float *cells, uint width, uint height, const Patch *patch,
                          int distance) {
    int columns = cells_in_row(width), rows = (height + CELL_SIZE - 1u) / CELL_SIZE;
    int around = distance / CELL_SIZE;
    int left = MAX((int)(patch->left / CELL_SIZE) - around, 0),
        top = MAX((int)(patch->top / CELL_SIZE) - around, 0);
    int right = MIN((int)((patch->right - 1u) / CELL_SIZE) + around, columns - 1);
    int bottom = MIN((int)((patch->bottom - 1u) / CELL_SIZE) + around, rows - 1);
    for (int row = top; row <= bottom; row++)
        for (int column = left; column <= right; column++)
            if (is_changed(cells, columns * rows, row * columns + column))
                return 1;
    return 0;
}

// A work-item for each patch. A change is spread over 1 + 2 + 4 + 8 pixels at most, and what it is told from
// noise by over 16 more; see impact/shrinkage.cl.
__kernel void mark_patches(PICTURE_PARAMETERS, CELLS_PARAMETERS, ACTIVITIES_PARAMETERS) {
    uint index = (uint)get_global_id(0);
    const Patch patch = patch_at(width, height, index);
    if (patch.top >= height)
        return;
    activities[index] = is_near_change(cells, width, height, &patch, FIELD_MARGIN)       ? ACTIVITY_CHANGED
                        : is_near_change(cells, width, height, &patch, 2 * FIELD_MARGIN) ? ACTIVITY_NEAR
                                                                                         : ACTIVITY_IDLE;
}
