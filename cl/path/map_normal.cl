#include "path/surface_material.cl"

// Normal maps. A surface whose material has one gets the normal that the map tells in the frame of the
// tangent, the way up in the image, and the interpolated normal. Tangents are those of MikkTSpace, which
// interpolates them as they are and keeps them as long as they then are.

#if TEXTURED(NORMAL)
// A direction along a surface, from object space to world space: along with what lies on the surface.
INLINE Vec3 world_tangent(__global const Object *object, Vec3 t) {
    __global const float *m = object->world_from_object;
    return vec3(m[0] * t.x + m[1] * t.y + m[2] * t.z, m[4] * t.x + m[5] * t.y + m[6] * t.z,
                m[8] * t.x + m[9] * t.y + m[10] * t.z);
}

INLINE void map_normal(__global const Object *objects, const Shading *shading, Surface *surface) {
    __global const Material *material = &shading->materials[surface->material];
    __global const Attributes *attributes = shading->attributes + surface->object;
    Vec3 weight = vec3(1.0f - surface->weight_b - surface->weight_c, surface->weight_b, surface->weight_c);
    Uvs uvs = uvs_at(shading, surface->object, surface->face, weight);
    uint number = material->textures[SLOT_OF_NORMAL];
    Vec3 texel = sample_texture(shading, number, &uvs).color;
    uint has = attributes->has_tangent;
    __global const float *values =
        shading->tangents + attributes->first_tangent + 12u * (size_t)(has * surface->face);
    Vec3 tangent = vec3(at_corners(values, 4u, weight), at_corners(values + 1, 4u, weight),
                        at_corners(values + 2, 4u, weight));
    tangent = world_tangent(objects + surface->object, tangent);
    Vec3 normal = surface->shading;
    // Across: the scale of the object may have bent the tangent out of the surface.
    tangent = subtract(tangent, scale(dot(tangent, normal), normal));
    float length2 = dot(tangent, tangent);
    tangent = scale(1.0f / SQRT(MAX(length2, 1e-30f)), tangent);
    float side = values[3] * objects[surface->object].winding;
    Vec3 up = scale(side, cross(normal, tangent));
    float amount = material->normal_scale;
    float x = amount * (2.0f * texel.x - 1.0f), y = amount * (2.0f * texel.y - 1.0f);
    float z = MAX(2.0f * texel.z - 1.0f, 1e-3f);
    Vec3 mapped = add(scale(x, tangent), add(scale(y, up), scale(z, normal)));
    int usable = (number != 0u) & (has != 0u) & (length2 > 1e-30f);
    surface->shading = select(usable, normalize(mapped), normal);
}
#endif
