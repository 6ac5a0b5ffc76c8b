#include "base/sampling.cl"
#include "scene/light_sample.cl"
#include "base/attributes.cl"
#include "shading/medium.cl"

// The state of paths, as planes: plane p of path i is planes[p * stride + i].
//
// A wavefront keeps the paths of a chunk in global memory, and each stage is a kernel over them. A block of
// paths (trace_blocks.cl) lies in local memory, and the stages are loops of one kernel. Both call the same
// functions, which see the state through this struct. Strides of a block are constants, so that the address
// of a plane is known when the kernel is built.

#ifdef BLOCKS
#define STATE __local
#define STRIDE(state) BLOCK_STRIDE
#define RADIANCE_STRIDE(state) BLOCK_STRIDE
#else
#define STATE __global
#define STRIDE(state) (state)->stride
#define RADIANCE_STRIDE(state) (state)->radiance_stride
// The state that a kernel with PATH_STATE_PARAMETERS works on.
#define STATE_OF(params) {PATH_STATE_ARGUMENTS, (params).path_stride, (params).buffer_stride}
#endif

typedef struct {
    STATE float *rays;     // RayPlane
    STATE float *paths;    // PathPlane
    STATE float *surfaces; // SurfacePlane
    STATE float *shadows;  // ShadowPlane
    STATE float *radiance; // three planes, what each path has gathered
#ifndef BLOCKS
    uint stride; // of all planes but those of radiance
    uint radiance_stride;
#endif
} State;

INLINE Vec3 load3(STATE const float *plane, uint stride, uint i) {
    return vec3(plane[i], plane[stride + i], plane[2 * stride + i]);
}
INLINE void store3(STATE float *plane, uint stride, uint i, Vec3 v) {
    plane[i] = v.x;
    plane[stride + i] = v.y;
    plane[2 * stride + i] = v.z;
}

// Planes that hold unsigned integers, bit for bit.
INLINE uint load_bits(STATE const float *planes, uint place) { return ((STATE const uint *)planes)[place]; }
INLINE void store_bits(STATE float *planes, uint place, uint bits) { ((STATE uint *)planes)[place] = bits; }

// The planes of the functions below, with their stride. Whoever needs only some members of what is loaded
// pays for these alone: the compiler leaves out the other loads.

INLINE Ray load_ray(STATE const float *rays, uint stride, uint path) {
    Ray ray;
    ray.origin = load3(rays + RAY_ORIGIN_X * stride, stride, path);
    ray.direction = load3(rays + RAY_DIRECTION_X * stride, stride, path);
    return ray;
}

INLINE void store_ray(const State *state, uint path, Ray ray) {
    uint stride = STRIDE(state);
    store3(state->rays + RAY_ORIGIN_X * stride, stride, path, ray.origin);
    store3(state->rays + RAY_DIRECTION_X * stride, stride, path, ray.direction);
}

// What a path carries from hit to hit.
typedef struct {
    Vec3 throughput;
    float bsdf_pdf; // with which its ray was chosen; 0: light sampling could not have found what it meets
    uint pixel, sample;
    uint bounces, passages, ray; // see COUNTS_BOUNCES
} Path;

INLINE Path load_path(const State *state, uint path) {
    uint stride = STRIDE(state);
    uint counts = load_bits(state->paths, PATH_COUNTS * stride + path);
    Path p;
    p.throughput = load3(state->paths + PATH_THROUGHPUT_R * stride, stride, path);
    p.bsdf_pdf = state->paths[PATH_BSDF_PDF * stride + path];
    p.pixel = load_bits(state->paths, PATH_PIXEL * stride + path);
    p.sample = load_bits(state->paths, PATH_SAMPLE * stride + path);
    p.bounces = FIELD(counts, COUNTS_BOUNCES);
    p.passages = FIELD(counts, COUNTS_PASSAGES);
    p.ray = FIELD(counts, COUNTS_RAY);
    return p;
}

