"""The picture on the screen: linear radiance in textures, tone-mapped on the GPU, under overlays, a tile
grid, the outline of the selection and the bar of a split view. Changes nothing of what was rendered."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np
import numpy.typing as npt

from incpt.picture import tone_mapping
from incpt.ui.display import overlays
from incpt.ui.display.outline import (
    FULL_SCREEN,
    OVER,
    Outline,
    Outlined,
    PixelRect,
    Rect,
    inside,
    viewport_of,
)

if TYPE_CHECKING:
    from incpt.render.first_hits import Aovs
    from incpt.render.tiles import TileGrid
    from incpt.ui.display.overlays import Overlay
    from incpt.ui.preferences import DisplaySettings
    from incpt.viewer.viewer import Picture

NEAREST_FROM = 2.0
"""Magnification from which pixels are shown as squares."""
GRID_MIN_PX, GRID_FULL_PX = 3.0, 10.0
"""Distance of tile lines below which there are none, and from which they are at full strength."""
BAR_PX, GRIP_PX = 2.0, (10.0, 44.0)
"""Width of the split bar, and width and height of its grip, at a DPI scale of 1."""


def _glsl(values: object) -> str:
    return ", ".join(f"{value:.9g}" for value in np.ravel(np.asarray(values, np.float64)))


# The constants of incpt.image_io. GLSL takes matrices column by column.
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

_TONE_MAP = f"""#version 330 core
{_CURVES}
uniform sampler2D picture;
uniform sampler2D underlay;
uniform bool has_underlay;
uniform vec3 nothing;
uniform float factor;
uniform int curve;
out vec4 result;

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
        if (!has_underlay) {{
            result = vec4(nothing, 1.0);
            return;
        }}
        radiance = texture(underlay, gl_FragCoord.xy / vec2(textureSize(picture, 0)));
    }}
    // A comparison with NaN may be optimised away; its bits cannot be mistaken.
    uvec3 bits = floatBitsToUint(radiance.rgb) & 0x7fffffffu;
    if (any(greaterThan(bits, uvec3(0x7f800000u)))) {{
        result = vec4(undefined_pixel, 1.0);
        return;
    }}
    vec3 linear = min(clamp(radiance.rgb, 0.0, 1e30) * factor, 1e30);
    result = vec4(curve == 0 ? agx(linear) : curve == 1 ? filmic(linear) : srgb(linear), 1.0);
}}
"""

_SHADER_CURVES = {"agx": 0, "filmic": 1, "srgb": 2}

# The mean brightness of each tile, from 16 places in it.
_TILE_LUMA = """#version 330 core
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

# Positions count from the top left, as in the image; `rect` is where the image lies in the framebuffer.
_COMPOSE = """#version 330 core
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

_BAR = """#version 330 core
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


