"""Mesh files, read by trimesh and checked here.

trimesh is lenient where a renderer must not be: it makes up vertex normals, keeps faces that point at no
vertex, fills a Draco-compressed glTF with zeros, and raises whatever comes up on damaged files. Every way
out of this module is a usable Mesh or an InputError; what had to be left out is told by an InputWarning.
"""

from __future__ import annotations

import io
import logging
import os
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from incpt.core.errors import InputError, InputWarning, reason_of
from incpt.core.files import read_bytes
from incpt.formats.clean import usable_mesh
from incpt.formats.gltf import gltf_attributes, gltf_header, gltf_materials
from incpt.formats.gltf_data import GltfData
from incpt.formats.obj import ODD_FACE, absolute_obj, utf8
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.picture.color import linear_from_srgb
from incpt.scene.mesh import MeshSource
from incpt.scene.mesh_part import MeshPart

_UV_UPWARDS = ("obj", "ply", "dae")
"""Files whose texture coordinates are (0, 0) at the bottom left of an image."""


def read_with_trimesh(path: Path) -> tuple[MeshPart, ...]:
    """The parts of a mesh file that trimesh can read; see `mesh_files.load_parts`. Raises InputError."""
    suffix = path.suffix[1:].lower()
    header: dict[str, Any] = {}
    if suffix in ("glb", "gltf"):
        header = gltf_header(path, suffix)
    loaded, dropped = _load_obj(path) if suffix == "obj" else (_load(path, suffix), 0)
    counts = {"in all": dropped, "with an index out of range": dropped}
    instances = _instances(loaded)
    data = GltfData(path, header)
    materials = gltf_materials(data, list(loaded.geometry))
    from_header = gltf_attributes(data, list(loaded.geometry))
    parts = []
    for name, geometry_name, matrix in instances:
        geometry = loaded.geometry[geometry_name]
        # STL has a normal for each face, of which trimesh makes normals at vertices.
        normals = None if suffix == "stl" else _normals(geometry)
        attributes = from_header.get(geometry_name) or _attributes(geometry, suffix)
        mesh = usable_mesh(*_placed(geometry, normals, matrix), counts, attributes.placed(matrix[:3, :3]))
        if mesh is not None:
            parts.append(MeshPart(name, mesh, *materials.get(geometry_name, (None, None))))
    left_out = ", ".join(
        f"{count} {reason}" for reason, count in counts.items() if count and reason != "in all"
    )
    if not parts:
        raise InputError(f"has no usable face ({left_out or 'no faces in the file'})")
    if left_out:
        total = counts["in all"]
        lost = sum(counts.values()) - total
        warnings.warn(f"{path}: left out {lost} of {total} faces: {left_out}", InputWarning, stacklevel=5)
    single = len(instances) == 1
    source = MeshSource(file=os.path.abspath(path))
    return tuple(
        replace(
            p,
            name=None if single else p.name,
            mesh=replace(p.mesh, source=source if single else replace(source, part=p.name)),
        )
        for p in parts
    )


def _normals(geometry: trimesh.Trimesh) -> npt.NDArray[np.float64] | None:
    """(V, 3) normals at the vertices as the file has them, or None where it has none."""
    # They stand in the cache only where the loader put them; the property makes them up.
    if "vertex_normals" not in geometry._cache:
        return None
    normals = np.asarray(geometry.vertex_normals, np.float64)
    return normals if normals.shape == np.shape(geometry.vertices) else None


def _attributes(geometry: trimesh.Trimesh, suffix: str) -> VertexAttributes:
    """Texture coordinates and colours as trimesh has read them."""
    visual: Any = geometry.visual
    count = len(geometry.vertices)
    uv = getattr(visual, "uv", None)
    colors = getattr(visual, "vertex_colors", None) if visual.kind == "vertex" else None
    uvs = np.zeros((0, 2)) if uv is None else np.asarray(uv, np.float64)
    found = VertexAttributes()
    if len(uvs) == count and uvs.ndim == 2 and uvs.shape[1] >= 2 and suffix in _UV_UPWARDS:
        found = replace(found, uvs=(uvs[:, :2] * [1, -1] + [0, 1],))
    if colors is not None and np.shape(colors) == (count, 4):
        # These files have bytes, as displays show them.
        shown = np.asarray(colors, np.float64) / 255
        linear = np.concatenate([linear_from_srgb(shown[:, :3]), shown[:, 3:]], axis=1)
        found = replace(found, colors=linear)
    return found


