"""Bad faces of mesh files: leaves them out, counts them, and makes a mesh of the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import handed_over
from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.vertex_attributes import NO_ATTRIBUTES, VertexAttributes
from incpt.formats.welding import mixed, row_hashes
from incpt.scene.checks import LARGEST
from incpt.scene.mesh import Mesh

_PIECE = 1 << 17
"""Faces that are looked at together."""
DEGENERATE = 1e-12
"""Twice the area of a face over its longest edge squared: below it the face has no normal to speak of."""


def usable_mesh(
    vertices: npt.NDArray[np.floating[Any]],
    faces: npt.NDArray[np.int64],
    normals: npt.NDArray[np.floating[Any]] | None,
    counts: dict[str, int],
    attributes: VertexAttributes = NO_ATTRIBUTES,
    normal_at: npt.NDArray[np.int64] | None = None,
    uv_at: npt.NDArray[np.int64] | None = None,
    color_at: npt.NDArray[np.int64] | None = None,
) -> Mesh | None:
    """A mesh of the faces that can be rendered, or None if there is none.

    `vertices` (V, 3), `faces` (F, 3) and `normals` (V, 3) at the vertices, of any length, or None for flat
    faces, and `attributes` may hold whatever a damaged file does. `counts` gets, by the words of a message,
    how many faces were left out, and under "in all" how many there were. `normal_at`, `uv_at` and `color_at`
    (F, 3) are the places of corners in normals, texture coordinates and colours where they are others than
    those of their vertices. Raises InputError: arrays of other shapes.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError("has vertices without three coordinates; the file is damaged")
    with np.errstate(all="ignore"):
        stored = vertices.astype(np.float32)
    usable = _usable_faces(stored, faces, counts)
    if not usable.any():
        return None
    finite = np.all(np.abs(stored) <= LARGEST, axis=1)
    # No face uses these vertices any more, but a mesh holds finite ones only.
    stored = np.where(finite[:, None], stored, np.float32(0))
    if not usable.all():
        faces = faces[usable]
        normal_at = None if normal_at is None else normal_at[usable]
        uv_at = None if uv_at is None else uv_at[usable]
        color_at = None if color_at is None else color_at[usable]
    corner_normals = None
    if normals is not None:
        places = faces if normal_at is None else normal_at
        corner_normals = handed_over(_corner_normals(stored, faces, normals, places))
    at_corners = attributes.at_corners(faces, uv_at, color_at)
    return Mesh(handed_over(stored), handed_over(faces.astype(np.int32)), corner_normals, **at_corners)


def tell_of_faces(counts: dict[str, int]) -> None:
    """Tells of the faces that `usable_mesh` has left out. Raises InputError where that are all."""
    total = counts.get("in all", 0)
    reasons = {reason: count for reason, count in counts.items() if count and reason != "in all"}
    lost, listed = sum(reasons.values()), ", ".join(f"{count} {reason}" for reason, count in reasons.items())
    if lost == total:
        raise InputError(f"has no usable face ({listed or 'no faces in the file'})")
    if lost:
        import_report.left_out(f"{lost} of {total} faces: {listed}")


def _usable_faces(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64], counts: dict[str, int]
) -> npt.NDArray[np.bool_]:
    """(F,) which faces of vertices (V, 3) to keep; the reasons against the others are counted."""
    usable: npt.NDArray[np.bool_] = np.all((faces >= 0) & (faces < len(vertices)), axis=1)
    in_range = faces if usable.all() else np.where(usable[:, None], faces, 0)
    _count(counts, "in all", len(faces))
    _count(counts, "with an index out of range", int((~usable).sum()))
    if not len(vertices):
        return usable
    # This comparison is false for NaN too.
    finite = np.all(np.abs(vertices) <= LARGEST, axis=1)
    bad = usable & ~finite[in_range].all(axis=1)
    _count(counts, "with a vertex that is not finite or too far away", int(bad.sum()))
    usable &= ~bad
    bad = usable & ~_has_area(vertices, in_range)
    _count(counts, "with zero area", int(bad.sum()))
    usable &= ~bad
    bad = usable & _repeated(vertices, in_range, usable)
    _count(counts, "that come twice", int(bad.sum()))
    return usable & ~bad


