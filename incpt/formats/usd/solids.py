"""Shapes that USD knows by their sizes, as meshes: spheres, cubes, cylinders, cones, capsules and planes."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from incpt.core.checks import one_of
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST
from incpt.scene.mesh import Mesh
from incpt.scene.shapes import CYLINDER_SEGMENTS, shape

Matrix = npt.NDArray[np.float64]
Solid = tuple[Mesh, Matrix]
"""A mesh, and what takes it to the space of the prim, (4, 4)."""
_ARCS = 32
"""Of a hemisphere, from its rim to its pole."""
_TO_AXIS = {
    "X": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "Y": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "Z": np.eye(3),
}
"""What turns z to the axis of a prim."""
_Z_FROM_Y = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""What turns our shapes along y to z."""


def solid_of(prim: Any, moment: Any) -> Solid:
    """The mesh of a prim that `is_solid`. Raises InputError, where it has no size."""
    return _SOLIDS[str(prim.GetTypeName())](prim, moment)


def is_solid(prim: Any) -> bool:
    """Whether a prim is a plain shape."""
    return str(prim.GetTypeName()) in _SOLIDS


def _sphere(prim: Any, moment: Any) -> Solid:
    (radius,) = _sizes(moment, UsdGeom.Sphere(prim).GetRadiusAttr())
    return shape("sphere"), _placed(np.eye(3), 2 * radius, 2 * radius, 2 * radius)


def _cube(prim: Any, moment: Any) -> Solid:
    (size,) = _sizes(moment, UsdGeom.Cube(prim).GetSizeAttr())
    return shape("cube"), _placed(np.eye(3), size, size, size)


def _plane(prim: Any, moment: Any) -> Solid:
    plane = UsdGeom.Plane(prim)
    width, length = _sizes(moment, plane.GetWidthAttr(), plane.GetLengthAttr())
    # By the schema the width lies along x, but along z where the axis is x; the length along y, but along z
    # where the axis is y.
    turn = {"Z": _Z_FROM_Y, "Y": np.eye(3), "X": np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])}
    return shape("plane"), _placed(turn[_axis(plane, moment)], width, 1.0, length)


def _cylinder(prim: Any, moment: Any) -> Solid:
    solid = UsdGeom.Cylinder(prim)
    radius, height = _sizes(moment, solid.GetRadiusAttr(), solid.GetHeightAttr())
    turn = _TO_AXIS[_axis(solid, moment)] @ _Z_FROM_Y
    return shape("cylinder"), _placed(turn, 2 * radius, height, 2 * radius)


def _frustum(prim: Any, moment: Any) -> Solid:
    solid = UsdGeom.Cylinder_1(prim)
    radii = solid.GetRadiusBottomAttr(), solid.GetRadiusTopAttr()
    return _revolved_along(solid, moment, _frustum_mesh(*_sizes(moment, *radii, solid.GetHeightAttr())))


def _cone(prim: Any, moment: Any) -> Solid:
    solid = UsdGeom.Cone(prim)
    radius, height = _sizes(moment, solid.GetRadiusAttr(), solid.GetHeightAttr())
    return _revolved_along(solid, moment, _frustum_mesh(radius, 0.0, height))


def _capsule(prim: Any, moment: Any) -> Solid:
    solid = UsdGeom.Capsule(prim)
    radius, height = _sizes(moment, solid.GetRadiusAttr(), solid.GetHeightAttr())
    return _revolved_along(solid, moment, _capsule_mesh(radius, radius, height))


def _tapered_capsule(prim: Any, moment: Any) -> Solid:
    solid = UsdGeom.Capsule_1(prim)
    radii = solid.GetRadiusBottomAttr(), solid.GetRadiusTopAttr()
    return _revolved_along(solid, moment, _capsule_mesh(*_sizes(moment, *radii, solid.GetHeightAttr())))


_SOLIDS: dict[str, Callable[[Any, Any], Solid]] = {
    "Sphere": _sphere,
    "Cube": _cube,
    "Plane": _plane,
    "Cylinder": _cylinder,
    "Cylinder_1": _frustum,
    "Cone": _cone,
    "Capsule": _capsule,
    "Capsule_1": _tapered_capsule,
}


