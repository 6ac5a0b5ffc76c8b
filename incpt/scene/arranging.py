"""Objects and lights put into line with one another, and onto what is below them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene import edits, placing, ray_cast
from incpt.scene.model import Object, Placed, Scene

Array = npt.NDArray[np.float64]

ENDS = {"least": 0.0, "middle": 0.5, "greatest": 1.0}
"""The ends of an extent by which things are aligned, and where they are in it."""
_FLOOR_Y = 0.0
"""Where what has nothing below it comes to stand, metres."""
_ROUNDING = 1e-6
"""The move that is no more than the rounding of vertices, as a share of how far from the origin it is."""
_INSIDE = 0.25
"""How deep something may be in what it is put onto, as a share of its own height."""


def extent(one: Placed) -> Array:
    """(2, 3) the bounds of an object's own vertices, or of a light, in world space, metres."""
    if not isinstance(one, Object):
        return one.world_bounds
    used = one.mesh.vertices[np.unique(one.mesh.faces)].astype(np.float64)
    places = affine.apply(one.world_from_object, used)
    return np.stack([places.min(axis=0), places.max(axis=0)])


def aligned(scene: Scene, names: Iterable[str], to: str, axis: int, end: str) -> Scene:
    """The scene with the named ones moved along an axis (0 to 2), until the least, middle or greatest place
    of each there, `end`, is that of the one called `to`. Raises InputError for unknown names."""

    def place(one: Placed) -> float:
        low, high = extent(one)[:, axis]
        return float(low + ENDS[end] * (high - low))

    wanted = place(scene.placed(to))
    changed: dict[str, Placed] = {}
    for name in names:
        one = scene.placed(name)
        changed[name] = _moved(one, axis, wanted - place(one))
    return edits.with_all(scene, changed)


def dropped(scene: Scene, names: Iterable[str]) -> Scene:
    """The scene with each of the named ones moved down, or up, until it stands on what is below its middle:
    on another object that is not among them, or on the floor y = 0. What it is in up to a quarter of its
    height counts as below it. Raises InputError for unknown names."""
    chosen = dict.fromkeys(names)
    others = [one for one in scene.objects if one.name not in chosen]
    changed: dict[str, Placed] = {}
    for name in chosen:
        one = scene.placed(name)
        low, high = extent(one)
        start = (low + high) / 2
        start[1] = low[1] + _INSIDE * (high[1] - low[1]) + 1e-6 * max(abs(low[1]), 1.0)
        hit = ray_cast.cast(others, start, np.array([0.0, -1.0, 0.0]))
        ground = _FLOOR_Y if hit is None else float(hit.place[1])
        changed[name] = _moved(one, 1, ground - float(low[1]))
    return edits.with_all(scene, changed)


def _moved(one: Placed, axis: int, by: float) -> Placed:
    """Moved along an axis; itself where that is no more than rounding."""
    if abs(by) <= _ROUNDING * max(abs(one.position[axis]), 1.0):
        return one
    way = np.zeros(3)
    way[axis] = by
    return placing.moved(one, way)
