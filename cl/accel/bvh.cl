// Two-level traversal of 8-wide bounding volume hierarchies: closest hit and any hit.
//
// The triangle test is watertight (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection"): the
// sign of an edge function, a product compared with a product, cannot come out wrong as long as both products
// are rounded alike, so that a ray which meets a shared edge or vertex is inside at least one of the faces
// there. Contracting one of the products into a fused multiply-add would break that.
// The box test errs on the side of a hit (Ize 2013, "Robust BVH Ray Traversal"). Where huge coordinates along
// a zero direction overflow to NaN, the order of operands in BVH_MIN8 and BVH_MAX8 leaves that axis out.

#include "accel/slab.cl"
#include "base/lanes8.cl"

#define BVH_STACK_SIZE ((BVH_WIDTH - 1) * BVH_MAX_DEPTH + 1)
#define BVH_TOP_STACK_SIZE (2 * BVH_STACK_SIZE) // below a tree over objects there may be one over packs
#define BVH_PLANE_BYTES (BVH_WIDTH * sizeof(float))
#define BVH_MIN8(a, b) ((a) < (b) ? (a) : (b))
#define BVH_MAX8(a, b) ((a) > (b) ? (a) : (b))

// All functions are inlined by force, and bit operations are the compiler's own where it has them, because in
// PoCL a call in the inner loop spills every vector register.
#ifdef __clang__
#define BVH_FIRST_BIT(x) ((uint)__builtin_ctz(x))
#define BVH_LIKELY(x) __builtin_expect(x, 1)
#else
#define BVH_FIRST_BIT(x) (31u - clz((x) & (0u - (x))))
#define BVH_LIKELY(x) (x)
#endif

// `Geometry` (core/bindings.py) is everything that rays can meet: the top level over objects and over the
// triangles of small meshes, which lie in its packs in world space, and the trees and packs of the other
// meshes.

// A ray in the space of one tree, prepared for its tests. Axis z of the triangle test is the direction's
// largest, x and y are the other two.
typedef struct {
    Slab slab[3];
    size_t near_plane[3]; // offset in a node, bytes
    size_t axis[3];       // x, y and z of the triangle test, as offsets in a pack, bytes
    float origin[3];      // along x, y and z of the triangle test
    float shear[3];
} BvhRay;

// The nearest hit so far. Only its distance has a meaning where `object` is NO_INDEX.
typedef struct {
    float distance; // along the ray
    uint object;
    uint triangle;   // its place, see PLACE_PACK
    float weight[3]; // of the corners, up to a common factor
#ifdef COUNT_VISITS
    uint visited_nodes, visited_packs;
#endif
} RawHit;

// Counts a node or a pack that a ray is tested against, where the benchmark of rays asks for it.
#ifdef COUNT_VISITS
#define COUNT_VISIT(hit, counter) ((hit)->counter++)
#else
#define COUNT_VISIT(hit, counter)
#endif

// The largest component of a direction, and the other two, which are x and y of the triangle test.
INLINE uint bvh_main_axis(Vec3 direction) {
    const float x = FABS(direction.x), y = FABS(direction.y), z = FABS(direction.z);
    return x > y ? (x > z ? 0u : 2u) : (y > z ? 1u : 2u);
}
INLINE uint bvh_x_axis(uint main) { return main == 2u ? 0u : main + 1u; }
INLINE uint bvh_y_axis(uint main) { return main == 0u ? 2u : main - 1u; }

INLINE float component(Vec3 v, uint axis) { return axis == 0u ? v.x : axis == 1u ? v.y : v.z; }

// Bit i: the direction is negative along axis i.
INLINE uint bvh_octant(Vec3 direction) {
    return as_uint(direction.x) >> 31 | as_uint(direction.y) >> 31 << 1 | as_uint(direction.z) >> 31 << 2;
}

// Where the planes that a ray into the octant meets first stand in a node.
INLINE void bvh_point(BvhRay *ray, uint octant, uint main) {
    ray->near_plane[0] = (octant & 1u) * BVH_PLANE_BYTES;
    ray->near_plane[1] = (2u + (octant >> 1 & 1u)) * BVH_PLANE_BYTES;
    ray->near_plane[2] = (4u + (octant >> 2 & 1u)) * BVH_PLANE_BYTES;
    ray->axis[0] = bvh_x_axis(main) * BVH_PLANE_BYTES;
    ray->axis[1] = bvh_y_axis(main) * BVH_PLANE_BYTES;
    ray->axis[2] = main * BVH_PLANE_BYTES;
}

