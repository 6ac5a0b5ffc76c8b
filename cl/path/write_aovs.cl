#include "path/surface_material.cl"

// Auxiliary images from the samples of the picture: base colour and shading normal of the first surface, and
// whether there is one, or a light.

// Writes these for a path at `place` of the planes of the path buffer; 0 where its ray left the scene.
INLINE void write_aovs_path(const Shading *shading, const State *state, uint path,
                            __global float *path_buffer, uint stride, uint place) {
    Surface surface = load_surface(state, path);
    int missed = surface.object == NO_INDEX;
    Vec3 nothing = vec3(0.0f, 0.0f, 0.0f);
    // What a ray that missed has left there is no index.
    surface.material &= INDEX_MASK(surface.object);
    surface.face &= INDEX_MASK(surface.object);
    surface.object = INDEX_OR_0(surface.object);
    Vec3 albedo = select(missed, nothing, seen_color(shading, &surface));
    Vec3 normal = select(missed, nothing, surface.shading);
    path_buffer[SAMPLE_ALBEDO_R * stride + place] = albedo.x;
    path_buffer[SAMPLE_ALBEDO_G * stride + place] = albedo.y;
    path_buffer[SAMPLE_ALBEDO_B * stride + place] = albedo.z;
    path_buffer[SAMPLE_NORMAL_X * stride + place] = normal.x;
    path_buffer[SAMPLE_NORMAL_Y * stride + place] = normal.y;
    path_buffer[SAMPLE_NORMAL_Z * stride + place] = normal.z;
#ifndef BLOCKS
    path_buffer[SAMPLE_ALPHA * stride + place] = surface.distance < INFINITY ? 1.0f : 0.0f;
#endif
}

#ifndef BLOCKS
__kernel void write_aovs(LAUNCH_PARAMETERS, LIST_PARAMETERS, SHADING_PARAMETERS, PATH_STATE_PARAMETERS) {
    RETURN_IF_GROUP_IS_IDLE(lengths[length_place])
    const State state = STATE_OF(params);
    const Shading shading = {SHADING_ARGUMENTS};
    const WorkItem item = listed_path(&params, lengths[length_place], list);
    write_aovs_path(&shading, &state, item.path, radiance, state.radiance_stride, item.result);
}
#endif
