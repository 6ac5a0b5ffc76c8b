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
// Direction components below this count as zero; their reciprocal stays finite, so that no NaN can arise.
#define BVH_ZERO 1e-20f
#define BVH_INVERSE_ZERO 1e25f

// Inlined by force, and with the compiler's own bit operations where it has them: in PoCL a call in the inner
// loop spills every vector register.
#ifdef __clang__
#define BVH_INLINE static inline __attribute__((always_inline))
#define BVH_COUNT_BITS(x) ((uint)__builtin_popcount(x))
#define BVH_FIRST_BIT(x) ((uint)__builtin_ctz(x))
#else
#define BVH_INLINE static inline
#define BVH_COUNT_BITS(x) popcount(x)
#define BVH_FIRST_BIT(x) (31u - clz((x) & (0u - (x))))
#endif

// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
#ifdef INCPT_POCL
#define BVH_CALL static __attribute__((noinline))
#else
#define BVH_CALL static inline
#endif

// A ray in the space of one tree, prepared for its tests. Axis z of the triangle test is the direction's
// largest, x and y are the other two.
typedef struct {
    float inverse[3];
    float near_shift[3]; // distance to a plane = plane * inverse + shift
    float far_shift[3];
    uint near_plane[3]; // of a node's bounds
    uint axis[3];       // x, y and z of the triangle test
    float origin[3];    // along these
    float shear[3];
} BvhRay;

typedef struct {
    float distance;
    uint object;
    uint pack; // counted from the first of the object
    uint lane;
    float weight[3]; // of the corners, up to a common factor
} BvhHit;

BVH_INLINE float bvh_abs(float x) { return x < 0.0f ? -x : x; }

// Bit i is set where lane i of a comparison holds.
BVH_INLINE uint bvh_lanes(const int8 comparison) {
#if defined(__AVX__) && defined(__clang__)
    return (uint)__builtin_ia32_movmskps256(as_float8(comparison));
#else
    const int8 bit = comparison & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 four = bit.lo | bit.hi;
    const int2 two = four.lo | four.hi;
    return (uint)(two.x | two.y);
#endif
}

BVH_INLINE BvhRay bvh_ray(const float *origin, const float *direction) {
    BvhRay ray;
    const float x = bvh_abs(direction[0]), y = bvh_abs(direction[1]), z = bvh_abs(direction[2]);
    const uint k = x > y ? (x > z ? 0 : 2) : (y > z ? 1 : 2);
    for (uint axis = 0; axis < 3; axis++) {
        const bool zero = bvh_abs(direction[axis]) < BVH_ZERO;
        const float signed_zero = direction[axis] < 0.0f ? -1.0f / BVH_INVERSE_ZERO : 1.0f / BVH_INVERSE_ZERO;
        const float inverse = 1.0f / (zero ? signed_zero : direction[axis]);
        const float shift = -origin[axis] * inverse;
        // Without a direction the ray lies between the planes or not; on a plane it counts as between.
        const float slack = bvh_abs(shift) * BVH_SLACK + (zero ? BVH_INVERSE_ZERO * 1e-10f : 0.0f);
        ray.inverse[axis] = inverse;
        ray.near_shift[axis] = shift - slack;
        ray.far_shift[axis] = shift + slack;
        ray.near_plane[axis] = 2 * axis + (inverse < 0.0f ? 1 : 0);
    }
    ray.axis[0] = k == 2 ? 0 : k + 1;
    ray.axis[1] = k == 0 ? 2 : k - 1;
    ray.axis[2] = k;
    for (uint i = 0; i < 3; i++)
        ray.origin[i] = origin[ray.axis[i]];
    ray.shear[2] = 1.0f / direction[k];
    ray.shear[0] = direction[ray.axis[0]] * ray.shear[2];
    ray.shear[1] = direction[ray.axis[1]] * ray.shear[2];
    return ray;
}

