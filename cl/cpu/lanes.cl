#include "base/scalar.cl"

// SIMD lanes over the paths of a block: loops that the compiler vectorises, and vectors by hand.

// Stands before a loop whose iterations are independent of each other. LLVM keeps this as a note on the
// function call in the loop, and loses the note where an argument of the call is a constant or is not used.
#ifdef __clang__
#define LANES _Pragma("clang loop vectorize(assume_safety) vectorize_width(16) interleave(disable)")
#else
#define LANES
#endif

// LLVM 14 keeps to registers of 256 bits unless it is told that the code needs wider ones.
#ifdef __AVX512F__
#define WIDE __attribute__((min_vector_width(512)))
#else
#define WIDE
#endif

#define LANE_COUNT 16

// Without AVX-512 clang warns that float16 is passed to functions in another way than with it. That does no
// harm, because nothing is passed to other programs.
#ifdef CLANG_CPU
#pragma clang diagnostic ignored "-Wpsabi"
#endif

INLINE float16 load_lanes(__local const float *place) {
    typedef float16 Unaligned __attribute__((aligned(4)));
    return *(__local const Unaligned *)place;
}

INLINE void store_lanes(__local float *place, float16 value) {
    typedef float16 Unaligned __attribute__((aligned(4)));
    *(__local Unaligned *)place = value;
}
