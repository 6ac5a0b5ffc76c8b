#include "scene/camera.cl"
#include "base/sampling.cl"

// Cameras whose rays start at different points: a thin lens, an orthographic picture, a near plane. Built in
// the variant LENS only, so that pinholes pay nothing for them.
#ifdef LENS

// A point that is uniform on the aperture, in halves of its height: on the unit disk, or on the polygon with
// its corners on the circle around it. The polygon is cut into triangles from its middle, one for each blade,
// whose outer edges face the directions k / blades of a turn.
INLINE Uniform2 sample_aperture(const Params *params, Uniform2 uv) {
    float blades = (float)MAX(params->camera.blades, 1u);
    int round = params->camera.blades == 0u;
    float scaled = uv.u * blades;
    float blade = MIN(FLOOR(scaled), blades - 1.0f);
    float a, b, sine, cosine, half_sine, half_cosine;
    sample_triangle(scaled - blade, uv.v, &a, &b);
    // The corners stand half a blade to either side; the share `a` is that of the middle.
    float first = 1.0f - a - b;
    sincos_turns(0.5f / blades, &half_sine, &half_cosine);
    float along = (first + b) * half_cosine, across = (first - b) * half_sine;
    float radius = SQRT(uv.u);
    float turns = round ? uv.v : blade / blades + params->camera.blade_turns;
    sincos_turns(turns - FLOOR(turns), &sine, &cosine);
    Uniform2 point;
    point.u = round ? radius * cosine : along * cosine - across * sine;
    point.v = round ? radius * sine : along * sine + across * cosine;
    return point;
}

// The ray through a point of the image, in pixels from the top left corner, that passes the lens at
// `aperture`, in halves of its height. All rays of a point of the image meet where it is sharp.
INLINE Ray lens_ray(const Params *params, float x, float y, Uniform2 aperture) {
    const Camera *camera = &params->camera;
    Vec3 right = vec3(camera->right[0], camera->right[1], camera->right[2]);
    Vec3 up = vec3(camera->up[0], camera->up[1], camera->up[2]);
    Vec3 forward = vec3(camera->forward[0], camera->forward[1], camera->forward[2]);
    Vec3 lens_right = vec3(camera->lens_right[0], camera->lens_right[1], camera->lens_right[2]);
    Vec3 lens_up = vec3(camera->lens_up[0], camera->lens_up[1], camera->lens_up[2]);
    float sx = 2.0f * x / (float)params->width - 1.0f;
    float sy = 1.0f - 2.0f * y / (float)params->height;
    Vec3 on_plane = add(scale(sx, right), scale(sy, up));
    Vec3 on_lens = add(scale(aperture.u, lens_right), scale(aperture.v, lens_up));
    // One long along the view.
    Vec3 direction = add(forward, scale(1.0f - camera->orthographic, on_plane));
    direction = subtract(direction, scale(camera->inverse_focus, on_lens));
    Ray ray;
    ray.origin = add(add(camera_position(params), scale(camera->orthographic, on_plane)), on_lens);
    ray.origin = along(ray.origin, camera->near, direction);
    ray.direction = normalize(direction);
    return ray;
}

#endif
