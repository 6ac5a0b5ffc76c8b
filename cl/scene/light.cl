#include "base/sampling.cl"
#include "scene/light_sample.cl"
#include "scene/sun.cl"
#include "base/texture.cl"
#ifdef SHAPED_LIGHTS
#include "scene/shaped_light.cl"
#endif
#ifdef LIGHT_TREE
#include "scene/light_tree.cl"
#endif

// Emitters: triangles, lights that are objects of their own, and the environment. Which exist is known when a
// kernel is built (ENVIRONMENT_IMAGE, TRIANGLE_LIGHTS, SHAPED_LIGHTS), so that a scene does not pay for
// emitters that it does not have. A constant environment is left to BSDF sampling, which finds it without any
// variance of its own.

#if defined(ENVIRONMENT_IMAGE) || defined(TRIANGLE_LIGHTS) || defined(SHAPED_LIGHTS)
#define LIGHT_SAMPLING
#endif

// Place in the lat-long image, in [0, 1) x [0, 1], of a direction. OpenEXR: the centre looks to +z, three
// quarters to the right is -x, the top row is +y; the rotation turns the image right-handed about +y.
INLINE Uniform2 environment_place(const Params *params, Vec3 direction) {
    Uniform2 place;
    float u = 0.5f + atan2_turns(-direction.x, direction.z) + params->environment_rotation;
    place.u = u - FLOOR(u);
    place.v = 2.0f * atan2_turns(SQRT(direction.x * direction.x + direction.z * direction.z), direction.y);
    return place;
}

INLINE Vec3 environment_direction(const Params *params, Uniform2 place) {
    float longitude = place.u - 0.5f - params->environment_rotation;
    float sine, cosine, sin_polar, cos_polar;
    sincos_turns(longitude - FLOOR(longitude), &sine, &cosine);
    sincos_turns(0.5f * place.v, &sin_polar, &cos_polar);
    return vec3(-sin_polar * sine, cos_polar, sin_polar * cosine);
}

// Radiance of the image at a place, bilinear between the centres of texels. Columns wrap around, rows do not.
INLINE Vec3 image_radiance(const Params *params, const Emitters *emitters, Uniform2 place) {
    uint width = params->environment_width, height = params->environment_height;
    float x = place.u * (float)width - 0.5f;
    float y = CLAMP(place.v * (float)height - 0.5f, 0.0f, (float)(height - 1u));
    float column = FLOOR(x), row = FLOOR(y);
    float tx = x - column, ty = y - row;
    int x0 = (int)column;
    uint left = (uint)(x0 < 0 ? x0 + (int)width : x0);
    uint right = (uint)(x0 + 1 >= (int)width ? x0 + 1 - (int)width : x0 + 1);
    uint top = (uint)row;
    uint bottom = MIN(top + 1u, height - 1u);
    __global const float *p00 = emitters->environment_image + 3u * (top * width + left);
    __global const float *p10 = emitters->environment_image + 3u * (top * width + right);
    __global const float *p01 = emitters->environment_image + 3u * (bottom * width + left);
    __global const float *p11 = emitters->environment_image + 3u * (bottom * width + right);
    return vec3(LERP(LERP(p00[0], p10[0], tx), LERP(p01[0], p11[0], tx), ty),
                LERP(LERP(p00[1], p10[1], tx), LERP(p01[1], p11[1], tx), ty),
                LERP(LERP(p00[2], p10[2], tx), LERP(p01[2], p11[2], tx), ty));
}

INLINE float environment_pdf(const Params *params, const Emitters *emitters, Uniform2 place) {
    uint width = params->environment_width, height = params->environment_height;
    uint column = MIN((uint)(place.u * (float)width), width - 1u);
    uint row = MIN((uint)(place.v * (float)height), height - 1u);
    float sin_polar, cos_polar;
    sincos_turns(0.5f * place.v, &sin_polar, &cos_polar);
    // The unit square has 2 pi^2 sin(polar) of solid angle per area.
    return emitters->texel_pdf[row * width + column] / (2.0f * PI * PI * MAX(sin_polar, 1e-6f)) *
           params->environment_probability;
}

