"""Bounding volume hierarchies: how they are built and refitted.

The builder is an OpenCL kernel (cl/accel/build_bvh.cl): in numpy the binned surface area heuristic takes tens
of seconds for a million triangles, on the device less than one. The host drives it level by level. It sums up
how many children each level has, which keeps the tree deterministic and its levels contiguous, so that a
refit goes through them backwards.

Nodes are 8-wide (Wald, Benthin and Boulos 2008, "Getting Rid of Packets"), leaves are packs of up to
eight triangles: box and triangle tests both fill a float8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import bindings, layout
from incpt.core.errors import DeviceError, InputError
from incpt.device.device import Device
from incpt.scene.mesh import Mesh

LARGEST_SERIAL_RANGE = 1 << 15
"""Boxes that one work-item may split alone; larger ranges are too few to keep a device busy."""
CHUNK = 1 << 12
"""Boxes that one work-item takes of such a range."""
MOST_PACKS = layout.PLACE_PACK.mask + 1
"""Of one tree: the place of a triangle has no room for more."""


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
    return build_triangles(device, mesh.vertices, mesh.faces)


def build_triangles(device: Device, vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32]) -> Bvh:
    """The tree of `faces` (F, 3), indices of `vertices` (V, 3); see `build_mesh`."""
    count = len(faces)
    vertex_buffer, face_buffer = device.upload(vertices), device.upload(faces)
    boxes = device.empty(count * 32)
    _launch(device, "bound_faces", count, faces=face_buffer, vertices=vertex_buffer, boxes=boxes)
    return build_boxes(device, count, layout.BVH_WIDTH, boxes, face_buffer, vertex_buffer)


def refit_mesh(device: Device, bvh: Bvh, mesh: Mesh) -> Bvh:
    """The tree `bvh` of a mesh with the same faces, fitted to the vertices of `mesh`.

    The shape of the tree stays, so that it suits the mesh the worse the more it is deformed.
    Raises InputError where the number of faces differs.
    """
    if np.count_nonzero(bvh.packs["face"] != layout.NO_INDEX) != len(mesh.faces):
        raise InputError(f"mesh: has {len(mesh.faces)} faces, its tree another number; build it anew")
    nodes, packs = device.upload(bvh.nodes), device.upload(bvh.packs)
    vertices, faces = device.upload(mesh.vertices), device.upload(mesh.faces)
    tree: dict[str, Any] = {"faces": faces, "vertices": vertices, "leaf_packs": packs}
    _launch(device, "refit_packs", len(bvh.packs), **tree)
    for first, end in reversed(list(zip(bvh.levels, bvh.levels[1:], strict=False))):
        _launch(device, "refit_nodes", end - first, first_node=first, tree_nodes=nodes, **tree)
    new_nodes = device.read(nodes, np.empty_like(bvh.nodes))
    new_packs = device.read(packs, np.empty_like(bvh.packs))
    return Bvh(new_nodes, new_packs, bvh.levels, root_bounds(new_nodes))


def build_boxes(
    device: Device, count: int, leaf_size: int, boxes: Any, faces: Any = None, vertices: Any = None
) -> Bvh:
    """The tree over `count` boxes in a buffer, laid out as Box of cl/accel/build_bvh.cl. A leaf is a pack of
    up to `leaf_size` faces of the mesh in the buffers `faces` and `vertices`, or without these a single box,
    whose number is the reference. Raises DeviceError where the device's memory runs out, where there are more
    packs than kernels can address, and where the device splits ranges wrongly.
    """
    # Kernel arguments for a mesh that is not there are filled with any buffer and never read.
    mesh = (faces, vertices) if faces is not None else (boxes, boxes)
    splitter = _Splitter(device, boxes, leaf_size) if count > LARGEST_SERIAL_RANGE else None
    ranges = device.upload(np.array([0, count], np.uint32))
    range_count, node_count, pack_count = 1, 0, 0
    nodes, packs, levels = [], [], [0]
    while range_count:
        if len(levels) > layout.BVH_MAX_DEPTH:
            raise _wrong_split(device, f"a tree became deeper than {layout.BVH_MAX_DEPTH} levels")
        capacity = min(leaf_size * 8 ** (layout.BVH_MAX_DEPTH - len(levels)), 0xFFFFFFFF)
        level = _Level(device, range_count, leaf_size)
        level.split(boxes, ranges, capacity)
        if splitter is not None and not level.split_large(splitter, ranges, capacity):
            splitter = None  # the ranges of further levels are smaller still
        offsets, inner, leaves = level.sum_up()
        node_count += range_count
        if leaf_size > 1 and pack_count + leaves > MOST_PACKS:
            raise DeviceError(
                f"mesh: has more than the {MOST_PACKS:,} packs of triangles that kernels can address; use a "
                f"smaller mesh"
            )
        ranges = device.empty(inner * 8)
        nodes.append(level.nodes_array)
        packs.append(level.link(boxes, offsets, node_count, pack_count, leaves, ranges, mesh))
        pack_count += leaves if leaf_size > 1 else 0
        range_count = inner
        levels.append(node_count)
    all_nodes = np.concatenate(nodes)
    return Bvh(all_nodes, np.concatenate(packs), tuple(levels), root_bounds(all_nodes))


def _wrong_split(device: Device, found: str) -> DeviceError:
    return DeviceError(f"{device.name} builds trees wrongly: {found}; choose another --device")


def _launch(device: Device, name: str, count: int, work_group: int | None = None, **values: Any) -> None:
    """Launch a kernel of the builder over `count` work-items; `values` are its other arguments."""
    arguments = bindings.arguments(bindings.KERNELS[name], {"count": count, **values})
    device.launch(device.kernel(name, bindings.FILES[name]), count, *arguments, work_group=work_group)


class _Level:
    """The device buffers of one level while it is being built."""

    def __init__(self, device: Device, count: int, leaf_size: int) -> None:
        self.device, self.count, self.leaf_size = device, count, leaf_size
        self.nodes = device.empty(count * layout.NODE.itemsize)
        self.children = device.empty(count * layout.BVH_WIDTH * 8)
        self.counts = device.empty(count * 8)
        self.nodes_array = np.empty(count, layout.NODE)
        self._level = {"leaf_size": leaf_size, "level_nodes": self.nodes, "children": self.children}

    def split(self, boxes: Any, ranges: Any, capacity: int) -> None:
        """Splits every range but those that are left to `split_large`."""
        values = {"boxes": boxes, "ranges": ranges, "child_counts": self.counts, **self._level}
        values |= {"capacity": capacity, "largest": LARGEST_SERIAL_RANGE}
        # Ranges differ in size by far: a group of its own for each spreads them best over the cores.
        group = 1 if self.device.is_cpu else None
        _launch(self.device, "split_ranges", self.count, group, **values)

    def split_large(self, splitter: _Splitter, ranges: Any, capacity: int) -> bool:
        """Splits the ranges that are too large for one work-item. False where there are none."""
        device, count = self.device, self.count
        sizes = device.read(ranges, np.empty((count, 2), np.uint32))
        large = np.flatnonzero(sizes[:, 1] > LARGEST_SERIAL_RANGE)
        if len(large) == 0:
            return False
        children = device.read(self.children, np.empty((count, layout.BVH_WIDTH, 2), np.uint32))
        counts = device.read(self.counts, np.empty((count, 2), np.uint32))
        device.read(self.nodes, self.nodes_array)
        for i in large:
            start, size = (int(n) for n in sizes[i])
            parts = splitter.split(start, size, even=size > capacity)
            leaves = sum(part.count <= self.leaf_size for part in parts)
            children[i] = 0
            children[i, : len(parts)] = [(part.start, part.count) for part in parts]
            counts[i] = len(parts) - leaves, leaves
            bounds = np.full((8, layout.BVH_WIDTH), np.inf, np.float32)
            bounds[:, : len(parts)] = np.stack([part.bounds for part in parts], axis=1)
            self.nodes_array[i]["bounds"][0::2] = bounds[0:3]
            self.nodes_array[i]["bounds"][1::2] = -bounds[4:7]
        for buffer, array in (
            (self.children, children),
            (self.counts, counts),
            (self.nodes, self.nodes_array),
        ):
            device.write(buffer, array)
        return True

    def sum_up(self) -> tuple[npt.NDArray[np.uint32], int, int]:
        """Inner children and leaves before each node (count, 2), and the sums of both."""
        counts = self.device.read(self.counts, np.empty((self.count, 2), np.uint32))
        sums = np.cumsum(counts, axis=0, dtype=np.uint32)
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
        values = {"boxes": boxes, "before": device.upload(offsets), "leaf_packs": packs, **self._level}
        values |= {"next_node": next_node, "next_pack": next_pack, "next_ranges": next_ranges}
        _launch(device, "link_children", self.count, faces=mesh[0], vertices=mesh[1], **values)
        device.read(self.nodes, self.nodes_array)
        if len(packs_array):
            device.read(packs, packs_array)
        return packs_array


@dataclass(frozen=True)
class _Part:
    """A range of boxes; what surrounds them, and twice their centres, as a Box of cl/accel/build_bvh.cl."""

    start: int
    count: int
    bounds: npt.NDArray[np.float32]
    centers: npt.NDArray[np.float32]


class _Splitter:
    """Splits ranges that are too large for one work-item: in chunks on the device, the plane chosen here."""

    def __init__(self, device: Device, boxes: Any, leaf_size: int) -> None:
        self.device, self.boxes, self.leaf_size = device, boxes, leaf_size
        self.moved = device.empty(boxes.size)

    def split(self, start: int, count: int, even: bool) -> list[_Part]:
        """Up to eight parts of a range, found as `split_ranges` does it."""
        parts = [self._measure(start, count)]
        while len(parts) < layout.BVH_WIDTH:
            sizes = [part.count if even else float(_area(part.bounds)) for part in parts]
            candidates = [i for i, part in enumerate(parts) if part.count > self.leaf_size]
            if not candidates:
                break
            chosen = max(candidates, key=sizes.__getitem__)
            part = parts[chosen]
            middle = part.start + (part.count // 2 if even else self._partition(part))
            parts[chosen] = self._measure(part.start, middle - part.start)
            parts.append(self._measure(middle, part.start + part.count - middle))
        return parts

    def _launch(self, name: str, count: int, **values: Any) -> None:
        group = 1 if self.device.is_cpu else None
        _launch(self.device, name, count, group, boxes=self.boxes, **values)

    def _measure(self, start: int, count: int) -> _Part:
        chunks = _chunks(start, count)
        measures = self.device.empty(len(chunks) * 64)
        self._launch("measure_chunks", len(chunks), chunks=self.device.upload(chunks), measures=measures)
        least = self.device.read(measures, np.empty((len(chunks), 2, 8), np.float32)).min(axis=0)
        return _Part(start, count, least[0], least[1])

    def _partition(self, part: _Part) -> int:
        """Reorders a part by the cheapest split; the number of boxes on its lower side."""
        device = self.device
        chunks = _chunks(part.start, part.count)
        chunk_buffer = device.upload(chunks)
        origin = part.centers[0:3]
        extent = -part.centers[4:7] - origin
        with np.errstate(divide="ignore"):
            scale = np.float32(layout.BVH_BINS * 0.999) / extent
        scale = np.where((extent > 0) & (scale < 1e30), scale, np.float32(0))
        bins, counts = self._bin(chunk_buffer, len(chunks), origin, scale)
        split = _cheapest_split(bins, counts.sum(axis=0, dtype=np.int64), self.leaf_size)
        if split is None:
            return part.count // 2  # all centres coincide: one order is as good as another
        axis, position = split
        left = counts[:, axis, :position].sum(axis=1, dtype=np.uint32)
        lower = int(left.sum())
        if not 0 < lower < part.count:
            raise _wrong_split(device, f"a split leaves {lower:,} of {part.count:,} boxes on one side")
        before = np.cumsum(left, dtype=np.uint32) - left
        sides = np.stack([part.start + before, lower + chunks[:, 0] - before], axis=1).astype(np.uint32)
        buffers = {"chunks": chunk_buffer, "moved": self.moved}
        plane = {"axis": axis, "position": position, "origin": origin[axis], "scale": scale[axis]}
        self._launch("scatter_chunks", len(chunks), sides=device.upload(sides), **plane, **buffers)
        self._launch("copy_chunks", len(chunks), **buffers)
        return lower

    def _bin(
        self, chunks: Any, count: int, origin: npt.NDArray[np.float32], scale: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
        """Boxes of the bins (3, bins, 8), and how many boxes each chunk put in them (count, 3, bins)."""
        bin_buffer = self.device.empty(count * 3 * layout.BVH_BINS * 32)
        count_buffer = self.device.empty(count * 3 * layout.BVH_BINS * 4)
        axes = {f"origin_{axis}": value for axis, value in zip("xyz", origin, strict=True)}
        axes |= {f"scale_{axis}": value for axis, value in zip("xyz", scale, strict=True)}
        self._launch("bin_chunks", count, chunks=chunks, bins=bin_buffer, bin_counts=count_buffer, **axes)
        bins = self.device.read(bin_buffer, np.empty((count, 3, layout.BVH_BINS, 8), np.float32))
        counts = self.device.read(count_buffer, np.empty((count, 3, layout.BVH_BINS), np.uint32))
        return bins.min(axis=0), counts


def _chunks(start: int, count: int) -> npt.NDArray[np.uint32]:
    """(chunks, 2) start and size of equal pieces of a range."""
    edges = np.linspace(start, start + count, -(-count // CHUNK) + 1).astype(np.uint32)
    return np.stack([edges[:-1], np.diff(edges)], axis=1)


def _area(box: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Half the surface of boxes (..., 8): lower bounds first, then the negated upper ones."""
    size = -box[..., 4:7] - box[..., 0:3]
    area: npt.NDArray[np.float32] = (size * np.roll(size, 1, axis=-1)).sum(axis=-1)
    return area


