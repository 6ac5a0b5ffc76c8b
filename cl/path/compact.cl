// Appends the paths of `list` (all paths up to `count` where `all` is 1) to up to three lists, by the class
// that each list asks for; the lengths go to counters[0 .. 2], which the caller has set. Terminated paths so
// cost nothing from here on. The order of the blocks depends on the device's timing; no result does, since a
// path only writes to itself.
__kernel void compact(const Params params, const uint count, const uint all, __global const uint *list,
                      __global const float *paths, const uint class_0, __global uint *list_0,
                      const uint class_1, __global uint *list_1, const uint class_2, __global uint *list_2,
                      __global uint *counters) {
    __global const uint *classes = (__global const uint *)paths + PATH_CLASS * params.path_stride;
    uint begin = (uint)get_global_id(0) * COMPACT_BLOCK;
    uint end = begin + COMPACT_BLOCK < count ? begin + COMPACT_BLOCK : count;
    uint count_0 = 0u, count_1 = 0u, count_2 = 0u;
    for (uint i = begin; i < end; i++) {
        uint path_class = classes[all ? i : list[i]];
        count_0 += (path_class & class_0) != 0u;
        count_1 += (path_class & class_1) != 0u;
        count_2 += (path_class & class_2) != 0u;
    }
    uint place_0 = count_0 ? atomic_add(&counters[0], count_0) : 0u;
    uint place_1 = count_1 ? atomic_add(&counters[1], count_1) : 0u;
    uint place_2 = count_2 ? atomic_add(&counters[2], count_2) : 0u;
    for (uint i = begin; i < end; i++) {
        uint path = all ? i : list[i];
        uint path_class = classes[path];
        if (path_class & class_0)
            list_0[place_0++] = path;
        if (path_class & class_1)
            list_1[place_1++] = path;
        if (path_class & class_2)
            list_2[place_2++] = path;
    }
}
