#include "base/scalar.cl"

// Eight comparisons at once, as the bits of a word. What is used of it is inlined by force, and bit
// operations are the compiler's own where it has them: in PoCL a call in an inner loop spills every vector
// register.

#ifdef __clang__
#define COUNT_BITS(x) ((uint)__builtin_popcount(x))
#else
#define COUNT_BITS(x) popcount(x)
#endif

// Bit i is set where lane i of a comparison holds.
INLINE uint lane_bits(const int8 comparison) {
#if defined(__AVX__) && defined(__clang__) && !defined(PORTABLE_LANES)
    return (uint)__builtin_ia32_movmskps256(as_float8(comparison));
#else
    const int8 bit = comparison & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int4 four = bit.lo | bit.hi;
    const int2 two = four.lo | four.hi;
    return (uint)(two.x | two.y);
#endif
}
