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
#ifdef TOP_LEVEL_ONLY
#define INTERLEAVED_RAYS 4
#else
#define INTERLEAVED_RAYS 16
#endif
// Eight more, because all children are written and the stack grows by those that are met.
#define INTERLEAVED_STACK_SIZE (BVH_TOP_STACK_SIZE + BVH_STACK_SIZE + 1 + BVH_WIDTH)
// On the stack below the tree of an object: the ray leaves its space there.
#define LEAVE_OBJECT NODE_EMPTY

// Planes of rays that are ready to start, made in SIMD lanes.
#define PREPARED_INVERSE 0
#define PREPARED_NEAR_SHIFT 3
#define PREPARED_FAR_SHIFT 6
#define PREPARED_SHEAR 9
#define PREPARED_HEADING 12 // octant in three bits, above them the largest component

// A ray in the space of the tree that it is in, and that tree.
typedef struct {
    BvhRay prepared;
    __global const Node *nodes;
    __global const TrianglePack *packs;
    uint octant;         // bit i: the direction is negative along axis i
    uint first_triangle; // of the tree, as HIT_TRIANGLE counts
} RaySpace;

typedef struct {
    RaySpace in;
    uint object; // in whose space it is; NO_INDEX: in the world's
    uint path;
    uint height;
    BvhHit hit; // the nearest so far
    uint reference[INTERLEAVED_STACK_SIZE];
    float distance[INTERLEAVED_STACK_SIZE]; // of the box of that reference
#ifndef TOP_LEVEL_ONLY
    RaySpace world; // to come back to
#endif
} InterleavedRay;

INLINE void interleaved_push(InterleavedRay *ray, uint reference, float distance) {
    ray->reference[ray->height] = reference;
    ray->distance[ray->height] = distance;
    ray->height++;
}

INLINE Vec3 plane_origin(STATE const float *rays, uint path) { return load3(rays, BLOCK_STRIDE, path); }
INLINE Vec3 plane_direction(STATE const float *rays, uint path) {
    return load3(rays + 3 * BLOCK_STRIDE, BLOCK_STRIDE, path);
}

INLINE void prepare_axis(__local float *ready, float origin, float direction) {
    const BvhSlab slab = bvh_slab(origin, direction);
    ready[PREPARED_INVERSE * BLOCK_STRIDE] = slab.inverse;
    ready[PREPARED_NEAR_SHIFT * BLOCK_STRIDE] = slab.near_shift;
    ready[PREPARED_FAR_SHIFT * BLOCK_STRIDE] = slab.far_shift;
}

INLINE void prepare_ray(__local float *ready, STATE const float *rays, uint path) {
    const Vec3 origin = plane_origin(rays, path), direction = plane_direction(rays, path);
    const uint main = bvh_main_axis(direction);
    const float inverse = 1.0f / bvh_component(direction, main);
    prepare_axis(ready + path, origin.x, direction.x);
    prepare_axis(ready + BLOCK_STRIDE + path, origin.y, direction.y);
    prepare_axis(ready + 2 * BLOCK_STRIDE + path, origin.z, direction.z);
    store3(ready + PREPARED_SHEAR * BLOCK_STRIDE, BLOCK_STRIDE, path,
           vec3(bvh_component(direction, bvh_x_axis(main)) * inverse,
                bvh_component(direction, bvh_y_axis(main)) * inverse, inverse));
    store_bits(ready, PREPARED_HEADING * BLOCK_STRIDE + path, bvh_octant(direction) | main << 3);
}