#define BVH_PLANE(node, index) (*(__global const float8 *)(node)->bounds[index])

// Distances at which the ray enters the boxes of a node, and which of them it meets before `limit`.
BVH_INLINE uint bvh_boxes(const BvhRay *ray, __global const Node *node, float limit, float8 *entry) {
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

#define BVH_VERTEX(pack, corner, axis) (*(__global const float8 *)(pack)->vertex[3 * (corner) + (axis)])

// Which triangles of a pack the ray meets at 0 < t < limit, their t, and the weights of their corners.
BVH_INLINE uint bvh_triangles(const BvhRay *ray, __global const TrianglePack *pack, float limit,
                              float8 *distance, float8 *weight) {
#pragma OPENCL FP_CONTRACT OFF
    const uint x = ray->axis[0], y = ray->axis[1], z = ray->axis[2];
    const float8 az = BVH_VERTEX(pack, 0, z) - ray->origin[2];
    const float8 bz = BVH_VERTEX(pack, 1, z) - ray->origin[2];
    const float8 cz = BVH_VERTEX(pack, 2, z) - ray->origin[2];
    const float8 ax = BVH_VERTEX(pack, 0, x) - ray->origin[0] - ray->shear[0] * az;
    const float8 bx = BVH_VERTEX(pack, 1, x) - ray->origin[0] - ray->shear[0] * bz;
    const float8 cx = BVH_VERTEX(pack, 2, x) - ray->origin[0] - ray->shear[0] * cz;
    const float8 ay = BVH_VERTEX(pack, 0, y) - ray->origin[1] - ray->shear[1] * az;
    const float8 by = BVH_VERTEX(pack, 1, y) - ray->origin[1] - ray->shear[1] * bz;
    const float8 cy = BVH_VERTEX(pack, 2, y) - ray->origin[1] - ray->shear[1] * cz;
    const float8 u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    const float8 lowest = BVH_MIN8(BVH_MIN8(u, v), w), highest = BVH_MAX8(BVH_MAX8(u, v), w);
    const float8 depth = (u * az + v * bz + w * cz) * ray->shear[2];
    // A determinant of 0 makes t infinite or NaN, for which the comparisons are false.
    const float8 t = depth / (u + v + w);
    weight[0] = u;
    weight[1] = v;
    weight[2] = w;
    *distance = t;
    return bvh_lanes(((lowest >= 0.0f) | (highest <= 0.0f)) & (t > 0.0f) & (t < limit));
}

// An entry of the stack: a child and, in the upper half, the distance of its box. Bits of floats that are not
// negative have the order of the floats.
BVH_INLINE ulong bvh_entry(uint reference, float distance) {
    return ((ulong)as_uint(distance) << 32) | reference;
}

// Pushes the children in `lanes` with the nearest on top, and returns the new height. A child's place is the
// number of those farther away: no comparison decides a branch.
BVH_INLINE uint bvh_push(__global const Node *node, uint lanes, const float8 entry, ulong *stack,
                         uint height) {
    float distances[8];
    *(float8 *)distances = entry;
    for (uint left = lanes; left; left &= left - 1) {
        const uint lane = BVH_FIRST_BIT(left);
        const float distance = distances[lane];
        const uint farther = bvh_lanes(entry > distance) & lanes;
        const uint equal = bvh_lanes(entry == distance) & lanes & ((1u << lane) - 1);
        stack[height + BVH_COUNT_BITS(farther | equal)] = bvh_entry(node->child[lane], distance);
    }
    return height + BVH_COUNT_BITS(lanes);
}

// Takes the hits in `lanes` of a pack: keeps the nearest.
BVH_INLINE void bvh_keep(uint pack, uint lanes, const float8 distance, const float8 *weight, BvhHit *hit) {
    float distances[8];
    *(float8 *)distances = distance;
    for (; lanes; lanes &= lanes - 1) {
        const uint lane = BVH_FIRST_BIT(lanes);
        if (distances[lane] < hit->distance) {
            hit->distance = distances[lane];
            hit->lane = lane;
        }
    }
    hit->pack = pack;
    for (uint i = 0; i < 3; i++)
        hit->weight[i] = ((const float *)&weight[i])[hit->lane];
}

// Nearest triangle of a mesh before hit->distance; any one of them if `any`, which fills nothing in.
BVH_INLINE bool bvh_trace_mesh(const BvhRay *ray, __global const Node *nodes,
                               __global const TrianglePack *packs, const bool any, BvhHit *hit) {
    ulong stack[BVH_STACK_SIZE];
    uint height = 0, reference = 0;
    bool found = false;
    for (;;) {
        float8 distance;
        if (!(reference & NODE_LEAF)) {
            __global const Node *node = nodes + reference;
            const uint lanes = bvh_boxes(ray, node, hit->distance, &distance);
            if (lanes && !(lanes & (lanes - 1))) {
                reference = node->child[BVH_FIRST_BIT(lanes)];
                continue;
            }
            height = bvh_push(node, lanes, distance, stack, height);
        } else {
            float8 weight[3];
            const uint pack = reference & ~NODE_LEAF;
            const uint lanes = bvh_triangles(ray, packs + pack, hit->distance, &distance, weight);
            if (lanes) {
                if (any)
                    return true;
                found = true;
                bvh_keep(pack, lanes, distance, weight, hit);
            }
        }
        const ulong limit = bvh_entry(NODE_EMPTY, hit->distance);
        do {
            if (height == 0)
                return found;
        } while (stack[--height] > limit);
        reference = (uint)stack[height];
    }
}

BVH_INLINE void bvh_transform_point(__global const float *matrix, const float *p, float *result) {
    for (uint i = 0; i < 3; i++)
        result[i] =
            matrix[4 * i] * p[0] + matrix[4 * i + 1] * p[1] + matrix[4 * i + 2] * p[2] + matrix[4 * i + 3];
}

BVH_INLINE void bvh_transform_vector(__global const float *matrix, const float *v, float *result) {
    for (uint i = 0; i < 3; i++)
        result[i] = matrix[4 * i] * v[0] + matrix[4 * i + 1] * v[1] + matrix[4 * i + 2] * v[2];
}

// The ray in the space of an object. The direction keeps its length there, so that t is the same.
BVH_INLINE BvhRay bvh_object_ray(__global const Object *object, const float *origin, const float *direction) {
    float object_origin[3], object_direction[3];
    bvh_transform_point(object->object_from_world, origin, object_origin);
    bvh_transform_vector(object->object_from_world, direction, object_direction);
    return bvh_ray(object_origin, object_direction);
}

// `origins` and `directions` are three planes each, `stride` apart.
// Nearest hit of the scene with 0 < t < hit->distance, else object is NO_INDEX; any one of them if `any`,
// which fills nothing in.
BVH_CALL bool bvh_trace(__global const float *origins, __global const float *directions, uint stride,
                        __global const Node *top_nodes, __global const Node *nodes,
                        __global const TrianglePack *packs, __global const Object *objects, const bool any,
                        BvhHit *hit) {
    const float origin[3] = {origins[0], origins[stride], origins[2 * stride]};
    const float direction[3] = {directions[0], directions[stride], directions[2 * stride]};
    const BvhRay ray = bvh_ray(origin, direction);
    ulong stack[BVH_STACK_SIZE];
    uint height = 1;
    stack[0] = 0;
    hit->object = NO_INDEX;
    while (height) {
        const ulong top = stack[--height];
        const uint reference = (uint)top;
        if (top > bvh_entry(NODE_EMPTY, hit->distance))
            continue;
        if (!(reference & NODE_LEAF)) {
            float8 entry;
            const uint lanes = bvh_boxes(&ray, top_nodes + reference, hit->distance, &entry);
            height = bvh_push(top_nodes + reference, lanes, entry, stack, height);
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