INLINE BvhRay bvh_ray(Ray world_or_local) {
    const Vec3 origin = world_or_local.origin, direction = world_or_local.direction;
    BvhRay ray;
    const uint main = bvh_main_axis(direction), x = bvh_x_axis(main), y = bvh_y_axis(main);
    bvh_point(&ray, bvh_octant(direction), main);
    ray.slab[0] = slab_of(origin.x, direction.x);
    ray.slab[1] = slab_of(origin.y, direction.y);
    ray.slab[2] = slab_of(origin.z, direction.z);
    ray.shear[2] = 1.0f / component(direction, main);
    ray.shear[0] = component(direction, x) * ray.shear[2];
    ray.shear[1] = component(direction, y) * ray.shear[2];
    ray.origin[0] = component(origin, x);
    ray.origin[1] = component(origin, y);
    ray.origin[2] = component(origin, main);
    return ray;
}

// Eight floats of a node or a pack, `offset` bytes from its start.
#define BVH_LOAD(place, offset) (*(__global const float8 *)((__global const char *)(place) + (offset)))

// Distances at which the ray enters and leaves the boxes of a node between 0 and `limit`; it meets those
// which it does not leave before it enters.
INLINE void bvh_box_distances(const BvhRay *ray, __global const Node *node, float limit, float8 *entry,
                              float8 *exit) {
    const float8 near_x = BVH_LOAD(node, ray->near_plane[0]) * ray->slab[0].inverse + ray->slab[0].near_shift;
    const float8 near_y = BVH_LOAD(node, ray->near_plane[1]) * ray->slab[1].inverse + ray->slab[1].near_shift;
    const float8 near_z = BVH_LOAD(node, ray->near_plane[2]) * ray->slab[2].inverse + ray->slab[2].near_shift;
    const float8 far_x =
        BVH_LOAD(node, ray->near_plane[0] ^ BVH_PLANE_BYTES) * ray->slab[0].inverse + ray->slab[0].far_shift;
    const float8 far_y =
        BVH_LOAD(node, ray->near_plane[1] ^ BVH_PLANE_BYTES) * ray->slab[1].inverse + ray->slab[1].far_shift;
    const float8 far_z =
        BVH_LOAD(node, ray->near_plane[2] ^ BVH_PLANE_BYTES) * ray->slab[2].inverse + ray->slab[2].far_shift;
    const float8 near_xy = BVH_MAX8(near_x, near_y), near_z0 = BVH_MAX8(near_z, (float8)(0.0f));
    const float8 far_xy = BVH_MIN8(far_x, far_y), far_z1 = BVH_MIN8(far_z, (float8)(limit));
    *entry = BVH_MAX8(near_xy, near_z0);
    *exit = BVH_MIN8(far_xy, far_z1) * (1.0f + BVH_SLACK);
}

// Distances at which the ray enters the boxes of a node, and which of them it meets before `limit`.
INLINE uint bvh_boxes(const BvhRay *ray, __global const Node *node, float limit, float8 *entry) {
    float8 exit;
    bvh_box_distances(ray, node, limit, entry, &exit);
    return lane_bits(*entry <= exit);
}

// The power of two that brings x between 1 and 2; finite and above 0 for any x that is.
INLINE float bvh_scale(float x) {
    const uint exponent = as_uint(x) & 0x7f800000;
    return as_float(0x7f000000 - (exponent < 0x7e800000 ? exponent : 0x7e800000));
}

INLINE float bvh_largest(Vec3 v) { return MAX(MAX(FABS(v.x), FABS(v.y)), FABS(v.z)); }

// Normal of a triangle by its winding, not of unit length; what has an area has a component above
// BVH_LEAST_NORMAL. The builder and the hit agree on that, because both come here and nothing is contracted.
// Edges are scaled, without rounding, because products of very short or long ones would leave the range of a
// float.
#define BVH_LEAST_NORMAL 1e-30f
INLINE Vec3 bvh_normal(Vec3 a, Vec3 b, Vec3 c) {
#pragma OPENCL FP_CONTRACT OFF
    Vec3 ab = subtract(b, a), ac = subtract(c, a);
    float factor = bvh_scale(MAX(bvh_largest(ab), bvh_largest(ac)));
    ab = scale(factor, ab);
    ac = scale(factor, ac);
    return vec3(ab.y * ac.z - ab.z * ac.y, ab.z * ac.x - ab.x * ac.z, ab.x * ac.y - ab.y * ac.x);
}

