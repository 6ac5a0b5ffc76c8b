"""The shaders that show a picture, in GLSL. Those of the outline stand in `outline`."""

from __future__ import annotations

import moderngl
import numpy as np

from incpt.picture import tone_mapping

FULL_SCREEN = """#version 330 core
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
"""
"""Vertex shader of one triangle that covers the viewport; draw 3 vertices of an empty array."""

OVER = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
"""Blending of straight alpha that leaves an opaque framebuffer opaque."""


def _glsl(values: object) -> str:
    return ", ".join(f"{value:.9g}" for value in np.ravel(np.asarray(values, np.float64)))


_CURVES = f"""
const mat3 agx_inset = mat3({_glsl(tone_mapping.AGX_INSET.T)});
const mat3 agx_outset = mat3({_glsl(tone_mapping.AGX_OUTSET.T)});
const vec2 agx_log2_range = vec2({_glsl(tone_mapping.AGX_LOG2_RANGE)});
const float agx_polynomial[7] = float[7]({_glsl(tone_mapping.AGX_POLYNOMIAL)});
const float hable[6] = float[6]({_glsl(tone_mapping.HABLE_CURVE)});
const float hable_white = {_glsl(tone_mapping.HABLE_WHITE)};
const float hable_bias = {_glsl(tone_mapping.HABLE_EXPOSURE_BIAS)};
const vec3 undefined_pixel = vec3({_glsl(np.array(tone_mapping.UNDEFINED_PIXEL) / 255)});
"""
"""The constants of incpt.picture.tone_mapping in GLSL, which takes matrices column by column."""

TONE_MAP = f"""#version 330 core
{_CURVES}
uniform sampler2D picture;
uniform sampler2D underlay;
uniform bool has_underlay;
uniform vec3 nothing;
uniform bool transparent;
uniform float factor;
uniform int curve;
out vec4 result;

const float square = 8.0;

// The pattern by which programs show that nothing is there: sRGB.
vec3 checkerboard(vec2 pixel) {{
    vec2 at = floor(pixel / square);
    return vec3(mod(at.x + at.y, 2.0) < 0.5 ? 0.40 : 0.55);
}}

vec3 srgb(vec3 x) {{
    x = min(x, 1.0);
    vec3 curved = 1.055 * pow(max(x, 1e-10), vec3(1.0 / 2.4)) - 0.055;
    return mix(12.92 * x, curved, greaterThan(x, vec3(0.0031308)));
}}

vec3 agx(vec3 linear) {{
    vec3 inset = max(agx_inset * linear, 1e-10);
    vec3 x = (log2(inset) - agx_log2_range.x) / (agx_log2_range.y - agx_log2_range.x);
    x = clamp(x, 0.0, 1.0);
    vec3 y = vec3(agx_polynomial[0]);
    for (int i = 1; i < 7; i++)
        y = y * x + agx_polynomial[i];
    return agx_outset * y;
}}

vec3 hable_curve(vec3 x) {{
    return (x * (hable[0] * x + hable[2] * hable[1]) + hable[3] * hable[4])
           / (x * (hable[0] * x + hable[1]) + hable[3] * hable[5]) - hable[4] / hable[5];
}}

vec3 filmic(vec3 linear) {{
    return srgb(hable_curve(min(linear * hable_bias, hable_white)) / hable_curve(vec3(hable_white)));
}}

void main() {{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 radiance = texelFetch(picture, pixel, 0);
    if (radiance.a == 0.0) {{
        if (!has_underlay && !transparent) {{
            result = vec4(nothing, 1.0);
            return;
        }}
        if (has_underlay)
            radiance = texture(underlay, gl_FragCoord.xy / vec2(textureSize(picture, 0)));
    }}
    float alpha = transparent ? clamp(radiance.a, 0.0, 1.0) : 1.0;
    if (transparent && radiance.a > 0.0)
        radiance.rgb /= radiance.a;
    // A comparison with NaN may be optimised away; its bits cannot be mistaken.
    uvec3 bits = floatBitsToUint(radiance.rgb) & 0x7fffffffu;
    if (any(greaterThan(bits, uvec3(0x7f800000u)))) {{
        result = vec4(undefined_pixel, 1.0);
        return;
    }}
    vec3 linear = min(clamp(radiance.rgb, 0.0, 1e30) * factor, 1e30);
    vec3 shown = curve == 0 ? agx(linear) : curve == 1 ? filmic(linear) : srgb(linear);
    result = vec4(mix(checkerboard(gl_FragCoord.xy), shown, alpha), 1.0);
}}
"""
"""Fragment shader: sRGB of linear radiance at the picture's own size, transparent pictures over a
checkerboard."""

