"""The picture on the screen: linear radiance in textures, tone-mapped on the GPU, under overlays, a tile
grid, the outline of the selection and the bar of a split view. Changes nothing of what was rendered."""

from __future__ import annotations

import math
from collections.abc import Sequence

import moderngl

from incpt.render.first_hits import FirstHits
from incpt.scene.camera import Camera
from incpt.scene.model import Scene
from incpt.ui.display import shaders
from incpt.ui.display.outline import Outline, Outlined
from incpt.ui.display.overlays import Overlay
from incpt.ui.display.projection import split_x, viewport_of, whole_pixels
from incpt.ui.display.shading import Shading
from incpt.ui.display.textures import PictureTextures
from incpt.ui.preferences import DisplaySettings
from incpt.ui.rect import Rect
from incpt.viewer.view import Picture

NEAREST_FROM = 2.0
"""Magnification from which pixels are shown as squares."""
GRID_MIN_PX, GRID_FULL_PX = 3.0, 10.0
"""Distance of tile lines below which there are none, and from which they are at full strength."""
BAR_PX, GRIP_PX = 2.0, (10.0, 44.0)
"""Width of the split bar, and width and height of its grip, at a DPI scale of 1."""


_BARE = DisplaySettings()
"""What is around a region has no overlay and no lines."""


