"""What is written over the picture: numbers and legend of an overlay, and the two sides of a split view."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.display.overlays import Overlay
from incpt.ui.display.projection import split_x
from incpt.ui.preferences import DisplaySettings
from incpt.ui.rect import Point, Rect
from incpt.ui.widgets import places, theme
from incpt.viewer.view import Frame, Picture

_NUMBERS_MARGIN = 4.0
"""How much wider than its number a tile has to be on the screen for numbers to be written, in points."""
_BESIDE = (0.0, 0.0, 0.0, 0.65)
"""What the picture is darkened by beside a region, sRGB with alpha."""
_DARKNESS = "Nothing shines in this scene: add a light, or an environment in the Scene panel"


def draw(frame: Frame | None, overlay: Overlay | None, settings: DisplaySettings, area: Rect[float]) -> None:
    """Write what belongs to the `overlay` and to a split view over the picture that lies at `area`, in
    points."""
    if frame is None:
        return
    canvas = imgui.get_background_draw_list()
    if overlay is not None and settings.overlay != "none":
        _write_numbers(canvas, overlay, frame.pictures[-1], area)
        _write_legend(canvas, overlay, area)
    if settings.split and len(frame.pictures) == 2:
        _write_sides(canvas, frame, settings.split_position, area)


def draw_region(picture: Rect[float], region: Rect[float]) -> None:
    """Darken the picture, which lies at `picture` in points, around the region that alone is rendered, and
    draw a line around that; it is given in units of the picture."""
    canvas, part = imgui.get_background_draw_list(), picture.part(region)
    shade = imgui.get_color_u32(imgui.ImVec4(*_BESIDE))
    for left, top, right, bottom in (
        (picture.left, picture.top, picture.right, part.top),
        (picture.left, part.bottom, picture.right, picture.bottom),
        (picture.left, part.top, part.left, part.bottom),
        (part.right, part.top, picture.right, part.bottom),
    ):
        canvas.add_rect_filled((left, top), (right, bottom), shade)
    line = imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT))
    canvas.add_rect((part.left, part.top), (part.right, part.bottom), line)
    places.note_rect("region", part)


def draw_darkness(area: Rect[float]) -> None:
    """Write why the picture is black, in the middle of it."""
    size = imgui.calc_text_size(_DARKNESS)
    x, y = area.middle
    write_label(imgui.get_background_draw_list(), (x - size.x / 2, y - size.y / 2), _DARKNESS)
    places.note_rect("darkness", Rect(x - size.x / 2, y - size.y / 2, size.x, size.y))


def write_label(canvas: imgui.ImDrawList, at: Point, text: str) -> None:
    """Write a line over the picture, on a dark ground; `at` is its top left, in points."""
    size, pad = imgui.calc_text_size(text), imgui.get_text_line_height() * 0.3
    dark = imgui.get_color_u32(imgui.ImVec4(0.0, 0.0, 0.0, 0.6))
    corner, opposite = (at[0] - pad, at[1] - pad / 2), (at[0] + size.x + pad, at[1] + size.y + pad / 2)
    canvas.add_rect_filled(corner, opposite, dark, 3.0)
    canvas.add_text(at, imgui.get_color_u32(imgui.ImVec4(*theme.ON_PICTURE)), text)


def _write_numbers(canvas: imgui.ImDrawList, overlay: Overlay, picture: Picture, area: Rect[float]) -> None:
    if overlay.numbers is None or overlay.numbers_at is None:
        return
    height, width = picture.image.shape[:2]
    scale = area.width / width, area.height / height
    widest = imgui.calc_text_size(str(int(overlay.numbers.max(initial=0)))).x
    if picture.grid.tile_size * scale[0] < widest + _NUMBERS_MARGIN:
        return
    white, half = imgui.get_color_u32(imgui.ImVec4(1.0, 1.0, 1.0, 0.9)), imgui.get_text_line_height() / 2
    for number, (x, y) in zip(overlay.numbers.tolist(), overlay.numbers_at.tolist(), strict=True):
        text = str(number)
        left = area.left + x * scale[0] - imgui.calc_text_size(text).x / 2
        canvas.add_text((left, area.top + y * scale[1] - half), white, text)


def _write_legend(canvas: imgui.ImDrawList, overlay: Overlay, area: Rect[float]) -> None:
    line = imgui.get_text_line_height()
    x, y = area.left + line * 0.6, area.bottom - line * 1.4
    for text, (red, green, blue) in overlay.legend:
        write_label(canvas, (x + line * 1.2, y), text)
        tint = imgui.get_color_u32(imgui.ImVec4(red / 255, green / 255, blue / 255, 1.0))
        canvas.add_rect_filled((x, y), (x + line * 0.8, y + line), tint, 2.0)
        y -= line * 1.35


def _write_sides(canvas: imgui.ImDrawList, frame: Frame, position: float, area: Rect[float]) -> None:
    line = imgui.get_text_line_height()
    bar, y = split_x(area, position), area.top + line * 0.5
    left, right = (f"{p.strategy}, {p.seconds:.2f} s" + _error_text(p.error) for p in frame.pictures)
    write_label(canvas, (bar - imgui.calc_text_size(left).x - line, y), left)
    write_label(canvas, (bar + line, y), right)


def _error_text(error: float | None) -> str:
    return "" if error is None else f", RMSE {error:.4f}"