class _Side:
    """One picture on the GPU: its radiance, what shows through where it has none yet, and the result of tone
    mapping at its own size."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.picture: Picture | None = None
        self.radiance: moderngl.Texture | None = None
        self.underlay: moderngl.Texture | None = None
        self.mapped: moderngl.Texture | None = None
        self.target: moderngl.Framebuffer | None = None
        self.mapped_with: tuple[float, str] | None = None
        self.tile_luma: moderngl.Texture | None = None
        self.tile_luma_target: moderngl.Framebuffer | None = None
        self.tile_luma_of: TileGrid | None = None
        self.overlay: Overlay | None = None
        self.overlay_texture: moderngl.Texture | None = None
        self.overlay_of: tuple[str, tuple[int, ...]] | None = None
        self.overlay_source: Picture | Aovs | None = None

    @property
    def aspect(self) -> float:
        """Width over height."""
        assert self.picture is not None
        height, width = self.picture.image.shape[:2]
        return float(width / height)

    def upload(self, picture: Picture) -> None:
        old = self.picture
        self.picture = picture
        if old is not None and old.image is picture.image:
            return
        image = self._fitting(picture.image)
        height, width = image.shape[:2]
        if self.radiance is None or self.radiance.size != (width, height):
            self._resize(width, height, old)
        assert self.radiance is not None
        self.radiance.write(np.ascontiguousarray(image, np.float32))
        self.mapped_with = self.tile_luma_of = None
        if self.underlay is not None and _is_complete(picture):
            self.underlay.release()
            self.underlay = None

    def _resize(self, width: int, height: int, old: Picture | None) -> None:
        if self.radiance is not None:
            if old is not None and _is_complete(old):
                self.underlay, self.radiance = self.radiance, self.underlay
            if self.radiance is not None:
                self.radiance.release()
        for resource in (self.mapped, self.target):
            if resource is not None:
                resource.release()
        self.radiance = self._context.texture((width, height), 4, dtype="f4")
        self.mapped = self._context.texture((width, height), 4)
        self.mapped.repeat_x = self.mapped.repeat_y = False
        self.target = self._context.framebuffer([self.mapped])
        if self.underlay is not None:
            self.underlay.repeat_x = self.underlay.repeat_y = False
            self.underlay.filter = (moderngl.LINEAR, moderngl.LINEAR)

    def lay_over(self, kind: str, aovs: Aovs | None) -> None:
        """Makes the overlay texture that of `kind`, unless it is there already."""
        assert self.picture is not None
        source = aovs if kind in overlays.NEEDS_AOVS else self.picture
        if self.overlay_of == (kind, self.picture.image.shape) and self.overlay_source is source:
            return
        self.overlay = overlays.build(kind, self.picture, aovs)
        self.overlay_of, self.overlay_source = (kind, self.picture.image.shape), source
        if self.overlay is None:
            return
        image = self._fitting(self.overlay.image)
        height, width = image.shape[:2]
        if self.overlay_texture is None or self.overlay_texture.size != (width, height):
            if self.overlay_texture is not None:
                self.overlay_texture.release()
            self.overlay_texture = self._context.texture((width, height), 4)
        self.overlay_texture.write(np.ascontiguousarray(image))

    def make_tile_luma(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The target for one brightness a tile, of a grid of columns and rows."""
        if self.tile_luma is None or self.tile_luma_target is None or self.tile_luma.size != size:
            for resource in (self.tile_luma, self.tile_luma_target):
                if resource is not None:
                    resource.release()
            self.tile_luma = self._context.texture(size, 1)
            self.tile_luma_target = self._context.framebuffer([self.tile_luma])
        return self.tile_luma_target

    def _fitting(self, image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Every n-th pixel of an image that is larger than a texture may be."""
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        n = -(-max(image.shape[:2]) // limit)
        return image[::n, ::n]

    def release(self) -> None:
        for resource in (
            self.radiance,
            self.underlay,
            self.mapped,
            self.target,
            self.tile_luma,
            self.tile_luma_target,
            self.overlay_texture,
        ):
            if resource is not None:
                resource.release()


class Display:
    """Shows pictures in an OpenGL 3.3 core context. All calls belong to the thread of that context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._tone_map = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_TONE_MAP)
        self._compose = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_COMPOSE)
        self._bar = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_BAR)
        self._tile_luma = context.program(vertex_shader=FULL_SCREEN, fragment_shader=_TILE_LUMA)
        self._programs = (self._tone_map, self._compose, self._bar, self._tile_luma)
        self._arrays = {p: context.vertex_array(p, []) for p in self._programs}
        self.outline = Outline(context)
        self._sides: list[_Side] = []
        self._aovs: Aovs | None = None
        self.background = (0.11, 0.11, 0.115)
        """Colour of pixels that have no sample yet and nothing to show instead, sRGB."""

    def upload(self, pictures: Sequence[Picture], aovs: Aovs | None = None) -> None:
        """Take the pictures of a Frame; what is the same as before is not sent again.

        When the size of a picture changes, the last complete one of the other size (the preview of a camera
        move, say) shows through where the new one has no sample yet, until it is complete.
        """
        while len(self._sides) < len(pictures):
            self._sides.append(_Side(self._context))
        while len(self._sides) > len(pictures):
            self._sides.pop(0).release()
        for side, picture in zip(self._sides, pictures, strict=True):
            side.upload(picture)
        self._aovs = aovs

    def forget(self) -> None:
        """Drop the pictures: nothing of them may show through the next, of another scene."""
        self.upload(())
        self._aovs = None

    @property
    def has_picture(self) -> bool:
        return bool(self._sides)

    def overlay(self, side: int = -1) -> Overlay | None:
        """The overlay of a side as it was drawn last, for its legend and numbers; see `overlays.Overlay`."""
        return self._sides[side].overlay if self._sides else None

    def draw(
        self,
        rect_px: Rect,
        settings: DisplaySettings,
        *,
        framebuffer_size: tuple[int, int],
        clip_px: Rect | None = None,
        selection: Outlined | None = None,
        scale: float = 1.0,
    ) -> None:
        """Draw into the framebuffer that is bound.

        `rect_px` is where the image lies, (x, y, width, height) in pixels of the framebuffer from its top
        left corner; it may reach beyond it. `clip_px`, by default the whole framebuffer, is where drawing is
        allowed. `scale` is the DPI scale, for lines. Leaves viewport and blending as imgui's renderer, which
        sets its own, may have them; restores the bound framebuffer.
        """
        area = inside(rect_px, clip_px, framebuffer_size)
        if not self._sides or area is None:
            return
        context, target, height = self._context, self._context.fbo, framebuffer_size[1]
        context.enable_only(moderngl.NOTHING)
        bar_x = (
            split_x(rect_px, settings.split_position) if settings.split and len(self._sides) == 2 else None
        )
        shown = self._shown(area, bar_x)
        for side, _ in shown:
            self._map(side, settings)
            if settings.tile_grid:
                self._measure_tiles(side)
            side.lay_over(settings.overlay, self._aovs)
        target.use()
        context.scissor = None
        for side, part in shown:
            self._draw_side(side, part, rect_px, settings, height)
        if settings.outline and selection is not None:
            self.outline.draw(target, area, rect_px, height, selection, self._sides[-1].aspect, scale)
        if bar_x is not None:
            self._draw_bar(bar_x, area, rect_px, height, scale)
        context.enable_only(moderngl.NOTHING)
        context.viewport = (0, 0, *framebuffer_size)

    def release(self) -> None:
        """Give all GL objects back."""
        self.forget()
        self.outline.release()
        for array in self._arrays.values():
            array.release()
        for program in self._programs:
            program.release()

    def _shown(self, area: PixelRect, bar_x: float | None) -> list[tuple[_Side, PixelRect]]:
        """Which side is seen in which part of the area."""
        if bar_x is None:
            return [(self._sides[-1], area)]
        x, y, width, height = area
        cut = min(max(round(bar_x), x), x + width)
        left, right = (x, y, cut - x, height), (cut, y, x + width - cut, height)
        return [(side, part) for side, part in zip(self._sides, (left, right), strict=True) if part[2] > 0]

    def _map(self, side: _Side, settings: DisplaySettings) -> None:
        wanted = (settings.exposure, settings.curve)
        if side.mapped_with == wanted:
            return
        assert side.radiance is not None and side.target is not None
        program = self._tone_map
        program["factor"] = 2.0**settings.exposure
        program["curve"] = _SHADER_CURVES[settings.curve]
        program["nothing"] = self.background
        program["has_underlay"] = side.underlay is not None
        program["picture"], program["underlay"] = 0, 1
        side.radiance.use(0)
        (side.underlay or side.radiance).use(1)
        side.target.use()
        self._context.scissor = None
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)
        side.mapped_with = wanted
        side.tile_luma_of = None

    def _measure_tiles(self, side: _Side) -> None:
        assert side.picture is not None and side.mapped is not None
        grid, limit = side.picture.grid, self._context.info["GL_MAX_TEXTURE_SIZE"]
        if side.tile_luma_of == grid or max(grid.columns, grid.rows) > limit:
            return
        program = self._tile_luma
        program["mapped"] = 0
        program["tile_units"] = (grid.tile_size / grid.width, grid.tile_size / grid.height)
        side.mapped.use(0)
        side.make_tile_luma((grid.columns, grid.rows)).use()
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)
        side.tile_luma_of = grid

    def _draw_side(
        self,
        side: _Side,
        part: PixelRect,
        rect_px: Rect,
        settings: DisplaySettings,
        framebuffer_height: int,
    ) -> None:
        assert side.mapped is not None and side.picture is not None
        height, width = side.picture.image.shape[:2]
        magnified = min(rect_px[2] / width, rect_px[3] / height)
        tile_size = side.picture.grid.tile_size
        program = self._compose
        program["rect"] = tuple(map(float, rect_px))
        program["framebuffer_height"] = float(framebuffer_height)
        program["nearest"] = magnified >= NEAREST_FROM
        program["tile_size"] = float(tile_size)
        program["image_size"] = (float(width), float(height))
        program["grid_strength"] = _grid_strength(tile_size * magnified) if settings.tile_grid else 0.0
        program["opacity"] = settings.overlay_opacity if side.overlay is not None else 0.0
        program["overlay_extent"] = tuple(map(float, side.overlay.extent_px)) if side.overlay else (1.0, 1.0)
        program["mapped"], program["overlay"], program["tile_luma"] = 0, 1, 2
        side.mapped.use(0)
        (side.overlay_texture or side.mapped).use(1)
        (side.tile_luma or side.mapped).use(2)
        self._context.viewport = viewport_of(part, framebuffer_height)
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)

    def _draw_bar(
        self,
        bar_x: float,
        area: PixelRect,
        rect_px: Rect,
        framebuffer_height: int,
        scale: float,
    ) -> None:
        grip = (GRIP_PX[0] / 2 * scale, GRIP_PX[1] / 2 * scale)
        reach = math.ceil(grip[0] + 2 * scale)
        x = round(bar_x)
        part = inside((x - reach, area[1], 2 * reach, area[3]), area, None)
        if part is None:
            return
        program = self._bar
        program["center"] = (float(x), rect_px[1] + rect_px[3] / 2)
        program["grip"] = grip
        program["half_width"] = max(round(BAR_PX * scale), 1) / 2
        program["rim"] = max(scale, 1.0)
        program["framebuffer_height"] = float(framebuffer_height)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = OVER  # type: ignore[assignment]  # takes four as well
        self._context.viewport = viewport_of(part, framebuffer_height)
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)


def split_x(rect_px: Rect, position: float) -> float:
    """Where the bar of the split view stands, x in pixels of the framebuffer."""
    return rect_px[0] + rect_px[2] * position


def _grid_strength(tile_px: float) -> float:
    return 0.35 * min(max((tile_px - GRID_MIN_PX) / (GRID_FULL_PX - GRID_MIN_PX), 0.0), 1.0)


def _is_complete(picture: Picture) -> bool:
    return bool((picture.image[..., 3] != 0).all())
