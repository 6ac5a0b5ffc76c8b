#include "cpu/lanes.cl"

// Picking some of a block's paths, and moving what they carry together. For SIMD lanes paths must be
// neighbours; gathering them plane by plane takes several times as long as the compression of AVX-512.

#if defined(__AVX512DQ__) && defined(__clang__) && !defined(PORTABLE_LANES)
#define COMPRESS_BY_MASK
#endif

// Those of the first `of` paths of a block that are picked: a word of bits for each sixteen of them, or the
// places of those that are.
typedef struct {
    __local uint *words;
    uint of, count;
} Subset;

// Picks the paths whose key is `key`.
INLINE Subset subset_where(__local const uint *keys, uint key, uint of, __local uint *words) {
    Subset subset = {words, of, 0};
#ifdef COMPRESS_BY_MASK
    for (uint first = 0; first < of; first += LANE_COUNT) {
        const int16 equal = as_int16(load_lanes((__local const float *)keys + first)) == (int16)((int)key);
        uint bits = (uint)__builtin_ia32_cvtd2mask512(equal) & 0xffffu;
        bits &= of - first < LANE_COUNT ? (1u << (of - first)) - 1u : 0xffffu;
        words[first / LANE_COUNT] = bits;
        subset.count += (uint)__builtin_popcount(bits);
    }
#else
    for (uint i = 0; i < of; i++) {
        words[subset.count] = i;
        subset.count += keys[i] == key;
    }
#endif
    return subset;
}

// What is picked of the plane `from`, one behind the other. `to` may be the same plane. The sixteen floats
// behind the last are lost.
INLINE void compact_plane(__local float *to, __local const float *from, const Subset *subset) {
#ifdef COMPRESS_BY_MASK
    for (uint first = 0; first < subset->of; first += LANE_COUNT) {
        const uint bits = subset->words[first / LANE_COUNT];
        const float16 all = load_lanes(from + first);
        store_lanes(to, __builtin_ia32_compresssf512_mask(all, all, (ushort)bits));
        to += (uint)__builtin_popcount(bits);
    }
#else
    // Places grow, so that what is read is not overwritten yet.
    __local const uint *words = subset->words;
    const int count = (int)subset->count;
    LANES
    for (int i = 0; i < count; i++)
        to[i] = from[words[i]];
#endif
}

// The places of those that are picked, counted from `base`.
INLINE void list_subset(__local uint *list, const Subset *subset, uint base) {
#ifdef COMPRESS_BY_MASK
    int16 place = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (int)base;
    for (uint first = 0; first < subset->of; first += LANE_COUNT) {
        const uint bits = subset->words[first / LANE_COUNT];
        const int16 kept_places = __builtin_ia32_compresssi512_mask(place, place, (ushort)bits);
        store_lanes((__local float *)list, as_float16(kept_places));
        list += (uint)__builtin_popcount(bits);
        place += (int)LANE_COUNT;
    }
#else
    __local const uint *words = subset->words;
    const int count = (int)subset->count;
    LANES
    for (int i = 0; i < count; i++)
        list[i] = words[i] + base;
#endif
}
