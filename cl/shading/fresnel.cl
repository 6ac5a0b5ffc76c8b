#include "base/scalar.cl"

// How much of the light a smooth boundary reflects.

// Unpolarised Fresnel reflectance; cosine > 0 on the side of incidence. 1 under total internal reflection.
INLINE float fresnel_dielectric(float cosine, float eta) {
    float sin2_t = (1.0f - cosine * cosine) / (eta * eta);
    float cos_t = SQRT(MAX(1.0f - sin2_t, 0.0f));
    float parallel = (eta * cosine - cos_t) / (eta * cosine + cos_t);
    float perpendicular = (cosine - eta * cos_t) / (cosine + eta * cos_t);
    float reflected = 0.5f * (parallel * parallel + perpendicular * perpendicular);
    return sin2_t >= 1.0f ? 1.0f : reflected;
}

// Of a wall without a thickness: the sum of all that leaves in front, after any number of ways to and fro,
// f + (1 - f)^2 f / (1 - f^2).
INLINE float wall_reflectance(float cosine, float eta) {
    float f = fresnel_dielectric(cosine, eta);
    return 2.0f * f / (1.0f + f);
}

// Schlick's approximation, from the reflectance at normal incidence.
INLINE float schlick(float f0, float cosine) {
    float c = 1.0f - CLAMP(cosine, 0.0f, 1.0f);
    return f0 + (1.0f - f0) * (c * c * c * c * c);
}
