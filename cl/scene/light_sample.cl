#include "base/scalar.cl"

// A direction that light sampling has chosen.
typedef struct {
    Vec3 direction;
    float distance;
    Vec3 radiance; // what arrives if nothing is in the way
    float pdf;     // of the direction, per solid angle; 0 where the sample failed
} LightSample;

// Where a ray from a surface to a point starts: a step off the surface, on the side where the point lies.
INLINE Vec3 start_towards(Vec3 point, Vec3 position, Vec3 step) {
    float side = dot(subtract(point, position), step) < 0.0f ? -1.0f : 1.0f;
    return along(position, side, step);
}
