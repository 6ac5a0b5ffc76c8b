#include "shading/material.cl"

// What lies on the base of an opaque surface: sheen, and on that a clearcoat.
//
//   f = coat + through(coat) (sheen + through(sheen) f_base)
//   through(x) = min(1 - E_x(wo), 1 - E_x(wi))
//
// where E_x is the directional albedo of x. This rule keeps the whole reciprocal and below 1 whatever lies
// below; a factor of wo alone would not be reciprocal, one for both directions would count what is lost twice
// (KHR_materials_sheen names the same). The clearcoat is a GGX dielectric with an index of refraction of 1.5
// and a normal of its own. Sheen has the distribution and masking of A. Conty Estevez and C. Kulla,
// Production Friendly Microfacet Sheen BRDF, SIGGRAPH Courses 2017; where that reflects more than arrives, at
// grazing angles, it is divided by its albedo, in both directions.

#if HAS_TRAIT(CLEARCOAT) || HAS_TRAIT(SHEEN)
#define COATED
#endif

#ifndef COATED
#define LayeredBsdf OpaqueBsdf
#define layered_bsdf(m, tables, multiple, coat_normal) bsdf_of(m, tables, multiple)
#define eval_bsdf eval_base
#define sample_bsdf sample_base
#else

typedef struct {
    OpaqueBsdf base;
    Vec3 coat_normal, sheen_color;
    AlbedoRows coat_rows, sheen_rows;
    float coat, coat_alpha, sheen, sheen_alpha; // `sheen` is the largest of its colour
} LayeredBsdf;

// `coat_normal` is local to the frame of the base.
INLINE LayeredBsdf layered_bsdf(const SurfaceMaterial *m, AlbedoTables tables, float multiple,
                                Vec3 coat_normal) {
    LayeredBsdf s;
    s.base = bsdf_of(m, tables, multiple);
    s.coat_normal = coat_normal;
    s.coat_rows = rows_at(tables.all, m->clearcoat_roughness);
    s.coat = m->clearcoat;
    s.coat_alpha = MAX(m->clearcoat_roughness * m->clearcoat_roughness, MIN_ALPHA);
    s.sheen_rows = rows_at(tables.all, m->sheen_roughness);
    s.sheen_color = m->sheen_color;
    s.sheen = largest(m->sheen_color);
    s.sheen_alpha = MAX(m->sheen_roughness * m->sheen_roughness, MIN_SHEEN_ALPHA);
    return s;
}

INLINE float coat_albedo(const LayeredBsdf *s, float cosine) {
    float all = albedo_at(s->coat_rows, 0u, cosine);
    float grazing = albedo_at(s->coat_rows, ALBEDO_TABLE_SIZE, cosine);
    return s->coat * (CLEARCOAT_F0 * (all - grazing) + grazing);
}

// Of white sheen; it may be above 1.
INLINE float sheen_albedo(const LayeredBsdf *s, float cosine) {
    return albedo_at(s->sheen_rows, 2u * ALBEDO_TABLE_SIZE + 2u, SQRT(CLAMP(cosine, 0.0f, 1.0f)));
}

// Lambda of Smith's masking, the fit of Estevez and Kulla: between that of a narrow and of a wide
// distribution.
INLINE float sheen_lambda(float alpha, float cosine) {
    float t = (1.0f - alpha) * (1.0f - alpha);
    float a = LERP(SHEEN_WIDE_0, SHEEN_NARROW_0, t), b = LERP(SHEEN_WIDE_1, SHEEN_NARROW_1, t);
    float c = LERP(SHEEN_WIDE_2, SHEEN_NARROW_2, t), d = LERP(SHEEN_WIDE_3, SHEEN_NARROW_3, t);
    float e = LERP(SHEEN_WIDE_4, SHEEN_NARROW_4, t);
    float x = CLAMP(cosine, 1e-4f, 1.0f);
    float near = x < 0.5f ? x : 1.0f - x;
    float power = exp_negative(c * logarithm(MAX(near, 1e-4f)));
    float fitted = a / (1.0f + b * power) + d * near + e;
    float middle = a / (1.0f + b * exp_negative(c * -0.69314718f)) + 0.5f * d + e;
    return exponential(x < 0.5f ? fitted : 2.0f * middle - fitted);
}

INLINE Vec3 eval_sheen(const LayeredBsdf *s, Vec3 wo, Vec3 wi, float albedo_o, float albedo_i) {
    Vec3 h = normalize(add(wo, wi));
    float sine2 = MAX(h.x * h.x + h.y * h.y, 1e-12f);
    float inverse = 1.0f / s->sheen_alpha;
    float d = (2.0f + inverse) * (0.5f * INV_PI) * exp_negative(0.5f * inverse * logarithm(sine2));
    float masking = 1.0f + sheen_lambda(s->sheen_alpha, wo.z) + sheen_lambda(s->sheen_alpha, wi.z);
    float most = MAX(MAX(albedo_o, albedo_i), 1.0f);
    return scale(d / (4.0f * MAX(wo.z, 1e-4f) * masking * most), s->sheen_color);
}

