#include "cpu/block.cl"
#include "cpu/lane_triangle.cl"

// Packet traversal: camera rays through the trees, sixteen at a time with one stack, for blocks of paths.
//
// Neighbouring paths start through the same pixel or through pixels next to each other, so that their rays
// meet the same nodes: a packet reads a node once, and tests each of its boxes against all rays in the lanes.
// Where many of the rays enter the box of a pack, its triangles are tested one by one against all rays in the
// lanes; where few do, each of those rays is tested against the eight triangles in the lanes. Rays that have
// been scattered, and those to points of lamps, go different ways too soon.

#if defined(__AVX512DQ__) && defined(__clang__) && !defined(PORTABLE_LANES)
#define PACKETS
#endif

#if defined(PACKETS) && !defined(BRUTE_FORCE_ONLY)
// From so many rays on the triangles of a pack are tested one by one.
#define PACKET_MANY 11u

#define PACKET_ABS(v) as_float16(as_int16(v) & INT_MAX)

// The rays in the space of the tree that they are in; see BvhRay. Their directions have the same signs and
// the same largest component.
typedef struct {
    Slab16 slab[3];
    float16 origin[3], shear[3]; // along the axes of the triangle test
    uint octant, main;
} PacketRays;

typedef struct {
    __global const Node *nodes;
    __global const TrianglePack *packs;
    uint object;         // whose space the rays are in; NO_INDEX: world space
    uint first_triangle; // the place of the first triangle of the tree
} PacketPlace;

typedef struct {
    PacketRays rays, world;   // in the space where they are, and in world space
    float16 limit, weight[3]; // of the nearest hits so far
    uint16 triangle, object;
    uint height;
    uint reference[ONE_STACK_SIZE];
    float16 near[ONE_STACK_SIZE]; // where each ray enters the box of that reference, infinity: nowhere
} Packet;

INLINE uint packet_lanes(const int16 comparison) { return (ushort)__builtin_ia32_cvtd2mask512(comparison); }

INLINE void packet_push(Packet *packet, uint reference) {
    packet->reference[packet->height] = reference;
    packet->near[packet->height] = 0.0f;
    packet->height++;
}

// False where the directions differ in signs or in the largest component.
INLINE bool packet_prepare(PacketRays *rays, const float16 *origin, const float16 *direction) {
    const float16 x = PACKET_ABS(direction[0]), y = PACKET_ABS(direction[1]), z = PACKET_ABS(direction[2]);
    const int16 x_main = (x > y) & (x > z), z_main = ~x_main & ~((y > z) & ~(x > y));
    const int16 sign[3] = {as_int16(direction[0]) < 0, as_int16(direction[1]) < 0,
                           as_int16(direction[2]) < 0};
    const int16 heading =
        (sign[0] & 1) | (sign[1] & 2) | (sign[2] & 4) | (~(x_main | z_main) & 8) | (z_main & 16);
    if (packet_lanes(heading != (int16)(heading.s0)))
        return false;
    rays->octant = (uint)heading.s0 & 7u;
    rays->main = (uint)heading.s0 >> 3;
#pragma unroll
    for (uint i = 0; i < 3; i++)
        rays->slab[i] = slab_of_lanes(origin[i], direction[i]);
    const uint axes[3] = {bvh_x_axis(rays->main), bvh_y_axis(rays->main), rays->main};
    rays->shear[2] = 1.0f / direction[axes[2]];
    rays->shear[0] = direction[axes[0]] * rays->shear[2];
    rays->shear[1] = direction[axes[1]] * rays->shear[2];
#pragma unroll
    for (uint i = 0; i < 3; i++)
        rays->origin[i] = origin[axes[i]];
    return true;
}

// Pushes the children of a node that any ray meets.
INLINE void packet_test_node(Packet *packet, const PacketPlace *place, uint reference) {
    const PacketRays *rays = &packet->rays;
    __global const Node *node = place->nodes + reference;
    const uint order = node->order[rays->octant];
    const uint x = rays->octant & 1u, y = 2u + (rays->octant >> 1 & 1u), z = 4u + (rays->octant >> 2);
    for (uint i = 0; i < BVH_WIDTH; i++) {
        const uint lane = order >> (3 * i) & 7u, child = node->child[lane];
        if (child == NODE_EMPTY)
            continue;
        const float16 near_x = node->bounds[x][lane] * rays->slab[0].inverse + rays->slab[0].near_shift;
        const float16 near_y = node->bounds[y][lane] * rays->slab[1].inverse + rays->slab[1].near_shift;
        const float16 near_z = node->bounds[z][lane] * rays->slab[2].inverse + rays->slab[2].near_shift;
        const float16 far_x = node->bounds[x ^ 1u][lane] * rays->slab[0].inverse + rays->slab[0].far_shift;
        const float16 far_y = node->bounds[y ^ 1u][lane] * rays->slab[1].inverse + rays->slab[1].far_shift;
        const float16 far_z = node->bounds[z ^ 1u][lane] * rays->slab[2].inverse + rays->slab[2].far_shift;
        const float16 near_xy = BVH_MAX8(near_x, near_y), near_z0 = BVH_MAX8(near_z, (float16)(0.0f));
        const float16 far_xy = BVH_MIN8(far_x, far_y), far_z1 = BVH_MIN8(far_z, packet->limit);
        const float16 near = BVH_MAX8(near_xy, near_z0);
        const int16 met = near <= BVH_MIN8(far_xy, far_z1) * (1.0f + BVH_SLACK);
        packet->reference[packet->height] = child;
        packet->near[packet->height] = met ? near : (float16)(INFINITY);
        if (packet_lanes(met)) {
            packet->height++;
            // One packet is under way at a time: without asking early it would wait for memory each time.
            if (place->object != NO_INDEX)
                bvh_prefetch(place->nodes, place->packs, child);
        }
    }
}

