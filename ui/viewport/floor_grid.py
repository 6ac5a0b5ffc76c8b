"""A grid on the floor y = 0, drawn over the picture: how far things are from each other."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui

from incpt.scene.camera import Camera
from incpt.ui.rect import Rect
from incpt.ui.widgets import theme

_LINES = 20
"""Lines to either side of the middle."""
_NEAR = 1e-3
"""How far before the camera lines are cut, as a share of the way to its target."""
_EVERY = 10
"""Every so many lines one is stronger."""


def spacing(camera: Camera) -> float:
    """Metres between lines: the greatest power of ten below a third of the way to what the camera looks
    at."""
    way = math.dist(camera.position, camera.target)
    return float(10.0 ** math.floor(math.log10(max(way, 1e-6)) - 0.5))


def draw(camera: Camera, picture: Rect[float]) -> None:
    """Draw the grid below the camera's target over the picture, which lies at `picture` in points."""
    step = spacing(camera)
    middle = np.round(np.array(camera.target)[[0, 2]] / step).astype(np.int64)
    canvas = imgui.get_background_draw_list()
    canvas.push_clip_rect((picture.left, picture.top), (picture.right, picture.bottom), True)
    for axis in (0, 1):
        for number in range(-_LINES, _LINES + 1):
            at = int(middle[axis]) + number
            ends = np.zeros((2, 3))
            ends[:, 2 * axis] = at * step
            ends[:, 2 - 2 * axis] = (middle[1 - axis] + np.array([-_LINES, _LINES])) * step
            cut = _before(camera, ends)
            if cut is not None:
                _stroke(canvas, camera, cut, picture, *_look(axis, at))
    canvas.pop_clip_rect()


def _look(axis: int, at: int) -> tuple[theme.Rgba, float]:
    """Colour and width of a line: the axes of the world have theirs."""
    if at == 0:
        r, g, b, _ = theme.AXIS_COLORS[2 if axis == 0 else 0]
        return (r, g, b, 0.7), 1.5
    return (0.75, 0.75, 0.75, 0.30 if at % _EVERY == 0 else 0.14), 1.0


def _before(camera: Camera, ends: npt.NDArray[np.float64]) -> npt.NDArray[np.float64] | None:
    """(2, 3) the part of a line that is before the camera; None: none of it is."""
    forward = camera.image_plane(1.0)[2]
    least = _NEAR * math.dist(camera.position, camera.target)
    depth = (ends - np.asarray(camera.position)) @ forward - least
    if (depth <= 0).all():
        return None
    if (depth > 0).all():
        return ends
    cut = ends[0] + (ends[1] - ends[0]) * depth[0] / (depth[0] - depth[1])
    return np.stack([ends[depth > 0][0], cut])


def _stroke(
    canvas: imgui.ImDrawList,
    camera: Camera,
    ends: npt.NDArray[np.float64],
    picture: Rect[float],
    color: theme.Rgba,
    width: float,
) -> None:
    seen, in_front = camera.project(ends, picture.width / picture.height)
    if in_front.all():
        # Far beyond the picture nothing is drawn, and its numbers would no longer be exact as floats.
        points = np.clip((picture.left, picture.top) + seen * picture.size, -1e6, 1e6)
        tint = imgui.get_color_u32(imgui.ImVec4(*color))
        canvas.add_line(tuple(points[0].tolist()), tuple(points[1].tolist()), tint, width)
