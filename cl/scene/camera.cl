#include "base/scalar.cl"

INLINE Vec3 camera_position(const Params *params) {
    const float *p = params->camera.position;
    return vec3(p[0], p[1], p[2]);
}

// Direction through a point of the image, in pixels from the top left corner; world space, unit length.
INLINE Vec3 camera_direction(const Params *params, float x, float y) {
    const float *r = params->camera.right, *u = params->camera.up, *f = params->camera.forward;
    Vec3 right = vec3(r[0], r[1], r[2]), up = vec3(u[0], u[1], u[2]), forward = vec3(f[0], f[1], f[2]);
    float sx = 2.0f * x / (float)params->width - 1.0f;
    float sy = 1.0f - 2.0f * y / (float)params->height;
    return normalize(add(forward, add(scale(sx, right), scale(sy, up))));
}
