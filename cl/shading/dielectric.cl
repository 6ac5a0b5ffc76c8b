#include "shading/fresnel.cl"
#include "shading/material.cl"
#include "shading/medium.cl"

// The boundary between two transparent media, smooth or rough. Directions are local, the normal points to
// wo's side (wo.z > 0), eta is the IOR of the far side over that of wo's side.
// B. Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007.
//
// THIN_WALLED: a wall without a thickness has such a boundary on either side. Light that is to and fro
// between them leaves at once, in the direction that it came in, or as if mirrored there.

typedef struct {
    float eta;
    float alpha;
    float specular;   // scales Fresnel reflection, total internal reflection apart (KHR_materials_specular)
    Vec3 transmitted; // tint of what goes through
    float gain;       // of rough boundaries, see rough_gain
#if HAS_TRAIT(THIN_WALLED)
    int thin;
#endif
#if HAS_TRAIT(CLEAR_WALL)
    int clear;
#endif
#if HAS_TRAIT(SPECULAR_COLOR)
    Vec3 tint; // of what is reflected
#endif
#if HAS_TRAIT(IRIDESCENCE)
    ThinFilm film; // all but f0
    float iridescence;
#endif
} Boundary;

// How light parts at a boundary: the chance of a reflection, and what it and the other way are weighted by.
typedef struct {
    float reflects;
    Vec3 reflected, passed;
} Parting;

INLINE int is_thin(const Boundary *b) {
#if HAS_TRAIT(THIN_WALLED)
    return b->thin;
#else
    return 0;
#endif
}

INLINE Parting boundary_parting(const Boundary *b, float cosine) {
    float f = fresnel_dielectric(cosine, b->eta);
    int total = !(f < 1.0f);
#if HAS_TRAIT(THIN_WALLED)
    f = is_thin(b) ? wall_reflectance(cosine, b->eta) : f;
#endif
    Parting parting;
    parting.reflects = total ? 1.0f : f * b->specular;
#if HAS_TRAIT(CLEAR_WALL)
    // What goes through has not ended here.
    parting.reflects = b->clear ? 1.0f : parting.reflects;
#endif
    parting.reflected = vec3(1.0f, 1.0f, 1.0f);
    parting.passed = b->transmitted;
#if HAS_TRAIT(SPECULAR_COLOR) || HAS_TRAIT(IRIDESCENCE)
    Vec3 color = vec3(parting.reflects, parting.reflects, parting.reflects);
#if HAS_TRAIT(IRIDESCENCE)
    // Between bodies the film lies in air, as everywhere.
    ThinFilm film = b->film;
    float r = (b->eta - 1.0f) / (b->eta + 1.0f);
    film.f0 = vec3(r * r, r * r, r * r);
    Vec3 of_film = scale(b->specular, film_reflectance(&film, cosine));
    color = add(color, scale(b->iridescence, subtract(of_film, color)));
#endif
#if HAS_TRAIT(SPECULAR_COLOR)
    color = mul(color, b->tint);
    color = vec3(MIN(color.x, 1.0f), MIN(color.y, 1.0f), MIN(color.z, 1.0f));
#endif
    // The chance is that of the mean, away from 0 and 1 where a channel is not there.
    float chance = (color.x + color.y + color.z) * (1.0f / 3.0f);
    float least = MIN(MIN(color.x, color.y), color.z), most = largest(color);
    chance = CLAMP(chance, 0.25f * most, 0.75f + 0.25f * least);
    Vec3 reflected = scale(1.0f / MAX(chance, 1e-12f), color);
    Vec3 rest = subtract(vec3(1.0f, 1.0f, 1.0f), color);
    Vec3 passed = mul(scale(1.0f / MAX(1.0f - chance, 1e-12f), rest), b->transmitted);
    parting.reflects = total ? 1.0f : chance;
    parting.reflected = select(total, parting.reflected, reflected);
    parting.passed = select(total, parting.passed, passed);
#endif
    return parting;
}

