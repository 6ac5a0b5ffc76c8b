#include "base/texture.cl"

// What meshes have at the corners of their faces, at a point of one: texture coordinates, colours, tangents.
// The weights of the corners add up to 1. What a mesh does not have is read from any place, and not used.

// Whether a scene needs any of it.
#if TEXTURES || defined(VERTEX_COLORS) || HAS_TRAIT(ANISOTROPY)
#define CORNER_ATTRIBUTES
#endif

INLINE float at_corners(__global const float *values, uint stride, Vec3 weight) {
    return weight.x * values[0] + weight.y * values[stride] + weight.z * values[2u * stride];
}

INLINE Uvs uvs_at(const Shading *shading, uint object, uint face, Vec3 weight) {
    __global const Attributes *attributes = shading->attributes + object;
    uint has_first = attributes->has_uv[0], has_second = attributes->has_uv[1];
    __global const float *first = shading->uvs + attributes->first_uv[0] + 6u * (size_t)(has_first * face);
    __global const float *second = shading->uvs + attributes->first_uv[1] + 6u * (size_t)(has_second * face);
    Uvs uvs;
    uvs.u0 = has_first ? at_corners(first, 2u, weight) : 0.0f;
    uvs.v0 = has_first ? at_corners(first + 1, 2u, weight) : 0.0f;
    uvs.u1 = has_second ? at_corners(second, 2u, weight) : 0.0f;
    uvs.v1 = has_second ? at_corners(second + 1, 2u, weight) : 0.0f;
    return uvs;
}

// The colour that base colours are multiplied with.
INLINE Texel vertex_color_at(const Shading *shading, uint object, uint face, Vec3 weight) {
    __global const Attributes *attributes = shading->attributes + object;
    uint has = attributes->has_color;
    __global const float *values = shading->colors + attributes->first_color + 12u * (size_t)(has * face);
    Texel color;
    color.color.x = has ? at_corners(values, 4u, weight) : 1.0f;
    color.color.y = has ? at_corners(values + 1, 4u, weight) : 1.0f;
    color.color.z = has ? at_corners(values + 2, 4u, weight) : 1.0f;
    color.alpha = has ? at_corners(values + 3, 4u, weight) : 1.0f;
    return color;
}
