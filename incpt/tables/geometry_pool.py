"""The geometry of all scenes on a device: every mesh is uploaded once, and its tree is built once.

Meshes are found by identity first, and by their content second, so that a file that is loaded twice is stored
once. A scene holds `PooledMesh` handles; what nobody holds makes room for others. Trees stay on the host as
long as one of their meshes does: undo uploads a mesh again, but does not build its tree again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.accel import bvh, quads
from incpt.core import layout
from incpt.device.device import Device
from incpt.scene.mesh import Mesh
from incpt.scene.tangents import corner_tangents, uv_gradients
from incpt.tables.range_buffer import Range, RangeBuffer

_MOST_NODES = layout.NODE_LEAF
_MOST_PACKS = layout.NODE_PACK // layout.BVH_WIDTH
"""The place of a hit is the place of its pack times BVH_WIDTH, and NODE_PACK is a flag above it."""
_MOST_NORMALS = layout.NO_INDEX
_CORNERS = {"uvs": "texture coordinates", "colors": "colours of corners", "tangents": "tangents",
            "gradients": "gradients of texture coordinates"}  # fmt: skip
"""Buffers of what meshes have at their corners beside normals, or on their faces."""


class BuiltMesh:
    """What was made of a mesh's content on the host: its tree, and its quads once somebody asks for them."""

    def __init__(self, tree: bvh.Bvh) -> None:
        self.tree = tree
        self._quads: quads.Quads | None = None

    def quads(self, mesh: Mesh) -> quads.Quads:
        """The quads of `mesh`, whose content this is."""
        if self._quads is None:
            self._quads = quads.find_quads(mesh)
        return self._quads


class PooledMesh:
    """A mesh on the device, which stays there as long as somebody holds this."""

    def __init__(self, built: BuiltMesh, nodes: Range, packs: Range, normals: Range | None) -> None:
        self.built = built
        self._nodes, self._packs, self._normals = nodes, packs, normals
        self.corners: dict[str, Range] = {}
        """What it has at its corners beside normals, as far as some scene needs it: "uvs 0", "uvs 1",
        "colors", and what goes by a set of texture coordinates: "tangents 0", "gradients 0" and those of set
        1."""

    @property
    def place(self) -> tuple[int, int, int, int]:
        """Its first node, its first pack, the first float of its normals, and 1 where it has normals, in the
        buffers of the pool, until `GeometryPool.packings` changes."""
        normals = (0, 0) if self._normals is None else (self._normals.first, 1)
        return self._nodes.first, self._packs.first, *normals

    def place_of(self, corners: str) -> tuple[int, int]:
        """The first float of what it has at its corners, and 1; 0 and 0 where it has nothing."""
        found = self.corners.get(corners)
        return (0, 0) if found is None else (found.first, 1)


