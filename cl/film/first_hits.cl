#include "path/surface_material.cl"

// Auxiliary values of the first hit, from rays through pixel centres. `first_surface` has seven planes over
// the pixels: shading normal, distance along the ray in metres, base colour; a miss has distance infinity.
__kernel void first_hits(LAUNCH_PARAMETERS, SHADING_PARAMETERS, PATH_STATE_PARAMETERS,
                         FIRST_HITS_PARAMETERS) {
    const State state = STATE_OF(params);
    uint path = (uint)get_global_id(0);
    if (path >= params.path_count || load_class(&state, path) == 0u)
        return;
    uint pixel = load_path(&state, path).pixel;
    Surface surface = load_surface(&state, path);
    int missed = surface.object == NO_INDEX;
    Vec3 nothing = vec3(0.0f, 0.0f, 0.0f);
    object_ids[pixel] = surface.object;
    // What a ray that missed has left there is no index.
    surface.material &= INDEX_MASK(surface.object);
    surface.face &= INDEX_MASK(surface.object);
    surface.object = INDEX_OR_0(surface.object);
    const Shading shading = {SHADING_ARGUMENTS};
    Vec3 color = seen_color(&shading, &surface);
    store3(first_surface, pixels, pixel, select(missed, nothing, surface.shading));
    first_surface[3u * pixels + pixel] = missed ? INFINITY : surface.distance;
    store3(first_surface + 4u * pixels, pixels, pixel, select(missed, nothing, color));
}
