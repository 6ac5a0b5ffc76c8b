#include "path/map_normal.cl"
#include "path/setup_surface.cl"
#include "path/trace.cl"

// Finds the nearest hit of each path's ray, and what the surface is like there. The hint keeps compilers from
// making SIMD lanes of work-items, as Intel's would: the lanes are boxes and triangles.
__kernel __attribute__((vec_type_hint(float8))) void intersect(LAUNCH_PARAMETERS, LIST_PARAMETERS,
                                                               GEOMETRY_PARAMETERS, SHADING_PARAMETERS,
                                                               PATH_STATE_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    RawHit hit;
    if (!trace_path(&geometry, &state, path, &hit)) {
        store_bits(surfaces, SURFACE_OBJECT * state.stride + path, NO_INDEX);
        store_class(&state, path, CLASS_MISS);
        return;
    }
    Surface surface = surface_at(&geometry, &hit);
#if TEXTURED(NORMAL)
    const Shading shading = {SHADING_ARGUMENTS};
    map_normal(objects, &shading, &surface);
#endif
    store_surface(&state, path, &surface);
    store_class(&state, path, hit_class(&geometry, materials, hit.object, is_in_medium(&state, path)));
}
