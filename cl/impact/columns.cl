#include "impact/patch.cl"

// Strips: rows of pixels below each other, as wide as a patch, over which sums are made column by column.
#ifdef CLANG_CPU
#define COLUMN_ITEMS 1u
#define EACH_COLUMN(x, strip) EACH_LANE(x, strip)
#else
#define COLUMN_ITEMS PATCH_WIDTH
#define EACH_COLUMN(x, strip)                                                                                \
    for (size_t x = strip.left + get_local_id(0) % PATCH_WIDTH; x < strip.right; x += PATCH_WIDTH)
#endif

// The strip of this work-item, `rows` pixels high; its index is that among strips side by side.
INLINE Patch strip_of(uint width, uint height, uint rows) {
    Patch strip;
    uint in_row = patches_in_row(width), item = (uint)get_global_id(0) / COLUMN_ITEMS;
    strip.index = item / in_row;
    strip.left = item % in_row * PATCH_WIDTH;
    strip.top = strip.index * rows;
    strip.right = MIN(strip.left + PATCH_WIDTH, width);
    strip.bottom = MIN(strip.top + rows, height);
    return strip;
}

// Floats of a plane of sums over columns of `rows` pixels.
INLINE size_t column_plane(uint width, uint height, uint rows) {
    return (size_t)width * ((height + rows - 1u) / rows);
}

// Adds to the sum of a column, which begins with this value or has those above it already.
INLINE void add_to_column(__global float *column, int begins, float value) {
    *column = value + (begins ? 0.0f : *column);
}
