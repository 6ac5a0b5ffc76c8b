#include "base/scalar.cl"

// A direction that light sampling has chosen.
typedef struct {
    Vec3 direction;
    float distance;
    Vec3 radiance; // what arrives if nothing is in the way
    float pdf;     // of the direction, per solid angle; 0 where the sample failed
} LightSample;

// Where rays start that leave a surface: steps off it, for points on that side of its face where `above` is,
// and for those on the other side.
typedef struct {
    Vec3 position, above, below;
} Starts;

INLINE Vec3 start_towards(Vec3 point, const Starts *starts) {
    int is_below = dot(subtract(point, starts->position), starts->above) < 0.0f;
    return add(starts->position, select(is_below, starts->below, starts->above));
}