// Radiance that arrives from far away along -direction, and the density with which light sampling would
// have chosen the direction (0: never).
INLINE Vec3 eval_environment(const Params *params, const Emitters *emitters, Vec3 direction, float *pdf) {
    Vec3 color =
        vec3(params->environment_color[0], params->environment_color[1], params->environment_color[2]);
#ifdef ENVIRONMENT_IMAGE
    Uniform2 place = environment_place(params, direction);
    *pdf = environment_pdf(params, emitters, place);
#ifdef SUN
    int sunny = meets_sun(params, direction);
    Vec3 sun = vec3(params->sun_radiance[0], params->sun_radiance[1], params->sun_radiance[2]);
    *pdf = *pdf * (1.0f - params->sun_probability) +
           (sunny ? sun_pdf(params) * params->sun_probability * params->environment_probability : 0.0f);
    return mul(color, add(image_radiance(params, emitters, place), scale(sunny ? 1.0f : 0.0f, sun)));
#else
    return mul(color, image_radiance(params, emitters, place));
#endif
#else
    *pdf = 0.0f;
    return color;
#endif
}

#ifdef ENVIRONMENT_IMAGE
INLINE LightSample sample_environment(const Params *params, const Emitters *emitters, Uniform2 uv) {
    uint width = params->environment_width, height = params->environment_height;
#ifdef SUN
    int sunny = chooses_sun(params, &uv.u);
    Vec3 to_sun = sample_sun(params, uv);
#endif
    uint row = find_cell(emitters->marginal, height, uv.v);
    float low = emitters->marginal[row], high = emitters->marginal[row + 1u];
    __global const float *cells = emitters->conditional + row * (width + 1u);
    uint column = find_cell(cells, width, uv.u);
    float left = cells[column], right = cells[column + 1u];
    Uniform2 place;
    place.v = ((float)row + (uv.v - low) / MAX(high - low, 1e-30f)) / (float)height;
    place.u = ((float)column + (uv.u - left) / MAX(right - left, 1e-30f)) / (float)width;
    LightSample result;
    result.direction = environment_direction(params, place);
#ifdef SUN
    result.direction = select(sunny, to_sun, result.direction);
#endif
    result.distance = INFINITY;
    // Looked up by the direction, as for a ray that goes there, so that both techniques agree on the texel.
    result.radiance = eval_environment(params, emitters, result.direction, &result.pdf);
    return result;
}
#endif

#ifdef TRIANGLE_LIGHTS
INLINE Vec3 light_vec3(__global const float *plane, uint stride, uint i) {
    return vec3(plane[i], plane[stride + i], plane[2 * stride + i]);
}

// The triangle that `choice` selects (Walker's alias method).
INLINE uint chosen_triangle(const Params *params, const Emitters *emitters, float choice) {
    uint stride = params->light_count;
    __global const float *lights = emitters->lights;
    float scaled_choice = choice * (float)stride;
    uint cell = MIN((uint)scaled_choice, stride - 1u);
    uint alias = ((__global const uint *)lights)[LIGHT_ALIAS * stride + cell];
    return scaled_choice - (float)cell < lights[LIGHT_ALIAS_PROBABILITY * stride + cell] ? cell : alias;
}

// Of LightFlag.
INLINE uint light_flags(const Params *params, const Emitters *emitters, uint light) {
    return ((__global const uint *)emitters->lights)[LIGHT_FLAGS * params->light_count + light];
}

#if TEXTURED(EMISSION)
// Where a point of a triangle lies in the texture of its emission, for both sets.
INLINE Uvs light_uvs(__global const float *lights, uint stride, uint light, float b1, float b2) {
    Uvs uvs;
    uvs.u0 = lights[LIGHT_U * stride + light] + b1 * lights[LIGHT_EDGE_1_U * stride + light] +
             b2 * lights[LIGHT_EDGE_2_U * stride + light];
    uvs.v0 = lights[LIGHT_V * stride + light] + b1 * lights[LIGHT_EDGE_1_V * stride + light] +
             b2 * lights[LIGHT_EDGE_2_V * stride + light];
    uvs.u1 = uvs.u0;
    uvs.v1 = uvs.v0;
    return uvs;
}
#endif

