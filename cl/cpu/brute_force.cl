#include "cpu/lane_triangle.cl"

// Rays against everything in a small top level, for blocks of paths. Where a scene has few objects, the way
// through a tree is a chain of waiting for memory and of wrongly guessed branches; going over all of them
// with sixteen rays in the lanes has neither. Parallelepipeds are tested as boxes in their own coordinates,
// what is left as facets, parallelograms and triangles (facets.py); clusters of them have boxes to pass them
// by.
//
// Rays are sorted by the largest component of their direction, so that the axes of the test are the same for
// all lanes. A parallelogram is tested as a triangle is, by the signs of four edges, so that no ray slips
// through between it and its neighbours.

// Planes of what the sweep finds.
#define FOUND_DISTANCE 0
#define FOUND_WEIGHT 1
#define FOUND_PLACE 4 // of the facet, or FOUND_SIDE and more

// A place with this bit is that of the first of two opposite sides of a parallelepiped, and the weights are
// local coordinates. Above FOUND_AXIS_SHIFT stands the axis along which they are opposite.
#define FOUND_SIDE 0x80000000u
#define FOUND_AXIS_SHIFT 29

typedef struct {
    __global const Quad *quads;
    __global const Parallelepiped *parallelepipeds;
    __global const Cluster *clusters;
    uint cluster_count; // at most 32, of which rays meet the last without asking for its box
} BruteForce;

INLINE bool any_lane(const int16 comparison) {
#ifdef __AVX512DQ__
    return __builtin_ia32_cvtd2mask512(comparison) != 0;
#else
    return (bvh_lanes(comparison.lo) | bvh_lanes(comparison.hi)) != 0;
#endif
}

// Which rays meet a box between 0 and their limit, to be on the safe side; as bvh_boxes tells it of many
// boxes and one ray. `inverse` and the shifts are those of bvh_slab, in the axes of the rays.
INLINE int16 lanes_meet_box(__global const float *bounds, const uint *axes, const float16 *inverse,
                            const float16 *near_shift, const float16 *far_shift, float16 limit) {
    float16 near = 0.0f, far = limit;
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        const float16 a = bounds[2 * axes[i]] * inverse[i], b = bounds[2 * axes[i] + 1] * inverse[i];
        near = BVH_MAX8(BVH_MIN8(a, b) + near_shift[i], near);
        far = BVH_MIN8(BVH_MAX8(a, b) + far_shift[i], far);
    }
    return near <= far * (1.0f + BVH_SLACK);
}

// Sixteen rays in the axes of the test, and the nearest facets that they have met so far.
typedef struct {
    float16 origin[3], direction[3], shear[3];
    float16 limit, weight[3];
    uint16 place;
} RayGroup;

// Tests the rays against a parallelogram, or a triangle. Of both the weights of the corners A, B and C are
// kept: in the other half of a parallelogram that of B is negative. With `any`, that something is met is
// kept.
INLINE void test_quad(RayGroup *group, __global const Quad *quad, uint index, const uint *axes,
                      const bool triangle, const bool any) {
    LaneCorner corner[4];
#pragma unroll
    for (uint i = 0; i < (triangle ? 3 : 4); i++) {
        __global const float *vertex = quad->vertex + 3 * i;
        corner[i] =
            lane_corner(vertex[axes[0]], vertex[axes[1]], vertex[axes[2]], group->origin, group->shear);
    }
    const float16 weight[3] = {lane_edge(corner + 1, corner + 2), lane_edge(corner + 2, corner),
                               lane_edge(corner, corner + 1)};
    float16 lowest = BVH_MIN8(weight[0], weight[2]), highest = BVH_MAX8(weight[0], weight[2]);
    if (triangle) {
        lowest = BVH_MIN8(lowest, weight[1]);
        highest = BVH_MAX8(highest, weight[1]);
    } else {
        const float16 cd = lane_edge(corner + 2, corner + 3), da = lane_edge(corner + 3, corner);
        lowest = BVH_MIN8(lowest, BVH_MIN8(cd, da));
        highest = BVH_MAX8(highest, BVH_MAX8(cd, da));
    }
    // Divided before it is compared: what waits for the facet before is the comparison alone. A determinant
    // of 0 fails one of them.
    const float16 distance = lane_distance(corner, weight, group->shear[2]);
    const int16 met = ((lowest >= 0.0f) | (highest <= 0.0f)) & (distance > 0.0f) & (distance < group->limit);
    group->place = met ? (uint16)(index) : group->place;
    if (!any)
        lane_keep(met, distance, weight, &group->limit, group->weight);
}

