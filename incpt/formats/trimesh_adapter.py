"""Mesh files, read by trimesh and checked here.

trimesh is lenient where a renderer must not be: it makes up vertex normals, keeps faces that point at no
vertex, and raises whatever comes up on damaged files. Every way out of this module is a usable Mesh or an
InputError; what had to be left out is told in the report.
"""

from __future__ import annotations

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

from incpt.core.errors import InputError, reason_of
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.placement import placed_arrays
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.picture.color import linear_from_srgb
from incpt.scene.mesh import MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart

_UV_UPWARDS = ("ply", "dae")
"""Files whose texture coordinates are (0, 0) at the bottom left of an image."""


def read_with_trimesh(path: Path) -> MeshFile:
    """A mesh file that trimesh can read; see `mesh_files.load_file`. Raises InputError."""
    suffix = path.suffix[1:].lower()
    loaded = _load(path, suffix)
    counts: dict[str, int] = {}
    instances = _instances(loaded)
    parts = []
    for name, geometry_name, matrix in instances:
        geometry = loaded.geometry[geometry_name]
        # STL has a normal for each face, of which trimesh makes normals at vertices.
        normals = None if suffix == "stl" else _normals(geometry)
        vertices, faces = np.asarray(geometry.vertices, np.float64), np.asarray(geometry.faces, np.int64)
        arrays = placed_arrays(vertices, faces, normals, matrix)
        mesh = usable_mesh(*arrays, counts, _attributes(geometry, suffix).placed(matrix[:3, :3]))
        if mesh is not None:
            parts.append(MeshPart(name, mesh))
    tell_of_faces(counts)
    single = len(instances) == 1
    source = MeshSource(file=os.path.abspath(path))
    return MeshFile(
        tuple(
            replace(
                p,
                name=None if single else p.name,
                mesh=replace(p.mesh, source=source if single else replace(source, part=p.name)),
            )
            for p in parts
        )
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


@contextmanager
def _quiet() -> Iterator[None]:
    """Drops what trimesh logs, and what it and numpy warn about: the error names the problem."""
    log = logging.getLogger("trimesh")
    handler, propagate = logging.NullHandler(), log.propagate
    log.addHandler(handler)
    log.propagate = False
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.propagate = propagate
        log.removeHandler(handler)


def _load(path: Path, suffix: str) -> trimesh.Scene:
    # Textures are not used, so that no file but this one is opened.
    options: dict[str, Any] = {"skip_materials": True} if suffix == "ply" else {}
    try:
        with _quiet():
            loaded = trimesh.load_scene(str(path), file_type=suffix, process=False, **options)
    except Exception as error:  # trimesh raises errors of any type for a damaged file.
        raise InputError(f"is no {suffix.upper()} mesh, or a damaged one ({reason_of(error)})") from None
    return loaded


def _instances(loaded: trimesh.Scene) -> list[tuple[str, str, npt.NDArray[np.float64]]]:
    """(name, name of the geometry, (4, 4) placement) of every placed triangle mesh.

    Ordered by geometry, then by name.
    """
    order = {name: index for index, name in enumerate(loaded.geometry)}
    found = []
    for node in loaded.graph.nodes_geometry:
        matrix, geometry_name = loaded.graph.get(node)
        mesh = loaded.geometry.get(geometry_name)
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            found.append((order[geometry_name], str(node), str(geometry_name), matrix))
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
