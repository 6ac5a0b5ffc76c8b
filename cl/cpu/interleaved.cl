#include "accel/bvh.cl"
#include "path/state.cl"

// Rays on their way through the trees, several at a time in one thread, for blocks of paths.
//
// The way of one ray is a chain: the next node is known only when the boxes of this one are tested, and most
// of the time is spent waiting for that, for memory, or for a branch that was guessed wrong to be told so. A
// few rays that take turns, a node or pack each, keep the processor busy meanwhile. For that a ray's turn
// must end without a branch on what was just computed: it begins with one instead, on what is known since the
// turn before. Only a pack ends with one, whether anything in it is met, which is slower without.
//
//   turn: take the nearest child from the stack; test its boxes or triangles; push the boxes that are met
//
// So children are not sorted by distance, which is a branch or a chain, but pushed in an order that the node
// knows for the octant of the direction (Fuetterling, Lojewski, Pfreundt, Hamann and Ebert 2017, "Accelerated
// Single Ray Tracing for Wide Vector Units"); those that the ray does not meet are left out by compression.

// Of a large mesh a few more than the processor can follow, so that memory has answered when a ray's turn
// comes.
#ifdef ALL_ON_TOP
#define FLIGHTS 4
#else
#define FLIGHTS 16
#endif
// Eight more, because all children are written and the stack grows by those that are met.
#define FLIGHT_STACK_SIZE (BVH_TOP_STACK_SIZE + BVH_STACK_SIZE + 1 + BVH_WIDTH)
// On the stack below the tree of an object: the ray leaves its space there.
#define FLIGHT_LEAVES NODE_EMPTY

// Planes of rays that are ready to start, made in SIMD lanes.
#define FLIGHT_INVERSE 0
#define FLIGHT_NEAR_SHIFT 3
#define FLIGHT_FAR_SHIFT 6
#define FLIGHT_SHEAR 9
#define FLIGHT_HEADING 12 // octant in three bits, above them the largest component

// A ray in the space of the tree that it is in, and that tree.
typedef struct {
    BvhRay ray;
    __global const Node *nodes;
    __global const TrianglePack *packs;
    uint octant;         // bit i: the direction is negative along axis i
    uint first_triangle; // of the tree, as HIT_TRIANGLE counts
} FlightSpace;

typedef struct {
    FlightSpace in;
    uint object; // in whose space it is; NO_INDEX: in the world's
    uint path;
    uint height;
    BvhHit hit; // the nearest so far
    uint reference[FLIGHT_STACK_SIZE];
    float distance[FLIGHT_STACK_SIZE]; // of the box of that reference
#ifndef ALL_ON_TOP
    FlightSpace world; // to come back to
#endif
} Flight;

INLINE void flight_push(Flight *flight, uint reference, float distance) {
    flight->reference[flight->height] = reference;
    flight->distance[flight->height] = distance;
    flight->height++;
}

INLINE Vec3 flight_origin(STATE const float *rays, uint path) { return load3(rays, BLOCK_STRIDE, path); }
INLINE Vec3 flight_direction(STATE const float *rays, uint path) {
    return load3(rays + 3 * BLOCK_STRIDE, BLOCK_STRIDE, path);
}

INLINE void flight_prepare_axis(__local float *ready, float origin, float direction) {
    const BvhSlab slab = bvh_slab(origin, direction);
    ready[FLIGHT_INVERSE * BLOCK_STRIDE] = slab.inverse;
    ready[FLIGHT_NEAR_SHIFT * BLOCK_STRIDE] = slab.near_shift;
    ready[FLIGHT_FAR_SHIFT * BLOCK_STRIDE] = slab.far_shift;
}

INLINE void flight_prepare(__local float *ready, STATE const float *rays, uint path) {
    const Vec3 origin = flight_origin(rays, path), direction = flight_direction(rays, path);
    const uint main = bvh_main_axis(direction);
    const float inverse = 1.0f / bvh_component(direction, main);
    flight_prepare_axis(ready + path, origin.x, direction.x);
    flight_prepare_axis(ready + BLOCK_STRIDE + path, origin.y, direction.y);
    flight_prepare_axis(ready + 2 * BLOCK_STRIDE + path, origin.z, direction.z);
    store3(ready + FLIGHT_SHEAR * BLOCK_STRIDE, BLOCK_STRIDE, path,
           vec3(bvh_component(direction, bvh_x_axis(main)) * inverse,
                bvh_component(direction, bvh_y_axis(main)) * inverse, inverse));
    store_bits(ready, FLIGHT_HEADING * BLOCK_STRIDE + path, bvh_octant(direction) | main << 3);
}

