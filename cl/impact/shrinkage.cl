#include "impact/guides.cl"
#include "impact/pair.cl"

// The shown picture: the refined old picture, and of its change what stands out of the noise.
//
// The change, which the two halves of the samples show independently of each other, is taken apart into
// details of several scales by guided smoothing passes (a-trous wavelets; Dammertz et al. 2010, Rousselle et
// al. 2012 for the two halves). Products of the halves, summed up around a pixel, tell how much signal a
// detail has, squares of their difference how much noise; signal / (signal + noise) of it is shown.
//
//     split_change     the change in each half, and its weight
//     smooth_change    the next coarser scale, and what is lost on the way: a detail
//     rest_of_change   what is left behind the coarsest scale, taken as a detail
//     pool_evidence    signal and noise, summed up around each pixel; twice
//     shrink_detail    adds what is shown of a detail
//     store_picture    the picture without margins
//
// Patches without a change nearby are left out. What the sums hold is never smoothed.

#define VEC3_PLANES(planes, size, place)                                                                     \
    vec3((planes)[place], (planes)[(size) + (place)], (planes)[2u * (size) + (place)])

INLINE void store_vec3(__global float *planes, size_t size, size_t place, Vec3 value) {
    planes[place] = value.x;
    planes[size + place] = value.y;
    planes[2u * size + place] = value.z;
}

// Variance of a sample where few degrees of freedom tell of it: that of light which is nearly always black
// elsewhere, relative to the old picture. It keeps the first samples of bright pixels from drowning others.
#define PRIOR_FREEDOM 4.0f
#define PRIOR_VARIANCE 0.5f
#define LEAST_PRIOR 1e-6f
// How much of the noise that the halves of a pixel show in it alone counts, since that is known badly.
#define OWN_NOISE 0.05f

// What a pixel shows without its change, and its change. Where nothing is smoothed only the former is needed,
// and that nothing shows any detail.
INLINE void split_pixel(const Pair *p, const Anchor *anchor, const Known *known, Vec3 refinement,
                        __global float *halves, size_t size, size_t place) {
    const float weight = old_weight(p, anchor, known);
    const int changed = known->touched > 0.0f;
    const Vec3 none = vec3(0.0f, 0.0f, 0.0f);
    const Vec3 first = select(changed, change_of(&p->halves[0], refinement, weight), none);
    const Vec3 second = select(changed, change_of(&p->halves[1], refinement, weight), none);

    const float prior = PRIOR_VARIANCE * (mean_square(anchor->radiance) + LEAST_PRIOR);
    const float known_variance = sample_variance(p, anchor, known, weight);
    const float variance =
        (known->freedom_new * known_variance + PRIOR_FREEDOM * prior) / (known->freedom_new + PRIOR_FREEDOM);
    const int both = (p->halves[0].samples > 0.0f) & (p->halves[1].samples > 0.0f);
    const float apart = mean_square(subtract(first, second)) * 0.25f * sample_count(p);
    const float per_variance = 1.0f / (MAX(variance, both ? OWN_NOISE * apart : 0.0f) + 1e-7f);
    const float first_weight = p->halves[0].samples * per_variance;
    const float second_weight = p->halves[1].samples * per_variance;
    store_vec3(halves + HALF_CHANGE_R_0 * size, size, place, scale(first_weight, first));
    store_vec3(halves + HALF_CHANGE_R_1 * size, size, place, scale(second_weight, second));
    halves[HALF_WEIGHT_0 * size + place] = first_weight;
    halves[HALF_WEIGHT_1 * size + place] = second_weight;
}