class GeometryPool:
    """Trees, triangles and normals of meshes on a device; see `of` for the one that its sessions share."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._nodes = RangeBuffer(device, "nodes of trees", layout.NODE, _MOST_NODES)
        self._packs = RangeBuffer(device, "packs of triangles", layout.TRIANGLE_PACK, _MOST_PACKS)
        self._normals = RangeBuffer(device, "floats of normals", np.float32, _MOST_NORMALS)
        self._corners = {
            name: RangeBuffer(device, f"floats of {what}", np.float32, _MOST_NORMALS)
            for name, what in _CORNERS.items()
        }
        self._buffers = {
            "nodes": self._nodes, "packs": self._packs, "normals": self._normals, **self._corners,
        }  # fmt: skip
        self._built: WeakKeyDictionary[Mesh, BuiltMesh] = WeakKeyDictionary()
        self._built_by_content: WeakValueDictionary[bytes, BuiltMesh] = WeakValueDictionary()
        self._pooled: WeakValueDictionary[BuiltMesh, PooledMesh] = WeakValueDictionary()

    @staticmethod
    def of(device: Device) -> GeometryPool:
        """The pool that all sessions of a device share. It goes when the last of its users goes."""
        pool = _POOLS.get(device)
        if pool is None:
            pool = _POOLS[device] = GeometryPool(device)
        return pool

    @property
    def packings(self) -> int:
        """How often meshes have moved to other places so far; whoever noted places asks for them again."""
        return sum(ranges.packings for ranges in self._buffers.values())

    def buffer(self, name: str) -> cl.Buffer:
        """The buffer of all nodes, packs, normals, uvs, colors, tangents or gradients. It may be another one
        after the next `hold` or `shrink`, so that every launch asks for it. One that was replaced keeps what
        it had, and nothing is written to it any more: launches with buffers that were asked for together are
        right."""
        return self._buffers[name].buffer

    def hold(self, meshes: Iterable[Mesh]) -> dict[Mesh, PooledMesh]:
        """Handles of meshes; those that are not on the device are uploaded together.

        Raises DeviceError where there is no room for them. Nothing has changed for others then.
        """
        built = {mesh: self._build(mesh) for mesh in meshes}
        held: dict[BuiltMesh, PooledMesh] = {}
        missing: dict[BuiltMesh, Mesh] = {}
        for mesh, content in built.items():
            pooled = self._pooled.get(content)
            if pooled is None:
                missing[content] = mesh
            else:
                held[content] = pooled
        held.update(self._upload(missing))
        return {mesh: held[content] for mesh, content in built.items()}

    def hold_corners(self, wanted: Mapping[tuple[Mesh, str], None], held: Mapping[Mesh, PooledMesh]) -> None:
        """Upload what held meshes have at their corners, by the names of PooledMesh.corners, where it is not
        there yet. It stays as long as its mesh does. Raises DeviceError where there is no room for it."""
        missing: dict[str, dict[tuple[PooledMesh, str], npt.NDArray[np.float32]]] = {}
        for mesh, name in wanted:
            if name not in held[mesh].corners:
                missing.setdefault(name.split()[0], {})[held[mesh], name] = _at_corners(mesh, name).ravel()
        for kind, values in missing.items():
            ranges = self._corners[kind].add(list(values.values()))
            for (pooled, name), own in zip(values, ranges, strict=True):
                pooled.corners[name] = own

    def refit(self, old: Mesh, new: Mesh) -> None:
        """Make the tree of `new`, which has the faces of `old`, by refitting that of `old`.

        It is found by the identity of `new` alone. A mesh of the same content that comes from elsewhere
        gets a tree of its own, which suits it better, and a drag computes no digests.
        """
        if new not in self._built and old in self._built:
            self._built[new] = BuiltMesh(bvh.refit_mesh(self.device, self._built[old].tree, new))

    def shrink(self) -> None:
        """Give memory back where meshes that nobody holds any more have left much of it unused."""
        for ranges in self._buffers.values():
            ranges.shrink()

    def _build(self, mesh: Mesh) -> BuiltMesh:
        built = self._built.get(mesh)
        if built is None:
            digest = _content_digest(mesh)
            built = self._built_by_content.get(digest)
            if built is None:
                built = BuiltMesh(bvh.build_mesh(self.device, mesh))
                self._built_by_content[digest] = built
            self._built[mesh] = built
        return built

    def _upload(self, meshes: Mapping[BuiltMesh, Mesh]) -> dict[BuiltMesh, PooledMesh]:
        nodes = self._nodes.add([built.tree.nodes for built in meshes])
        packs = self._packs.add([built.tree.packs for built in meshes])
        smooth = {built: mesh.normals for built, mesh in meshes.items() if mesh.normals is not None}
        ranges = self._normals.add([normals.ravel() for normals in smooth.values()])
        normals = dict(zip(smooth, ranges, strict=True))
        uploaded = {
            built: PooledMesh(built, own_nodes, own_packs, normals.get(built))
            for built, own_nodes, own_packs in zip(meshes, nodes, packs, strict=True)
        }
        self._pooled.update(uploaded)
        return uploaded


def _at_corners(mesh: Mesh, name: str) -> npt.NDArray[np.float32]:
    """What a mesh has at its corners under one of the names of PooledMesh.corners."""
    kind, _, number = name.partition(" ")
    if kind == "colors":
        assert mesh.colors is not None
        return mesh.colors
    if kind == "gradients":
        return uv_gradients(mesh, int(number))
    return mesh.uvs[int(number)] if kind == "uvs" else corner_tangents(mesh, int(number))


_POOLS: WeakValueDictionary[Device, GeometryPool] = WeakValueDictionary()


def _content_digest(mesh: Mesh) -> bytes:
    """A digest of all that a mesh has. Meshes with the same one are taken for equal."""
    digest = hashlib.blake2b(digest_size=16)
    uvs = (*mesh.uvs, None, None)[:2]
    for array in (mesh.vertices, mesh.faces, mesh.normals, *uvs, mesh.colors, mesh.tangents):
        digest.update(b"" if array is None else str(array.shape).encode())
        digest.update(b"" if array is None else array.data)
    return digest.digest()
