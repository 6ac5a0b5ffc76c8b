#include "path/state.cl"
#include "base/attributes.cl"
#include "shading/material.cl"

// The material at a point of a surface: its numbers times what its textures and the colours at corners say.
// What no material of the scene has is not asked for.

// Numbers from 0 to 1.
INLINE Vec3 shares(Vec3 c) {
    return vec3(CLAMP(c.x, 0.0f, 1.0f), CLAMP(c.y, 0.0f, 1.0f), CLAMP(c.z, 0.0f, 1.0f));
}

INLINE SurfaceMaterial surface_material(const Shading *shading, const Surface *surface) {
    __global const Material *material = &shading->materials[surface->material];
    SurfaceMaterial m = plain_material(material);
#ifdef CORNER_ATTRIBUTES
    Vec3 weight = vec3(1.0f - surface->weight_b - surface->weight_c, surface->weight_b, surface->weight_c);
#endif
#ifdef VERTEX_COLORS
    m.base_color = mul(m.base_color, vertex_color_at(shading, surface->object, surface->face, weight).color);
#endif
#if TEXTURES
    Uvs uvs = uvs_at(shading, surface->object, surface->face, weight);
    __global const uint *textures = material->textures;
#endif
#if TEXTURED(BASE_COLOR)
    m.base_color = mul(m.base_color, sample_texture(shading, textures[SLOT_OF_BASE_COLOR], &uvs).color);
#endif
#if TEXTURED(METALLIC_ROUGHNESS)
    Vec3 rough = sample_texture(shading, textures[SLOT_OF_METALLIC_ROUGHNESS], &uvs).color;
    m.roughness *= rough.y;
    m.metallic *= rough.z;
#endif
#if TEXTURED(EMISSION)
    m.emission = mul(m.emission, bright_texel(shading, textures[SLOT_OF_EMISSION], &uvs));
#endif
#if TEXTURED(TRANSMISSION)
    m.transmission *= sample_texture(shading, textures[SLOT_OF_TRANSMISSION], &uvs).color.x;
#endif
#if TEXTURED(SPECULAR)
    m.specular *= sample_texture(shading, textures[SLOT_OF_SPECULAR], &uvs).alpha;
#endif
#if TEXTURED(SPECULAR_COLOR)
    m.specular_color = mul(m.specular_color, bright_texel(shading, textures[SLOT_OF_SPECULAR_COLOR], &uvs));
#endif
#if TEXTURED(CLEARCOAT)
    m.clearcoat *= sample_texture(shading, textures[SLOT_OF_CLEARCOAT], &uvs).color.x;
#endif
#if TEXTURED(CLEARCOAT_ROUGHNESS)
    m.clearcoat_roughness *= sample_texture(shading, textures[SLOT_OF_CLEARCOAT_ROUGHNESS], &uvs).color.y;
#endif
#if TEXTURED(SHEEN_COLOR)
    m.sheen_color = mul(m.sheen_color, sample_texture(shading, textures[SLOT_OF_SHEEN_COLOR], &uvs).color);
#endif
#if TEXTURED(SHEEN_ROUGHNESS)
    m.sheen_roughness *= sample_texture(shading, textures[SLOT_OF_SHEEN_ROUGHNESS], &uvs).alpha;
#endif
#if TEXTURED(ANISOTROPY)
    m.anisotropy *= sample_texture(shading, textures[SLOT_OF_ANISOTROPY], &uvs).color.z;
#endif
#if TEXTURED(IRIDESCENCE)
    m.iridescence *= sample_texture(shading, textures[SLOT_OF_IRIDESCENCE], &uvs).color.x;
#endif
#if TEXTURED(IRIDESCENCE_THICKNESS)
    uint film = textures[SLOT_OF_IRIDESCENCE_THICKNESS];
    float thick = CLAMP(sample_texture(shading, film, &uvs).color.y, 0.0f, 1.0f);
    m.iridescence_thickness = LERP(material->iridescence_least_thickness, m.iridescence_thickness, thick);
#endif
#if TEXTURED(DIFFUSE_TRANSMISSION)
    m.diffuse_transmission *= sample_texture(shading, textures[SLOT_OF_DIFFUSE_TRANSMISSION], &uvs).alpha;
#endif
#if TEXTURED(DIFFUSE_TRANSMISSION_COLOR)
    uint passed = textures[SLOT_OF_DIFFUSE_TRANSMISSION_COLOR];
    m.diffuse_transmission_color =
        mul(m.diffuse_transmission_color, sample_texture(shading, passed, &uvs).color);
#endif
#if TEXTURES &                                                                                               \
    ~(1u << SLOT_OF_NORMAL | 1u << SLOT_OF_EMISSION | 1u << SLOT_OF_CLEARCOAT_NORMAL | 1u << SLOT_OF_BUMP)
    // Images of floats may hold anything.
    m.base_color = shares(m.base_color);
    m.roughness = CLAMP(m.roughness, 0.0f, 1.0f);
    m.metallic = CLAMP(m.metallic, 0.0f, 1.0f);
    m.transmission = CLAMP(m.transmission, 0.0f, 1.0f);
    m.specular = CLAMP(m.specular, 0.0f, 1.0f);
    m.clearcoat = CLAMP(m.clearcoat, 0.0f, 1.0f);
    m.clearcoat_roughness = CLAMP(m.clearcoat_roughness, 0.0f, 1.0f);
    m.sheen_color = shares(m.sheen_color);
    m.sheen_roughness = CLAMP(m.sheen_roughness, 0.0f, 1.0f);
    m.anisotropy = CLAMP(m.anisotropy, 0.0f, 1.0f);
    m.iridescence = CLAMP(m.iridescence, 0.0f, 1.0f);
    m.diffuse_transmission = CLAMP(m.diffuse_transmission, 0.0f, 1.0f);
    m.diffuse_transmission_color = shares(m.diffuse_transmission_color);
#endif
#if HAS_TRAIT(UNLIT)
    // It shines as it is, and does nothing else.
    int unlit = (material->flags & MATERIAL_UNLIT) != 0u;
    Vec3 nothing = vec3(0.0f, 0.0f, 0.0f);
    m.emission = select(unlit, m.base_color, m.emission);
    m.base_color = select(unlit, nothing, m.base_color);
    m.metallic = unlit ? 0.0f : m.metallic;
    m.specular = unlit ? 0.0f : m.specular;
    m.clearcoat = unlit ? 0.0f : m.clearcoat;
    m.sheen_color = select(unlit, nothing, m.sheen_color);
    m.iridescence = unlit ? 0.0f : m.iridescence;
    m.diffuse_transmission = unlit ? 0.0f : m.diffuse_transmission;
#endif
    return m;
}

// The base colour for auxiliary images: also of what shines with it.
INLINE Vec3 seen_color(const Shading *shading, const Surface *surface) {
    SurfaceMaterial m = surface_material(shading, surface);
#if HAS_TRAIT(UNLIT)
    int unlit = (shading->materials[surface->material].flags & MATERIAL_UNLIT) != 0u;
    return select(unlit, m.emission, m.base_color);
#else
    return m.base_color;
#endif
}
