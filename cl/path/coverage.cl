#include "path/setup_surface.cl"
#include "shading/clear_wall.cl"

// Cut-outs: leaves, fences, gauze. A surface covers a share of what is behind it; a ray that meets it ends
// there by that chance and goes on behind it otherwise, whatever kind of ray it is. So light that comes
// through is found by every technique with the same chance, and nothing but tracing knows of it. Only scenes
// with such materials ask (the variant CUTOUTS). Clear walls are of their kind: what they let through goes
// straight on, so that light behind a window is sampled as if there were none.

#ifdef CUTOUTS
// The point of a hit, as far as it takes to look up what a mesh has at corners.
typedef struct {
    uint object, face;
    Vec3 weight;
} HitPoint;

// Of what a ray that missed has left, some point.
INLINE HitPoint hit_point(const Geometry *geometry, const RawHit *hit) {
    uint triangle = hit->triangle & INDEX_MASK(hit->object);
#ifdef TOP_LEVEL_ONLY
    __global const TrianglePack *packs = geometry->top_packs;
#else
    __global const TrianglePack *packs =
        FIELD(triangle, PLACE_ON_TOP) ? geometry->top_packs : geometry->packs;
#endif
    HitPoint point;
    point.object = INDEX_OR_0(hit->object);
    point.face = packs[FIELD(triangle, PLACE_PACK)].face[FIELD(triangle, PLACE_LANE)];
    point.face = INDEX_OR_0(point.face);
    Vec3 weight = vec3(hit->weight[0], hit->weight[1], hit->weight[2]);
    point.weight = scale(1.0f / (weight.x + weight.y + weight.z), weight);
    return point;
}

// The share of the ray's light that ends at a point: 1, or 0, where the material has a mask. `cosine` is that
// of the angle between ray and normal, by which clear walls mirror.
INLINE float coverage_at(const Geometry *geometry, const Shading *shading, const HitPoint *point,
                         float cosine) {
    __global const Material *material = &shading->materials[geometry->objects[point->object].material];
    float alpha = material->alpha;
#if TEXTURED(BASE_COLOR)
    Uvs uvs = uvs_at(shading, point->object, point->face, point->weight);
    alpha *= sample_texture(shading, material->textures[SLOT_OF_BASE_COLOR], &uvs).alpha;
#endif
#ifdef VERTEX_COLORS
    alpha *= vertex_color_at(shading, point->object, point->face, point->weight).alpha;
#endif
    float masked = alpha >= material->alpha_cutoff ? 1.0f : 0.0f;
    uint flags = material->flags;
    float coverage = flags & MATERIAL_MASKED ? masked : alpha;
    coverage = flags & MATERIAL_CUTOUT ? coverage : 1.0f;
#if HAS_TRAIT(CLEAR_WALL)
    float ends = 1.0f - material->transmission + wall_share(material, cosine);
    coverage = is_clear_wall(shading, material, point->object) ? ends : coverage;
#endif
    return coverage;
}

// Whether a ray of a path goes on behind its hit, which is number `layer` on its way. Shadow rays have
// numbers of their own.
INLINE int passes_hit(const Params *params, const Geometry *geometry, const Shading *shading,
                      const Path *path, const RawHit *hit, Vec3 direction, uint layer, int is_shadow) {
    HitPoint point = hit_point(geometry, hit);
    float cosine = 1.0f;
#if HAS_TRAIT(CLEAR_WALL)
    RawHit met = *hit;
    met.object = INDEX_OR_0(hit->object);
    met.triangle &= INDEX_MASK(hit->object);
    cosine = FABS(dot(surface_at(geometry, &met).geometric, direction));
#endif
    Uniform2 luck =
        uniform_2d(pixel_seed(path->pixel, params->seed), path->sample, PAIR_COVERAGE(path->ray, layer));
    float least = is_shadow ? luck.v : luck.u;
    int passes = (hit->object != NO_INDEX) & (least >= coverage_at(geometry, shading, &point, cosine));
#if HAS_TRAIT(CLEAR_WALL)
    // Who picks a window means it.
    uint material = geometry->objects[point.object].material;
    passes &= !(params->pixel_center & is_clear_wall(shading, shading->materials + material, point.object));
#endif
    return passes;
}

// Where a ray goes on behind its hit.
INLINE Vec3 behind_hit(const Geometry *geometry, const RawHit *hit, Vec3 direction) {
    Surface surface = surface_at(geometry, hit);
    float side = dot(surface.geometric, direction) > 0.0f ? 1.0f : -1.0f;
    return along(surface.position, side * surface.offset, surface.geometric);
}
#endif