INLINE BsdfValue eval_coat(const LayeredBsdf *s, Vec3 wo, Vec3 wi) {
    float cos_o = dot(wo, s->coat_normal), cos_i = dot(wi, s->coat_normal);
    Vec3 h = normalize(add(wo, wi));
    float cos_h = dot(h, s->coat_normal), o_h = dot(wo, h);
    float a2 = s->coat_alpha * s->coat_alpha;
    Vec3 across = subtract(h, scale(cos_h, s->coat_normal));
    float slope = dot(across, across) / a2 + cos_h * cos_h;
    float d = 1.0f / (PI * a2 * slope * slope);
    float root_o = SQRT(a2 + (1.0f - a2) * cos_o * cos_o);
    float root_i = SQRT(a2 + (1.0f - a2) * cos_i * cos_i);
    int above = (cos_o > 0.0f) & (cos_i > 0.0f);
    BsdfValue result;
    float f_cos = s->coat * schlick(CLEARCOAT_F0, o_h) * d * 0.5f * cos_i / (cos_i * root_o + cos_o * root_i);
    result.f_cos = vec3(f_cos, f_cos, f_cos);
    result.f_cos = select(above, result.f_cos, vec3(0.0f, 0.0f, 0.0f));
    result.pdf = above ? 0.5f * d / (cos_o + root_o) : 0.0f;
    return result;
}

// The chances with which a sample is one of the clearcoat and of the sheen: their shares of the albedo for
// wo, kept away from 0 and 1 where they exist.
typedef struct {
    float coat, sheen;
} CoatChances;

INLINE CoatChances coat_chances(const LayeredBsdf *s, float coat_wo, float sheen_wo, float layer_wo) {
    float below = 1.0f - coat_wo, fuzz = below * MIN(sheen_wo, 1.0f);
    float sheen = fuzz * luminance(s->sheen_color);
    float specular = layer_wo * LERP(1.0f, MAX(luminance(s->base.f0), 0.0f), s->base.metallic);
    float base = (below - fuzz * s->sheen) * (specular + diffuse_luminance(&s->base) * (1.0f - layer_wo));
    CoatChances chances;
    chances.coat = s->coat > 0.0f ? CLAMP(coat_wo / MAX(coat_wo + sheen + base, 1e-12f), 0.1f, 0.9f) : 0.0f;
    float share = CLAMP(sheen / MAX(sheen + base, 1e-12f), 0.1f, 0.9f);
    chances.sheen = s->sheen > 0.0f ? (1.0f - chances.coat) * share : 0.0f;
    return chances;
}

INLINE BsdfValue eval_bsdf(const LayeredBsdf *s, Vec3 wo, Vec3 wi) {
    BsdfValue result = eval_base(&s->base, wo, wi);
    float cos_i = FABS(wi.z);
    int above = (wo.z > 0.0f) & (wi.z > 0.0f);
#if HAS_TRAIT(CLEARCOAT)
    float coat_wo = coat_albedo(s, dot(wo, s->coat_normal));
    float coat_wi = coat_albedo(s, FABS(dot(wi, s->coat_normal)));
    BsdfValue coat = eval_coat(s, wo, wi);
    coat.f_cos = select(above, coat.f_cos, vec3(0.0f, 0.0f, 0.0f));
    coat.pdf = above ? coat.pdf : 0.0f;
#else
    float coat_wo = 0.0f;
#endif
#if HAS_TRAIT(SHEEN)
    float sheen_wo = sheen_albedo(s, wo.z), sheen_wi = sheen_albedo(s, cos_i);
#else
    float sheen_wo = 0.0f;
#endif
    CoatChances chances = coat_chances(s, coat_wo, sheen_wo, layer_albedo(&s->base, wo));
    result.pdf *= 1.0f - chances.coat - chances.sheen;
#if HAS_TRAIT(SHEEN)
    float lost = s->sheen * MIN(MAX(sheen_wo, sheen_wi), 1.0f);
    Vec3 fuzz = eval_sheen(s, wo, wi, sheen_wo, sheen_wi);
    fuzz = select(above, fuzz, vec3(0.0f, 0.0f, 0.0f));
    result.f_cos = add(scale(1.0f - lost, result.f_cos), fuzz);
    result.pdf += above ? chances.sheen * 0.5f * INV_PI : 0.0f;
#endif
#if HAS_TRAIT(CLEARCOAT)
    result.f_cos = add(scale(1.0f - MAX(coat_wo, coat_wi), result.f_cos), coat.f_cos);
    result.pdf += chances.coat * coat.pdf;
#endif
    return result;
}

INLINE BsdfSample sample_bsdf(const LayeredBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
#if HAS_TRAIT(CLEARCOAT)
    float coat_wo = coat_albedo(s, dot(wo, s->coat_normal));
#else
    float coat_wo = 0.0f;
#endif
#if HAS_TRAIT(SHEEN)
    float sheen_wo = sheen_albedo(s, wo.z);
#else
    float sheen_wo = 0.0f;
#endif
    CoatChances chances = coat_chances(s, coat_wo, sheen_wo, layer_albedo(&s->base, wo));
    float first = chances.coat + chances.sheen;
    Vec3 wi =
        sample_base_direction(&s->base, wo, direction, MIN((lobe - first) / (1.0f - first), 0.99999994f));
#if HAS_TRAIT(SHEEN)
    wi = select(lobe < first, sample_hemisphere(direction.u, direction.v), wi);
#endif
#if HAS_TRAIT(CLEARCOAT)
    Frame frame = frame_of(s->coat_normal);
    Vec3 seen = to_local(frame, wo);
    seen.z = MAX(seen.z, 1e-4f);
    Vec3 h = sample_visible_normal(seen, s->coat_alpha, direction.u, direction.v);
    Vec3 mirrored = from_local(frame, subtract(scale(2.0f * dot(seen, h), h), seen));
    wi = select(lobe < chances.coat, reflected_above(mirrored), wi);
#endif
    return sample_of(eval_bsdf(s, wo, wi), wi);
}
#endif
