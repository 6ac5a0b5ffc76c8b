"""Moves of the camera as functions from a Camera to another one.

The camera turns like a turntable: about its `up` through the target, and up and down, but never over a pole.
Coordinates of the cursor are pixels from the top left of the picture, `size` is the picture's (width,
height), on any screen: nothing depends on how many pixels are rendered. A move that would leave the numbers
a scene allows is not made: the camera comes back unchanged.

What an orthographic camera shows does not depend on its distance: to go nearer is to show less of the scene.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.scene.camera import Camera

Array = npt.NDArray[np.float64]

MAX_ELEVATION_DEG = 89.9
"""The highest elevation. Above it the horizon's direction would be lost in rounding, and the view would flip
over the pole."""
ORBIT_DEG = 180.0
"""How far the camera turns about its target by a drag over the whole height of the picture."""
LOOK_DEG = 90.0
"""How far the camera turns in place by a drag over the whole height of the picture."""
WHEEL_FACTOR = 0.85
"""One notch of the wheel towards the target multiplies the distance by this."""
DOLLY_FACTOR = 8.0
"""A drag over the whole height of the picture divides or multiplies the distance by this."""
FRAME_MARGIN = 1.1
"""The size of the picture over that of what is framed in it."""
FRAME_CLEARANCE = 0.1
"""Least distance from the nearest corner of what is framed, in diagonals of its box."""
NEAREST = 1e-3
"""Least distance to the target, metres, and relative to its coordinates 1e-6: what float32 can tell apart."""

VIEWS: dict[str, Vector] = {
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
"""Where the camera stands, seen from the target: y up, and z towards whoever looks from the front."""


def orbit(camera: Camera, dx: float, dy: float, height: float) -> Camera:
    """Turned about the target as if the scene were dragged by (dx, dy) pixels: to the right turns it to
    the right, down shows more of its top."""
    degrees = ORBIT_DEG / height
    back, distance = _back(camera)
    turned = _turned(camera, back, -dx * degrees, dy * degrees)
    return _with(camera, np.asarray(camera.target) + turned * distance, camera.target)


def look(camera: Camera, dx: float, dy: float, height: float) -> Camera:
    """Turned in place: to the right looks to the right, down looks down."""
    degrees = LOOK_DEG / height
    back, distance = _back(camera)
    turned = _turned(camera, back, -dx * degrees, dy * degrees)
    return _with(camera, camera.position, np.asarray(camera.position) - turned * distance)


def pan(camera: Camera, dx: float, dy: float, size: tuple[float, float]) -> Camera:
    """Moved sideways so that what lies at the target's distance follows the cursor by (dx, dy) pixels."""
    right, up, _ = camera.image_plane(size[0] / size[1])
    distance = 1.0 if camera.is_orthographic else _distance(camera)
    return _moved(camera, 2 * distance * (dy / size[1] * up - dx / size[0] * right))


def zoom(camera: Camera, factor: float, cursor: tuple[float, float], size: tuple[float, float]) -> Camera:
    """At `factor` times the distance to the target, with the point under the cursor at the target's
    distance staying under the cursor. The distance has a least value and does not fall below it. An
    orthographic camera shows `factor` times as much instead."""
    if camera.is_orthographic:
        return _zoomed_flat(camera, factor, cursor, size)
    distance = _distance(camera)
    nearest = max(NEAREST, 1e-6 * max(map(abs, camera.target)))
    new_distance = max(distance * factor, min(nearest, distance))
    _, ray = _ray(camera, cursor, size)
    position = np.asarray(camera.position) + ray * (distance - new_distance)
    return _with(camera, position, position + camera.image_plane(1.0)[2] * new_distance)


def _zoomed_flat(
    camera: Camera, factor: float, cursor: tuple[float, float], size: tuple[float, float]
) -> Camera:
    height = max(camera.ortho_height * factor, min(NEAREST, camera.ortho_height))
    start, _ = _ray(camera, cursor, size)
    move = (1 - height / camera.ortho_height) * (start - np.asarray(camera.position))
    try:
        camera = replace(camera, ortho_height=height)
    except InputError:
        return camera
    return _moved(camera, move)


