#include "cpu/lanes.cl"

// Patches of the picture, and who goes over their pixels: on CPUs one work-item, row by row in SIMD lanes, so
// that what is the same for a whole patch is asked once; elsewhere a work-item for each pixel.
//
//     const Patch patch = patch_of(width, height);
//     EACH_ROW(y, patch)
//     EACH_LANE(x, patch) { ... }

typedef struct {
    uint index;
    uint left, top, right, bottom; // pixels; the last two are outside
} Patch;

#ifdef CLANG_CPU
#define PATCH_ITEMS 1u
#define EACH_ROW(y, patch) for (size_t y = patch.top; y < patch.bottom; y++)
#define EACH_LANE(x, patch) LANES for (size_t x = patch.left; x < patch.right; x++)
#else
#define PATCH_ITEMS (PATCH_WIDTH * PATCH_HEIGHT)
#define EACH_ROW(y, patch)                                                                                   \
    for (size_t y = patch.top + get_local_id(0) / PATCH_WIDTH; y < patch.bottom; y += PATCH_HEIGHT)
#define EACH_LANE(x, patch)                                                                                  \
    for (size_t x = patch.left + get_local_id(0) % PATCH_WIDTH; x < patch.right; x += PATCH_WIDTH)
#endif

INLINE uint patches_in_row(uint width) { return (width + PATCH_WIDTH - 1u) / PATCH_WIDTH; }

INLINE Patch patch_at(uint width, uint height, uint index) {
    Patch patch;
    uint in_row = patches_in_row(width);
    patch.index = index;
    patch.left = index % in_row * PATCH_WIDTH;
    patch.top = index / in_row * PATCH_HEIGHT;
    patch.right = MIN(patch.left + PATCH_WIDTH, width);
    patch.bottom = MIN(patch.top + PATCH_HEIGHT, height);
    return patch;
}

// The patch of this work-item. One that lies outside has no pixels.
INLINE Patch patch_of(uint width, uint height) {
    return patch_at(width, height, (uint)get_global_id(0) / PATCH_ITEMS);
}

// Planes with a margin, in which the kernels look around without asking where the picture ends: floats from
// one row to the next, floats of a plane, and the place of a pixel. Margins hold zeros.
INLINE size_t field_pitch(uint width) { return patches_in_row(width) * PATCH_WIDTH + 2u * FIELD_MARGIN; }
INLINE size_t field_size(uint width, uint height) {
    return field_pitch(width) * (height + 2u * FIELD_MARGIN);
}
INLINE size_t field_place(uint width, size_t x, size_t y) {
    return (y + FIELD_MARGIN) * field_pitch(width) + x + FIELD_MARGIN;
}

// Cells: how many there are, and which one a pixel lies in.
INLINE uint cells_in_row(uint width) { return (width + CELL_SIZE - 1u) / CELL_SIZE; }
INLINE uint cell_count(uint width, uint height) {
    return cells_in_row(width) * ((height + CELL_SIZE - 1u) / CELL_SIZE);
}
