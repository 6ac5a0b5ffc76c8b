#include "path/state.cl"
#include "base/attributes.cl"
#include "shading/material.cl"

// The material at a point of a surface: its numbers times what its textures and the colours at corners say.
// What no material of the scene has is not asked for.

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
    m.emission = mul(m.emission, emission_texel(shading, textures[SLOT_OF_EMISSION], &uvs));
#endif
#if TEXTURED(TRANSMISSION)
    m.transmission *= sample_texture(shading, textures[SLOT_OF_TRANSMISSION], &uvs).color.x;
#endif
#if TEXTURED(SPECULAR)
    m.specular *= sample_texture(shading, textures[SLOT_OF_SPECULAR], &uvs).alpha;
#endif
#if TEXTURED(BASE_COLOR) || TEXTURED(METALLIC_ROUGHNESS) || TEXTURED(TRANSMISSION) || TEXTURED(SPECULAR)
    // Images of floats may hold anything.
    m.base_color = vec3(CLAMP(m.base_color.x, 0.0f, 1.0f), CLAMP(m.base_color.y, 0.0f, 1.0f),
                        CLAMP(m.base_color.z, 0.0f, 1.0f));
    m.roughness = CLAMP(m.roughness, 0.0f, 1.0f);
    m.metallic = CLAMP(m.metallic, 0.0f, 1.0f);
    m.transmission = CLAMP(m.transmission, 0.0f, 1.0f);
    m.specular = CLAMP(m.specular, 0.0f, 1.0f);
#endif
    return m;
}
