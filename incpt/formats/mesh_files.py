"""Mesh files: reads the parts of any file that holds meshes, each file once while it is in use."""

from __future__ import annotations

import json
import os
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from types import NoneType
from typing import cast

import numpy as np

from incpt.core.checks import path_of, require
from incpt.core.errors import InputError
from incpt.core.files import check_readable
from incpt.formats import import_report, registry
from incpt.formats.import_options import ImportOptions, current_options
from incpt.formats.import_report import Remark
from incpt.formats.placement import placed_mesh
from incpt.formats.registry import FileKind
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.transform import IDENTITY

FileStamp = tuple[str, int, int]
"""Real path, time of the last change in nanoseconds, and size: a file with the same stamp is unchanged."""
FileKey = tuple[FileStamp, ImportOptions]


@dataclass(frozen=True)
class _Known:
    """What a file gave when it was read, without its meshes, which live as long as somebody uses them."""

    file: MeshFile
    beside: tuple[FileStamp, ...]
    remarks: tuple[Remark, ...]
    meshes: tuple[weakref.ref[Mesh], ...]

    def is_unchanged(self) -> bool:
        """Whether the files beside the file are as they were."""
        return all(_stamp(Path(stamp[0])) == stamp for stamp in self.beside)

    def revived(self) -> MeshFile | None:
        """What the file gave; None where a mesh of it is no longer in use."""
        meshes = [mesh() for mesh in self.meshes]
        parts = [replace(p, mesh=m) for p, m in zip(self.file.parts, meshes, strict=True) if m is not None]
        return replace(self.file, parts=tuple(parts)) if len(parts) == len(meshes) else None


_files: dict[FileKey, _Known] = {}
_placed: weakref.WeakValueDictionary[tuple[FileKey, str | None], Mesh] = weakref.WeakValueDictionary()
"""Parts by name, with their placement in the vertices."""
_NO_MESH = Mesh(np.zeros((3, 3), np.float32), np.zeros((1, 3), np.int32))
"""Stands for the meshes of `_Known`."""


def load_file(path: str | os.PathLike[str]) -> MeshFile:
    """All that a mesh file gives. Shading normals are there only where the file brings them.

    The same file, unchanged, gives the same Mesh objects as long as they are in use. What is left out is
    told, see `import_report`: also faces with an index out of range, a vertex that is not finite, zero area,
    or that come twice. Raises InputError: the file is missing, damaged, of an unknown type, or has no face
    left.
    """
    path = path_of("path", path)
    known = _known(path)
    found = None if known is None else known.revived()
    if known is not None and found is not None:
        import_report.tell(*known.remarks)
        return found
    row = registry.format_of(path, FileKind.MESH)
    if row is None:
        raise InputError(f"{path}: is no mesh file; {registry.listed(FileKind.MESH)} can be read")
    with import_report.gathered() as told:
        found = cast(MeshFile, row.read(path))
    import_report.tell(*told.report.remarks)
    _forget_other_times(_key(path))
    _files[_key(path)] = _Known(
        replace(found, parts=tuple(replace(part, mesh=_NO_MESH) for part in found.parts)),
        tuple(_stamp(file) for file in found.files),
        told.report.remarks,
        tuple(weakref.ref(part.mesh) for part in found.parts),
    )
    return found


def _forget_other_times(key: FileKey) -> None:
    """Frees what is known of a file at other times, of which a sequence of pictures has thousands."""
    stamp, options = key
    for other in [known for known in _files if known[0] == stamp]:
        if other[1].time not in (None, options.time):
            del _files[other]


def _known(path: Path) -> _Known | None:
    """What was read of a file before, if it and the files beside it are unchanged. Raises InputError where
    the file cannot be read."""
    check_readable(path)
    key = _key(path)
    known = _files.get(key)
    if known is None or known.is_unchanged():
        return known
    del _files[key]
    for part in known.file.parts:
        _placed.pop((key, part.name), None)
    return None


def load_parts(path: str | os.PathLike[str]) -> tuple[MeshPart, ...]:
    """All meshes of a file as its nodes place them: baked into the vertices, winding turned where the
    placement mirrors. See `load_file`. Raises InputError."""
    path = path_of("path", path)
    return tuple(placed_part(path, part) for part in load_file(path).parts)


def load_mesh(path: str | os.PathLike[str], part: str | None = None) -> Mesh:
    """The mesh of a file, or its part of that name, as the file places it. Raises InputError, also where the
    file holds several meshes and `part` is not given."""
    path = path_of("path", path)
    require("part", part, (str, NoneType), "the name of a part")
    known = _known(path)
    if known is not None:
        mesh = _placed.get((_key(path), choose_part(path, known.file.parts, part).name))
        if mesh is not None:
            import_report.tell(*known.remarks)
            return mesh
    return placed_part(path, choose_part(path, load_file(path).parts, part)).mesh


def placed_part(path: Path, part: MeshPart) -> MeshPart:
    """A part of that file with its placement in the vertices: the same mesh as long as that is in use."""
    key = (_key(path), part.name)
    mesh = part.mesh if part.transform == IDENTITY else _placed.get(key)
    if mesh is None:
        source = MeshSource(file=part.mesh.source.file, part=part.name)
        mesh = placed_mesh(part.mesh, part.transform.world_from_object, source)
    _placed[key] = mesh
    return replace(part, mesh=mesh, transform=IDENTITY)


def choose_geometry(path: Path, parts: tuple[MeshPart, ...], name: str) -> Mesh:
    """The mesh that the file has under that name in its own space. Raises InputError with the names that
    there are."""
    found = {part.mesh.source.geometry: part.mesh for part in parts}
    if name in found:
        return found[name]
    names = [one for one in found if one is not None]
    if not names:
        raise InputError(f"geometry: {path} shows none but its parts; name one by `part`")
    raise InputError(f"geometry: {name!r} is not in {path}; {_hint(name, names)}")


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
    if name is None:
        raise InputError(f"part: {path} holds {len(names)} meshes; choose one of {_listed(names)}")
    raise InputError(f"part: {name!r} is not in {path}; {_hint(name, names)}")


def _hint(name: str, names: Sequence[str]) -> str:
    close = get_close_matches(name, names, 1)
    return f"did you mean {close[0]!r}?" if close else f"choose one of {_listed(names)}"


def _listed(names: Sequence[str]) -> str:
    more = ", …" if len(names) > 8 else ""
    return ", ".join(json.dumps(name, ensure_ascii=False) for name in names[:8]) + more


def _key(path: Path) -> FileKey:
    return _stamp(path), current_options()


def _stamp(path: Path) -> FileStamp:
    real = os.path.realpath(path)
    try:
        status = os.stat(real)
    except OSError:  # It was there when it was read, and is gone.
        return real, 0, 0
    return real, status.st_mtime_ns, status.st_size
