"""The table of file formats: one row makes a format known everywhere."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest
import trimesh

from incpt.core.errors import InputError
from incpt.formats import insert, mesh_files, mesh_store, registry
from incpt.formats.registry import FORMATS, FileKind, Format
from incpt.scene.model import Scene
from incpt.scene.shapes import shape


@pytest.mark.parametrize("row", FORMATS, ids=[row.suffix for row in FORMATS])
def test_every_reader_is_there(row: Format) -> None:
    module, function = row.reader
    assert callable(getattr(import_module(f"incpt.formats.{module}"), function))
    assert row.suffix == row.suffix.lower() and row.suffix.startswith(".")


def test_a_suffix_has_one_row() -> None:
    assert len({row.suffix for row in FORMATS}) == len(FORMATS)


def test_formats_of_trimesh_are_available_where_trimesh_says_so() -> None:
    ours = {row.suffix for row in FORMATS if row.reader[0] == "trimesh_adapter"}
    available = {f".{name}" for name in trimesh.available_formats()}
    assert ours & available == ours & set(registry.suffixes(FileKind.MESH))


def test_a_row_is_all_that_a_format_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cube.TRI"
    mesh_store.store_mesh(path, shape("cube"))
    with pytest.raises(
        InputError, match=r"cannot be read; use a scene \(\.toml, \.xml, \.pbrt\) or a mesh \(\.glb"
    ):
        registry.load(path)
    row = Format(".tri", FileKind.MESH, ("mesh_store", "read_stored"))
    monkeypatch.setattr(registry, "FORMATS", (*FORMATS, row))
    assert registry.suffixes(FileKind.MESH)[-1] == ".tri"
    assert len(mesh_files.load_mesh(path).faces) == 12
    assert [o.name for o in registry.load(path).objects] == ["cube"]
    assert insert.file_kind(path) is FileKind.MESH
    assert insert.drop_file(Scene(), path)[1] == ("cube",)
    with pytest.raises(InputError, match=r"\.npz, \.tri can be read"):
        mesh_files.load_mesh(Path(__file__))


def test_a_format_without_its_library_is_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = Format(".tri", FileKind.MESH, ("mesh_store", "read_stored"), needs=("no_such_library",))
    monkeypatch.setattr(registry, "FORMATS", (*FORMATS, row))
    mesh_store.store_mesh(tmp_path / "cube.tri", shape("cube"))
    assert ".tri" not in registry.suffixes(FileKind.MESH)
    with pytest.raises(InputError, match="cannot be read"):
        registry.load(tmp_path / "cube.tri")
