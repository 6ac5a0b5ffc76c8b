// Entries that one work-item looks at: few atomics, and enough work-items for a GPU.
#define COMPACT_BLOCK 64u

// Appends the paths of `list` (all paths up to `count` where `all` is 1) whose class has a bit of
// `first_bits` to first_list, and those with a bit of `second_bits` to second_list; the lengths go to
// counters[0] and [1], which the caller has set to 0. Terminated paths so cost nothing from here on.
// The order of the blocks depends on the device's timing; no result does, since a path only writes to itself.
__kernel void compact(const Params params, const uint count, const uint all, __global const uint *list,
                      __global const float *paths, const uint first_bits, __global uint *first_list,
                      const uint second_bits, __global uint *second_list, __global uint *counters) {
    __global const uint *classes = (__global const uint *)paths + PATH_CLASS * params.path_stride;
    uint begin = (uint)get_global_id(0) * COMPACT_BLOCK;
    uint end = begin + COMPACT_BLOCK < count ? begin + COMPACT_BLOCK : count;
    uint first_count = 0u, second_count = 0u;
    for (uint i = begin; i < end; i++) {
        uint path_class = classes[all ? i : list[i]];
        first_count += (path_class & first_bits) != 0u;
        second_count += (path_class & second_bits) != 0u;
    }
    uint first = first_count ? atomic_add(&counters[0], first_count) : 0u;
    uint second = second_count ? atomic_add(&counters[1], second_count) : 0u;
    for (uint i = begin; i < end; i++) {
        uint path = all ? i : list[i];
        uint path_class = classes[path];
        if (path_class & first_bits)
            first_list[first++] = path;
        if (path_class & second_bits)
            second_list[second++] = path;
    }
}
