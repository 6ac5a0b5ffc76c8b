#include "base/sampling.cl"

// The opaque surface: a GGX metal, or a Lambertian base under a dielectric GGX layer, or a blend of both.
// Directions are local (normal along z), unit, and point away from the surface; densities are per solid
// angle; the cosine of wi is part of what eval and sample return.
//
//   f = D V (F0 + (F90 - F0) (1 - <wo, h>)^5) + base / pi (1 - E(wo)) (1 - E(wi)) / (1 - E_avg)
//   base = (1 - metallic) rho + metallic M
//
// D and V are GGX with height-correlated Smith masking (Heitz 2014), Fresnel is Schlick's, and E is the
// directional albedo of what reflects at once, tabulated per material by albedo.py. What the layer reflects
// does not reach the Lambertian base, in both directions, so that a white base under a lossless layer
// reflects exactly everything and the whole stays reciprocal (Kelemen and Szirmay-Kalos 2001). What metal
// does not reflect at once meets more microfacets, and the share M of it comes out after all, in the same
// directions (C. Kulla and A. Conty, Revisiting Physically Based Shading at Imageworks, SIGGRAPH Courses
// 2017): white metal loses nothing.
//
// The variant MATTE serves scenes without metals and layers, where f is rho / pi.

typedef struct {
    Vec3 base;    // albedo of what is not reflected at once
    Vec3 f0, f90; // specular reflectance at normal and at grazing incidence
    float alpha;  // GGX roughness
    float metallic;
    __global const float *layer; // E at ALBEDO_TABLE_SIZE cosines from 0 to 1, then 1 / (1 - E_avg)
} OpaqueBsdf;

typedef struct {
    Vec3 f_cos;
    float pdf;
} BsdfValue;

typedef struct {
    Vec3 wi;
    Vec3 weight; // f cos / pdf; 0 where the sample failed
    float pdf;
} BsdfSample;

// `multiple` is 1, or 0 where nothing comes out of metal that scatters more than once.
INLINE OpaqueBsdf bsdf_of(__global const Material *material, __global const float *layer, float multiple) {
    OpaqueBsdf s;
    Vec3 color = vec3_at(material->base_color);
    float metallic = material->metallic;
    float specular = material->specular;
    float r = (material->ior - 1.0f) / (material->ior + 1.0f);
    float dielectric_f0 = specular * r * r;
    s.base = scale(1.0f - metallic, color);
#ifndef MATTE
    s.base = add(s.base, scale(multiple, vec3_at(layer + ALBEDO_TABLE_SIZE + 1u)));
#endif
    s.f0 = vec3(LERP(dielectric_f0, color.x, metallic), LERP(dielectric_f0, color.y, metallic),
                LERP(dielectric_f0, color.z, metallic));
    float f90 = LERP(specular, 1.0f, metallic);
    s.f90 = vec3(f90, f90, f90);
    s.alpha = MAX(material->roughness * material->roughness, MIN_ALPHA);
    s.metallic = metallic;
    s.layer = layer;
    return s;
}

INLINE float layer_albedo(const OpaqueBsdf *s, float cosine) {
    float place = CLAMP(cosine, 0.0f, 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint cell = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    float t = place - (float)cell;
    return LERP(s->layer[cell], s->layer[cell + 1u], t);
}

// Chance of sampling the specular part: its share of the albedo for wo, kept away from 0 and 1 where both
// parts exist, so that neither is starved where the estimate is off. Of metal it is known.
INLINE float specular_probability(const OpaqueBsdf *s, float layer_wo) {
    float specular = layer_wo * LERP(1.0f, MAX(luminance(s->f0), 0.0f), s->metallic);
    float diffuse = luminance(s->base) * (1.0f - layer_wo);
    float share = specular / MAX(specular + diffuse, 1e-12f);
    int both = (specular > 0.0f) & (diffuse > 0.0f);
    return both ? CLAMP(share, 0.1f, LERP(0.9f, 1.0f, s->metallic)) : (diffuse > 0.0f ? 0.0f : 1.0f);
}

#ifdef MATTE
INLINE BsdfValue eval_bsdf(const OpaqueBsdf *s, Vec3 wo, Vec3 wi) {
    int above = (wo.z > 0.0f) & (wi.z > 0.0f);
    float cosine = above ? wi.z : 0.0f;
    BsdfValue result;
    result.f_cos = scale(cosine * INV_PI, s->base);
    result.pdf = cosine * INV_PI;
    return result;
}

INLINE BsdfSample sample_bsdf(const OpaqueBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
    BsdfSample result;
    result.wi = sample_cosine_hemisphere(direction.u, direction.v);
    result.pdf = wo.z > 0.0f ? result.wi.z * INV_PI : 0.0f;
    result.weight = select(result.pdf > 0.0f, s->base, vec3(0.0f, 0.0f, 0.0f));
    return result;
}
#else
INLINE BsdfValue eval_bsdf(const OpaqueBsdf *s, Vec3 wo, Vec3 wi) {
    float a2 = s->alpha * s->alpha;
    Vec3 h = normalize(add(wo, wi));
    float slope = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    float d = 1.0f / (PI * a2 * slope * slope);
    float root_o = SQRT(a2 + (1.0f - a2) * wo.z * wo.z);
    float root_i = SQRT(a2 + (1.0f - a2) * wi.z * wi.z);
    float v_cos = 0.5f * wi.z / (wi.z * root_o + wo.z * root_i);
    float c = 1.0f - CLAMP(dot(wo, h), 0.0f, 1.0f);
    float schlick = c * c * c * c * c;
    Vec3 fresnel = add(s->f0, scale(schlick, subtract(s->f90, s->f0)));

    float layer_wo = layer_albedo(s, wo.z);
    float through = (1.0f - layer_wo) * (1.0f - layer_albedo(s, wi.z)) * s->layer[ALBEDO_TABLE_SIZE];
    float p = specular_probability(s, layer_wo);

    int above = (wo.z > 0.0f) & (wi.z > 0.0f);
    BsdfValue result;
    result.f_cos = add(scale(d * v_cos, fresnel), scale(through * wi.z * INV_PI, s->base));
    result.f_cos = select(above, result.f_cos, vec3(0.0f, 0.0f, 0.0f));
    float pdf = p * 0.5f * d / (wo.z + root_o) + (1.0f - p) * wi.z * INV_PI;
    result.pdf = above ? pdf : 0.0f;
    return result;
}

INLINE BsdfSample sample_bsdf(const OpaqueBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
    int specular = lobe < specular_probability(s, layer_albedo(s, wo.z));
    Vec3 h = sample_visible_normal(wo, s->alpha, direction.u, direction.v);
    Vec3 reflected = subtract(scale(2.0f * dot(wo, h), h), wo);
    Vec3 wi = select(specular, reflected, sample_cosine_hemisphere(direction.u, direction.v));
    BsdfValue value = eval_bsdf(s, wo, wi);
    int valid = value.pdf > 0.0f;
    BsdfSample result;
    result.wi = wi;
    result.pdf = value.pdf;
    result.weight =
        select(valid, scale(1.0f / (valid ? value.pdf : 1.0f), value.f_cos), vec3(0.0f, 0.0f, 0.0f));
    return result;
}
#endif
