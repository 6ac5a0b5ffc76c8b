// Features with a number have a bit for each of several things that a scene may have. What none of its
// materials has is left out when kernels are built.

// Which of TextureSlot some material reads textures for.
#ifndef TEXTURES
#define TEXTURES 0u
#endif
#define TEXTURED(slot) (TEXTURES >> SLOT_OF_##slot & 1u)

// Which of MaterialTrait some material has.
#ifndef TRAITS
#define TRAITS 0u
#endif
#define HAS_TRAIT(trait) (TRAITS >> TRAIT_##trait & 1u)

// Whether a clearcoat has a normal that is not that of its base.
#if HAS_TRAIT(CLEARCOAT) && (TEXTURED(NORMAL) || TEXTURED(BUMP) || TEXTURED(CLEARCOAT_NORMAL))
#define COAT_NORMALS
#define COAT_NORMAL(surface) (surface)->coat
#else
#define COAT_NORMAL(surface) (surface)->shading
#endif
// Whether surfaces have more to be set up than a hit tells.
#if TEXTURED(NORMAL) || TEXTURED(BUMP) || defined(COAT_NORMALS) || HAS_TRAIT(ANISOTROPY)
#define TANGENTS
#endif