// Stores what changes of a path at a hit: all but its pixel and its sample.
INLINE void store_scattered(const State *state, uint path, const Path *p) {
    uint stride = STRIDE(state);
    store3(state->paths + PATH_THROUGHPUT_R * stride, stride, path, p->throughput);
    state->paths[PATH_BSDF_PDF * stride + path] = p->bsdf_pdf;
    store_bits(state->paths, PATH_COUNTS * stride + path,
               IN_FIELD(p->bounces, COUNTS_BOUNCES) | IN_FIELD(p->passages, COUNTS_PASSAGES) |
                   IN_FIELD(p->ray, COUNTS_RAY));
}

INLINE void store_path(const State *state, uint path, const Path *p) {
    store_scattered(state, path, p);
    store_bits(state->paths, PATH_PIXEL * STRIDE(state) + path, p->pixel);
    store_bits(state->paths, PATH_SAMPLE * STRIDE(state) + path, p->sample);
}

// What the path waits for: bits of CLASS_LIVE and those that follow it.
INLINE uint load_class(const State *state, uint path) {
    return load_bits(state->paths, PATH_CLASS * STRIDE(state) + path);
}
INLINE void store_class(const State *state, uint path, uint path_class) {
    store_bits(state->paths, PATH_CLASS * STRIDE(state) + path, path_class);
}

INLINE MediumStack load_medium_stack(const State *state, uint path) {
    uint upper = load_bits(state->paths, PATH_MEDIUM_0 * STRIDE(state) + path);
    uint lower = load_bits(state->paths, PATH_MEDIUM_1 * STRIDE(state) + path);
    MediumStack stack;
    stack.entry[0] = FIELD(upper, MEDIUM_LOW);
    stack.entry[1] = FIELD(upper, MEDIUM_HIGH);
    stack.entry[2] = FIELD(lower, MEDIUM_LOW);
    stack.entry[3] = FIELD(lower, MEDIUM_HIGH);
    return stack;
}

INLINE void store_medium_stack(const State *state, uint path, const MediumStack *stack) {
    store_bits(state->paths, PATH_MEDIUM_0 * STRIDE(state) + path,
               IN_FIELD(stack->entry[0], MEDIUM_LOW) | IN_FIELD(stack->entry[1], MEDIUM_HIGH));
    store_bits(state->paths, PATH_MEDIUM_1 * STRIDE(state) + path,
               IN_FIELD(stack->entry[2], MEDIUM_LOW) | IN_FIELD(stack->entry[3], MEDIUM_HIGH));
}

// Whether any medium encloses the path.
INLINE uint is_in_medium(const State *state, uint path) {
    return load_bits(state->paths, PATH_MEDIUM_0 * STRIDE(state) + path) != NO_INDEX;
}

// The surface that a ray has met, in world space; see layout.SurfacePlane.
typedef struct {
    Vec3 geometric, shading; // normals, of unit length
    float offset;            // how far along the geometric normal a ray must start to be clear of the surface
    float rise;              // but if FLAT: how much farther one does that goes below the plane of the face
    float distance;          // along the ray
    Vec3 position;
    uint object, material, face;
    float weight_b, weight_c; // of the second and third corner; scenes without textures don't keep them
    float turn;               // with anisotropy: in turns, where reflections are stretched
    Vec3 coat;                // the normal of a clearcoat, where it is another one than `shading`
} Surface;

INLINE Surface load_surface(const State *state, uint path) {
    uint stride = STRIDE(state);
    Surface s;
    s.geometric = load3(state->surfaces + SURFACE_GEOMETRIC_X * stride, stride, path);
    s.shading = load3(state->surfaces + SURFACE_SHADING_X * stride, stride, path);
    s.offset = state->surfaces[SURFACE_OFFSET * stride + path];
    s.distance = state->surfaces[SURFACE_DISTANCE * stride + path];
    s.position = load3(state->surfaces + SURFACE_POSITION_X * stride, stride, path);
    s.object = load_bits(state->surfaces, SURFACE_OBJECT * stride + path);
    s.material = load_bits(state->surfaces, SURFACE_MATERIAL * stride + path);
    s.face = load_bits(state->surfaces, SURFACE_FACE * stride + path);
#ifndef FLAT
    s.rise = state->surfaces[SURFACE_RISE * stride + path];
#endif
#ifdef CORNER_ATTRIBUTES
    s.weight_b = state->surfaces[SURFACE_WEIGHT_B * stride + path];
    s.weight_c = state->surfaces[SURFACE_WEIGHT_C * stride + path];
#endif
#if HAS_TRAIT(ANISOTROPY)
    s.turn = state->surfaces[SURFACE_TURN * stride + path];
#endif
#ifdef COAT_NORMALS
    s.coat = load3(state->surfaces + SURFACE_COAT_X * stride, stride, path);
#endif
    return s;
}

