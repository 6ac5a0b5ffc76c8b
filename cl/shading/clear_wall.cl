#include "base/features.cl"
#include "shading/fresnel.cl"

// Thin walls that rays go straight through where they are traced: of a ray that meets one, `transmission`
// times what the wall does not reflect passes. Those that end there are on what is opaque of it, or mirrored.

#if HAS_TRAIT(CLEAR_WALL)
// Colours at corners would tint what goes through.
INLINE int is_clear_wall(const Shading *shading, __global const Material *material, uint object) {
    int clear = (material->flags & MATERIAL_CLEAR_WALL) != 0u;
#ifdef VERTEX_COLORS
    clear &= shading->attributes[object].has_color == 0u;
#endif
    return clear;
}

// The share of all rays that it mirrors, at this cosine to its normal.
INLINE float wall_share(__global const Material *material, float cosine) {
    return material->transmission * material->specular * wall_reflectance(cosine, material->ior);
}
#endif