class Display:
    """Shows pictures in an OpenGL 3.3 core context. All calls belong to the thread of that context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._tone_map = context.program(vertex_shader=shaders.FULL_SCREEN, fragment_shader=shaders.TONE_MAP)
        self._compose = context.program(vertex_shader=shaders.FULL_SCREEN, fragment_shader=shaders.COMPOSE)
        self._bar = context.program(vertex_shader=shaders.FULL_SCREEN, fragment_shader=shaders.BAR)
        self._tile_luma = context.program(
            vertex_shader=shaders.FULL_SCREEN, fragment_shader=shaders.TILE_LUMA
        )
        self._programs = (self._tone_map, self._compose, self._bar, self._tile_luma)
        self._arrays = {p: context.vertex_array(p, []) for p in self._programs}
        self.outline = Outline(context)
        self._shading: Shading | None = None
        self._sides: list[PictureTextures] = []
        self._region: Rect[float] | None = None
        self._camera: Camera | None = None
        self._around: PictureTextures | None = None
        """The whole picture as it was, around the region that alone is rendered."""
        self._first_hits: FirstHits | None = None
        self.background = (0.11, 0.11, 0.115)
        """Colour of pixels that have no sample yet and nothing to show instead, sRGB."""

    def upload(
        self,
        pictures: Sequence[Picture],
        first_hits: FirstHits | None = None,
        region: Rect[float] | None = None,
        camera: Camera | None = None,
    ) -> None:
        """Take the pictures of a Frame; what is the same as before is not sent again. They show a `region` of
        the picture, in units of it, or all of it (None). Around a region the last whole one stays, until the
        region is seen by another `camera`.

        When the size of a picture changes, the last complete one of the other size (the preview of a camera
        move, say) shows through where the new one has no sample yet, until it is complete.
        """
        if region != self._region:
            self._go_to(region)
        elif camera != self._camera:
            self._forget_around()
        self._camera = camera
        while len(self._sides) < len(pictures):
            self._sides.append(PictureTextures(self._context))
        while len(self._sides) > len(pictures):
            self._sides.pop(0).release()
        for side, picture in zip(self._sides, pictures, strict=True):
            side.upload(picture)
        self._first_hits = first_hits

    def _go_to(self, region: Rect[float] | None) -> None:
        if self._around is None and self._region is None and self._sides:
            self._around = self._sides.pop()
            self._around.overlay = self._around.overlay_of = None
        while self._sides:
            self._sides.pop().release()
        if region is None and self._around is not None:
            self._around.begin_anew()
            self._sides, self._around = [self._around], None
        self._region = region

    def forget(self) -> None:
        """Drop the pictures: nothing of them may show through the next, of another scene."""
        self.upload(())
        self._forget_around()
        self._first_hits = None

    def _forget_around(self) -> None:
        if self._around is not None:
            self._around.release()
            self._around = None

    def overlay(self, side: int = -1) -> Overlay | None:
        """The overlay of a side as it was drawn last, for its legend and numbers; see `overlays.Overlay`."""
        return self._sides[side].overlay if self._sides else None

    def draw(
        self,
        rect_px: Rect[float],
        settings: DisplaySettings,
        *,
        framebuffer_size: tuple[int, int],
        clip_px: Rect[float] | None = None,
        selection: Outlined | None = None,
        scale: float = 1.0,
        scene: Scene | None = None,
    ) -> None:
        """Draw into the framebuffer that is bound. `scene` is what is shaded where that is not rendered.

        `rect_px` is where the whole image lies in the framebuffer; it may reach beyond it. `clip_px`, by
        default the whole framebuffer, is where drawing is allowed. `scale` is the DPI scale, for lines.
        Leaves viewport and blending as imgui's renderer, which sets its own, may have them; restores the
        bound framebuffer.
        """
        whole = Rect(0, 0, *framebuffer_size)
        area = whole_pixels(rect_px, clip_px or whole, whole)
        shaded = scene if settings.shading != "rendered" else None
        if area is None or (not self._sides and shaded is None):
            return
        context, target, height = self._context, self._context.fbo, framebuffer_size[1]
        context.enable_only(moderngl.NOTHING)
        if shaded is not None:
            self._shading = self._shading or Shading(context)
            self._shading.draw(target, area, rect_px, height, shaded, settings.shading)
        else:
            self._draw_rendered(target, area, rect_px, settings, height, scale)
        if settings.outline and selection is not None:
            aspect = self._aspect(selection, shaded is not None)
            self.outline.draw(target, area, rect_px, height, selection, aspect, scale)
        context.enable_only(moderngl.NOTHING)
        context.viewport = (0, 0, *framebuffer_size)

    def _draw_rendered(
        self,
        target: moderngl.Framebuffer,
        area: Rect[int],
        rect_px: Rect[float],
        settings: DisplaySettings,
        framebuffer_height: int,
        scale: float,
    ) -> None:
        """The pictures, and the bar between two."""
        rendered = rect_px if self._region is None else rect_px.part(self._region)
        is_split = settings.split and len(self._sides) == 2
        bar_x = split_x(rect_px, settings.split_position) if is_split else None
        shown = self._shown(area, rendered, bar_x)
        self._prepare(shown, settings)
        target.use()
        self._context.scissor = None
        if self._around is not None:
            self._draw_side(self._around, area, rect_px, _BARE, framebuffer_height)
        for side, part in shown:
            self._draw_side(side, part, rendered, settings, framebuffer_height)
        if bar_x is not None:
            self._draw_bar(bar_x, area, rect_px, framebuffer_height, scale)
            self._context.disable(moderngl.BLEND)

    def release(self) -> None:
        """Give all GL objects back."""
        self.forget()
        self.outline.release()
        if self._shading is not None:
            self._shading.release()
        for array in self._arrays.values():
            array.release()
        for program in self._programs:
            program.release()

    def _aspect(self, selection: Outlined, is_shaded: bool) -> float:
        if self._region is None and not is_shaded:
            return self._sides[-1].aspect
        width, height = selection.scene.settings.size
        return width / height

    def _prepare(self, shown: Sequence[tuple[PictureTextures, Rect[int]]], settings: DisplaySettings) -> None:
        """Draw into the textures of what is shown what is not there yet."""
        if self._around is not None:
            self._map(self._around, settings)
        for side, _ in shown:
            self._map(side, settings)
            if settings.tile_grid:
                self._measure_tiles(side)
            side.lay_over(settings.overlay, self._first_hits)

    def _shown(
        self, area: Rect[int], rendered: Rect[float], bar_x: float | None
    ) -> list[tuple[PictureTextures, Rect[int]]]:
        """Which side is seen in which part of the area; `rendered` is where the pictures lie."""
        if bar_x is None:
            part = whole_pixels(rendered, area)
            return [] if part is None else [(self._sides[-1], part)]
        cut = min(max(round(bar_x), area.left), area.right)
        left = Rect(area.left, area.top, cut - area.left, area.height)
        right = Rect(cut, area.top, area.right - cut, area.height)
        return [(side, part) for side, part in zip(self._sides, (left, right), strict=True) if part.width > 0]

    def _map(self, side: PictureTextures, settings: DisplaySettings) -> None:
        wanted = (settings.exposure, settings.curve)
        if side.mapped_with == wanted:
            return
        assert side.radiance is not None and side.target is not None
        program = self._tone_map
        program["factor"] = 2.0**settings.exposure
        program["curve"] = shaders.CURVE_NUMBERS[settings.curve]
        program["nothing"] = self.background
        program["transparent"] = side.picture is not None and side.picture.transparent
        program["has_underlay"] = side.underlay is not None
        program["picture"], program["underlay"] = 0, 1
        side.radiance.use(0)
        (side.underlay or side.radiance).use(1)
        side.target.use()
        self._context.scissor = None
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)
        side.mapped_with = wanted
        side.tile_luma_of = None

    def _measure_tiles(self, side: PictureTextures) -> None:
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
        side: PictureTextures,
        part: Rect[int],
        rect_px: Rect[float],
        settings: DisplaySettings,
        framebuffer_height: int,
    ) -> None:
        assert side.mapped is not None and side.picture is not None
        height, width = side.picture.image.shape[:2]
        magnified = min(rect_px.width / width, rect_px.height / height)
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
        area: Rect[int],
        rect_px: Rect[float],
        framebuffer_height: int,
        scale: float,
    ) -> None:
        grip = (GRIP_PX[0] / 2 * scale, GRIP_PX[1] / 2 * scale)
        reach = math.ceil(grip[0] + 2 * scale)
        x = round(bar_x)
        part = whole_pixels(Rect(x - reach, area.top, 2 * reach, area.height), area)
        if part is None:
            return
        program = self._bar
        program["center"] = (float(x), rect_px.middle[1])
        program["grip"] = grip
        program["half_width"] = max(round(BAR_PX * scale), 1) / 2
        program["rim"] = max(scale, 1.0)
        program["framebuffer_height"] = float(framebuffer_height)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = shaders.OVER  # type: ignore[assignment]  # takes four as well
        self._context.viewport = viewport_of(part, framebuffer_height)
        self._arrays[program].render(moderngl.TRIANGLES, vertices=3)


def _grid_strength(tile_px: float) -> float:
    return 0.35 * min(max((tile_px - GRID_MIN_PX) / (GRID_FULL_PX - GRID_MIN_PX), 0.0), 1.0)
