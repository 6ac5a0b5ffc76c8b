"""Affine transforms and the camera's geometry. Matrices act on column vectors; world space is
right-handed with y up, in metres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = npt.NDArray[np.float64]


def rotation_matrix(rotation_deg: Sequence[float]) -> Array:
    """(3, 3) rotation about x, then y, then z: R = Rz · Ry · Rx. Angles in degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(rotation_deg)), np.sin(np.radians(rotation_deg))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    result: Array = about_z @ about_y @ about_x
    return result


def world_from_object(
    position: Sequence[float], rotation_deg: Sequence[float], scale: Sequence[float]
) -> Array:
    """(3, 4) affine matrix that scales, rotates and then moves."""
    matrix = np.empty((3, 4))
    matrix[:, :3] = rotation_matrix(rotation_deg) * np.asarray(scale, np.float64)
    matrix[:, 3] = position
    return matrix


def invert_affine(matrix: Array) -> Array:
    """Inverse of a (3, 4) affine matrix, (3, 4). Raises numpy.linalg.LinAlgError where it is singular."""
    linear = np.linalg.inv(matrix[:, :3])
    return np.column_stack([linear, -linear @ matrix[:, 3]])


def apply_affine(matrix: Array, points: npt.NDArray[np.floating]) -> Array:
    """(N, 3) points, moved by a (3, 4) affine matrix."""
    result: Array = points @ matrix[:, :3].T + matrix[:, 3]
    return result


def box_corners(bounds: npt.NDArray[np.floating]) -> Array:
    """(8, 3) corners of a box given as (2, 3): least and greatest coordinates."""
    choose = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)])
    corners: Array = np.asarray(bounds, np.float64)[choose, np.arange(3)]
    return corners


def camera_frame(
    position: Sequence[float],
    target: Sequence[float],
    up: Sequence[float],
    fov_y_deg: float,
    aspect: float,
) -> tuple[Array, Array, Array]:
    """(right, up, forward), each (3,): the image plane at unit distance, half its width and height long."""
    forward = _unit(np.subtract(target, position))
    right = np.cross(forward, _unit(np.asarray(up, np.float64)))
    if np.linalg.norm(right) < 1e-9:  # looking along `up`: any other axis gives a frame
        right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
    right = _unit(right)
    half_height = math.tan(math.radians(fov_y_deg) / 2)
    return right * half_height * aspect, np.cross(right, forward) * half_height, forward


def project(
    points: npt.NDArray[np.floating],
    position: Sequence[float],
    frame: tuple[Array, Array, Array],
    size: tuple[int, int],
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Pixel coordinates (N, 2) of (N, 3) world points, and which of them lie in front of the camera.

    `frame` comes from `camera_frame`, `size` is (width, height) in pixels; pixel (0, 0) spans [0, 1]^2
    at the top left. Coordinates of points behind the camera mean nothing.
    """
    right, up, forward = frame
    offset = np.asarray(points, np.float64) - np.asarray(position, np.float64)
    depth = offset @ forward
    in_front = depth > 1e-6
    depth = np.where(in_front, depth, 1.0)
    x = offset @ right / (right @ right) / depth
    y = offset @ up / (up @ up) / depth
    pixels = np.column_stack([(x + 1) / 2 * size[0], (1 - y) / 2 * size[1]])
    return pixels, in_front


def _unit(vector: Array) -> Array:
    result: Array = vector / np.linalg.norm(vector)
    return result
