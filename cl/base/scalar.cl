// Scalar mathematics and three-vectors from which PoCL can still make SIMD lanes out of work-items.
//
// CLANG_CPU: PoCL or Intel's runtime on a CPU, which are made of clang, so that its intrinsics are at hand.
//
// PoCL does not inline OpenCL's built-in functions into a kernel, and one call left in a kernel keeps its
// loop over work-items from being vectorised; so there compiler intrinsics and selects stand in for them.
// Elsewhere the names mean the built-ins. Vec3 is a struct of scalars for the same reason: values of type
// float3 are not vectorised over.

#ifdef CLANG_CPU
#define SQRT(x) __builtin_sqrtf(x)
#define FABS(x) __builtin_fabsf(x)
#define FLOOR(x) __builtin_floorf(x)
#define REVERSE_BITS(x) __builtin_bitreverse32(x)
#else
#define SQRT(x) sqrt(x)
#define FABS(x) fabs(x)
#define FLOOR(x) floor(x)
#define REVERSE_BITS(x) reverse_bits(x)
#endif

// A call that stays a call is not vectorised over either, and LLVM leaves large functions as calls. Not
// static under PoCL: LLVM rewrites calls of static functions to leave out what it finds constant or unused,
// and loses the note on the call that the iterations of a loop are independent.
#ifdef CLANG_CPU
#define INLINE inline __attribute__((always_inline))
#else
#define INLINE static inline __attribute__((always_inline))
#endif

#define PI 3.14159265358979f
#define INV_PI 0.318309886183791f

// Ternaries, not the built-ins: they become selects. A NaN in `a` gives `b`.
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#define CLAMP(x, low, high) MIN(MAX(x, low), high)
#define LERP(a, b, t) ((a) + ((b) - (a)) * (t))

// One of the numbers that share a word, and a number at its place in such a word; see layout.Bits.
#define FIELD(word, name) ((word) >> name##_SHIFT & name##_MASK)
#define IN_FIELD(number, name) ((number) << name##_SHIFT)

// An index below 2^31, or 0 in place of NO_INDEX. This is arithmetic, not a choice: compilers move what only
// one branch needs into it, and loops over lanes then read it in all lanes nevertheless, also at NO_INDEX.
#define INDEX_MASK(index) (((index) >> 31) - 1u) // all bits, or none for NO_INDEX
#define INDEX_OR_0(index) ((index) & INDEX_MASK(index))

typedef struct {
    float x, y, z;
} Vec3;

typedef struct {
    Vec3 origin, direction; // the direction has unit length, but in the space of an object
} Ray;

