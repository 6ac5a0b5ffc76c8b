"""The meshes that a scene file or an edit script names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError, in_place
from incpt.formats import mesh_files, placeholders
from incpt.formats.toml_kit import text_of
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile
from incpt.scene.shapes import shape


class MeshLibrary:
    """The meshes that one file names, relative to its folder; each file is read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: dict[str, MeshFile] = {}
        self._placeholders: dict[MeshSource, Mesh] = {}

    def meshes(self, table: Mapping[str, Any]) -> list[tuple[str | None, Mesh]]:
        """(part, mesh) that the keys `shape`, or `mesh` with `part` or `geometry`, of a table ask for. Raises
        InputError. Where a file cannot be read, and options allow it, a placeholder stands for all of
        it."""
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
        texts = {key: text_of(table, key, f"name a {key} of the mesh file") for key in of_files}
        source = MeshSource(file=os.path.abspath(self.folder / name), **texts)
        if source in self._placeholders:
            return [(None, self._placeholders[source])]

        def stand_in() -> list[tuple[str | None, Mesh]]:
            self._placeholders[source] = placeholders.mesh(source)
            return [(None, self._placeholders[source])]

        return placeholders.read_or(lambda: self._of_file(name, source), stand_in, "a cube")

    def _of_file(self, name: str, source: MeshSource) -> list[tuple[str | None, Mesh]]:
        path = self.folder / name
        if name not in self._files:
            with in_place("mesh"):
                self._files[name] = mesh_files.load_file(path)
        parts = self._files[name].parts
        if source.geometry is not None:
            return [(None, mesh_files.choose_geometry(path, parts, source.geometry))]
        if source.part is not None:
            parts = (mesh_files.choose_part(path, parts, source.part),)
        return [(part.name, mesh_files.placed_part(path, part).mesh) for part in parts]