def _count(counts: dict[str, int], reason: str, number: int) -> None:
    counts[reason] = counts.get(reason, 0) + number


def _has_area(vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """(F,)"""
    found: npt.NDArray[np.bool_] = np.empty(len(faces), bool)
    # In pieces, because the numbers in between are several times as large as the mesh.
    for first in range(0, len(faces), _PIECE):
        piece = faces[first : first + _PIECE]
        with np.errstate(all="ignore"):
            a, b, c = (vertices[piece[:, corner]].astype(np.float64) for corner in range(3))
            ab, ac, bc = b - a, c - a, c - b
            longest = np.maximum(np.maximum((ab**2).sum(axis=1), (ac**2).sum(axis=1)), (bc**2).sum(axis=1))
            area = np.linalg.norm(np.cross(ab, ac), axis=1)
            found[first : first + _PIECE] = area > DEGENERATE * longest
    return found


def _repeated(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64], usable: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """(F,) which usable faces have the corner positions and the winding of an earlier one.

    By position, not by index: formats without shared vertices repeat them too. Equal faces have equal
    hashes, so that only the few that share theirs with another are compared.
    """
    hashes = _hashes(vertices, faces)
    ordered = np.sort(hashes[usable])
    shared = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    result: npt.NDArray[np.bool_] = np.zeros(len(faces), bool)
    if len(shared):
        (places,) = np.nonzero(usable & np.isin(hashes, shared))
        result[places] = _again(vertices[faces[places]])
    return result


def _hashes(vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64]) -> npt.NDArray[np.uint64]:
    """(F,) the same for faces with the same positions in the same order, wherever it begins."""
    of_vertices = row_hashes(vertices)
    found = np.empty(len(faces), np.uint64)
    for first in range(0, len(faces), _PIECE):
        corners = of_vertices[faces[first : first + _PIECE]]
        edges = mixed(corners + np.uint64(3) * np.roll(corners, 1, axis=1))
        found[first : first + _PIECE] = edges.sum(axis=1)
    return found


def _again(corners: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """(F,) which of (F, 3, 3) corners of faces, in their order, come earlier already."""
    rows = np.ascontiguousarray(corners + np.float32(0)).view(np.dtype((np.void, 12)))
    place = np.unique(rows, return_inverse=True)[1].reshape(-1, 3)
    # With the least corner first, equal faces are equal rows.
    turn = (place.argmin(axis=1)[:, None] + np.arange(3)) % 3
    place = np.take_along_axis(place, turn, axis=1)
    # The sort is stable, so the first of equal faces comes first.
    order = np.lexsort(place.T)
    again: npt.NDArray[np.bool_] = np.zeros(len(place), bool)
    again[order[1:]] = np.all(place[order[1:]] == place[order[:-1]], axis=1)
    return again


def _corner_normals(
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int64],
    normals: npt.NDArray[np.floating[Any]],
    places: npt.NDArray[np.int64],
) -> npt.NDArray[np.float32]:
    """(F, 3, 3) unit normals of (N, 3) normals at the places (F, 3) of corners; a face's own where one has no
    direction."""
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(normals.astype(np.float64), axis=1, keepdims=True)
        unit = (normals / lengths).astype(np.float32)
    is_direction = np.isfinite(unit).all(axis=1) & (lengths[:, 0] > 1e-12)
    corners = np.take(unit, places, axis=0)
    if is_direction.all():
        return corners
    usable = is_direction[places]
    if not usable.all():
        a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
        flat = np.cross(b - a, c - a)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        corners = np.where(usable[..., None], corners, flat[:, None, :])
    result: npt.NDArray[np.float32] = corners.astype(np.float32)
    return result