// The direction behind the boundary of light that comes along wo, for a microfacet normal h with
// <wo, h> > 0; of no meaning under total internal reflection.
INLINE Vec3 refracted(Vec3 wo, Vec3 h, float eta) {
    float cosine = dot(wo, h);
    float cos_t = SQRT(MAX(1.0f - (1.0f - cosine * cosine) / (eta * eta), 0.0f));
    return add(scale(-1.0f / eta, wo), scale(cosine / eta - cos_t, h));
}

#define GLASS_ROW (2u * GLASS_STEPS)

// Between two cosines of the table of rough glass, for a boundary whose reflection is scaled.
INLINE float glass_albedo(__global const float *row, float share, float specular) {
    return LERP(LERP(row[0], row[1], specular), LERP(row[2], row[3], specular), share);
}

// What a rough boundary reflects or lets through is this many times what microfacets do at once, so that what
// meets several of them is not lost: it takes the same ways as the rest (E. Turquin, Practical Multiple
// Scattering Compensation for Microfacet Models, 2019). `glass` is the table of albedo.glass_table, `rows`
// that of albedo.rows, which serves walls: the shares of both sides of one depend on masking alone.
INLINE float rough_gain(const Boundary *b, float roughness, float cosine, __global const float *glass,
                        __global const float *rows) {
    float step = CLAMP((b->eta - 1.0f) / (b->eta + 1.0f) + 0.5f, 0.0f, 1.0f) * (float)(GLASS_STEPS - 1u);
    float rough = CLAMP(roughness, 0.0f, 1.0f) * (float)(GLASS_STEPS - 1u);
    float root = SQRT(CLAMP(cosine, 0.0f, 1.0f)) * (float)(GLASS_STEPS - 1u);
    uint i = MIN((uint)step, GLASS_STEPS - 2u), j = MIN((uint)rough, GLASS_STEPS - 2u);
    uint k = MIN((uint)root, GLASS_STEPS - 2u);
    float s = step - (float)i, t = rough - (float)j, u = root - (float)k;
    __global const float *first = glass + 2u * ((i * GLASS_STEPS + j) * GLASS_STEPS + k);
    // Along the root of the cosine, then roughness, then the step.
    float albedo =
        LERP(LERP(glass_albedo(first, u, b->specular), glass_albedo(first + GLASS_ROW, u, b->specular), t),
             LERP(glass_albedo(first + GLASS_STEPS * GLASS_ROW, u, b->specular),
                  glass_albedo(first + (GLASS_STEPS + 1u) * GLASS_ROW, u, b->specular), t),
             s);
#if HAS_TRAIT(THIN_WALLED)
    albedo = is_thin(b) ? albedo_at(rows_at(rows, roughness), 0u, cosine) : albedo;
#endif
    return 1.0f / MAX(albedo, 0.1f);
}

