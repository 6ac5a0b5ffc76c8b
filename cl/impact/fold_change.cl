#include "impact/guides.cl"
#include "impact/pair.cl"

// Noise that is shown counts twice, since shrinkage may have taken some of it for signal. As little as this
// of it may be left: what drowned in noise is not shown, and has to be found later.
#define SHOWN_TWICE 2.0f
#define LEAST_SHOWN 0.03f

// The number of samples that a changed pixel is worth: its uncorrelated share started with the new samples,
// of whose noise only a part is shown; the correlated share goes on from those that were kept. 1 / worth is
// the variance over that of a sample.
INLINE float worth_of(const Pair *p, const Anchor *anchor, __global const float *known, uint total,
                      float shown) {
    const float samples = sample_count(p), refined = anchor->samples + pair_count(p);
    const float freedom = known[CELL_FREEDOM_NEW * total];
    // The mean square of the difference from the kept picture is what the variance is at most.
    const float new_variance =
        (freedom * known[CELL_NEW_VARIANCE * total] + known[CELL_NEW_MOMENT * total]) / (freedom + 1.0f);
    const float variances = new_variance * known[CELL_OLD_VARIANCE * total];
    const float covariance = known[CELL_COVARIANCE * total];
    const float correlation2 = variances > 0.0f ? MIN(covariance * covariance / variances, 1.0f) : 0.0f;
    const float kept_share = known[CELL_TOUCHED * total] > 0.0f ? correlation2 : 1.0f;
    const float per_worth =
        (1.0f - kept_share) * shown / MAX(samples, 1.0f) + kept_share / MAX(refined, 1e-20f);
    return samples > 0.0f ? 1.0f / per_worth : anchor->samples;
}

// Makes the shown picture, with what it is worth, the kept one. Pixels that show what they showed before
// without a new sample stay as they are to the bit.
__kernel WIDE void fold_change(PICTURE_PARAMETERS, PAIRS_PARAMETERS, LABELS_PARAMETERS, CELLS_PARAMETERS,
                               SHOWN_IMAGE_PARAMETERS, SHOWN_SHARES_PARAMETERS) {
    const Patch patch = patch_of(width, height, CELL_SIZE);
    const size_t pixels = (size_t)width * height;
    const uint total = cell_count(width, height);
    __global const float *row_of_cells = cells + patch.row * cell_columns(width);
    EACH_ROW(y, patch)
    EACH_COLUMN(x, patch) {
        const size_t pixel = y * width + x;
        const Pair p = load_pair(pairs, pixels, pixel);
        const Anchor anchor = load_anchor(anchor_sums, pixels, pixel);
        const uint class = class_of(labels[pixel]);
        const Vec3 light = vec3_at(shown_image + 4u * pixel);
        const int stays = (sample_count(&p) == 0.0f) & (light.x == anchor.radiance.x) &
                          (light.y == anchor.radiance.y) & (light.z == anchor.radiance.z);
        __global const float *known = row_of_cells + class * CELL_PLANES * total + (uint)x / CELL_SIZE;
        // Far from a change nothing is known of shares.
        const float noise = known[CELL_TOUCHED * total] > 0.0f ? SHOWN_TWICE * shown_shares[pixel] : 1.0f;
        const float worth = worth_of(&p, &anchor, known, total, CLAMP(noise, LEAST_SHOWN, 1.0f));
        anchor_sums[pixel] = stays ? anchor_sums[pixel] : light.x * worth;
        anchor_sums[pixels + pixel] = stays ? anchor_sums[pixels + pixel] : light.y * worth;
        anchor_sums[2u * pixels + pixel] = stays ? anchor_sums[2u * pixels + pixel] : light.z * worth;
        anchor_sums[3u * pixels + pixel] = stays ? anchor_sums[3u * pixels + pixel] : worth;
    }
}
