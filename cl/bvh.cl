// Two-level traversal of 8-wide bounding volume hierarchies: closest hit and any hit.
//
// Watertight (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection"): the sign of an edge
// function, a product compared with a product, cannot come out wrong as long as both are rounded alike, so a
// ray that meets a shared edge or vertex is inside at least one of the faces there. Contracting one of the
// products into a fused multiply-add would break that.
// Box tests err on the side of a hit (Ize 2013, "Robust BVH Ray Traversal").

#define BVH_STACK_SIZE ((BVH_WIDTH - 1) * BVH_MAX_DEPTH + 1)
#define BVH_MIN8(a, b) ((a) < (b) ? (a) : (b))
#define BVH_MAX8(a, b) ((a) > (b) ? (a) : (b))
// Rounding errors of the box test, relative: several ulps, because compilers may or may not fuse.
#define BVH_SLACK 4e-7f
// Direction components below this count as zero; its reciprocal stays finite, so that no NaN can arise.
#define BVH_ZERO 1e-20f
#define BVH_INVERSE_ZERO 1e25f

// A ray in the space of one tree, prepared for its tests. Axis k of the triangle test is the direction's
// largest (z of the paper), then the other two.
typedef struct {
    float inverse[3];
    float near_shift[3]; // distance to a plane = plane * inverse + shift
    float far_shift[3];
    uint near_plane[3]; // of a node's bounds
    uint axis[3];       // x, y and z of the paper
    float origin[3];    // along these
    float shear[3];
} BvhRay;

typedef struct {
    float distance;
    uint object;
    uint pack;
    uint lane;
} BvhHit;

static inline float bvh_abs(float x) { return x < 0.0f ? -x : x; }

// Bit i is set where lane i of a comparison holds.
static inline uint bvh_lanes(const int8 comparison) {
#if defined(__AVX__) && defined(__clang__)
    return (uint)__builtin_ia32_movmskps256(as_float8(comparison));
#else
    const int8 bit = comparison & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 four = bit.lo | bit.hi;
    const int2 two = four.lo | four.hi;
    return (uint)(two.x | two.y);
#endif
}

static inline uint bvh_first_lane(uint lanes) { return 31u - clz(lanes & (0u - lanes)); }

static inline BvhRay bvh_ray(const float *origin, const float *direction) {
    BvhRay ray;
    for (uint axis = 0; axis < 3; axis++) {
        const bool zero = bvh_abs(direction[axis]) < BVH_ZERO;
        const float magnitude = zero ? BVH_INVERSE_ZERO : 1.0f / bvh_abs(direction[axis]);
        const float inverse = direction[axis] < 0.0f ? -magnitude : magnitude;
        const float shift = -origin[axis] * inverse;
        // Without a direction the ray lies between the planes or not; on a plane it counts as between.
        const float slack = bvh_abs(shift) * BVH_SLACK + (zero ? BVH_INVERSE_ZERO * 1e-10f : 0.0f);
        ray.inverse[axis] = inverse;
        ray.near_shift[axis] = shift - slack;
        ray.far_shift[axis] = shift + slack;
        ray.near_plane[axis] = 2 * axis + (inverse < 0.0f ? 1 : 0);
    }
    const float x = bvh_abs(direction[0]), y = bvh_abs(direction[1]), z = bvh_abs(direction[2]);
    const uint k = x > y ? (x > z ? 0 : 2) : (y > z ? 1 : 2);
    ray.axis[0] = k == 2 ? 0 : k + 1;
    ray.axis[1] = k == 0 ? 2 : k - 1;
    ray.axis[2] = k;
    for (uint i = 0; i < 3; i++)
        ray.origin[i] = origin[ray.axis[i]];
    ray.shear[0] = direction[ray.axis[0]] / direction[k];
    ray.shear[1] = direction[ray.axis[1]] / direction[k];
    ray.shear[2] = 1.0f / direction[k];
    return ray;
}

#define BVH_PLANE(node, index) (*(__global const float8 *)(node)->bounds[index])

