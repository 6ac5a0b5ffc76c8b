"""The built-in shapes: vertices, faces, corner normals (object space, metres) and texture coordinates."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.scene.mesh import Mesh, MeshSource

Array = npt.NDArray[np.float64]
Shape = tuple[Array, npt.NDArray[np.int64], Array | None, Array]
"""Vertices, faces, corner normals if any, and texture coordinates (F, 3, 2)."""
SPHERE_SUBDIVISIONS = 5
"""20 * 4^5 = 20,480 triangles: the outline shows no corners at 1080 rows."""
CYLINDER_SEGMENTS = 128


def plane() -> Shape:
    """1 x 1 in the xz plane, facing +y."""
    vertices = np.array([[-0.5, 0, -0.5], [-0.5, 0, 0.5], [0.5, 0, 0.5], [0.5, 0, -0.5]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return vertices, faces, None, vertices[faces][..., [0, 2]] + 0.5


def cube() -> Shape:
    """[-0.5, 0.5]^3, flat faces."""
    vertices = np.array([[(i & 1) - 0.5, (i >> 1 & 1) - 0.5, (i >> 2 & 1) - 0.5] for i in range(8)])
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    return vertices, faces, None, _on_sides(vertices[faces])


def _on_sides(corners: Array) -> Array:
    """The whole image on each side of the unit cube, upright as seen from outside; on top and bottom with the
    image's upper edge to -z and to +z."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = np.where(np.abs(normal[:, 1:2]) > 0.5, [[0.0, 0.0, -1.0]] * normal[:, 1:2], [[0.0, 1.0, 0.0]])
    right = np.cross(up, normal)
    return np.stack(
        [np.einsum("fcd,fd->fc", corners, right) + 0.5, 0.5 - np.einsum("fcd,fd->fc", corners, up)], axis=2
    )


def sphere() -> Shape:
    """Radius 0.5: an icosahedron, subdivided."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array(
        [
            (-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0),
            (0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden),
            (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1),
        ]
    )  # fmt: skip
    faces = np.array(
        [
            (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
            (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
            (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1),
        ]
    )  # fmt: skip
    for _ in range(SPHERE_SUBDIVISIONS):
        vertices, faces = _subdivide(vertices, faces)
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return normals * 0.5, faces, normals[faces], _around(normals[faces])


def _around(directions: Array) -> Array:
    """Texture coordinates of unit vectors (F, 3, 3) at the corners of faces: as a map of the earth, whose
    middle looks to +z. Faces across the seam go beyond the edge of the image; corners at a pole have the
    longitude of the middle of their face."""
    u = 0.5 + np.arctan2(directions[..., 0], directions[..., 2]) / (2 * np.pi)
    pole = np.hypot(directions[..., 0], directions[..., 2]) < 1e-9
    least = np.where(pole, np.inf, u).min(axis=1, keepdims=True)
    u = np.where(u - least > 0.5, u - 1, u)
    others = np.where(pole, 0, u).sum(axis=1, keepdims=True) / (~pole).sum(axis=1, keepdims=True)
    v = np.arccos(np.clip(directions[..., 1], -1, 1)) / np.pi
    return np.stack([np.where(pole, others, u), v], axis=2)


def _subdivide(
    vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = inverse.reshape(3, -1) + len(vertices)
    a, b, c = faces.T
    middle = vertices[unique].mean(axis=1)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([vertices, middle]), np.concatenate([np.stack(p, axis=1) for p in parts])


def cylinder() -> Shape:
    """Radius 0.5, height 1, along y: a smooth wall, flat caps."""
    n = CYLINDER_SEGMENTS
    angle = np.arange(n) * (2 * np.pi / n)
    ring = np.column_stack([np.cos(angle), np.zeros(n), np.sin(angle)])
    low, high = ring * 0.5 - [0, 0.5, 0], ring * 0.5 + [0, 0.5, 0]
    vertices = np.concatenate([low, high, [[0, -0.5, 0], [0, 0.5, 0]]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    bottom, top = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    groups = [(i, n + i, n + j), (i, n + j, j), (bottom, i, j), (top, n + j, n + i)]
    faces = np.concatenate([np.stack(group, axis=1) for group in groups])
    up = np.broadcast_to([0.0, 1.0, 0.0], (n, 3, 3))
    normals = np.concatenate([ring[np.stack([i, i, j], 1)], ring[np.stack([i, j, j], 1)], -up, up])
    around = np.arange(n + 1) / n
    left, right = 1 - around[:-1], 1 - around[1:]  # the angle grows clockwise as seen from outside
    one, zero = np.ones(n), np.zeros(n)
    wall = [
        np.stack(
            [np.column_stack([left, one]), np.column_stack([left, zero]), np.column_stack([right, zero])], 1
        ),
        np.stack(
            [np.column_stack([left, one]), np.column_stack([right, zero]), np.column_stack([right, one])], 1
        ),
    ]
    caps = [
        vertices[faces[2 * n : 3 * n]][..., [0, 2]] * [1, -1] + 0.5,
        vertices[faces[3 * n :]][..., [0, 2]] + 0.5,
    ]
    return vertices, faces, normals, np.concatenate([*wall, *caps])


_GENERATORS = {"cube": cube, "sphere": sphere, "plane": plane, "cylinder": cylinder}
SHAPES = tuple(_GENERATORS)
"""Names of the built-in shapes."""


def shape(name: str) -> Mesh:
    """A built-in mesh: cube ([-0.5, 0.5]^3), sphere (radius 0.5), plane (1 x 1, facing +y), cylinder
    (radius 0.5, height 1, along y). Sphere and cylinder carry shading normals, all carry texture coordinates.
    It is the same mesh at every call. Raises InputError."""
    if not isinstance(name, str) or name not in SHAPES:
        raise InputError(f"shape {described(name)} is not known; choose one of {', '.join(SHAPES)}")
    return _made(name)


@cache
def _made(name: str) -> Mesh:
    vertices, faces, normals, uvs = _GENERATORS[name]()
    corner_normals = None if normals is None else normals.astype(np.float32)
    source = MeshSource(shape=name)
    return Mesh(
        vertices.astype(np.float32), faces.astype(np.int32), corner_normals, source, (uvs.astype(np.float32),)
    )
