#include "cpu/block.cl"
#include "cpu/lane_triangle.cl"

// Brute force: rays against everything in a small top level, for blocks of paths. Where a scene has few
// objects, the way through a tree is a chain of waiting for memory and of wrongly guessed branches; testing
// all of them with sixteen rays in the lanes has neither. Parallelepipeds are tested as boxes in their own
// coordinates, other triangles as quads: parallelograms where two of them make one up, single triangles
// elsewhere (accel/quads.py). Clusters of them have boxes, so that rays pass by those that they cannot meet.
//
// Rays are sorted by the largest component of their direction, so that the axes of the test are the same for
// all lanes. A parallelogram is tested as a triangle is, by the signs of four edges, so that no ray slips
// through between it and its neighbours.

// Planes of what brute force finds.
#define FOUND_DISTANCE 0
#define FOUND_WEIGHT 1 // three planes
#define FOUND_PLACE 4  // the index of the quad, or as FOUND_SIDE says; 0 where nothing is met

// The place of a hit with a parallelepiped has the index of one of two opposite sides, the bit FOUND_SIDE,
// and the axis of the local coordinates along which the two are opposite. The weights are local coordinates
// then, which tell the two sides apart.
#define FOUND_SIDE 0x80000000u
#define FOUND_AXIS_SHIFT 29u
#define FOUND_AXIS_MASK 3u
#define FOUND_INDEX_SHIFT 0u
#define FOUND_INDEX_MASK 0x1fffffffu

INLINE bool any_lane(const int16 comparison) {
#ifdef __AVX512DQ__
    return __builtin_ia32_cvtd2mask512(comparison) != 0;
#else
    return (lane_bits(comparison.lo) | lane_bits(comparison.hi)) != 0;
#endif
}

// Which rays meet a box between 0 and their limit, erring on the side of a hit. `slab` has the axes of the
// rays.
INLINE int16 lanes_meet_box(__global const float *bounds, const uint *axes, const Slab16 *slab,
                            float16 limit) {
    float16 near = 0.0f, far = limit;
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        const float16 a = bounds[2 * axes[i]] * slab[i].inverse,
                      b = bounds[2 * axes[i] + 1] * slab[i].inverse;
        near = BVH_MAX8(BVH_MIN8(a, b) + slab[i].near_shift, near);
        far = BVH_MIN8(BVH_MAX8(a, b) + slab[i].far_shift, far);
    }
    return near <= far * (1.0f + BVH_SLACK);
}

// Sixteen rays in the axes of the test, and the nearest of what they have met so far.
typedef struct {
    float16 origin[3], direction[3], shear[3];
    float16 limit, weight[3];
    uint16 place;
} RayGroup;

// Tests the rays against a quad, a parallelogram or a triangle. The weights of the corners A, B and C are
// kept; in the half ACD of a parallelogram that of B is negative. With `any` only the fact that something is
// met is kept.
//
// The distance follows from how far the ray starts from the plane, and not from the distances of the corners:
// near a large quad its sign would be left to rounding errors; see bvh_starts_before.
INLINE void test_quad(RayGroup *group, __global const Quad *quad, uint index, const uint *axes,
                      const bool triangle, const bool any) {
    LaneCorner corner[4];
#pragma unroll
    for (uint i = 0; i < (triangle ? 3 : 4); i++) {
        __global const float *vertex = quad->vertex + 3 * i;
        corner[i] =
            lane_corner(vertex[axes[0]], vertex[axes[1]], vertex[axes[2]], group->origin, group->shear);
    }
    float16 height = 0.0f;
#pragma unroll
    for (uint i = 0; i < 3; i++)
        height += quad->normal[axes[i]] * (quad->vertex[axes[i]] - group->origin[i]);
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
    // The division comes before the comparison, so that only the comparison has to wait for the limit that
    // the quad before has left. A determinant of 0 fails one of the comparisons.
    const float16 distance = height * group->shear[2] / (weight[0] + weight[1] + weight[2]);
    const int16 met = ((lowest >= 0.0f) | (highest <= 0.0f)) & (distance > 0.0f) & (distance < group->limit);
    group->place = met ? (uint16)(index) : group->place;
    if (!any)
        lane_keep(met, distance, weight, &group->limit, group->weight);
}

// Tests the rays against a parallelepiped, as against a box with slabs (Kay and Kajiya 1986) in its own
// coordinates. Rays that start inside meet the side where they leave.
INLINE void test_parallelepiped(RayGroup *group, __global const Parallelepiped *parallelepiped,
                                const uint *axes, const bool any) {
    float16 away[3], left[3], start[3], step[3], entry[3], exit[3];
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        away[i] = group->origin[i] - parallelepiped->corner[axes[i]];
        left[i] = parallelepiped->opposite[axes[i]] - group->origin[i];
    }
