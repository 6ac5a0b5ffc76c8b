"""Which bodies enclose a point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene

_FACES_AT_ONCE = 1 << 18


def transparent_bodies_around(scene: Scene, point: Vector) -> list[Object]:
    """The objects that are seen, let light through and enclose a point in world space. Those with the largest
    boxes come first: in that order a path would have entered bodies that lie inside each other."""
    around = [
        obj
        for obj in scene.objects
        if obj.visible
        and scene.material(obj.material).is_body
        and has_in_bounds(obj, point)
        and _encloses(obj, point)
    ]
    return sorted(around, key=lambda obj: -float(np.prod(np.ptp(obj.world_bounds, axis=0))))


def has_in_bounds(obj: Object, point: Vector) -> bool:
    """Whether a point lies in the box around an object."""
    least, greatest = obj.world_bounds
    return bool((least <= point).all() and (point <= greatest).all())


def _encloses(obj: Object, point: Vector) -> bool:
    local = affine.apply(affine.invert(obj.world_from_object), np.array([point], np.float64))[0]
    return abs(winding_number(obj.mesh, local)) > 0.5


def winding_number(mesh: Mesh, point: npt.NDArray[np.float64]) -> float:
    """How often a mesh winds around a point (3,) of its space: 1 inside of a closed body, 0 outside, between
    them where it is open. By the solid angles of its triangles (Van Oosterom and Strackee 1983)."""
    total = 0.0
    for first in range(0, len(mesh.faces), _FACES_AT_ONCE):
        faces = mesh.faces[first : first + _FACES_AT_ONCE]
        a, b, c = (mesh.vertices[faces].astype(np.float64) - point).transpose(1, 0, 2)
        la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        rest = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
        rest += lb * np.einsum("ij,ij->i", a, c) + la * np.einsum("ij,ij->i", b, c)
        total += float(np.arctan2(volume, rest).sum())
    return total / (2 * np.pi)
