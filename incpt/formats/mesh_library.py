"""The meshes that a scene file or an edit script names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError, in_place
from incpt.formats import mesh_files
from incpt.formats.toml_kit import text_of
from incpt.scene.mesh import Mesh
from incpt.scene.mesh_part import MeshFile
from incpt.scene.shapes import shape


class MeshLibrary:
    """The meshes that one file names, relative to its folder; each file is read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[str, MeshFile] = {}

    def meshes(self, table: Mapping[str, Any]) -> list[tuple[str | None, Mesh]]:
        """(part, mesh) that the keys `shape`, or `mesh` with `part` or `geometry`, of a table ask for. Raises
        InputError."""
        if ("shape" in table) == ("mesh" in table):
            both = "has both `shape` and `mesh`" if "shape" in table else "has neither `shape` nor `mesh`"
            raise InputError(f"{both}; give it one of them")
        of_files = [key for key in ("part", "geometry") if key in table]
        if "shape" in table:
            if of_files:
                raise InputError(f"{of_files[0]}: belongs to a mesh file; leave it out beside `shape`")
            return [(None, shape(text_of(table, "shape", "name a built-in shape")))]
        name = text_of(table, "mesh", "name a mesh file")
        if len(of_files) == 2:
            raise InputError("has both `part` and `geometry`; give it one of them")
        path = self.folder / name
        if name not in self._files:
            with in_place("mesh"):
                self._files[name] = mesh_files.load_file(path)
        parts = self._files[name].parts
        if "geometry" in table:
            geometry = text_of(table, "geometry", "name a geometry of the mesh file")
            return [(None, mesh_files.choose_geometry(path, parts, geometry))]
        if "part" in table:
            part = text_of(table, "part", "name a part of the mesh file")
            parts = (mesh_files.choose_part(path, parts, part),)
        return [(part.name, mesh_files.placed_part(path, part).mesh) for part in parts]
