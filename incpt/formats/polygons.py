"""Polygons of mesh files as triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mapbox_earcut
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

MOST_CORNERS = 1 << 16
"""Larger polygons become fans: cutting ears takes the square of their corners in the worst case."""


def triangulated(
    sizes: Indices, vertices: npt.NDArray[np.floating[Any]], corners: npt.NDArray[np.signedinteger[Any]]
) -> Indices:
    """(T, 3) the triangles of polygons as numbers of their corners, polygon by polygon. `sizes` (P,) are
    their corners; those with fewer than three have no triangle. `corners` (C,) are their places in `vertices`
    (V, 3), polygon after polygon; what is not finite is allowed.

    Convex polygons become fans around their first corner, concave ones have their ears cut off, so that no
    notch is filled. All triangles wind as their polygon does.
    """
    if (sizes == 3).all():
        return np.arange(3 * len(sizes)).reshape(-1, 3)
    first = np.cumsum(sizes) - sizes
    found, order = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[sizes >= 3]):
        (chosen,) = np.nonzero(sizes == size)
        starts = first[chosen]
        triangles = _fans(int(size))[None] + starts[:, None, None]
        if size > 3:
            outlines = vertices[corners[starts[:, None] + np.arange(size)]].astype(np.float64, copy=False)
            for place in np.flatnonzero(~_convex(outlines)):
                cut = _cut(outlines[place])
                if cut is not None:
                    triangles[place] = cut + starts[place]
        found.append(triangles.reshape(-1, 3))
        order.append(chosen.repeat(size - 2))
    return np.concatenate(found)[np.argsort(np.concatenate(order), kind="stable")]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Polygons of a file as triangles: `faces` (T, 3), the places of their corners in the vertices, -1 for
    all of a polygon that has one which is not there; `corners` (T, 3), their numbers among those of all
    polygons; `polygons` (T,), the number of the polygon of each; and how many polygons had fewer than three
    corners."""

    faces: Indices
    corners: Indices
    polygons: Indices
    too_small: int = 0


def triangles_of(sizes: Indices, vertices: npt.NDArray[np.floating[Any]], corners: Indices) -> Triangles:
    """The triangles of polygons with so many corners (P,) each, of which `corners` (C,) are the places in
    vertices (V, 3), whatever a damaged file has there."""
    is_there = (corners >= 0) & (corners < len(vertices))
    if not is_there.all():
        corners = np.where(is_there, corners, len(vertices))
        vertices = np.concatenate([vertices, np.full((1, 3), np.nan, vertices.dtype)])
    numbers = triangulated(sizes, vertices, corners)
    polygons = np.repeat(np.arange(len(sizes)), np.maximum(sizes - 2, 0))
    faces = corners[numbers]
    if not is_there.all():
        is_bad = np.zeros(len(sizes), bool)
        is_bad[np.repeat(np.arange(len(sizes)), sizes)[~is_there]] = True
        faces[is_bad[polygons]] = -1
    return Triangles(faces, numbers, polygons, int((sizes < 3).sum()))


def _fans(size: int) -> Indices:
    """(size - 2, 3)"""
    second = np.arange(1, size - 1)
    return np.column_stack([np.zeros_like(second), second, second + 1])


def _convex(corners: Array) -> npt.NDArray[np.bool_]:
    """(P,) whether polygons (P, size, 3) turn in one direction only, and once."""
    with np.errstate(all="ignore"):
        normals = _normals(corners)
        along = np.roll(corners, -1, axis=1) - corners
        turns = np.einsum("pci,pi->pc", np.cross(np.roll(along, 1, axis=1), along), normals)
        fans = _fans(corners.shape[1])
        a, b, c = (corners[:, fans[:, i]] for i in range(3))
        areas = np.einsum("pti,pi->pt", np.cross(b - a, c - a), normals)
        result: npt.NDArray[np.bool_] = (turns >= 0).all(axis=1) & (areas >= 0).all(axis=1)
    return result


def _normals(corners: Array) -> Array:
    """(P, 3) of polygons (P, size, 3), as long as twice their area: Newell's method (Sutherland, Sproull and
    Schumacker 1974)."""
    local = corners - corners[:, :1]
    return np.asarray(np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1))


def _cut(corners: Array) -> Indices | None:
    """(size - 2, 3) triangles of a polygon (size, 3) without its notches; None where that cannot be done."""
    if len(corners) > MOST_CORNERS or not np.isfinite(corners).all():
        return None
    normal = _normals(corners[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.ascontiguousarray(np.delete(corners - corners[0], axis, axis=1))
    cut = (
        mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
        .reshape(-1, 3)
        .astype(np.int64)
    )
    if len(cut) != len(corners) - 2:
        return None
    # The library gives any winding.
    a, b, c = (corners[cut[:, i]] for i in range(3))
    turned = np.cross(b - a, c - a) @ normal < 0
    cut[turned] = cut[turned][:, ::-1]
    return np.asarray(cut)
