"""Cameras that look along -z of a matrix, as those of glTF and USD do."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.formats import import_report

Array = npt.NDArray[np.float64]


def placement(matrix: Array, bounds: npt.NDArray[np.floating]) -> dict[str, Any]:
    """The keywords `position`, `target` and `up` of a Camera under a matrix (4, 4) that does not flatten.
    `bounds` (2, 3) of what stands in the scene tell how far away the point is that it looks at."""
    back, up = (matrix[:3, axis] / np.linalg.norm(matrix[:3, axis]) for axis in (2, 1))
    position = matrix[:3, 3]
    distance = viewing_distance(position, -back, bounds)
    return {
        "position": _vector(position), "target": _vector(position - distance * back), "up": _vector(up),
    }  # fmt: skip


def viewing_distance(position: Array, forward: Array, bounds: npt.NDArray[np.floating]) -> float:
    """From a position along a unit direction to the middle of what there is to see, so that a view turns
    about it."""
    size = float(np.linalg.norm(bounds[1] - bounds[0]))
    distance = float((bounds.mean(axis=0) - position) @ forward)
    return distance if distance > 1e-3 * size else max(size / 2, 1e-3)


def tell_of_far_plane(far: float, matrix: Array, bounds: npt.NDArray[np.floating], name: str) -> None:
    """What stands behind the far plane of a camera is seen here."""
    depth = -(affine.box_corners(bounds) - matrix[:3, 3]) @ matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    if far < math.inf and depth.max() > far:
        import_report.left_out(f"the far plane of camera {name!r}: what is behind it is seen")


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
