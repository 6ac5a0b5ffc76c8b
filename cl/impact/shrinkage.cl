#include "impact/guides.cl"
#include "impact/rules.cl"

// The shown picture: a base that is known well, and what stands out of the noise of the change from it.
//
// The base is the refined old picture. Where an object changed itself it is less of it, down to nothing, the
// less its samples go together with the old ones: then the change is all of the new picture. After a further
// edit the base is the picture that was shown before it, the target, where that shows the same: until there
// are samples nearby, and as long as these meet a change.
//
// The change, which the two halves of the samples show independently of each other, is taken apart into
// details of several scales by guided smoothing passes (a-trous wavelets; Dammertz et al. 2010). Products of
// the halves tell how much signal the details around have, squares of their difference how much noise
// (Rousselle et al. 2012 use two halves so); signal / (signal + noise) of each detail is shown.
//
//     split_change    the change in each half, and its weight
//     smooth_change   the next coarser scale, and the detail that is lost on the way; after the last one
//                     also what is left, as a detail of its own
//     pool_evidence   what cells and those around tell of details
//     show_change     the picture, with a share of each detail; and which share of all noise that shows
//
// Patches without a change nearby are left out. What the sums hold is never smoothed.

// How much of the noise counts that the halves of a pixel show in it alone, where it is above what is known.
#define OWN_NOISE 0.05f
// Of a variance: what is lost in rounding.
#define ROUNDING 1e-7f

INLINE Rule rule_between(__global const float *column_rules, size_t size, const CellRows *rows, size_t x,
                         const ClassShares *class) {
    const Rule r = {between_cells(column_rules + RULE_OLD_WEIGHT * CLASSES * size, size, rows, x, class),
                    between_cells(column_rules + RULE_BASE_SHARE * CLASSES * size, size, rows, x, class),
                    between_cells(column_rules + RULE_VARIANCE * CLASSES * size, size, rows, x, class),
                    between_cells(column_rules + RULE_PRIOR * CLASSES * size, size, rows, x, class),
                    between_cells(column_rules + RULE_COVERED * CLASSES * size, size, rows, x, class)};
    return r;
}

// The change that a half of the samples shows, from a base that is the refined old picture plus `from_base`.
INLINE Vec3 change_of(const Half *samples_of, float per_sample, float per_pair, Vec3 refinement, float weight,
                      Vec3 from_base) {
    const float used = samples_of->pairs > 0.0f ? weight : 0.0f;
    const Vec3 new_mean = scale(per_sample, samples_of->new_sum);
    const Vec3 old_mean = scale(used * per_pair, samples_of->old_sum);
    // Deviations of old values from the refined old picture are taken off.
    const Vec3 expected = scale(1.0f - used, refinement);
    return subtract(subtract(subtract(new_mean, old_mean), expected), from_base);
}

