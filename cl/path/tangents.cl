#include "path/surface_material.cl"

// What directions along a surface are for: normal maps, and reflections that are stretched. A surface whose
// material has a normal map gets the normal that the map tells in the frame of the tangent, the way up in the
// image, and the interpolated normal; a height map adds its slope. Tangents are those of MikkTSpace, which
// interpolates them as they are and keeps them as long as they then are. A clearcoat has its own map, or the
// interpolated normal.

#ifdef TANGENTS
// A direction along a surface, from object space to world space: along with what lies on the surface.
INLINE Vec3 world_tangent(__global const Object *object, Vec3 t) {
    __global const float *m = object->world_from_object;
    return vec3(m[0] * t.x + m[1] * t.y + m[2] * t.z, m[4] * t.x + m[5] * t.y + m[6] * t.z,
                m[8] * t.x + m[9] * t.y + m[10] * t.z);
}

// Along a surface and across its normal. `exists`: the mesh has tangents, and this one a length.
typedef struct {
    Vec3 tangent, up;
    int exists;
} TangentFrame;

INLINE TangentFrame tangent_frame(__global const Object *objects, const Shading *shading,
                                  const Surface *surface, Vec3 weight) {
    __global const Attributes *attributes = shading->attributes + surface->object;
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
    TangentFrame frame;
    frame.tangent = scale(1.0f / SQRT(MAX(length2, 1e-30f)), tangent);
    frame.up = scale(values[3] * objects[surface->object].winding, cross(normal, frame.tangent));
    frame.exists = (has != 0u) & (length2 > 1e-30f);
    return frame;
}

// The normal that a map tells.
INLINE Vec3 mapped_normal(const Shading *shading, uint number, float amount, const Uvs *uvs,
                          const TangentFrame *frame, Vec3 normal) {
    Vec3 texel = sample_texture(shading, number, uvs).color;
    float x = amount * (2.0f * texel.x - 1.0f), y = amount * (2.0f * texel.y - 1.0f);
    float z = MAX(2.0f * texel.z - 1.0f, 1e-3f);
    Vec3 mapped = add(scale(x, frame->tangent), add(scale(y, frame->up), scale(z, normal)));
    return select((number != 0u) & frame->exists, normalize(mapped), normal);
}

#if TEXTURED(BUMP)
// No slope of a height map is steeper.
#define STEEPEST_BUMP 1e6f

// How the heights of a map grow along the surface, in world space (M. Mikkelsen, Surface Gradient-Based Bump
// Mapping Framework, JCGT 9(3), 2020). Gradients go to world space as normals do.
INLINE Vec3 height_gradient(__global const Object *objects, const Shading *shading, const Surface *surface,
                            uint number, float metres, const Uvs *uvs, Vec3 normal) {
    __global const Attributes *attributes = shading->attributes + surface->object;
    uint has = attributes->has_gradient;
    __global const float *g =
        shading->gradients + attributes->first_gradient + 6u * (size_t)(has * surface->face);
    TextureSlope slope = texture_slope(shading, number, uvs);
    float u = metres * slope.u, v = metres * slope.v;
    Vec3 grown = vec3(u * g[0] + v * g[3], u * g[1] + v * g[4], u * g[2] + v * g[5]);
    __global const float *m = objects[surface->object].object_from_world;
    Vec3 gradient = vec3(m[0] * grown.x + m[4] * grown.y + m[8] * grown.z,
                         m[1] * grown.x + m[5] * grown.y + m[9] * grown.z,
                         m[2] * grown.x + m[6] * grown.y + m[10] * grown.z);
    gradient = subtract(gradient, scale(dot(gradient, normal), normal));
    gradient.x = CLAMP(gradient.x, -STEEPEST_BUMP, STEEPEST_BUMP);
    gradient.y = CLAMP(gradient.y, -STEEPEST_BUMP, STEEPEST_BUMP);
    gradient.z = CLAMP(gradient.z, -STEEPEST_BUMP, STEEPEST_BUMP);
    return select((number != 0u) & (has != 0u), gradient, vec3(0.0f, 0.0f, 0.0f));
}

// A normal with the slope of a height map beside its own, over the surface with the normal `smooth`.
INLINE Vec3 bumped_normal(Vec3 normal, Vec3 smooth, Vec3 gradient) {
    float upright = MAX(dot(normal, smooth), 1e-3f);
    Vec3 bumped = normalize(subtract(scale(1.0f / upright, normal), gradient));
    return select(dot(gradient, gradient) > 0.0f, bumped, normal);
}
#endif

#if HAS_TRAIT(ANISOTROPY)
// The angle, in turns, from the tangent of `frame_of` to the direction along which reflections are stretched.
INLINE float stretched_turns(const Shading *shading, __global const Material *material, const Uvs *uvs,
                             const TangentFrame *tangents, Vec3 shading_normal) {
    float turns = material->anisotropy_rotation * (1.0f / 360.0f);
#if TEXTURED(ANISOTROPY)
    uint number = material->textures[SLOT_OF_ANISOTROPY];
    Vec3 texel = sample_texture(shading, number, uvs).color;
    float mapped = atan2_turns(2.0f * texel.y - 1.0f, 2.0f * texel.x - 1.0f);
    turns += number != 0u ? mapped : 0.0f;
#endif
    float sine, cosine;
    sincos_turns(turns - FLOOR(turns), &sine, &cosine);
    Vec3 along = add(scale(cosine, tangents->tangent), scale(sine, tangents->up));
    Frame frame = frame_of(shading_normal);
    float found = atan2_turns(dot(along, frame.bitangent), dot(along, frame.tangent));
    // What is read in place of tangents that are not there may be anything.
    return tangents->exists ? found : 0.0f;
}
#endif

// Sets up what a surface has beside what its hit tells.
INLINE void set_tangents(__global const Object *objects, const Shading *shading, Surface *surface) {
    __global const Material *material = &shading->materials[surface->material];
    Vec3 weight = vec3(1.0f - surface->weight_b - surface->weight_c, surface->weight_b, surface->weight_c);
    TangentFrame frame = tangent_frame(objects, shading, surface, weight);
#if TEXTURES
    Uvs uvs = uvs_at(shading, surface->object, surface->face, weight);
#else
    Uvs uvs = {0.0f, 0.0f, 0.0f, 0.0f};
#endif
    Vec3 smooth = surface->shading;
    __global const uint *textures = material->textures;
#if TEXTURED(NORMAL)
    surface->shading =
        mapped_normal(shading, textures[SLOT_OF_NORMAL], material->normal_scale, &uvs, &frame, smooth);
#endif
#if TEXTURED(BUMP)
    Vec3 gradient = height_gradient(objects, shading, surface, textures[SLOT_OF_BUMP], material->bump_scale,
                                    &uvs, smooth);
    surface->shading = bumped_normal(surface->shading, smooth, gradient);
#endif
#ifdef COAT_NORMALS
    surface->coat = smooth;
#if TEXTURED(CLEARCOAT_NORMAL)
    surface->coat = mapped_normal(shading, textures[SLOT_OF_CLEARCOAT_NORMAL],
                                  material->clearcoat_normal_scale, &uvs, &frame, smooth);
#endif
#endif
#if HAS_TRAIT(ANISOTROPY)
    surface->turn = stretched_turns(shading, material, &uvs, &frame, surface->shading);
#endif
}
#endif
