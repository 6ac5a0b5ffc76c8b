#include "base/lanes8.cl"
#include "base/sampling.cl"

// The light tree (incpt/tables/light_tree.py): from the root down, a child of each node is chosen by what its
// lights may bring to a receiver (A. Conty Estevez and C. Kulla, Importance Sampling of Many Lights with
// Adaptive Tree Splitting, HPG 2018). Children are lanes of a vector, so that a node takes one turn.

// What lights are chosen for: a point, and the side of a surface there that may be lit. Where light counts
// from all sides, `all_sides` is 1, else 0.
typedef struct {
    Vec3 position, normal;
    float all_sides;
} Receiver;

// A light as light sampling has chosen it.
typedef struct {
    uint number;  // see layout.LIGHT_NODE; NO_INDEX: the choice has turned elsewhere
    float chance; // that it is chosen among the lights of the tree
} ChosenLight;

// The least that the cosines count for, at a light and at a receiver. Bounds say what lights cannot reach;
// but light that is never chosen would be lost where rounding is on the wrong side of a bound.
#define LEAST_FACING 0.01f

#define LIGHT_MIN8(a, b) ((a) < (b) ? (a) : (b))
#define LIGHT_MAX8(a, b) ((a) > (b) ? (a) : (b))
#define LIGHT_CLAMP8(x, low, high) LIGHT_MIN8(LIGHT_MAX8(x, (float8)(low)), (float8)(high))

// 1 / sqrt(x), relative error below 5e-6, for x above 1e-30. The cones of narrow spots magnify it.
INLINE float8 light_rsqrt(const float8 x) {
#if defined(__AVX__) && defined(__clang__) && !defined(PORTABLE_LANES)
    const float8 y = __builtin_ia32_rsqrtps256(x);
#else
    float8 y = as_float8(0x5f375a86 - (as_int8(x) >> 1));
    y = y * (1.5f - 0.5f * x * y * y);
#endif
    return y * (1.5f - 0.5f * x * y * y);
}

#define LIGHT_PLANE(node, plane) (*(__global const float8 *)((node)->planes[LIGHT_NODE_##plane]))

// What the children of a node may bring: power over squared distance, less where they shine elsewhere or
// stand low over the receiver. Of the lights in a ball it is known that they are not farther off than its
// radius, seen from the receiver, be it in height over its surface, or in the angle to their normals. So the
// bounds are above 0 wherever any of them may bring something, and take no angles. Everything changes
// steadily with the place of the receiver, of which the ray that meets a light knows a little less than the
// sample did.
INLINE float8 light_importance(__global const LightNode *node, const Receiver *receiver) {
    const float8 x = LIGHT_PLANE(node, CENTER_X) - receiver->position.x;
    const float8 y = LIGHT_PLANE(node, CENTER_Y) - receiver->position.y;
    const float8 z = LIGHT_PLANE(node, CENTER_Z) - receiver->position.z;
    const float8 radius = LIGHT_PLANE(node, RADIUS);
    const float8 distance2 = LIGHT_MAX8(x * x + y * y + z * z, radius * radius);
    const float8 inverse = light_rsqrt(LIGHT_MAX8(distance2, (float8)(1e-20f)));
    const float8 seen = radius * inverse;

    // At the lights: the cosine to the nearest of the normals, and how far that may be off. Where lights
    // shine everywhere, as among many they do, there is nothing to ask.
    float8 shining = (float8)(1.0f);
    if (node->directed) {
        const float8 facing =
            -(LIGHT_PLANE(node, AXIS_X) * x + LIGHT_PLANE(node, AXIS_Y) * y + LIGHT_PLANE(node, AXIS_Z) * z) *
            inverse;
        const float8 cos_spread = LIGHT_PLANE(node, COS_SPREAD);
        const float8 sine2 = LIGHT_MAX8(1.0f - facing * facing, (float8)(1e-12f));
        const float8 aside = facing * cos_spread + sine2 * light_rsqrt(sine2) * LIGHT_PLANE(node, SIN_SPREAD);
        const float8 nearest = facing >= cos_spread ? (float8)(1.0f) : aside;
        const float8 bound =
            (nearest + 1.5708f * seen - LIGHT_PLANE(node, COS_FALLOFF)) * LIGHT_PLANE(node, FALLOFF_SCALE);
        shining = LIGHT_CLAMP8(bound, LEAST_FACING, 1.0f);
    }

    // At the receiver: the sine of the greatest height.
    const float8 height =
        (receiver->normal.x * x + receiver->normal.y * y + receiver->normal.z * z) * inverse;
    const float8 lit = height + seen + receiver->all_sides;

    return LIGHT_PLANE(node, POWER) * LIGHT_MAX8(inverse * inverse, (float8)(1e-18f)) * shining *
           LIGHT_CLAMP8(lit, LEAST_FACING, 1.0f);
}

