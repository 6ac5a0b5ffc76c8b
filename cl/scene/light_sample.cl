#include "base/scalar.cl"

// A direction that light sampling has chosen.
typedef struct {
    Vec3 direction;
    float distance;
    Vec3 radiance; // what arrives if nothing is in the way
    float pdf;     // of the direction, per solid angle; 0 where the sample failed
} LightSample;
