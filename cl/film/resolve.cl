// How many floats a pixel of the pass has.
#ifndef CHANNELS
#define CHANNELS 3
#endif

// The picture of one pass of the film: its sums, divided by the number of samples unless KEEP_SUMS, and after
// them 1, interleaved; all are 0 where there is no sample yet. `sums` has planes as cl/film/reduce.cl
// fills them.
__kernel void resolve(RESOLUTION_PARAMETERS) {
    uint pixel = (uint)get_global_id(0);
    if (pixel >= pixel_total)
        return;
    float count = sums[CHANNELS * pixel_total + pixel];
#ifdef KEEP_SUMS
    float scale = count > 0.0f ? 1.0f : 0.0f;
#else
    float scale = count > 0.0f ? 1.0f / count : 0.0f;
#endif
    for (uint channel = 0u; channel < CHANNELS; channel++)
        image[(CHANNELS + 1u) * pixel + channel] = sums[channel * pixel_total + pixel] * scale;
    image[(CHANNELS + 1u) * pixel + CHANNELS] = count > 0.0f ? 1.0f : 0.0f;
}
