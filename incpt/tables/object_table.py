"""What kernels know of each object: its transform, its material, and where its mesh is.

An edit of one object among thousands describes that one alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import compress, count
from operator import is_not
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import affine, layout
from incpt.scene.contacts import separated
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.tables.geometry_pool import GeometryPool, PooledMesh

_MOST_FACES_OF_ONE = 512
_MOST_FACES_OF_ALL = 4096
"""Of one object, and of all together, that stand in the top level in world space."""
_HIDDEN = np.iinfo(np.int64).max
"""The size of an object that is not seen."""


@dataclass(frozen=True, eq=False)
class ObjectTable:
    """The objects of a scene, N of them.

    rows            (N,) layout.OBJECT
    bounds          (N, 2, 3) of each in world space
    sizes           (N,) faces of those that are seen, else _HIDDEN
    world_vertices  (V, 3) in world space, by number, of the objects whose triangles are part of the top
                    level, smallest first
    materials       names of the scene's materials in order, to whose numbers rows refer
    packings        state of the pool in which the meshes are where rows say
    """

    objects: tuple[Object, ...]
    rows: npt.NDArray[np.void]
    bounds: npt.NDArray[np.float64]
    sizes: npt.NDArray[np.int64]
    world_vertices: dict[int, npt.NDArray[np.float32]]
    materials: tuple[str, ...]
    packings: int

    @property
    def others(self) -> npt.NDArray[np.int64]:
        """Numbers of the objects whose triangles are not part of the top level."""
        return _all_but(len(self.objects), list(self.world_vertices))

    def follow(self, scene: Scene, meshes: Mapping[Mesh, PooledMesh], packings: int) -> ObjectTable:
        """The table of another scene. Objects that are the same are not described again."""
        objects = separated(scene)
        source = self._source(objects)
        known = np.flatnonzero(source >= 0)
        sizes = np.empty(len(objects), np.int64)
        sizes[known] = self.sizes[source[known]]
        for i in np.flatnonzero(source < 0):
            sizes[i] = len(objects[i].mesh.faces) if objects[i].visible else _HIDDEN
        chosen = _objects_in_world_space(sizes)
        vertices = {
            i: self.world_vertices[source[i]]
            if source[i] in self.world_vertices
            else _world_vertices(objects[i])
            for i in chosen
        }
        is_chosen, was_chosen = np.zeros(len(objects), np.bool_), np.zeros(len(self.objects), np.bool_)
        is_chosen[chosen] = True
        was_chosen[list(self.world_vertices)] = True
        same = known[was_chosen[source[known]] == is_chosen[known]]
        rows, bounds = np.zeros(len(objects), layout.OBJECT), np.zeros((len(objects), 2, 3))
        rows[same], bounds[same] = self.rows[source[same]], self.bounds[source[same]]
        changed = _all_but(len(objects), same)
        for i in changed.tolist():
            _describe(objects[i], rows[i])
            bounds[i] = objects[i].world_bounds
        table = ObjectTable(objects, rows, bounds, sizes, vertices, tuple(scene.materials), packings)
        everything = slice(None)
        table._refer_to_materials(changed if self.materials == table.materials else everything)
        table._refer_to_meshes(meshes, changed if self.packings == packings else everything)
        return table

    def with_packings(self, meshes: Mapping[Mesh, PooledMesh], packings: int) -> ObjectTable:
        """The same table after meshes have moved to other places in the pool."""
        table = replace(self, rows=self.rows.copy(), packings=packings)
        table._refer_to_meshes(meshes, slice(None))
        return table

    def _refer_to_materials(self, chosen: npt.NDArray[np.int64] | slice) -> None:
        number = {name: i for i, name in enumerate(self.materials)}
        self.rows["material"][chosen] = [number[obj.material] for obj in self._chosen(chosen)]

    def _refer_to_meshes(
        self, meshes: Mapping[Mesh, PooledMesh], chosen: npt.NDArray[np.int64] | slice
    ) -> None:
        places = np.array([meshes[obj.mesh].place for obj in self._chosen(chosen)], np.uint32).reshape(-1, 4)
        columns = ("first_node", "first_pack", "first_normal", "is_smooth")
        for name, column in zip(columns, places.T, strict=True):
            self.rows[name][chosen] = column

    def _chosen(self, chosen: npt.NDArray[np.int64] | slice) -> tuple[Object, ...]:
        if isinstance(chosen, slice):
            return self.objects
        return tuple(self.objects[i] for i in chosen.tolist())

    def _source(self, objects: tuple[Object, ...]) -> npt.NDArray[np.int64]:
        """(N,) where each object stood, -1 for those that are new."""
        if len(objects) == len(self.objects):
            changed = list(compress(count(), map(is_not, objects, self.objects)))
            if len(changed) <= 1:  # as in every drag
                source = np.arange(len(objects))
                source[changed] = -1
                return source
        known = {id(obj): i for i, obj in enumerate(self.objects)}
        return np.array([known.get(id(obj), -1) for obj in objects], np.int64)


NO_OBJECTS = ObjectTable(
    (), np.zeros(0, layout.OBJECT), np.zeros((0, 2, 3)), np.zeros(0, np.int64), {}, (), 0
)
"""The table of a scene without objects, from which the first one follows."""


class PlacedObjects:
    """A table of objects on the device, for meshes that a pool holds.

    The table does not change, but for where its meshes are: the pool may move them for the sake of another
    scene, and then the rows are uploaded again before they are used.
    """

    def __init__(self, pool: GeometryPool, meshes: Mapping[Mesh, PooledMesh], table: ObjectTable) -> None:
        self._pool, self._meshes = pool, meshes
        self.table = table
        self._buffer = self._uploaded()

    @property
    def buffer(self) -> cl.Buffer:
        """Rows of layout.OBJECT that refer to places in the pool's buffers as they are now."""
        packings = self._pool.packings
        if self.table.packings != packings:
            table = self.table.with_packings(self._meshes, packings)
            self.table = table
            self._buffer = self._uploaded()
        return self._buffer

    def _uploaded(self) -> cl.Buffer:
        """The rows, one at least, because kernels read the first one for a ray that meets nothing."""
        rows = self.table.rows
        return self._pool.device.upload(rows if len(rows) else np.zeros(1, layout.OBJECT))


def _describe(obj: Object, row: Any) -> None:
    """Fill in what depends on the object alone."""
    matrix = obj.world_from_object
    row["world_from_object"], row["object_from_world"] = matrix.ravel(), affine.invert(matrix).ravel()
    row["visible"] = obj.visible
    row["winding"] = np.sign(np.linalg.det(matrix[:, :3]))


def _world_vertices(obj: Object) -> npt.NDArray[np.float32]:
    vertices = obj.mesh.vertices.astype(np.float64)
    return affine.apply(obj.world_from_object, vertices).astype(np.float32)


def _objects_in_world_space(sizes: npt.NDArray[np.int64]) -> list[int]:
    """The objects whose triangles become part of the top level, smallest first: rays need no way into the
    space of the object then. They are few enough that moving one costs milliseconds."""
    small = np.flatnonzero(sizes <= _MOST_FACES_OF_ONE)
    small = small[np.argsort(sizes[small], kind="stable")]
    fitting = np.searchsorted(np.cumsum(sizes[small]), _MOST_FACES_OF_ALL, side="right")
    return [int(i) for i in small[: int(fitting)]]


def _all_but(total: int, chosen: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """The numbers below `total` that are not among the chosen."""
    left = np.ones(total, np.bool_)
    left[np.asarray(chosen, np.int64)] = False
    return np.flatnonzero(left)
