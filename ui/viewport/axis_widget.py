"""The axes of the world in a corner of the picture: how the view is turned, and a click to look along one."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui

from incpt.scene.camera import Camera
from incpt.ui.rect import Point, Rect
from incpt.ui.widgets import places, theme

SIDES = (("right", "left"), ("top", "bottom"), ("front", "back"))
"""From where the view looks after a click on the positive and the negative end of each axis."""
_REACH = 2.4
"""From its middle to the end of an axis, in heights of a line."""
_RADIUS = 0.55
"""Of a ball at an end, in heights of a line."""
_LEAST_PICTURE = 12.0
"""The least height of a picture that has one, in heights of a line."""


def side_at(camera: Camera, picture: Rect[float], at: Point) -> str | None:
    """From which side a click at a point of the screen is to look; None where it meets no end of an axis."""
    line = imgui.get_text_line_height()
    found = [end for end in _ends(camera, picture) if math.dist(end[1], at) <= _RADIUS * line * 1.15]
    return max(found, key=lambda end: end[2])[0] if found else None


def draw(camera: Camera, picture: Rect[float], mouse: Point) -> None:
    """Draw the axes over the picture, which lies at `picture` in points; the end at the mouse is marked."""
    line, canvas = imgui.get_text_line_height(), imgui.get_background_draw_list()
    marked, middle = side_at(camera, picture, mouse), _middle(picture)
    for side, place, _, axis, is_positive in sorted(_ends(camera, picture), key=lambda end: end[2]):
        r, g, b, _ = theme.AXIS_COLORS[axis]
        bright = imgui.get_color_u32(imgui.ImVec4(r, g, b, 1.0 if is_positive or side == marked else 0.45))
        if is_positive:
            canvas.add_line(middle, place, bright, 2.0)
        radius = _RADIUS * line * (1.15 if side == marked else 1.0 if is_positive else 0.8)
        canvas.add_circle_filled(place, radius, bright)
        if is_positive:
            name = "XYZ"[axis]
            size = imgui.calc_text_size(name)
            dark = imgui.get_color_u32(imgui.ImVec4(0.08, 0.08, 0.08, 1.0))
            canvas.add_text((place[0] - size.x / 2, place[1] - size.y / 2), dark, name)
        places.note_rect(f"axis {side}", Rect(*place, 0.0, 0.0))


def _middle(picture: Rect[float]) -> Point:
    inset = (_REACH + 2 * _RADIUS) * imgui.get_text_line_height()
    return picture.right - inset, picture.top + inset


def _ends(camera: Camera, picture: Rect[float]) -> list[tuple[str, Point, float, int, bool]]:
    """Of each end the side, the place on the screen, how near it is to the viewer, the axis, and whether it
    is its positive one; none where the picture is too small."""
    line = imgui.get_text_line_height()
    if min(picture.size) < _LEAST_PICTURE * line:
        return []
    right, up, forward = camera.image_plane(1.0)
    right, up = right / np.linalg.norm(right), up / np.linalg.norm(up)
    x, y = _middle(picture)
    found = []
    for axis in range(3):
        for sign, side in zip((1, -1), SIDES[axis], strict=True):
            across, upwards = sign * right[axis] * _REACH * line, sign * up[axis] * _REACH * line
            place = x + float(across), y - float(upwards)
            found.append((side, place, float(-sign * forward[axis]), axis, sign > 0))
    return found