__kernel WIDE void split_change(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, CELLS_PARAMETERS,
                                SPANS_PARAMETERS, COLUMN_RULES_PARAMETERS, HALVES_PARAMETERS,
                                SMOOTH_HALVES_PARAMETERS, EVIDENCE_PARAMETERS, TARGET_PARAMETERS,
                                BASE_PARAMETERS, SHOWN_IMAGE_PARAMETERS) {
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    const Patch near = near_change(&patch, height, spans);
    // On both sides of what changes the refined old picture is all there is to show.
    for (int side = 0; side < 2; side++) {
        const Patch idle = narrowed(&patch, side ? near.right : patch.left, side ? patch.right : near.left);
        EACH_ROW(y, idle)
        EACH_COLUMN(x, idle) {
            const size_t pixel = y * width + x;
            const Pair p = load_pair(pairs, pixels, pixel);
            const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
            const Vec3 light = add(anchor.radiance, refinement_of(&p, &anchor));
            store_pixel(shown_image, pixel, light, anchor.samples + sample_count(&p) > 0.0f);
        }
    }
    // Pixels near a change look around at those that are not. Where a picture before had a change near and
    // this one does not, what it left there must not be found.
    const Patch was_near = was_near_change(&patch, height, spans);
    for (int side = 0; side < 2; side++) {
        const Patch left_behind = narrowed(&patch, side ? MAX(was_near.left, near.right) : was_near.left,
                                           side ? was_near.right : MIN(was_near.right, near.left));
        EACH_ROW(y, left_behind)
        EACH_COLUMN(x, left_behind) {
            const size_t place = field_place(width, x, y);
            halves[HALF_WEIGHT_0 * size + place] = 0.0f;
            halves[HALF_WEIGHT_1 * size + place] = 0.0f;
            smooth_halves[HALF_WEIGHT_0 * size + place] = 0.0f;
            smooth_halves[HALF_WEIGHT_1 * size + place] = 0.0f;
#pragma unroll
            for (size_t i = 0u; i < EVIDENCE_PLANES * LOCAL_SCALES; i++)
                evidence[i * size + place] = 0.0f;
        }
    }
    const size_t rule_size = (size_t)width * cell_rows(height);
    const uint total = cell_count(width, height);
    __global const float *touched = cells + CELL_TOUCHED * total + patch.row * cell_columns(width);
    __global const float *second_touched = touched + CELL_PLANES * total;
    __global const float *sampled = touched + (CELL_SAMPLES - CELL_TOUCHED) * total;
    __global const float *second_sampled = sampled + CELL_PLANES * total;
    EACH_ROW(y, near) {
        const CellRows rows = cell_rows_around(width, height, y);
        EACH_COLUMN(x, near) {
            const size_t pixel = y * width + x, place = field_place(width, x, y);
            const Pair p = load_pair(pairs, pixels, pixel);
            const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
            const ClassShares class = class_shares(labels[pixel]);
            const Rule rule = rule_between(column_rules, rule_size, &rows, x, &class);
            const int cell = (int)x / (int)CELL_SIZE;
            const int changed = class.first * touched[cell] + class.second * second_touched[cell] > 0.0f;
            const int waits = class.first * sampled[cell] + class.second * second_sampled[cell] == 0.0f;
            const int starts_from_target = has_target_at(labels[pixel]) & (changed | waits);

            const Vec3 refinement = refinement_of(&p, &anchor);
            const Vec3 refined = add(anchor.radiance, refinement);
            const Vec3 guess = scale(changed ? rule.base_share : 1.0f, refined);
            const Vec3 base = select(starts_from_target, vec3_at(target_image + 4u * pixel), guess);
            const Vec3 from_base = subtract(base, refined);
            const float weight = weight_of_pairs(&p, &rule);
            // One division serves four numbers, each at least 1 and at most some million.
            const float s0 = MAX(p.halves[0].samples, 1.0f), s1 = MAX(p.halves[1].samples, 1.0f);
            const float p0 = MAX(p.halves[0].pairs, 1.0f), p1 = MAX(p.halves[1].pairs, 1.0f);
            const float per_all = 1.0f / (s0 * s1 * (p0 * p1));
            const float per_samples = per_all * (p0 * p1), per_pairs = per_all * (s0 * s1);
            const Vec3 first =
                change_of(&p.halves[0], per_samples * s1, per_pairs * p1, refinement, weight, from_base);
            const Vec3 second =
                change_of(&p.halves[1], per_samples * s0, per_pairs * p0, refinement, weight, from_base);

            const int has_first = p.halves[0].samples > 0.0f, has_second = p.halves[1].samples > 0.0f;
            const float apart = mean_square(subtract(first, second)) * 0.25f * sample_count(&p);
            const float own = has_first & has_second ? OWN_NOISE * apart : 0.0f;
            const float per_variance =
                1.0f / (MAX(sample_variance(&p, &anchor, &rule, weight), own) + ROUNDING);
            const Vec3 none = vec3(0.0f, 0.0f, 0.0f);
            store_vec3(halves + HALF_CHANGE_R_0 * size, size, place,
                       select(changed & has_first, first, none));
            store_vec3(halves + HALF_CHANGE_R_1 * size, size, place,
                       select(changed & has_second, second, none));
            halves[HALF_WEIGHT_0 * size + place] = p.halves[0].samples * per_variance;
            halves[HALF_WEIGHT_1 * size + place] = p.halves[1].samples * per_variance;
            store_vec3(base_light, pixels, pixel, base);
        }
    }
}