INLINE void flight_start(Flight *flight, const Geometry *geometry, __local const float *ready,
                         STATE const float *rays, uint path, float limit) {
    const uint heading = as_uint(ready[FLIGHT_HEADING * BLOCK_STRIDE + path]);
    const uint main = heading >> 3;
    BvhRay *ray = &flight->in.ray;
    bvh_point(ray, heading & 7u, main);
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        ray->slab[i].inverse = ready[(FLIGHT_INVERSE + i) * BLOCK_STRIDE + path];
        ray->slab[i].near_shift = ready[(FLIGHT_NEAR_SHIFT + i) * BLOCK_STRIDE + path];
        ray->slab[i].far_shift = ready[(FLIGHT_FAR_SHIFT + i) * BLOCK_STRIDE + path];
        ray->shear[i] = ready[(FLIGHT_SHEAR + i) * BLOCK_STRIDE + path];
    }
    ray->origin[0] = rays[bvh_x_axis(main) * BLOCK_STRIDE + path];
    ray->origin[1] = rays[bvh_y_axis(main) * BLOCK_STRIDE + path];
    ray->origin[2] = rays[main * BLOCK_STRIDE + path];
    flight->in.octant = heading & 7u;
    flight->in.nodes = geometry->top_nodes;
    flight->in.packs = geometry->top_packs;
    flight->in.first_triangle = NODE_PACK;
    flight->object = NO_INDEX;
    flight->path = path;
    flight->hit.distance = limit;
    flight->hit.object = NO_INDEX;
    flight->height = 0;
    flight_push(flight, 0, 0.0f);
}

#ifndef ALL_ON_TOP
INLINE void flight_into_object(Flight *flight, const Geometry *geometry, STATE const float *rays,
                               uint index) {
    __global const Object *object = geometry->objects + index;
    if (!object->visible)
        return;
    flight->world = flight->in;
    const Vec3 direction = bvh_object_vector(object, flight_direction(rays, flight->path));
    flight->in.ray = bvh_ray(bvh_object_point(object, flight_origin(rays, flight->path)), direction);
    flight->in.octant = bvh_octant(direction);
    flight->in.nodes = geometry->nodes + object->first_node;
    flight->in.packs = geometry->packs + object->first_pack;
    flight->in.first_triangle = object->first_pack * BVH_WIDTH;
    flight->object = index;
    flight_push(flight, FLIGHT_LEAVES, 0.0f);
    flight_push(flight, 0, 0.0f);
}
#endif

// Pushes the children of a node that are met (`near` <= `far`), in its order for the octant. With `any` their
// distances are not needed: see flight_turn.
INLINE void flight_push_children(Flight *flight, __global const Node *node, const float8 near,
                                 const float8 far, const bool any) {
    const uint order = node->order[flight->in.octant];
    uint *references = flight->reference + flight->height;
    float *distances = flight->distance + flight->height;
#if defined(__AVX512VL__) && defined(__clang__) && !defined(PORTABLE_LANES)
    typedef int8 UnalignedInt __attribute__((aligned(4)));
    typedef float8 UnalignedFloat __attribute__((aligned(4)));
    const int8 places = (int8)((int)order) >> (int8)(0, 3, 6, 9, 12, 15, 18, 21); // of which 3 bits count
    const float8 sorted = __builtin_ia32_permvarsf256(near, places);
    const int8 children = __builtin_ia32_permvarsi256(*(__global const int8 *)node->child, places);
    const uchar met =
        __builtin_ia32_cmpps256_mask(sorted, __builtin_ia32_permvarsf256(far, places), 2 /* <= */, 0xff);
    *(UnalignedInt *)references = __builtin_ia32_compresssi256_mask(children, children, met);
    if (!any)
        *(UnalignedFloat *)distances = __builtin_ia32_compresssf256_mask(sorted, sorted, met);
    flight->height += BVH_COUNT_BITS((uint)met);
#else
    const uint met = bvh_lanes(near <= far);
    const float *all = (const float *)&near;
    uint count = 0;
#pragma unroll
    for (uint i = 0; i < BVH_WIDTH; i++) {
        const uint lane = (order >> (3 * i)) & 7;
        references[count] = node->child[lane];
        distances[count] = all[lane];
        count += (met >> lane) & 1;
    }
    flight->height += count;
#endif
}

INLINE void flight_through_node(Flight *flight, uint reference, const bool any) {
    __global const Node *node = flight->in.nodes + reference;
    float8 near, far;
    bvh_box_distances(&flight->in.ray, node, flight->hit.distance, &near, &far);
    flight_push_children(flight, node, near, far, any);
}

// Whether the ray has met a triangle of a pack; it keeps the nearest, unless `any` will do.
INLINE bool flight_through_pack(Flight *flight, uint pack, const bool any) {
    float8 distance, weight[3];
    const uint lanes =
        bvh_triangles(&flight->in.ray, flight->in.packs + pack, flight->hit.distance, &distance, weight);
    if (!lanes)
        return false;
    if (!any && bvh_keep(pack, lanes, distance, weight, &flight->hit)) {
        flight->hit.object = flight->object != NO_INDEX
                                 ? flight->object
                                 : flight->in.packs[pack].object[flight->hit.triangle % BVH_WIDTH];
        flight->hit.triangle += flight->in.first_triangle;
    }
    return true;
}

