"""Geometry under affine matrices: what a file places is baked into vertices where no object can stand so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.transform import IDENTITY, Transform

Array = npt.NDArray[np.floating[Any]]

_SAME = 1e-9
"""Matrices that differ by less of their largest number are the same placement."""


def cofactors(linear: Array) -> npt.NDArray[np.float64]:
    """(3, 3) the matrix that takes normals along under a (3, 3) one: det · inverse transpose, which exists
    for flat placements too."""
    x, y, z = np.asarray(linear, np.float64).T
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)


def transform_of(matrix: npt.NDArray[np.float64]) -> Transform | None:
    """The placement by a (4, 4) matrix; None where it flattens, or is so large that no object can have it."""
    if np.array_equal(matrix, np.eye(4)):
        return IDENTITY
    try:
        kept = Transform.from_matrix(matrix)
        plain = replace(kept, matrix=None)
    except (InputError, np.linalg.LinAlgError):
        return None
    difference = np.abs(plain.world_from_object - kept.world_from_object).max()
    return plain if difference <= _SAME * np.abs(matrix).max() else kept


def placed_arrays(
    vertices: Array, faces: npt.NDArray[np.int64], normals: Array | None, matrix: npt.NDArray[np.float64]
) -> tuple[Array, npt.NDArray[np.int64], Array | None]:
    """Vertices (V, 3), faces (F, 3) and normals (V, 3), of any length, under a (4, 4) matrix; faces are
    turned over where it mirrors. The arrays are not checked."""
    if np.array_equal(matrix, np.eye(4)) or vertices.ndim != 2 or vertices.shape[1] != 3:
        return vertices, faces, normals
    with np.errstate(all="ignore"):
        linear = matrix[:3, :3]
        mirrors = np.linalg.det(linear) < 0
        vertices = vertices @ linear.T + matrix[:3, 3]
        if normals is not None:
            normals = normals @ cofactors(linear).T * (-1 if mirrors else 1)
    return vertices, faces[:, ::-1] if mirrors else faces, normals


def placed_mesh(mesh: Mesh, matrix: npt.NDArray[np.float64], source: MeshSource) -> Mesh:
    """A mesh under a (3, 4) affine matrix that does not flatten it."""
    linear = matrix[:, :3]
    mirrors = np.linalg.det(linear) < 0
    normals, tangents = mesh.normals, mesh.tangents
    if normals is not None:
        normals = _unit(normals @ cofactors(linear).T * (-1 if mirrors else 1))
    if tangents is not None:
        along, side = _unit(tangents[..., :3] @ linear.T), tangents[..., 3:]
        tangents = np.concatenate([along, -side if mirrors else side], axis=-1).astype(np.float32)
    at_corners = (normals, *mesh.uvs, mesh.colors, tangents)
    turned = [None if one is None else one[:, ::-1] if mirrors else one for one in at_corners]
    normals, *uvs, colors, tangents = turned
    faces = mesh.faces[:, ::-1] if mirrors else mesh.faces
    vertices = (mesh.vertices @ linear.T + matrix[:, 3]).astype(np.float32)
    return Mesh(
        vertices, faces, normals, source, tuple(one for one in uvs if one is not None), colors, tangents
    )


def turned_over(mesh: Mesh) -> Mesh:
    """A mesh with its inside out, which is that of no file."""

    def turned(values: Any) -> Any:
        return None if values is None else values[:, ::-1]

    normals = None if mesh.normals is None else -turned(mesh.normals)
    uvs = tuple(turned(one) for one in mesh.uvs)
    colors, tangents = turned(mesh.colors), turned(mesh.tangents)
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], normals, MeshSource(), uvs, colors, tangents)


def _unit(vectors: Array) -> npt.NDArray[np.float32]:
    result: npt.NDArray[np.float32] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result.astype(np.float32)
