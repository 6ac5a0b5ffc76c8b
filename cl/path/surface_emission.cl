#include "path/surface_material.cl"
#include "scene/light.cl"

// What a surface emits towards the origin of the ray that has met it.

// The area density with which light sampling finds this point of an emitter: that of its material, in the
// share that its face has where a texture makes faces differ.
INLINE float emitter_density(const Shading *shading, const Surface *surface) {
    float density = shading->materials[surface->material].light_pdf;
#if TEXTURED(EMISSION)
    uint first = shading->first_share[surface->object];
    uint has = first != 0u;
    density *= shading->emitter_shares[first + has * surface->face];
#endif
    return density;
}

// What the surface emits towards the origin of the ray that has met it, see emitted_radiance.
INLINE Vec3 surface_emission(const Shading *shading, const Surface *surface, const SurfaceMaterial *m,
                             float facing, float bsdf_pdf) {
    return emitted_radiance(&shading->materials[surface->material], m->emission,
                            emitter_density(shading, surface), facing, surface->distance, bsdf_pdf);
}
