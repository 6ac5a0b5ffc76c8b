#include "base/sampling.cl"
#include "base/texture.cl"

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
// The variant MATTE serves scenes without metals and layers, where f is rho / pi. Where textures change what
// E depends on, it comes from the table over roughness from which rows of materials are made, albedos.

// The numbers of a material at one point.
typedef struct {
    Vec3 base_color, emission;
    float metallic, roughness, specular, ior, transmission;
} SurfaceMaterial;

INLINE SurfaceMaterial plain_material(__global const Material *material) {
    SurfaceMaterial m;
    m.base_color = vec3_at(material->base_color);
    m.emission = vec3_at(material->emission);
    m.metallic = material->metallic;
    m.roughness = material->roughness;
    m.specular = material->specular;
    m.ior = material->ior;
    m.transmission = material->transmission;
    return m;
}

// Whether E may differ from point to point of a material.
#ifndef MATTE
#if TEXTURED(BASE_COLOR) || TEXTURED(METALLIC_ROUGHNESS) || TEXTURED(SPECULAR) || defined(VERTEX_COLORS)
#define TEXTURED_LAYER
#endif
#endif

typedef struct {
    Vec3 base;    // albedo of what is not reflected at once
    Vec3 f0, f90; // specular reflectance at normal and at grazing incidence
    float alpha;  // GGX roughness
    float metallic;
#ifdef TEXTURED_LAYER
    __global const float *albedos; // the rows of the roughnesses below and above
    float row_share;               // of the one above
    float share_a, share_b;        // E = share_a A + share_b B, see albedo.py
    float through;                 // 1 / (1 - E_avg)
#else
    __global const float *layer; // E at ALBEDO_TABLE_SIZE cosines from 0 to 1, then 1 / (1 - E_avg)
#endif
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

#ifdef TEXTURED_LAYER
// A value of the table between the rows of both roughnesses.
INLINE float between_rows(const OpaqueBsdf *s, uint place) {
    return LERP(s->albedos[place], s->albedos[ALBEDO_ROW_SIZE + place], s->row_share);
}

// What comes out after all of the light that microfacets of this reflectance lose, see albedo.py; `albedo` is
// the share that they don't lose.
INLINE float scattered_again(float f0, float albedo) {
    float fresnel = f0 + (1.0f - f0) * (1.0f / 21.0f);
    float color = fresnel * fresnel * albedo / (1.0f - fresnel * (1.0f - albedo));
    return 1.0f - albedo < LEAST_ALBEDO_LOSS ? 0.0f : color;
}

INLINE void set_layer(OpaqueBsdf *s, const SurfaceMaterial *m, __global const float *albedos,
                      float dielectric_f0, float multiple) {
    float place = CLAMP(m->roughness, 0.0f, 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint row = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    s->albedos = albedos + row * ALBEDO_ROW_SIZE;
    s->row_share = place - (float)row;
    s->share_b = (1.0f - m->metallic) * (m->specular - dielectric_f0);
    s->share_a = m->metallic + (1.0f - m->metallic) * dielectric_f0;
    float mean = between_rows(s, 2u * ALBEDO_TABLE_SIZE);
    float lost = 1.0f - s->share_a * mean - s->share_b * between_rows(s, 2u * ALBEDO_TABLE_SIZE + 1u);
    s->through = 1.0f / MAX(lost, 1e-6f);
    Vec3 again = vec3(scattered_again(m->base_color.x, mean), scattered_again(m->base_color.y, mean),
                      scattered_again(m->base_color.z, mean));
    s->base = add(s->base, scale(multiple * m->metallic, again));
}
#endif

// `layer` is the row of its material in Shading.layers; `multiple` is 1, or 0 where nothing comes out of
// metal that scatters more than once.
INLINE OpaqueBsdf bsdf_of(const SurfaceMaterial *m, __global const float *layer,
                          __global const float *albedos, float multiple) {
    OpaqueBsdf s;
    Vec3 color = m->base_color;
    float metallic = m->metallic;
    float specular = m->specular;
    float r = (m->ior - 1.0f) / (m->ior + 1.0f);
    float dielectric_f0 = specular * r * r;
    s.base = scale(1.0f - metallic, color);
#if defined(TEXTURED_LAYER)
    set_layer(&s, m, albedos, dielectric_f0, multiple);
#elif !defined(MATTE)
    s.base = add(s.base, scale(multiple, vec3_at(layer + ALBEDO_TABLE_SIZE + 1u)));
#endif
    s.f0 = vec3(LERP(dielectric_f0, color.x, metallic), LERP(dielectric_f0, color.y, metallic),
                LERP(dielectric_f0, color.z, metallic));
    float f90 = LERP(specular, 1.0f, metallic);
    s.f90 = vec3(f90, f90, f90);
    s.alpha = MAX(m->roughness * m->roughness, MIN_ALPHA);
    s.metallic = metallic;
#ifndef TEXTURED_LAYER
    s.layer = layer;
#endif
    return s;
}

INLINE float layer_albedo(const OpaqueBsdf *s, float cosine) {
    float place = CLAMP(cosine, 0.0f, 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint cell = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    float t = place - (float)cell;
#ifdef TEXTURED_LAYER
    float a = LERP(between_rows(s, cell), between_rows(s, cell + 1u), t);
    cell += ALBEDO_TABLE_SIZE;
    float b = LERP(between_rows(s, cell), between_rows(s, cell + 1u), t);
    return s->share_a * a + s->share_b * b;
#else
    return LERP(s->layer[cell], s->layer[cell + 1u], t);
#endif
}

// 1 / (1 - E_avg)
INLINE float inverse_mean_loss(const OpaqueBsdf *s) {
#ifdef TEXTURED_LAYER
    return s->through;
#else
    return s->layer[ALBEDO_TABLE_SIZE];
#endif
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
    float through = (1.0f - layer_wo) * (1.0f - layer_albedo(s, wi.z)) * inverse_mean_loss(s);
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
