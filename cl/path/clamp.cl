#include "path/state.cl"

// A limit on what a path adds at once after its first bounce, against fireflies. It is that of Cycles: the
// mean of the components is held below it. The light above is lost.

#ifdef CLAMP_INDIRECT
INLINE Vec3 clamped(const Params *params, Vec3 light, int indirect) {
    float mean = (light.x + light.y + light.z) * (1.0f / 3.0f);
    int above = indirect & (mean > params->clamp_indirect);
    return scale(above ? params->clamp_indirect / mean : 1.0f, light);
}

// Whether what a ray finds has come to the eye by more than one bounce. What the first bounce finds is direct
// light, as light sampling brings it there; that which has passed glass on its way there is not.
INLINE int finds_indirect(const Path *p) {
    int through_glass = (p->bounces == 1u) & (p->bsdf_pdf == 0.0f) & (p->ray > 1u);
    return (p->bounces > 1u) | through_glass;
}

// The same of what light sampling brings to where a path is now.
INLINE int samples_indirect(const Path *p) { return p->bounces > 0u; }

#define CLAMPED(params, light, indirect) clamped(params, light, indirect)
#else
#define CLAMPED(params, light, indirect) (light)
#endif
