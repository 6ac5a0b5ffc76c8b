#include "accel/bvh.cl"
#include "path/state.cl"

// Turns the hit that traversal has found into a surface: position, normals, material, rounding bound. This is
// straight-line code of scalars, so that PoCL runs it in SIMD lanes.

// The variants TOP_LEVEL_ONLY and FLAT leave out what a scene does not need: the way from object space, and
// the normals of meshes.

// A vector of unit length, and the reciprocal of the length that it had before.
typedef struct {
    Vec3 direction;
    float inverse_length;
} Normal;

// The unit vector along v, which is scaled before it is squared, because squares of very small or large
// components would leave the range of a float.
INLINE Normal normal_along(Vec3 v) {
    float factor = bvh_scale(bvh_largest(v));
    Vec3 scaled = scale(factor, v);
    float inverse = 1.0f / SQRT(dot(scaled, scaled));
    Normal normal;
    normal.direction = scale(inverse, scaled);
    normal.inverse_length = inverse * factor;
    return normal;
}

// A normal of object space in world space: by the inverse transpose, which keeps the outside outside, also
// where the object is mirrored. For a normal of unit length the reciprocal length says how far two planes
// are apart in world space that are a metre apart in object space.
INLINE Normal world_normal(__global const Object *object, Vec3 normal) {
    __global const float *m = object->object_from_world;
    Vec3 v = vec3(m[0] * normal.x + m[4] * normal.y + m[8] * normal.z,
                  m[1] * normal.x + m[5] * normal.y + m[9] * normal.z,
                  m[2] * normal.x + m[6] * normal.y + m[10] * normal.z);
    return normal_along(v);
}

INLINE Vec3 world_point(__global const Object *object, Vec3 p) {
    __global const float *m = object->world_from_object;
    return vec3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}

INLINE Vec3 absolute(Vec3 v) { return vec3(FABS(v.x), FABS(v.y), FABS(v.z)); }

// What a matrix makes at most of a point whose coordinates are at most p.
INLINE Vec3 largest_image(__global const float *m, Vec3 p) {
    return vec3(FABS(m[0]) * p.x + FABS(m[1]) * p.y + FABS(m[2]) * p.z + FABS(m[3]),
                FABS(m[4]) * p.x + FABS(m[5]) * p.y + FABS(m[6]) * p.z + FABS(m[7]),
                FABS(m[8]) * p.x + FABS(m[9]) * p.y + FABS(m[10]) * p.z + FABS(m[11]));
}

// A corner of the triangle in a lane of a pack.
INLINE Vec3 pack_vertex(__global const TrianglePack *pack, uint corner, uint lane) {
    return vec3(pack->vertex[3 * corner][lane], pack->vertex[3 * corner + 1][lane],
                pack->vertex[3 * corner + 2][lane]);
}

// Rounding errors of a hit in units of half an ulp: for the largest coordinates and the extent of its
// triangle, and for the way of its position to world space and back (J. Wächter and N. Binder, A Fast and
// Robust Method for Avoiding Self-Intersection, Ray Tracing Gems, 2019; pbrt-v4, section 6.8). They contain
// the interpolation of the position; the next ray's origin; the question on which side of the triangle that
// lies; and how far the corners of a parallelogram or a parallelepiped are off its planes
// (accel/clusters.py). All are taken axis by axis, so that a surface in a plane of the axes has the error of
// that one coordinate, however large it is.
#define HALF_ULP 0x1p-24f
#define COORDINATE_ULPS 8.0f
#define EXTENT_ULPS 16.0f
#define TRANSFORM_ULPS 10.0f
// And of the normal, which matters for thin triangles.
#define NORMAL_ULPS 18.0f
// Of the distance at which the next ray would meet the triangle again. Traversal knows better (see
// bvh_starts_before), but takes longer to find out, so that rays keep off by that too where it is little
// compared with the way that they have come.
#define DISTANCE_ULPS 8.0f
#define DISTANCE_SHARE 0x1p-22f

