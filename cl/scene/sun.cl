#include "base/sampling.cl"

// The sun of a sky: a disk at infinity of the same radiance all over, beside the image of the environment. It
// is smaller than a texel, and brings most of the light of a clear day, so that it has a share of the light
// samples for itself. Directions are told by their distance from the sun's middle on the unit sphere, the
// chord, since a cosine that near to 1 has too few digits: a cap of the chord c covers pi c^2 of the sphere.
#ifdef SUN

INLINE Vec3 sun_direction(const Params *params) {
    return vec3(params->sun_direction[0], params->sun_direction[1], params->sun_direction[2]);
}

// Whether a direction of unit length leads to the sun.
INLINE int meets_sun(const Params *params, Vec3 direction) {
    Vec3 chord = subtract(direction, sun_direction(params));
    return dot(chord, chord) < params->sun_chord * params->sun_chord;
}

// Density per solid angle with which `sample_sun` chooses directions that lead to the sun.
INLINE float sun_pdf(const Params *params) { return INV_PI / (params->sun_chord * params->sun_chord); }

INLINE Vec3 sample_sun(const Params *params, Uniform2 uv) {
    float squared = uv.u * params->sun_chord * params->sun_chord;
    float sine, cosine;
    sincos_turns(uv.v, &sine, &cosine);
    float aside = SQRT(MAX(squared * (1.0f - 0.25f * squared), 0.0f));
    Frame frame = frame_of(sun_direction(params));
    return normalize(from_local(frame, vec3(aside * cosine, aside * sine, 1.0f - 0.5f * squared)));
}

// Whether the first number leads to the sun; else it is made one of the same distribution again.
INLINE int chooses_sun(const Params *params, float *u) {
    float share = params->sun_probability;
    int chosen = *u < share;
    float rest = MIN(MAX(*u - share, 0.0f) / (1.0f - share), 0.99999994f);
    *u = chosen ? *u / share : rest;
    return chosen;
}
#endif