// A plane at a place and around it.
typedef struct {
    float at[9];
} Around;

INLINE Around load_around(__global const float *plane, size_t place, size_t step, size_t below) {
    __global const float *middle = plane + place, *upper = middle - below, *lower = middle + below;
    const ptrdiff_t s = (ptrdiff_t)step;
    const Around around = {
        {upper[-s], upper[0], upper[s], middle[-s], middle[0], middle[s], lower[-s], lower[0], lower[s]}};
    return around;
}

INLINE float weighted(const Around *around, const float *weights) {
    return ((weights[0] * around->at[0] + weights[1] * around->at[1] + weights[2] * around->at[2]) +
            (weights[3] * around->at[3] + weights[4] * around->at[4] + weights[5] * around->at[5])) +
           (weights[6] * around->at[6] + weights[7] * around->at[7] + weights[8] * around->at[8]);
}

// The change of one half at the next scale, and its weight there.
INLINE Vec3 smooth_half(__global const float *changes, __global const float *plane_of_weights, size_t size,
                        size_t place, size_t step, size_t below, const float *guide_weights, float *weight) {
    const Around half_weights = load_around(plane_of_weights, place, step, below);
    float weights[9], sum = 0.0f;
#pragma unroll
    for (int i = 0; i < 9; i++) {
        weights[i] = guide_weights[i] * half_weights.at[i];
        sum += weights[i];
    }
    *weight = sum;
    const Around red = load_around(changes, place, step, below);
    const Around green = load_around(changes + size, place, step, below);
    const Around blue = load_around(changes + 2u * size, place, step, below);
    return scale(1.0f / MAX(sum, 1e-30f),
                 vec3(weighted(&red, weights), weighted(&green, weights), weighted(&blue, weights)));
}

// What a detail of a pixel counts for, and its mean over both halves.
typedef struct {
    Vec3 mean;
    float signal, noise;
} Detail;

INLINE Detail detail_of(Vec3 first, Vec3 second, float first_weight, float second_weight) {
    const float weight = first_weight + second_weight, per_weight = 1.0f / MAX(weight, 1e-30f);
    const int both = (first_weight > 0.0f) & (second_weight > 0.0f);
    // What is known well counts more, but not as much more as its weight says, which is not known well.
    const float count = both ? SQRT(weight) : 0.0f;
    Detail detail;
    detail.mean = add(scale(first_weight * per_weight, first), scale(second_weight * per_weight, second));
    detail.signal = count * dot(first, second) * (1.0f / 3.0f);
    detail.noise = count * mean_square(subtract(first, second)) * (first_weight * per_weight) *
                   (second_weight * per_weight);
    return detail;
}

// Sums over a cell for a detail: of each Evidence for each class.
#define CELL_EVIDENCE (EVIDENCE_PLANES * CLASSES)
// Stores a detail, and what it tells in the columns of its cell.
#define STORE_DETAIL(detail, shown_mean, number)                                                             \
    store_vec3(details + 3u * (scale_index + number) * pixels, pixels, pixel, shown_mean);                   \
    COLUMN(columns, CELL_EVIDENCE *number, x, patch) += class.first * detail.signal;                         \
    COLUMN(columns, CELL_EVIDENCE *number + 1u, x, patch) += class.second * detail.signal;                   \
    COLUMN(columns, CELL_EVIDENCE *number + 2u, x, patch) += class.first * detail.noise;                     \
    COLUMN(columns, CELL_EVIDENCE *number + 3u, x, patch) += class.second * detail.noise

