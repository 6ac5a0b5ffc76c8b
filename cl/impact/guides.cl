#include "impact/cell.cl"

// Guides: which pixels belong together, so that what is known of one may be used for the other.
//
// The label of a pixel is a number for what its centre shows in the old and in the new scene together; its
// highest bit is the class of the pixel, the next one says whether the target has what it shows. Pixels with
// different labels do not belong together, nor do those whose normals differ by much.
//
// For each pixel and each scale the weights of its eight neighbours stand in two words, a byte each, row by
// row from the upper left. They are parts of all of GUIDE_UNIT; what they leave is the pixel's own.
#define GUIDE_WEIGHT(word, i) ((float)(int)((word) >> 8 * (i) & 255u) * (1.0f / GUIDE_UNIT))

INLINE void load_guides(__global const uint *guides, size_t size, size_t place, float *weights) {
    const uint above = guides[place], below = guides[size + place];
    weights[0] = GUIDE_WEIGHT(above, 0);
    weights[1] = GUIDE_WEIGHT(above, 1);
    weights[2] = GUIDE_WEIGHT(above, 2);
    weights[3] = GUIDE_WEIGHT(above, 3);
    weights[5] = GUIDE_WEIGHT(below, 0);
    weights[6] = GUIDE_WEIGHT(below, 1);
    weights[7] = GUIDE_WEIGHT(below, 2);
    weights[8] = GUIDE_WEIGHT(below, 3);
    weights[4] = 1.0f - (((weights[0] + weights[1]) + (weights[2] + weights[3])) +
                         ((weights[5] + weights[6]) + (weights[7] + weights[8])));
}
