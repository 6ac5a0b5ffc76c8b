#include "impact/patch.cl"

// Guides: which pixels belong together, so that what is known of one may be used for the other.
//
// The label of a pixel is a number for what its centre shows in the old and in the new scene together; its
// highest bit is the class of the pixel, 1 where an object itself changed. Pixels with different labels do
// not belong together, nor do those whose normals differ by much.

INLINE uint class_of(uint label) { return label >> 31; }

// Weights of neighbours at a distance are kept as a byte each, in a word for every pixel: those to the right,
// at the lower left, below, and at the lower right. The weight between two pixels is the same for both, so
// that the other four stand with the neighbours.
#define GUIDE_RIGHT 0
#define GUIDE_LOWER_LEFT 8
#define GUIDE_BELOW 16
#define GUIDE_LOWER_RIGHT 24

#define GUIDE_WEIGHT(word, shift) ((float)((word) >> (shift) & 255u) * (1.0f / 255.0f))
