#include "scalar.cl"

// The stack of dielectrics that enclose a point: C. M. Schmidt and B. Budge, Simple Nested Dielectrics in
// Ray Traced Images, JGT 7(2), 2002. It is sorted by priority; its first entry is the medium that is seen,
// the others are covered by it. Four 16-bit material indices, MEDIUM_NONE where there is none.

typedef struct {
    uint entry[MEDIUM_STACK_SIZE];
} MediumStack;

INLINE MediumStack load_medium_stack(__global const uint *path_bits, uint stride, uint path) {
    uint low = path_bits[PATH_MEDIUM_0 * stride + path];
    uint high = path_bits[PATH_MEDIUM_1 * stride + path];
    MediumStack stack;
    stack.entry[0] = low & 0xffffu;
    stack.entry[1] = low >> 16;
    stack.entry[2] = high & 0xffffu;
    stack.entry[3] = high >> 16;
    return stack;
}

INLINE void store_medium_stack(__global uint *path_bits, uint stride, uint path, const MediumStack *stack) {
    path_bits[PATH_MEDIUM_0 * stride + path] = stack->entry[0] | (stack->entry[1] << 16);
    path_bits[PATH_MEDIUM_1 * stride + path] = stack->entry[2] | (stack->entry[3] << 16);
}

// The higher wins; 0 is the highest of all.
INLINE uint effective_priority(__global const Material *materials, uint material) {
    uint priority = materials[material].priority;
    return priority == 0u ? 0xffffffffu : priority;
}

// Puts a medium above all that do not win over it. The lowest entry of a full stack is forgotten.
INLINE void enter_medium(MediumStack *stack, __global const Material *materials, uint material) {
    uint priority = effective_priority(materials, material);
    uint carried = material;
    int placed = 0;
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        uint here = stack->entry[i];
        if (!placed && here != MEDIUM_NONE && effective_priority(materials, here) > priority)
            continue;
        placed = 1;
        stack->entry[i] = carried;
        carried = here;
    }
}

// Takes the first entry of that medium out; returns whether there was one.
INLINE int leave_medium(MediumStack *stack, uint material) {
    int found = 0;
    for (uint i = 0u; i < MEDIUM_STACK_SIZE; i++) {
        found |= stack->entry[i] == material;
        if (found)
            stack->entry[i] = i + 1u < MEDIUM_STACK_SIZE ? stack->entry[i + 1u] : MEDIUM_NONE;
    }
    return found;
}

INLINE float medium_ior(__global const Material *materials, uint medium) {
    return medium == MEDIUM_NONE ? 1.0f : materials[medium].ior;
}

// What a medium lets through over a distance in metres, which may be infinite (Beer and Lambert).
INLINE Vec3 transmittance(__global const Material *materials, uint medium, float distance) {
    if (medium == MEDIUM_NONE)
        return vec3(1.0f, 1.0f, 1.0f);
    __global const float *a = materials[medium].absorption;
    return vec3(a[0] > 0.0f ? exp(-a[0] * distance) : 1.0f, a[1] > 0.0f ? exp(-a[1] * distance) : 1.0f,
                a[2] > 0.0f ? exp(-a[2] * distance) : 1.0f);
}
