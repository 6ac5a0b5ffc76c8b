#include "path/state.cl"

// What a path carries to the end of a ray that is so long: what is left behind absorption on the way. The
// variant MEDIA serves scenes with transparent bodies.
INLINE Vec3 carried_along(const Shading *shading, const State *state, uint path, Vec3 throughput,
                          float distance) {
#ifdef MEDIA
    uint medium = load_medium_stack(state, path).entry[0];
    throughput = mul(throughput, transmittance(shading->materials, medium, distance));
#endif
    return throughput;
}
