"""Where something that is moved snaps to: surfaces and vertices of what stays where it is."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene import arranging, ray_cast
from incpt.scene.model import Object, Scene
from incpt.ui.rect import Point, Rect

Array = npt.NDArray[np.float64]

REACH = 20.0
"""How near to a vertex the mouse has to be, in points."""


def target(
    scene: Scene, names: Collection[str], picture: Rect[float], mouse: Point, kind: str
) -> Array | None:
    """(3,) the place in world space that the mouse points at: on a surface, or a vertex, as `kind` says, of
    the objects that are shown and not among `names`; None where there is none. The picture lies at `picture`,
    and the mouse is at `mouse`, in points."""
    others = [one for one in scene.objects if one.visible and one.name not in names]
    if kind == "vertex":
        return _nearest_vertex(scene, others, picture, mouse, REACH)
    at = np.array([picture.relative(mouse)])
    starts, ways = scene.camera.rays(at, picture.width / picture.height)
    hit = ray_cast.cast(others, starts[0], ways[0])
    return None if hit is None else hit.place


def base(
    scene: Scene, names: Collection[str], picture: Rect[float], mouse: Point, kind: str, pivot: Array
) -> Array:
    """(3,) the place of what is moved that comes to the target: for surfaces the middle of its lower side, so
    that it stands on them; for vertices that one of its own which is nearest to the mouse where the move
    began, or the pivot of what has none."""
    if kind == "vertex":
        own = [scene.object(name) for name in names if name in scene.object_index]
        found = _nearest_vertex(scene, own, picture, mouse, np.inf)
        return pivot if found is None else found
    extents = np.stack([arranging.extent(scene.placed(name)) for name in names])
    low, high = extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])


def _nearest_vertex(
    scene: Scene, objects: Iterable[Object], picture: Rect[float], mouse: Point, reach: float
) -> Array | None:
    nearest: Array | None = None
    for one in objects:
        places = affine.apply(one.world_from_object, one.mesh.vertices.astype(np.float64))
        seen, in_front = scene.camera.project(places, picture.width / picture.height)
        points = (picture.left, picture.top) + seen * picture.size
        away = np.where(in_front, np.linalg.norm(points - mouse, axis=1), np.inf)
        index = int(np.argmin(away))
        if away[index] < reach:
            nearest, reach = places[index], float(away[index])
    return nearest
