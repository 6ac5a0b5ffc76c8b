"""Where rectangles and the world land in the framebuffer."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene.camera import Camera
from incpt.scene.model import Object
from incpt.ui.rect import Rect

_NEAR = 1e-4
"""The distance from the camera below which nothing is outlined, in metres."""
_FAR = 1e5
"""That of an orthographic camera beyond which nothing is outlined, in metres: single precision tells a
centimetre from nothing there."""


def whole_pixels(rect_px: Rect[float], *bounds_px: Rect[float]) -> Rect[int] | None:
    """The whole pixels that a rectangle touches inside of others; None where there are none."""
    if not (rect_px.width > 0 and rect_px.height > 0 and all(map(math.isfinite, rect_px))):
        return None
    left, top = math.floor(rect_px.left), math.floor(rect_px.top)
    right, bottom = math.ceil(rect_px.right), math.ceil(rect_px.bottom)
    for bound in bounds_px:
        left, top = max(left, round(bound.left)), max(top, round(bound.top))
        right, bottom = min(right, round(bound.right)), min(bottom, round(bound.bottom))
    return Rect(left, top, right - left, bottom - top) if left < right and top < bottom else None


def split_x(rect: Rect[float], position: float) -> float:
    """The x of the bar of a split view, in the unit of `rect`, where the picture lies."""
    return rect.left + rect.width * position


def viewport_of(part: Rect[int], framebuffer_height: int) -> tuple[int, int, int, int]:
    """x, y, width and height of the same rectangle counted from the bottom left, as OpenGL does."""
    return part.left, framebuffer_height - part.bottom, part.width, part.height


def clip_from_world(
    camera: Camera, aspect: float, rect_px: Rect[float], part: Rect[int]
) -> npt.NDArray[np.float64]:
    """(4, 4) matrix that projects world space as the path tracer does, for an image that lies at `rect_px`
    and a viewport that covers `part` of it. Depth only clips what lies behind the camera."""
    right, up, forward = camera.image_plane(aspect)
    rows = np.stack([right / (right @ right), up / (up @ up), forward])
    view = np.column_stack([rows, -rows @ np.asarray(camera.position, np.float64)])
    across, down, depth = view
    one = np.array([0.0, 0.0, 0.0, 1.0])
    nearest = max(_NEAR, camera.near)
    # What x and y are divided by.
    divisor = one if camera.is_orthographic else depth
    shift_x, shift_y = camera.shift_at(aspect)
    across, down = across - shift_x * divisor, down - shift_y * divisor
    x, y, width, height = rect_px
    part_x, part_y, part_width, part_height = part
    # The image spans -1 to 1 of its own along each axis. This scales it and moves it to where the viewport
    # sees it.
    scale_x, scale_y = width / part_width, height / part_height
    move_x = (2 * (x - part_x) + width) / part_width - 1
    move_y = 1 - (2 * (y - part_y) + height) / part_height
    # Depth is clipped at -1 and 1 times the divisor.
    span = 2 / (_FAR - nearest)
    near = span * (depth - nearest * one) - one if camera.is_orthographic else depth - 2 * nearest * one
    return np.stack([scale_x * across + move_x * divisor, scale_y * down + move_y * divisor, near, divisor])


def covered(
    objects: Sequence[Object],
    camera: Camera,
    aspect: float,
    rect_px: Rect[float],
    part: Rect[int],
    margin: int,
) -> Rect[int] | None:
    """The pixels of `part` that objects may cover, with a margin; None where there are none."""
    corners = np.concatenate([affine.box_corners(o.world_bounds) for o in objects])
    pixels, in_front = camera.project(corners, aspect)
    if not in_front.all():
        # A box that reaches behind the camera covers more than the rectangle around its projected corners.
        return part
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    # Pixels beyond this are never drawn, and their numbers would no longer be exact as floats.
    low, high = np.clip([low, high], -1e6, 1e6)
    size = np.array([rect_px.width, rect_px.height])
    x, y = (rect_px.left, rect_px.top) + low * size - margin
    width, height = (high - low) * size + 2 * margin
    return whole_pixels(Rect(float(x), float(y), float(width), float(height)), part)
