"""Bounding volume hierarchies: one per mesh, and one over the objects of a scene.

Layer L2, above `device`, because the builder is an OpenCL kernel (cl/build_bvh.cl): in numpy the binned
surface area heuristic takes tens of seconds for a million triangles, on the device less than one. The
host drives it level by level; it sums up how many children each level has, which keeps the tree
deterministic and its levels contiguous, so that a refit goes through them backwards.

Nodes are 8-wide (Wald, Benthin and Boulos 2008, "Getting Rid of Packets"), leaves are packs of up to
eight triangles: box and triangle tests both fill a float8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt import layout
from incpt.device import Device
from incpt.errors import InputError
from incpt.scene import Mesh

_FILE = "build_bvh"


@dataclass(frozen=True, eq=False)
class Bvh:
    """A tree as `layout.NODE` and `layout.TRIANGLE_PACK` describe it.

    nodes   (N,) NODE, breadth first, the root first; child references are relative to this array.
    packs   (P,) TRIANGLE_PACK, one per leaf; empty for a top level, whose leaves are object indices.
    levels  where each level starts in `nodes`, and their end: level i is nodes[levels[i]:levels[i + 1]].
    bounds  (2, 3) float32 least and greatest coordinates; least above greatest where the tree is empty.
    """

    nodes: npt.NDArray[np.void]
    packs: npt.NDArray[np.void]
    levels: tuple[int, ...]
    bounds: npt.NDArray[np.float32]


def build_mesh(device: Device, mesh: Mesh) -> Bvh:
    """The tree of a mesh, in its object space. Faces without area keep their place, but no ray meets them.

    Raises DeviceError where the device's memory runs out.
    """
    count = len(mesh.faces)
    vertices, faces = device.upload(mesh.vertices), device.upload(mesh.faces)
    boxes = device.empty(count * 32)
    device.launch(device.kernel("bound_faces", _FILE), count, np.uint32(count), faces, vertices, boxes)
    return _build(device, count, layout.BVH_WIDTH, boxes, faces, vertices)


def refit_mesh(device: Device, bvh: Bvh, mesh: Mesh) -> Bvh:
    """The tree `bvh` of a mesh with the same faces, fitted to the vertices of `mesh`.

    The shape of the tree stays, so that it suits the mesh the worse the more it is deformed.
    Raises InputError where the number of faces differs.
    """
    if np.count_nonzero(bvh.packs["face"] != layout.NO_INDEX) != len(mesh.faces):
        raise InputError(f"mesh: has {len(mesh.faces)} faces, its tree another number; build it anew")
    vertices, faces = device.upload(mesh.vertices), device.upload(mesh.faces)
    nodes, packs = device.upload(bvh.nodes), device.upload(bvh.packs)
    count = len(bvh.packs)
    device.launch(device.kernel("refit_packs", _FILE), count, np.uint32(count), packs, faces, vertices)
    kernel = device.kernel("refit_nodes", _FILE)
    for first, end in reversed(list(zip(bvh.levels, bvh.levels[1:], strict=False))):
        size = end - first
        device.launch(kernel, size, np.uint32(size), np.uint32(first), nodes, packs, faces, vertices)
    new_nodes = device.read(nodes, np.empty_like(bvh.nodes))
    new_packs = device.read(packs, np.empty_like(bvh.packs))
    return Bvh(new_nodes, new_packs, bvh.levels, _root_bounds(new_nodes))


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
    return _build(device, len(bounds), 1, device.upload(boxes))


def _empty_tree() -> Bvh:
    nodes = np.zeros(1, layout.NODE)
    nodes["bounds"][:, 0::2] = np.inf
    nodes["bounds"][:, 1::2] = -np.inf
    nodes["child"] = layout.NODE_EMPTY
    return Bvh(nodes, np.empty(0, layout.TRIANGLE_PACK), (0, 1), _root_bounds(nodes))


def _build(
    device: Device, count: int, leaf_size: int, boxes: Any, faces: Any = None, vertices: Any = None
) -> Bvh:
    # A top level has no faces: its kernel arguments are filled with any buffer and never read.
    mesh = (faces, vertices) if faces is not None else (boxes, boxes)
    ranges = device.upload(np.array([0, count], np.uint32))
    range_count, node_count, pack_count = 1, 0, 0
    nodes, packs, levels = [], [], [0]
    while range_count:
        capacity = leaf_size * 8 ** (layout.BVH_MAX_DEPTH - len(levels))
        level = _Level(device, range_count, leaf_size)
        offsets, inner, leaves = level.split(boxes, ranges, min(capacity, 0xFFFFFFFF))
        node_count += range_count
        ranges = device.empty(inner * 8)
        nodes.append(level.nodes_array)
        packs.append(level.link(boxes, offsets, node_count, pack_count, leaves, ranges, mesh))
        pack_count += leaves if leaf_size > 1 else 0
        range_count = inner
        levels.append(node_count)
    all_nodes = np.concatenate(nodes)
    return Bvh(all_nodes, np.concatenate(packs), tuple(levels), _root_bounds(all_nodes))


class _Level:
    """The device buffers of one level while it is being built."""

    def __init__(self, device: Device, count: int, leaf_size: int) -> None:
        self.device, self.count, self.leaf_size = device, count, leaf_size
        self.nodes = device.empty(count * layout.NODE.itemsize)
        self.children = device.empty(count * layout.BVH_WIDTH * 8)
        self.nodes_array = np.empty(count, layout.NODE)

    def split(self, boxes: Any, ranges: Any, capacity: int) -> tuple[npt.NDArray[np.uint32], int, int]:
        """Splits every range. Inner children and leaves before each node (count, 2), and the sums."""
        device, count = self.device, self.count
        counts = device.empty(count * 8)
        sizes = np.uint32(count), np.uint32(self.leaf_size), np.uint32(capacity)
        kernel = device.kernel("split_ranges", _FILE)
        # Ranges differ in size by far: a group of its own for each spreads them best over the cores.
        group = 1 if device.is_cpu else None
        device.launch(
            kernel, count, *sizes, boxes, ranges, self.nodes, self.children, counts, work_group=group
        )
        sums = np.cumsum(device.read(counts, np.empty((count, 2), np.uint32)), axis=0, dtype=np.uint32)
        offsets = np.concatenate([np.zeros((1, 2), np.uint32), sums[:-1]])
        return offsets, int(sums[-1, 0]), int(sums[-1, 1])

    def link(
        self,
        boxes: Any,
        offsets: npt.NDArray[np.uint32],
        next_node: int,
        next_pack: int,
        leaves: int,
        next_ranges: Any,
        mesh: tuple[Any, Any],
    ) -> npt.NDArray[np.void]:
        """Refers the nodes to their children, reads them back, and returns the packs of the leaves."""
        device = self.device
        packs_array = np.empty(leaves if self.leaf_size > 1 else 0, layout.TRIANGLE_PACK)
        packs = device.empty(packs_array.nbytes)
        sizes = (np.uint32(n) for n in (self.count, self.leaf_size, next_node, next_pack))
        device.launch(
            device.kernel("link_children", _FILE),
            self.count,
            *sizes,
            boxes,
            self.children,
            device.upload(offsets),
            self.nodes,
            next_ranges,
            packs,
            *mesh,
        )
        device.read(self.nodes, self.nodes_array)
        if len(packs_array):
            device.read(packs, packs_array)
        return packs_array


def _root_bounds(nodes: npt.NDArray[np.void]) -> npt.NDArray[np.float32]:
    planes = nodes["bounds"][0]
    return np.stack([planes[0::2].min(axis=1), planes[1::2].max(axis=1)])