// `uv` selects the point on the triangle number `light`. Direction, distance and density are those from where
// the shadow ray starts. It ends before the point by what rounding may put between that and the light's
// surface, which would be in its way. That is the more the flatter the light is seen, but never so much that
// the ray passes by what stands before the light.
INLINE LightSample sample_triangle_point(const Params *params, const Shading *shading,
                                         const Emitters *emitters, const Starts *starts, Uniform2 uv,
                                         uint light) {
    uint stride = params->light_count;
    __global const float *lights = emitters->lights;
    float b1, b2;
    sample_triangle(uv.u, uv.v, &b1, &b2);
    Vec3 vertex = light_vec3(lights + LIGHT_VERTEX_X * stride, stride, light);
    Vec3 edge_1 = light_vec3(lights + LIGHT_EDGE_1_X * stride, stride, light);
    Vec3 edge_2 = light_vec3(lights + LIGHT_EDGE_2_X * stride, stride, light);
    Vec3 point = add(vertex, add(scale(b1, edge_1), scale(b2, edge_2)));
    Vec3 normal = normalize(cross(edge_1, edge_2));
    Vec3 to_light = subtract(point, start_towards(point, starts));
    float squared = dot(to_light, to_light);
    float distance = SQRT(squared);
    LightSample result;
    result.direction = scale(1.0f / MAX(distance, 1e-30f), to_light);
    float cosine = -dot(normal, result.direction);
    int double_sided = (light_flags(params, emitters, light) & LIGHT_DOUBLE_SIDED) != 0u;
    int shines = double_sided | (cosine > 0.0f);
    float facing = FABS(cosine);
    int valid = shines & (facing > 1e-7f) & (squared > 0.0f);
    float inverse_facing = 1.0f / (valid ? facing : 1.0f);
    float slack = lights[LIGHT_SLACK * stride + light] + 0x1p-21f * distance;
    result.distance = distance - MIN(slack * inverse_facing, 0.125f * distance);
    result.radiance = light_vec3(lights + LIGHT_EMISSION_R * stride, stride, light);
#if TEXTURED(EMISSION)
    uint texture = ((__global const uint *)lights)[LIGHT_TEXTURE * stride + light];
    Uvs uvs = light_uvs(lights, stride, light, b1, b2);
    result.radiance = mul(result.radiance, bright_texel(shading, texture, &uvs));
#endif
    result.pdf = valid ? lights[LIGHT_PDF_AREA * stride + light] * squared * inverse_facing : 0.0f;
    return result;
}

// `choice` selects the triangle.
INLINE LightSample sample_triangle_light(const Params *params, const Shading *shading,
                                         const Emitters *emitters, const Starts *starts, Uniform2 uv,
                                         float choice) {
    uint light = chosen_triangle(params, emitters, choice);
    return sample_triangle_point(params, shading, emitters, starts, uv, light);
}
#endif

#if defined(SHAPED_LIGHTS) || defined(LIGHT_TREE)
INLINE LightSample select_sample(int condition, LightSample a, LightSample b) {
    LightSample result;
    result.direction = select(condition, a.direction, b.direction);
    result.distance = condition ? a.distance : b.distance;
    result.radiance = select(condition, a.radiance, b.radiance);
    result.pdf = condition ? a.pdf : b.pdf;
    return result;
}
#endif

#ifdef LIGHT_TREE
// Where a light that the tree has chosen stands in its table, and all bits where it is of that kind. By
// arithmetic, as INDEX_OR_0. Elsewhere the place is 0.
typedef struct {
    uint place, mask;
} TablePlace;

INLINE TablePlace place_of_shaped(const Params *params, uint number) {
    TablePlace result;
    result.mask = (0u - ((INDEX_OR_0(number) - params->shaped_count) >> 31)) & INDEX_MASK(number);
    result.place = number & result.mask;
    return result;
}

