#include "base/sampling.cl"
#include "scene/light_sample.cl"

// Lights that are objects of their own: balls, rectangles, disks and suns; see layout.ShapedPlane. They are
// chosen by `sample_shaped_light`, and met by rays. A ray that meets the shining side of one ends there, as
// on a surface that reflects nothing; from behind, or from inside of a ball, lights are not there.
//
// Directions are chosen by solid angle: suns and balls within the cone that they fill, rectangles by C.
// Ureña, M. Fajardo and A. King, An Area-Preserving Parametrization for Spherical Rectangles, EGSR 2013.
// Points on disks, and on rectangles that are seen under a small angle, are chosen by area.

typedef struct {
    uint flags; // ShapedFlag
    Vec3 center, x, y, z;
    float half_x, half_y;
    Vec3 emission;
    float cap, cone_outer, cone_scale, probability;
} ShapedLight;

// A number of a light: in planes, as lanes read neighbours from them; or, with the light tree, where
// neighbours have different lights, all of a light in a row.
#ifdef LIGHT_TREE
#define SHAPED_PLACE(params, plane, light) (SHAPED_PLANES * (light) + (plane))
#else
#define SHAPED_PLACE(params, plane, light) ((plane) * (params)->shaped_count + (light))
#endif

INLINE float shaped_number(const Params *params, const Emitters *emitters, uint plane, uint light) {
    return emitters->shaped_lights[SHAPED_PLACE(params, plane, light)];
}

INLINE uint shaped_bits(const Params *params, const Emitters *emitters, uint plane, uint light) {
    return ((__global const uint *)emitters->shaped_lights)[SHAPED_PLACE(params, plane, light)];
}

INLINE Vec3 shaped_vec3(const Params *params, const Emitters *emitters, uint plane, uint light) {
    return vec3(shaped_number(params, emitters, plane, light),
                shaped_number(params, emitters, plane + 1u, light),
                shaped_number(params, emitters, plane + 2u, light));
}

// Of ShapedFlag.
INLINE uint shaped_flags(const Params *params, const Emitters *emitters, uint light) {
    return shaped_bits(params, emitters, SHAPED_FLAGS, light);
}

INLINE ShapedLight load_shaped_light(const Params *params, const Emitters *emitters, uint i) {
    ShapedLight light;
    light.flags = shaped_flags(params, emitters, i);
    light.center = shaped_vec3(params, emitters, SHAPED_CENTER_X, i);
    light.x = shaped_vec3(params, emitters, SHAPED_X_X, i);
    light.y = shaped_vec3(params, emitters, SHAPED_Y_X, i);
    light.z = cross(light.x, light.y);
    light.half_x = shaped_number(params, emitters, SHAPED_HALF_X, i);
    light.half_y = shaped_number(params, emitters, SHAPED_HALF_Y, i);
    light.emission = shaped_vec3(params, emitters, SHAPED_EMISSION_R, i);
    light.cap = shaped_number(params, emitters, SHAPED_CAP, i);
    light.cone_outer = shaped_number(params, emitters, SHAPED_CONE_OUTER, i);
    light.cone_scale = shaped_number(params, emitters, SHAPED_CONE_SCALE, i);
    light.probability = shaped_number(params, emitters, SHAPED_PROBABILITY, i);
    return light;
}

// The light that `choice` selects among them (Walker's alias method); with the light tree, among the suns.
INLINE uint chosen_shaped_light(const Params *params, const Emitters *emitters, float choice) {
#ifdef LIGHT_TREE
    uint count = params->sun_count;
#else
    uint count = params->shaped_count;
#endif
    float scaled_choice = choice * (float)count;
    uint cell = MIN((uint)scaled_choice, count - 1u);
    uint alias = shaped_bits(params, emitters, SHAPED_ALIAS, cell);
    float own = shaped_number(params, emitters, SHAPED_ALIAS_PROBABILITY, cell);
    return scaled_choice - (float)cell < own ? cell : alias;
}

INLINE int has_flag(const ShapedLight *light, uint flag) { return (light->flags & flag) != 0u; }

// What the light emits against `direction`, which leads to it: less towards the edge of a cone.
INLINE Vec3 shaped_emission(const ShapedLight *light, Vec3 direction) {
    float t = CLAMP((dot(direction, light->z) - light->cone_outer) * light->cone_scale, 0.0f, 1.0f);
    return scale(t * t * (3.0f - 2.0f * t), light->emission);
}