// The interpolated normal, turned to the side of the geometric one. Where the face is flat, or where the
// normals of its corners cancel out, it is the geometric normal itself.
INLINE Vec3 shading_normal(__global const Object *object, __global const float *normals, uint face,
                           Vec3 weight, Vec3 geometric) {
    int smooth = object->is_smooth != 0u;
    // Of a flat mesh, any normal is read, and not used.
    __global const float *n = normals + object->first_normal + 9u * (size_t)object->is_smooth * face;
    Vec3 interpolated = vec3(weight.x * n[0] + weight.y * n[3] + weight.z * n[6],
                             weight.x * n[1] + weight.y * n[4] + weight.z * n[7],
                             weight.x * n[2] + weight.y * n[5] + weight.z * n[8]);
    smooth &= FABS(interpolated.x) + FABS(interpolated.y) + FABS(interpolated.z) >= 1e-6f;
    Vec3 shading = world_normal(object, select(smooth, interpolated, vec3(0.0f, 0.0f, 1.0f))).direction;
    shading = select(dot(shading, geometric) < 0.0f, scale(-1.0f, shading), shading);
    return select(smooth, shading, geometric);
}

#ifndef FLAT
// Where a corner's normal is farther off that of the face, an edge was smoothed over, and no curve is meant.
#define LEAST_SMOOTH_COSINE 0.75f

// How far the surface that the normals at corners pretend stands above a point of a face: half of what the
// planes do that are perpendicular to them there, interpolated. That is a ball's own surface if they are the
// ball's, and the same for both faces at an edge. Below 0 where it is hollow. Everything is in object space;
// `ab` and `ac` are the edges from the first corner, and `up` is the unit normal of the face.
INLINE float pretended_height(__global const Object *object, __global const float *normals, uint face,
                              Vec3 weight, Vec3 ab, Vec3 ac, Vec3 up) {
    __global const float *n = normals + object->first_normal + 9u * (size_t)object->is_smooth * face;
    Vec3 a = vec3(n[0], n[1], n[2]), b = vec3(n[3], n[4], n[5]), c = vec3(n[6], n[7], n[8]);
    Vec3 to_a = scale(-1.0f, add(scale(weight.y, ab), scale(weight.z, ac)));
    Vec3 cosine = vec3(dot(a, up), dot(b, up), dot(c, up));
    float height = weight.x * dot(to_a, a) / cosine.x + weight.y * dot(add(to_a, ab), b) / cosine.y +
                   weight.z * dot(add(to_a, ac), c) / cosine.z;
    int all_up = MIN(cosine.x, MIN(cosine.y, cosine.z)) > LEAST_SMOOTH_COSINE;
    int all_down = MAX(cosine.x, MAX(cosine.y, cosine.z)) < -LEAST_SMOOTH_COSINE;
    return (object->is_smooth != 0u) & (all_up | all_down) ? 0.5f * height : 0.0f;
}

// A vector of world space in object space.
INLINE Vec3 object_vector(__global const Object *object, Vec3 v) {
    __global const float *m = object->object_from_world;
    return vec3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
                m[8] * v.x + m[9] * v.y + m[10] * v.z);
}

// As world_normal, the other way.
INLINE Normal object_normal(__global const Object *object, Vec3 normal) {
    __global const float *m = object->world_from_object;
    return normal_along(vec3(m[0] * normal.x + m[4] * normal.y + m[8] * normal.z,
                             m[1] * normal.x + m[5] * normal.y + m[9] * normal.z,
                             m[2] * normal.x + m[6] * normal.y + m[10] * normal.z));
}

// The same of a triangle in world space, in world space.
INLINE float pretended_world_height(__global const Object *object, __global const float *normals, uint face,
                                    Vec3 weight, Vec3 ab, Vec3 ac, Vec3 up) {
    Normal normal = object_normal(object, up);
    return pretended_height(object, normals, face, weight, object_vector(object, ab),
                            object_vector(object, ac), normal.direction) /
           normal.inverse_length;
}
#endif