INLINE void store_surface(const State *state, uint path, const Surface *s) {
    uint stride = STRIDE(state);
    store3(state->surfaces + SURFACE_GEOMETRIC_X * stride, stride, path, s->geometric);
    store3(state->surfaces + SURFACE_SHADING_X * stride, stride, path, s->shading);
    state->surfaces[SURFACE_OFFSET * stride + path] = s->offset;
    state->surfaces[SURFACE_DISTANCE * stride + path] = s->distance;
    store3(state->surfaces + SURFACE_POSITION_X * stride, stride, path, s->position);
    store_bits(state->surfaces, SURFACE_OBJECT * stride + path, s->object);
    store_bits(state->surfaces, SURFACE_MATERIAL * stride + path, s->material);
    store_bits(state->surfaces, SURFACE_FACE * stride + path, s->face);
#ifndef FLAT
    state->surfaces[SURFACE_RISE * stride + path] = s->rise;
#endif
#ifdef CORNER_ATTRIBUTES
    state->surfaces[SURFACE_WEIGHT_B * stride + path] = s->weight_b;
    state->surfaces[SURFACE_WEIGHT_C * stride + path] = s->weight_c;
#endif
}

// Stores what set_tangents sets up.
INLINE void store_tangents(const State *state, uint path, const Surface *s) {
    uint stride = STRIDE(state);
#if TEXTURED(NORMAL) || TEXTURED(BUMP)
    store3(state->surfaces + SURFACE_SHADING_X * stride, stride, path, s->shading);
#endif
#if HAS_TRAIT(ANISOTROPY)
    state->surfaces[SURFACE_TURN * stride + path] = s->turn;
#endif
#ifdef COAT_NORMALS
    store3(state->surfaces + SURFACE_COAT_X * stride, stride, path, s->coat);
#endif
}

#ifndef FLAT
// The least cosine between a mirrored ray and the surface: little above it, and no more than the ray itself.
#define LEAST_MIRRORED 0.01f

// The shading normal, bent towards the geometric one as far as it takes for the mirror image of `wo`, the way
// back along a ray, to stay above the surface; else smooth metal has black facets where it turns away. In the
// plane of both normals the image of an angle p is at 2 n - p from the geometric normal if the shading normal
// is at n, whatever lies across, so that the flattest image that is wanted and wo itself have the bent normal
// between them.
INLINE Vec3 mirroring_normal(Vec3 shading, Vec3 geometric, Vec3 wo) {
    float facing = dot(geometric, wo), least = MIN(0.9f * facing, LEAST_MIRRORED);
    Vec3 mirrored = subtract(scale(2.0f * dot(shading, wo), shading), wo);
    Vec3 across = subtract(shading, scale(dot(shading, geometric), geometric));
    across = scale(1.0f / SQRT(MAX(dot(across, across), 1e-20f)), across);
    float aside = dot(across, wo);
    float inverse = 1.0f / SQRT(MAX(aside * aside + facing * facing, 1e-20f));
    float up = least * inverse;
    float out = SQRT(MAX(1.0f - up * up, 0.0f));
    Vec3 bent = add(scale(aside * inverse + out, across), scale(facing * inverse + up, geometric));
    return select(dot(mirrored, geometric) < least, normalize(bent), shading);
}
#endif

// Turns both normals to the side that a ray along `direction` comes from; returns the cosine between the
// geometric normal as it was and the way back along the ray, which is above 0 on the outside. Where the
// surface `mirrors`, the shading normal is bent so that it can. Else one that looks away from the ray, or
// along the surface as seen by it, gives way to the geometric one.
INLINE float orient_surface(Surface *surface, Vec3 direction, int mirrors) {
    float facing = -dot(surface->geometric, direction);
    float side = facing > 0.0f ? 1.0f : -1.0f;
    surface->geometric = scale(side, surface->geometric);
    surface->shading = scale(side, surface->shading);
#ifndef FLAT
    surface->rise *= side;
    Vec3 towards = select(dot(surface->shading, direction) < -1e-4f, surface->shading, surface->geometric);
    Vec3 mirroring = mirroring_normal(surface->shading, surface->geometric, scale(-1.0f, direction));
    surface->shading = select(mirrors, mirroring, towards);
#endif
#ifdef COAT_NORMALS
    surface->coat = mirroring_normal(scale(side, surface->coat), surface->geometric, scale(-1.0f, direction));
#endif
    return facing;
}

