#include "base/rng.cl"

// Directions around a normal, and searches in tables. Local frames have the normal along z.

typedef struct {
    Vec3 tangent, bitangent, normal;
} Frame;

// T. Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017.
INLINE Frame frame_of(Vec3 n) {
    float sign = n.z >= 0.0f ? 1.0f : -1.0f;
    float a = -1.0f / (sign + n.z);
    float b = n.x * n.y * a;
    Frame frame;
    frame.tangent = vec3(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
    frame.bitangent = vec3(b, sign + n.y * n.y * a, -n.y);
    frame.normal = n;
    return frame;
}

INLINE Vec3 to_local(Frame f, Vec3 v) {
    return vec3(dot(v, f.tangent), dot(v, f.bitangent), dot(v, f.normal));
}

INLINE Vec3 from_local(Frame f, Vec3 v) {
    return add(add(scale(v.x, f.tangent), scale(v.y, f.bitangent)), scale(v.z, f.normal));
}

// Density cos / pi per solid angle.
INLINE Vec3 sample_cosine_hemisphere(float u, float v) {
    float sine, cosine;
    sincos_turns(v, &sine, &cosine);
    float radius = SQRT(u);
    return vec3(radius * cosine, radius * sine, SQRT(MAX(1.0f - u, 0.0f)));
}

// A microfacet normal that is visible from wo (wo.z > 0) on a GGX surface that is stretched along its axes,
// density G1(wo) D(h) <wo, h> / wo.z. J. Dupuy and A. Benyoub, Sampling Visible GGX Normals with Spherical
// Caps, HPG 2023.
INLINE Vec3 sample_stretched_normal(Vec3 wo, float alpha_x, float alpha_y, float u, float v) {
    Vec3 stretched = normalize(vec3(alpha_x * wo.x, alpha_y * wo.y, wo.z));
    float sine, cosine;
    sincos_turns(u, &sine, &cosine);
    float z = (1.0f - v) * (1.0f + stretched.z) - stretched.z;
    float radius = SQRT(CLAMP(1.0f - z * z, 0.0f, 1.0f));
    Vec3 h = add(vec3(radius * cosine, radius * sine, z), stretched);
    return normalize(vec3(alpha_x * h.x, alpha_y * h.y, MAX(h.z, 1e-7f)));
}

// The same of one that is not stretched.
INLINE Vec3 sample_visible_normal(Vec3 wo, float alpha, float u, float v) {
    return sample_stretched_normal(wo, alpha, alpha, u, v);
}

// Density 1 / (2 pi) per solid angle.
INLINE Vec3 sample_hemisphere(float u, float v) {
    float sine, cosine;
    sincos_turns(v, &sine, &cosine);
    float radius = SQRT(MAX(1.0f - u * u, 0.0f));
    return vec3(radius * cosine, radius * sine, u);
}

// Barycentric coordinates of a point that is uniform on a triangle, for its second and third vertex.
INLINE void sample_triangle(float u, float v, float *b1, float *b2) {
    float root = SQRT(u);
    *b1 = 1.0f - root;
    *b2 = v * root;
}

// Index of the cell of a cumulative table cdf[0 .. count] (0 first, 1 last) in which u lies. The number of
// steps is fixed, so that all lanes take the same steps.
INLINE uint find_cell(__global const float *cdf, uint count, float u) {
    uint low = 0, high = count;
#pragma unroll
    for (uint step = 0; step < ENVIRONMENT_SEARCH_STEPS; step++) {
        uint middle = (low + high) >> 1;
        int right = cdf[middle] <= u;
        low = right ? middle : low;
        high = right ? high : middle;
    }
    return MIN(low, count - 1u);
}

// Power heuristic of two techniques (Veach and Guibas 1995), one sample each.
INLINE float mis_weight(float pdf, float other_pdf) {
    float ratio = other_pdf / pdf;
    return 1.0f / (1.0f + ratio * ratio);
}

// The weight of light that was found by light sampling, with a density above 0. MIS_ONLY_LIGHT and
// MIS_ONLY_BSDF leave all light to one of the techniques, for the tests.
INLINE float light_sampling_weight(float light_pdf, float bsdf_pdf) {
#if defined(MIS_ONLY_LIGHT)
    return 1.0f;
#elif defined(MIS_ONLY_BSDF)
    return 0.0f;
#else
    return mis_weight(light_pdf, bsdf_pdf);
#endif
}

// The weight of light that a ray has found whose direction was chosen with the density `bsdf_pdf`. Where that
// is 0 no other technique could have found the light.
INLINE float bsdf_sampling_weight(float bsdf_pdf, float light_pdf) {
#if defined(MIS_ONLY_LIGHT)
    float weight = light_pdf > 0.0f ? 0.0f : 1.0f;
#elif defined(MIS_ONLY_BSDF)
    float weight = 1.0f;
#else
    float weight = mis_weight(MAX(bsdf_pdf, 1e-30f), light_pdf);
#endif
    return bsdf_pdf > 0.0f ? weight : 1.0f;
}

// Chance that Russian roulette lets a path go on that had `bounces` scattering events before this one.
INLINE float survival_probability(Vec3 throughput, uint bounces, uint roulette_depth) {
    float share = CLAMP(largest(throughput), 0.05f, 1.0f);
    return bounces >= roulette_depth ? share : 1.0f;
}
