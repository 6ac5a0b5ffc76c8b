"""What is drawn over the picture while a transform is under way: its header, the axes along which it is held,
and the way from the pivot to the mouse."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui

from incpt.scene.camera import Camera
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import captions
from incpt.ui.viewport.light_marks import on_screen
from incpt.ui.viewport.modal_transform import ModalTransform
from incpt.ui.widgets import places, theme

Array = npt.NDArray[np.float64]

HINT = (
    "Enter, click: done   |   Esc, right click: give up   |   X Y Z: axis, again: local   |   "
    "Shift + X Y Z: plane   |   Ctrl: steps   |   Shift: finer"
)
"""What keys do meanwhile, for the status line."""
_REACH = 1000.0
"""How far a line reaches, as a multiple of the distance of its point."""
_MOST_LINES = 32
"""Objects whose own axes are drawn."""
_DASH = 5.0
"""Length of a dash and of the gap behind it, in points."""


def draw(transform: ModalTransform, picture: Rect[float], is_split: bool) -> None:
    """Draw the marks over the picture, which lies at `picture` in points. Where it `is_split`, the header
    stands below the captions of the two sides."""
    canvas = imgui.get_background_draw_list()
    canvas.push_clip_rect((picture.left, picture.top), (picture.right, picture.bottom), True)
    camera = transform.start.scene.camera
    for point, direction, axis in transform.lines[:_MOST_LINES]:
        ends = on_screen(camera, visible_part(camera, point, direction), picture)
        if ends is not None:
            tint = imgui.get_color_u32(imgui.ImVec4(*theme.AXIS_COLORS[axis]))
            canvas.add_line(tuple(ends[0].tolist()), tuple(ends[1].tolist()), tint, 1.5)
    if transform.operation != "move":
        _draw_dashes(canvas, transform.start.center, transform.mouse)
    canvas.pop_clip_rect()
    _write_header(canvas, transform.header, picture, 2.2 if is_split else 0.5)


def visible_part(camera: Camera, point: Array, direction: Array) -> Array:
    """(2, 3) ends of a line through a point before the camera, both ways, cut off where it passes the
    camera's plane; world space."""
    forward = camera.image_plane(1.0)[2]
    distance = float(np.linalg.norm(point - camera.position))
    depth, slope = float((point - camera.position) @ forward), float(direction @ forward)
    reach = _REACH * max(distance, 1e-3)
    ends = []
    for side in (-1.0, 1.0):
        # Only the side that comes nearer to the camera passes its plane.
        nearing = -side * slope
        length = min(reach, 0.999 * depth / nearing) if nearing > 0 < depth else reach
        ends.append(point + side * length * direction)
    return np.array(ends)


def _write_header(canvas: imgui.ImDrawList, text: str, picture: Rect[float], lines: float) -> None:
    size, line = imgui.calc_text_size(text), imgui.get_text_line_height()
    at = picture.left + (picture.width - size.x) / 2, picture.top + lines * line
    captions.write_label(canvas, at, text)
    places.note_rect("transform", Rect(at[0], at[1], size.x, size.y))


def _draw_dashes(canvas: imgui.ImDrawList, start: Point, end: Point) -> None:
    way = np.subtract(end, start)
    length = float(np.linalg.norm(way))
    tint = imgui.get_color_u32(imgui.ImVec4(*theme.ON_PICTURE))
    for at in np.arange(0.0, length, 2 * _DASH):
        first, last = start + way * (at / length), start + way * (min(at + _DASH, length) / length)
        canvas.add_line(tuple(first.tolist()), tuple(last.tolist()), tint, 1.0)
