#include "shading/fresnel.cl"

// Colours of a thin film on a surface: L. Belcour and P. Barla, A Practical Extension to Microfacet Theory
// for the Modeling of Varying Iridescence, SIGGRAPH 2017, as KHR_materials_iridescence uses it. Light that
// goes to and fro in the film between its two sides interferes. The spectrum is that of a wave over the wave
// number, which the eye's sensitivities, as Gaussians over it, turn into a colour in closed form.

typedef struct {
    Vec3 f0;              // reflectance of what is below the film at normal incidence, from air
    float ior, thickness; // of the film; nm
} ThinFilm;

// What an eye sees of a wave of reflectance over wave numbers, for a difference of optical paths in nm, and a
// shift of its phase in turns. Rec. 709.
INLINE Vec3 wave_color(float path, float turns) {
    // Gaussians of the sensitivities: their height, middle and variance (Belcour and Barla 2017, appendix).
    float phase = 2.0f * PI * 1e-9f * path, phase2 = phase * phase;
    float sine, x, y, z, second;
    float at_x = 1.6810e-3f * path + turns, at_y = 1.7953e-3f * path + turns;
    float at_z = 2.2084e-3f * path + turns, at_second = 2.2399e-3f * path + turns;
    sincos_turns(at_x - FLOOR(at_x), &sine, &x);
    sincos_turns(at_y - FLOOR(at_y), &sine, &y);
    sincos_turns(at_z - FLOOR(at_z), &sine, &z);
    sincos_turns(at_second - FLOOR(at_second), &sine, &second);
    // Height times sqrt(2 pi variance), over the integral of the sensitivity to green.
    x = 0.84659f * x * exp_negative(-4.3278e9f * phase2) +
        0.15387f * second * exp_negative(-4.5282e9f * phase2);
    y = 1.00022f * y * exp_negative(-9.3046e9f * phase2);
    z = 1.00113f * z * exp_negative(-6.6121e9f * phase2);
    // To Rec. 709, whose white is that of a surface that reflects all waves alike.
    return vec3(3.079955f * x - 1.537138f * y - 0.542816f * z, -0.921258f * x + 1.876011f * y + 0.045247f * z,
                0.052887f * x - 0.204026f * y + 1.151139f * z);
}

// One channel of the reflectance below the film, seen from inside of it, and -1 where that turns the phase
// over, else 1.
INLINE float below_film(float f0, float ior, float cosine, float *sign) {
    float root = SQRT(MIN(f0, 0.9999f));
    float base_ior = (1.0f + root) / (1.0f - root);
    *sign = base_ior < ior ? -1.0f : 1.0f;
    return fresnel_dielectric(cosine, base_ior / ior);
}

// One channel: Airy's sum to its second term. `first` and `second` are the colours of waves with one and with
// two ways to and fro.
INLINE float airy_sum(float outer, float inner, float first, float second) {
    float through = 1.0f - outer;
    float both = MIN(outer * inner, 0.9999f);
    float root = SQRT(both);
    float again = through * through * inner / (1.0f - both);
    float wave = again - through;
    return outer + again + 2.0f * wave * (root * first + both * second);
}

// Reflectance for light at this cosine to the normal of the microfacet, in [0, 1].
INLINE Vec3 film_reflectance(const ThinFilm *film, float cosine) {
    // A film that is thinner than any wave is none.
    float t = CLAMP(film->thickness * (1.0f / 0.03f), 0.0f, 1.0f);
    float ior = LERP(1.0f, film->ior, t * t * (3.0f - 2.0f * t));
    float c = CLAMP(cosine, 0.0f, 1.0f);
    float inside = SQRT(MAX(1.0f - (1.0f - c * c) / (ior * ior), 0.0f));
    float outer = fresnel_dielectric(c, ior);
    float path = 2.0f * ior * film->thickness * inside;
    float sign_r, sign_g, sign_b;
    float inner_r = below_film(film->f0.x, ior, inside, &sign_r);
    float inner_g = below_film(film->f0.y, ior, inside, &sign_g);
    float inner_b = below_film(film->f0.z, ior, inside, &sign_b);
    // Half a turn at the upper side, seen from below. Two ways turn the phase by whole turns.
    Vec3 odd = wave_color(path, 0.5f), twice = wave_color(2.0f * path, 0.0f);
    Vec3 sum = vec3(airy_sum(outer, inner_r, sign_r * odd.x, twice.x),
                    airy_sum(outer, inner_g, sign_g * odd.y, twice.y),
                    airy_sum(outer, inner_b, sign_b * odd.z, twice.z));
    return vec3(CLAMP(sum.x, 0.0f, 1.0f), CLAMP(sum.y, 0.0f, 1.0f), CLAMP(sum.z, 0.0f, 1.0f));
}