INLINE void interleaved_start(InterleavedRay *ray, const Geometry *geometry, __local const float *ready,
                              STATE const float *rays, uint path, float limit) {
    const uint heading = as_uint(ready[PREPARED_HEADING * BLOCK_STRIDE + path]);
    const uint main = heading >> 3;
    BvhRay *prepared = &ray->in.prepared;
    bvh_point(prepared, heading & 7u, main);
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        prepared->slab[i].inverse = ready[(PREPARED_INVERSE + i) * BLOCK_STRIDE + path];
        prepared->slab[i].near_shift = ready[(PREPARED_NEAR_SHIFT + i) * BLOCK_STRIDE + path];
        prepared->slab[i].far_shift = ready[(PREPARED_FAR_SHIFT + i) * BLOCK_STRIDE + path];
        prepared->shear[i] = ready[(PREPARED_SHEAR + i) * BLOCK_STRIDE + path];
    }
    prepared->origin[0] = rays[bvh_x_axis(main) * BLOCK_STRIDE + path];
    prepared->origin[1] = rays[bvh_y_axis(main) * BLOCK_STRIDE + path];
    prepared->origin[2] = rays[main * BLOCK_STRIDE + path];
    ray->in.octant = heading & 7u;
    ray->in.nodes = geometry->top_nodes;
    ray->in.packs = geometry->top_packs;
    ray->in.first_triangle = NODE_PACK;
    ray->object = NO_INDEX;
    ray->path = path;
    ray->hit.distance = limit;
    ray->hit.object = NO_INDEX;
    ray->height = 0;
    interleaved_push(ray, 0, 0.0f);
}

#ifndef TOP_LEVEL_ONLY
INLINE void interleaved_enter_object(InterleavedRay *ray, const Geometry *geometry, STATE const float *rays,
                                     uint index) {
    __global const Object *object = geometry->objects + index;
    if (!object->visible)
        return;
    ray->world = ray->in;
    const Vec3 direction = bvh_object_vector(object, plane_direction(rays, ray->path));
    ray->in.prepared = bvh_ray(bvh_object_point(object, plane_origin(rays, ray->path)), direction);
    ray->in.octant = bvh_octant(direction);
    ray->in.nodes = geometry->nodes + object->first_node;
    ray->in.packs = geometry->packs + object->first_pack;
    ray->in.first_triangle = object->first_pack * BVH_WIDTH;
    ray->object = index;
    interleaved_push(ray, LEAVE_OBJECT, 0.0f);
    interleaved_push(ray, 0, 0.0f);
}
#endif

// Pushes the children of a node that are met (`near` <= `far`), in its order for the octant. With `any` their
// distances are not needed: see interleaved_turn.
INLINE void interleaved_push_children(InterleavedRay *ray, __global const Node *node, const float8 near,
                                      const float8 far, const bool any) {
    const uint order = node->order[ray->in.octant];
    uint *references = ray->reference + ray->height;
    float *distances = ray->distance + ray->height;
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
    ray->height += BVH_COUNT_BITS((uint)met);
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
    ray->height += count;
#endif
}

INLINE void interleaved_test_node(InterleavedRay *ray, uint reference, const bool any) {
    __global const Node *node = ray->in.nodes + reference;
    float8 near, far;
    bvh_box_distances(&ray->in.prepared, node, ray->hit.distance, &near, &far);
    interleaved_push_children(ray, node, near, far, any);
}

// Whether the ray has met a triangle of a pack; it keeps the nearest, unless `any` will do.
INLINE bool interleaved_test_pack(InterleavedRay *ray, uint pack, const bool any) {
    float8 distance, weight[3];
    const uint lanes =
        bvh_triangles(&ray->in.prepared, ray->in.packs + pack, ray->hit.distance, &distance, weight);
    if (!lanes)
        return false;
    if (!any && bvh_keep(pack, lanes, distance, weight, &ray->hit)) {
        ray->hit.object =
            ray->object != NO_INDEX ? ray->object : ray->in.packs[pack].object[ray->hit.triangle % BVH_WIDTH];
        ray->hit.triangle += ray->in.first_triangle;
    }
    return true;
}

// What comes next lies in memory that is slow to answer, if the mesh is large; it is asked for a round early.
INLINE void interleaved_prefetch(const InterleavedRay *ray) {
#ifndef TOP_LEVEL_ONLY
    if (ray->object != NO_INDEX)
        bvh_prefetch(ray->in.nodes, ray->in.packs, ray->height > 0 ? ray->reference[ray->height - 1] : 0);
#endif
}

