#include "base/features.cl"
#include "base/scalar.cl"

// The stack of dielectrics that enclose a point: C. M. Schmidt and B. Budge, Simple Nested Dielectrics in
// Ray Traced Images, JGT 7(2), 2002. It is sorted by priority; its first entry is the medium that is seen,
// the others are covered by it. Each entry is the index of a material, or MEDIUM_NONE.

typedef struct {
    uint entry[MEDIUM_STACK_SIZE];
} MediumStack;

// The properties of a medium. MEDIUM_NONE gives those of some material, because all lanes read one; by
// arithmetic, as INDEX_OR_0.
INLINE __global const Material *medium_material(__global const Material *materials, uint medium) {
    return &materials[medium & (((medium + 1u) >> 16) - 1u)];
}

// The higher wins; 0 is the highest of all.
INLINE uint effective_priority(__global const Material *materials, uint medium) {
    uint priority = medium_material(materials, medium)->priority;
    return priority == 0u ? 0xffffffffu : priority;
}

// Puts a medium above all that do not win over it. The lowest entry of a full stack is forgotten.
INLINE void enter_medium(MediumStack *stack, __global const Material *materials, uint material) {
    uint priority = effective_priority(materials, material);
    uint carried = material;
    int placed = 0;
#pragma unroll
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        uint here = stack->entry[i];
        int wins = (here != MEDIUM_NONE) & (effective_priority(materials, here) > priority);
        placed |= !wins;
        stack->entry[i] = placed ? carried : here;
        carried = placed ? here : carried;
    }
}

// Takes the first entry of that medium out; returns whether there was one.
INLINE int leave_medium(MediumStack *stack, uint material) {
    int found = 0;
#pragma unroll
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        uint next = i + 1u < MEDIUM_STACK_SIZE ? stack->entry[(i + 1u) % MEDIUM_STACK_SIZE] : MEDIUM_NONE;
        found |= stack->entry[i] == material;
        stack->entry[i] = found ? next : stack->entry[i];
    }
    return found;
}

INLINE float medium_ior(__global const Material *materials, uint medium) {
    float ior = medium_material(materials, medium)->ior;
    return medium == MEDIUM_NONE ? 1.0f : ior;
}

#if HAS_TRAIT(DISPERSION)
// How much higher the index of refraction is in blue than in green, and in green than in red.
INLINE float medium_spread(__global const Material *materials, uint medium) {
    __global const Material *material = medium_material(materials, medium);
    // A twentieth of Abbe's number from end to end (KHR_materials_dispersion).
    float spread = 0.025f * (material->ior - 1.0f) * material->dispersion;
    return medium == MEDIUM_NONE ? 0.0f : spread;
}

// Where colours `part`, a path goes on with one of them, chosen by what it carries of each, and carries all
// of that in it. Returns -1, 0, 1 for red, green, blue, and 0 where they don't part.
INLINE float follow_channel(Vec3 *throughput, float luck, int part) {
    float r = throughput->x, g = throughput->y, b = throughput->z;
    float sum = r + g + b, place = luck * sum;
    int is_red = (place < r) | (g + b == 0.0f);
    int is_green = (!is_red) & ((place < r + g) | (b == 0.0f));
    Vec3 followed = vec3(is_red ? sum : 0.0f, is_green ? sum : 0.0f, is_red | is_green ? 0.0f : sum);
    *throughput = select(part, followed, *throughput);
    return part ? (is_red ? -1.0f : (is_green ? 0.0f : 1.0f)) : 0.0f;
}
#endif

// What a medium lets through over a distance in metres, which may be infinite (Beer and Lambert). The variant
// CLEAR_MEDIA serves scenes whose media absorb nothing.
INLINE Vec3 transmittance(__global const Material *materials, uint medium, float distance) {
#ifdef CLEAR_MEDIA
    return vec3(1.0f, 1.0f, 1.0f);
#else
    int vacuum = medium == MEDIUM_NONE;
    __global const float *a = medium_material(materials, medium)->absorption;
    Vec3 depth = vec3(a[0] > 0.0f ? a[0] * distance : 0.0f, a[1] > 0.0f ? a[1] * distance : 0.0f,
                      a[2] > 0.0f ? a[2] * distance : 0.0f);
    depth = select(vacuum, vec3(0.0f, 0.0f, 0.0f), depth);
    return vec3(exp_negative(-depth.x), exp_negative(-depth.y), exp_negative(-depth.z));
#endif
}
