#include "impact/guides.cl"

// How much two pixels belong together: the sixteenth power of the cosine between their normals, and 1 where
// neither shows a surface.
INLINE float likeness(__global const uint *labels, __global const float *normals, size_t pixels, size_t a,
                      size_t b) {
    const Vec3 n = load_vec3(normals, pixels, a), m = load_vec3(normals, pixels, b);
    float weight = CLAMP(dot(n, m), 0.0f, 1.0f);
    weight *= weight;
    weight *= weight;
    weight *= weight;
    weight *= weight;
    weight = dot(n, n) + dot(m, m) > 0.0f ? weight : 1.0f;
    return labels[a] == labels[b] ? weight : 0.0f;
}

// Neighbours of a pixel on one side of it: how far away they are, and 1; both are 0 where there are none.
typedef struct {
    size_t distance;
    float count;
} Side;

INLINE Side side(int is_there, size_t distance) {
    const Side there = {is_there ? distance : 0u, is_there ? 1.0f : 0.0f};
    return there;
}

// The two words of a pixel: a binomial kernel times the likeness of pixels.
INLINE void weigh_neighbours(__global const uint *labels, __global const float *normals, size_t pixels,
                             size_t here, const Side *left, const Side *right, const Side *above,
                             const Side *below, __global uint *words, size_t size) {
    const size_t upper = here - above->distance, lower = here + below->distance;
#define LIKENESS(place) likeness(labels, normals, pixels, here, place)
    float weights[8];
    weights[0] = 0.25f * above->count * left->count * LIKENESS(upper - left->distance);
    weights[1] = 0.5f * above->count * LIKENESS(upper);
    weights[2] = 0.25f * above->count * right->count * LIKENESS(upper + right->distance);
    weights[3] = 0.5f * left->count * LIKENESS(here - left->distance);
    weights[4] = 0.5f * right->count * LIKENESS(here + right->distance);
    weights[5] = 0.25f * below->count * left->count * LIKENESS(lower - left->distance);
    weights[6] = 0.5f * below->count * LIKENESS(lower);
    weights[7] = 0.25f * below->count * right->count * LIKENESS(lower + right->distance);
#undef LIKENESS
    float sum = 1.0f;
#pragma unroll
    for (int i = 0; i < 8; i++)
        sum += weights[i];
    const float unit = GUIDE_UNIT / sum;
    uint packed[2] = {0u, 0u};
#pragma unroll
    for (int i = 0; i < 8; i++)
        packed[i / 4] |= (uint)(int)MIN(weights[i] * unit + 0.5f, 255.0f) << 8 * (i % 4);
    words[0] = packed[0];
    words[size] = packed[1];
}

// Fills the planes of weights for every scale.
__kernel WIDE void weigh_guides(PICTURE_PARAMETERS, LABELS_PARAMETERS, NORMALS_PARAMETERS,
                                GUIDES_PARAMETERS) {
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    for (uint i = 0u; i < SMOOTHING_SCALES; i++) {
        const size_t step = 1u << i;
        __global uint *words = guides + 2u * i * size;
        // Columns with neighbours on both sides are apart from the others, so that those need not be asked.
        const size_t inner_left = CLAMP(step, patch.left, patch.right);
        const size_t inner_right = CLAMP(MAX(width, step) - step, inner_left, patch.right);
        const Patch inner = narrowed(&patch, inner_left, inner_right);
        EACH_ROW(y, patch) {
            const Side above = side(y >= step, step * width), below = side(y + step < height, step * width);
            const Side aside = {step, 1.0f};
            EACH_COLUMN(x, inner) {
                const size_t place = field_place(width, x, y);
                weigh_neighbours(labels, guide_normals, pixels, y * width + x, &aside, &aside, &above, &below,
                                 words + place, size);
            }
            for (int outer = 0; outer < 2; outer++) {
                const Patch edge =
                    narrowed(&patch, outer ? inner.right : patch.left, outer ? patch.right : inner.left);
                EACH_PIXEL(x, edge) {
                    const size_t place = field_place(width, x, y);
                    const Side left = side(x >= step, step), right = side(x + step < width, step);
                    weigh_neighbours(labels, guide_normals, pixels, y * width + x, &left, &right, &above,
                                     &below, words + place, size);
                }
            }
        }
    }
}