// GGX with height-correlated Smith masking; the cosine of wi is in f_cos, pdf is per solid angle and that of
// sample_rough_boundary. Radiance is scaled by 1 / eta^2 on its way through, as it travels against the path.
INLINE BsdfValue eval_rough_boundary(const Boundary *b, Vec3 wo, Vec3 wi) {
    int reflects = wi.z > 0.0f;
    int thin = is_thin(b);
    // What goes through a wall is as if mirrored by it.
    wi.z = thin ? FABS(wi.z) : wi.z;
    Vec3 h = add(wo, scale(reflects | thin ? 1.0f : b->eta, wi));
    float length2 = dot(h, h);
    h = scale((h.z < 0.0f ? -1.0f : 1.0f) / SQRT(MAX(length2, 1e-14f)), h);
    float o_h = dot(wo, h), i_h = dot(wi, h);
    int possible = (length2 >= 1e-14f) & (wo.z > 0.0f) & (wi.z != 0.0f) & (o_h > 0.0f) &
                   (reflects | thin ? i_h > 0.0f : i_h < 0.0f);

    float a2 = b->alpha * b->alpha;
    float slope = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    float d = 1.0f / (PI * a2 * slope * slope);
    float mu_i = FABS(wi.z);
    float lambda_o = 0.5f * (SQRT(a2 + (1.0f - a2) * wo.z * wo.z) / wo.z - 1.0f);
    float lambda_i = 0.5f * (SQRT(a2 + (1.0f - a2) * mu_i * mu_i) / mu_i - 1.0f);
    // Smith masking correlates with height on one side of the surface only; across it both maskings
    // hold at once with Beta(1 + lambda_o, 1 + lambda_i), for which G1 G1 is the usual stand-in.
    float g2 = 1.0f / (reflects | thin ? 1.0f + lambda_o + lambda_i : (1.0f + lambda_o) * (1.0f + lambda_i));
    float visible_pdf = d * o_h / (wo.z * (1.0f + lambda_o));
    Parting parting = boundary_parting(b, o_h);
    float f = parting.reflects;
    float denominator = i_h + o_h / b->eta;
    float jacobian = -i_h / (denominator * denominator);
    float reflected = f * d * g2 / (4.0f * wo.z);
    float passed = (1.0f - f) * d * g2 * o_h * jacobian / (wo.z * b->eta * b->eta);
    float pdf = reflects ? f * visible_pdf / (4.0f * o_h) : (1.0f - f) * visible_pdf * jacobian;
#if HAS_TRAIT(THIN_WALLED)
    passed = thin ? (1.0f - f) * d * g2 / (4.0f * wo.z) : passed;
    pdf = (thin & !reflects) ? (1.0f - f) * visible_pdf / (4.0f * o_h) : pdf;
#endif
    BsdfValue result;
    result.f_cos = select(reflects, scale(reflected, parting.reflected), scale(passed, parting.passed));
    result.f_cos = select(possible, scale(b->gain, result.f_cos), vec3(0.0f, 0.0f, 0.0f));
    result.pdf = possible ? pdf : 0.0f;
    return result;
}

INLINE BsdfSample sample_rough_boundary(const Boundary *b, Vec3 wo, Uniform2 uv, float lobe) {
    Vec3 h = sample_visible_normal(wo, b->alpha, uv.u, uv.v);
    float o_h = dot(wo, h);
    int reflects = lobe < boundary_parting(b, o_h).reflects;
    BsdfSample result;
    Vec3 mirrored = subtract(scale(2.0f * o_h, h), wo);
    result.wi = select(reflects, mirrored, normalize(refracted(wo, h, b->eta)));
#if HAS_TRAIT(THIN_WALLED)
    // Not where the mirror image is below the surface already.
    Vec3 behind = vec3(mirrored.x, mirrored.y, mirrored.z > 0.0f ? -mirrored.z : 1.0f);
    result.wi = select(is_thin(b) & !reflects, behind, result.wi);
#endif
    BsdfValue value = eval_rough_boundary(b, wo, result.wi);
    // A microfacet may send light to the wrong side of the surface: such samples are lost, as in nature
    // they would meet another facet.
    int valid = (value.pdf > 0.0f) & (reflects == (result.wi.z > 0.0f));
    result.pdf = valid ? value.pdf : 0.0f;
    result.weight = scale(valid ? 1.0f / value.pdf : 0.0f, value.f_cos);
    return result;
}

INLINE BsdfSample sample_smooth_boundary(const Boundary *b, Vec3 wo, float lobe) {
    Parting parting = boundary_parting(b, wo.z);
    int reflects = lobe < parting.reflects;
    Vec3 normal = vec3(0.0f, 0.0f, 1.0f);
    BsdfSample result;
    result.wi = select(reflects, vec3(-wo.x, -wo.y, wo.z), normalize(refracted(wo, normal, b->eta)));
    float squeezed = 1.0f / (b->eta * b->eta);
#if HAS_TRAIT(THIN_WALLED)
    result.wi = select(is_thin(b) & !reflects, scale(-1.0f, wo), result.wi);
    squeezed = is_thin(b) ? 1.0f : squeezed;
#endif
    result.weight = select(reflects, parting.reflected, scale(squeezed, parting.passed));
    result.pdf = 0.0f; // a single direction: no density
    return result;
}