__kernel WIDE void split_change(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, CELLS_PARAMETERS,
                                ACTIVITIES_PARAMETERS, HALVES_PARAMETERS, EVIDENCE_PARAMETERS,
                                SHOWN_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    const uint in_row = cells_in_row(width), total = cell_count(width, height);
    if (patch.top >= height)
        return;
    if (activities[patch.index] == ACTIVITY_IDLE) {
        EACH_ROW(y, patch)
        EACH_LANE(x, patch) {
            const size_t pixel = y * width + x, place = field_place(width, x, y);
            const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
            const Pair p = load_pair(pairs, pixels, pixel);
            store_vec3(shown, size, place, add(anchor.radiance, refinement_of(&p, &anchor)));
            store_vec3(evidence, size, place, vec3(0.0f, 0.0f, 0.0f));
        }
        return;
    }
    EACH_ROW(y, patch) {
        const uint cell_row = (uint)y / CELL_SIZE * in_row;
        EACH_LANE(x, patch) {
            const size_t pixel = y * width + x, place = field_place(width, x, y);
            const Pair p = load_pair(pairs, pixels, pixel);
            const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
            const uint cell = cell_row + (uint)x / CELL_SIZE;
            const Known known = load_known(cells, total, cell, class_of(labels[pixel]));
            const Vec3 refinement = refinement_of(&p, &anchor);
            split_pixel(&p, &anchor, &known, refinement, halves, size, place);
            store_vec3(shown, size, place, add(anchor.radiance, refinement));
        }
    }
}

// The weighted mean of a plane around a place; `weights` are those of the neighbours, row by row.
INLINE float smoothed(__global const float *plane, size_t place, size_t step, size_t below,
                      const float *weights) {
    __global const float *above_row = plane + place - below, *row = plane + place, *below_row = row + below;
    return weights[0] * above_row[-(ptrdiff_t)step] + weights[1] * above_row[0] +
           weights[2] * above_row[step] + weights[3] * row[-(ptrdiff_t)step] + weights[4] * row[0] +
           weights[5] * row[step] + weights[6] * below_row[-(ptrdiff_t)step] + weights[7] * below_row[0] +
           weights[8] * below_row[step];
}

// The weights of a pixel and its neighbours, which sum up to 1: a binomial kernel times the guides.
INLINE void smoothing_weights(__global const uint *guides, size_t place, size_t step, size_t below,
                              float *weights) {
    const uint own = guides[place], left = guides[place - step], upper_left = guides[place - below - step];
    const uint above = guides[place - below], upper_right = guides[place - below + step];
    weights[0] = 0.25f * GUIDE_WEIGHT(upper_left, GUIDE_LOWER_RIGHT);
    weights[1] = 0.5f * GUIDE_WEIGHT(above, GUIDE_BELOW);
    weights[2] = 0.25f * GUIDE_WEIGHT(upper_right, GUIDE_LOWER_LEFT);
    weights[3] = 0.5f * GUIDE_WEIGHT(left, GUIDE_RIGHT);
    weights[4] = 1.0f;
    weights[5] = 0.5f * GUIDE_WEIGHT(own, GUIDE_RIGHT);
    weights[6] = 0.25f * GUIDE_WEIGHT(own, GUIDE_LOWER_LEFT);
    weights[7] = 0.5f * GUIDE_WEIGHT(own, GUIDE_BELOW);
    weights[8] = 0.25f * GUIDE_WEIGHT(own, GUIDE_LOWER_RIGHT);
    float sum = 0.0f;
#pragma unroll
    for (int i = 0; i < 9; i++)
        sum += weights[i];
    const float per_sum = 1.0f / sum;
#pragma unroll
    for (int i = 0; i < 9; i++)
        weights[i] *= per_sum;
}

