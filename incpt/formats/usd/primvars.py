"""Values over a mesh at the corners of its triangles: texture coordinates, colours and normals of any
interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats.polygons import Triangles

Array = npt.NDArray[np.floating[Any]]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class AtCorners:
    """Values (N, width), and which of them each corner of each triangle has, (T, 3)."""

    values: Array
    at: Indices


def at_corners(values: Array, indices: Indices | None, interpolation: str, triangles: Triangles) -> AtCorners:
    """Values (N, width) of an interpolation at the corners of triangles; `indices` choose among them, where
    there are any. Raises InputError, where they are too few."""
    places = _places(interpolation, triangles)
    if indices is not None:
        _check("indices", places, len(indices), interpolation)
        places = indices[places]
    _check("values", places, len(values), interpolation)
    return AtCorners(values, places)


def _places(interpolation: str, triangles: Triangles) -> Indices:
    if interpolation == "faceVarying":
        return triangles.corners
    if interpolation in ("vertex", "varying"):
        # Corners that are not there belong to faces that are left out.
        return np.maximum(triangles.faces, 0)
    if interpolation == "uniform":
        return np.repeat(triangles.polygons[:, None], 3, axis=1)
    if interpolation == "constant":
        return np.zeros_like(triangles.faces)
    raise InputError(f"the interpolation {interpolation[:40]!r} is none")


def _check(what: str, places: Indices, count: int, interpolation: str) -> None:
    if places.size and not 0 <= places.min() <= places.max() < count:
        raise InputError(f"{count} {what} of {interpolation} interpolation do not fit the mesh")


def of_primvar(primvar: Any, width: int, moment: Any, triangles: Triangles) -> AtCorners:
    """What a primvar has at corners. Raises InputError, where it does not fit the mesh."""
    values = primvar_values(primvar, width, moment)
    indices = np.asarray(primvar.GetIndices(moment), np.int64) if primvar.IsIndexed() else None
    return at_corners(values, indices, str(primvar.GetInterpolation()), triangles)


def primvar_values(primvar: Any, width: int, moment: Any) -> Array:
    """(N, width) the values of a primvar, without what its indices say. Raises InputError, where it has no
    numbers or other widths."""
    found = primvar.Get(moment)
    values = np.asarray([] if found is None else found)
    if values.dtype.kind not in "fiu" or values.size == 0 or values.size % width:
        raise InputError(f"have no values of {width} numbers")
    if values.ndim > 1 and values.shape[-1] != width:
        raise InputError(f"have {values.shape[-1]} numbers each, not {width}")
    return values.reshape(-1, width).astype(np.float32, copy=False)


def joined(sets: list[AtCorners]) -> tuple[tuple[Array, ...], Indices | None]:
    """The values of several, and where the corners of triangles have all of them."""
    if not sets:
        return (), None
    if all(one.at is sets[0].at for one in sets):
        return tuple(one.values for one in sets), sets[0].at
    spread = tuple(one.values[one.at].reshape(-1, one.values.shape[1]) for one in sets)
    return spread, np.arange(sets[0].at.size).reshape(-1, 3)
