#include "cpu/block.cl"

// Interleaved traversal: several rays on their way through the trees at a time, in one thread, for blocks of
// paths.
//
// The way of one ray is a chain: the next node is known only when the boxes of this one are tested, and most
// of the time is spent waiting for that, for memory, or for the outcome of a branch that was guessed wrong. A
// few rays that take turns, a node or pack each, keep the processor busy meanwhile. For that a ray's turn
// must end without a branch on what was just computed: it begins with one instead, on what is known since the
// turn before. Only a turn with a pack ends with a branch, on whether anything in it is met, because it is
// slower without.
//
//   turn: take the nearest child from the stack; test its boxes or triangles; push the boxes that are met
//
// So children are not sorted by distance, which is a branch or a chain, but pushed in an order that the node
// knows for the octant of the direction (Fuetterling, Lojewski, Pfreundt, Hamann and Ebert 2017, "Accelerated
// Single Ray Tracing for Wide Vector Units"); those that the ray does not meet are left out by compression.

// Rays under way. In the trees of large meshes they are more than the processor can follow, so that memory
// has answered when a ray's turn comes.
#ifdef TOP_LEVEL_ONLY
#define INTERLEAVED_RAYS 4
#else
#define INTERLEAVED_RAYS 16
#endif

// Planes of rays that are prepared, in SIMD lanes, for their way through the top level.
#define PREPARED_INVERSE 0u
#define PREPARED_NEAR_SHIFT 3u
#define PREPARED_FAR_SHIFT 6u
#define PREPARED_SHEAR 9u
#define PREPARED_HEADING 12u
// A heading is the octant of the direction, and its largest component.
#define HEADING_OCTANT_SHIFT 0u
#define HEADING_OCTANT_MASK 7u
#define HEADING_AXIS_SHIFT 3u
#define HEADING_AXIS_MASK 3u

// A ray in the space of the tree that it is in, and that tree.
typedef struct {
    BvhRay prepared;
    __global const Node *nodes;
    __global const TrianglePack *packs;
    uint octant;         // bit i: the direction is negative along axis i
    uint first_triangle; // the place of the first triangle of the tree
} RaySpace;

typedef struct {
    RaySpace in;
    uint object; // whose space the ray is in; NO_INDEX: world space
    uint path;
    uint height;
    RawHit hit; // the nearest so far
    uint reference[ONE_STACK_SIZE];
    float distance[ONE_STACK_SIZE]; // where the ray enters the box of that reference
#ifndef TOP_LEVEL_ONLY
    RaySpace world; // where the ray comes back to
#endif
} InterleavedRay;

INLINE void interleaved_push(InterleavedRay *ray, uint reference, float distance) {
    ray->reference[ray->height] = reference;
    ray->distance[ray->height] = distance;
    ray->height++;
}

INLINE void store_slab(__local float *prepared, uint axis, Slab slab) {
    prepared[(PREPARED_INVERSE + axis) * BLOCK_STRIDE] = slab.inverse;
    prepared[(PREPARED_NEAR_SHIFT + axis) * BLOCK_STRIDE] = slab.near_shift;
    prepared[(PREPARED_FAR_SHIFT + axis) * BLOCK_STRIDE] = slab.far_shift;
}

INLINE void prepare_ray(__local float *prepared, __local const float *rays, uint path) {
    const Ray ray = load_ray(rays, BLOCK_STRIDE, path);
    const Vec3 origin = ray.origin, direction = ray.direction;
    const uint main = bvh_main_axis(direction);
    const float inverse = 1.0f / component(direction, main);
    store_slab(prepared + path, 0, slab_of(origin.x, direction.x));
    store_slab(prepared + path, 1, slab_of(origin.y, direction.y));
    store_slab(prepared + path, 2, slab_of(origin.z, direction.z));
    store3(prepared + PREPARED_SHEAR * BLOCK_STRIDE, BLOCK_STRIDE, path,
           vec3(component(direction, bvh_x_axis(main)) * inverse,
                component(direction, bvh_y_axis(main)) * inverse, inverse));
    store_bits(prepared, PREPARED_HEADING * BLOCK_STRIDE + path,
               IN_FIELD(bvh_octant(direction), HEADING_OCTANT) | IN_FIELD(main, HEADING_AXIS));
}

