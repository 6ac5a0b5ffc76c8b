#include "base/scalar.cl"

// What pairs have brought for a pixel, and what follows from it; incpt/render/impact/README.md has the
// formulas.

// The kept picture of the old scene: its radiance, and the number of samples behind it.
typedef struct {
    Vec3 radiance;
    float samples;
} Anchor;

// Sums over one half of the samples of a pixel.
typedef struct {
    Vec3 new_sum, old_sum;
    float samples, pairs;
} Half;

// Those of both, with the moments; see layout.PairPlane.
typedef struct {
    Half halves[2];
    float new_moment, old_moment, joint_moment, touched;
} Pair;

// Deviations of samples: degrees of freedom, pairs, and sums of squares and products.
typedef struct {
    float freedom_new, squares_new, pairs, squares_old, products;
} Spread;

INLINE Anchor load_anchor(__global const float *sums, size_t pixels, size_t pixel) {
    Anchor anchor;
    anchor.samples = sums[3u * pixels + pixel];
    const float share = anchor.samples > 0.0f ? 1.0f / anchor.samples : 0.0f;
    anchor.radiance =
        vec3(sums[pixel] * share, sums[pixels + pixel] * share, sums[2u * pixels + pixel] * share);
    return anchor;
}

INLINE Pair load_pair(__global const float *pairs, size_t pixels, size_t pixel) {
#define PLANE(name) pairs[PAIR_##name * pixels + pixel]
    Pair p;
    p.halves[0].new_sum = vec3(PLANE(NEW_R_0), PLANE(NEW_G_0), PLANE(NEW_B_0));
    p.halves[1].new_sum = vec3(PLANE(NEW_R_1), PLANE(NEW_G_1), PLANE(NEW_B_1));
    p.halves[0].old_sum = vec3(PLANE(OLD_R_0), PLANE(OLD_G_0), PLANE(OLD_B_0));
    p.halves[1].old_sum = vec3(PLANE(OLD_R_1), PLANE(OLD_G_1), PLANE(OLD_B_1));
    p.halves[0].samples = PLANE(SAMPLES_0);
    p.halves[1].samples = PLANE(SAMPLES_1);
    p.halves[0].pairs = PLANE(PAIRS_0);
    p.halves[1].pairs = PLANE(PAIRS_1);
    p.new_moment = PLANE(NEW_MOMENT);
    p.old_moment = PLANE(OLD_MOMENT);
    p.joint_moment = PLANE(JOINT_MOMENT);
    p.touched = PLANE(TOUCHED);
    return p;
#undef PLANE
}

INLINE float sample_count(const Pair *p) { return p->halves[0].samples + p->halves[1].samples; }
INLINE float pair_count(const Pair *p) { return p->halves[0].pairs + p->halves[1].pairs; }
INLINE Vec3 new_sum(const Pair *p) { return add(p->halves[0].new_sum, p->halves[1].new_sum); }
INLINE Vec3 old_sum(const Pair *p) { return add(p->halves[0].old_sum, p->halves[1].old_sum); }
INLINE float mean_square(Vec3 a) { return dot(a, a) * (1.0f / 3.0f); }

// How the samples of one pixel spread, with `kept` samples behind the old picture.
//
// New values spread around their own mean. Old ones spread around a mean that the kept picture knows already,
// so that each pair tells of their variance, also the first. What the noise of the kept picture adds to
// squares and products, in which it is common to all pairs of a pixel, is taken off, as it is on average.
INLINE Spread spread_of(const Pair *p, float kept) {
    const float samples = sample_count(p), pairs = pair_count(p);
    const Vec3 x = new_sum(p), y = old_sum(p);
    const float per_sample = 1.0f / MAX(samples, 1.0f), per_refined = 1.0f / MAX(kept + pairs, 1.0f);
    const int spreads = samples >= 2.0f, known = (kept >= 1.0f) & (pairs > 0.0f);
    Spread s;
    s.freedom_new = spreads ? samples - 1.0f : 0.0f;
    s.squares_new = spreads ? MAX(p->new_moment - mean_square(x) * per_sample, 0.0f) : 0.0f;
    s.pairs = known ? pairs : 0.0f;
    s.squares_old = known ? MAX(p->old_moment - mean_square(y) * per_refined, 0.0f) : 0.0f;
    // Some of the samples may be no pairs.
    const float pair_share = pairs * per_sample;
    const float products = p->joint_moment - dot(x, y) * (1.0f / 3.0f) * pair_share * per_refined;
    s.products = known ? (products - s.squares_old * per_refined) / (1.0f - pair_share * per_refined) : 0.0f;
    return s;
}

// How the pairs of one pixel spread around their own means, of which each takes a degree of freedom. Unlike
// the squares of spread_of, both scenes are measured by the same samples here: where all pairs bring the same
// twice, nothing is left between them, however few they are.
typedef struct {
    float freedom, squares_old, products;
} PairSpread;

INLINE PairSpread pair_spread_of(const Pair *p) {
    const float samples = sample_count(p), pairs = pair_count(p);
    const Vec3 x = new_sum(p), y = old_sum(p);
    const int spreads = pairs >= 2.0f;
    const float per_sample = 1.0f / MAX(samples, 2.0f), per_pair = 1.0f / MAX(pairs, 2.0f);
    const float products = p->joint_moment - dot(x, y) * (1.0f / 3.0f) * per_sample;
    // Some of the samples may be no pairs: then the mean of the new ones is known better.
    const float freedom_share = (pairs - 1.0f) * per_pair / (1.0f - per_sample);
    PairSpread s;
    s.freedom = spreads ? pairs - 1.0f : 0.0f;
    s.squares_old = spreads ? MAX(p->old_moment - mean_square(y) * per_pair, 0.0f) : 0.0f;
    s.products = spreads ? products * freedom_share : 0.0f;
    return s;
}

// The old picture, refined by the partners of new samples, as its difference from the anchor.
INLINE Vec3 refinement_of(const Pair *p, const Anchor *anchor) {
    return scale(1.0f / MAX(anchor->samples + pair_count(p), 1e-20f), old_sum(p));
}