// What comes next lies in memory that is slow to answer, if the mesh is large; it is asked for a round early.
INLINE void flight_look_ahead(const Flight *flight) {
#ifndef ALL_ON_TOP
    if (flight->object != NO_INDEX)
        bvh_prefetch(flight->in.nodes, flight->in.packs,
                     flight->height > 0 ? flight->reference[flight->height - 1] : 0);
#endif
}

// One node or pack more. With `any` the limit stays what it was when a box was met, so that it is not
// compared again. False when the ray is done: there is nothing left, or, with `any`, something is met.
INLINE bool flight_turn(Flight *flight, const Geometry *geometry, STATE const float *rays, const bool any) {
    do {
        if (flight->height == 0)
            return false;
        flight->height--;
    } while (!any && flight->distance[flight->height] > flight->hit.distance);
    const uint reference = flight->reference[flight->height];
    if (!(reference & NODE_LEAF)) {
        flight_through_node(flight, reference, any);
        flight_look_ahead(flight);
        return true;
    }
#ifndef ALL_ON_TOP
    if (reference == FLIGHT_LEAVES) {
        flight->in = flight->world;
        flight->object = NO_INDEX;
        return true;
    }
    if (flight->object == NO_INDEX && !(reference & NODE_PACK)) {
        flight_into_object(flight, geometry, rays, reference & ~NODE_LEAF);
        return true;
    }
#endif
    const bool met = flight_through_pack(flight, reference & ~(NODE_LEAF | NODE_PACK), any);
    if (any && met)
        flight->hit.object = 0; // whichever
    flight_look_ahead(flight);
    return !(any && met);
}

// Leaves what a ray has met in the planes of hits, as far as `describe_path` needs it. With FEW_ON_TOP a hit
// with a triangle of the top level is there already, and stays where nothing is nearer.
INLINE void flight_keep(const Flight *flight, const State *state) {
    STATE float *hits = state->hits + flight->path;
    const BvhHit *hit = &flight->hit;
#ifdef FEW_ON_TOP
    if (hit->object == NO_INDEX)
        return;
#endif
    hits[HIT_DISTANCE * BLOCK_STRIDE] = hit->distance;
    hits[HIT_OBJECT * BLOCK_STRIDE] = as_float(hit->object);
    hits[HIT_TRIANGLE * BLOCK_STRIDE] = as_float(hit->triangle);
#pragma unroll
    for (uint i = 0; i < 3; i++)
        hits[(HIT_POSITION_X + i) * BLOCK_STRIDE] = hit->weight[i];
}

// Adds the radiance of a shadow ray that nothing is in the way of.
INLINE void flight_bring(const Flight *flight, const State *state) {
    if (flight->hit.object == NO_INDEX)
        gather(state, load_bits(state->paths, PATH_RESULT * BLOCK_STRIDE + flight->path),
               load3(state->shadows + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, flight->path));
}

INLINE float flight_limit(const State *state, uint path, const bool any) {
    if (any)
        return state->shadows[SHADOW_DISTANCE * BLOCK_STRIDE + path];
#ifdef FEW_ON_TOP
    return state->hits[HIT_DISTANCE * BLOCK_STRIDE + path];
#else
    return INFINITY;
#endif
}

// The rays of the `count` paths in `list`: their nearest hits, or, with `any`, what their shadow rays bring.
INLINE void fly(const Geometry *geometry, const State *state, __local const float *ready,
                __local const uint *list, uint count, const bool any) {
    STATE const float *rays = any ? state->shadows : state->rays;
    Flight flights[FLIGHTS];
    Flight *order[FLIGHTS]; // those under way in front
    uint started = 0, under_way = 0;
    for (; under_way < FLIGHTS && started < count; under_way++, started++) {
        order[under_way] = flights + under_way;
        flight_start(flights + under_way, geometry, ready, rays, list[started],
                     flight_limit(state, list[started], any));
    }
    while (under_way > 0) {
        for (uint i = 0; i < under_way; i++) {
            Flight *flight = order[i];
            if (flight_turn(flight, geometry, rays, any))
                continue;
            if (any)
                flight_bring(flight, state);
            else
                flight_keep(flight, state);
            if (started == count) {
                order[i] = order[--under_way];
                continue;
            }
            flight_start(flight, geometry, ready, rays, list[started],
                         flight_limit(state, list[started], any));
            started++;
        }
    }
}

// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
static __attribute__((noinline)) void fly_to_nearest(const Geometry *geometry, const State *state,
                                                     __local const float *ready, __local const uint *list,
                                                     uint count) {
    fly(geometry, state, ready, list, count, false);
}

#ifdef LIGHT_SAMPLING
static __attribute__((noinline)) void fly_to_lights(const Geometry *geometry, const State *state,
                                                    __local const float *ready, __local const uint *list,
                                                    uint count) {
    fly(geometry, state, ready, list, count, true);
}
#endif
