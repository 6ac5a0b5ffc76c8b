"""Meshes made in Python, stored exactly as .npz archives (vertices, faces, normals).

No interchange format keeps normals per corner without splitting vertices.
"""

from __future__ import annotations

import hashlib
import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes, write_bytes
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshPart

STORED_SUFFIX = ".npz"
"""Ends the names of files that `store_mesh` writes."""


def store_mesh(path: Path, mesh: Mesh) -> None:
    """Writes a mesh exactly, as .npz, atomically. Raises OutputError."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **_arrays(mesh))
    write_bytes(path, content.getvalue())


def digest(mesh: Mesh) -> str:
    """A short text that differs for meshes of different content."""
    result = hashlib.sha256()
    for name, array in _arrays(mesh).items():
        result.update(f"{name}{array.shape}".encode() + array.tobytes())
    return result.hexdigest()[:12]


def _arrays(mesh: Mesh) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {"vertices": mesh.vertices, "faces": mesh.faces}
    return arrays if mesh.normals is None else {**arrays, "normals": mesh.normals}


def read_stored(path: Path) -> tuple[MeshPart, ...]:
    """The mesh of an .npz archive, which `store_mesh` wrote, as the only part of the file. Raises
    InputError."""
    try:
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in ("vertices", "faces", "normals") if name in archive}
        vertices, faces, normals = arrays["vertices"], arrays["faces"], arrays.get("normals")
        return (MeshPart(None, Mesh(vertices, faces, normals, MeshSource(file=os.path.abspath(path)))),)
    except InputError:
        raise
    except Exception:  # zipfile, zlib and numpy raise errors of many types for damaged files.
        raise InputError("is no mesh archive with `vertices` and `faces`, or a damaged one") from None
