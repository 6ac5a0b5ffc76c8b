"""Where an object stands: position, rotation and scale, or any affine matrix.

What a person places has a position, three angles and three factors, which stay as they were typed. What comes
from elsewhere may be sheared, as a scaled group of turned things is, and then no such numbers describe it: it
keeps its matrix, and the numbers are the nearest ones, to be shown and edited.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.arrays import frozen
from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, checked_number, is_list, set_vector

Row = tuple[float, float, float, float]
Rows = tuple[Row, Row, Row]

SMALLEST_SCALE = 1e-6
"""Least factor along an axis, without its sign: a smaller one flattens the object."""
SMALLEST_VOLUME = 1e-5
"""Least volume that the three axes of a matrix span when each is one long. Below it the axes lie nearly in a
plane, and single precision cannot tell the matrix from one that has no inverse."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A placement as a value, which takes points of object space to world space, metres.

    Without a matrix: scaled by axis, then turned by `rotation` (degrees; about x, then y, then z:
    R = Rz · Ry · Rx), then moved to `position`.

    With a matrix, the three rows of an affine one, the matrix alone says where the object is. The other
    fields are then read off it, for whoever shows or edits numbers: the position exactly; the rotation
    nearest to the directions of the axes; the scale along the rotated axes (see `core.affine.decompose`).
    Of the angles and signs that describe the same matrix, those nearest to the `rotation` and the signs of
    the `scale` that stand beside it are taken, so that numbers do not jump while they are edited. A
    comparison of two placements by a matrix does not count them.

    Raises InputError: numbers that are not finite or out of range, and what flattens space.
    """

    position: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    matrix: Rows | None = None

    def __post_init__(self) -> None:
        for name in ("position", "rotation", "scale"):
            set_vector(self, name)
        if self.matrix is not None:
            rows = _checked_rows(self.matrix)
            parts = affine.decompose(np.array(rows), self.rotation, self.scale)
            for name, value in zip(("position", "rotation", "scale", "matrix"), (*parts, rows), strict=True):
                object.__setattr__(self, name, value)
        elif min(abs(s) for s in self.scale) < SMALLEST_SCALE:
            raise InputError(
                f"scale: {list(self.scale)} flattens the object; use at least {SMALLEST_SCALE:g}"
            )

    @classmethod
    def from_matrix(cls, matrix: npt.ArrayLike) -> Transform:
        """The placement by a (3, 4) or (4, 4) affine matrix, which is kept exactly. Raises InputError."""
        return cls(matrix=_checked_rows(matrix))

    @cached_property
    def world_from_object(self) -> npt.NDArray[np.float64]:
        """(3, 4) affine matrix, which cannot be written to."""
        if self.matrix is not None:
            return frozen(np.array(self.matrix))
        return frozen(affine.compose(self.position, self.rotation, self.scale))

    def with_parts(
        self,
        position: Vector | None = None,
        rotation: Vector | None = None,
        scale: Vector | None = None,
        matrix: npt.ArrayLike | None = None,
    ) -> Transform:
        """The placement with another position, rotation or scale, or by another matrix altogether.

        A placement by a matrix stays one, and keeps its shear: a rotation turns it from the old angles to the
        new ones about its position, a scale multiplies the axes of the object by new over old. Raises
        InputError.
        """
        given: dict[str, Any] = {
            name: value
            for name, value in (("position", position), ("rotation", rotation), ("scale", scale))
            if value is not None
        }
        if matrix is not None:
            if given:
                raise InputError(f"matrix: stands beside {' and '.join(given)}; give one or the other")
            return Transform.from_matrix(matrix)
        if not given:
            return self
        if self.matrix is None:
            return replace(self, **given)
        wanted = Transform(**given)
        world = self.world_from_object.copy()
        if position is not None:
            world[:, 3] = wanted.position
        if scale is not None:
            world[:, :3] *= np.divide(wanted.scale, self.scale)
        if rotation is not None:
            turn = affine.rotation_matrix(wanted.rotation) @ affine.rotation_matrix(self.rotation).T
            world[:, :3] = turn @ world[:, :3]
        return Transform(
            rotation=wanted.rotation if rotation is not None else self.rotation,
            scale=wanted.scale if scale is not None else self.scale,
            matrix=_checked_rows(world),
        )

    def moved_to(self, matrix: npt.NDArray[np.floating[Any]]) -> Transform:
        """The placement by a (3, 4) matrix, shown by the angles and signs nearest to those of this one.
        Raises InputError."""
        return Transform(rotation=self.rotation, scale=self.scale, matrix=_checked_rows(matrix))

    def __eq__(self, other: object) -> bool:
        return self._placement == other._placement if isinstance(other, Transform) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._placement)

    @property
    def _placement(self) -> tuple[object, ...]:
        return self.matrix or (self.position, self.rotation, self.scale, None)


IDENTITY = Transform()
"""At the origin, unturned, at the mesh's own size."""


def _checked_rows(matrix: Any) -> Rows:
    """The upper three rows of a (3, 4) or (4, 4) affine matrix. Raises InputError."""
    if not is_list(matrix) or not all(is_list(row) for row in matrix):
        raise InputError(f"matrix: {described(matrix)} is not a list of rows, each of four numbers")
    if len(matrix) not in (3, 4) or any(len(row) != 4 for row in matrix):
        raise InputError("matrix: an affine one has three or four rows of four numbers")
    rows = tuple(tuple(checked_number("matrix", v, -LARGEST, LARGEST) for v in row) for row in matrix)
    if rows[3:] not in ((), ((0.0, 0.0, 0.0, 1.0),)):
        raise InputError(f"matrix: its last row is {list(rows[3])}; that of an affine one is [0, 0, 0, 1]")
    linear = np.array(rows)[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    if lengths.min() < SMALLEST_SCALE or abs(np.linalg.det(linear / lengths)) < SMALLEST_VOLUME:
        raise InputError("matrix: flattens the object; it has no inverse, or hardly one")
    return rows[:3]  # type: ignore[return-value]
