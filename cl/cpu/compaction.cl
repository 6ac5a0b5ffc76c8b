#include "cpu/lanes.cl"

// Compaction: the paths of a subset move together, plane by plane, so that the loops which follow go over
// neighbours. AVX-512 compresses a plane several times as fast as a loop over a list of places can gather it.

#if defined(__AVX512DQ__) && defined(__clang__) && !defined(PORTABLE_LANES)
#define COMPRESS_BY_MASK
#endif

// Some of the first `of` paths of a block. With COMPRESS_BY_MASK there is a word for each sixteen paths, with
// a bit for each of them; else `words` are the places of the paths in the subset.
typedef struct {
    __local uint *words;
    uint of, count;
} Subset;

// The paths whose key is `key`.
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

// Writes the values of a subset, which stand in the plane `from`, one after the other to `to`, which may be
// the same plane. The sixteen floats behind the last value are overwritten too.
INLINE void compact_plane(__local float *to, __local const float *from, const Subset *subset) {
    if (subset->count == 0)
        return;
#ifdef COMPRESS_BY_MASK
    for (uint first = 0; first < subset->of; first += LANE_COUNT) {
        const uint bits = subset->words[first / LANE_COUNT];
        const float16 all = load_lanes(from + first);
        store_lanes(to, __builtin_ia32_compresssf512_mask(all, all, (ushort)bits));
        to += (uint)__builtin_popcount(bits);
    }
#else
    // Places grow along the list, so that no value is overwritten before it is read.
    __local const uint *words = subset->words;
    const int count = (int)subset->count;
    LANES
    for (int i = 0; i < count; i++)
        to[i] = from[words[i]];
#endif
}

// Lists the places of the paths of a subset, counted from `base`.
INLINE void list_subset(__local uint *list, const Subset *subset, uint base) {
#ifdef COMPRESS_BY_MASK
    int16 place = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) + (int)base;
    for (uint first = 0; first < subset->of; first += LANE_COUNT) {
        const uint bits = subset->words[first / LANE_COUNT];
        const int16 places = __builtin_ia32_compresssi512_mask(place, place, (ushort)bits);
        store_lanes((__local float *)list, as_float16(places));
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