INLINE TablePlace place_of_triangle(const Params *params, uint number) {
    TablePlace result;
    result.mask = (((INDEX_OR_0(number) - params->shaped_count) >> 31) - 1u) & INDEX_MASK(number);
    // Scratch paths of a wavefront hold any number.
    result.place = MIN((number - params->shaped_count) & result.mask, params->light_count - 1u);
    return result;
}
#endif

#if defined(ENVIRONMENT_IMAGE) && defined(TRIANGLE_LIGHTS)
// The choice among the triangles, where the first one has not turned to the environment.
INLINE float second_choice(const Params *params, float choice) {
    float p = params->environment_probability;
    return MIN(MAX(choice - p, 0.0f) / (1.0f - p), 0.99999994f);
}
#endif

#ifdef SHAPED_LIGHTS
// The choice within a part of the choices, which begins at `first` and is `size` long.
INLINE float choice_within(float choice, float first, float size) {
    return CLAMP((choice - first) / MAX(size, 1e-20f), 0.0f, 0.99999994f);
}

INLINE float choice_among_shaped(const Params *params, float choice) {
    return choice_within(choice, params->environment_probability, params->shaped_probability);
}

INLINE int is_choice_of_shaped(const Params *params, float choice) {
    float first = params->environment_probability;
    return (choice >= first) & (choice < first + params->shaped_probability);
}

INLINE float choice_among_triangles(const Params *params, float choice) {
    float first = params->environment_probability + params->shaped_probability;
    return choice_within(choice, first, 1.0f - first);
}

#ifndef LIGHT_TREE
// The choices begin with those of the environment; then come lights that are objects of their own, and
// triangles.
INLINE LightSample sample_any_light(const Params *params, const Shading *shading, const Emitters *emitters,
                                    const Starts *starts, Uniform2 uv, float choice) {
    LightSample result =
        sample_shaped_light(params, emitters, starts, uv, choice_among_shaped(params, choice));
#ifdef TRIANGLE_LIGHTS
    LightSample triangle =
        sample_triangle_light(params, shading, emitters, starts, uv, choice_among_triangles(params, choice));
    result = select_sample(choice >= params->environment_probability + params->shaped_probability, triangle,
                           result);
#endif
#ifdef ENVIRONMENT_IMAGE
    LightSample far = sample_environment(params, emitters, uv);
    result = select_sample(choice < params->environment_probability, far, result);
#endif
    return result;
}
#endif
#endif

#ifdef LIGHT_TREE
// One direction towards the light that the tree has chosen; where the choice has turned elsewhere, to a sun
// or to the environment, whose choices come first.
INLINE LightSample sample_tree_light(const Params *params, const Shading *shading, const Emitters *emitters,
                                     const Starts *starts, Uniform2 uv, float choice, ChosenLight chosen) {
    float chance = chosen.chance * params->tree_probability;
    LightSample result;
#ifdef SHAPED_LIGHTS
    TablePlace shaped = place_of_shaped(params, chosen.number);
    uint far_mask = ~INDEX_MASK(chosen.number);
    uint sun = chosen_shaped_light(params, emitters, choice_among_shaped(params, choice));
    ShapedLight light = load_shaped_light(params, emitters, shaped.place | (sun & far_mask));
    light.probability *= far_mask ? 1.0f : chance;
    result = sample_shape(light, starts, uv);
#endif
#ifdef TRIANGLE_LIGHTS
    TablePlace place = place_of_triangle(params, chosen.number);
    LightSample triangle = sample_triangle_point(params, shading, emitters, starts, uv, place.place);
    triangle.pdf *= chance;
#ifdef SHAPED_LIGHTS
    result = select_sample(place.mask != 0u, triangle, result);
#else
    result = triangle;
#endif
#endif
#ifdef ENVIRONMENT_IMAGE
    LightSample far = sample_environment(params, emitters, uv);
    result = select_sample(choice < params->environment_probability, far, result);
#endif
    return result;
}