// How high a cap of the unit sphere a ball fills, 1 - cos of its angular radius, from `squared` metres
// squared away from its centre; 2 from inside.
INLINE float cap_of_ball(float radius, float squared) {
    float share = radius * radius / MAX(squared, 1e-37f);
    return share < 1.0f ? share / (1.0f + SQRT(1.0f - MIN(share, 1.0f))) : 2.0f;
}

// The distance along a ray at which it meets a ball from outside; below 0 where it does not. The
// distance of the centre from the ray is not taken from a difference of squares, which loses small balls.
INLINE float distance_to_ball(Vec3 to_center, float radius, Vec3 direction) {
    float middle = dot(to_center, direction);
    Vec3 aside = subtract(to_center, scale(middle, direction));
    float chord2 = radius * radius - dot(aside, aside);
    return chord2 >= 0.0f ? middle - SQRT(MAX(chord2, 0.0f)) : -1.0f;
}

// A rectangle as it is seen: its edges in its own axes from where it is seen from, and how far its plane is
// away. Arcsines of products of the normals of its sides add up to its solid angle.
typedef struct {
    float x0, x1, y0, y1, height;
    float below, above;           // z of the normals of the sides y0 and y1
    float corner_11_01, corner_0; // sums of arcsines: at the side x0, and at the side x1
} SeenRectangle;

INLINE SeenRectangle seen_rectangle(const ShapedLight *light, Vec3 to_center) {
    SeenRectangle seen;
    float x = dot(to_center, light->x), y = dot(to_center, light->y);
    seen.x0 = x - light->half_x;
    seen.x1 = x + light->half_x;
    seen.y0 = y - light->half_y;
    seen.y1 = y + light->half_y;
    seen.height = FABS(dot(to_center, light->z));
    float z2 = MAX(seen.height * seen.height, 1e-37f);
    float left = -seen.x0 / SQRT(z2 + seen.x0 * seen.x0), right = seen.x1 / SQRT(z2 + seen.x1 * seen.x1);
    seen.below = -seen.y0 / SQRT(z2 + seen.y0 * seen.y0);
    seen.above = seen.y1 / SQRT(z2 + seen.y1 * seen.y1);
    seen.corner_11_01 = arcsine(seen.above * left) + arcsine(left * seen.below);
    seen.corner_0 = arcsine(seen.below * right) + arcsine(right * seen.above);
    return seen;
}

INLINE float solid_angle_of(const SeenRectangle *seen) { return seen->corner_11_01 + seen->corner_0; }

// Steradians below which points on a rectangle are chosen by area. Rounding errors of the solid angle, some
// 1e-6, would count then, and the density hardly differs.
#define LEAST_SOLID_ANGLE 4e-3f

// Where a direction that is uniform over the solid angle of a rectangle meets it, in its own axes from
// its centre, by Ureña et al. with sines in place of the cosines of angles near a right one.
INLINE Uniform2 sample_seen_rectangle(const SeenRectangle *seen, float solid_angle, Uniform2 uv) {
    float turn = (seen->corner_11_01 - uv.u * solid_angle) * (0.5f * INV_PI), sine, cosine;
    sincos_turns(turn - FLOOR(turn), &sine, &cosine);
    float rise = -(cosine * seen->below + seen->above);
    float across = sine / SQRT(MAX(rise * rise + seen->below * seen->below * sine * sine, 1e-37f));
    across = CLAMP(rise < 0.0f ? -across : across, -0.9999999f, 0.9999999f);
    float x = CLAMP(across * seen->height / SQRT(1.0f - across * across), seen->x0, seen->x1);
    float d2 = x * x + seen->height * seen->height;
    float h0 = seen->y0 / SQRT(MAX(d2 + seen->y0 * seen->y0, 1e-37f));
    float h1 = seen->y1 / SQRT(MAX(d2 + seen->y1 * seen->y1, 1e-37f));
    float h = h0 + uv.v * (h1 - h0), h2 = h * h;
    float y = h2 < 0.999999f ? h * SQRT(d2) / SQRT(1.0f - MIN(h2, 0.999999f)) : seen->y1;
    Uniform2 place;
    place.u = x - 0.5f * (seen->x0 + seen->x1);
    place.v = CLAMP(y, seen->y0, seen->y1) - 0.5f * (seen->y0 + seen->y1);
    return place;
}

INLINE float flat_area(const ShapedLight *light) {
    return (has_flag(light, SHAPED_DISK) ? PI : 4.0f) * light->half_x * light->half_y;
}

