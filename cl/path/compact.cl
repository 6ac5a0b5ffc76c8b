#include "base/scalar.cl"

// Appends the paths of `list` (all paths of the chunk where `takes_all` is 1) to up to three lists, by the
// class that each list asks for; the lists grow from the lengths that they have. Terminated paths are in no
// list, so that they cost nothing from here on. The order in which paths stand in a list depends on the
// device's timing; no result does, since a path only writes to itself.
__kernel void compact(LAUNCH_PARAMETERS, LIST_PARAMETERS, PATH_STATE_PARAMETERS, COMPACTION_PARAMETERS) {
    __global const uint *classes = (__global const uint *)paths + PATH_CLASS * params.path_stride;
    uint count = takes_all ? params.path_count : lengths[length_place];
    uint begin = (uint)get_global_id(0) * COMPACT_BLOCK;
    uint end = begin + COMPACT_BLOCK < count ? begin + COMPACT_BLOCK : count;
    uint count_0 = 0u, count_1 = 0u, count_2 = 0u;
    for (uint i = begin; i < end; i++) {
        uint path_class = classes[takes_all ? i : list[i]];
        count_0 += (path_class & class_0) != 0u;
        count_1 += (path_class & class_1) != 0u;
        count_2 += (path_class & class_2) != 0u;
    }
    uint place_0 = count_0 ? atomic_add(&lengths[length_0], count_0) : 0u;
    uint place_1 = count_1 ? atomic_add(&lengths[length_1], count_1) : 0u;
    uint place_2 = count_2 ? atomic_add(&lengths[length_2], count_2) : 0u;
    for (uint i = begin; i < end; i++) {
        uint path = takes_all ? i : list[i];
        uint path_class = classes[path];
        if (path_class & class_0)
            list_0[place_0++] = path;
        if (path_class & class_1)
            list_1[place_1++] = path;
        if (path_class & class_2)
            list_2[place_2++] = path;
    }
}