// The surface of a hit. The weights of the corners may have a common factor.
INLINE Surface surface_at(const Geometry *geometry, const RawHit *hit) {
    __global const Object *object = geometry->objects + hit->object;
#ifdef TOP_LEVEL_ONLY
    __global const TrianglePack *packs = geometry->top_packs;
#else
    int on_top = FIELD(hit->triangle, PLACE_ON_TOP) != 0u;
    __global const TrianglePack *packs = on_top ? geometry->top_packs : geometry->packs;
#endif
    __global const TrianglePack *pack = packs + FIELD(hit->triangle, PLACE_PACK);
    uint lane = FIELD(hit->triangle, PLACE_LANE);
    Vec3 a = pack_vertex(pack, 0, lane), b = pack_vertex(pack, 1, lane), c = pack_vertex(pack, 2, lane);
    Vec3 weight = vec3(hit->weight[0], hit->weight[1], hit->weight[2]);
    weight = scale(1.0f / (weight.x + weight.y + weight.z), weight);

    Vec3 ab = subtract(b, a), ac = subtract(c, a), size_ab = absolute(ab), size_ac = absolute(ac);
    Vec3 extent = vec3(MAX(size_ab.x, size_ac.x), MAX(size_ab.y, size_ac.y), MAX(size_ab.z, size_ac.z));
    Vec3 reach = add(absolute(a), extent);
    Vec3 error = add(scale(COORDINATE_ULPS * HALF_ULP, reach), scale(EXTENT_ULPS * HALF_ULP, extent));
#ifndef TOP_LEVEL_ONLY
    Vec3 way = largest_image(object->object_from_world, largest_image(object->world_from_object, reach));
    error = add(error, scale(on_top ? 0.0f : TRANSFORM_ULPS * HALF_ULP, way));
#endif
    Vec3 winding_normal = bvh_normal(a, b, c);
    Normal normal = normal_along(winding_normal);
    // That normal is of scaled edges, whose cross product has twice the area of the triangle as its length.
    float factor = bvh_scale(bvh_largest(extent));
    Vec3 scaled = scale(factor, extent);
    float thin = NORMAL_ULPS * HALF_ULP * (scaled.x * scaled.y) * extent.z * normal.inverse_length;
    Vec3 facing = absolute(normal.direction);
    float size = bvh_largest(extent);
    float offset = dot(facing, error) + MIN(thin, size), clear = DISTANCE_ULPS * HALF_ULP * size;

    // The position keeps off the edges by its error. Without this a ray could start just above one face but
    // on the plane of the neighbouring face, and slip out where the two meet.
    float least =
        (factor * bvh_largest(error)) * (2.0f * (scaled.x + scaled.y + scaled.z)) * normal.inverse_length;
    least = MIN(least, 1.0f / 3.0f);
    float to_b = MAX(weight.y, least), to_c = MAX(weight.z, least);
    float inwards = MIN((1.0f - least) / (to_b + to_c), 1.0f);
    Vec3 position = add(a, add(scale(inwards * to_b, ab), scale(inwards * to_c, ac)));
    Vec3 geometric = scale(object->winding, normal.direction);
#ifndef TOP_LEVEL_ONLY
    position = select(on_top, position, world_point(object, position));
    Normal in_world = world_normal(object, normal.direction);
    geometric = select(on_top, geometric, in_world.direction);
    offset *= on_top ? 1.0f : in_world.inverse_length;
    clear *= on_top ? 1.0f : in_world.inverse_length;
#endif
    Surface surface;
    surface.face = pack->face[lane];
#ifndef FLAT
    Vec3 at = vec3(1.0f - inwards * (to_b + to_c), inwards * to_b, inwards * to_c);
    surface.rise = object->winding * pretended_world_height(object, geometry->normals, surface.face, at, ab,
                                                            ac, normal.direction);
#ifndef TOP_LEVEL_ONLY
    float in_object = pretended_height(object, geometry->normals, surface.face, at, ab, ac, normal.direction);
    surface.rise = on_top ? surface.rise : in_world.inverse_length * in_object;
#endif
#endif
    surface.offset = offset + MIN(clear, DISTANCE_SHARE * hit->distance);
    surface.position = position;
    surface.geometric = geometric;
#ifdef FLAT
    surface.shading = geometric;
#else
    surface.shading = shading_normal(object, geometry->normals, surface.face, weight, geometric);
#endif
    surface.distance = hit->distance;
    surface.object = hit->object;
    surface.material = object->material;
    surface.weight_b = weight.y;
    surface.weight_c = weight.z;
    return surface;
}

#ifndef FLAT
// Leaves the rise of a surface where rays need it: on the side that the ray along `direction` has come from,
// and where no light is let through, which would start below.
INLINE void settle_rise(__global const Material *materials, Vec3 direction, Surface *surface) {
    __global const Material *material = &materials[surface->material];
    int is_opaque = (material->transmission <= 0.0f) & (material->diffuse_transmission <= 0.0f);
    int is_seen = surface->rise * dot(surface->geometric, direction) < 0.0f;
    surface->rise = is_opaque & is_seen ? surface->rise : 0.0f;
}
#endif

// Which stage shades a path that has hit this object. A path that has hit nothing is given any answer.
INLINE uint hit_class(const Geometry *geometry, __global const Material *materials, uint object,
                      uint in_medium) {
    uint material = geometry->objects[INDEX_OR_0(object)].material;
    return in_medium | (materials[material].flags & MATERIAL_TRANSMISSIVE) ? CLASS_MEDIUM : CLASS_SURFACE;
}