// Whether the light that the tree has chosen differs between two scenes.
INLINE uint is_changed_light(const Params *params, const Emitters *emitters, ChosenLight chosen) {
    uint changed = 0u;
#ifdef SHAPED_LIGHTS
    TablePlace shaped = place_of_shaped(params, chosen.number);
    changed |= shaped.mask & (uint)((shaped_flags(params, emitters, shaped.place) & SHAPED_CHANGED) != 0u);
#endif
#ifdef TRIANGLE_LIGHTS
    TablePlace triangle = place_of_triangle(params, chosen.number);
    changed |= triangle.mask & (uint)((light_flags(params, emitters, triangle.place) & LIGHT_CHANGED) != 0u);
#endif
    return changed;
}
#endif

#if defined(LIGHT_SAMPLING) && !defined(LIGHT_TREE)
// One direction towards a light, chosen by power among triangles and the environment.
INLINE LightSample sample_light(const Params *params, const Shading *shading, const Emitters *emitters,
                                const Starts *starts, Uniform2 uv, float choice) {
#if defined(SHAPED_LIGHTS)
    return sample_any_light(params, shading, emitters, starts, uv, choice);
#elif defined(ENVIRONMENT_IMAGE) && defined(TRIANGLE_LIGHTS)
    float p = params->environment_probability;
    int far = choice < p;
    LightSample a = sample_environment(params, emitters, uv);
    LightSample b =
        sample_triangle_light(params, shading, emitters, starts, uv, second_choice(params, choice));
    LightSample result;
    result.direction = select(far, a.direction, b.direction);
    result.distance = far ? a.distance : b.distance;
    result.radiance = select(far, a.radiance, b.radiance);
    result.pdf = far ? a.pdf : b.pdf;
    return result;
#elif defined(ENVIRONMENT_IMAGE)
    return sample_environment(params, emitters, uv);
#elif defined(TRIANGLE_LIGHTS)
    return sample_triangle_light(params, shading, emitters, starts, uv, choice);
#endif
}
#endif

#ifndef LIGHT_TREE
// Whether `choice` leads to a light that differs between two scenes.
INLINE uint chooses_changed_light(const Params *params, const Emitters *emitters, float choice) {
#if defined(SHAPED_LIGHTS)
    uint flags = shaped_flags(params, emitters,
                              chosen_shaped_light(params, emitters, choice_among_shaped(params, choice)));
    uint changed = ((flags & SHAPED_CHANGED) != 0u) & (uint)is_choice_of_shaped(params, choice);
#ifdef TRIANGLE_LIGHTS
    uint triangle = chosen_triangle(params, emitters, choice_among_triangles(params, choice));
    uint is_triangle = choice >= params->environment_probability + params->shaped_probability;
    changed |= is_triangle & ((light_flags(params, emitters, triangle) & LIGHT_CHANGED) != 0u);
#endif
    return changed;
#elif defined(ENVIRONMENT_IMAGE) && defined(TRIANGLE_LIGHTS)
    uint near = choice >= params->environment_probability;
    uint light = chosen_triangle(params, emitters, second_choice(params, choice));
    return near & ((light_flags(params, emitters, light) & LIGHT_CHANGED) != 0u);
#elif defined(TRIANGLE_LIGHTS)
    return (light_flags(params, emitters, chosen_triangle(params, emitters, choice)) & LIGHT_CHANGED) != 0u;
#else
    return 0u;
#endif
}
#endif

// What arrives of the radiance `emission` of a surface at the origin of the ray that has met it, weighted
// against light sampling, which would have found the point with the area density `density`. `facing` is the
// cosine between the geometric normal and the way back along the ray. A `bsdf_pdf` of 0 says that light
// sampling could not have found the point.
INLINE Vec3 emitted_radiance(__global const Material *material, Vec3 emission, float density, float facing,
                             float distance, float bsdf_pdf) {
    int shines = ((material->flags & MATERIAL_DOUBLE_SIDED) != 0u) | (facing > 0.0f);
    float light_pdf = density * distance * distance / MAX(FABS(facing), 1e-7f);
    float weight = bsdf_sampling_weight(bsdf_pdf, light_pdf);
    return scale(shines ? weight : 0.0f, emission);
}
