"""How texture coordinates lie on a mesh: tangents at its corners, and gradients on its faces.

Normal maps are made for tangents that are computed in one way, and look wrong with others: that of MikkTSpace
(M. Mikkelsen, Simulation of Wrinkled Surfaces Revisited, 2008), which glTF asks for. Corners share a tangent
where they have the same position, normal and texture coordinates and their faces the same orientation in the
image: the mean of the directions of u of their faces, each along the surface at the corner and weighted by
the angle that the face has there. No library of it has wheels for the systems that incpt runs on.

Where texture coordinates tell no direction, tangents run along the parallels around the y axis, as grooves of
a lathe do: y x normal, which turns as the normal does, so that surfaces with smooth normals have no seams.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.scene.mesh import Mesh

Array = npt.NDArray[np.float64]

_LEAST = 1e-30
"""Lengths below it have no direction."""
_STEEPEST = 1e12
"""Of gradients, so that kernels can calculate with those of slivers."""
_POLE = 1e-3
"""Sines of the angle to the y axis below it have no parallel: beside it rounding would tell the direction."""


def corner_tangents(mesh: Mesh, uv_set: int = 0) -> npt.NDArray[np.float32]:
    """(F, 3, 4) unit tangents at the corners, perpendicular to the normals there, and the side on which v
    grows: 1 where that is normal x tangent, else -1. Object space.

    Along the parallel around the y axis where the mesh has no such texture coordinates, or where they do not
    tell a direction. The tangents that a mesh brings are taken as they are.
    """
    if mesh.tangents is not None:
        return mesh.tangents
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normals = _normals(mesh, corners)
    if uv_set >= len(mesh.uvs):
        return _joined(_parallels(normals), np.full(len(corners), 1.0))
    uvs = mesh.uvs[uv_set].astype(np.float64)
    directions, side, is_known = _directions(corners, uvs)
    along = _along(np.broadcast_to(directions[:, None], normals.shape), normals)
    weight = _angles(corners, normals) * is_known[:, None]
    group = _groups(corners, normals, uvs, side)
    sums = np.stack([np.bincount(group, (along[..., axis] * weight).ravel()) for axis in range(3)], axis=1)
    tangents = sums[group].reshape(normals.shape)
    length = np.linalg.norm(tangents, axis=2, keepdims=True)
    usable = length > _LEAST
    unit: Array = np.where(usable, tangents / np.where(usable, length, 1), _parallels(normals))
    return _joined(unit, side)


def uv_gradients(mesh: Mesh, uv_set: int = 0) -> npt.NDArray[np.float32]:
    """(F, 2, 3) the gradients of u and of v along each face, per metre, object space. 0 where the mesh has no
    such texture coordinates, and on faces without an area."""
    if uv_set >= len(mesh.uvs):
        return np.zeros((len(mesh.faces), 2, 3), np.float32)
    corners, uvs = mesh.vertices[mesh.faces].astype(np.float64), mesh.uvs[uv_set].astype(np.float64)
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(ab, ac)
    squared = np.sum(normal * normal, axis=1, keepdims=True)
    # Vectors along the face of which one grows along ab alone, and the other along ac.
    along = np.stack([np.cross(ac, normal), np.cross(normal, ab)], axis=1)
    along = along / np.where(squared > 0, squared, np.inf)[:, None]
    gradients: Array = np.einsum("fed,fec->fcd", along, uvs[:, 1:] - uvs[:, :1])
    bounded: npt.NDArray[np.float32] = np.clip(gradients, -_STEEPEST, _STEEPEST).astype(np.float32)
    return bounded


def _normals(mesh: Mesh, corners: Array) -> Array:
    """(F, 3, 3) unit normals at the corners."""
    if mesh.normals is not None:
        normals = mesh.normals.astype(np.float64)
    else:
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.broadcast_to(flat[:, None], corners.shape)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    return np.where(length > _LEAST, normals / np.maximum(length, _LEAST), [0.0, 0.0, 1.0])


def _directions(corners: Array, uvs: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """(F, 3) along which u grows on each face; (F,) the side on which v does, with (0, 0) at the top left;
    and (F,) whether the texture coordinates of the face tell it."""
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # With v upwards, as the method has it: normal x tangent is the way up in the image.
    first, second = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area = first[:, 0] * -second[:, 1] + first[:, 1] * second[:, 0]
    side = np.where(area < 0, -1.0, 1.0)
    direction = side[:, None] * (-second[:, 1:] * ab + first[:, 1:] * ac)
    return direction, side, (np.abs(area) > _LEAST) & (np.linalg.norm(direction, axis=1) > _LEAST)


def _along(directions: Array, normals: Array) -> Array:
    """Unit vectors of those (..., 3) in the planes that are perpendicular to normals; 0 where there is
    none."""
    flat = directions - normals * np.sum(directions * normals, axis=-1, keepdims=True)
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    return np.where(length > _LEAST, flat / np.maximum(length, _LEAST), 0.0)


def _angles(corners: Array, normals: Array) -> Array:
    """(F, 3) of each face at its corners, seen along their normals."""
    following = _along(np.roll(corners, -1, axis=1) - corners, normals)
    preceding = _along(np.roll(corners, 1, axis=1) - corners, normals)
    return np.asarray(np.arccos(np.clip(np.sum(following * preceding, axis=2), -1, 1)))


def _groups(corners: Array, normals: Array, uvs: Array, side: Array) -> npt.NDArray[np.int64]:
    """(3 F,) a number for each corner, the same for those that share a tangent."""
    sides = np.broadcast_to(side[:, None, None], (*corners.shape[:2], 1))
    # Rounded to what files have, so that equal numbers are equal to the bit; adding 0 makes -0 the same as 0.
    rows = np.concatenate([corners, normals, uvs, sides], axis=2).astype(np.float32).reshape(-1, 9) + 0
    whole = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.shape[1] * 4))).ravel()
    return np.unique(whole, return_inverse=True)[1].reshape(-1)


def _parallels(normals: Array) -> Array:
    """(F, 3, 3) unit tangents along the parallels around the y axis, for unit normals at corners, eastwards
    on a ball. At a pole that of the other corners of the face, so that faces around it are like their
    neighbours; x where all of them are poles."""
    east = np.cross([0.0, 1.0, 0.0], normals)
    east = np.where(np.linalg.norm(east, axis=2, keepdims=True) > _POLE, _along(east, normals), 0.0)
    for other in (east.sum(axis=1, keepdims=True), np.array([1.0, 0.0, 0.0])):
        is_known = east.any(axis=2, keepdims=True)
        east = np.where(is_known, east, _along(np.broadcast_to(other, normals.shape), normals))
    return east


def _joined(tangents: Array, side: Array) -> npt.NDArray[np.float32]:
    sides = np.broadcast_to(side[:, None, None], (*tangents.shape[:2], 1))
    joined: npt.NDArray[np.float32] = np.concatenate([tangents, sides], axis=2).astype(np.float32)
    return joined