def _placed(turn: Matrix, x: float, y: float, z: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3] = turn * [x, y, z]
    return matrix


def _revolved_along(solid: Any, moment: Any, mesh: Mesh) -> Solid:
    return mesh, _placed(_TO_AXIS[_axis(solid, moment)], 1.0, 1.0, 1.0)


def _axis(solid: Any, moment: Any) -> str:
    axis = str(solid.GetAxisAttr().Get(moment))
    one_of("axis", axis, tuple(_TO_AXIS))
    return axis


def _sizes(moment: Any, *attributes: Any) -> tuple[float, ...]:
    """The numbers of attributes, of which one radius of two may be 0. Raises InputError."""
    found = tuple(float(one.Get(moment)) for one in attributes)
    if not (all(0 <= size <= LARGEST for size in found) and found[-1] > 0 and any(found[:-1] or found)):
        raise InputError("has no size")
    return found


@lru_cache(maxsize=64)
def _frustum_mesh(bottom: float, top: float, height: float) -> Mesh:
    """Along z, from -height / 2 to height / 2, with flat caps."""
    half, slope = height / 2, (height, bottom - top)
    outline = [((0.0, -half), (bottom, -half), (0.0, -1.0), (0.0, -1.0)),
               ((bottom, -half), (top, half), slope, slope),
               ((top, half), (0.0, half), (0.0, 1.0), (0.0, 1.0))]  # fmt: skip
    return _revolved(outline)


@lru_cache(maxsize=64)
def _capsule_mesh(bottom: float, top: float, height: float) -> Mesh:
    """Along z, with hemispheres at both ends."""
    half, sine = height / 2, np.sin(np.linspace(0, np.pi / 2, _ARCS + 1)).tolist()
    # Backwards it is the cosine, and exactly 0 at the pole.
    low = [((bottom * s, -half - bottom * c), (s, -c)) for s, c in zip(sine, sine[::-1], strict=True)]
    high = [((top * c, half + top * s), (c, s)) for s, c in zip(sine, sine[::-1], strict=True)]
    return _revolved([(p, q, n, m) for (p, n), (q, m) in pairwise([*low, *high])])


_Point = tuple[float, float]


def _revolved(outline: list[tuple[_Point, _Point, _Point, _Point]]) -> Mesh:
    """Pieces of an outline in the plane of x and z, from below upwards, turned about z: for each its two ends
    and the normals there. u is the share of a turn, v goes down from the upper end to the lower one."""
    n = CYLINDER_SEGMENTS
    angle = np.arange(n + 1) * (2 * np.pi / n)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    lengths = np.array([np.hypot(q[0] - p[0], q[1] - p[1]) for p, q, _, _ in outline])
    up = np.concatenate([[0.0], np.cumsum(lengths)]) / max(float(lengths.sum()), 1e-300)
    vertices, faces, normals, uvs = [], [], [], []
    i, count = np.arange(n), 0
    for number, (p, q, first, second) in enumerate(outline):
        ends = [np.column_stack([around * x, np.full(n + 1, z)]) for x, z in (p, q)]
        turned = [_unit(np.column_stack([around * x, np.full(n + 1, z)])) for x, z in (first, second)]
        places = [np.column_stack([angle / (2 * np.pi), np.full(n + 1, 1 - up[number + k])]) for k in (0, 1)]
        low, high = count + i, count + n + 1 + i
        # A piece that ends on the axis has one triangle for each segment there.
        triangles = ([np.stack([low, low + 1, high + 1], 1)] if p[0] > 0 else []) + (
            [np.stack([low, high + 1, high], 1)] if q[0] > 0 else []
        )
        vertices.append(np.concatenate(ends))
        normals.append(np.concatenate(turned))
        uvs.append(np.concatenate(places))
        faces += triangles
        count += 2 * (n + 1)
    chosen = np.concatenate(faces)
    return Mesh(
        np.concatenate(vertices).astype(np.float32),
        chosen.astype(np.int32),
        np.concatenate(normals)[chosen].astype(np.float32),
        uvs=(np.concatenate(uvs)[chosen].astype(np.float32),),
    )


def _unit(vectors: Matrix) -> Matrix:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1))
