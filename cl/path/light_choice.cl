#include "path/met_light.cl"

// What is done with the light tree where rays have ended on surfaces: the lights that they have met get their
// density, and lights are chosen for those paths that go on. This is a stage of its own, because lanes are
// the children of nodes here, and paths everywhere else.

#ifdef LIGHT_TREE
// Where a ray came from, by its end.
INLINE Vec3 start_of_ray(const State *state, uint path, const Surface *surface) {
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    return along(surface->position, -surface->distance, direction);
}

// As weigh_met_shaped_light, of the emissive triangle that a path stands on, if it does.
INLINE void weigh_met_triangle(const Params *params, const Shading *shading, const Emitters *emitters,
                               const State *state, uint path, const Surface *surface) {
#ifdef TRIANGLE_LIGHTS
    if (!(shading->materials[surface->material].light_pdf > 0.0f) || !(load_bsdf_pdf(state, path) > 0.0f))
        return;
    const uint first = emitters->first_trail[surface->object], face = first + surface->face;
    __global const uint *trail = emitters->face_trails + FACE_TRAIL_SIZE * (face & INDEX_MASK(first));
    const float factor = first == NO_INDEX ? 0.0f : as_float(trail[1]);
    if (factor > 0.0f)
        weigh_met_light(params, emitters, state, path, start_of_ray(state, path, surface), trail[0], factor);
    else
        state->paths[PATH_BSDF_PDF * STRIDE(state) + path] = 0.0f;
#endif
}

// Where paths wait that choose a light: the number that is left of the random one, below 0 where it turns to
// the environment or to a sun, or where paths end; and the normal of their receiver. In the planes of the
// shadow ray, which is not there yet.
#define CHOICE_NUMBER SHADOW_PDF
#define CHOICE_NORMAL SHADOW_DIRECTION_X
#define CHOICE_ALL_SIDES SHADOW_DISTANCE

// Prepares the choice of a light for a path on a surface. What lets light through may be lit from both sides.
INLINE void prepare_choice(const Params *params, const Shading *shading, const State *state, uint path) {
    Surface surface = load_surface(state, path);
    Vec3 direction = load_ray(state->rays, STRIDE(state), path).direction;
    Vec3 normal = scale(dot(surface.geometric, direction) > 0.0f ? -1.0f : 1.0f, surface.geometric);
    __global const Material *material = &shading->materials[surface.material];
    int is_opaque = (material->transmission <= 0.0f) & (material->diffuse_transmission <= 0.0f);
    uint packed = is_opaque ? packed_normal(normal) : NO_INDEX;
    store_bits(state->paths, PATH_NORMAL * STRIDE(state) + path, packed);
    Receiver receiver = receiver_at(surface.position, packed);
    store3(state->shadows + CHOICE_NORMAL * STRIDE(state), STRIDE(state), path, receiver.normal);
    state->shadows[CHOICE_ALL_SIDES * STRIDE(state) + path] = receiver.all_sides;

    Path p = load_path(state, path);
    float choice = uniform_2d(pixel_seed(p.pixel, params->seed), p.sample, PAIR_CHOICE(p.ray)).v;
    float first = params->environment_probability + params->shaped_probability;
    float left = CLAMP((choice - first) / params->tree_probability, 0.0f, 0.99999994f);
    int chooses = (choice >= first) & (p.ray != params->last_ray);
    state->shadows[CHOICE_NUMBER * STRIDE(state) + path] = chooses ? left : -1.0f;
}

// A path at the root of the tree; false where it chooses elsewhere.
INLINE bool begin_choice(const State *state, uint path, Receiver *receiver, LightWalk *walk) {
    walk->choice = state->shadows[CHOICE_NUMBER * STRIDE(state) + path];
    walk->node = 0u;
    walk->chance = 1.0f;
    receiver->position = load3(state->surfaces + SURFACE_POSITION_X * STRIDE(state), STRIDE(state), path);
    receiver->normal = load3(state->shadows + CHOICE_NORMAL * STRIDE(state), STRIDE(state), path);
    receiver->all_sides = state->shadows[CHOICE_ALL_SIDES * STRIDE(state) + path];
    return walk->choice >= 0.0f;
}
#endif
