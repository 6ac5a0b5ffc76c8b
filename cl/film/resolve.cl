// The film's picture: sums divided by counts, as interleaved red, green, blue and 1 (0 and black where
// there is no sample yet).
__kernel void resolve(const uint pixels, __global const float *film, __global float *image) {
    uint pixel = (uint)get_global_id(0);
    if (pixel >= pixels)
        return;
    float count = film[3u * pixels + pixel];
    float scale = count > 0.0f ? 1.0f / count : 0.0f;
    image[4u * pixel] = film[pixel] * scale;
    image[4u * pixel + 1u] = film[pixels + pixel] * scale;
    image[4u * pixel + 2u] = film[2u * pixels + pixel] * scale;
    image[4u * pixel + 3u] = count > 0.0f ? 1.0f : 0.0f;
}
