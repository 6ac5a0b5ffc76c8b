// Finds the nearest hit of each path's ray and describes the surface there.

#include "bvh.cl"

// Scaled before it is squared, because squares of very small or large components would leave the range of a
// float.
INLINE void make_unit(float *v) {
    const float scale = bvh_scale(bvh_largest3(v[0], v[1], v[2]));
    const float x = v[0] * scale, y = v[1] * scale, z = v[2] * scale;
    const float inverse = 1.0f / SQRT(x * x + y * y + z * z);
    v[0] = x * inverse;
    v[1] = y * inverse;
    v[2] = z * inverse;
}

INLINE float dot3(const float *a, const float *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// A normal of object space in world space: by the inverse transpose, which keeps the outside outside, also
// where the object is mirrored.
INLINE void world_normal(__global const Object *object, const float *normal, float *result) {
    __global const float *m = object->object_from_world;
    for (uint i = 0; i < 3; i++)
        result[i] = m[i] * normal[0] + m[4 + i] * normal[1] + m[8 + i] * normal[2];
    make_unit(result);
}

// How far along the unit normal a ray must start to be clear of the surface.
INLINE float offset_bound(__global const Object *object, const float *normal) {
    __global const float *error = object->position_error;
    return FABS(normal[0]) * error[0] + FABS(normal[1]) * error[1] + FABS(normal[2]) * error[2];
}

INLINE void shading_normal(__global const Object *object, __global const float *normals, uint face,
                           const float *weight, const float *geometric, float *result) {
    float interpolated[3] = {0.0f, 0.0f, 0.0f}, largest = 0.0f;
    if (object->first_normal != NO_INDEX) {
        __global const float *corner = normals + object->first_normal + 9 * (size_t)face;
        for (uint i = 0; i < 3; i++) {
            interpolated[i] = weight[0] * corner[i] + weight[1] * corner[3 + i] + weight[2] * corner[6 + i];
            largest += FABS(interpolated[i]);
        }
    }
    if (largest < 1e-6f) { // flat, or normals that cancel out
        for (uint i = 0; i < 3; i++)
            result[i] = geometric[i];
        return;
    }
    world_normal(object, interpolated, result);
    if (dot3(result, geometric) < 0.0f)
        for (uint i = 0; i < 3; i++)
            result[i] = -result[i];
}

// Moves a position on a triangle by that much towards its centroid. A ray that starts just above one face but
// on the plane of its neighbour, which it must not miss, would slip out where the two meet.
INLINE void leave_edge(__global const Object *object, const float (*vertex)[3], float offset,
                       float *position) {
    float middle[3], centroid[3];
    for (uint i = 0; i < 3; i++)
        middle[i] = (vertex[0][i] + vertex[1][i] + vertex[2][i]) * (1.0f / 3.0f);
    bvh_transform_point(object->world_from_object, middle, centroid);
    for (uint i = 0; i < 3; i++)
        centroid[i] -= position[i];
    const float share = offset / SQRT(dot3(centroid, centroid));
    for (uint i = 0; i < 3; i++)
        position[i] += (share < 1.0f ? share : 0.0f) * centroid[i];
}

// Writes all planes of a hit but its distance and object.
BVH_CALL void write_hit(const BvhHit *hit, uint k, uint stride, __global const Object *object,
                        __global const TrianglePack *packs, __global const float *normals,
                        __global float *hits) {
    __global const TrianglePack *pack = packs + object->first_pack + hit->pack;
    const uint face = pack->face[hit->lane];
    const float scale = 1.0f / (hit->weight[0] + hit->weight[1] + hit->weight[2]);
    float vertex[3][3], weight[3], point[3], position[3], normal[3], geometric[3], shading[3];
    for (uint i = 0; i < 3; i++) {
        weight[i] = hit->weight[i] * scale;
        for (uint axis = 0; axis < 3; axis++)
            vertex[i][axis] = pack->vertex[3 * i + axis][hit->lane];
    }
    for (uint i = 0; i < 3; i++)
        point[i] = weight[0] * vertex[0][i] + weight[1] * vertex[1][i] + weight[2] * vertex[2][i];
    bvh_transform_point(object->world_from_object, point, position);
    bvh_normal(vertex, normal);
    world_normal(object, normal, geometric);
    shading_normal(object, normals, face, weight, geometric, shading);
    const float offset = offset_bound(object, geometric);
    leave_edge(object, vertex, offset, position);
    hits[HIT_OFFSET * stride + k] = offset;
    hits[HIT_MATERIAL * stride + k] = as_float(object->material);
    hits[HIT_TRIANGLE * stride + k] = as_float(face);
    for (uint i = 0; i < 3; i++) {
        hits[(HIT_POSITION_X + i) * stride + k] = position[i];
        hits[(HIT_GEOMETRIC_X + i) * stride + k] = geometric[i];
        hits[(HIT_SHADING_X + i) * stride + k] = shading[i];
    }
}

// The hint keeps compilers from making SIMD lanes of work-items (Intel's would): the lanes are boxes and
// triangles.
__kernel __attribute__((vec_type_hint(float8))) void
intersect(const Params params, const uint count, __global const uint *list, __global const Node *top_nodes,
          __global const Node *nodes, __global const TrianglePack *packs, __global const Object *objects,
          __global const Material *materials, __global const float *normals, __global const float *rays,
          __global float *paths, __global float *hits) {
    if (get_global_id(0) >= count)
        return;
    const uint k = list[get_global_id(0)], stride = params.path_stride;
    BvhHit hit;
    hit.distance = INFINITY;
    bvh_trace(rays + RAY_ORIGIN_X * stride + k, rays + RAY_DIRECTION_X * stride + k, stride, top_nodes, nodes,
              packs, objects, false, &hit);
    hits[HIT_DISTANCE * stride + k] = hit.distance;
    hits[HIT_OBJECT * stride + k] = as_float(hit.object);
    uint path_class = CLASS_ESCAPED;
    if (hit.object != NO_INDEX) {
        __global const Object *object = objects + hit.object;
        write_hit(&hit, k, stride, object, packs, normals, hits);
        const bool in_medium = as_uint(paths[PATH_MEDIUM_0 * stride + k]) != NO_INDEX;
        const bool transmissive = materials[object->material].flags & MATERIAL_TRANSMISSIVE;
        path_class = in_medium || transmissive ? CLASS_MEDIUM : CLASS_SURFACE;
    }
    paths[PATH_CLASS * stride + k] = as_float(path_class);
}
