#include "accel/bvh.cl"
#include "path/state.cl"

// Turns the hit that traversal has found into a surface: position, normals, material, rounding bound. This is
// straight-line code of scalars, so that PoCL runs it in SIMD lanes.

// The variants TOP_LEVEL_ONLY and FLAT leave out what a scene does not need: the way from object space, and
// the normals of meshes.

// The unit vector along v, which is scaled before it is squared, because squares of very small or large
// components would leave the range of a float.
INLINE Vec3 safe_normalize(Vec3 v) { return normalize(scale(bvh_scale(bvh_largest(v)), v)); }

// A normal of object space in world space: by the inverse transpose, which keeps the outside outside, also
// where the object is mirrored.
INLINE Vec3 world_normal(__global const Object *object, Vec3 normal) {
    __global const float *m = object->object_from_world;
    Vec3 v = vec3(m[0] * normal.x + m[4] * normal.y + m[8] * normal.z,
                  m[1] * normal.x + m[5] * normal.y + m[9] * normal.z,
                  m[2] * normal.x + m[6] * normal.y + m[10] * normal.z);
    return safe_normalize(v);
}

INLINE Vec3 world_point(__global const Object *object, Vec3 p) {
    __global const float *m = object->world_from_object;
    return vec3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}

// A corner of the triangle in a lane of a pack.
INLINE Vec3 pack_vertex(__global const TrianglePack *pack, uint corner, uint lane) {
    return vec3(pack->vertex[3 * corner][lane], pack->vertex[3 * corner + 1][lane],
                pack->vertex[3 * corner + 2][lane]);
}

// How far along the unit normal a ray must start to be clear of the surface.
INLINE float offset_bound(__global const Object *object, Vec3 normal) {
    __global const float *error = object->position_error;
    return FABS(normal.x) * error[0] + FABS(normal.y) * error[1] + FABS(normal.z) * error[2];
}

// The interpolated normal, turned to the side of the geometric one. Where the face is flat, or where the
// normals of its corners cancel out, it is the geometric normal itself.
INLINE Vec3 shading_normal(__global const Object *object, __global const float *normals, uint face,
                           Vec3 weight, Vec3 geometric) {
    int smooth = object->first_normal != NO_INDEX;
    __global const float *n = normals + (smooth ? object->first_normal + 9u * (size_t)face : 0u);
    Vec3 interpolated = vec3(weight.x * n[0] + weight.y * n[3] + weight.z * n[6],
                             weight.x * n[1] + weight.y * n[4] + weight.z * n[7],
                             weight.x * n[2] + weight.y * n[5] + weight.z * n[8]);
    smooth &= FABS(interpolated.x) + FABS(interpolated.y) + FABS(interpolated.z) >= 1e-6f;
    Vec3 shading = world_normal(object, select(smooth, interpolated, vec3(0.0f, 0.0f, 1.0f)));
    shading = select(dot(shading, geometric) < 0.0f, scale(-1.0f, shading), shading);
    return select(smooth, shading, geometric);
}

// The position on a triangle, moved towards its centroid by `offset`. Without this a ray could start just
// above one face but on the plane of the neighbouring face, and slip out where the two meet.
INLINE Vec3 leave_edge(Vec3 centroid, float offset, Vec3 position) {
    Vec3 inwards = subtract(centroid, position);
    float share = offset / SQRT(dot(inwards, inwards));
    return along(position, share < 1.0f ? share : 0.0f, inwards);
}

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
    Vec3 position = add(scale(weight.x, a), add(scale(weight.y, b), scale(weight.z, c)));
    Vec3 centroid = scale(1.0f / 3.0f, add(a, add(b, c)));
    Vec3 normal = bvh_normal(a, b, c);
    Vec3 geometric = scale(object->winding, safe_normalize(normal));
#ifndef TOP_LEVEL_ONLY
    position = select(on_top, position, world_point(object, position));
    centroid = select(on_top, centroid, world_point(object, centroid));
    geometric = select(on_top, geometric, world_normal(object, normal));
#endif
    Surface surface;
    surface.face = pack->face[lane];
    surface.offset = offset_bound(object, geometric);
    surface.position = leave_edge(centroid, surface.offset, position);
    surface.geometric = geometric;
#ifdef FLAT
    surface.shading = geometric;
#else
    surface.shading = shading_normal(object, geometry->normals, surface.face, weight, geometric);
#endif
    surface.distance = hit->distance;
    surface.object = hit->object;
    surface.material = object->material;
    return surface;
}

// Which stage shades a path that has hit this object. A path that has hit nothing is given any answer.
INLINE uint hit_class(const Geometry *geometry, __global const Material *materials, uint object,
                      uint in_medium) {
    uint material = geometry->objects[object == NO_INDEX ? 0u : object].material;
    return in_medium | (materials[material].flags & MATERIAL_TRANSMISSIVE) ? CLASS_MEDIUM : CLASS_SURFACE;
}
