"""Mesh files: reads the parts of any file that holds meshes, each file once while it is in use."""

from __future__ import annotations

import json
import os
import weakref
from difflib import get_close_matches
from pathlib import Path

import trimesh

from incpt.core.errors import InputError, in_place
from incpt.core.files import check_readable
from incpt.formats.mesh_store import STORED_SUFFIX, read_stored
from incpt.formats.trimesh_adapter import TRIMESH_SUFFIXES, read_with_trimesh
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.mesh_part import MeshPart

FileKey = tuple[str, int, int]
_meshes: weakref.WeakValueDictionary[tuple[FileKey, str | None], Mesh] = weakref.WeakValueDictionary()
_parts: dict[FileKey, tuple[tuple[str | None, str | None, Material | None], ...]] = {}


def mesh_suffixes() -> tuple[str, ...]:
    """File name suffixes, without the dot, of the mesh files that can be read here."""
    available = trimesh.available_formats()
    return (*(suffix for suffix in TRIMESH_SUFFIXES if suffix in available), STORED_SUFFIX)


def load_mesh(path: str | os.PathLike[str], part: str | None = None) -> Mesh:
    """The mesh of a file, or its part of that name. Raises InputError, also where the file holds several
    meshes and `part` is not given."""
    return choose_part(Path(path), load_parts(path), part).mesh


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


def load_parts(path: str | os.PathLike[str]) -> tuple[MeshPart, ...]:
    """All meshes of a file, placed as the file's nodes say (baked into the vertices, winding turned where
    the placement mirrors), with shading normals only where the file brings them.

    The same file, unchanged, gives the same Mesh objects as long as they are in use. Faces with an index
    out of range, a vertex that is not finite, zero area, or that come twice are left out, with an
    InputWarning. Raises InputError: the file is missing, damaged, of an unknown type, or has no face left.
    """
    path = Path(path)
    suffix = path.suffix[1:].lower()
    status = check_readable(path)
    if suffix not in mesh_suffixes():
        raise InputError(f"{path}: is no mesh file; {readable_types()} can be read")
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size)
    known = _known_parts(key)
    if known is None:
        with in_place(str(path)):
            known = read_stored(path) if suffix == STORED_SUFFIX else read_with_trimesh(path, suffix)
        if suffix != "gltf":  # its vertices are in another file, whose age says nothing here
            _parts[key] = tuple((p.name, p.material_name, p.material) for p in known)
            _meshes.update({(key, p.name): p.mesh for p in known})
    return known


def readable_types() -> str:
    """The suffixes of mesh files as a list for a message."""
    return ", ".join(f".{suffix}" for suffix in mesh_suffixes())


def _known_parts(key: FileKey) -> tuple[MeshPart, ...] | None:
    result = []
    for name, material_name, material in _parts.get(key, ()):
        mesh = _meshes.get((key, name))
        if mesh is None:
            return None
        result.append(MeshPart(name, mesh, material_name, material))
    return tuple(result) or None
