#include "base/scalar.cl"

// Direction through a point of the image, in pixels from the top left corner; world space, unit length.
INLINE Vec3 camera_direction(const Params *params, float x, float y) {
    Vec3 right = vec3(params->camera.right[0], params->camera.right[1], params->camera.right[2]);
    Vec3 up = vec3(params->camera.up[0], params->camera.up[1], params->camera.up[2]);
    Vec3 forward = vec3(params->camera.forward[0], params->camera.forward[1], params->camera.forward[2]);
    float sx = 2.0f * x / (float)params->width - 1.0f;
    float sy = 1.0f - 2.0f * y / (float)params->height;
    return normalize(add(forward, add(scale(sx, right), scale(sy, up))));
}