def _cheapest_split(
    bins: npt.NDArray[np.float32], counts: npt.NDArray[np.int64], leaf_size: int
) -> tuple[int, int] | None:
    """Axis and first bin of the upper side, by the surface area heuristic; None where nothing separates."""
    lower, upper = counts.cumsum(axis=1)[:, :-1], counts[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]
    lower_box = np.minimum.accumulate(bins, axis=1)[:, :-1]
    upper_box = np.minimum.accumulate(bins[:, ::-1], axis=1)[:, ::-1][:, 1:]
    with np.errstate(invalid="ignore"):  # an empty side has an infinite box
        cost = _area(lower_box) * -(-lower // leaf_size) + _area(upper_box) * -(-upper // leaf_size)
    cost = np.where((lower > 0) & (upper > 0), cost, np.inf)
    axis, position = np.unravel_index(cost.argmin(), cost.shape)
    return (int(axis), int(position) + 1) if np.isfinite(cost[axis, position]) else None


def root_bounds(nodes: npt.NDArray[np.void]) -> npt.NDArray[np.float32]:
    """(2, 3) least and greatest coordinates of what is in the root, the first of the nodes of a tree."""
    planes = nodes["bounds"][0]
    return np.stack([planes[0::2].min(axis=1), planes[1::2].max(axis=1)])
