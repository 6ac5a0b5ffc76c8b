"""From a move of the mouse to a move in the world: in the plane of the view, along an axis, in a plane.

All take the camera, the rectangle at which its picture lies (points), a point of the world that the mouse
holds (world space, metres), and how far the mouse went (points, y downwards).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from incpt.scene.camera import Camera
from incpt.ui.rect import Point, Rect

Array = npt.NDArray[np.float64]

_GRAZING = math.sin(math.radians(5.0))
"""Sine of the angle between an axis and the view, or a plane and the view, below which the mouse cannot point
along it. The angle is Blender's."""
_FARTHEST = 1000.0
"""How many times as far as at the point itself the mouse may move what is near the horizon."""


def held_point(camera: Camera, point: Array) -> Array:
    """A point before the camera to hold in place of `point`: itself, or where the camera looks if it lies
    behind."""
    _, _, forward = camera.image_plane(1.0)
    if (point - camera.position) @ forward > 1e-6:
        return point
    return np.asarray(camera.target, np.float64)


def place(camera: Camera, picture: Rect[float], point: Array) -> Point:
    """Where a point before the camera is on the screen, points."""
    found = camera.project(point[None], picture.width / picture.height)[0][0]
    return picture.left + float(found[0]) * picture.width, picture.top + float(found[1]) * picture.height


def in_view_plane(camera: Camera, picture: Rect[float], point: Array, by: Point) -> Array:
    """(3,) metres: in the plane through the point that faces the camera, so that it stays under the mouse."""
    right, up, forward = camera.image_plane(picture.width / picture.height)
    depth = 1.0 if camera.is_orthographic else float((point - camera.position) @ forward)
    move: Array = depth * (2 * by[0] / picture.width * right - 2 * by[1] / picture.height * up)
    return move


def along_axis(camera: Camera, picture: Rect[float], point: Array, axis: Array, by: Point) -> float:
    """Metres along an axis (one long) through the point: to where the mouse is nearest to it on the screen.
    Where the axis points to the viewer, up is along it."""
    right, up, forward = camera.image_plane(picture.width / picture.height)
    eye = forward if camera.is_orthographic else point - camera.position
    if np.linalg.norm(np.cross(eye / np.linalg.norm(eye), axis)) < _GRAZING:
        away = in_view_plane(camera, picture, point, (0.0, by[1]))
        return float(away @ up / np.linalg.norm(up))
    # A place on the screen is (x / w, y / w), and x, y and w are linear along the axis.
    planes = np.array([right / (right @ right), up / (up @ up), forward])
    x, y, w = planes @ (point - camera.position)
    dx, dy, dw = planes @ axis
    if camera.is_orthographic:
        w, dw = 1.0, 0.0
    tangent = np.array([dx * w - x * dw, y * dw - dy * w]) / w**2 * picture.size / 2
    points_per_metre = float(np.linalg.norm(tangent))
    wanted = float(np.dot(by, tangent)) / points_per_metre
    # The point at t metres is seen points_per_metre * t * w / (w + t * dw) from the start. Where the wanted
    # place is beyond the end of the axis, its horizon, no t leads there.
    slope = max(points_per_metre * w - wanted * dw, points_per_metre * w / _FARTHEST)
    return float(wanted * w / slope)


def in_plane(camera: Camera, picture: Rect[float], point: Array, normal: Array, by: Point) -> Array:
    """(3,) metres in a plane through the point with that normal (one long): to where the mouse points in it.
    Where the plane is seen from its edge or the mouse is above its horizon: the nearest in it to
    `in_view_plane`."""
    free = in_view_plane(camera, picture, point, by)
    x, y = place(camera, picture, point)
    at = picture.relative((x + by[0], y + by[1]))
    starts, ways = camera.rays(np.array([at]), picture.width / picture.height)
    start, way = starts[0], ways[0]
    slope = float(way @ normal)
    if abs(slope) >= _GRAZING * np.linalg.norm(way):
        distance = float((point - start) @ normal) / slope
        if distance > 0:
            move: Array = start + distance * way - point
            return move
    nearest: Array = free - (free @ normal) * normal
    return nearest