INLINE Vec3 vec3(float x, float y, float z) {
    Vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

// The vector that three floats in a row make up.
INLINE Vec3 vec3_at(__global const float *v) { return vec3(v[0], v[1], v[2]); }

// OpenCL has built-in functions of these names, which take its own vector types. Compilers differ in whether
// a program may add an overload for a struct, so macros lead the calls to functions of other names. PoCL has
// macros of these names too.
#undef cross
#undef dot
#undef normalize
#undef select
#define cross(a, b) vec3_cross(a, b)
#define dot(a, b) vec3_dot(a, b)
#define normalize(a) vec3_normalize(a)
#define select(condition, a, b) vec3_select(condition, a, b) // `a` where the condition holds, as in ?:

INLINE Vec3 add(Vec3 a, Vec3 b) { return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
INLINE Vec3 subtract(Vec3 a, Vec3 b) { return vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
INLINE Vec3 mul(Vec3 a, Vec3 b) { return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }
INLINE Vec3 scale(float s, Vec3 a) { return vec3(s * a.x, s * a.y, s * a.z); }
INLINE Vec3 along(Vec3 origin, float t, Vec3 direction) { return add(origin, scale(t, direction)); }
INLINE Vec3 vec3_select(int condition, Vec3 a, Vec3 b) {
    return vec3(condition ? a.x : b.x, condition ? a.y : b.y, condition ? a.z : b.z);
}
INLINE float vec3_dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE Vec3 vec3_cross(Vec3 a, Vec3 b) {
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
INLINE Vec3 vec3_normalize(Vec3 a) { return scale(1.0f / SQRT(dot(a, a)), a); }
INLINE float largest(Vec3 a) { return MAX(MAX(a.x, a.y), a.z); }
INLINE float luminance(Vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

INLINE uint reverse_bits(uint x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Sine and cosine of an angle in turns, 0 <= turns <= 1; absolute error below 2e-7. The angle is reduced
// to an eighth of a turn on either side of a quarter; the polynomials are S. Moshier's (Cephes).
INLINE void sincos_turns(float turns, float *sine, float *cosine) {
    float quarter = FLOOR(4.0f * turns + 0.5f);
    float x = (turns - 0.25f * quarter) * (2.0f * PI);
    float x2 = x * x;
    float s = x * (1.0f + x2 * (-1.6666655e-1f + x2 * (8.3321609e-3f + x2 * -1.9515296e-4f)));
    float c = 1.0f + x2 * (-0.5f + x2 * (4.1666646e-2f + x2 * (-1.3887316e-3f + x2 * 2.4433157e-5f)));
    int q = (int)quarter & 3;
    float s1 = q & 1 ? c : s;
    float c1 = q & 1 ? s : c;
    *sine = q & 2 ? -s1 : s1;
    *cosine = (q + 1) & 2 ? -c1 : c1;
}

// atan2(y, x) in turns, in [-0.5, 0.5]; absolute error below 1e-6. 0 where both are 0.
INLINE float atan2_turns(float y, float x) {
    float ax = FABS(x), ay = FABS(y);
    float high = MAX(ax, ay), low = MIN(ax, ay);
    float t = low / MAX(high, 1e-37f);
    float t2 = t * t;
    // Minimax polynomial of atan(t) / t on [0, 1] in t^2.
    float p = 0.05265332f + t2 * -0.0117212f;
    p = -0.11643287f + t2 * p;
    p = 0.19354346f + t2 * p;
    p = -0.33262347f + t2 * p;
    p = 0.99997726f + t2 * p;
    float angle = t * p * (0.5f * INV_PI);
    angle = ay > ax ? 0.25f - angle : angle;
    angle = x < 0.0f ? 0.5f - angle : angle;
    return y < 0.0f ? -angle : angle;
}

// asin(x), absolute error below 3e-7 (S. Moshier's, Cephes). Beyond 1 it is that of 1.
INLINE float arcsine(float x) {
    float a = MIN(FABS(x), 1.0f);
    int steep = a > 0.5f;
    float z = steep ? 0.5f * (1.0f - a) : a * a;
    float s = steep ? SQRT(z) : a;
    float p = 7.4953002686e-2f + z * (4.5470025998e-2f + z * (2.4181311049e-2f + z * 4.2163199048e-2f));
    p = s + s * z * (1.6666752422e-1f + z * p);
    float angle = steep ? 0.5f * PI - 2.0f * p : p;
    return x < 0.0f ? -angle : angle;
}

// exp(x) for x <= 0, relative error below 2e-7; 0 where a float has no exponent left. 2^n times a polynomial
// of the fraction (S. Moshier's, Cephes).
INLINE float exp_negative(float x) {
    float y = MAX(x, -87.0f);
    float n = FLOOR(y * 1.44269504f + 0.5f);
    float r = (y - n * 0.693359375f) - n * -2.12194440e-4f;
    float p =
        5.0000001201e-1f +
        r * (1.6666665459e-1f +
             r * (4.1665795894e-2f + r * (8.3334519073e-3f + r * (1.3981999507e-3f + r * 1.9875691500e-4f))));
    return x < -87.0f ? 0.0f : (1.0f + r + r * r * p) * as_float(((int)n + 127) << 23);
}

// exp(x) for |x| <= 87, beyond that that of the nearest such x.
INLINE float exponential(float x) {
    float falling = exp_negative(-MIN(FABS(x), 87.0f));
    return x > 0.0f ? 1.0f / falling : falling;
}

// The natural logarithm of x > 0 that is no denormal number, relative error below 2e-7 (S. Moshier's,
// Cephes).
INLINE float logarithm(float x) {
    uint bits = as_uint(x);
    float m = as_float((bits & 0x007fffffu) | 0x3f000000u); // x = m 2^e with m from 0.5 to 1
    int low = m < 0.70710678f;
    float e = (float)((int)(bits >> 23) - 126 - low);
    m = (low ? 2.0f * m : m) - 1.0f;
    float p = 7.0376836292e-2f;
    p = -1.1514610310e-1f + m * p;
    p = 1.1676998740e-1f + m * p;
    p = -1.2420140846e-1f + m * p;
    p = 1.4249322787e-1f + m * p;
    p = -1.6668057665e-1f + m * p;
    p = 2.0000714765e-1f + m * p;
    p = -2.4999993993e-1f + m * p;
    p = 3.3333331174e-1f + m * p;
    float z = m * m;
    return m + (m * z * p - 2.12194440e-4f * e - 0.5f * z) + 0.693359375f * e;
}
