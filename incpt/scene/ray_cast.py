"""What a single ray meets, found on the host: for edits that ask where a surface is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene.model import Object

Array = npt.NDArray[np.float64]

_FLAT = 1e-12
"""The determinant below which a ray lies in the plane of a triangle."""


@dataclass(frozen=True, eq=False)
class Hit:
    """The nearest surface: the object, the `place` (3,) in world space, the unit `normal` (3,) of the face on
    the side that the ray comes from, and how far away it is, in lengths of the ray's direction."""

    name: str
    place: Array
    normal: Array
    distance: float


def cast(objects: Iterable[Object], origin: Array, direction: Array) -> Hit | None:
    """What a ray from `origin` (3,) along `direction` (3,), world space, meets first of the objects that are
    shown. Their faces have no holes here, whatever their materials say."""
    nearest: Hit | None = None
    for one in objects:
        if one.visible and _may_meet(one.world_bounds, origin, direction):
            found = _met(one, origin, direction)
            if found is not None and (nearest is None or found.distance < nearest.distance):
                nearest = found
    return nearest


def _may_meet(bounds: Array, origin: Array, direction: Array) -> bool:
    """Whether a ray meets a box (2, 3): the slab test, with a little to spare for rounding."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ends = (bounds + np.array([[-1e-9], [1e-9]]) * (1 + np.abs(bounds)) - origin) / direction
    low, high = np.fmin(ends[0], ends[1]), np.fmax(ends[0], ends[1])
    return bool(np.fmax.reduce(low) <= np.fmin.reduce(high) and np.fmin.reduce(high) >= 0)


def _met(one: Object, origin: Array, direction: Array) -> Hit | None:
    """Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997), in object space, where
    distances along the ray are the same."""
    inverse = affine.invert(one.world_from_object)
    start, way = affine.apply(inverse, origin[None])[0], inverse[:, :3] @ direction
    a, b, c = (one.mesh.vertices[one.mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    ab, ac = b - a, c - a
    across = np.cross(way, ac)
    determinant = (ab * across).sum(axis=1)
    scale = np.abs(determinant).max(initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        from_a = start - a
        u = (from_a * across).sum(axis=1) / determinant
        over = np.cross(from_a, ab)
        v = (over @ way) / determinant
        distance = (ac * over).sum(axis=1) / determinant
        is_inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    is_met = (np.abs(determinant) > _FLAT * scale) & is_inside & (distance >= 0)
    if not is_met.any():
        return None
    face = int(np.argmin(np.where(is_met, distance, np.inf)))
    normal = inverse[:, :3].T @ np.cross(ab[face], ac[face])
    normal = normal / np.linalg.norm(normal) * (-1.0 if normal @ direction > 0 else 1.0)
    way_there = float(distance[face])
    return Hit(one.name, origin + way_there * direction, normal, way_there)
