"""Affine matrices: making them of position, rotation and scale, taking them apart, applying them.

A matrix is (3, 4), float64, and acts on column vectors. World space is right-handed with y up, in metres.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

GIMBAL_LOCK = 1e-6
"""Cosine of the angle about y below which the other two cannot be told apart (float32 matrices)."""


def rotation_matrix(rotation_deg: Sequence[float]) -> Array:
    """(3, 3) rotation about x, then y, then z: R = Rz · Ry · Rx. Angles in degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(rotation_deg)), np.sin(np.radians(rotation_deg))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    result: Array = about_z @ about_y @ about_x
    return result


def compose(position: Sequence[float], rotation_deg: Sequence[float], scale: Sequence[float]) -> Array:
    """(3, 4) affine matrix that scales by axis, then rotates (see `rotation_matrix`), then moves."""
    matrix = np.empty((3, 4))
    matrix[:, :3] = rotation_matrix(rotation_deg) * np.asarray(scale, np.float64)
    matrix[:, 3] = position
    return matrix


def decompose(
    matrix: Array,
    near_rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
    sign_of_scale: Sequence[float] = (1.0, 1.0, 1.0),
) -> tuple[Vector, Vector, Vector]:
    """(position, rotation in degrees, scale) of which `compose` makes a (3, 4) affine matrix.

    Shear is dropped: the rotation is the orthogonal factor of the polar decomposition of the axes at unit
    length (the rotation nearest to their directions, however long they are), the scale is the length of each
    axis along its own rotated one. Of the angles that give this rotation, also whole turns apart, those
    nearest to `near_rotation_deg` are taken, so that fields do not jump. The scale has the signs of
    `sign_of_scale`; where the matrix mirrors and they do not, or the other way round, one of them is turned.
    Raises numpy.linalg.LinAlgError where the matrix is singular or not finite.
    """
    linear = np.asarray(matrix[:, :3], np.float64)
    lengths = np.linalg.norm(linear, axis=0)
    if not np.isfinite(matrix).all() or not lengths.min() > 0:
        raise np.linalg.LinAlgError("the matrix flattens space, or holds numbers that are not finite")
    axes = linear / lengths
    determinant = np.linalg.det(axes)
    if abs(determinant) < 1e-9:
        raise np.linalg.LinAlgError("the matrix flattens space")
    signs = np.where(np.asarray(sign_of_scale) < 0, -1.0, 1.0)
    flips = np.ones((1, 3)) if determinant * signs.prod() > 0 else 1 - 2 * np.eye(3)
    near = np.asarray(near_rotation_deg, np.float64)
    best: tuple[float, Array, Array] | None = None
    for chosen in flips * signs:
        u, _, vt = np.linalg.svd(axes * chosen)
        rotation = u @ vt
        angles = _euler_angles(rotation, near)
        distance = float(np.abs(angles - near).sum())
        if best is None or distance < best[0]:
            best = distance, angles, (rotation * linear).sum(axis=0)
    assert best is not None
    return _vector(matrix[:, 3]), _vector(best[1]), _vector(best[2])


def _euler_angles(rotation: Array, near_deg: Array) -> Array:
    """(3,) angles about x, then y, then z, degrees, that give a (3, 3) rotation, nearest to `near_deg`."""
    sin_y, cos_y = -rotation[2, 0], math.hypot(rotation[2, 1], rotation[2, 2])
    if cos_y < GIMBAL_LOCK:
        # Only x - z (at y = 90°) or x + z is determined, so both change by half of what is missing.
        z = math.degrees(_y_and_z(rotation, math.radians(near_deg[0]))[1])
        missing = (z - near_deg[2] + 180) % 360 - 180
        choices = [math.radians(near_deg[0] - math.copysign(0.5, sin_y) * missing)]
    else:
        x = math.atan2(rotation[2, 1], rotation[2, 2])
        choices = [x, x + math.pi]
    candidates = np.degrees([(x, *_y_and_z(rotation, x)) for x in choices])
    candidates += 360 * np.round((near_deg - candidates) / 360)
    result: Array = candidates[np.argmin(((candidates - near_deg) ** 2).sum(axis=1))]
    return result


def _y_and_z(rotation: Array, x: float) -> tuple[float, float]:
    """The other two angles of a rotation whose angle about x is known, radians; well defined everywhere."""
    without_x = rotation @ rotation_matrix((math.degrees(x), 0.0, 0.0)).T
    y = math.atan2(-without_x[2, 0], without_x[2, 2])
    return y, math.atan2(-without_x[0, 1], without_x[1, 1])


def invert(matrix: Array) -> Array:
    """Inverse of a (3, 4) affine matrix, (3, 4). Raises numpy.linalg.LinAlgError where it is singular."""
    linear = np.linalg.inv(matrix[:, :3])
    return np.column_stack([linear, -linear @ matrix[:, 3]])


def apply(matrix: Array, points: npt.NDArray[np.floating]) -> Array:
    """(N, 3) points, moved by a (3, 4) affine matrix."""
    result: Array = points @ matrix[:, :3].T + matrix[:, 3]
    return result


def box_corners(bounds: npt.NDArray[np.floating]) -> Array:
    """(8, 3) corners of a box given as (2, 3): least and greatest coordinates."""
    choose = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)])
    corners: Array = np.asarray(bounds, np.float64)[choose, np.arange(3)]
    return corners


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
