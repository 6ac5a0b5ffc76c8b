"""Meshes made in Python, stored exactly as .npz archives: vertices, faces, and what there is at corners.

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
from incpt.scene.mesh_part import MeshFile, MeshPart
from incpt.scene.texture import UV_SETS

_NAMES = ("vertices", "faces", "normals", *(f"uvs_{i}" for i in range(UV_SETS)), "colors", "tangents")
STORED_SUFFIX = ".npz"
"""Ends the names of files that `store_mesh` writes."""


def store_mesh(path: Path, mesh: Mesh) -> None:
    """Writes a mesh exactly, as .npz, atomically. Raises OutputError."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays(mesh))
    write_bytes(path, content.getvalue())


def digest(mesh: Mesh) -> str:
    """A short text that differs for meshes of different content."""
    result = hashlib.sha256()
    for name, array in arrays(mesh).items():
        result.update(f"{name}{array.shape}".encode() + array.tobytes())
    return result.hexdigest()[:12]


def arrays(mesh: Mesh) -> dict[str, npt.NDArray[Any]]:
    """All that a mesh has, by name."""
    found: dict[str, npt.NDArray[Any] | None] = {
        "vertices": mesh.vertices, "faces": mesh.faces, "normals": mesh.normals,
        **{f"uvs_{number}": uvs for number, uvs in enumerate(mesh.uvs)},
        "colors": mesh.colors, "tangents": mesh.tangents,
    }  # fmt: skip
    return {name: array for name, array in found.items() if array is not None}


def read_stored(path: Path) -> MeshFile:
    """The mesh of an .npz archive, which `store_mesh` wrote, as the only part of the file. Raises
    InputError."""
    try:
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as archive:
            found = {name: archive[name] for name in _NAMES if name in archive}
        uvs = tuple(found[f"uvs_{number}"] for number in range(UV_SETS) if f"uvs_{number}" in found)
        source = MeshSource(file=os.path.abspath(path))
        mesh = Mesh(
            found["vertices"], found["faces"], found.get("normals"), source, uvs, found.get("colors"),
            found.get("tangents"),
        )  # fmt: skip
        return MeshFile((MeshPart(None, mesh),))
    except InputError:
        raise
    except Exception:  # zipfile, zlib and numpy raise errors of many types for damaged files.
        raise InputError("is no mesh archive with `vertices` and `faces`, or a damaged one") from None
