#include "base/sampling.cl"
#include "base/texture.cl"
#include "shading/thin_film.cl"

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
//
// Three traits belong to the base. ANISOTROPY: D and V have a roughness for each axis of the tangent frame,
// and E has a table of its own, which knows the azimuth. DIFFUSE_TRANSMISSION: a share of what is diffuse
// leaves on the other side, in a colour of its own. IRIDESCENCE: on its share of the surface the reflectance
// of the film stands for Schlick's, and E grows by what the film reflects more at the angle of w. What lies
// on the base is in layers.cl.

// The numbers of a material at one point. Those of traits are read where the scene has the trait.
typedef struct {
    Vec3 base_color, emission;
    float metallic, roughness, specular, ior, transmission;
    Vec3 specular_color, sheen_color, diffuse_transmission_color;
    float clearcoat, clearcoat_roughness, sheen_roughness, anisotropy, diffuse_transmission;
    float iridescence, iridescence_ior, iridescence_thickness;
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
    m.specular_color = vec3_at(material->specular_color);
    m.clearcoat = material->clearcoat;
    m.clearcoat_roughness = material->clearcoat_roughness;
    m.sheen_color = vec3_at(material->sheen_color);
    m.sheen_roughness = material->sheen_roughness;
    m.anisotropy = material->anisotropy;
    m.iridescence = material->iridescence;
    m.iridescence_ior = material->iridescence_ior;
    m.iridescence_thickness = material->iridescence_thickness;
    m.diffuse_transmission = material->diffuse_transmission;
    m.diffuse_transmission_color = vec3_at(material->diffuse_transmission_color);
    return m;
}

// Whether E may differ from point to point of a material.
#ifndef MATTE
#if TEXTURED(BASE_COLOR) || TEXTURED(METALLIC_ROUGHNESS) || TEXTURED(SPECULAR) ||                            \
    TEXTURED(SPECULAR_COLOR) || defined(VERTEX_COLORS) || HAS_TRAIT(ANISOTROPY)
#define TEXTURED_LAYER
#endif
#endif

// Where the albedos of a material are.
typedef struct {
    __global const float *layer;     // the row of its material in Shading.layers
    __global const float *all;       // Shading.albedos
    __global const float *stretched; // Shading.stretched
} AlbedoTables;

// Two neighbouring rows of the table of albedos, and where a roughness lies between them.
typedef struct {
    __global const float *first;
    float share; // of the second
} AlbedoRows;