#define BVH_VERTEX(pack, corner, axis) BVH_LOAD(pack, 3 * BVH_PLANE_BYTES * (corner) + (axis))

// Coordinate of a vertex in the frame of the ray, x or y. One function for all corners, so that a vertex
// comes out the same in all its triangles.
INLINE float8 bvh_shear(const float8 v, float origin, float shear, const float8 z) {
    return (v - origin) - shear * z;
}

// Twice the signed area between the ray and an edge. Both products are rounded alike: see above.
INLINE float8 bvh_edge(const float8 ax, const float8 ay, const float8 bx, const float8 by) {
#pragma OPENCL FP_CONTRACT OFF
    return ax * by - ay * bx;
}

// Which triangles of a pack the ray may meet though it starts between the first and the last of their
// corners.
//
// The distance of a hit is a mean of those of the corners, which are far apart where a triangle is large:
// near the ray's origin its sign is left to rounding errors. The side of the triangle on which the origin
// lies is known far better, and for a triangle in a plane of the axes to the bit. So a ray that leaves a
// surface never meets it again, however close to it it starts. `seen` is the determinant, whose sign tells
// from which side the ray comes.
INLINE int8 bvh_starts_before(const BvhRay *ray, __global const TrianglePack *pack, const float8 seen) {
    const size_t x = ray->axis[0], y = ray->axis[1], z = ray->axis[2];
    const float8 ax = BVH_VERTEX(pack, 0, x), ay = BVH_VERTEX(pack, 0, y), az = BVH_VERTEX(pack, 0, z);
    const float8 bx = BVH_VERTEX(pack, 1, x) - ax, by = BVH_VERTEX(pack, 1, y) - ay,
                 bz = BVH_VERTEX(pack, 1, z) - az;
    const float8 cx = BVH_VERTEX(pack, 2, x) - ax, cy = BVH_VERTEX(pack, 2, y) - ay,
                 cz = BVH_VERTEX(pack, 2, z) - az;
    const float8 side = (by * cz - bz * cy) * (ax - ray->origin[0]) +
                        (bz * cx - bx * cz) * (ay - ray->origin[1]) +
                        (bx * cy - by * cx) * (az - ray->origin[2]);
    const int8 differs = as_int8(side) ^ as_int8(seen * ray->shear[2]);
    return (differs < 0) & (side != 0.0f);
}

// Which triangles of a pack the ray meets at 0 < t < limit, their t, and the weights of their corners.
INLINE uint bvh_triangles(const BvhRay *ray, __global const TrianglePack *pack, float limit, float8 *distance,
                          float8 *weight) {
    const size_t x = ray->axis[0], y = ray->axis[1], z = ray->axis[2];
    const float8 az = BVH_VERTEX(pack, 0, z) - ray->origin[2];
    const float8 bz = BVH_VERTEX(pack, 1, z) - ray->origin[2];
    const float8 cz = BVH_VERTEX(pack, 2, z) - ray->origin[2];
    const float8 ax = bvh_shear(BVH_VERTEX(pack, 0, x), ray->origin[0], ray->shear[0], az);
    const float8 bx = bvh_shear(BVH_VERTEX(pack, 1, x), ray->origin[0], ray->shear[0], bz);
    const float8 cx = bvh_shear(BVH_VERTEX(pack, 2, x), ray->origin[0], ray->shear[0], cz);
    const float8 ay = bvh_shear(BVH_VERTEX(pack, 0, y), ray->origin[1], ray->shear[1], az);
    const float8 by = bvh_shear(BVH_VERTEX(pack, 1, y), ray->origin[1], ray->shear[1], bz);
    const float8 cy = bvh_shear(BVH_VERTEX(pack, 2, y), ray->origin[1], ray->shear[1], cz);
    const float8 u = bvh_edge(cx, cy, bx, by), v = bvh_edge(ax, ay, cx, cy), w = bvh_edge(bx, by, ax, ay);
    const float8 lowest = BVH_MIN8(BVH_MIN8(u, v), w), highest = BVH_MAX8(BVH_MAX8(u, v), w);
    const float8 determinant = u + v + w, depth = (u * az + v * bz + w * cz) * ray->shear[2];
    const int8 sign = as_int8(determinant) & INT_MIN;
    // t = depth / determinant, compared without the division. A determinant of 0 fails one of the
    // comparisons.
    const float8 size = as_float8(as_int8(determinant) ^ sign), scaled = as_float8(as_int8(depth) ^ sign);
    uint lanes =
        lane_bits(((lowest >= 0.0f) | (highest <= 0.0f)) & (scaled > 0.0f) & (scaled < size * limit));
    if (lanes) {
        lanes &= lane_bits(bvh_starts_before(ray, pack, determinant));
        *distance = depth / determinant;
        weight[0] = u;
        weight[1] = v;
        weight[2] = w;
    }
    return lanes;
}