CURVE_NUMBERS = {"agx": 0, "filmic": 1, "srgb": 2}
"""The values of `curve` in TONE_MAP, by name of the curve."""

TILE_LUMA = """#version 330 core
uniform sampler2D mapped;
uniform vec2 tile_units;
out float luma;
void main() {
    vec2 corner = floor(gl_FragCoord.xy) * tile_units;
    luma = 0.0;
    for (int y = 0; y < 4; y++)
        for (int x = 0; x < 4; x++) {
            vec2 place = corner + (vec2(x, y) + 0.5) / 4.0 * tile_units;
            luma += dot(textureLod(mapped, place, 0.0).rgb, vec3(0.2126, 0.7152, 0.0722)) / 16.0;
        }
}
"""
"""Fragment shader: the mean brightness of each tile, from 16 places in it."""

COMPOSE = """#version 330 core
uniform sampler2D mapped;
uniform sampler2D overlay;
uniform sampler2D tile_luma;
uniform float opacity;
uniform vec2 image_size;
uniform vec2 overlay_extent;
uniform vec4 rect;
uniform float framebuffer_height;
uniform bool nearest;
uniform float tile_size;
uniform float grid_strength;
out vec4 result;

bool on_line(float at, float origin, float step, float extent) {
    // Each line falls into exactly one pixel, whatever the zoom: that which holds the line itself.
    float line = round((at - origin) / step);
    float place = line * step;
    return line >= 1.0 && place < extent - 0.5 && floor(origin + place + 0.01) == floor(at);
}

// Light on dark tiles, dark on bright ones: by pixel, lines would break up into dots on a noisy picture.
vec3 with_grid(vec3 color, vec2 at, vec2 place) {
    vec2 step = tile_size * rect.zw / image_size;
    bool vertical = on_line(at.x, rect.x, step.x, rect.z);
    if (!vertical && !on_line(at.y, rect.y, step.y, rect.w))
        return color;
    vec2 tile = place / tile_size;
    ivec2 after = ivec2(vertical ? vec2(round(tile.x), tile.y) : vec2(tile.x, round(tile.y)));
    ivec2 before = after - (vertical ? ivec2(1, 0) : ivec2(0, 1));
    float luma = texelFetch(tile_luma, before, 0).r + texelFetch(tile_luma, after, 0).r;
    return mix(color, vec3(luma < 1.0 ? 1.0 : 0.0), grid_strength);
}

void main() {
    vec2 at = vec2(gl_FragCoord.x, framebuffer_height - gl_FragCoord.y);
    vec2 unit = (at - rect.xy) / rect.zw;
    if (any(lessThan(unit, vec2(0.0))) || any(greaterThanEqual(unit, vec2(1.0))))
        discard;
    vec2 place = unit * image_size;
    vec2 texels = vec2(textureSize(mapped, 0));
    vec3 color = nearest ? texelFetch(mapped, ivec2(unit * texels), 0).rgb : texture(mapped, unit).rgb;
    if (opacity > 0.0) {
        vec4 over = texelFetch(overlay, ivec2(place / overlay_extent * vec2(textureSize(overlay, 0))), 0);
        color = mix(color, over.rgb, over.a * opacity);
    }
    if (grid_strength > 0.0)
        color = with_grid(color, at, place);
    result = vec4(color, 1.0);
}
"""
"""Fragment shader: the tone-mapped picture under an overlay and the tile grid. Positions count from the top
left, as in the image; `rect` is where the image lies in the framebuffer."""

BAR = """#version 330 core
uniform vec2 center;
uniform vec2 grip;
uniform float half_width;
uniform float rim;
uniform float framebuffer_height;
out vec4 result;

float outside_grip(vec2 offset) {
    vec2 q = abs(offset) - (grip - grip.x);
    return length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - grip.x;
}

void main() {
    vec2 at = vec2(gl_FragCoord.x, framebuffer_height - gl_FragCoord.y);
    vec2 offset = at - center;
    float far = min(abs(offset.x) - half_width, outside_grip(offset));
    float white = clamp(0.5 - far, 0.0, 1.0);
    float dark = clamp(0.5 + rim - far, 0.0, 1.0) * 0.55;
    // Two grooves in the grip.
    float groove = abs(abs(offset.x) - grip.x * 0.32) < 0.5 * rim && abs(offset.y) < grip.y * 0.4 ? 0.5 : 0.0;
    result = vec4(vec3(0.96 - groove) * white / max(white, dark), max(white, dark));
}
"""
"""Fragment shader: the bar of a split view with its grip."""