INLINE AlbedoRows rows_at(__global const float *albedos, float roughness) {
    float place = CLAMP(roughness, 0.0f, 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint row = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    AlbedoRows rows = {albedos + row * ALBEDO_ROW_SIZE, place - (float)row};
    return rows;
}

// A value of the table between the rows of both roughnesses.
INLINE float between_rows(AlbedoRows rows, uint place) {
    return LERP(rows.first[place], rows.first[ALBEDO_ROW_SIZE + place], rows.share);
}

// A column of the table, which begins at that place of its rows, between its cosines, or roots of them.
INLINE float albedo_at(AlbedoRows rows, uint column, float cosine) {
    float place = CLAMP(cosine, 0.0f, 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint cell = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    return LERP(between_rows(rows, column + cell), between_rows(rows, column + cell + 1u),
                place - (float)cell);
}

#if HAS_TRAIT(ANISOTROPY)
// The same in the table of stretched reflections: four rows, for two roughnesses across and two steps.
typedef struct {
    __global const float *first;
    float share, step_share; // of the next roughness, and of the next step
} StretchedRows;

INLINE StretchedRows stretched_rows_at(__global const float *albedos, float roughness, float stretch) {
    float place = CLAMP(roughness, 0.0f, 1.0f) * (float)(STRETCHED_ROUGHNESSES - 1u);
    uint row = MIN((uint)place, STRETCHED_ROUGHNESSES - 2u);
    float step_place = CLAMP(stretch, 0.0f, 1.0f) * (float)(STRETCHED_STEPS - 1u);
    uint step = MIN((uint)step_place, STRETCHED_STEPS - 2u);
    StretchedRows rows = {albedos + (row * STRETCHED_STEPS + step) * STRETCHED_ROW_SIZE, place - (float)row,
                          step_place - (float)step};
    return rows;
}

INLINE float between_stretched(StretchedRows rows, uint place) {
    __global const float *next = rows.first + STRETCHED_STEPS * STRETCHED_ROW_SIZE;
    float here = LERP(rows.first[place], rows.first[STRETCHED_ROW_SIZE + place], rows.step_share);
    return LERP(here, LERP(next[place], next[STRETCHED_ROW_SIZE + place], rows.step_share), rows.share);
}

// A (`which` 0) or B (1) for directions at this place among the cosines, between three azimuths: a parabola
// in the square of the cosine of the azimuth, `along`.
INLINE float stretched_albedo(StretchedRows rows, uint place, float along, uint which) {
    float across = 1.0f - along;
    return across * (across - along) * between_stretched(rows, place + which) +
           4.0f * along * across * between_stretched(rows, place + 2u + which) +
           along * (along - across) * between_stretched(rows, place + 4u + which);
}
#endif

typedef struct {
    Vec3 base;    // albedo of what is not reflected at once
    Vec3 f0, f90; // specular reflectance at normal and at grazing incidence
    float alpha;  // GGX roughness
    float metallic;
#if HAS_TRAIT(ANISOTROPY)
    float alpha_x; // along the tangent; `alpha` is that across
#endif
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    Vec3 transmitted; // albedo of what leaves on the other side
#endif
#if HAS_TRAIT(IRIDESCENCE)
    ThinFilm film;
    float iridescence; // share of the surface that has the film
    float film_weight; // that scales its reflectance
#endif
#ifdef TEXTURED_LAYER
    AlbedoRows rows; // of the roughness by which E goes
#if HAS_TRAIT(ANISOTROPY)
    StretchedRows stretched;
#endif
    float share_a, share_b; // E = share_a A + share_b B, see albedo.py
    float through;          // 1 / (1 - E_avg)
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
// What comes out after all of the light that microfacets of this reflectance lose, see albedo.py; `albedo` is
// the share that they don't lose.
INLINE float scattered_again(float f0, float albedo) {
    float fresnel = f0 + (1.0f - f0) * (1.0f / 21.0f);
    float color = fresnel * fresnel * albedo / (1.0f - fresnel * (1.0f - albedo));
    return 1.0f - albedo < LEAST_ALBEDO_LOSS ? 0.0f : color;
}

INLINE void set_layer(OpaqueBsdf *s, const SurfaceMaterial *m, AlbedoTables tables, float dielectric_f0,
                      float multiple) {
    s->rows = rows_at(tables.all, m->roughness);
    float mean = between_rows(s->rows, 2u * ALBEDO_TABLE_SIZE);
    float mean_b = between_rows(s->rows, 2u * ALBEDO_TABLE_SIZE + 1u);
#if HAS_TRAIT(ANISOTROPY)
    s->stretched = stretched_rows_at(tables.stretched, m->roughness, m->anisotropy * m->anisotropy);
    mean = between_stretched(s->stretched, STRETCHED_ROW_SIZE - 2u);
    mean_b = between_stretched(s->stretched, STRETCHED_ROW_SIZE - 1u);
#endif
    s->share_b = (1.0f - m->metallic) * (m->specular - dielectric_f0);
    s->share_a = m->metallic + (1.0f - m->metallic) * dielectric_f0;
    float lost = 1.0f - s->share_a * mean - s->share_b * mean_b;
    s->through = 1.0f / MAX(lost, 1e-6f);
    Vec3 again = vec3(scattered_again(m->base_color.x, mean), scattered_again(m->base_color.y, mean),
                      scattered_again(m->base_color.z, mean));
    s->base = add(s->base, scale(multiple * m->metallic, again));
}
#endif

// `multiple` is 1, or 0 where nothing comes out of metal that scatters more than once.
INLINE OpaqueBsdf bsdf_of(const SurfaceMaterial *m, AlbedoTables tables, float multiple) {
    OpaqueBsdf s;
    Vec3 color = m->base_color;
    float metallic = m->metallic;
    float specular = m->specular;
    float r = (m->ior - 1.0f) / (m->ior + 1.0f);
#if HAS_TRAIT(SPECULAR_COLOR)
    Vec3 tint = m->specular_color;
    Vec3 layer_f0 = vec3(specular * MIN(r * r * tint.x, 1.0f), specular * MIN(r * r * tint.y, 1.0f),
                         specular * MIN(r * r * tint.z, 1.0f));
    // What the layer lets through is colourless, so that no channel of the whole is above 1.
    float dielectric_f0 = largest(layer_f0);
#else
    float dielectric_f0 = specular * r * r;
    Vec3 layer_f0 = vec3(dielectric_f0, dielectric_f0, dielectric_f0);
#endif
    s.base = scale(1.0f - metallic, color);
    s.alpha = MAX(m->roughness * m->roughness, MIN_ALPHA);
#if HAS_TRAIT(ANISOTROPY)
    s.alpha_x = LERP(s.alpha, 1.0f, m->anisotropy * m->anisotropy);
#endif
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    s.transmitted = scale((1.0f - metallic) * m->diffuse_transmission, m->diffuse_transmission_color);
    s.base = scale(1.0f - m->diffuse_transmission, s.base);
#endif
#if defined(TEXTURED_LAYER)
    set_layer(&s, m, tables, dielectric_f0, multiple);
#elif !defined(MATTE)
    s.base = add(s.base, scale(multiple, vec3_at(tables.layer + ALBEDO_TABLE_SIZE + 1u)));
#endif
    s.f0 = vec3(LERP(layer_f0.x, color.x, metallic), LERP(layer_f0.y, color.y, metallic),
                LERP(layer_f0.z, color.z, metallic));
    float f90 = LERP(specular, 1.0f, metallic);
    s.f90 = vec3(f90, f90, f90);
    s.metallic = metallic;
#if HAS_TRAIT(IRIDESCENCE)
    s.iridescence = m->iridescence;
    s.film_weight = f90;
    s.film.f0 = scale(1.0f / MAX(f90, 1e-6f), s.f0);
    s.film.ior = m->iridescence_ior;
    s.film.thickness = m->iridescence_thickness;
#endif
#ifndef TEXTURED_LAYER
    s.layer = tables.layer;
#endif
    return s;
}

// Schlick's reflectance at this cosine to the normal of the microfacet.
INLINE Vec3 schlick_reflectance(const OpaqueBsdf *s, float cosine) {
    float c = 1.0f - CLAMP(cosine, 0.0f, 1.0f);
    float schlick = c * c * c * c * c;
    return add(s->f0, scale(schlick, subtract(s->f90, s->f0)));
}

// E(w), the same on both sides.
INLINE float layer_albedo(const OpaqueBsdf *s, Vec3 w) {
#if HAS_TRAIT(ANISOTROPY)
    float root = SQRT(MIN(FABS(w.z), 1.0f)) * (float)(STRETCHED_COSINES - 1u);
    uint column = MIN((uint)root, STRETCHED_COSINES - 2u);
    float share = root - (float)column, x2 = w.x * w.x;
    float along = x2 / MAX(x2 + w.y * w.y, 1e-20f);
    float all = LERP(stretched_albedo(s->stretched, 6u * column, along, 0u),
                     stretched_albedo(s->stretched, 6u * column + 6u, along, 0u), share);
    float grazing = LERP(stretched_albedo(s->stretched, 6u * column, along, 1u),
                         stretched_albedo(s->stretched, 6u * column + 6u, along, 1u), share);
    float albedo = s->share_a * all + s->share_b * grazing;
#elif defined(TEXTURED_LAYER)
    float albedo = s->share_a * albedo_at(s->rows, 0u, FABS(w.z)) +
                   s->share_b * albedo_at(s->rows, ALBEDO_TABLE_SIZE, FABS(w.z));
#else
    float place = MIN(FABS(w.z), 1.0f) * (float)(ALBEDO_TABLE_SIZE - 1u);
    uint cell = MIN((uint)place, ALBEDO_TABLE_SIZE - 2u);
    float albedo = LERP(s->layer[cell], s->layer[cell + 1u], place - (float)cell);
#endif
#if HAS_TRAIT(IRIDESCENCE)
    float cosine = FABS(w.z);
    Vec3 of_film = scale(s->film_weight, film_reflectance(&s->film, cosine));
    float more = largest(subtract(of_film, schlick_reflectance(s, cosine)));
    albedo += s->iridescence * (1.0f - s->metallic) * MAX(more, 0.0f);
    albedo = MIN(albedo, 1.0f);
#endif
    return albedo;
}

// 1 / (1 - E_avg)
INLINE float inverse_mean_loss(const OpaqueBsdf *s) {
#ifdef TEXTURED_LAYER
    return s->through;
#else
    return s->layer[ALBEDO_TABLE_SIZE];
#endif
}

// Luminance of what is diffuse, before the layer takes its share.
INLINE float diffuse_luminance(const OpaqueBsdf *s) {
    float diffuse = luminance(s->base);
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    diffuse += luminance(s->transmitted);
#endif
    return diffuse;
}

// Chance of sampling the specular part: its share of the albedo for wo, kept away from 0 and 1 where both
// parts exist, so that neither is starved where the estimate is off. Of metal it is known.
INLINE float specular_probability(const OpaqueBsdf *s, float layer_wo) {
    float specular = layer_wo * LERP(1.0f, MAX(luminance(s->f0), 0.0f), s->metallic);
    float diffuse = diffuse_luminance(s) * (1.0f - layer_wo);
    float share = specular / MAX(specular + diffuse, 1e-12f);
    int both = (specular > 0.0f) & (diffuse > 0.0f);
    return both ? CLAMP(share, 0.1f, LERP(0.9f, 1.0f, s->metallic)) : (diffuse > 0.0f ? 0.0f : 1.0f);
}

#ifdef MATTE
INLINE BsdfValue eval_base(const OpaqueBsdf *s, Vec3 wo, Vec3 wi) {
    int above = (wo.z > 0.0f) & (wi.z > 0.0f);
    float cosine = above ? wi.z : 0.0f;
    BsdfValue result;
    result.f_cos = scale(cosine * INV_PI, s->base);
    result.pdf = cosine * INV_PI;
    return result;
}

INLINE BsdfSample sample_base(const OpaqueBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
    BsdfSample result;
    result.wi = sample_cosine_hemisphere(direction.u, direction.v);
    result.pdf = wo.z > 0.0f ? result.wi.z * INV_PI : 0.0f;
    result.weight = select(result.pdf > 0.0f, s->base, vec3(0.0f, 0.0f, 0.0f));
    return result;
}
#else
// GGX with a roughness for each axis: its distribution, and the root in Smith's masking, (1 + 2 Lambda) cos.
INLINE float stretched_distribution(float alpha_x, float alpha_y, Vec3 h) {
    float x = h.x / alpha_x, y = h.y / alpha_y;
    float slope = x * x + y * y + h.z * h.z;
    return 1.0f / (PI * alpha_x * alpha_y * slope * slope);
}
INLINE float stretched_root(float alpha_x, float alpha_y, Vec3 w) {
    float x = alpha_x * w.x, y = alpha_y * w.y;
    return SQRT(x * x + y * y + w.z * w.z);
}

INLINE BsdfValue eval_base(const OpaqueBsdf *s, Vec3 wo, Vec3 wi) {
    Vec3 h = normalize(add(wo, wi));
#if HAS_TRAIT(ANISOTROPY)
    float d = stretched_distribution(s->alpha_x, s->alpha, h);
    float root_o = stretched_root(s->alpha_x, s->alpha, wo);
    float root_i = stretched_root(s->alpha_x, s->alpha, wi);
#else
    float a2 = s->alpha * s->alpha;
    float slope = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    float d = 1.0f / (PI * a2 * slope * slope);
    float root_o = SQRT(a2 + (1.0f - a2) * wo.z * wo.z);
    float root_i = SQRT(a2 + (1.0f - a2) * wi.z * wi.z);
#endif
    float v_cos = 0.5f * wi.z / (wi.z * root_o + wo.z * root_i);
    Vec3 fresnel = schlick_reflectance(s, dot(wo, h));
#if HAS_TRAIT(IRIDESCENCE)
    Vec3 of_film = scale(s->film_weight, film_reflectance(&s->film, dot(wo, h)));
    fresnel = add(fresnel, scale(s->iridescence, subtract(of_film, fresnel)));
#endif

    float layer_wo = layer_albedo(s, wo);
    float through = (1.0f - layer_wo) * (1.0f - layer_albedo(s, wi)) * inverse_mean_loss(s);
    float p = specular_probability(s, layer_wo);

    int above = (wo.z > 0.0f) & (wi.z > 0.0f);
    BsdfValue result;
    result.f_cos = add(scale(d * v_cos, fresnel), scale(through * wi.z * INV_PI, s->base));
    result.f_cos = select(above, result.f_cos, vec3(0.0f, 0.0f, 0.0f));
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    float passing = luminance(s->transmitted) / MAX(diffuse_luminance(s), 1e-12f);
    int below = (wo.z > 0.0f) & (wi.z < 0.0f);
    float diffuse_pdf = (1.0f - p) * FABS(wi.z) * INV_PI;
    result.f_cos = select(below, scale(through * -wi.z * INV_PI, s->transmitted), result.f_cos);
    float pdf = p * 0.5f * d / (wo.z + root_o) + (1.0f - passing) * diffuse_pdf;
    result.pdf = above ? pdf : (below ? passing * diffuse_pdf : 0.0f);
#else
    float pdf = p * 0.5f * d / (wo.z + root_o) + (1.0f - p) * wi.z * INV_PI;
    result.pdf = above ? pdf : 0.0f;
#endif
    return result;
}

// A reflection that a microfacet sends below the surface is lost: it must not pass for light that goes
// through.
INLINE Vec3 reflected_above(Vec3 wi) {
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    wi = select(wi.z > 0.0f, wi, vec3(1.0f, 0.0f, 0.0f));
#endif
    return wi;
}

// A direction that the base chooses; `lobe` says by which of its parts.
INLINE Vec3 sample_base_direction(const OpaqueBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
    float p = specular_probability(s, layer_albedo(s, wo));
#if HAS_TRAIT(ANISOTROPY)
    Vec3 h = sample_stretched_normal(wo, s->alpha_x, s->alpha, direction.u, direction.v);
#else
    Vec3 h = sample_visible_normal(wo, s->alpha, direction.u, direction.v);
#endif
    Vec3 reflected = subtract(scale(2.0f * dot(wo, h), h), wo);
    Vec3 diffuse = sample_cosine_hemisphere(direction.u, direction.v);
#if HAS_TRAIT(DIFFUSE_TRANSMISSION)
    float passing = luminance(s->transmitted) / MAX(diffuse_luminance(s), 1e-12f);
    diffuse.z = lobe - p < passing * (1.0f - p) ? -diffuse.z : diffuse.z;
#endif
    return select(lobe < p, reflected_above(reflected), diffuse);
}

// The sample of a direction that was chosen with the density of its value.
INLINE BsdfSample sample_of(BsdfValue value, Vec3 wi) {
    int valid = value.pdf > 0.0f;
    BsdfSample result;
    result.wi = wi;
    result.pdf = value.pdf;
    result.weight =
        select(valid, scale(1.0f / (valid ? value.pdf : 1.0f), value.f_cos), vec3(0.0f, 0.0f, 0.0f));
    return result;
}

INLINE BsdfSample sample_base(const OpaqueBsdf *s, Vec3 wo, Uniform2 direction, float lobe) {
    Vec3 wi = sample_base_direction(s, wo, direction, lobe);
    return sample_of(eval_base(s, wo, wi), wi);
}
#endif