#if HAS_TRAIT(ANISOTROPY)
// A frame turned about its normal.
INLINE Frame turned(Frame f, float turns) {
    float sine, cosine;
    sincos_turns(turns - FLOOR(turns), &sine, &cosine);
    Frame frame;
    frame.tangent = add(scale(cosine, f.tangent), scale(sine, f.bitangent));
    frame.bitangent = subtract(scale(cosine, f.bitangent), scale(sine, f.tangent));
    frame.normal = f.normal;
    return frame;
}
#endif

// The frame of an oriented surface, and the way back along the ray in it, which is kept above the surface.
INLINE Frame shading_frame(const Surface *surface, Vec3 direction, Vec3 *wo) {
    Frame frame = frame_of(surface->shading);
#if HAS_TRAIT(ANISOTROPY)
    frame = turned(frame, surface->turn);
#endif
    *wo = to_local(frame, scale(-1.0f, direction));
    wo->z = MAX(wo->z, 1e-4f);
    return frame;
}

// The light that was sampled for a path: where to, what arrives, and the density of the direction.
INLINE LightSample load_light_sample(const State *state, uint path) {
    uint stride = STRIDE(state);
    LightSample light;
    light.direction = load3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path);
    light.distance = state->shadows[SHADOW_DISTANCE * stride + path];
    light.radiance = load3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path);
    light.pdf = state->shadows[SHADOW_PDF * stride + path];
    return light;
}

INLINE void store_light_sample(const State *state, uint path, const LightSample *light) {
    uint stride = STRIDE(state);
    store3(state->shadows + SHADOW_DIRECTION_X * stride, stride, path, light->direction);
    state->shadows[SHADOW_DISTANCE * stride + path] = light->distance;
    store3(state->shadows + SHADOW_RADIANCE_R * stride, stride, path, light->radiance);
    state->shadows[SHADOW_PDF * stride + path] = light->pdf;
}

// Replaces what the shadow ray of a path brings if nothing is in its way.
INLINE void store_arriving(const State *state, uint path, Vec3 radiance) {
    store3(state->shadows + SHADOW_RADIANCE_R * STRIDE(state), STRIDE(state), path, radiance);
}

// Makes a shadow ray of the light sample: where it starts, and what it brings.
INLINE void store_shadow_ray(const State *state, uint path, Vec3 origin, Vec3 radiance) {
    store3(state->shadows + SHADOW_ORIGIN_X * STRIDE(state), STRIDE(state), path, origin);
    store_arriving(state, path, radiance);
}

#ifndef BLOCKS
// Ends the work-groups of a wavefront that lie beyond the list as a whole. This branch is the same for all
// work-items of a group, so that their loop is vectorised nevertheless.
#define RETURN_IF_GROUP_IS_IDLE(count)                                                                       \
    if (get_group_id(0) * get_local_size(0) >= (count))                                                      \
        return;

// The path that a work-item of a wavefront has, and the place in the planes of radiance where it gathers.
// Work-items beyond the list work on scratch paths in the last places: a branch would end vectorisation.
typedef struct {
    uint path, result;
} WorkItem;

INLINE WorkItem listed_path(const Params *params, uint count, __global const uint *list) {
    uint k = (uint)get_global_id(0);
    int listed = k < count;
    WorkItem item;
    item.path = listed ? list[k] : params->path_stride - 1u;
    item.result = listed ? params->first_path + item.path : params->buffer_stride - 1u;
    return item;
}
#endif

// Adds to what a path has gathered; `result` is its place there.
INLINE void accumulate(const State *state, uint result, Vec3 radiance) {
    store3(state->radiance, RADIANCE_STRIDE(state), result,
           add(load3(state->radiance, RADIANCE_STRIDE(state), result), radiance));
}
