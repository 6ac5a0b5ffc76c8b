#include "base/scalar.cl"

// What the test of a ray against boxes needs of the ray along one axis: the distance to a plane is
// plane * inverse + shift. There are two shifts, so that rounding errs on the side of a hit: the near plane
// counts as nearer, the far plane as farther than it is.

// Relative rounding errors of the box test: several ulps, because compilers may or may not fuse operations. A
// reciprocal that is not the nearest one, as OpenCL allows it, is two ulps more.
#ifdef INEXACT_DIVISION
#define BVH_SLACK 1e-6f
#else
#define BVH_SLACK 4e-7f
#endif
#ifdef PERTURBED_DIVISION
#define BVH_RECIPROCAL(x, AS_FLOAT, AS_INT) AS_FLOAT(AS_INT(1.0f / (x)) + (AS_INT(1.0f / (x)) & 1) * 4 - 2)
#else
#define BVH_RECIPROCAL(x, AS_FLOAT, AS_INT) (1.0f / (x))
#endif
// Direction components below this count as zero; their reciprocal stays finite, so that no NaN can arise.
#define BVH_ZERO 1e-20f
#define BVH_INVERSE_ZERO 1e25f

typedef struct {
    float inverse, near_shift, far_shift;
} Slab;

// The same of sixteen rays.
typedef struct {
    float16 inverse, near_shift, far_shift;
} Slab16;

// Both are written once for all widths. NAME takes any direction: where that has no component, the ray lies
// between the planes or it does not, and a ray on a plane counts as between them. NAME_by_inverse takes the
// reciprocal of a component that is not 0, and how far beyond rounding errors the shifts are apart.
#define DEFINE_SLAB(NAME, SLAB, FLOAT, AS_FLOAT, AS_INT)                                                     \
    INLINE SLAB NAME##_by_inverse(FLOAT origin, FLOAT inverse, FLOAT least_slack) {                          \
        const FLOAT shift = -origin * inverse;                                                               \
        const FLOAT slack = AS_FLOAT(AS_INT(shift) & INT_MAX) * BVH_SLACK + least_slack;                     \
        SLAB slab;                                                                                           \
        slab.inverse = inverse;                                                                              \
        slab.near_shift = shift - slack;                                                                     \
        slab.far_shift = shift + slack;                                                                      \
        return slab;                                                                                         \
    }                                                                                                        \
    INLINE SLAB NAME(FLOAT origin, FLOAT direction) {                                                        \
        const FLOAT size = AS_FLOAT(AS_INT(direction) & INT_MAX);                                            \
        const FLOAT least =                                                                                  \
            AS_FLOAT((AS_INT(direction) & INT_MIN) | AS_INT((FLOAT)(1.0f / BVH_INVERSE_ZERO)));              \
        const FLOAT inverse = BVH_RECIPROCAL(size < BVH_ZERO ? least : direction, AS_FLOAT, AS_INT);         \
        const FLOAT between = size < BVH_ZERO ? (FLOAT)(BVH_INVERSE_ZERO * 1e-10f) : (FLOAT)(0.0f);          \
        return NAME##_by_inverse(origin, inverse, between);                                                  \
    }

DEFINE_SLAB(slab_of, Slab, float, as_float, as_int)
#ifdef CLANG_CPU
DEFINE_SLAB(slab_of_lanes, Slab16, float16, as_float16, as_int16)
#endif
