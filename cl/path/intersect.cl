#include "path/coverage.cl"
#include "path/tangents.cl"
#include "path/trace.cl"
#include "path/light_search.cl"
#include "path/shade_light.cl"

#if defined(CUTOUTS) || defined(SHAPED_LIGHTS) || defined(TANGENTS)
#define NEEDS_SHADING
#endif

// Finds the nearest hit of each path's ray, and what the surface is like there. The hint keeps compilers from
// making SIMD lanes of work-items, as Intel's would: the lanes are boxes and triangles.
__kernel __attribute__((vec_type_hint(float8))) void intersect(LAUNCH_PARAMETERS, LIST_PARAMETERS,
                                                               GEOMETRY_PARAMETERS, SHADING_PARAMETERS,
                                                               EMITTERS_PARAMETERS, PATH_STATE_PARAMETERS) {
    if (get_global_id(0) >= lengths[length_place])
        return;
    const uint path = list[get_global_id(0)];
    const State state = STATE_OF(params);
    const Geometry geometry = {GEOMETRY_ARGUMENTS};
    RawHit hit;
#ifdef NEEDS_SHADING
    const Shading shading = {SHADING_ARGUMENTS};
#endif
#ifdef CUTOUTS
    const Path p = load_path(&state, path);
    Ray ray = load_ray(rays, state.stride, path);
    float travelled = 0.0f;
    bool met = bvh_nearest(&geometry, ray, INFINITY, &hit);
    for (uint layer = 0u; met && layer < MOST_LAYERS; layer++) {
        if (!passes_hit(&params, &geometry, &shading, &p, &hit, ray.direction, layer, 0))
            break;
        travelled += hit.distance;
        ray.origin = behind_hit(&geometry, &hit, ray.direction);
        met = bvh_nearest(&geometry, ray, INFINITY, &hit);
    }
    hit.distance += travelled;
#else
    const bool met = trace_path(&geometry, &state, path, &hit);
#endif
#ifdef SHAPED_LIGHTS
    const Emitters emitters = {EMITTERS_ARGUMENTS};
    float distance = met ? hit.distance : INFINITY;
#ifdef LIGHT_TREE
    const uint light = nearest_tree_light(&params, &emitters, &state, path, &distance);
    if (light != NO_INDEX)
        weigh_met_shaped_light(&params, &emitters, &state, path, load_ray(rays, state.stride, path).origin,
                               light);
#else
    const uint light = nearest_light(&params, &emitters, &state, path, &distance);
#endif
    if (light != NO_INDEX) {
        shade_light_path(&params, &shading, &emitters, &state, path, params.first_path + path, light,
                         distance);
        surfaces[SURFACE_DISTANCE * state.stride + path] = distance;
        store_bits(surfaces, SURFACE_OBJECT * state.stride + path, NO_INDEX);
        store_class(&state, path, 0u);
        return;
    }
#endif
    if (!met) {
        surfaces[SURFACE_DISTANCE * state.stride + path] = INFINITY;
        store_bits(surfaces, SURFACE_OBJECT * state.stride + path, NO_INDEX);
        store_class(&state, path, CLASS_MISS);
        return;
    }
    Surface surface = surface_at(&geometry, &hit);
#ifndef FLAT
    settle_rise(materials, load_ray(rays, state.stride, path).direction, &surface);
#endif
#ifdef TANGENTS
    set_tangents(objects, &shading, &surface);
#endif
    store_surface(&state, path, &surface);
#ifdef TANGENTS
    store_tangents(&state, path, &surface);
#endif
    store_class(&state, path, hit_class(&geometry, materials, hit.object, is_in_medium(&state, path)));
}