def wheel(camera: Camera, notches: float, cursor: tuple[float, float], size: tuple[float, float]) -> Camera:
    """Zoomed towards the cursor by turns of the wheel; positive is nearer."""
    return zoom(camera, _power(WHEEL_FACTOR, notches), cursor, size)


def dolly(camera: Camera, dx: float, dy: float, height: float) -> Camera:
    """Nearer to the target by a drag up or to the right, farther by one down or to the left."""
    return zoom(camera, _power(DOLLY_FACTOR, (dy - dx) / height), (0.5, 0.5), (1.0, 1.0))


def fly(camera: Camera, forward: float, right: float, up: float, seconds: float, speed: float) -> Camera:
    """Moved as a free camera: `forward` and `right` along the view, `up` along the camera's up, each from
    -1 to 1, at `speed` metres per second; diagonals are not faster."""
    right_axis, _, forward_axis = camera.image_plane(1.0)
    direction = forward * forward_axis + right * _unit(right_axis) + up * _up(camera)
    length = float(np.linalg.norm(direction))
    return _moved(camera, direction / max(length, 1.0) * (seconds * speed))


def frame(camera: Camera, bounds: npt.ArrayLike, aspect: float) -> Camera:
    """Looking at the middle of a box in the same direction, as near as shows all of it in a picture of
    that aspect (width by height), with a tenth of margin. `bounds` is (2, 3), world space, metres."""
    box = np.asarray(bounds, np.float64)
    middle = box.mean(axis=0)
    if np.ptp(box, axis=0).max() < NEAREST:  # The box is a point, which any distance shows.
        box = np.stack([middle - NEAREST / 2, middle + NEAREST / 2])
    right, up, forward = camera.image_plane(aspect)
    offset = affine.box_corners(box) - middle
    x, y, depth = offset @ right / (right @ right), offset @ up / (up @ up), offset @ forward
    shift_x, shift_y = camera.shift_at(aspect)
    shift = shift_x * right + shift_y * up
    # Without a clearance, a plate or a rod seen along itself would be looked at from its very edge.
    clearance = FRAME_CLEARANCE * float(np.linalg.norm(box[1] - box[0]))
    if camera.is_orthographic:
        scale = FRAME_MARGIN * float(np.maximum(np.abs(x), np.abs(y)).max())
        scale = max(scale, clearance / camera.ortho_height)
        distance = max(float((clearance - depth).max()) + camera.near, _distance(camera))
        try:
            camera = replace(camera, ortho_height=camera.ortho_height * scale)
        except InputError:
            return camera
        position = middle - forward * distance - scale * shift
    else:
        # The middle of a shifted picture sees what lies ahead of it and aside.
        beside = np.maximum(np.abs(x - shift_x * depth), np.abs(y - shift_y * depth))
        distance = float((np.maximum(FRAME_MARGIN * beside, clearance + camera.near) - depth).max())
        position = middle - (forward + shift) * distance
    return _with(camera, position, position + forward * distance)


def set_view(camera: Camera, side: str) -> Camera:
    """Looking at the same target from the same distance along an axis, with +y up; `side` is one of VIEWS.

    Top and bottom are seen from 0.1 degrees beside the pole, so that right is +x as seen from the front.
    """
    back = np.asarray(VIEWS[side])
    if back[1] != 0:
        tilt = math.radians(MAX_ELEVATION_DEG)
        back = np.array([0.0, math.copysign(math.sin(tilt), back[1]), math.cos(tilt)])
    position = np.asarray(camera.target) + back * _distance(camera)
    return _with(camera, position, camera.target, up=(0.0, 1.0, 0.0))