def _placed(
    geometry: trimesh.Trimesh, normals: npt.NDArray[np.float64] | None, matrix: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.float64] | None]:
    """Vertices (V, 3), faces (F, 3) and normals (V, 3) in the space of the file, under a (4, 4) matrix that
    places them there; faces are turned over where it mirrors. The arrays are not checked."""
    vertices = np.asarray(geometry.vertices, np.float64)
    faces = np.asarray(geometry.faces, np.int64)
    if np.array_equal(matrix, np.eye(4)) or vertices.ndim != 2 or vertices.shape[1] != 3:
        return vertices, faces, normals
    with np.errstate(all="ignore"):
        linear = matrix[:3, :3]
        vertices = vertices @ linear.T + matrix[:3, 3]
        if normals is not None:
            # The cofactor matrix is det · inverse transpose, and exists for flat placements too.
            x, y, z = linear.T
            cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
            normals = normals @ cofactors.T * np.sign(np.linalg.det(linear))
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
    return vertices, faces, normals


@contextmanager
def _quiet() -> Iterator[list[str]]:
    """Collects what trimesh logs and drops what it and numpy warn about: the error names the problem."""
    messages: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages.append(record.getMessage())

    log = logging.getLogger("trimesh")
    handler, propagate = Collect(logging.WARNING), log.propagate
    log.addHandler(handler)
    log.propagate = False
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield messages
    finally:
        log.propagate = propagate
        log.removeHandler(handler)


def _load(path: Path, suffix: str, content: bytes | None = None) -> trimesh.Scene:
    options: dict[str, Any] = {"process": False}
    if suffix in ("obj", "ply", "glb", "gltf"):
        # Textures are not used, so that no file but this one is opened.
        options["skip_materials"] = True
    if suffix == "obj":
        options |= {"split_objects": True, "group_material": False}
    try:
        with _quiet() as messages:
            stream: Any = str(path) if content is None else io.BytesIO(content)
            loaded = trimesh.load_scene(stream, file_type=suffix, **options)
    except Exception as error:  # trimesh raises errors of any type for a damaged file.
        raise InputError(f"is no {suffix.upper()} mesh, or a damaged one ({reason_of(error)})") from None
    if any("placeholder zeros" in message for message in messages):
        raise InputError("is compressed in a way that cannot be decoded; export it uncompressed")
    return loaded


def _load_obj(path: Path) -> tuple[trimesh.Scene, int]:
    """An OBJ file, and how many faces were left out for a vertex index that is out of range.

    trimesh counts relative indices from the end of the file and fails altogether on one out of range:
    such files are rewritten for it.
    """
    content = utf8(read_bytes(path))
    if not ODD_FACE.search(content):
        try:
            return _load(path, "obj", content), 0
        except InputError:
            pass
    try:
        content, left_out = absolute_obj(content)
    except ValueError as error:
        raise InputError(f"is no OBJ mesh, or a damaged one ({reason_of(error)})") from None
    return _load(path, "obj", content), left_out


def _instances(loaded: trimesh.Scene) -> list[tuple[str, str, npt.NDArray[np.float64]]]:
    """(name, name of the geometry, (4, 4) placement) of every placed triangle mesh.

    Ordered by geometry, then by name. A glTF node with several primitives gets random frame names from
    trimesh: its parts are numbered instead, so that they are the same the next time.
    """
    order = {name: index for index, name in enumerate(loaded.geometry)}
    parents = {child: parent for parent, child, _ in loaded.graph.to_edgelist()}  # type: ignore[no-untyped-call]
    found = []
    for node in loaded.graph.nodes_geometry:
        matrix, geometry_name = loaded.graph.get(node)
        mesh = loaded.geometry.get(geometry_name)
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            numbered = mesh.metadata.get("from_gltf_primitive") is True
            name = str(parents[node] if numbered else node)
            found.append((order[geometry_name], name, str(geometry_name), matrix))
    uses = Counter(name for _, name, _, _ in found)
    used: set[str] = set()
    result: list[tuple[str, str, npt.NDArray[np.float64]]] = []
    for _, name, geometry, matrix in sorted(found, key=lambda item: item[:2]):
        unique, number = (f"{name}.1", 1) if uses[name] > 1 else (name or "part", 1)
        while unique in used:
            number += 1
            unique = f"{name or 'part'}.{number}"
        used.add(unique)
        result.append((unique, geometry, np.asarray(matrix, np.float64)))
    return result