// Tests each of the rays in `lanes` against eight triangles at a time.
INLINE void packet_test_pack_by_ray(Packet *packet, const PacketPlace *place, uint index, uint lanes) {
    const PacketRays *rays = &packet->rays;
    __global const TrianglePack *pack = place->packs + index;
    BvhRay ray;
    ray.axis[0] = bvh_x_axis(rays->main) * BVH_PLANE_BYTES;
    ray.axis[1] = bvh_y_axis(rays->main) * BVH_PLANE_BYTES;
    ray.axis[2] = rays->main * BVH_PLANE_BYTES;
    for (; lanes; lanes &= lanes - 1) {
        const uint lane = BVH_FIRST_BIT(lanes);
#pragma unroll
        for (uint i = 0; i < 3; i++) {
            ray.origin[i] = ((const float *)&rays->origin[i])[lane];
            ray.shear[i] = ((const float *)&rays->shear[i])[lane];
        }
        float8 distance, weight[3];
        RawHit hit;
        hit.distance = ((const float *)&packet->limit)[lane];
        const uint met = bvh_triangles(&ray, pack, hit.distance, &distance, weight);
        if (!met || !bvh_keep(index, met, distance, weight, &hit))
            continue;
        ((float *)&packet->limit)[lane] = hit.distance;
        ((uint *)&packet->triangle)[lane] = hit.triangle + place->first_triangle;
        ((uint *)&packet->object)[lane] =
            place->object != NO_INDEX ? place->object : pack->object[FIELD(hit.triangle, PLACE_LANE)];
#pragma unroll
        for (uint i = 0; i < 3; i++)
            ((float *)&packet->weight[i])[lane] = hit.weight[i];
    }
}

// Tests all rays against one triangle of a pack after the other.
INLINE void packet_test_pack(Packet *packet, const PacketPlace *place, uint index) {
    const PacketRays *rays = &packet->rays;
    __global const TrianglePack *pack = place->packs + index;
    const uint axes[3] = {bvh_x_axis(rays->main), bvh_y_axis(rays->main), rays->main};
    for (uint lane = 0; lane < BVH_WIDTH && pack->face[lane] != NO_INDEX; lane++) {
        LaneCorner corner[3];
#pragma unroll
        for (uint i = 0; i < 3; i++)
            corner[i] = lane_corner(pack->vertex[3 * i + axes[0]][lane], pack->vertex[3 * i + axes[1]][lane],
                                    pack->vertex[3 * i + axes[2]][lane], rays->origin, rays->shear);
        const float16 weight[3] = {lane_edge(corner + 1, corner + 2), lane_edge(corner + 2, corner),
                                   lane_edge(corner, corner + 1)};
        const float16 lowest = BVH_MIN8(BVH_MIN8(weight[0], weight[1]), weight[2]);
        const float16 highest = BVH_MAX8(BVH_MAX8(weight[0], weight[1]), weight[2]);
        const int16 inside = (lowest >= 0.0f) | (highest <= 0.0f);
        if (!packet_lanes(inside))
            continue;
        const float16 distance = lane_distance(corner, weight, rays->shear[2]);
        const int16 met = inside & (distance > 0.0f) & (distance < packet->limit);
        lane_keep(met, distance, weight, &packet->limit, packet->weight);
        packet->triangle =
            met ? (uint16)(IN_FIELD(index, PLACE_PACK) + lane + place->first_triangle) : packet->triangle;
        packet->object =
            met ? (uint16)(place->object != NO_INDEX ? place->object : pack->object[lane]) : packet->object;
    }
}

INLINE PacketPlace packet_world(const Geometry *geometry) {
    const PacketPlace place = {geometry->top_nodes, geometry->top_packs, NO_INDEX, NODE_PACK};
    return place;
}

