"""Where widgets were drawn in the frame before, by name: what help, tests and the pictures of the
documentation point at. Coordinates are imgui's: points from the top left of the window."""

from __future__ import annotations

from imgui_bundle import imgui

from incpt.ui.rect import Rect

_drawing: dict[str, Rect[float]] = {}
"""Places noted in the frame that is being drawn."""
_drawn: dict[str, Rect[float]] = {}
"""Places noted in the frame before."""
_hidden = [False, False]
"""Whether the widget that the hand is at was cut off altogether, in the frame that is drawn and in the one
before."""


def begin_frame() -> None:
    """What was noted so far becomes the frame before."""
    global _drawing, _drawn
    _drawn, _drawing = _drawing, {}
    _hidden[:] = False, _hidden[0]


def note(name: str) -> None:
    """Remember the place of the widget drawn last: the part of it that its panel does not cut off."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    clip = imgui.internal.get_current_window_read().clip_rect
    left, top = max(low.x, clip.min.x), max(low.y, clip.min.y)
    right, bottom = min(high.x, clip.max.x), min(high.y, clip.max.y)
    if left < right and top < bottom:
        _drawing[name] = Rect(left, top, right - left, bottom - top)
    elif imgui.is_item_active():
        _hidden[0] = True


def note_rect(name: str, rect: Rect[float]) -> None:
    """Remember a place that is no widget of imgui."""
    _drawing[name] = rect


def is_active_hidden() -> bool:
    """Whether the widget that is dragged or typed into was out of sight in the frame before."""
    return _hidden[1]


def find(name: str) -> Rect[float] | None:
    """The place of a widget in the frame before; None where it was not drawn."""
    return _drawn.get(name)


def names() -> list[str]:
    """All widgets of the frame before."""
    return list(_drawn)
