#include "cpu/lanes.cl"

// Patches: rows of pixels below each other, PATCH_WIDTH wide, and who goes over them. On CPUs that is one
// work-item for each patch, in SIMD lanes along the rows, so that what is the same for a patch is asked once.
// Elsewhere it is a group of work-items, one for each column.
//
//     const Patch patch = patch_of(width, height, CELL_SIZE);
//     EACH_ROW(y, patch)
//     EACH_COLUMN(x, patch) { ... }

typedef struct {
    uint row, index;                 // of patches: which row it is in, and which one it is of all
    size_t left, top, right, bottom; // pixels; the last two are outside
} Patch;

#define EACH_ROW(y, patch) for (size_t y = patch.top; y < patch.bottom; y++)

#ifdef CLANG_CPU
#define PATCH_ITEMS 1u
#define EACH_PIXEL(x, patch) for (size_t x = patch.left; x < patch.right; x++)
#define EACH_COLUMN(x, patch) LANES EACH_PIXEL(x, patch)
#else
#define PATCH_ITEMS PATCH_WIDTH
// A work-item keeps to its column of the whole patch also where that is narrowed.
#define EACH_PIXEL(x, patch)                                                                                 \
    for (size_t x = patch.left / PATCH_WIDTH * PATCH_WIDTH + get_local_id(0); x < patch.right;               \
         x += PATCH_WIDTH)                                                                                   \
        if (x >= patch.left)
#define EACH_COLUMN(x, patch) EACH_PIXEL(x, patch)
#endif

INLINE uint patches_in_row(uint width) { return (width + PATCH_WIDTH - 1u) / PATCH_WIDTH; }

INLINE Patch patch_at(uint width, uint height, uint rows, uint index) {
    Patch patch;
    uint in_row = patches_in_row(width);
    patch.index = index;
    patch.row = index / in_row;
    patch.left = index % in_row * PATCH_WIDTH;
    patch.top = patch.row * rows;
    patch.right = MIN(patch.left + PATCH_WIDTH, width);
    patch.bottom = MIN(patch.top + rows, height);
    return patch;
}

// The patch of this work-item, so many rows high. One that lies outside the picture has no pixels.
INLINE Patch patch_of(uint width, uint height, uint rows) {
    return patch_at(width, height, rows, (uint)get_global_id(0) / PATCH_ITEMS);
}

// The columns of a patch from one to another, the last one outside.
INLINE Patch narrowed(const Patch *patch, size_t left, size_t right) {
    Patch narrow = *patch;
    narrow.left = left;
    narrow.right = right;
    return narrow;
}

// What of a patch is near a change; `spans` has its first column and the one behind its last.
INLINE Patch near_change(const Patch *patch, uint height, __global const uint *spans) {
    const uint index = patch->top < height ? patch->index : 0u;
    return narrowed(patch, spans[4u * index], spans[4u * index + 1u]);
}

// What of a patch was near a change when the picture was made before; no columns if it never was made.
INLINE Patch was_near_change(const Patch *patch, uint height, __global const uint *spans) {
    const uint index = patch->top < height ? patch->index : 0u;
    return narrowed(patch, spans[4u * index + 2u], spans[4u * index + 3u]);
}

// Planes with a margin, in which kernels look around without asking where the picture ends: floats from one
// row to the next, floats of a plane, and the place of a pixel. Margins hold zeros.
INLINE size_t field_pitch(uint width) { return (width + 15u) / 16u * 16u + 2u * FIELD_MARGIN; }
INLINE size_t field_size(uint width, uint height) {
    return field_pitch(width) * (height + 2u * FIELD_MARGIN);
}
INLINE size_t field_place(uint width, size_t x, size_t y) {
    return (y + FIELD_MARGIN) * field_pitch(width) + x + FIELD_MARGIN;
}

INLINE void store_vec3(__global float *planes, size_t size, size_t place, Vec3 value) {
    planes[place] = value.x;
    planes[size + place] = value.y;
    planes[2u * size + place] = value.z;
}

INLINE Vec3 load_vec3(__global const float *planes, size_t size, size_t place) {
    return vec3(planes[place], planes[size + place], planes[2u * size + place]);
}

// A pixel of an image: red, green, blue, and whether there is any sample.
INLINE void store_pixel(__global float *image, size_t pixel, Vec3 light, int is_there) {
    image[4u * pixel] = light.x;
    image[4u * pixel + 1u] = light.y;
    image[4u * pixel + 2u] = light.z;
    image[4u * pixel + 3u] = is_there ? 1.0f : 0.0f;
}
