"""The document: what is saved, what is dirty, and what a crash leaves behind."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from incpt.core.errors import InputError, InputWarning, OutputError
from incpt.formats.import_report import Fate
from incpt.scene import summary
from incpt.scene.change import diff
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.ui.editor.document import Document, collected_warnings, new_scene, scene_path


def edit(document: Document, x: float) -> None:
    document.history.propose(document.scene.with_object("cube", position=(x, 0, 0)), "Move")


def test_a_new_document_is_clean_and_untitled(tmp_path: Path) -> None:
    document = Document.new()
    assert not document.is_dirty and document.path is None and document.title == "untitled"
    assert not summary.scene_problems(document.scene) and document.warnings == ()


def test_the_shipped_scene_is_opened_as_an_untitled_copy() -> None:
    document = Document.example()
    assert document.path is None and document.name == "untitled" and not document.is_dirty
    assert "red cube" in document.scene.object_index and document.warnings == ()


def test_dirty_follows_undo_and_redo(tmp_path: Path) -> None:
    document = Document.new()
    edit(document, 1)
    assert document.is_dirty and document.title == "untitled (edited)"
    document.history.undo()
    assert not document.is_dirty
    document.history.redo()
    written = document.save(tmp_path / "a.toml")
    assert not document.is_dirty and document.title == "a.toml" and document.path == written
    document.history.undo()
    assert document.is_dirty
    edit(document, 1)
    assert not document.is_dirty  # another scene, but an equal one


def test_a_drag_under_way_is_dirty_and_is_settled_by_saving(tmp_path: Path) -> None:
    document = Document.new()
    document.history.propose(document.scene.with_object("cube", position=(9, 0, 0)), "Drag", "gizmo")
    assert document.is_dirty
    document.save(tmp_path / "a.toml")
    assert not document.is_dirty and document.history.before is None and document.history.can_undo


def test_saved_and_opened_again_it_is_the_same(tmp_path: Path) -> None:
    document = Document.new()
    edit(document, 2)
    written = document.save(tmp_path / "place")
    assert written == tmp_path / "place.toml"
    opened = Document.open(written)
    assert opened.scene == document.scene and opened.path == written and not opened.is_dirty
    edit(opened, 3)
    assert opened.save(written) == written and Document.open(written).scene == opened.scene


def test_what_is_no_scene_file_is_refused_and_nothing_changes(tmp_path: Path) -> None:
    document = Document.new()
    edit(document, 1)
    for name in ("a.json", "b.ply", "c.toml.bak", " "):
        with pytest.raises(InputError):
            document.save(tmp_path / name if name.strip() else name)
    with pytest.raises(OutputError):
        document.save(tmp_path / "missing" / "a.toml")
    assert document.is_dirty and document.path is None and not list(tmp_path.iterdir())


def test_paths_are_absolute_and_know_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert scene_path("~/a") == tmp_path / "a.toml"
    monkeypatch.chdir(tmp_path)
    assert scene_path("b.TOML") == tmp_path / "b.TOML"


def test_a_mesh_file_opens_as_an_untitled_scene_and_tells_what_it_lost(tmp_path: Path) -> None:
    path = tmp_path / "tri.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    document = Document.open(path)
    assert document.path is None and document.name == "tri" and not document.is_dirty
    assert len(document.warnings) == 1 and "tri.obj" in document.warnings[0]
    (remark,) = document.report.of(Fate.LEFT_OUT)
    assert document.warnings == (str(remark),) and remark.file == str(path)


def test_a_scene_of_another_renderer_is_saved_as_one_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "room.xml"
    path.write_text('<scene version="3.0.0"><shape type="cube"/><emitter type="constant"/></scene>')
    document = Document.open(path)
    assert (document.path, document.name, document.warnings) == (None, "room", ())
    written = document.save(tmp_path / "room")
    assert written.name == "room.toml"
    assert Document.open(written).scene.objects[0].transform == document.scene.objects[0].transform


def test_what_cannot_be_opened_says_why(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("version = 9\n")
    for name in ("missing.toml", "bad.toml", "x.docx", "\0.toml"):
        with pytest.raises(InputError):
            Document.open(tmp_path / name)


def test_a_mesh_made_in_memory_is_written_beside(tmp_path: Path) -> None:
    document = Document.new()
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    document.history.propose(document.scene.with_object("cube", mesh=mesh), "Mesh")
    written = document.save(tmp_path / "a.toml")
    assert not document.is_dirty
    again = Document.open(written).scene.object("cube").mesh
    assert np.array_equal(again.vertices, mesh.vertices) and len(list(tmp_path.iterdir())) == 2


def test_other_warnings_pass() -> None:
    def warn() -> list[str]:
        with collected_warnings() as messages:
            warnings.warn("old", DeprecationWarning, stacklevel=1)
            for _ in range(2):
                warnings.warn("left out", InputWarning, stacklevel=1)
        return messages

    with pytest.warns(DeprecationWarning, match="old"):
        messages = warn()
    assert messages == ["left out", "left out"]


def test_the_new_scene_shows_its_cube_on_the_floor() -> None:
    scene = new_scene()
    assert diff(Scene(), scene).added == {"floor", "cube"}
    assert scene.object("cube").world_bounds[0][1] == pytest.approx(0)
    assert os.path.basename(scene_path("a")) == "a.toml"


def test_saving_keeps_what_a_person_wrote(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(
        "# mine\nversion = 2\n[environment]\ncolor = [1, 1, 1] # white\n[materials.red]\n"
        '[[objects]]\nname = "cube" # the die\nshape = "cube"\nmaterial = "red"\n'
    )
    text = path.read_text()
    document = Document.open(path)
    document.save(path)
    assert path.read_text() == text
    document.history.propose(document.scene.with_environment(intensity=0.25), "Environment")
    document.save(tmp_path / "b.toml")
    saved = (tmp_path / "b.toml").read_text()
    assert saved == text.replace("# white\n", "# white\nintensity = 0.25\n")
    document.history.propose(document.scene.with_object("cube", position=(1, 2, 3)), "Move")
    document.save(tmp_path / "b.toml")
    assert "# the die" in (tmp_path / "b.toml").read_text() and "# mine" in (tmp_path / "b.toml").read_text()
    assert Document.open(tmp_path / "b.toml").scene == document.scene


@pytest.mark.skipif(sys.platform == "win32", reason="there it is told by age alone")
@pytest.mark.parametrize("act", ["open", "save"])
def test_what_was_left_half_written_goes_when_a_scene_is_opened_or_saved(tmp_path: Path, act: str) -> None:
    path = tmp_path / "a.toml"
    Document.new().save(path)
    left = tmp_path / ".a.cube.0123.npz.99999999-abcdefgh.npz"
    left.write_bytes(b"half")
    os.utime(left, (0, 0))
    if act == "open":
        Document.open(path)
    else:
        Document.new().save(path)
    assert sorted(tmp_path.iterdir()) == [path]
