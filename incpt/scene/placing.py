"""Moves, turns and scalings of one object or light, in world space.

They keep what they do not change to the bit: what is moved keeps its angles and its scale, what is turned its
scale, what is scaled its angles. Numbers out of the range of a scene are brought back into it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST
from incpt.scene.model import Placed
from incpt.scene.transform import SMALLEST_SCALE, Transform

Array = npt.NDArray[np.float64]
Numbers = Sequence[float] | Array
"""Three numbers."""

_SAME_ROTATION_DEG = 1e-4
"""Angles that differ by less are the same: a gizmo's matrices are float32."""
_RIGID = 1e-5
"""Factors of matrices that differ by less are the same for that reason: nothing was turned, or scaled."""
_OPPOSITE = 1e-9
"""The sine below which two directions are the same, or opposite."""
_DIGITS = 10
"""Decimals of angles and factors that mean something: what lies below is rounding."""


def moved(one: Placed, by: Numbers) -> Placed:
    """Moved by so many metres along the axes of the world."""
    position = within_range(np.add(one.position, by))
    return replace(one, transform=one.transform.with_parts(position=position))


def turned(one: Placed, axis: Numbers, degrees: float, pivot: Array) -> Placed:
    """Turned about an axis (world space, one long) through a point, right-handed."""
    return turned_by(one, turn_matrix(axis, degrees), pivot)


def turned_by(one: Placed, turn: Array, pivot: Array) -> Placed:
    """Turned by a (3, 3) rotation about a point."""
    if (turn == np.eye(3)).all():
        return one
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    result = transformed(one, matrix, pivot)
    if result.transform.matrix is not None:
        return result
    x, y, z = (round(angle, _DIGITS) for angle in result.rotation)
    return replace(result, transform=result.transform.with_parts(rotation=(x, y, z)))


def aimed(one: Placed, at: Numbers) -> Placed:
    """Turned as little as can be, so that its -z, along which lights shine, points to a place in world space;
    as it was where it stands there."""
    way = np.asarray(at, np.float64) - one.position
    length = float(np.linalg.norm(way))
    if length == 0:
        return one
    old, new = -affine.rotation_matrix(one.rotation)[:, 2], way / length
    axis = np.cross(old, new)
    sine = float(np.linalg.norm(axis))
    if sine < _OPPOSITE:
        # Any axis across does where it is turned round.
        axis = affine.rotation_matrix(one.rotation)[:, 0]
    degrees = math.degrees(math.atan2(sine, float(old @ new)))
    return turned(one, axis / np.linalg.norm(axis), degrees, np.asarray(one.position))


def scaled(one: Placed, axes: Array, factors: Numbers, pivot: Array) -> Placed:
    """Scaled by three factors along three axes (3, 3; columns, at right angles, one long) about a point.

    What stands by position, rotation and scale keeps its rotation: along each of its own axes it gets the
    factor by which that one changes its length, negative where it comes to point the other way. Shear is
    dropped, as in Blender. A placement by a matrix is scaled exactly, and stays as it was where that would
    flatten it.
    """
    if tuple(factors) == (1.0, 1.0, 1.0):
        return one
    linear = axes * np.asarray(factors, np.float64) @ axes.T
    if one.transform.matrix is not None:
        matrix = np.eye(4)
        matrix[:3, :3] = linear
        return transformed(one, matrix, pivot)
    own = affine.rotation_matrix(one.rotation)
    lengths = np.linalg.norm(linear @ own, axis=0)
    along = (own * (linear @ own)).sum(axis=0)
    own_factors = np.round(np.where(along < 0, -lengths, lengths), _DIGITS)
    position = within_range(pivot + linear @ (np.asarray(one.position) - pivot))
    scale = within_range(own_factors * one.scale, SMALLEST_SCALE)
    return replace(one, transform=one.transform.with_parts(position=position, scale=scale))


def transformed(one: Placed, matrix: Array, pivot: Array) -> Placed:
    """Under a (4, 4) affine matrix in world space about a point; see `edits.transform_objects`."""
    world, turn = one.transform.world_from_object, matrix[:3, :3]
    position = turn @ (world[:, 3] - pivot) + pivot + matrix[:3, 3]
    return _moved(one, np.column_stack([turn @ world[:, :3], position]), turn)


def turn_matrix(axis: Numbers, degrees: float) -> Array:
    """(3, 3) rotation about an axis that is one long, right-handed (Rodrigues' formula)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.radians(degrees)
    result: Array = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return result


def within_range(values: Numbers, smallest: float = 0.0) -> Vector:
    """Three numbers brought into the range that a scene allows; their sizes are at least `smallest`."""
    numbers = np.asarray(values, np.float64)
    sizes = np.clip(np.abs(numbers), smallest, LARGEST)
    return _vector(np.copysign(sizes, numbers))


def _moved(one: Placed, world: npt.NDArray[np.float64], turn: npt.NDArray[np.float64]) -> Placed:
    """An object or light under another matrix (3, 4), which `turn` (3, 3) made of its own."""
    world = np.column_stack([world[:, :3], within_range(world[:, 3])])
    if one.transform.matrix is None:
        transform = _without_shear(one.transform, world, turn)
    else:
        try:
            transform = one.transform.moved_to(world)
        except InputError:
            transform = one.transform
    return replace(one, transform=transform)


def _without_shear(
    old: Transform, world: npt.NDArray[np.float64], turn: npt.NDArray[np.float64]
) -> Transform:
    """Position, rotation and scale nearest to a matrix (3, 4), which `turn` (3, 3) made of the old one; the
    old ones themselves as far as they stay the same, and where the matrix flattens the object."""
    position = _vector(world[:, 3])
    if np.abs(turn - np.eye(3)).max() < _RIGID:
        return replace(old, position=position)
    try:
        _, rotation, scale = affine.decompose(world, old.rotation, old.scale)
    except np.linalg.LinAlgError:
        return old
    is_turned_only = np.abs(turn @ turn.T - np.eye(3)).max() < _RIGID and np.linalg.det(turn) > 0
    is_scaled_only = np.abs(np.subtract(rotation, old.rotation)).max() < _SAME_ROTATION_DEG
    return Transform(
        position,
        old.rotation if is_scaled_only else rotation,
        old.scale if is_turned_only else within_range(scale, SMALLEST_SCALE),
    )


def _vector(values: npt.NDArray[np.float64]) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
