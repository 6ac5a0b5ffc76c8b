"""The top level of a scene: one tree over its objects, and over the triangles of its small meshes.

Triangles of small meshes stand in the top level in world space: rays need no way into the space of their
objects. They have a tree of their own (`join_triangles`), which becomes a branch of the top level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.accel import bvh
from incpt.accel.bvh import Bvh
from incpt.core import layout
from incpt.device.device import Device
from incpt.scene.mesh import Mesh


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """The mesh of object number `object_index`, with its `vertices` (V, 3) in world space."""

    object_index: int
    mesh: Mesh
    vertices: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class WorldTriangles:
    """The triangles of several objects together, in world space.

    meshes          the objects, in the order in which their vertices and faces follow each other
    first_vertices  (M,) where those of each object begin in `vertices`
    first_faces     (M,) where those of each object begin among the faces of all
    vertices        (V, 3) of all objects
    tree            over all faces; its packs tell the object, and the number of a face in its own mesh
    places          (F,) where each face stands in the packs, as HIT_TRIANGLE has it
    """

    meshes: tuple[PlacedMesh, ...]
    first_vertices: tuple[int, ...]
    first_faces: tuple[int, ...]
    vertices: npt.NDArray[np.float32]
    tree: Bvh
    places: npt.NDArray[np.uint32]

    @property
    def without_area(self) -> npt.NDArray[np.bool_]:
        """(8 * P,) whether the place in the packs holds no face, or one without area: no ray meets it."""
        return np.asarray(np.isnan(self.tree.packs["vertex"][:, 0]).ravel())


def join_triangles(device: Device, meshes: Sequence[PlacedMesh]) -> WorldTriangles:
    """The triangles of these meshes, one at least. Raises DeviceError where the device's memory runs out."""
    counts = [len(placed.mesh.faces) for placed in meshes]
    first_faces = np.cumsum([0, *counts[:-1]]).tolist()
    first_vertices = np.cumsum([0, *(len(placed.vertices) for placed in meshes[:-1])]).tolist()
    vertices = np.concatenate([placed.vertices for placed in meshes])
    faces = [placed.mesh.faces + first for placed, first in zip(meshes, first_vertices, strict=True)]
    tree = bvh.build_triangles(device, vertices, np.concatenate(faces).astype(np.int32))
    owner = np.repeat(np.array([placed.object_index for placed in meshes], np.uint32), counts)
    own_face = np.concatenate([np.arange(count, dtype=np.uint32) for count in counts])
    face = tree.packs["face"]
    used = face != layout.NO_INDEX
    places = np.empty(len(own_face), np.uint32)
    places[face[used]] = np.flatnonzero(used) | layout.NODE_PACK
    tree.packs["object"][used] = owner[face[used]]
    face[used] = own_face[face[used]]
    return WorldTriangles(tuple(meshes), tuple(first_vertices), tuple(first_faces), vertices, tree, places)


def build_top(device: Device, bounds: npt.NDArray[np.floating[Any]]) -> Bvh:
    """The tree over objects with world-space bounds (N, 2, 3); each leaf is one object.

    Boxes are widened to the next float32 outwards, so that bounds may come in float64.
    """
    if len(bounds) == 0:
        return _empty_tree()
    boxes = np.zeros((len(bounds), 8), np.float32)
    infinity = np.float32(np.inf)
    boxes[:, 0:3] = np.nextafter(bounds[:, 0].astype(np.float32), -infinity)
    boxes[:, 4:7] = -np.nextafter(bounds[:, 1].astype(np.float32), infinity)
    boxes[:, 3] = np.arange(len(bounds), dtype=np.uint32).view(np.float32)
    return bvh.build_boxes(device, len(bounds), 1, device.upload(boxes))


def build_top_with_triangles(
    device: Device,
    bounds: npt.NDArray[np.floating[Any]],
    objects: npt.NDArray[np.integer[Any]],
    triangles: Bvh | None,
) -> npt.NDArray[np.void]:
    """The nodes of a top level over `objects`, which are indices (N,) with world-space bounds (N, 2, 3), and
    over the packs of `triangles`, a tree in world space, which becomes a branch of it."""
    if triangles is None:
        return _with_leaves(build_top(device, bounds), objects)
    packs = _with_leaves(triangles, np.arange(len(triangles.packs)) | layout.NODE_PACK)
    if len(objects) == 0:
        return packs
    both = np.concatenate([bounds, triangles.bounds[None]])
    nodes = _with_leaves(build_top(device, both), np.append(objects, layout.NODE_PACK))
    # The leaf that stands for all triangles becomes the root of their tree.
    nodes["child"][nodes["child"] == layout.NODE_LEAF | layout.NODE_PACK] = len(nodes)
    inner = packs["child"] < layout.NODE_PACK
    packs["child"][inner] += np.uint32(len(nodes))
    return np.concatenate([nodes, packs])


def _with_leaves(tree: Bvh, references: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.void]:
    """The nodes of a tree whose leaf i refers to references[i]."""
    nodes = tree.nodes.copy()
    child = nodes["child"]
    leaves = (child >= layout.NODE_LEAF) & (child != layout.NODE_EMPTY)
    child[leaves] = references[child[leaves] & ~np.uint32(layout.NODE_LEAF)] | layout.NODE_LEAF
    return nodes


def _empty_tree() -> Bvh:
    nodes = np.zeros(1, layout.NODE)
    nodes["bounds"][:, 0::2] = np.inf
    nodes["bounds"][:, 1::2] = -np.inf
    nodes["child"] = layout.NODE_EMPTY
    return Bvh(nodes, np.empty(0, layout.TRIANGLE_PACK), (0, 1), bvh.root_bounds(nodes))
