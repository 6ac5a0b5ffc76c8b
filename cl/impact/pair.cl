#include "base/scalar.cl"

// What pairs have brought for a pixel, and what follows from it; impact/README.md has the formulas.

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

// Deviations of samples from the mean of their pixel: degrees of freedom, and sums of squares and products.
typedef struct {
    float freedom_new, squares_new, freedom_pairs, squares_old, products;
} Spread;

// What is known of the pixels around; see layout.CellPlane.
typedef struct {
    float new_variance, old_variance, covariance, freedom_new, freedom_pairs, touched;
} Known;

INLINE Anchor load_anchor(__global const float *sums, size_t pixels, size_t pixel) {
    Anchor anchor;
    anchor.samples = sums[3u * pixels + pixel];
    float share = anchor.samples > 0.0f ? 1.0f / anchor.samples : 0.0f;
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

// How the samples of one pixel spread around their means. In the sum of products new values are taken from
// the mean of all samples, of which some may be no pairs; that makes it larger by what is divided out.
INLINE Spread spread_of(const Pair *p) {
    float samples = sample_count(p), pairs = pair_count(p);
    Vec3 x = new_sum(p), y = old_sum(p);
    float per_sample = 1.0f / MAX(samples, 1.0f), per_pair = 1.0f / MAX(pairs, 1.0f);
    int spreads = samples >= 2.0f, pairs_spread = pairs >= 2.0f;
    Spread s;
    s.freedom_new = spreads ? samples - 1.0f : 0.0f;
    s.freedom_pairs = pairs_spread ? pairs - 1.0f : 0.0f;
    s.squares_new = spreads ? MAX(p->new_moment - mean_square(x) * per_sample, 0.0f) : 0.0f;
    s.squares_old = pairs_spread ? MAX(p->old_moment - mean_square(y) * per_pair, 0.0f) : 0.0f;
    float excess = s.freedom_new * per_sample * pairs;
    float products = p->joint_moment - dot(x, y) * (1.0f / 3.0f) * per_sample;
    s.products = pairs_spread ? products * s.freedom_pairs / MAX(excess, 1e-20f) : 0.0f;
    return s;
}

INLINE Known load_known(__global const float *cells, uint cell_total, uint cell, uint class) {
    __global const float *planes = cells + class * CELL_PLANES * cell_total + cell;
    Known known;
    known.new_variance = planes[CELL_NEW_VARIANCE * cell_total];
    known.old_variance = planes[CELL_OLD_VARIANCE * cell_total];
    known.covariance = planes[CELL_COVARIANCE * cell_total];
    known.freedom_new = planes[CELL_FREEDOM_NEW * cell_total];
    known.freedom_pairs = planes[CELL_FREEDOM_PAIRS * cell_total];
    known.touched = planes[CELL_TOUCHED * cell_total];
    return known;
}

// Variances below this are rounding, and tell nothing of a correlation.
#define LEAST_VARIANCE 1e-8f
// The weight of old values may be larger than that of new ones, but not by much, since it is estimated.
#define MOST_OLD_WEIGHT 1.5f

// The old picture, refined by the partners of new samples, as its difference from the anchor.
INLINE Vec3 refinement_of(const Pair *p, const Anchor *anchor) {
    return scale(1.0f / MAX(anchor->samples + pair_count(p), 1e-20f), old_sum(p));
}

// The weight with which deviations of old values from the refined old picture are taken off new values. Where
// nothing is known of their correlation it is that of equal samples.
INLINE float old_weight(const Pair *p, const Anchor *anchor, const Known *known) {
    float samples = MAX(sample_count(p), 1.0f), pairs = pair_count(p);
    float equal = (anchor->samples + pairs) / (anchor->samples + samples);
    float weight = (known->covariance * pairs / samples + LEAST_VARIANCE * equal) /
                   (known->old_variance + LEAST_VARIANCE);
    return known->freedom_pairs < 0.5f ? equal : CLAMP(weight, 0.0f, MOST_OLD_WEIGHT);
}

// The variance of the changed picture with that weight, without shrinkage, times the number of samples.
INLINE float sample_variance(const Pair *p, const Anchor *anchor, const Known *known, float weight) {
    float samples = MAX(sample_count(p), 1.0f), pairs = pair_count(p), kept = anchor->samples;
    float share = pairs > 0.0f ? weight * kept / (kept + pairs) : 0.0f;
    float old = weight * share * known->old_variance * samples / MAX(pairs, 1.0f);
    return MAX(known->new_variance - 2.0f * share * known->covariance + old, 1e-12f);
}

// The change that one half of the samples shows, as its difference from the refined old picture.
INLINE Vec3 change_of(const Half *samples_of, Vec3 refinement, float weight) {
    Vec3 new_mean = scale(1.0f / MAX(samples_of->samples, 1.0f), samples_of->new_sum);
    Vec3 old_mean = scale(1.0f / MAX(samples_of->pairs, 1.0f), samples_of->old_sum);
    float used = samples_of->pairs > 0.0f ? weight : 0.0f;
    Vec3 change = subtract(subtract(new_mean, refinement), scale(used, subtract(old_mean, refinement)));
    return select(samples_of->samples > 0.0f, change, vec3(0.0f, 0.0f, 0.0f));
}

// The variance of what a pixel shows, without shrinkage. Where nothing changed that is the refined old
// picture.
INLINE float shown_variance(const Pair *p, const Anchor *anchor, const Known *known) {
    float refined = known->new_variance / MAX(anchor->samples + pair_count(p), 1.0f);
    float weight = old_weight(p, anchor, known);
    float changed = sample_variance(p, anchor, known, weight) / MAX(sample_count(p), 1.0f);
    return known->touched > 0.0f ? changed : refined;
}