// Sums of the first one, two ... of eight floats.
INLINE float8 light_sums(float8 x) {
    x += (float8)(0.0f, x.s0123, x.s45, x.s6);
    x += (float8)(0.0f, 0.0f, x.s0123, x.s45);
    return x + (float8)(0.0f, 0.0f, 0.0f, 0.0f, x.s0123);
}

// On the way from the root to a light.
typedef struct {
    float choice; // what is left of the random number, in [0, 1)
    uint node;    // or, at the end, NODE_LEAF | number of the light
    float chance; // of coming here
} LightWalk;

// One node further.
INLINE void light_step(__global const LightNode *nodes, const Receiver *receiver, LightWalk *walk) {
    __global const LightNode *node = nodes + walk->node;
    const float8 importance = light_importance(node, receiver), sums = light_sums(importance);
    const float *each = (const float *)&importance, *ends = (const float *)&sums;
    const float total = ends[BVH_WIDTH - 1u], target = walk->choice * total;
    // Behind the last child, where rounding may lead, sums go on as they are.
    const uint behind = COUNT_BITS(lane_bits(sums <= target));
    const uint chosen = MIN(behind, node->last);
    const float size = each[chosen];
    const float left = (target - (ends[chosen] - size)) / size;
    const float least = left > 0.0f ? left : 0.0f;
    walk->choice = least < 0.99999994f ? least : 0.99999994f;
    walk->chance *= size / total;
    walk->node = node->child[chosen];
}

// The chance with which the light of that trail is chosen for a receiver.
INLINE float chance_of_light(const Params *params, const Emitters *emitters, const Receiver *receiver,
                             uint trail) {
    float chance = 1.0f;
    uint place = 0u;
    for (uint level = 0u; level < params->light_levels; level++) {
        __global const LightNode *node = emitters->light_nodes + place;
        const float8 importance = light_importance(node, receiver), sums = light_sums(importance);
        const uint child = trail & (BVH_WIDTH - 1u);
        chance *= ((const float *)&importance)[child] / ((const float *)&sums)[BVH_WIDTH - 1u];
        place = node->child[child];
        trail >>= LIGHT_TREE_BITS;
    }
    return chance;
}

// A direction in 32 bits, by the octahedral map (Cigolle et al., Survey of Efficient Representations for
// Independent Unit Vectors, JCGT 3(2), 2014). Never NO_INDEX, which says that there is none.
#define NORMAL_STEPS 65534.0f

INLINE uint packed_normal(Vec3 n) {
    float size = FABS(n.x) + FABS(n.y) + FABS(n.z);
    float x = n.x / size, y = n.y / size;
    float folded_x = (1.0f - FABS(y)) * (x < 0.0f ? -1.0f : 1.0f);
    float folded_y = (1.0f - FABS(x)) * (y < 0.0f ? -1.0f : 1.0f);
    x = n.z < 0.0f ? folded_x : x;
    y = n.z < 0.0f ? folded_y : y;
    uint u = (uint)(CLAMP(0.5f * x + 0.5f, 0.0f, 1.0f) * NORMAL_STEPS + 0.5f);
    uint v = (uint)(CLAMP(0.5f * y + 0.5f, 0.0f, 1.0f) * NORMAL_STEPS + 0.5f);
    return IN_FIELD(v, NORMAL_V) | IN_FIELD(u, NORMAL_U);
}

INLINE Vec3 unpacked_normal(uint bits) {
    float x = (float)FIELD(bits, NORMAL_U) * (2.0f / NORMAL_STEPS) - 1.0f;
    float y = (float)FIELD(bits, NORMAL_V) * (2.0f / NORMAL_STEPS) - 1.0f;
    float z = 1.0f - FABS(x) - FABS(y);
    float fold = MAX(-z, 0.0f);
    x += x < 0.0f ? fold : -fold;
    y += y < 0.0f ? fold : -fold;
    return normalize(vec3(x, y, z));
}

// A receiver by its packed normal, so that sample and ray see the same one.
INLINE Receiver receiver_at(Vec3 position, uint normal) {
    Receiver receiver;
    receiver.position = position;
    receiver.normal = unpacked_normal(normal);
    receiver.all_sides = normal == NO_INDEX ? 1.0f : 0.0f;
    return receiver;
}