#ifndef TOP_LEVEL_ONLY
INLINE bool packet_enter_object(Packet *packet, PacketPlace *place, const Geometry *geometry,
                                const float16 *origin, const float16 *direction, uint index) {
    __global const Object *object = geometry->objects + index;
    if (!object->visible)
        return true;
    __global const float *m = object->object_from_world;
    float16 p[3], d[3];
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        d[i] = m[4 * i] * direction[0] + m[4 * i + 1] * direction[1] + m[4 * i + 2] * direction[2];
        p[i] = m[4 * i] * origin[0] + m[4 * i + 1] * origin[1] + m[4 * i + 2] * origin[2] + m[4 * i + 3];
    }
    packet->world = packet->rays;
    place->object = index;
    place->nodes = geometry->nodes + object->first_node;
    place->packs = geometry->packs + object->first_pack;
    place->first_triangle = IN_FIELD(object->first_pack, PLACE_PACK);
    packet_push(packet, LEAVE_OBJECT);
    packet_push(packet, 0);
    return packet_prepare(&packet->rays, p, d);
}
#endif

// The nearest hits of the sixteen rays in these planes, before `limit`. False where the rays do not keep
// together; then nothing is found.
INLINE bool packet_trace(Packet *packet, const Geometry *geometry, __local const float *planes) {
    float16 origin[3], direction[3];
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        origin[i] = load_lanes(planes + i * BLOCK_STRIDE);
        direction[i] = load_lanes(planes + (3 + i) * BLOCK_STRIDE);
    }
    packet->object = NO_INDEX;
    packet->height = 0;
    packet_push(packet, 0);
    PacketPlace place = packet_world(geometry);
    if (!packet_prepare(&packet->rays, origin, direction))
        return false;
    while (packet->height > 0) {
        packet->height--;
        const uint lanes = packet_lanes(packet->near[packet->height] <= packet->limit);
        const uint reference = packet->reference[packet->height];
#ifndef TOP_LEVEL_ONLY
        if (reference == LEAVE_OBJECT) {
            packet->rays = packet->world;
            place = packet_world(geometry);
            continue;
        }
#endif
        if (!lanes)
            continue;
        if (!(reference & NODE_LEAF)) {
            packet_test_node(packet, &place, reference);
            continue;
        }
#ifndef TOP_LEVEL_ONLY
        if (place.object == NO_INDEX && !(reference & NODE_PACK)) {
            if (!packet_enter_object(packet, &place, geometry, origin, direction, reference & ~NODE_LEAF))
                return false;
            continue;
        }
#endif
        const uint pack = reference & ~(NODE_LEAF | NODE_PACK);
        if (COUNT_BITS(lanes) < PACKET_MANY)
            packet_test_pack_by_ray(packet, &place, pack, lanes);
        else
            packet_test_pack(packet, &place, pack);
    }
    return true;
}

INLINE void packet_store_plane(__local float *plane, int16 met, float16 value) {
    store_lanes(plane, met ? value : load_lanes(plane));
}

// Stores the hits of sixteen paths from place `path` on. With BRUTE_FORCE there are raw hits already, which
// stay where the trees have nothing nearer.
INLINE void packet_store_hits(const Packet *packet, const Block *block, uint path) {
    __local float *hits = PLANES(block->memory, RAW_HITS) + path;
#ifdef BRUTE_FORCE
    const int16 met = packet->object != NO_INDEX;
#else
    const int16 met = -1;
#endif
    packet_store_plane(hits + RAW_HIT_DISTANCE * BLOCK_STRIDE, met, packet->limit);
    packet_store_plane(hits + RAW_HIT_OBJECT * BLOCK_STRIDE, met, as_float16(packet->object));
    packet_store_plane(hits + RAW_HIT_TRIANGLE * BLOCK_STRIDE, met, as_float16(packet->triangle));
#pragma unroll
    for (uint i = 0; i < 3; i++)
        packet_store_plane(hits + (RAW_HIT_WEIGHT_A + i) * BLOCK_STRIDE, met, packet->weight[i]);
}

// The nearest hits of `count` traced paths, as far as the rays of sixteen neighbours keep together. The
// others come to stand in the list, in order; returns how many they are.
STAGE uint packet_nearest(const Block *block, uint count) {
    __local uint *list = UINT_PLANES(block->memory, LIST);
    Packet packet;
    uint left = 0, first = 0;
    for (; first + LANE_COUNT <= count; first += LANE_COUNT) {
#ifdef BRUTE_FORCE
        packet.limit = load_lanes(PLANES(block->memory, RAW_HITS) + RAW_HIT_DISTANCE * BLOCK_STRIDE + first);
#else
        packet.limit = INFINITY;
#endif
        if (packet_trace(&packet, &block->geometry, block->traced.rays + first)) {
            packet_store_hits(&packet, block, first);
            continue;
        }
        for (uint i = 0; i < LANE_COUNT; i++)
            list[left++] = first + i;
    }
    for (; first < count; first++)
        list[left++] = first;
    return left;
}
#endif