// The density per solid angle with which a direction to a light is chosen that meets it in `distance`.
INLINE float shaped_light_pdf(const ShapedLight *light, Vec3 to_center, Vec3 direction, float distance) {
    int is_round = has_flag(light, SHAPED_BALL | SHAPED_SUN);
    float cap =
        has_flag(light, SHAPED_SUN) ? light->cap : cap_of_ball(light->half_x, dot(to_center, to_center));
    SeenRectangle seen = seen_rectangle(light, to_center);
    float solid_angle = solid_angle_of(&seen);
    float facing = MAX(FABS(dot(light->z, direction)), 1e-7f);
    float by_area = distance * distance / (facing * flat_area(light));
    int by_angle = has_flag(light, SHAPED_RECTANGLE) & (solid_angle > LEAST_SOLID_ANGLE);
    float flat = by_angle ? 1.0f / MAX(solid_angle, LEAST_SOLID_ANGLE) : by_area;
    return light->probability * (is_round ? 1.0f / (2.0f * PI * MAX(cap, 1e-37f)) : flat);
}

// Of a distance to a light, by how much surfaces in its own plane count as behind it.
#define LIGHT_AHEAD 1e-6f

// `uv` selects the direction. Where only light sampling can find the light, its weight is made 1 by SURE_PDF.
INLINE LightSample sample_shape(ShapedLight light, const Starts *starts, Uniform2 uv) {
    int sun = has_flag(&light, SHAPED_SUN), ball = has_flag(&light, SHAPED_BALL);
    int point = has_flag(&light, SHAPED_POINT);
    Vec3 origin = start_towards(light.center, starts);
    Vec3 to_center = subtract(light.center, origin);
    float squared = dot(to_center, to_center), length = SQRT(squared);
    Vec3 center_direction = select(sun, light.z, scale(1.0f / MAX(length, 1e-30f), to_center));

    // Balls and suns: a direction in a cone; points: its axis.
    float cap = point ? 0.0f : sun ? light.cap : cap_of_ball(light.half_x, squared);
    float height = uv.u * cap, sine, cosine;
    sincos_turns(uv.v, &sine, &cosine);
    float aside = SQRT(MAX(height * (2.0f - height), 0.0f));
    Vec3 in_cone = from_local(frame_of(center_direction), vec3(aside * cosine, aside * sine, 1.0f - height));
    int is_round = sun | ball;
    float chord = SQRT(MAX(light.half_x * light.half_x - squared * aside * aside, 0.0f));
    float round_distance = point ? length : MAX(length * (1.0f - height) - chord, 0.0f);

    // Rectangles and disks: a point on them.
    SeenRectangle seen = seen_rectangle(&light, to_center);
    float solid_angle = solid_angle_of(&seen);
    int by_angle = has_flag(&light, SHAPED_RECTANGLE) & (solid_angle > LEAST_SOLID_ANGLE);
    Uniform2 chosen = sample_seen_rectangle(&seen, MAX(solid_angle, LEAST_SOLID_ANGLE), uv);
    int disk = has_flag(&light, SHAPED_DISK);
    float radius = SQRT(uv.u);
    float a = disk       ? light.half_x * radius * cosine
              : by_angle ? chosen.u
                         : light.half_x * (2.0f * uv.u - 1.0f);
    float b = disk ? light.half_y * radius * sine : by_angle ? chosen.v : light.half_y * (2.0f * uv.v - 1.0f);
    Vec3 to_point = add(to_center, add(scale(a, light.x), scale(b, light.y)));
    float flat_squared = dot(to_point, to_point), flat_distance = SQRT(flat_squared);
    Vec3 to_flat = scale(1.0f / MAX(flat_distance, 1e-30f), to_point);

    LightSample result;
    result.direction = select(is_round, in_cone, to_flat);
    float distance = is_round ? round_distance : flat_distance;
    float facing = dot(light.z, result.direction);
    int front = has_flag(&light, SHAPED_DOUBLE_SIDED) ? FABS(facing) > 1e-7f : facing > 1e-7f;
    int valid = is_round ? sun | (point ? squared > 0.0f : cap < 1.0f) : front & (flat_squared > 0.0f);
    Vec3 emission = shaped_emission(&light, result.direction);
    float spread = (point & !sun) ? 1.0f / MAX(squared, 1e-37f) : 1.0f;
    float pdf = point ? light.probability : shaped_light_pdf(&light, to_center, result.direction, distance);
    int only_here = point | has_flag(&light, SHAPED_SHADOWLESS);
    float sure = only_here ? SURE_PDF / MAX(pdf, 1e-30f) : 1.0f;
    result.radiance = scale(spread * sure, emission);
    result.pdf = valid ? (only_here ? SURE_PDF : pdf) : 0.0f;
    result.distance = sun ? INFINITY : distance * (1.0f - LIGHT_AHEAD);
    result.distance = has_flag(&light, SHAPED_SHADOWLESS) ? 0.0f : result.distance;
    return result;
}

