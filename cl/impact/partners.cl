#include "path/tile.cl"

// Lists the paths that met something that changed, so that they are traced in the scene before it as well.
//
// A work-item looks at COMPACT_BLOCK paths, in the order of the path buffer. `partner_count` counts those of
// each work-item; the host sums the counts up, so that `list_partners` puts paths in the list in the same
// order each time.

// Whether a path gets a partner if it met something that changed: its slot says so.
INLINE int may_have_partner(const Params *params, __global const Slot *slots, uint place) {
    uint tile_pixels = params->tile_size * params->tile_size;
    return (slots[quotient(place, tile_pixels)].flags & SLOT_SINGLE) == 0u;
}

// `partner_place` has 1 for paths that met something that changed, else 0.
__kernel void count_partners(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, PARTNERS_PARAMETERS) {
    uint begin = (uint)get_global_id(0) * COMPACT_BLOCK;
    uint end = MIN(begin + COMPACT_BLOCK, params.path_count);
    uint count = 0u;
    for (uint place = begin; place < end; place++)
        count += partner_place[place] && may_have_partner(&params, slots, place);
    if (begin < end)
        partner_counts[get_global_id(0)] = count;
}

// Puts into `partner_place` of each path its place in the list, NO_PARTNER where it has none but met
// something that changed, and NO_INDEX where it met nothing of it. `partner_counts` has the paths listed
// before.
__kernel void list_partners(LAUNCH_PARAMETERS, SLOTS_PARAMETERS, PARTNERS_PARAMETERS) {
    uint begin = (uint)get_global_id(0) * COMPACT_BLOCK;
    uint end = MIN(begin + COMPACT_BLOCK, params.path_count);
    uint next = begin < end ? partner_counts[get_global_id(0)] : 0u;
    for (uint place = begin; place < end; place++) {
        uint touched = partner_place[place];
        int listed = touched && may_have_partner(&params, slots, place);
        if (listed)
            partners[next] = place;
        partner_place[place] = listed ? next : touched ? NO_PARTNER : NO_INDEX;
        next += listed;
    }
}
