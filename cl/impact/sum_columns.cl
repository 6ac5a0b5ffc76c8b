#include "base/scalar.cl"

// Adds up the sums over columns of pixels that lie next to each other in a square. All planes are seen as one
// of `row_total` rows; a work-item does one square of a row.
__kernel void sum_columns(COLUMN_SUMS_PARAMETERS) {
    uint squares = (column_total + column_count - 1u) / column_count;
    uint row = (uint)get_global_id(0) / squares, square = (uint)get_global_id(0) % squares;
    if (row >= row_total)
        return;
    __global const float *sums = column_sums + (size_t)row * column_total;
    uint first = square * column_count, end = MIN(first + column_count, column_total);
    float sum = 0.0f;
    for (uint x = first; x < end; x++)
        sum += sums[x];
    square_sums[(size_t)row * squares + square] = sum;
}