// Distances at which the ray enters the boxes of a node, and which of them it meets before `limit`.
static inline uint bvh_boxes(const BvhRay *ray, __global const Node *node, float limit, float8 *entry) {
    const float8 near_x = BVH_PLANE(node, ray->near_plane[0]) * ray->inverse[0] + ray->near_shift[0];
    const float8 near_y = BVH_PLANE(node, ray->near_plane[1]) * ray->inverse[1] + ray->near_shift[1];
    const float8 near_z = BVH_PLANE(node, ray->near_plane[2]) * ray->inverse[2] + ray->near_shift[2];
    const float8 far_x = BVH_PLANE(node, ray->near_plane[0] ^ 1) * ray->inverse[0] + ray->far_shift[0];
    const float8 far_y = BVH_PLANE(node, ray->near_plane[1] ^ 1) * ray->inverse[1] + ray->far_shift[1];
    const float8 far_z = BVH_PLANE(node, ray->near_plane[2] ^ 1) * ray->inverse[2] + ray->far_shift[2];
    const float8 near_xy = BVH_MAX8(near_x, near_y), near_z0 = BVH_MAX8(near_z, (float8)(0.0f));
    const float8 far_xy = BVH_MIN8(far_x, far_y), far_z1 = BVH_MIN8(far_z, (float8)(limit));
    const float8 near = BVH_MAX8(near_xy, near_z0), far = BVH_MIN8(far_xy, far_z1);
    *entry = near;
    return bvh_lanes(near <= far * (1.0f + BVH_SLACK));
}

#define BVH_VERTEX(pack, corner, axis) (*(__global const float8 *)(pack)->vertex[3 * (corner) + (axis)])

// Normal of a triangle by its winding, not of unit length. False where it has no area; the builder and the
// hit agree on that, because both come here and nothing is contracted.
static inline bool bvh_normal(const float (*vertex)[3], float *normal) {
#pragma OPENCL FP_CONTRACT OFF
    float e[2][3], longest = 1e-30f;
    for (uint i = 0; i < 6; i++) {
        const float edge = vertex[1 + i / 3][i % 3] - vertex[0][i % 3];
        e[i / 3][i % 3] = edge;
        longest = bvh_abs(edge) > longest ? bvh_abs(edge) : longest;
    }
    const float scale =
        1.0f / longest; // products of very small or large edges would leave the range of a float
    for (uint i = 0; i < 6; i++)
        e[i / 3][i % 3] *= scale;
    float largest = 0.0f;
    for (uint i = 0; i < 3; i++) {
        const uint j = i == 2 ? 0 : i + 1, k = i == 0 ? 2 : i - 1;
        normal[i] = e[0][j] * e[1][k] - e[0][k] * e[1][j];
        largest = bvh_abs(normal[i]) > largest ? bvh_abs(normal[i]) : largest;
    }
    return largest > 1e-30f;
}

// Edge functions and sheared depths of one triangle or of eight: U, V, W of the paper and the scaled z.
#define BVH_EDGES(T, name, LOAD)                                                                             \
    static inline void name(const BvhRay *ray, __global const TrianglePack *pack, uint lane, T *u, T *v,     \
                            T *w, T *depth) {                                                                \
        _Pragma("OPENCL FP_CONTRACT OFF") const uint x = ray->axis[0], y = ray->axis[1], z = ray->axis[2];   \
        const T az = LOAD(0, z) - ray->origin[2], bz = LOAD(1, z) - ray->origin[2];                          \
        const T cz = LOAD(2, z) - ray->origin[2];                                                            \
        const T ax = LOAD(0, x) - ray->origin[0] - ray->shear[0] * az;                                       \
        const T bx = LOAD(1, x) - ray->origin[0] - ray->shear[0] * bz;                                       \
        const T cx = LOAD(2, x) - ray->origin[0] - ray->shear[0] * cz;                                       \
        const T ay = LOAD(0, y) - ray->origin[1] - ray->shear[1] * az;                                       \
        const T by = LOAD(1, y) - ray->origin[1] - ray->shear[1] * bz;                                       \
        const T cy = LOAD(2, y) - ray->origin[1] - ray->shear[1] * cz;                                       \
        *u = cx * by - cy * bx;                                                                              \
        *v = ax * cy - ay * cx;                                                                              \
        *w = bx * ay - by * ax;                                                                              \
        *depth = (*u * az + *v * bz + *w * cz) * ray->shear[2];                                              \
    }

#define BVH_LOAD8(corner, axis) BVH_VERTEX(pack, corner, axis)
#define BVH_LOAD1(corner, axis) pack->vertex[3 * (corner) + (axis)][lane]
BVH_EDGES(float8, bvh_edges8, BVH_LOAD8)
BVH_EDGES(float, bvh_edges1, BVH_LOAD1)

// Which triangles of a pack the ray meets at 0 < t < limit, and their t.
static inline uint bvh_triangles(const BvhRay *ray, __global const TrianglePack *pack, float limit,
                                 float8 *distance) {
    float8 u, v, w, depth;
    bvh_edges8(ray, pack, 0, &u, &v, &w, &depth);
    const float8 lowest = BVH_MIN8(BVH_MIN8(u, v), w), highest = BVH_MAX8(BVH_MAX8(u, v), w);
    const float8 determinant = u + v + w;
    // A determinant of 0 makes t infinite or NaN, for which the comparisons are false.
    const float8 t = depth / determinant;
    *distance = t;
    return bvh_lanes(((lowest >= 0.0f) | (highest <= 0.0f)) & (t > 0.0f) & (t < limit));
}