// Tests the rays against a parallelepiped, as against a box with slabs (Kay and Kajiya 1986) in its own
// coordinates. Rays that start inside meet the side where they leave.
INLINE void test_parallelepiped(RayGroup *group, __global const Parallelepiped *parallelepiped,
                                const uint *axes, const bool any) {
    float16 away[3], start[3], step[3], entry[3], exit[3];
#pragma unroll
    for (uint i = 0; i < 3; i++)
        away[i] = group->origin[i] - parallelepiped->corner[axes[i]];
#pragma unroll
    for (uint k = 0; k < 3; k++) {
        __global const float *row = parallelepiped->local_from_world + 3 * k;
        start[k] = row[axes[0]] * away[0] + row[axes[1]] * away[1] + row[axes[2]] * away[2];
        step[k] = row[axes[0]] * group->direction[0] + row[axes[1]] * group->direction[1] +
                  row[axes[2]] * group->direction[2];
        // Both as products: along a side, where `inverse` is infinite, a sum would be no number.
        const float16 inverse = 1.0f / step[k];
        const float16 first = -start[k] * inverse, second = (1.0f - start[k]) * inverse;
        entry[k] = BVH_MIN8(first, second);
        exit[k] = BVH_MAX8(first, second);
    }
    const float16 near = BVH_MAX8(BVH_MAX8(entry[0], entry[1]), entry[2]);
    const float16 far = BVH_MIN8(BVH_MIN8(exit[0], exit[1]), exit[2]);
    const int16 inside = near <= 0.0f;
    const float16 distance = inside ? far : near;
    const int16 met = (near <= far) & (distance > 0.0f) & (distance < group->limit);
    if (any) {
        group->place = met ? (uint16)(0) : group->place;
        return;
    }
    const int16 on_first = (inside ? exit[0] : entry[0]) == distance;
    const int16 on_second = (inside ? exit[1] : entry[1]) == distance;
    const uint base = parallelepiped->first_side | FOUND_SIDE;
    uint16 place = on_second ? (uint16)(base + 2u + (1u << FOUND_AXIS_SHIFT))
                             : (uint16)(base + 4u + (2u << FOUND_AXIS_SHIFT));
    place = on_first ? (uint16)(base) : place;
    group->place = met ? place : group->place;
#pragma unroll
    for (uint k = 0; k < 3; k++)
        start[k] += distance * step[k];
    lane_keep(met, distance, start, &group->limit, group->weight);
}

// The clusters, a bit for each, whose boxes some ray of the group meets, and the last.
INLINE uint clusters_met(const BruteForce *brute_force, const RayGroup *group, const uint *axes) {
    float16 inverse[3], near_shift[3], far_shift[3];
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        float16 least = 0.0f;
        inverse[i] = group->shear[2];
        if (i < 2) {
            const int16 sign = as_int16(group->shear[i]) & INT_MIN;
            const int16 zero = as_float16(as_int16(group->shear[i]) ^ sign) < BVH_ZERO;
            inverse[i] /= zero ? as_float16(sign | as_int16((float16)(BVH_ZERO))) : group->shear[i];
            // Without a direction the ray lies between the planes or not; on a plane it counts as between.
            least = zero ? (float16)(BVH_INVERSE_ZERO * 1e-10f) : least;
        }
        const float16 shift = -group->origin[i] * inverse[i];
        const float16 slack = BVH_MAX8(shift, -shift) * BVH_SLACK + least;
        near_shift[i] = shift - slack;
        far_shift[i] = shift + slack;
    }
    const uint last = brute_force->cluster_count - 1;
    uint met = 1u << last;
    for (uint i = 0; i < last; i++)
        met |= (uint)any_lane(lanes_meet_box(brute_force->clusters[i].bounds, axes, inverse, near_shift,
                                             far_shift, group->limit))
               << i;
    return met;
}

// Tests sixteen rays against all facets; `axis` is the largest of their directions. `rays` are planes of
// origins, directions and, with `any`, how far the rays look; what is found comes into the planes `found`,
// with `any` that something is met alone.
INLINE void brute_force_group(const BruteForce *brute_force, __local const float *rays, uint axis,
                              const bool any, __local float *found) {
    const uint axes[3] = {bvh_x_axis(axis), bvh_y_axis(axis), axis};
    RayGroup group;
    group.shear[2] = 1.0f / load_lanes(rays + (3 + axis) * BLOCK_STRIDE);
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        group.origin[i] = load_lanes(rays + axes[i] * BLOCK_STRIDE);
        group.direction[i] = load_lanes(rays + (3 + axes[i]) * BLOCK_STRIDE);
        if (i < 2)
            group.shear[i] = group.direction[i] * group.shear[2];
        group.weight[i] = 0.0f;
    }
    group.limit = any ? load_lanes(rays + 6 * BLOCK_STRIDE) : INFINITY;
    group.place = NO_INDEX;
    for (uint waiting = clusters_met(brute_force, &group, axes); waiting; waiting &= waiting - 1) {
        __global const Cluster *cluster = brute_force->clusters + BVH_FIRST_BIT(waiting);
        for (uint i = cluster->first_parallelepiped; i < cluster->parallelepiped_end; i++)
            test_parallelepiped(&group, brute_force->parallelepipeds + i, axes, any);
        uint i = cluster->first;
        for (; i < cluster->first_triangle; i++)
            test_quad(&group, brute_force->quads + i, i, axes, false, any);
        for (; i < cluster->end; i++)
            test_quad(&group, brute_force->quads + i, i, axes, true, any);
    }
    store_lanes(found + FOUND_PLACE * BLOCK_STRIDE, as_float16(group.place));
    if (any)
        return;
    store_lanes(found + FOUND_DISTANCE * BLOCK_STRIDE, group.limit);
#pragma unroll
    for (uint i = 0; i < 3; i++)
        store_lanes(found + (FOUND_WEIGHT + i) * BLOCK_STRIDE, group.weight[i]);
}

// Up to fifteen more rays than `count` are read, and their places in `found` written: in the planes of a
// block there is room for them.
static __attribute__((noinline)) WIDE void brute_force_nearest(const BruteForce *brute_force,
                                                               __local const float *rays, uint axis,
                                                               uint count, __local float *found) {
    for (uint first = 0; first < count; first += LANE_COUNT)
        brute_force_group(brute_force, rays + first, axis, false, found + first);
}

#ifdef LIGHT_SAMPLING
static __attribute__((noinline)) WIDE void brute_force_any(const BruteForce *brute_force,
                                                           __local const float *rays, uint axis, uint count,
                                                           __local float *found) {
    for (uint first = 0; first < count; first += LANE_COUNT)
        brute_force_group(brute_force, rays + first, axis, true, found + first);
}
#endif
