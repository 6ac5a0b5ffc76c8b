"""The camera of a scene, and where it sees points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.arrays import numbers
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, checked_number, set_number, set_vector

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. Positions in world space, metres; `fov_y` is the full vertical angle, degrees."""

    position: Vector = (0.0, 1.2, 5.0)
    target: Vector = (0.0, 1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: float = 40.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            set_vector(self, name)
        set_number(self, "fov_y", 0.01, 179.0)
        if math.dist(self.position, self.target) < 1e-9:
            raise InputError("target: is the same point as position; move one of them")
        if math.hypot(*self.up) < 1e-9:
            raise InputError("up: has no length; use [0, 1, 0]")

    def image_plane(self, aspect: float) -> tuple[Array, Array, Array]:
        """(right, up, forward), each (3,), world space: the image plane lies one forward from the position,
        and reaches one right and one up from its middle. `aspect` is the picture's width by its height."""
        aspect = checked_number("aspect", aspect, 1 / LARGEST, LARGEST)
        forward = _unit(np.subtract(self.target, self.position))
        right = np.cross(forward, _unit(np.asarray(self.up, np.float64)))
        if np.linalg.norm(right) < 1e-9:  # The view is along `up`, and any other axis gives a frame.
            right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
        right = _unit(right)
        half_height = math.tan(math.radians(self.fov_y) / 2)
        return right * half_height * aspect, np.cross(right, forward) * half_height, forward

    def project(self, points: npt.NDArray[np.floating], aspect: float) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Where (N, 3) world points are in a picture of that aspect, and which lie in front of the camera.

        Places (N, 2) are fractions of the picture's width and height from its top left. Those of points
        behind the camera mean nothing.
        """
        right, up, forward = self.image_plane(aspect)
        points = numbers("points", points, np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points: have shape {points.shape}; use (N, 3)")
        offset = points - np.asarray(self.position, np.float64)
        depth = offset @ forward
        in_front = depth > 1e-6
        depth = np.where(in_front, depth, 1.0)
        x = offset @ right / (right @ right) / depth
        y = offset @ up / (up @ up) / depth
        return np.column_stack([(x + 1) / 2, (1 - y) / 2]), in_front


def _unit(vector: Array) -> Array:
    result: Array = vector / np.linalg.norm(vector)
    return result