// Pushes the children that the ray meets, the nearest on top. Returns the new height of the stack.
static inline uint bvh_push(__global const Node *node, uint lanes, const float8 entry, uint *references,
                            float *entries, uint height) {
    const uint bottom = height;
    float entry_of[8];
    *(float8 *)entry_of = entry;
    while (lanes) {
        const uint lane = bvh_first_lane(lanes);
        lanes &= lanes - 1;
        const float distance = entry_of[lane];
        uint place = height++;
        for (; place > bottom && entries[place - 1] < distance; place--) {
            entries[place] = entries[place - 1];
            references[place] = references[place - 1];
        }
        entries[place] = distance;
        references[place] = node->child[lane];
    }
    return height;
}

// Nearest triangle of a mesh before hit->distance; any one of them if `any`. Sets distance, pack and lane.
static inline bool bvh_trace_mesh(const BvhRay *ray, __global const Node *nodes,
                                  __global const TrianglePack *packs, const bool any, BvhHit *hit) {
    uint references[BVH_STACK_SIZE];
    float entries[BVH_STACK_SIZE];
    uint height = 1;
    bool found = false;
    references[0] = 0;
    entries[0] = 0.0f;
    while (height) {
        height--;
        if (entries[height] > hit->distance)
            continue;
        const uint reference = references[height];
        float8 distance;
        if (!(reference & NODE_LEAF)) {
            const uint lanes = bvh_boxes(ray, nodes + reference, hit->distance, &distance);
            height = bvh_push(nodes + reference, lanes, distance, references, entries, height);
            continue;
        }
        uint lanes = bvh_triangles(ray, packs + (reference & ~NODE_LEAF), hit->distance, &distance);
        if (!lanes)
            continue;
        found = true;
        if (any)
            return true;
        float distance_of[8];
        *(float8 *)distance_of = distance;
        for (; lanes; lanes &= lanes - 1) {
            const uint lane = bvh_first_lane(lanes);
            if (distance_of[lane] < hit->distance) {
                hit->distance = distance_of[lane];
                hit->lane = lane;
                hit->pack = reference & ~NODE_LEAF;
            }
        }
    }
    return found;
}

static inline void bvh_transform_point(__global const float *matrix, const float *p, float *result) {
    for (uint i = 0; i < 3; i++)
        result[i] =
            matrix[4 * i] * p[0] + matrix[4 * i + 1] * p[1] + matrix[4 * i + 2] * p[2] + matrix[4 * i + 3];
}

static inline void bvh_transform_vector(__global const float *matrix, const float *v, float *result) {
    for (uint i = 0; i < 3; i++)
        result[i] = matrix[4 * i] * v[0] + matrix[4 * i + 1] * v[1] + matrix[4 * i + 2] * v[2];
}

// The ray in the space of an object. The direction keeps its length there, so that t is the same.
static inline BvhRay bvh_object_ray(__global const Object *object, const float *origin,
                                    const float *direction) {
    float local_origin[3], local_direction[3];
    bvh_transform_point(object->object_from_world, origin, local_origin);
    bvh_transform_vector(object->object_from_world, direction, local_direction);
    return bvh_ray(local_origin, local_direction);
}

// Nearest hit of the scene with 0 < t < hit->distance; any one of them if `any`, which then fills nothing
// in. Packs are counted from the object's first; object is NO_INDEX unless set here.
static inline bool bvh_trace(const float *origin, const float *direction, __global const Node *top_nodes,
                             __global const Node *nodes, __global const TrianglePack *packs,
                             __global const Object *objects, const bool any, BvhHit *hit) {
    const BvhRay ray = bvh_ray(origin, direction);
    uint references[BVH_STACK_SIZE];
    float entries[BVH_STACK_SIZE];
    uint height = 1;
    references[0] = 0;
    entries[0] = 0.0f;
    hit->object = NO_INDEX;
    while (height) {
        height--;
        if (entries[height] > hit->distance)
            continue;
        const uint reference = references[height];
        if (!(reference & NODE_LEAF)) {
            float8 entry;
            const uint lanes = bvh_boxes(&ray, top_nodes + reference, hit->distance, &entry);
            height = bvh_push(top_nodes + reference, lanes, entry, references, entries, height);
            continue;
        }
        __global const Object *object = objects + (reference & ~NODE_LEAF);
        if (!object->visible)
            continue;
        const BvhRay object_ray = bvh_object_ray(object, origin, direction);
        if (bvh_trace_mesh(&object_ray, nodes + object->first_node, packs + object->first_pack, any, hit)) {
            if (any)
                return true;
            hit->object = reference & ~NODE_LEAF;
        }
    }
    return hit->object != NO_INDEX;
}
