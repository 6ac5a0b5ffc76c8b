#include "base/scalar.cl"

// The state of paths, as planes: plane p of path i is planes[p * stride + i].
//
// A wavefront keeps the paths of a chunk in global memory, and each stage is a kernel over them. A block of
// paths (trace_blocks.cl) lies in local memory, and the stages are loops of one kernel. Both call the same
// functions, which see the state through this struct. Strides of a block are constants, so that the way to a
// plane is known when the kernel is built.

#ifdef BLOCKS
#define STATE __local
#define STRIDE(state) BLOCK_STRIDE
#define RADIANCE_STRIDE(state) BLOCK_STRIDE
#else
#define STATE __global
#define STRIDE(state) (state)->stride
#define RADIANCE_STRIDE(state) (state)->radiance_stride
#endif

typedef struct {
    STATE float *rays;
    STATE float *paths;
    STATE float *hits;
    STATE float *shadows;
    STATE float *radiance; // three planes, what each path has gathered
#ifndef BLOCKS
    uint stride; // of the planes
    uint radiance_stride;
#endif
} State;

INLINE Vec3 load3(STATE const float *plane, uint stride, uint i) {
    return vec3(plane[i], plane[stride + i], plane[2 * stride + i]);
}
INLINE void store3(STATE float *plane, uint stride, uint i, Vec3 v) {
    plane[i] = v.x;
    plane[stride + i] = v.y;
    plane[2 * stride + i] = v.z;
}

// Planes that hold unsigned integers, bit for bit.
INLINE uint load_bits(STATE const float *planes, uint place) { return ((STATE const uint *)planes)[place]; }
INLINE void store_bits(STATE float *planes, uint place, uint bits) { ((STATE uint *)planes)[place] = bits; }

// Adds to what a path has gathered; `result` is its place there.
INLINE void accumulate(const State *state, uint result, Vec3 radiance) {
    store3(state->radiance, RADIANCE_STRIDE(state), result,
           add(load3(state->radiance, RADIANCE_STRIDE(state), result), radiance));
}