// Stores what is told of a detail by the two halves of it and the weights of these: `first` and `second`.
INLINE void store_detail(Vec3 first, Vec3 second, float first_weight, float second_weight, uint scale_index,
                         __global float *details, __global float *evidence, size_t size, size_t place) {
    const int both = (first_weight > 0.0f) & (second_weight > 0.0f);
    const float weight = first_weight + second_weight, per_weight = 1.0f / MAX(weight, 1e-30f);
    const float first_share = first_weight * per_weight, second_share = second_weight * per_weight;
    const Vec3 mean = add(scale(first_share, first), scale(second_share, second));
    const float signal = dot(first, second) * (1.0f / 3.0f);
    const float apart = mean_square(subtract(first, second));
    const float noise = both ? apart * first_share * second_share : 0.0f;
    const int counts = both & (mean_square(first) + mean_square(second) > 0.0f);
    const float evidence_weight = counts ? 1.0f / (noise * OWN_NOISE + per_weight + 1e-12f) : 0.0f;
    // In the finest detail one half alone tells nothing of its noise, nor do its neighbours.
    const int shows = scale_index > 0u ? weight > 0.0f : both;
    store_vec3(details, size, place, select(shows, mean, vec3(0.0f, 0.0f, 0.0f)));
    details[DETAIL_NOISE * size + place] = noise;
    evidence[EVIDENCE_SIGNAL * size + place] = signal * evidence_weight;
    evidence[EVIDENCE_NOISE * size + place] = noise * evidence_weight;
    evidence[EVIDENCE_WEIGHT * size + place] = evidence_weight;
}

// The change of a half, from the change times its weight.
INLINE Vec3 unweighted(__global const float *planes, size_t size, size_t place, float weight) {
    const float per_weight = weight > 0.0f ? 1.0f / weight : 0.0f;
    return scale(per_weight, VEC3_PLANES(planes, size, place));
}

INLINE Vec3 smooth_vec3(__global const float *planes, size_t size, size_t place, size_t step, size_t below,
                        const float *weights) {
    return vec3(smoothed(planes, place, step, below, weights),
                smoothed(planes + size, place, step, below, weights),
                smoothed(planes + 2u * size, place, step, below, weights));
}

__kernel WIDE void smooth_change(PICTURE_PARAMETERS, GUIDES_PARAMETERS, ACTIVITIES_PARAMETERS,
                                 SCALE_PARAMETERS, HALVES_PARAMETERS, SMOOTH_HALVES_PARAMETERS,
                                 EVIDENCE_PARAMETERS, DETAILS_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    if (patch.top >= height || activities[patch.index] == ACTIVITY_IDLE)
        return;
    const size_t size = field_size(width, height), pitch = field_pitch(width);
    const size_t step = 1u << scale_index, below = step * pitch;
    __global const uint *guide = guides + scale_index * size;
    EACH_ROW(y, patch)
    EACH_LANE(x, patch) {
        const size_t place = field_place(width, x, y);
        float weights[9];
        smoothing_weights(guide, place, step, below, weights);
        const Vec3 first = smooth_vec3(halves + HALF_CHANGE_R_0 * size, size, place, step, below, weights);
        const Vec3 second = smooth_vec3(halves + HALF_CHANGE_R_1 * size, size, place, step, below, weights);
        const float first_weight = smoothed(halves + HALF_WEIGHT_0 * size, place, step, below, weights);
        const float second_weight = smoothed(halves + HALF_WEIGHT_1 * size, place, step, below, weights);
        store_vec3(smooth_halves + HALF_CHANGE_R_0 * size, size, place, first);
        store_vec3(smooth_halves + HALF_CHANGE_R_1 * size, size, place, second);
        smooth_halves[HALF_WEIGHT_0 * size + place] = first_weight;
        smooth_halves[HALF_WEIGHT_1 * size + place] = second_weight;

        const float fine_first = halves[HALF_WEIGHT_0 * size + place];
        const float fine_second = halves[HALF_WEIGHT_1 * size + place];
        const Vec3 none = vec3(0.0f, 0.0f, 0.0f);
        const Vec3 first_detail =
            subtract(unweighted(halves + HALF_CHANGE_R_0 * size, size, place, fine_first),
                     scale(first_weight > 0.0f ? 1.0f / first_weight : 0.0f, first));
        const Vec3 second_detail =
            subtract(unweighted(halves + HALF_CHANGE_R_1 * size, size, place, fine_second),
                     scale(second_weight > 0.0f ? 1.0f / second_weight : 0.0f, second));
        store_detail(select(fine_first > 0.0f, first_detail, none),
                     select(fine_second > 0.0f, second_detail, none), fine_first, fine_second, scale_index,
                     details, evidence, size, place);
    }
}

