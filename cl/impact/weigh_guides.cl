#include "impact/guides.cl"

// The sixteenth power of the cosine between two normals; 1 where neither pixel shows a surface.
INLINE uint guide_byte(__global const uint *labels, __global const float *normals, size_t pixels, size_t a,
                       size_t b, int inside) {
    b = inside ? b : a;
    Vec3 n = vec3(normals[a], normals[pixels + a], normals[2u * pixels + a]);
    Vec3 m = vec3(normals[b], normals[pixels + b], normals[2u * pixels + b]);
    float cosine = CLAMP(dot(n, m), 0.0f, 1.0f);
    float weight = cosine * cosine;
    weight *= weight;
    weight *= weight;
    weight *= weight;
    weight = dot(n, n) + dot(m, m) > 0.0f ? weight : 1.0f;
    return (inside & (labels[a] == labels[b])) ? (uint)(weight * 255.0f + 0.5f) : 0u;
}

// Fills the planes of weights for every distance that smoothing passes look around.
__kernel void weigh_guides(PICTURE_PARAMETERS, LABELS_PARAMETERS, NORMALS_PARAMETERS, GUIDES_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    const size_t pixels = (size_t)width * height;
    EACH_ROW(y, patch)
    for (uint i = 0u; i < SMOOTHING_STEPS; i++) {
        const size_t step = 1u << i;
        EACH_LANE(x, patch) {
            const size_t pixel = y * width + x;
            const int has_left = x >= step, has_right = x + step < width, has_below = y + step < height;
            const size_t below = pixel + step * width;
#define BYTE(place, inside) guide_byte(labels, guide_normals, pixels, pixel, place, inside)
            const uint word = BYTE(pixel + step, has_right) << GUIDE_RIGHT |
                              BYTE(below - step, has_below & has_left) << GUIDE_LOWER_LEFT |
                              BYTE(below, has_below) << GUIDE_BELOW |
                              BYTE(below + step, has_below & has_right) << GUIDE_LOWER_RIGHT;
#undef BYTE
            guides[i * field_size(width, height) + field_place(width, x, y)] = word;
        }
    }
}
