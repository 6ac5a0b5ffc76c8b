"""The shapes that other renderers make themselves, as meshes: in the axes of Mitsuba and pbrt, with the
texture coordinates of Mitsuba.

Where they trace the round ones exactly, these have as many segments as ours.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from incpt.scene.mesh import Mesh
from incpt.scene.shapes import CYLINDER_SEGMENTS, shape

Array = npt.NDArray[np.float64]
SPHERE_FROM_OURS = np.array([[0.0, 0, -2, 0], [-2, 0, 0, 0], [0, 2, 0, 0]])
"""(3, 4) from our sphere (radius 0.5, poles along y) to Mitsuba's (radius 1, along z) with its longitudes."""
_CUBE_CORNERS = ((1, 5, 4, 0), (3, 2, 6, 7), (1, 3, 7, 5), (5, 7, 6, 4), (4, 6, 2, 0), (3, 1, 0, 2))
"""Of its sides: bits for the signs of x, y and z."""


@cache
def rectangle() -> Mesh:
    """[-1, 1]² in the plane of x and y, facing +z; v grows along y."""
    corners = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return _flat(np.column_stack([corners, np.zeros(4)]), faces, (corners + 1)[faces] / 2)


@cache
def cube() -> Mesh:
    """[-1, 1]³, with the whole image on each side."""
    corners = np.array([[(i >> axis & 1) * 2.0 - 1 for axis in range(3)] for i in range(8)])
    uv = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
    order = [[0, 1, 2], [3, 0, 2]]
    faces = np.array([[side[i] for i in three] for side in _CUBE_CORNERS for three in order])
    return _flat(corners, faces, np.tile(uv[order], (6, 1, 1)))


@cache
def disk() -> Mesh:
    """Of radius 1 in the plane of x and y, facing +z; u is the radius, v the share of a turn."""
    n = CYLINDER_SEGMENTS
    angle = np.arange(n) * (2 * np.pi / n)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.stack([np.full(n, n), i, j], axis=1)
    turn = np.stack([(i + 0.5) / n, i / n, (i + 1) / n], axis=1)
    radius = np.broadcast_to([0.0, 1.0, 1.0], (n, 3))
    return _flat(np.concatenate([rim, np.zeros((1, 3))]), faces, np.stack([radius, turn], axis=2))


@cache
def cylinder() -> Mesh:
    """The wall of one with radius 1 from z = 0 to 1, without caps; u is the share of a turn, v is z."""
    n = CYLINDER_SEGMENTS
    angle = np.arange(n) * (2 * np.pi / n)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.stack([i, j, n + j], axis=1), np.stack([i, n + j, n + i], axis=1)])
    left, right, low, high = i / n, (i + 1) / n, np.zeros(n), np.ones(n)
    uvs = np.concatenate(
        [
            np.stack([np.stack([left, right, right], 1), np.stack([low, low, high], 1)], 2),
            np.stack([np.stack([left, right, left], 1), np.stack([low, high, high], 1)], 2),
        ]
    )
    vertices = np.concatenate([ring, ring + np.array([0.0, 0, 1])])
    return _mesh(vertices, faces, np.concatenate([ring, ring])[faces], uvs)


def sphere() -> Mesh:
    """Ours; `SPHERE_FROM_OURS` makes Mitsuba's of it."""
    return shape("sphere")


def _flat(vertices: Array, faces: npt.NDArray[np.int64], uvs: Array) -> Mesh:
    return _mesh(vertices, faces, None, uvs)


def _mesh(vertices: Array, faces: npt.NDArray[np.int64], normals: Array | None, uvs: Array) -> Mesh:
    return Mesh(
        vertices.astype(np.float32),
        faces.astype(np.int32),
        None if normals is None else normals.astype(np.float32),
        uvs=(uvs.astype(np.float32),),
    )