def cropped(camera: Camera, size: tuple[int, int], box: tuple[int, int, int, int]) -> Camera:
    """The camera whose picture is a part of that of `camera`, which has `size` (width, height) pixels: those
    of `box` (left, top, right, bottom). Lens and perspective stay. Raises InputError for a part without
    pixels, and for one that is so small or so far aside that no shift reaches it."""
    (width, height), (left, top, right, bottom) = size, box
    if not (left < right and top < bottom):
        raise InputError(f"box: {box} has no pixels; use left, top, right, bottom")
    aspect, part_aspect = width / height, (right - left) / (bottom - top)
    share = (bottom - top) / height
    shift_x, shift_y = camera.shift_at(aspect)
    x = (shift_x + (left + right) / width - 1) * width / (right - left)
    y = (shift_y + 1 - (top + bottom) / height) / share
    larger = max(part_aspect, 1.0)
    aside = replace(camera, shift_x=x * part_aspect / (2 * larger), shift_y=y / (2 * larger))
    if camera.is_orthographic:
        return replace(aside, ortho_height=camera.ortho_height * share)
    # Less of the same sensor behind the same lens.
    length = camera.focal_length_at(aspect)
    sensor = 2 * length * math.tan(math.radians(camera.fov_y_at(aspect)) / 2)
    return replace(aside, focal_length=length, sensor_fit="vertical", sensor_height=sensor * share)


def point_under(camera: Camera, cursor: tuple[float, float], size: tuple[float, float]) -> Vector:
    """The world point under the cursor at the target's distance, on the plane that faces the camera."""
    start, ray = _ray(camera, cursor, size)
    return _vector(start + ray * _distance(camera))


def _ray(camera: Camera, cursor: tuple[float, float], size: tuple[float, float]) -> tuple[Array, Array]:
    """Start and direction of the ray through a pixel, 1 long along the view."""
    starts, directions = camera.rays(np.array([cursor]) / np.array(size), size[0] / size[1])
    return starts[0], directions[0]


def _distance(camera: Camera) -> float:
    return math.dist(camera.position, camera.target)


def _back(camera: Camera) -> tuple[Array, float]:
    """The unit direction from target to camera, and their distance."""
    offset = np.subtract(camera.position, camera.target)
    distance = float(np.linalg.norm(offset))
    return offset / distance, distance


def _up(camera: Camera) -> Array:
    return _unit(np.asarray(camera.up, np.float64))


def _turned(camera: Camera, back: Array, azimuth_deg: float, elevation_deg: float) -> Array:
    """A unit direction turned about the camera's up, right-handed, and away from the horizon."""
    up = _up(camera)
    # The picture's right is level whatever the elevation, and defined where the view is along `up`.
    side = _unit(camera.image_plane(1.0)[0])
    level = np.cross(side, up)
    old = math.degrees(math.atan2(float(back @ up), float(back @ level)))
    elevation = min(max(old + elevation_deg, -MAX_ELEVATION_DEG), MAX_ELEVATION_DEG)
    azimuth, tilt = math.radians(azimuth_deg), math.radians(elevation)
    around = level * math.cos(azimuth) + np.cross(up, level) * math.sin(azimuth)
    turned: Array = around * math.cos(tilt) + up * math.sin(tilt)
    return turned


def _moved(camera: Camera, move: Array) -> Camera:
    return _with(camera, np.add(camera.position, move), np.add(camera.target, move))


def _with(
    camera: Camera,
    position: Sequence[float] | Array,
    target: Sequence[float] | Array,
    up: Vector | None = None,
) -> Camera:
    """The camera at another place, or unchanged where a scene does not allow that."""
    try:
        return replace(camera, position=_vector(position), target=_vector(target), up=up or camera.up)
    except InputError:
        return camera


def _power(base: float, exponent: float) -> float:
    return float(base ** min(max(exponent, -100.0), 100.0))


def _unit(vector: Array) -> Array:
    unit: Array = vector / np.linalg.norm(vector)
    return unit


def _vector(values: Sequence[float] | Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