// `choice` selects the light, `uv` the direction.
INLINE LightSample sample_shaped_light(const Params *params, const Emitters *emitters, const Starts *starts,
                                       Uniform2 uv, float choice) {
    ShapedLight light = load_shaped_light(params, emitters, chosen_shaped_light(params, emitters, choice));
    return sample_shape(light, starts, uv);
}

// Whether rays of which `bsdf_pdf` is the density can meet the light: 0 is that of camera rays, and of those
// that light sampling could not have chosen.
INLINE int may_be_met(uint flags, int from_camera, float bsdf_pdf) {
    uint never = SHAPED_POINT | SHAPED_SUN | (from_camera ? SHAPED_HIDDEN : 0u);
    return ((flags & never) == 0u) & (((flags & SHAPED_SHADOWLESS) == 0u) | (bsdf_pdf <= 0.0f));
}

// The distance in which a ray meets a light's shining side; INFINITY: it does not. From outside of its cone
// the ball of a spot is not there, where it would be a black one.
INLINE float distance_to_shaped_light(const ShapedLight *light, Ray ray) {
    Vec3 to_center = subtract(light->center, ray.origin);
    float to_ball = distance_to_ball(to_center, light->half_x, ray.direction);
    float facing = dot(light->z, ray.direction), height = dot(light->z, to_center);
    float along_ray = height / (FABS(facing) > 1e-20f ? facing : 1e-20f);
    Vec3 from_center = subtract(scale(along_ray, ray.direction), to_center);
    float x = dot(from_center, light->x) / light->half_x, y = dot(from_center, light->y) / light->half_y;
    int inside = has_flag(light, SHAPED_DISK) ? x * x + y * y <= 1.0f : (FABS(x) <= 1.0f) & (FABS(y) <= 1.0f);
    int front = (facing > 1e-7f) | (has_flag(light, SHAPED_DOUBLE_SIDED) & (facing < -1e-7f));
    to_ball = facing > light->cone_outer ? to_ball : -1.0f;
    float distance = has_flag(light, SHAPED_BALL) ? to_ball : (inside & front ? along_ray : -1.0f);
    return distance > 0.0f ? distance : INFINITY;
}

// As a share of the length of a shadow ray to a light, how far before its end other lights are in its way.
// The light itself is never found there.
#define LIGHT_CLEAR 1e-4f

// Whether a light may be in the way of a shadow ray at all.
INLINE int may_shade(uint flags) { return may_be_met(flags, 0, 1.0f); }

// Whether a light that may be is in the way of a shadow ray of that length.
INLINE int shaped_light_shades(const ShapedLight *light, Ray ray, float limit) {
    return distance_to_shaped_light(light, ray) < limit * (1.0f - LIGHT_CLEAR);
}

// Whether any light is.
INLINE bool any_light_shades(const Params *params, const Emitters *emitters, Ray ray, float limit) {
    for (uint i = params->sun_count; i < params->shaped_count; i++) {
        if (!may_shade(shaped_flags(params, emitters, i)))
            continue;
        const ShapedLight light = load_shaped_light(params, emitters, i);
        if (shaped_light_shades(&light, ray, limit))
            return true;
    }
    return false;
}

// Radiance that a light sends to the origin of a ray that has met it, weighted against light sampling.
INLINE Vec3 shaped_radiance(const ShapedLight *light, Ray ray, float distance, float bsdf_pdf) {
    float pdf = shaped_light_pdf(light, subtract(light->center, ray.origin), ray.direction, distance);
    pdf = has_flag(light, SHAPED_SHADOWLESS) ? 0.0f : pdf;
    return scale(bsdf_sampling_weight(bsdf_pdf, pdf), shaped_emission(light, ray.direction));
}

// The same of a sun for a ray that has left the scene.
INLINE Vec3 sun_radiance(const ShapedLight *light, Vec3 direction, int from_camera, float bsdf_pdf) {
    Vec3 aside = subtract(direction, light->z);
    int met = 0.5f * dot(aside, aside) <= light->cap;
    uint never = SHAPED_POINT | (from_camera ? SHAPED_HIDDEN : 0u);
    int seen = ((light->flags & never) == 0u) & (!has_flag(light, SHAPED_SHADOWLESS) | (bsdf_pdf <= 0.0f));
    Ray ray;
    ray.origin = vec3(0.0f, 0.0f, 0.0f);
    ray.direction = direction;
    Vec3 radiance = shaped_radiance(light, ray, 1.0f, bsdf_pdf);
    return select(met & seen, radiance, vec3(0.0f, 0.0f, 0.0f));
}
