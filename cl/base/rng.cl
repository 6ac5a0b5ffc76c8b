#include "base/scalar.cl"

// Random numbers that depend on (pixel, sample, dimension, seed) alone: the first two dimensions of the
// Sobol sequence, padded, with hash-based Owen scrambling of values and of the order of samples.
// B. Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020. Any aligned power of two of samples
// of a pixel is a (0, 2)-net in each pair of dimensions.

// Pairs of dimensions: one for the place in the pixel, one for that on the lens, four for every ray
// of the path.
#define PAIR_PIXEL 0u
#define PAIR_DIRECTION(ray) (1u + 4u * (ray))
#define PAIR_LIGHT(ray) (2u + 4u * (ray))
#define PAIR_CHOICE(ray) (3u + 4u * (ray))
#define PAIR_LUCK(ray) (4u + 4u * (ray))
// Of the surfaces that a ray and the shadow ray behind it go through.
#define PAIR_COVERAGE(ray, layer) (5u + 4u * MOST_RAYS + MOST_LAYERS * (ray) + (layer))
// Beyond those of all rays, so that these are the same with a lens and without.
#define PAIR_LENS 0x80000000u
// Of the colour that a path follows where colours part.
#define PAIR_CHANNEL(ray) (0x80000001u + (ray))

typedef struct {
    float u, v;
} Uniform2;

INLINE uint hash(uint x) {
    // C. Wellons, "lowbias32": bias 0.17, the best known two-round multiply-xorshift.
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

// Owen scrambling of a number whose bits are reversed: every bit is flipped depending on the lower ones.
// Laine-Karras permutation with N. Vegdahl's constants.
INLINE uint scramble_reversed(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

// Second dimension of Sobol's sequence, its bits reversed: the Pascal matrix modulo 2, which is the sum
// over supersets of bit indices and so takes log2(32) steps.
INLINE uint sobol_second_reversed(uint index) {
    index ^= index >> 16;
    index ^= (index & 0xff00ff00u) >> 8;
    index ^= (index & 0xf0f0f0f0u) >> 4;
    index ^= (index & 0xccccccccu) >> 2;
    return index ^ ((index & 0xaaaaaaaau) >> 1);
}

// [0, 1): 24 bits, which a float holds exactly.
INLINE float to_uniform(uint x) { return (float)(x >> 8) * 0x1p-24f; }

// What all dimensions of a pixel share.
INLINE uint pixel_seed(uint pixel, uint seed) { return hash(pixel ^ hash(seed + 0x9e3779b9u)); }

// Two uniform numbers for a pair of dimensions of a sample.
INLINE Uniform2 uniform_2d(uint pixel_seed, uint sample, uint pair) {
    uint seed = hash(pixel_seed + pair * 0x9e3779b9u);
    uint index = REVERSE_BITS(scramble_reversed(REVERSE_BITS(sample), seed));
    Uniform2 result;
    result.u = to_uniform(REVERSE_BITS(scramble_reversed(index, hash(seed + 1u))));
    result.v = to_uniform(REVERSE_BITS(scramble_reversed(sobol_second_reversed(index), hash(seed + 2u))));
    return result;
}
