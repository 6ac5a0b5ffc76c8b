#include "shading/material.cl"
#include "shading/medium.cl"

// The boundary between two transparent media, smooth or rough. Directions are local, the normal points to
// wo's side (wo.z > 0), eta is the IOR of the far side over that of wo's side.
// B. Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007.

typedef struct {
    float eta;
    float alpha;
    float specular;   // scales Fresnel reflection, total internal reflection apart (KHR_materials_specular)
    Vec3 transmitted; // tint of what goes through
} Boundary;

// Unpolarised Fresnel reflectance; cosine > 0 on the side of incidence. 1 under total internal reflection.
INLINE float fresnel_dielectric(float cosine, float eta) {
    float sin2_t = (1.0f - cosine * cosine) / (eta * eta);
    float cos_t = SQRT(MAX(1.0f - sin2_t, 0.0f));
    float parallel = (eta * cosine - cos_t) / (eta * cosine + cos_t);
    float perpendicular = (cosine - eta * cos_t) / (cosine + eta * cos_t);
    float reflected = 0.5f * (parallel * parallel + perpendicular * perpendicular);
    return sin2_t >= 1.0f ? 1.0f : reflected;
}

INLINE float boundary_reflectance(const Boundary *b, float cosine) {
    float f = fresnel_dielectric(cosine, b->eta);
    return f < 1.0f ? f * b->specular : 1.0f;
}

// The direction behind the boundary of light that comes along wo, for a microfacet normal h with
// <wo, h> > 0; of no meaning under total internal reflection.
INLINE Vec3 refracted(Vec3 wo, Vec3 h, float eta) {
    float cosine = dot(wo, h);
    float cos_t = SQRT(MAX(1.0f - (1.0f - cosine * cosine) / (eta * eta), 0.0f));
    return add(scale(-1.0f / eta, wo), scale(cosine / eta - cos_t, h));
}

// GGX with height-correlated Smith masking; the cosine of wi is in f_cos, pdf is per solid angle and that of
// sample_rough_boundary. Radiance is scaled by 1 / eta^2 on its way through, as it travels against the path.
INLINE BsdfValue eval_rough_boundary(const Boundary *b, Vec3 wo, Vec3 wi) {
    int reflects = wi.z > 0.0f;
    Vec3 h = add(wo, scale(reflects ? 1.0f : b->eta, wi));
    float length2 = dot(h, h);
    h = scale((h.z < 0.0f ? -1.0f : 1.0f) / SQRT(MAX(length2, 1e-14f)), h);
    float o_h = dot(wo, h), i_h = dot(wi, h);
    int possible = (length2 >= 1e-14f) & (wo.z > 0.0f) & (wi.z != 0.0f) & (o_h > 0.0f) &
                   (reflects ? i_h > 0.0f : i_h < 0.0f);

    float a2 = b->alpha * b->alpha;
    float slope = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    float d = 1.0f / (PI * a2 * slope * slope);
    float mu_i = FABS(wi.z);
    float lambda_o = 0.5f * (SQRT(a2 + (1.0f - a2) * wo.z * wo.z) / wo.z - 1.0f);
    float lambda_i = 0.5f * (SQRT(a2 + (1.0f - a2) * mu_i * mu_i) / mu_i - 1.0f);
    // Smith masking correlates with height on one side of the surface only; across it both maskings
    // hold at once with Beta(1 + lambda_o, 1 + lambda_i), for which G1 G1 is the usual stand-in.
    float g2 = 1.0f / (reflects ? 1.0f + lambda_o + lambda_i : (1.0f + lambda_o) * (1.0f + lambda_i));
    float visible_pdf = d * o_h / (wo.z * (1.0f + lambda_o));
    float f = boundary_reflectance(b, o_h);
    float denominator = i_h + o_h / b->eta;
    float jacobian = -i_h / (denominator * denominator);
    float reflected = f * d * g2 / (4.0f * wo.z);
    float passed = (1.0f - f) * d * g2 * o_h * jacobian / (wo.z * b->eta * b->eta);
    float pdf = reflects ? f * visible_pdf / (4.0f * o_h) : (1.0f - f) * visible_pdf * jacobian;
    BsdfValue result;
    result.f_cos = select(reflects, vec3(reflected, reflected, reflected), scale(passed, b->transmitted));
    result.f_cos = select(possible, result.f_cos, vec3(0.0f, 0.0f, 0.0f));
    result.pdf = possible ? pdf : 0.0f;
    return result;
}

INLINE BsdfSample sample_rough_boundary(const Boundary *b, Vec3 wo, Uniform2 uv, float lobe) {
    Vec3 h = sample_visible_normal(wo, b->alpha, uv.u, uv.v);
    float o_h = dot(wo, h);
    int reflects = lobe < boundary_reflectance(b, o_h);
    BsdfSample result;
    result.wi = select(reflects, subtract(scale(2.0f * o_h, h), wo), normalize(refracted(wo, h, b->eta)));
    BsdfValue value = eval_rough_boundary(b, wo, result.wi);
    // A microfacet may send light to the wrong side of the surface: such samples are lost, as in nature
    // they would meet another facet.
    int valid = (value.pdf > 0.0f) & (reflects == (result.wi.z > 0.0f));
    result.pdf = valid ? value.pdf : 0.0f;
    result.weight = scale(valid ? 1.0f / value.pdf : 0.0f, value.f_cos);
    return result;
}

INLINE BsdfSample sample_smooth_boundary(const Boundary *b, Vec3 wo, float lobe) {
    int reflects = lobe < boundary_reflectance(b, wo.z);
    Vec3 normal = vec3(0.0f, 0.0f, 1.0f);
    BsdfSample result;
    result.wi = select(reflects, vec3(-wo.x, -wo.y, wo.z), normalize(refracted(wo, normal, b->eta)));
    result.weight = select(reflects, vec3(1.0f, 1.0f, 1.0f), scale(1.0f / (b->eta * b->eta), b->transmitted));
    result.pdf = 0.0f; // a single direction: no density
    return result;
}