// One node or pack more. With `any` the limit stays what it was when a box was met, so that it is not
// compared again. False when the ray is done: there is nothing left, or, with `any`, something is met.
INLINE bool interleaved_turn(InterleavedRay *ray, const Geometry *geometry, STATE const float *rays,
                             const bool any) {
    do {
        if (ray->height == 0)
            return false;
        ray->height--;
    } while (!any && ray->distance[ray->height] > ray->hit.distance);
    const uint reference = ray->reference[ray->height];
    if (!(reference & NODE_LEAF)) {
        interleaved_test_node(ray, reference, any);
        interleaved_prefetch(ray);
        return true;
    }
#ifndef TOP_LEVEL_ONLY
    if (reference == LEAVE_OBJECT) {
        ray->in = ray->world;
        ray->object = NO_INDEX;
        return true;
    }
    if (ray->object == NO_INDEX && !(reference & NODE_PACK)) {
        interleaved_enter_object(ray, geometry, rays, reference & ~NODE_LEAF);
        return true;
    }
#endif
    const bool met = interleaved_test_pack(ray, reference & ~(NODE_LEAF | NODE_PACK), any);
    if (any && met)
        ray->hit.object = 0; // whichever
    interleaved_prefetch(ray);
    return !(any && met);
}

// Leaves what a ray has met in the planes of hits, as far as `setup_surface_path` needs it. With BRUTE_FORCE
// a hit with a triangle of the top level is there already, and stays where nothing is nearer.
INLINE void interleaved_store_hit(const InterleavedRay *ray, const State *state) {
    STATE float *hits = state->hits + ray->path;
    const BvhHit *hit = &ray->hit;
#ifdef BRUTE_FORCE
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
INLINE void interleaved_add_light(const InterleavedRay *ray, const State *state) {
    if (ray->hit.object == NO_INDEX)
        accumulate(state, load_bits(state->paths, PATH_RESULT * BLOCK_STRIDE + ray->path),
                   load3(state->shadows + SHADOW_RADIANCE_R * BLOCK_STRIDE, BLOCK_STRIDE, ray->path));
}

INLINE float interleaved_limit(const State *state, uint path, const bool any) {
    if (any)
        return state->shadows[SHADOW_DISTANCE * BLOCK_STRIDE + path];
#ifdef BRUTE_FORCE
    return state->hits[HIT_DISTANCE * BLOCK_STRIDE + path];
#else
    return INFINITY;
#endif
}

// The rays of the `count` paths in `list`: their nearest hits, or, with `any`, what their shadow rays bring.
INLINE void interleaved_trace(const Geometry *geometry, const State *state, __local const float *ready,
                              __local const uint *list, uint count, const bool any) {
    STATE const float *rays = any ? state->shadows : state->rays;
    InterleavedRay all[INTERLEAVED_RAYS];
    InterleavedRay *order[INTERLEAVED_RAYS]; // those under way in front
    uint started = 0, under_way = 0;
    for (; under_way < INTERLEAVED_RAYS && started < count; under_way++, started++) {
        order[under_way] = all + under_way;
        interleaved_start(all + under_way, geometry, ready, rays, list[started],
                          interleaved_limit(state, list[started], any));
    }
    while (under_way > 0) {
        for (uint i = 0; i < under_way; i++) {
            InterleavedRay *ray = order[i];
            if (interleaved_turn(ray, geometry, rays, any))
                continue;
            if (any)
                interleaved_add_light(ray, state);
            else
                interleaved_store_hit(ray, state);
            if (started == count) {
                order[i] = order[--under_way];
                continue;
            }
            interleaved_start(ray, geometry, ready, rays, list[started],
                              interleaved_limit(state, list[started], any));
            started++;
        }
    }
}

// PoCL keeps the variables of a kernel for each work-item of a group apart; those of a function that is
// called lie in one place, and stay in the nearest cache.
static __attribute__((noinline)) void interleaved_nearest(const Geometry *geometry, const State *state,
                                                          __local const float *ready,
                                                          __local const uint *list, uint count) {
    interleaved_trace(geometry, state, ready, list, count, false);
}

#ifdef LIGHT_SAMPLING
static __attribute__((noinline)) void interleaved_any(const Geometry *geometry, const State *state,
                                                      __local const float *ready, __local const uint *list,
                                                      uint count) {
    interleaved_trace(geometry, state, ready, list, count, true);
}
#endif