#pragma unroll
    for (uint k = 0; k < 3; k++) {
        __global const float *row = parallelepiped->local_from_world + 3 * k;
        start[k] = row[axes[0]] * away[0] + row[axes[1]] * away[1] + row[axes[2]] * away[2];
        // What is left up to 1, from the corner that lies there, so that rounding errors near that side do
        // not grow with the size of the whole.
        const float16 end = row[axes[0]] * left[0] + row[axes[1]] * left[1] + row[axes[2]] * left[2];
        step[k] = row[axes[0]] * group->direction[0] + row[axes[1]] * group->direction[1] +
                  row[axes[2]] * group->direction[2];
        // Both are products, because a ray along a side has an infinite `inverse`, from which a sum would
        // make NaN.
        const float16 inverse = 1.0f / step[k];
        const float16 first = -start[k] * inverse, second = end * inverse;
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

// The clusters whose boxes some ray of the group meets, a bit for each. The last one is always among them.
INLINE uint clusters_met(const BruteForce *brute_force, const RayGroup *group, const uint *axes) {
    Slab16 slab[3];
#pragma unroll
    for (uint i = 0; i < 2; i++)
        slab[i] = slab_of_lanes(group->origin[i], group->direction[i]);
    // Along the largest component of the direction the reciprocal is known.
    slab[2] = slab_of_lanes_by_inverse(group->origin[2], group->shear[2], 0.0f);
    const uint last = brute_force->cluster_count - 1;
    uint met = 1u << last;
    for (uint i = 0; i < last; i++)
        met |= (uint)any_lane(lanes_meet_box(brute_force->clusters[i].bounds, axes, slab, group->limit)) << i;
    return met;
}

// Tests sixteen rays against everything; `axis` is the largest component of their directions. `rays` are
// planes of origins and directions. The nearest hits come into the planes `found`. With `any` the rays look
// as far as `limits`, and only the places of what they meet come into the plane `occluders`.
INLINE void brute_force_group(const BruteForce *brute_force, __local const float *rays, uint axis,
                              const bool any, __local const float *limits, __local float *found,
                              __local float *occluders) {
    const uint axes[3] = {bvh_x_axis(axis), bvh_y_axis(axis), axis};
    RayGroup group;
    group.shear[2] = BVH_RECIPROCAL(load_lanes(rays + (3 + axis) * BLOCK_STRIDE), as_float16, as_int16);
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        group.origin[i] = load_lanes(rays + axes[i] * BLOCK_STRIDE);
        group.direction[i] = load_lanes(rays + (3 + axes[i]) * BLOCK_STRIDE);
        if (i < 2)
            group.shear[i] = group.direction[i] * group.shear[2];
        group.weight[i] = 0.0f;
    }
    group.limit = any ? load_lanes(limits) : INFINITY;
    group.place = any ? NO_INDEX : 0u;
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
    if (any) {
        store_lanes(occluders, as_float16(group.place));
        return;
    }
    store_lanes(found + FOUND_PLACE * BLOCK_STRIDE, as_float16(group.place));
    store_lanes(found + FOUND_DISTANCE * BLOCK_STRIDE, group.limit);
#pragma unroll
    for (uint i = 0; i < 3; i++)
        store_lanes(found + (FOUND_WEIGHT + i) * BLOCK_STRIDE, group.weight[i]);
}

// Loops over sixteen rays read up to fifteen more than there are, and write their places; the planes of a
// block have room for them.
STAGE void brute_force_kind(const Block *block, uint first, uint axis, uint count) {
    __local const float *rays = block->traced.rays + first;
    __local float *found = PLANES(block->memory, FOUND) + first;
    for (uint i = 0; i < count; i += LANE_COUNT)
        brute_force_group(&block->brute_force, rays + i, axis, false, 0, found + i, 0);
}

// Weights of the corners A, B and C of a side of a parallelepiped, of a point with these local coordinates.
INLINE Vec3 side_weights(uint turns, Vec3 point) {
    float to_b = component(point, FIELD(turns, TURNS_AXIS_B));
    float to_d = component(point, FIELD(turns, TURNS_AXIS_D));
    to_b = FIELD(turns, TURNS_BACK_B) ? 1.0f - to_b : to_b;
    to_d = FIELD(turns, TURNS_BACK_D) ? 1.0f - to_d : to_d;
    return vec3(1.0f - to_b, to_b - to_d, to_d);
}