// `details` has three planes for each scale, and for the rest; `evidence` has Evidence for each local scale.
__kernel WIDE void smooth_change(PICTURE_PARAMETERS, LABELS_PARAMETERS, GUIDES_PARAMETERS, SPANS_PARAMETERS,
                                 SCALE_PARAMETERS, HALVES_PARAMETERS, SMOOTH_HALVES_PARAMETERS,
                                 DETAILS_PARAMETERS, EVIDENCE_PARAMETERS, CELL_EVIDENCE_PARAMETERS) {
#ifdef LAST_SCALE
    CELL_COLUMNS(columns, 2u * CELL_EVIDENCE);
    const uint sums = 2u * CELL_EVIDENCE;
#else
    CELL_COLUMNS(columns, CELL_EVIDENCE);
    const uint sums = CELL_EVIDENCE;
#endif
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    const size_t step = 1u << scale_index, below = step * field_pitch(width);
    __global const uint *guide = guides + 2u * scale_index * size;
    const Patch near = near_change(&patch, height, spans);
    EACH_ROW(y, near)
    EACH_COLUMN(x, near) {
        const size_t pixel = y * width + x, place = field_place(width, x, y);
        const ClassShares class = class_shares(labels[pixel]);
        float weights[9];
        load_guides(guide, size, place, weights);
        float first_weight, second_weight;
        const Vec3 first = smooth_half(halves + HALF_CHANGE_R_0 * size, halves + HALF_WEIGHT_0 * size, size,
                                       place, step, below, weights, &first_weight);
        const Vec3 second = smooth_half(halves + HALF_CHANGE_R_1 * size, halves + HALF_WEIGHT_1 * size, size,
                                        place, step, below, weights, &second_weight);
        const float fine_first_weight = halves[HALF_WEIGHT_0 * size + place];
        const float fine_second_weight = halves[HALF_WEIGHT_1 * size + place];
        const Vec3 none = vec3(0.0f, 0.0f, 0.0f);
        const Vec3 fine_first = load_vec3(halves + HALF_CHANGE_R_0 * size, size, place);
        const Vec3 fine_second = load_vec3(halves + HALF_CHANGE_R_1 * size, size, place);
        const Detail detail =
            detail_of(select(fine_first_weight > 0.0f, subtract(fine_first, first), none),
                      select(fine_second_weight > 0.0f, subtract(fine_second, second), none),
                      fine_first_weight, fine_second_weight);
        // In the finest detail one half alone tells nothing of its noise.
        const int shows = (scale_index > 0u) | ((fine_first_weight > 0.0f) & (fine_second_weight > 0.0f));
        const Vec3 shown_mean = select(shows, detail.mean, none);
        STORE_DETAIL(detail, shown_mean, 0u);
#ifdef LAST_SCALE
        const Detail rest = detail_of(first, second, first_weight, second_weight);
        STORE_DETAIL(rest, rest.mean, 1u);
#else
        evidence[(EVIDENCE_PLANES * scale_index + EVIDENCE_SIGNAL) * size + place] = detail.signal;
        evidence[(EVIDENCE_PLANES * scale_index + EVIDENCE_NOISE) * size + place] = detail.noise;
        store_vec3(smooth_halves + HALF_CHANGE_R_0 * size, size, place, first);
        store_vec3(smooth_halves + HALF_CHANGE_R_1 * size, size, place, second);
        smooth_halves[HALF_WEIGHT_0 * size + place] = first_weight;
        smooth_halves[HALF_WEIGHT_1 * size + place] = second_weight;
#endif
    }
    const size_t first_sum = (size_t)scale_index * CELL_EVIDENCE * cell_count(width, height);
    store_cell_sums(columns, sums, &patch, width, height, cell_evidence + first_sum);
}

