"""Autosave, with the time given, and with editors that are really killed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from incpt.core.errors import InputError, OutputError
from incpt.formats import insert
from incpt.formats.images import write_exr
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.ui.editor.document import Document
from incpt.ui.editor.recovery import LeftBehind, Recovery, find_left_behind, recovery_folder

EDITOR = """
import sys
from pathlib import Path
from incpt.ui.editor.document import Document
from incpt.ui.editor.recovery import Recovery

document = Document.open(sys.argv[1])
document.history.propose(document.scene.with_object("tri", position=(1, 2, 3)), "Move")
recovery = Recovery(seconds=10, folder=Path(sys.argv[2]))
assert not recovery.update(document, now=0)
assert recovery.update(document, now=10)
print("written", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "state" / "recovery"


def edit(document: Document, x: float) -> None:
    document.history.propose(document.scene.with_object("cube", position=(x, 0, 0)), "Move")


def project(tmp_path: Path) -> Path:
    """A scene file that names a mesh and an image by relative paths."""
    work = tmp_path / "work"
    (work / "assets").mkdir(parents=True)
    (work / "assets" / "tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    write_exr(work / "assets" / "sky.exr", {"RGB": np.ones((2, 4, 3), np.float32)})
    scene, _ = insert.add_mesh(Scene(), work / "assets" / "tri.obj")
    scene = insert.set_environment_image(scene, work / "assets" / "sky.exr")
    document = Document(scene)
    return document.save(work / "scene.toml")


def test_nothing_is_written_before_it_is_due(folder: Path) -> None:
    document, recovery = Document.new(), Recovery(30, folder)
    assert not recovery.update(document, 1000)
    edit(document, 1)
    assert not recovery.update(document, 1001) and not recovery.update(document, 1030.9)
    assert not folder.exists() and recovery.path is None
    assert recovery.update(document, 1031)
    assert recovery.path is not None and str(os.getpid()) in recovery.path.name
    assert Document.open(recovery.path).scene == document.scene


def test_only_changes_are_written_and_not_too_often(folder: Path) -> None:
    document, recovery = Document.new(), Recovery(30, folder)
    edit(document, 1)
    times = []
    for now in range(200):
        if now == 75:
            edit(document, 2)
        if recovery.update(document, now):
            times.append(now)
    assert times == [30, 75]
    edit(document, 3)
    assert recovery.update(document, 200)
    edit(document, 4)
    assert not recovery.update(document, 229) and recovery.update(document, 230)
    recovery.remove()


def test_a_drag_under_way_is_not_written(folder: Path) -> None:
    document, recovery = Document.new(), Recovery(1, folder)
    document.history.propose(document.scene.with_object("cube", position=(5, 0, 0)), "Drag", "gizmo")
    recovery.update(document, 0)
    assert not recovery.update(document, 5)
    document.history.settle()
    assert recovery.update(document, 5)
    recovery.remove()


def test_saving_removes_the_recovery_file(folder: Path, tmp_path: Path) -> None:
    document, recovery = Document.new(), Recovery(0, folder)
    edit(document, 1)
    assert recovery.update(document, 0)
    document.save(tmp_path / "a.toml")
    assert not recovery.update(document, 1)
    assert recovery.path is None and not list(folder.glob("*.toml"))
    edit(document, 2)
    assert recovery.update(document, 2) and len(list(folder.glob("*.toml"))) == 1
    recovery.remove()


def test_a_clean_end_leaves_nothing(folder: Path) -> None:
    document, recovery = Document.new(), Recovery(0, folder)
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    document.history.propose(document.scene.with_object("cube", mesh=mesh), "Mesh")
    assert recovery.update(document, 0) and len(list(folder.iterdir())) == 3
    recovery.remove()
    assert not list(folder.iterdir())
    recovery.remove()
    Recovery(0, folder).remove()


def test_a_running_editor_is_not_found(folder: Path) -> None:
    assert find_left_behind(folder) == []
    document, recovery = Document.new(), Recovery(0, folder)
    edit(document, 1)
    recovery.update(document, 0)
    assert find_left_behind(folder) == []
    recovery.remove()


def test_a_folder_that_cannot_be_written_is_told_again_only_later(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    document, recovery = Document.new(), Recovery(10, tmp_path / "file" / "recovery")
    edit(document, 1)
    recovery.update(document, 0)
    with pytest.raises(OutputError, match="nothing is autosaved"):
        recovery.update(document, 10)
    assert not recovery.update(document, 19.9)
    with pytest.raises(OutputError):
        recovery.update(document, 20)
    recovery.remove()


def killed_editor(scene: Path, folder: Path) -> int:
    """Runs an editor that autosaves an edit and is killed; returns its process id."""
    process = subprocess.Popen(
        [sys.executable, "-c", EDITOR, str(scene), str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        assert find_left_behind(folder) == []  # it still runs
        process.kill()
    return process.pid


@pytest.mark.slow
def test_what_a_killed_editor_leaves_is_found_and_recovered(folder: Path, tmp_path: Path) -> None:
    scene = project(tmp_path)
    pid = killed_editor(scene, folder)
    (left,) = find_left_behind(folder)
    assert left.original == scene and left.name == "scene.toml" and left.path.name.startswith(f"{pid}-")
    assert left.time == left.path.stat().st_mtime and left.saved_at.startswith("20")
    assert left.open().scene.object("tri").position == (1, 2, 3) and left.path.exists()

    recovery = Recovery(30, folder)
    document = recovery.recover(left)
    before = Document.open(scene).scene
    assert document.is_dirty and document.path == scene
    assert document.scene == before.with_object("tri", position=(1, 2, 3))  # the same mesh and image
    assert find_left_behind(folder) == [] and recovery.path is not None and not left.path.exists()

    document.save(scene)
    recovery.update(document, 1)
    recovery.remove()
    assert Document.open(scene).scene == document.scene and not list(folder.iterdir())


@pytest.mark.slow
def test_what_is_left_may_be_discarded(folder: Path, tmp_path: Path) -> None:
    killed_editor(project(tmp_path), folder)
    (left,) = find_left_behind(folder)
    left.remove()
    assert find_left_behind(folder) == [] and not list(folder.iterdir())


def test_a_damaged_file_is_found_but_stays_when_it_cannot_be_read(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "1-a.lock").touch()
    (folder / "1-a.toml").write_bytes(b"\xff not a scene")
    (folder / "2-b.lock").touch()  # ended before anything was written
    (folder / "3-c.toml").write_text("version = 1\n")  # nobody's
    (left,) = find_left_behind(folder)
    assert left == LeftBehind(folder / "1-a.toml", None, left.time) and left.name == "untitled"
    recovery = Recovery(1, folder)
    with pytest.raises(InputError):
        recovery.recover(left)
    assert left.path.exists() and not (folder / "2-b.lock").exists()
    recovery.remove()


def test_the_folder_is_the_users_or_the_chosen_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INCPT_CONFIG_DIR", str(tmp_path))
    assert recovery_folder() == tmp_path / "recovery"
    monkeypatch.delenv("INCPT_CONFIG_DIR")
    assert recovery_folder().name == "recovery" and recovery_folder().parent.name == "incpt"
