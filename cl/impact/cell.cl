#include "impact/patch.cl"

// Cells of CELL_SIZE x CELL_SIZE pixels, and the classes of pixels in them.
//
// The class of a pixel is the highest bit of its label: 1 where an object changed itself, see
// impact/guides.cl.
INLINE uint class_of(uint label) { return label >> 31; }
// Whether the target has what a pixel shows: the next bit of its label, see impact/shrinkage.cl.
INLINE int has_target_at(uint label) { return (int)(label >> 30) & 1; }

// The class of a pixel as factors, of which one is 1 and the other 0. Compilers make choices of places in
// memory out of choices between classes, and vectorise badly over those.
typedef struct {
    float first, second;
} ClassShares;

INLINE ClassShares class_shares(uint label) {
    const float second = (float)(int)class_of(label);
    const ClassShares shares = {1.0f - second, second};
    return shares;
}

INLINE uint cell_columns(uint width) { return (width + CELL_SIZE - 1u) / CELL_SIZE; }
INLINE uint cell_rows(uint height) { return (height + CELL_SIZE - 1u) / CELL_SIZE; }
INLINE uint cell_count(uint width, uint height) { return cell_columns(width) * cell_rows(height); }

// Sums over the cells of a patch that is as high as a cell. While the patch is gone over they are made for
// each column, plane after plane; then columns are added up. `sums` has a float for each cell and plane.
//
//     CELL_COLUMNS(columns, PLANES);
//     ... COLUMN(columns, plane, x, patch) += value ...
//     store_cell_sums(columns, PLANES, &patch, width, height, sums);
#ifdef CLANG_CPU
#define COLUMNS
#define CELL_COLUMNS(name, planes) float name[(planes) * PATCH_WIDTH] = {0.0f}
#else
#define COLUMNS __local
#define CELL_COLUMNS(name, planes)                                                                           \
    __local float name[(planes) * PATCH_WIDTH];                                                              \
    for (uint i = get_local_id(0); i < (planes) * PATCH_WIDTH; i += PATCH_WIDTH)                             \
    name[i] = 0.0f
#endif
#define COLUMN(columns, plane, x, patch) columns[(plane) * PATCH_WIDTH + (x) - patch.left]

// All work-items of a group must come here, those of patches outside the picture too.
INLINE void store_cell_sums(const COLUMNS float *columns, uint planes, const Patch *patch, uint width,
                            uint height, __global float *sums) {
    const uint cells = PATCH_WIDTH / CELL_SIZE, total = cell_count(width, height);
    const uint first = (uint)patch->left / CELL_SIZE, in_row = cell_columns(width);
#ifdef CLANG_CPU
    for (uint i = 0u; i < planes * cells; i++) {
#else
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = get_local_id(0); i < planes * cells; i += PATCH_WIDTH) {
#endif
        const uint plane = i / cells, cell = first + i % cells;
        float sum = 0.0f;
        for (uint x = 0u; x < CELL_SIZE; x++)
            sum += columns[i * CELL_SIZE + x];
        if (cell < in_row && patch->top < height)
            sums[plane * total + patch->row * in_row + cell] = sum;
    }
}

// What is known of cells is interpolated between their centres: along rows beforehand, so that each row of
// cells has a float for every column of pixels; between the rows of cells when a row of pixels is gone over.
typedef struct {
    size_t upper, lower; // where the two rows of cells begin
    float share;         // of the lower one
} CellRows;

INLINE CellRows cell_rows_around(uint width, uint height, size_t y) {
    const float at = ((float)y + 0.5f) / CELL_SIZE - 0.5f;
    const int upper = (int)FLOOR(at), last = (int)cell_rows(height) - 1;
    CellRows rows;
    rows.upper = (size_t)width * CLAMP(upper, 0, last);
    rows.lower = (size_t)width * CLAMP(upper + 1, 0, last);
    rows.share = at - (float)upper;
    return rows;
}

// The value of a plane for a pixel; planes of both classes follow each other.
INLINE float between_cells(__global const float *plane, size_t size, const CellRows *rows, size_t x,
                           const ClassShares *class) {
    __global const float *second = plane + size;
    const float upper = class->first * plane[rows->upper + x] + class->second * second[rows->upper + x];
    const float lower = class->first * plane[rows->lower + x] + class->second * second[rows->lower + x];
    return upper + rows->share * (lower - upper);
}
