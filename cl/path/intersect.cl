// Finds the nearest hit of each path's ray and describes the surface there.

#include "path/setup_surface.cl"
#include "path/trace.cl"

// The hint keeps compilers from making SIMD lanes of work-items (Intel's would): the lanes are boxes and
// triangles.
__kernel __attribute__((vec_type_hint(float8))) void
intersect(const Params params, const uint count, __global const uint *list, __global const Node *top_nodes,
          __global const TrianglePack *top_packs, __global const Node *nodes,
          __global const TrianglePack *packs, __global const Object *objects,
          __global const Material *materials, __global const float *normals, __global float *rays,
          __global float *paths, __global float *hits) {
    if (get_global_id(0) >= count)
        return;
    const uint path = list[get_global_id(0)];
    const State state = {rays, paths, hits, 0, 0, params.path_stride, params.buffer_stride};
    const Geometry geometry = {top_nodes, top_packs, nodes, packs, objects, normals};
    if (trace_path(&geometry, &state, path)) {
        setup_surface_path(&geometry, &state, path);
        store_bits(paths, PATH_CLASS * state.stride + path,
                   surface_class(&geometry, materials, &state, path));
    } else {
        store_bits(paths, PATH_CLASS * state.stride + path, CLASS_MISS);
    }
}
