"""The meshes of shapes: those of files and those that Mitsuba makes, as each shape wants them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.formats import import_report, mesh_files, primitive_shapes
from incpt.formats.import_options import current_options, reading_with
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.materials import Surface
from incpt.formats.mitsuba.node import Node
from incpt.formats.mitsuba.serialized import read_serialized
from incpt.formats.placement import turned_over
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.texture import Texture

Array = npt.NDArray[np.float64]
FILES = ("obj", "ply", "serialized")
"""Shapes that a file holds."""
_GREY = (0.5, 0.5, 0.5, 1.0)
_ROUND = ("sphere", "cylinder", "disk")
"""Those that are no meshes in Mitsuba."""
PlacedMesh = tuple[Mesh, Array]
"""A mesh, and its place (4, 4) in the space of its shape."""


class Meshes:
    """Reads the meshes of shapes, each once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._variants: dict[tuple[object, ...], tuple[Mesh, Mesh]] = {}
        self._serialized: dict[tuple[str, int], Mesh] = {}

    def of(self, node: Node, surface: Surface) -> dict[str, PlacedMesh]:
        """The meshes of a shape by the names of parts, "" where it has one. What cannot be read is told, and
        there are none. Raises InputError."""
        found = self._of_file(node) if node.kind in FILES else self._built_in(node)
        return {part: (self._variant(node, mesh, surface), place) for part, (mesh, place) in found.items()}

    def _built_in(self, node: Node) -> dict[str, PlacedMesh]:
        if node.kind not in _BUILT_IN:
            node.ignore(*node.values, *node.objects)
            import_report.left_out(f"{node}: shapes of that type are not read")
            return {}
        matrix = np.eye(4)
        if node.kind == "sphere":
            matrix[:3] = primitive_shapes.SPHERE_FROM_OURS * node.number("radius", 1.0, 0.0)
            matrix[:3, 3] = node.vector("center", (0.0, 0.0, 0.0))
        elif node.kind == "cylinder":
            matrix = _along(node)
        return {"": (_BUILT_IN[node.kind](), matrix)}

    def _of_file(self, node: Node) -> dict[str, PlacedMesh]:
        name = node.text("filename")
        try:
            path = self._document.file(name)
            if node.kind == "serialized":
                mesh = self._serialized_mesh(path, node.whole("shape_index", 0, 0, 1 << 31))
                return {"": (mesh, np.eye(4))}
            # Mitsuba takes no materials of meshes.
            with reading_with(replace(current_options(), materials=False)):
                parts = mesh_files.load_file(path).parts
        except InputError as error:
            import_report.left_out(f"{node}: {error}")
            node.ignore(*node.values)
            return {}
        bottom = [[0.0, 0.0, 0.0, 1.0]]
        return {
            part.name or "": (part.mesh, np.vstack([part.transform.world_from_object, bottom]))
            for part in parts
        }

    def _serialized_mesh(self, path: Path, number: int) -> Mesh:
        key = (os.path.realpath(path), number)
        if key not in self._serialized:
            with in_place(str(path)):
                self._serialized[key] = read_serialized(path, number)
        return self._serialized[key]

    def _variant(self, node: Node, mesh: Mesh, surface: Surface) -> Mesh:
        """A mesh as a shape wants it: the same object for all that want the same of it."""
        is_flat = node.kind not in _ROUND and node.flag("face_normals", False)
        flips = node.flag("flip_normals", False)
        turns_v = _turns_v(node) and any(isinstance(value, Texture) for value in surface.look.values())
        key = (id(mesh), is_flat, flips, turns_v, surface.has_vertex_colors)
        if key not in self._variants:
            made = mesh
            if surface.has_vertex_colors and made.colors is None:
                what = f"colours at the vertices of {node}"
                import_report.left_out(f"{what}: the mesh has none that are read; grey stands for them")
                made = _changed(made, colors=np.full((len(made.faces), 3, 4), _GREY, np.float32))
            if is_flat and made.normals is not None:
                made = _changed(made, normals=None)
            elif not is_flat and made.normals is None and node.kind in FILES:
                made = _changed(made, normals=_smooth_normals(made))
            if made.colors is not None and not surface.has_vertex_colors:
                made = _changed(made, colors=None)
            if turns_v:
                made = _changed(made, uvs=tuple(uv * _UPSIDE_DOWN + _ONE_DOWN for uv in made.uvs))
            # The mesh is kept, so that no other gets its identity.
            self._variants[key] = (mesh, turned_over(made) if flips else made)
        return self._variants[key][1]


_BUILT_IN: dict[str, Callable[[], Mesh]] = {
    "rectangle": primitive_shapes.rectangle,
    "cube": primitive_shapes.cube,
    "disk": primitive_shapes.disk,
    "cylinder": primitive_shapes.cylinder,
    "sphere": primitive_shapes.sphere,
}
_UPSIDE_DOWN, _ONE_DOWN = np.array([1, -1], np.float32), np.array([0, 1], np.float32)


def _turns_v(node: Node) -> bool:
    """Whether texture coordinates are upside down: our readers put (0, 0) at the top left of an image, where
    Mitsuba takes those of a PLY file as they are."""
    if node.kind not in ("obj", "ply"):
        return False
    return not node.flag("flip_tex_coords", node.kind == "obj")


def _changed(mesh: Mesh, **values: Any) -> Mesh:
    """A mesh that is no longer that of its file."""
    return replace(mesh, source=MeshSource(), **values)


def _smooth_normals(mesh: Mesh) -> npt.NDArray[np.float32]:
    """(F, 3, 3) at each vertex the mean over its faces, weighted by their angles there (G. Thürmer and
    C. Wüthrich, "Computing Vertex Normals from Polygonal Facets", JGT 1998), as Mitsuba makes them for files
    without normals."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    along = np.roll(corners, -1, axis=1) - corners
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    flat = np.cross(along[:, 0], along[:, 1])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    angles = np.arccos(np.clip(-(along * np.roll(along, 1, axis=1)).sum(axis=2), -1, 1))
    sums = np.stack(
        [
            np.bincount(mesh.faces.ravel(), (angles * flat[:, axis, None]).ravel(), len(mesh.vertices))
            for axis in range(3)
        ],
        axis=1,
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    unit = sums / np.where(lengths > 1e-9, lengths, 1)
    # Where faces stand back to back, each has its own.
    normals = np.where((lengths > 1e-9)[mesh.faces], unit[mesh.faces], flat[:, None])
    return normals.astype(np.float32)


def _along(node: Node) -> Array:
    """(4, 4) from the cylinder with radius 1 between z = 0 and 1 to that of a shape."""
    first, last = node.vector("p0", (0.0, 0.0, 0.0)), node.vector("p1", (0.0, 0.0, 1.0))
    length = float(np.linalg.norm(last - first))
    if length == 0:
        raise InputError("p1: is the same point as p0; move one of them")
    # T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017, as Mitsuba does it.
    x, y, z = (last - first) / length
    sign = math.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    axes = [[x * x * a * sign + 1, b * sign, -x * sign], [b, y * y * a + sign, -y], [x, y, z]]
    radius = node.number("radius", 1.0, 0.0)
    matrix = np.eye(4)
    matrix[:3, :3] = np.transpose(axes) * [radius, radius, length]
    matrix[:3, 3] = first
    return matrix
