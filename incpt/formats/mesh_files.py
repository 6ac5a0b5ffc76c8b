"""Mesh files: reads the parts of any file that holds meshes, each file once while it is in use."""

from __future__ import annotations

import json
import os
import weakref
from difflib import get_close_matches
from pathlib import Path
from types import NoneType

from incpt.core.checks import path_of, require
from incpt.core.errors import InputError
from incpt.core.files import check_readable
from incpt.formats import registry
from incpt.formats.registry import FileKind
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.mesh_part import MeshPart

FileKey = tuple[str, int, int]
"""Real path, time of the last change in nanoseconds, and size: a file with the same key is unchanged."""

_meshes: weakref.WeakValueDictionary[tuple[FileKey, str | None], Mesh] = weakref.WeakValueDictionary()
_parts: dict[FileKey, tuple[tuple[str | None, str | None, Material | None], ...]] = {}


def load_parts(path: str | os.PathLike[str]) -> tuple[MeshPart, ...]:
    """All meshes of a file, placed as the file's nodes say (baked into the vertices, winding turned where
    the placement mirrors), with shading normals only where the file brings them.

    The same file, unchanged, gives the same Mesh objects as long as they are in use. Faces with an index
    out of range, a vertex that is not finite, zero area, or that come twice are left out, with an
    InputWarning. Raises InputError: the file is missing, damaged, of an unknown type, or has no face left.
    """
    path = path_of("path", path)
    status = check_readable(path)
    row = registry.format_of(path, FileKind.MESH)
    if row is None:
        raise InputError(f"{path}: is no mesh file; {registry.listed(FileKind.MESH)} can be read")
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size)
    known = _known_parts(key)
    if known is not None:
        return known
    parts: tuple[MeshPart, ...] = row.read(path)
    if row.is_whole:
        _parts[key] = tuple((p.name, p.material_name, p.material) for p in parts)
        _meshes.update({(key, p.name): p.mesh for p in parts})
    return parts


def load_mesh(path: str | os.PathLike[str], part: str | None = None) -> Mesh:
    """The mesh of a file, or its part of that name. Raises InputError, also where the file holds several
    meshes and `part` is not given."""
    path = path_of("path", path)
    require("part", part, (str, NoneType), "the name of a part")
    return choose_part(path, load_parts(path), part).mesh


def choose_part(path: Path, parts: tuple[MeshPart, ...], name: str | None) -> MeshPart:
    """The part of that name, or the only one. Raises InputError with the names that there are."""
    if name is None and len(parts) == 1:
        return parts[0]
    for part in parts:
        if part.name == name and name is not None:
            return part
    names = [part.name for part in parts if part.name is not None]
    if not names:
        raise InputError(f"part: {path} holds one mesh without a name; leave `part` out")
    listed = ", ".join(json.dumps(n, ensure_ascii=False) for n in names[:8]) + (
        ", …" if len(names) > 8 else ""
    )
    if name is None:
        raise InputError(f"part: {path} holds {len(names)} meshes; choose one of {listed}")
    close = get_close_matches(name, names, 1)
    hint = f"did you mean {close[0]!r}?" if close else f"choose one of {listed}"
    raise InputError(f"part: {name!r} is not in {path}; {hint}")


def _known_parts(key: FileKey) -> tuple[MeshPart, ...] | None:
    result = []
    for name, material_name, material in _parts.get(key, ()):
        mesh = _meshes.get((key, name))
        if mesh is None:
            return None
        result.append(MeshPart(name, mesh, material_name, material))
    return tuple(result) or None