// An entry of the stack: a child and, in the upper half, the distance of its box. Bits of floats that are not
// negative have the order of the floats.
INLINE ulong bvh_entry(uint reference, float distance) {
    return ((ulong)as_uint(distance) << 32) | reference;
}

// Pushes the children in `lanes` (one or more) but the nearest, which it returns, nearer ones above farther
// ones. Of three or more, the place of each is the number of those farther away: no comparison decides a
// branch there.
INLINE uint bvh_push(__global const Node *node, uint lanes, const float8 entry, ulong *stack, uint *height) {
    const uint first = BVH_FIRST_BIT(lanes);
    uint left = lanes & (lanes - 1);
    if (!left)
        return node->child[first];
    const float *distances = (const float *)&entry;
    const uint second = BVH_FIRST_BIT(left);
    left &= left - 1;
    if (!left) {
        // Told to be likely, so that it stays a branch: a guess right half the time beats waiting for the
        // boxes.
        if (BVH_LIKELY(distances[first] <= distances[second])) {
            stack[(*height)++] = bvh_entry(node->child[second], distances[second]);
            return node->child[first];
        }
        stack[(*height)++] = bvh_entry(node->child[first], distances[first]);
        return node->child[second];
    }
    for (left = lanes; left; left &= left - 1) {
        const uint lane = BVH_FIRST_BIT(left);
        const float distance = distances[lane];
        const uint farther = lane_bits(entry > distance) & lanes;
        const uint equal = lane_bits(entry == distance) & lanes & ((1u << lane) - 1);
        stack[*height + COUNT_BITS(farther | equal)] = bvh_entry(node->child[lane], distance);
    }
    *height += COUNT_BITS(lanes) - 1;
    return (uint)stack[*height];
}

// Takes the nearest of the hits in `lanes` of a pack, if it is nearer than the one before.
INLINE bool bvh_keep(uint pack, uint lanes, const float8 distance, const float8 *weight, RawHit *hit) {
    const float *distances = (const float *)&distance;
    uint nearest = BVH_FIRST_BIT(lanes);
    for (lanes &= lanes - 1; lanes; lanes &= lanes - 1) {
        const uint lane = BVH_FIRST_BIT(lanes);
        nearest = distances[lane] < distances[nearest] ? lane : nearest;
    }
    if (!(distances[nearest] < hit->distance))
        return false;
    hit->distance = distances[nearest];
    hit->triangle = IN_FIELD(pack, PLACE_PACK) + nearest;
#pragma unroll
    for (uint i = 0; i < 3; i++)
        hit->weight[i] = ((const float *)&weight[i])[nearest];
    return true;
}

// Asks for a node or pack before it is needed: those of a large mesh lie in memory that is slow to answer.
INLINE void bvh_prefetch(__global const Node *nodes, __global const TrianglePack *packs, uint reference) {
#ifdef CLANG_CPU
    const size_t place =
        reference & NODE_LEAF ? (size_t)(packs + (reference & ~NODE_LEAF)) : (size_t)(nodes + reference);
#pragma unroll
    for (uint line = 0; line < 5; line++)
        __builtin_prefetch((const void *)(place + 64 * line));
#endif
}