// Sends the ray of a path on its way, to look as far as `limit`.
INLINE void interleaved_start(InterleavedRay *ray, const Geometry *geometry, __local const float *planes,
                              __local const float *rays, uint path, float limit) {
    const uint heading = load_bits(planes, PREPARED_HEADING * BLOCK_STRIDE + path);
    const uint octant = FIELD(heading, HEADING_OCTANT), main = FIELD(heading, HEADING_AXIS);
    BvhRay *prepared = &ray->in.prepared;
    bvh_point(prepared, octant, main);
#pragma unroll
    for (uint i = 0; i < 3; i++) {
        prepared->slab[i].inverse = planes[(PREPARED_INVERSE + i) * BLOCK_STRIDE + path];
        prepared->slab[i].near_shift = planes[(PREPARED_NEAR_SHIFT + i) * BLOCK_STRIDE + path];
        prepared->slab[i].far_shift = planes[(PREPARED_FAR_SHIFT + i) * BLOCK_STRIDE + path];
        prepared->shear[i] = planes[(PREPARED_SHEAR + i) * BLOCK_STRIDE + path];
    }
    prepared->origin[0] = rays[(RAY_ORIGIN_X + bvh_x_axis(main)) * BLOCK_STRIDE + path];
    prepared->origin[1] = rays[(RAY_ORIGIN_X + bvh_y_axis(main)) * BLOCK_STRIDE + path];
    prepared->origin[2] = rays[(RAY_ORIGIN_X + main) * BLOCK_STRIDE + path];
    ray->in.octant = octant;
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
INLINE void interleaved_enter_object(InterleavedRay *ray, const Geometry *geometry, __local const float *rays,
                                     uint index) {
    __global const Object *object = geometry->objects + index;
    if (!object->visible)
        return;
    ray->world = ray->in;
    const Ray object_ray = bvh_object_ray(object, load_ray(rays, BLOCK_STRIDE, ray->path));
    ray->in.prepared = bvh_ray(object_ray);
    ray->in.octant = bvh_octant(object_ray.direction);
    ray->in.nodes = geometry->nodes + object->first_node;
    ray->in.packs = geometry->packs + object->first_pack;
    ray->in.first_triangle = IN_FIELD(object->first_pack, PLACE_PACK);
    ray->object = index;
    interleaved_push(ray, LEAVE_OBJECT, 0.0f);
    interleaved_push(ray, 0, 0.0f);
}
#endif

// Pushes the children of a node that are met (`near` <= `far`), in the order that the node has for the
// octant. With `any` their distances are not needed: see interleaved_turn.
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
    ray->height += COUNT_BITS((uint)met);
#else
    const uint met = lane_bits(near <= far);
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

// Whether the ray has met a triangle of a pack. It keeps the nearest one, unless `any` will do.
INLINE bool interleaved_test_pack(InterleavedRay *ray, uint pack, const bool any) {
    float8 distance, weight[3];
    const uint lanes =
        bvh_triangles(&ray->in.prepared, ray->in.packs + pack, ray->hit.distance, &distance, weight);
    if (!lanes)
        return false;
    if (!any && bvh_keep(pack, lanes, distance, weight, &ray->hit)) {
        ray->hit.object = ray->object != NO_INDEX
                              ? ray->object
                              : ray->in.packs[pack].object[FIELD(ray->hit.triangle, PLACE_LANE)];
        ray->hit.triangle += ray->in.first_triangle;
    }
    return true;
}

// Asks for the node or pack of the ray's next turn a round early: that of a large mesh lies in memory that is
// slow to answer.
INLINE void interleaved_prefetch(const InterleavedRay *ray) {
#ifndef TOP_LEVEL_ONLY
    if (ray->object != NO_INDEX)
        bvh_prefetch(ray->in.nodes, ray->in.packs, ray->height > 0 ? ray->reference[ray->height - 1] : 0);
#endif
}

// One node or pack more. With `any` the limit stays what it was when a box was met, so that the distance of
// the box is not compared again. False when the ray is done: nothing is left on the stack, or, with `any`,
// something is met.
INLINE bool interleaved_turn(InterleavedRay *ray, const Geometry *geometry, __local const float *rays,
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
        ray->hit.object = 0; // any index says that something is met
    interleaved_prefetch(ray);
    return !(any && met);
}

// What rays look for: the nearest hits of paths; whether anything is in the way of shadow rays; or what is
// first in their way.
#define FIND_NEAREST 0u
#define FIND_ANY 1u
#define FIND_NEAREST_SHADOW 2u

// Ends the way of a ray: stores its hit, or, for FIND_ANY, adds the radiance of a shadow ray that nothing is
// in the way of. With BRUTE_FORCE there is a raw hit already, which stays where the trees have nothing
// nearer.
INLINE void interleaved_end(const InterleavedRay *ray, const Block *block, const uint what) {
    const int met = ray->hit.object != NO_INDEX;
#ifdef CUTOUTS
    if (what == FIND_NEAREST_SHADOW) {
        store_hit(PLANES(block->memory, SHADOW_HITS), ray->path, &ray->hit);
        return;
    }
#endif
    if (what == FIND_ANY) {
        if (!met)
            accumulate(&block->state, load_result(&block->state, ray->path),
                       load_light_sample(&block->state, ray->path).radiance);
        return;
    }
#ifdef BRUTE_FORCE
    if (!met)
        return;
#endif
    store_raw_hit(block, ray->path, &ray->hit);
}

INLINE float interleaved_limit(const Block *block, uint path, const uint what) {
    return what != FIND_NEAREST ? block->state.shadows[SHADOW_DISTANCE * BLOCK_STRIDE + path]
                                : nearest_limit(block, path);
}

// The rays of the first `count` paths in the list: their nearest hits, or what their shadow rays bring or
// meet. `prepared` are planes of all rays that are in `rays`.
INLINE void interleaved_trace(const Block *block, __local const float *rays, __local const float *prepared,
                              uint count, const uint what) {
    const bool any = what == FIND_ANY;
    const Geometry *geometry = &block->geometry;
    __local const uint *list = UINT_PLANES(block->memory, LIST);
    InterleavedRay all[INTERLEAVED_RAYS];
    InterleavedRay *order[INTERLEAVED_RAYS]; // those under way stand in front
    uint started = 0, under_way = 0;
    for (; under_way < INTERLEAVED_RAYS && started < count; under_way++, started++) {
        order[under_way] = all + under_way;
        interleaved_start(all + under_way, geometry, prepared, rays, list[started],
                          interleaved_limit(block, list[started], what));
    }
    while (under_way > 0) {
        for (uint i = 0; i < under_way; i++) {
            InterleavedRay *ray = order[i];
            if (interleaved_turn(ray, geometry, rays, any))
                continue;
            interleaved_end(ray, block, what);
            if (started == count) {
                order[i] = order[--under_way];
                continue;
            }
            interleaved_start(ray, geometry, prepared, rays, list[started],
                              interleaved_limit(block, list[started], what));
            started++;
        }
    }
}

#if !defined(BRUTE_FORCE_ONLY) || defined(LIGHT_TREE)
STAGE void prepare_rays(__local float *prepared, __local const float *rays, uint count) {
    LANES
    for (int i = 0; i < (int)count; i++)
        prepare_ray(prepared, rays, i);
}
#endif

#ifndef BRUTE_FORCE_ONLY
// The nearest hits of the first `listed` paths in the list, which are some of `count` traced paths.
STAGE void interleaved_nearest(const Block *block, uint count, uint listed) {
    __local float *prepared = PLANES(block->memory, PREPARED);
    if (listed > 0)
        prepare_rays(prepared, block->traced.rays, count);
    interleaved_trace(block, block->traced.rays, prepared, listed, FIND_NEAREST);
}

#ifdef LIGHT_SAMPLING
// Traces the shadow rays of the first `listed` paths in the list, which are some of `count` paths, and adds
// the radiance of those rays that nothing is in the way of.
STAGE void interleaved_any(const Block *block, uint count, uint listed) {
    __local float *prepared = PLANES(block->memory, PREPARED_SHADOWS);
    prepare_rays(prepared, block->state.shadows, count);
    interleaved_trace(block, block->state.shadows, prepared, listed, FIND_ANY);
}

#ifdef CUTOUTS
// As interleaved_any, but finds what is first in the way of each shadow ray.
STAGE void interleaved_nearest_shadow(const Block *block, uint count, uint listed) {
    __local float *prepared = PLANES(block->memory, PREPARED_SHADOWS);
    prepare_rays(prepared, block->state.shadows, count);
    interleaved_trace(block, block->state.shadows, prepared, listed, FIND_NEAREST_SHADOW);
}
#endif
#endif
#endif
