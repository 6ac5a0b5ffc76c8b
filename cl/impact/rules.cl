#include "impact/pair.cl"

// What is known of the samples of a pixel from those around it: layout.RulePlane.
typedef struct {
    float old_weight, base_share, variance, prior, covered;
} Rule;

// The weight with which deviations of old values from the refined old picture are taken off new values. Not
// all samples need be pairs.
INLINE float weight_of_pairs(const Pair *p, const Rule *rule) {
    return rule->old_weight * pair_count(p) / MAX(sample_count(p), 1.0f);
}

// The variance of a sample of the changed picture with that weight, without shrinkage.
INLINE float sample_variance(const Pair *p, const Anchor *anchor, const Rule *rule, float weight) {
    const float kept_share = anchor->samples / MAX(anchor->samples + pair_count(p), 1e-20f);
    const float guess = rule->prior * (mean_square(anchor->radiance) + 1e-6f);
    return MAX(rule->variance + guess - rule->covered * weight * kept_share, 1e-12f);
}

// The rule of a cell, without interpolation.
INLINE Rule load_rule(__global const float *rules, uint total, uint cell, uint class) {
    __global const float *rule = rules + class * total + cell;
    const uint next = CLASSES * total;
    const Rule r = {rule[RULE_OLD_WEIGHT * next], rule[RULE_BASE_SHARE * next], rule[RULE_VARIANCE * next],
                    rule[RULE_PRIOR * next], rule[RULE_COVERED * next]};
    return r;
}

// The variance of a sample of the change of a pixel, 0 where nothing changed.
INLINE float change_variance(const Pair *p, const Anchor *anchor, __global const float *cells,
                             __global const float *rules, uint total, uint cell, uint class) {
    const Rule rule = load_rule(rules, total, cell, class);
    const float variance = sample_variance(p, anchor, &rule, weight_of_pairs(p, &rule));
    return cells[(class * CELL_PLANES + CELL_TOUCHED) * total + cell] > 0.0f ? variance : 0.0f;
}

// The variance of what a pixel shows, without shrinkage. Where nothing changed that is the refined old
// picture.
INLINE float shown_variance(const Pair *p, const Anchor *anchor, __global const float *cells,
                            __global const float *rules, uint total, uint cell, uint class) {
    __global const float *known = cells + class * CELL_PLANES * total + cell;
    const Rule rule = load_rule(rules, total, cell, class);
    const float changed =
        sample_variance(p, anchor, &rule, weight_of_pairs(p, &rule)) / MAX(sample_count(p), 1.0f);
    const float refined = known[CELL_OLD_VARIANCE * total] / MAX(anchor->samples + pair_count(p), 1.0f);
    return known[CELL_TOUCHED * total] > 0.0f ? changed : refined;
}