// Nearest triangle of a mesh before hit->distance; any one of them if `any`, which fills nothing in.
INLINE bool bvh_trace_mesh(const BvhRay *ray, __global const Node *nodes, __global const TrianglePack *packs,
                           const bool any, RawHit *hit) {
    ulong stack[BVH_STACK_SIZE];
    uint height = 0, reference = 0;
    bool found = false;
    for (;;) {
        float8 distance;
        if (!(reference & NODE_LEAF)) {
            __global const Node *node = nodes + reference;
            COUNT_VISIT(hit, visited_nodes);
            const uint lanes = bvh_boxes(ray, node, hit->distance, &distance);
            if (lanes) {
                reference = bvh_push(node, lanes, distance, stack, &height);
                bvh_prefetch(nodes, packs, reference);
                if (height > 0)
                    bvh_prefetch(nodes, packs, (uint)stack[height - 1]);
                continue;
            }
        } else {
            float8 weight[3];
            const uint pack = reference & ~NODE_LEAF;
            COUNT_VISIT(hit, visited_packs);
            const uint lanes = bvh_triangles(ray, packs + pack, hit->distance, &distance, weight);
            if (lanes) {
                if (any)
                    return true;
                found |= bvh_keep(pack, lanes, distance, weight, hit);
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

// The ray in the space of an object. The direction keeps its length there, so that t is the same.
INLINE Vec3 bvh_object_point(__global const Object *object, Vec3 p) {
    __global const float *m = object->object_from_world;
    return vec3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
                m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}
INLINE Vec3 bvh_object_vector(__global const Object *object, Vec3 v) {
    __global const float *m = object->object_from_world;
    return vec3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
                m[8] * v.x + m[9] * v.y + m[10] * v.z);
}

INLINE Ray bvh_object_ray(__global const Object *object, Ray ray) {
    Ray object_ray;
    object_ray.origin = bvh_object_point(object, ray.origin);
    object_ray.direction = bvh_object_vector(object, ray.direction);
    return object_ray;
}

INLINE bool bvh_trace_object(const Geometry *geometry, __global const Object *object, Ray ray, const bool any,
                             RawHit *hit) {
    const BvhRay object_ray = bvh_ray(bvh_object_ray(object, ray));
    return bvh_trace_mesh(&object_ray, geometry->nodes + object->first_node,
                          geometry->packs + object->first_pack, any, hit);
}

// Nearest hit of the scene with 0 < t < hit->distance, else object is NO_INDEX; any one of them if `any`,
// which fills nothing in.
INLINE bool bvh_trace(const Geometry *geometry, Ray world_ray, const bool any, RawHit *hit) {
    __global const Node *top_nodes = geometry->top_nodes;
    const BvhRay ray = bvh_ray(world_ray);
    ulong stack[BVH_TOP_STACK_SIZE];
    uint height = 0, reference = 0;
    hit->object = NO_INDEX;
    for (;;) {
        if (!(reference & NODE_LEAF)) {
            float8 entry;
            COUNT_VISIT(hit, visited_nodes);
            const uint lanes = bvh_boxes(&ray, top_nodes + reference, hit->distance, &entry);
            if (lanes) {
                reference = bvh_push(top_nodes + reference, lanes, entry, stack, &height);
                continue;
            }
        } else if (reference & NODE_PACK) {
            float8 distance, weight[3];
            const uint pack = reference & ~(NODE_LEAF | NODE_PACK);
            COUNT_VISIT(hit, visited_packs);
            const uint lanes =
                bvh_triangles(&ray, geometry->top_packs + pack, hit->distance, &distance, weight);
            if (lanes) {
                if (any)
                    return true;
                if (bvh_keep(pack, lanes, distance, weight, hit)) {
                    hit->object = geometry->top_packs[pack].object[FIELD(hit->triangle, PLACE_LANE)];
                    hit->triangle |= NODE_PACK;
                }
            }
        } else {
            __global const Object *object = geometry->objects + (reference & ~NODE_LEAF);
            if (object->visible && bvh_trace_object(geometry, object, world_ray, any, hit)) {
                if (any)
                    return true;
                hit->object = reference & ~NODE_LEAF;
                hit->triangle += IN_FIELD(object->first_pack, PLACE_PACK);
            }
        }
        const ulong limit = bvh_entry(NODE_EMPTY, hit->distance);
        do {
            if (height == 0)
                return hit->object != NO_INDEX;
        } while (stack[--height] > limit);
        reference = (uint)stack[height];
    }
}

// The nearest hit along a ray before `limit`. False, and object NO_INDEX, where the ray meets nothing.
INLINE bool bvh_nearest(const Geometry *geometry, Ray ray, float limit, RawHit *hit) {
    hit->distance = limit;
    return bvh_trace(geometry, ray, false, hit);
}

// Whether a ray meets anything before `limit`.
INLINE bool bvh_any(const Geometry *geometry, Ray ray, float limit) {
    RawHit hit;
    hit.distance = limit;
    return bvh_trace(geometry, ray, true, &hit);
}