__kernel WIDE void rest_of_change(PICTURE_PARAMETERS, ACTIVITIES_PARAMETERS, HALVES_PARAMETERS,
                                  EVIDENCE_PARAMETERS, DETAILS_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    if (patch.top >= height || activities[patch.index] == ACTIVITY_IDLE)
        return;
    const size_t size = field_size(width, height);
    EACH_ROW(y, patch)
    EACH_LANE(x, patch) {
        const size_t place = field_place(width, x, y);
        const float first_weight = halves[HALF_WEIGHT_0 * size + place];
        const float second_weight = halves[HALF_WEIGHT_1 * size + place];
        store_detail(unweighted(halves + HALF_CHANGE_R_0 * size, size, place, first_weight),
                     unweighted(halves + HALF_CHANGE_R_1 * size, size, place, second_weight), first_weight,
                     second_weight, SMOOTHING_SCALES, details, evidence, size, place);
    }
}

// Looks as far as the details reach: `pool_scale` is that of the detail.
__kernel WIDE void pool_evidence(PICTURE_PARAMETERS, GUIDES_PARAMETERS, ACTIVITIES_PARAMETERS,
                                 SCALE_PARAMETERS, EVIDENCE_PARAMETERS, POOLED_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    if (patch.top >= height || activities[patch.index] == ACTIVITY_IDLE)
        return;
    const size_t size = field_size(width, height), step = 1u << scale_index,
                 below = step * field_pitch(width);
    __global const uint *guide = guides + scale_index * size;
    EACH_ROW(y, patch)
    EACH_LANE(x, patch) {
        const size_t place = field_place(width, x, y);
        float weights[9];
        smoothing_weights(guide, place, step, below, weights);
        store_vec3(pooled, size, place, smooth_vec3(evidence, size, place, step, below, weights));
    }
}

__kernel WIDE void shrink_detail(PICTURE_PARAMETERS, GUIDES_PARAMETERS, ACTIVITIES_PARAMETERS,
                                 SCALE_PARAMETERS, POOLED_PARAMETERS, DETAILS_PARAMETERS, SHOWN_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    if (patch.top >= height || activities[patch.index] != ACTIVITY_CHANGED)
        return;
    const size_t size = field_size(width, height), step = 1u << scale_index,
                 below = step * field_pitch(width);
    __global const uint *guide = guides + scale_index * size;
    EACH_ROW(y, patch)
    EACH_LANE(x, patch) {
        const size_t place = field_place(width, x, y);
        float weights[9];
        smoothing_weights(guide, place, step, below, weights);
        const Vec3 around = smooth_vec3(pooled, size, place, step, below, weights);
        const float signal = MAX(around.x, 0.0f);
        const float own = OWN_NOISE * details[DETAIL_NOISE * size + place] * around.z;
        const float all = signal + MAX(around.y, own);
        const float share = all > 0.0f ? signal / MAX(all, 1e-30f) : 0.0f;
        const Vec3 detail = VEC3_PLANES(details, size, place);
        store_vec3(shown, size, place, add(VEC3_PLANES(shown, size, place), scale(share, detail)));
    }
}

__kernel WIDE void store_picture(PICTURE_PARAMETERS, PAIRS_PARAMETERS, SHOWN_PARAMETERS,
                                 SHOWN_IMAGE_PARAMETERS) {
    const Patch patch = patch_of(width, height);
    if (patch.top >= height)
        return;
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    EACH_ROW(y, patch)
    EACH_LANE(x, patch) {
        const size_t pixel = y * width + x, place = field_place(width, x, y);
        const float samples = anchor_sums[3u * pixels + pixel] + pairs[PAIR_SAMPLES_0 * pixels + pixel] +
                              pairs[PAIR_SAMPLES_1 * pixels + pixel];
        shown_image[4u * pixel] = shown[place];
        shown_image[4u * pixel + 1u] = shown[size + place];
        shown_image[4u * pixel + 2u] = shown[2u * size + place];
        shown_image[4u * pixel + 3u] = samples > 0.0f ? 1.0f : 0.0f;
    }
}
