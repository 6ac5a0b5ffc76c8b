"""A box drawn by the mouse: things in it are selected, or it is the region that is rendered."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

from incpt.ui.rect import Point, Rect
from incpt.ui.viewport.modal_input import is_given_up, mouse
from incpt.ui.widgets import theme

HINT = "Drag: select what the box shows   |   Shift: add   |   Ctrl: take out   |   Esc, right click: give up"
"""What keys and mouse do while things are selected, for the status line."""
REGION_HINT = "Drag: render this part of the picture alone   |   Esc, right click: give up"
"""What they do while a region is drawn."""
_LEFT = imgui.MouseButton_.left


@dataclass(frozen=True)
class Box:
    """A box that was drawn, in points, and what becomes of what is in it: it is added to the selection, taken
    out of it, or selected alone."""

    rect: Rect[float]
    is_added: bool = False
    takes_out: bool = False


class BoxSelect:
    """Waits for a press, then for the release. `is_on` tells whether it does, `is_region` whether the box is
    that of a region."""

    def __init__(self) -> None:
        self.is_on = self.is_region = False
        self._start: Point | None = None
        self._last: Point = (0.0, 0.0)

    def begin(self, is_region: bool = False) -> None:
        """Wait for a press."""
        self.is_on, self.is_region, self._start = True, is_region, None

    def stop(self) -> None:
        """Give it up."""
        self.is_on, self._start = False, None

    def update(self, *, is_blocked: bool) -> Box | None:
        """Take a frame's mouse and draw the box; returns it when it is done. A dialog (`is_blocked`) gives it
        up."""
        if is_blocked or is_given_up():
            self.stop()
            return None
        at = self._last = mouse(self._last)
        if self._start is None and imgui.is_mouse_clicked(_LEFT):
            self._start = at
        start = self._start
        if start is None:
            draw_cross(at)
            return None
        rect = between(start, at)
        _draw(rect)
        if imgui.is_mouse_down(_LEFT):
            return None
        self.stop()
        io = imgui.get_io()
        return Box(rect, io.key_shift and not io.key_ctrl, io.key_ctrl)


def between(start: Point, end: Point) -> Rect[float]:
    """The upright rectangle with two corners."""
    left, top = min(start[0], end[0]), min(start[1], end[1])
    return Rect(left, top, abs(end[0] - start[0]), abs(end[1] - start[1]))


def _draw(rect: Rect[float]) -> None:
    canvas = imgui.get_background_draw_list()
    low, high = (rect.left, rect.top), (rect.right, rect.bottom)
    canvas.add_rect_filled(low, high, imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT[:3], 0.12)))
    canvas.add_rect(low, high, imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT)))


def draw_cross(at: Point) -> None:
    """Draw lines across the window through the mouse."""
    canvas, size = imgui.get_background_draw_list(), imgui.get_io().display_size
    tint = imgui.get_color_u32(imgui.ImVec4(*theme.ON_PICTURE[:3], 0.5))
    canvas.add_line((at[0], 0.0), (at[0], size.y), tint)
    canvas.add_line((0.0, at[1]), (size.x, at[1]), tint)
