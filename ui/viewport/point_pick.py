"""A point of the picture that the mouse clicks for something that waits for it."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.rect import Point
from incpt.ui.viewport.box_select import draw_cross
from incpt.ui.viewport.modal_input import is_given_up, mouse

HINT = "Click what the light shall shine at   |   Esc, right click: give up"
"""What mouse and keys do meanwhile, for the status line."""


class PointPick:
    """Waits for a click. `is_on` tells whether it does."""

    def __init__(self) -> None:
        self.is_on = False
        self._last: Point = (0.0, 0.0)

    def begin(self) -> None:
        """Wait for a click."""
        self.is_on = True

    def stop(self) -> None:
        """Give it up."""
        self.is_on = False

    def update(self, *, is_blocked: bool) -> Point | None:
        """Take a frame's mouse and draw a cross at it; returns where it clicked, in points. A dialog
        (`is_blocked`) gives it up."""
        if is_blocked or is_given_up():
            self.stop()
            return None
        at = self._last = mouse(self._last)
        draw_cross(at)
        if not imgui.is_mouse_clicked(imgui.MouseButton_.left):
            return None
        self.stop()
        return at