// Means over cells and those around, of which those at the sides count half and those at the corners a
// quarter.
__kernel WIDE void pool_evidence(PICTURE_PARAMETERS, CELL_EVIDENCE_PARAMETERS, POOLED_EVIDENCE_PARAMETERS) {
    const int columns = cell_columns(width), rows = MAX(cell_rows(height), 1u);
    const Patch patch = patch_of(columns, (SMOOTHING_SCALES + 1u) * CELL_EVIDENCE * cell_rows(height), 1u);
    EACH_ROW(y, patch) {
        const int row = (int)y % rows;
        __global const float *middle = cell_evidence + y * columns;
        const float has_upper = row > 0 ? 0.5f : 0.0f, has_lower = row < rows - 1 ? 0.5f : 0.0f;
        __global const float *upper = middle - (row > 0 ? columns : 0);
        __global const float *lower = middle + (row < rows - 1 ? columns : 0);
        EACH_COLUMN(x, patch) {
#define THREE_ROWS(at) (middle[at] + (has_upper * upper[at] + has_lower * lower[at]))
            // By factors, as above: in loops over lanes what is read under a condition is read always.
            const size_t has_left = x > 0u, has_right = x + 1u < (size_t)columns;
            const float left = (float)has_left * THREE_ROWS(x - has_left);
            const float right = (float)has_right * THREE_ROWS(x + has_right);
            const float sum = THREE_ROWS(x) + 0.5f * (left + right);
#undef THREE_ROWS
            pooled_evidence[y * columns + x] = sum * (1.0f / (4u * CELL_SIZE * CELL_SIZE));
        }
    }
}

// What cells tell of a detail counts for so many samples of a pixel, beside what it tells itself and its
// neighbours at the distance of the detail. So the first samples are judged together, and many where they
// are.
#define CELLS_COUNT 32.0f

// The share of a detail that is no noise, which is what is shown of it.
INLINE float signal_share(float signal, float noise) {
    return signal > 0.0f ? signal / (signal + noise) : 0.0f;
}

// How much of white noise is in each detail, where all pixels belong together: what the passes before it
// leave, less what the next one leaves.
__constant float noise_of_detail[SMOOTHING_SCALES + 1u] = {0.859375f, 0.111084f, 0.022488f, 0.005310f,
                                                           0.001743f};

__kernel WIDE void show_change(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, GUIDES_PARAMETERS,
                               SPANS_PARAMETERS, BASE_PARAMETERS, DETAILS_PARAMETERS, EVIDENCE_PARAMETERS,
                               COLUMN_EVIDENCE_PARAMETERS, SHOWN_IMAGE_PARAMETERS, SHOWN_SHARES_PARAMETERS) {
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const Patch near = near_change(&patch, height, spans);
    const size_t pixels = (size_t)width * height, size = field_size(width, height);
    const size_t column_size = (size_t)width * cell_rows(height);
    EACH_ROW(y, near) {
        const CellRows rows = cell_rows_around(width, height, y);
        EACH_COLUMN(x, near) {
            const size_t pixel = y * width + x, place = field_place(width, x, y);
            const ClassShares class = class_shares(labels[pixel]);
            const float samples =
                pairs[PAIR_SAMPLES_0 * pixels + pixel] + pairs[PAIR_SAMPLES_1 * pixels + pixel];
            const float cells_count = CELLS_COUNT / MAX(samples, 1.0f);
            Vec3 light = load_vec3(base_light, pixels, pixel);
            float shown_share = 0.0f;
#pragma unroll
            for (size_t i = 0u; i <= SMOOTHING_SCALES; i++) {
                __global const float *of_cells = column_evidence + CELL_EVIDENCE * i * column_size;
                float signal = between_cells(of_cells, column_size, &rows, x, &class);
                float noise = between_cells(of_cells + CLASSES * column_size, column_size, &rows, x, &class);
                if (i < LOCAL_SCALES) {
                    const size_t step = (size_t)1u << i, below = step * field_pitch(width);
                    __global const float *field = evidence + EVIDENCE_PLANES * i * size;
                    float weights[9];
                    load_guides(guides + 2u * i * size, size, place, weights);
                    const Around signals = load_around(field + EVIDENCE_SIGNAL * size, place, step, below);
                    const Around noises = load_around(field + EVIDENCE_NOISE * size, place, step, below);
                    signal = weighted(&signals, weights) + cells_count * signal;
                    noise = weighted(&noises, weights) + cells_count * noise;
                }
                const Vec3 detail = load_vec3(details + 3u * i * pixels, pixels, pixel);
                const float share = signal_share(signal, noise);
                light = add(light, scale(share, detail));
                shown_share += noise_of_detail[i] * share;
            }
            shown_shares[pixel] = shown_share;
            store_pixel(shown_image, pixel, light, anchor_sums[3u * pixels + pixel] + samples > 0.0f);
        }
    }
}
