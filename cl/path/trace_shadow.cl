#include "path/trace.cl"

// Traces shadow rays, and adds the radiance of those that nothing is in the way of to what paths have
// gathered. The hint keeps compilers from making SIMD lanes of work-items, as Intel's would: the lanes are
// boxes and triangles.
__kernel __attribute__((vec_type_hint(float8))) void
trace_shadow(LAUNCH_PARAMETERS, LIST_PARAMETERS, GEOMETRY_PARAMETERS, PATH_STATE_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    if (!is_occluded(&geometry, &state, path))
        accumulate(&state, params.first_path + path, load_light_sample(&state, path).radiance);
}