// The hit with a triangle that brute force has found for a path. Of a parallelogram ABCD it leaves the
// weights of A, B and C. In the half ACD that of B has the other sign than the sum of the others; B is A + C
// - D, so that the weights of A, C and D follow.
INLINE RawHit found_hit(const BruteForce *brute_force, __local const float *found, uint path) {
    uint place = load_bits(found, FOUND_PLACE * BLOCK_STRIDE + path);
    Vec3 weight = load3(found + FOUND_WEIGHT * BLOCK_STRIDE, BLOCK_STRIDE, path);
    float distance = found[FOUND_DISTANCE * BLOCK_STRIDE + path];
    int met = distance < INFINITY;
    int side = (place & FOUND_SIDE) != 0u;
    uint index = FIELD(place, FOUND_INDEX);
    int opposite = side & (component(weight, FIELD(place, FOUND_AXIS)) > 0.5f);
    index += opposite ? 1u : 0u;
    __global const Quad *quad = brute_force->quads + index;
    uint turns = quad->turns;
    weight = select(side, side_weights(turns, weight), weight);
    float others = weight.x + weight.z;
    int second = ((weight.y < 0.0f) & (others > 0.0f)) | ((weight.y > 0.0f) & (others < 0.0f));
    weight = select(second, vec3(weight.x + weight.y, weight.z + weight.y, -weight.y), weight);
    uint triangle = second ? quad->place[1] : quad->place[0];
    uint corner = second ? FIELD(turns, TURNS_SECOND) : FIELD(turns, TURNS_FIRST);
    Vec3 turned = select(corner == 1u, vec3(weight.z, weight.x, weight.y), weight);
    turned = select(corner == 2u, vec3(weight.y, weight.z, weight.x), turned);
    RawHit hit;
    hit.distance = distance;
    hit.object = met ? quad->object : NO_INDEX;
    hit.triangle = met ? triangle : NO_INDEX;
    hit.weight[0] = turned.x;
    hit.weight[1] = turned.y;
    hit.weight[2] = turned.z;
    return hit;
}

// The nearest hits of the rays of `count` traced paths, which stand in the order of these kinds.
STAGE void brute_force_nearest(const Block *block, uint count, const Subset *kinds) {
    uint first = 0;
    for (uint axis = 0; axis < 3; axis++) {
        brute_force_kind(block, first, axis, kinds[axis].count);
        first += kinds[axis].count;
    }
    __local const float *found = PLANES(block->memory, FOUND);
    LANES
    for (int i = 0; i < (int)count; i++) {
        RawHit hit = found_hit(&block->brute_force, found, i);
        store_raw_hit(block, i, &hit);
    }
}

#ifdef LIGHT_SAMPLING
// Fills the plane of occluders for `count` shadow rays that have come together.
STAGE void brute_force_occluders(const Block *block, uint axis, uint count) {
    __local const float *rays = PLANES(block->memory, OCCLUSION_RAYS);
    __local const float *limits = rays + SHADOW_DISTANCE * BLOCK_STRIDE;
    __local float *occluders = PLANES(block->memory, OCCLUDERS);
    for (uint i = 0; i < count; i += LANE_COUNT)
        brute_force_group(&block->brute_force, rays + i, axis, true, limits + i, 0, occluders + i);
}

// Adds the radiance of a shadow ray that nothing is in the way of.
INLINE void accumulate_unoccluded(const Block *block, uint i) {
    __local const float *rays = PLANES(block->memory, OCCLUSION_RAYS);
    int free = UINT_PLANES(block->memory, OCCLUDERS)[i] == NO_INDEX;
    Vec3 light = load3(rays + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, i);
    accumulate(&block->state, UINT_PLANES(block->memory, OCCLUSION_RESULTS)[i],
               select(free, light, vec3(0.0f, 0.0f, 0.0f)));
}

// The shadow rays of `count` paths against what is tested without a tree. Returns how many of them nothing is
// in the way of; their paths stand in the list then. With BRUTE_FORCE_ONLY there is nothing else that could
// be in the way, so that their radiance is added and none is listed.
STAGE uint brute_force_any(const Block *block, uint count) {
    Subset kinds[RAY_KINDS];
    const State *state = &block->state;
    __local float *rays = PLANES(block->memory, OCCLUSION_RAYS);
    uint free = 0;
    subsets_by_kind(block, state, state->shadows, CLASS_SHADOW, count, kinds);
    for (uint axis = 0; axis < 3; axis++) {
        const Subset *subset = &kinds[axis];
        for (uint p = 0; p <= SHADOW_RADIANCE_B; p++)
            compact_plane(rays + p * BLOCK_STRIDE, state->shadows + p * BLOCK_STRIDE, subset);
        brute_force_occluders(block, axis, subset->count);
#ifdef BRUTE_FORCE_ONLY
        compact_plane(PLANES(block->memory, OCCLUSION_RESULTS), state->paths + PATH_RESULT * BLOCK_STRIDE,
                      subset);
        LANES
        for (int i = 0; i < (int)subset->count; i++)
            accumulate_unoccluded(block, i);
#else
        __local float *places = PLANES(block->memory, OCCLUSION_PATHS);
        list_subset((__local uint *)places, subset, 0);
        const Subset unmet = subset_where(UINT_PLANES(block->memory, OCCLUDERS), NO_INDEX, subset->count,
                                          UINT_PLANES(block->memory, SUBSETS) + 3 * BLOCK_STRIDE);
        compact_plane(PLANES(block->memory, LIST) + free, places, &unmet);
        free += unmet.count;
#endif
    }
    return free;
}
#endif
