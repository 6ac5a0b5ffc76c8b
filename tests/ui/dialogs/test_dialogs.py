"""Files and questions: what is asked, what each answer does, and that what fails leaves everything."""

from __future__ import annotations

import os
import shutil
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import trimesh
from support.parameters import A_TEXTURE
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, state

from incpt.core.errors import OutputError
from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps, mesh_files, registry, scene_save
from incpt.scene.selection import Selection
from incpt.ui.commands import camera, files, pictures
from incpt.ui.commands.table import command
from incpt.ui.dialogs import native
from incpt.ui.dialogs.path_dialog import PathDialog
from incpt.ui.dialogs.question import Question
from incpt.ui.dialogs.relink_dialog import RelinkDialog
from incpt.ui.editor import clipboard, job
from incpt.ui.editor.document import Document, new_scene
from incpt.ui.editor.recovery import LeftBehind, Recovery
from incpt.ui.panels import notices, textures
from incpt.viewer.renderer import Export

SCENE = mixed_scene(size=(48, 32)).with_environment(image=None)
OTHER = SCENE.with_camera(fov_y=33)


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(native, "is_there", lambda: False)
    monkeypatch.setenv("INCPT_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


@pytest.fixture
def other(tmp_path: Path) -> Path:
    path = tmp_path / "other.toml"
    scene_save.save(OTHER, path)
    return path


def answer(user: Desk, text: str, end: str = "Enter") -> None:
    """Type a path or a name into the dialog."""
    assert user.editor.dialog is not None
    user.frames(3)
    user.key("Ctrl+A")
    user.write(text)
    user.key(end)
    user.frames(2)


def edit(user: Desk) -> None:
    user.run("Cube")
    assert (
        user.editor.document.is_dirty and user.editor.title == f"{user.editor.document.name} (edited) - incpt"
    )


def choose(user: Desk, label: str) -> None:
    user.frames(3)
    user.click(label)
    user.frames(2)


# ------------------------------------------------------------------------------------------------- opening


def test_a_scene_is_opened_by_its_path(user: Desk, other: Path) -> None:
    user.key("Ctrl+O")
    answer(user, str(other))
    assert user.editor.dialog is None and user.scene == OTHER and user.editor.document.path == other
    assert user.editor.title == "other.toml - incpt" and user.undo_count == 0
    assert user.editor.preferences.recent_files == (other,) and user.null.views[-1].scene == OTHER


def test_a_scene_is_opened_by_clicking_on_it(user: Desk, other: Path, tmp_path: Path) -> None:
    (tmp_path / "sub" / "deep").mkdir(parents=True)
    shutil.copy(other, tmp_path / "sub" / "a.toml")
    (tmp_path / "sub" / "note.txt").write_text("no scene")
    (tmp_path / "sub" / ".hidden.toml").write_text("")
    user.key("Ctrl+O")
    choose(user, "sub/")
    assert user.shows("deep/") and user.shows("a.toml")
    assert not user.shows("note.txt") and not user.shows(".hidden.toml") and not user.shows("other.toml")
    choose(user, "../")
    assert user.shows("other.toml")
    choose(user, "sub/")
    choose(user, "a.toml")
    choose(user, "Open")
    assert user.scene == OTHER and user.editor.document.path == tmp_path / "sub" / "a.toml"


def test_a_scene_is_opened_by_a_double_click(user: Desk, other: Path, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    user.key("Ctrl+O")
    user.frames(3)
    user.open_field("sub/")
    user.frames(2)
    assert isinstance(user.editor.dialog, PathDialog), "a folder is entered"
    choose(user, "../")
    user.open_field("other.toml")
    user.frames(2)
    assert user.editor.dialog is None and user.scene == OTHER and user.editor.document.path == other


@pytest.mark.slow
@pytest.mark.parametrize(
    "typed", ["missing.toml", "bad.toml", "x.docx", "~nobody-of-that-name/a.toml", "", " "]
)
def test_a_path_that_is_refused_is_asked_for_again(
    user: Desk, tmp_path: Path, typed: str, other: Path
) -> None:
    (tmp_path / "bad.toml").write_text("version = 9\n")
    user.key("Ctrl+O")
    before = state(user.editor)
    answer(user, typed)
    assert changes(before, state(user.editor)) == {"notices"} and len(user.texts()) == 1
    assert isinstance(user.editor.dialog, PathDialog)
    answer(user, str(other))
    assert user.editor.dialog is None and user.scene == OTHER


def test_a_folder_is_no_file_but_is_gone_into(user: Desk, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for keys in ("Ctrl+O", "Ctrl+Shift+S"):
        user.key(keys)
        answer(user, str(tmp_path / "sub"))
        dialog = user.editor.dialog
        assert isinstance(dialog, PathDialog) and dialog.text == f"{tmp_path}/sub/"
        assert "is a folder" in user.texts()[-1]
        user.key("Escape")
        assert user.editor.dialog is None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sub"] and user.scene is SCENE


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="may enter every folder")
def test_folders_that_may_not_be_entered_do_no_harm(user: Desk, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o400)
    user.key("Ctrl+O")
    choose(user, "locked/")
    assert user.editor.dialog is not None


def test_cancel_and_escape_leave_everything(user: Desk, other: Path) -> None:
    before = state(user.editor)
    for leave in ("Escape", "Cancel"):
        user.key("Ctrl+O")
        user.frames(3)
        user.key("Ctrl+A")
        user.write(str(other))
        user.key("Escape") if leave == "Escape" else choose(user, "Cancel")
        user.frames(2)
        if user.editor.dialog is not None:
            user.key("Escape")
        assert changes(before, state(user.editor)) == set()


def test_a_mesh_is_opened_as_an_untitled_scene_and_tells_what_it_lost(user: Desk, tmp_path: Path) -> None:
    (tmp_path / "tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    user.key("Ctrl+O")
    answer(user, "tri.obj")
    assert user.editor.document.path is None and user.editor.document.name == "tri"
    assert len(user.texts()) == 1 and "tri.obj" in user.texts()[0]
    assert user.editor.preferences.recent_files == (tmp_path / "tri.obj",)


def test_a_recent_file_is_opened_from_the_menu(user: Desk, other: Path) -> None:
    user.editor.preferences = user.editor.preferences.with_recent(other).with_recent(
        other.with_name("gone.toml")
    )
    assert user.editor.preferences.recent_files == (other,)
    files.open_file(user.editor, other)
    assert user.scene == OTHER


def test_a_recent_file_that_is_broken_is_a_message(user: Desk, other: Path) -> None:
    user.editor.preferences = user.editor.preferences.with_recent(other)
    other.write_text("version = 9\n")
    user.click("menu File")
    user.move(*user.place("menu File/Open recent"))
    user.frames(10)
    user.click("recent other.toml")
    assert user.scene is SCENE and len(user.texts()) == 1 and "other.toml" in user.texts()[0]


def test_a_new_scene(user: Desk) -> None:
    user.key("Ctrl+N")
    assert user.scene == new_scene() and user.editor.title == "untitled - incpt" and user.undo_count == 0


# -------------------------------------------------------------------------------------------------- saving


def test_save_asks_for_a_place_once(user: Desk, tmp_path: Path) -> None:
    edit(user)
    user.key("Ctrl+S")
    assert isinstance(user.editor.dialog, PathDialog) and user.editor.dialog.text == f"{tmp_path}/test.toml"
    answer(user, "mine")
    written = tmp_path / "mine.toml"
    assert user.editor.dialog is None and registry.load(written) == user.scene
    assert not user.editor.document.is_dirty and user.editor.title == "mine.toml - incpt"
    assert user.texts() == [f"{written} is saved"] and user.editor.preferences.recent_files == (written,)
    edit(user)
    user.key("Ctrl+S")
    assert user.editor.dialog is None and registry.load(written) == user.scene
    assert user.undo_count == 2
    user.key("Ctrl+Z")
    assert user.editor.document.is_dirty


def test_a_file_is_replaced_only_when_told_so(user: Desk, other: Path) -> None:
    user.key("Ctrl+Shift+S")
    answer(user, "other")
    assert isinstance(user.editor.dialog, Question) and registry.load(other) == OTHER
    choose(user, "Cancel")
    assert isinstance(user.editor.dialog, PathDialog) and registry.load(other) == OTHER
    answer(user, "other")
    choose(user, "Replace")
    assert user.editor.dialog is None and registry.load(other) == SCENE
    assert user.editor.document.path == other


def test_where_replacing_fails_the_place_is_asked_for_again(
    user: Desk, other: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(scene_save, "save", fail)
    user.key("Ctrl+Shift+S")
    answer(user, "other")
    choose(user, "Replace")
    assert isinstance(user.editor.dialog, PathDialog) and user.texts() == ["the disk is full"]
    assert registry.load(other) == OTHER


@pytest.mark.parametrize("typed", ["a.json", "missing/a.toml", "a.ply"])
def test_a_place_that_is_refused_is_asked_for_again(user: Desk, tmp_path: Path, typed: str) -> None:
    edit(user)
    scene = user.scene
    user.key("Ctrl+S")
    answer(user, typed)
    assert isinstance(user.editor.dialog, PathDialog) and len(user.texts()) == 1
    assert user.scene is scene and user.editor.document.is_dirty and not list(tmp_path.iterdir())
    answer(user, "good.toml")
    assert not user.editor.document.is_dirty and (tmp_path / "good.toml").exists()


def test_a_drag_under_way_is_saved_as_one_entry(user: Desk, tmp_path: Path) -> None:
    files.save_to(user.editor, tmp_path / "a.toml")
    user.editor.select(Selection(("lamp",)))
    user.frames(2)
    user.hold_at(user.place("Position X"), (40, 0))
    user.key("Ctrl+S")
    assert registry.load(tmp_path / "a.toml") == user.scene != SCENE
    user.release()
    user.frames(2)
    assert not user.editor.document.is_dirty and user.undo_count == 1


# ----------------------------------------------------------------------------------------- unsaved changes


def leave(user: Desk, how: str, other: Path) -> None:
    if how == "drop":
        user.editor.attempt(lambda: files.drop(user.editor, other))
    elif how == "recent":
        files.open_file(user.editor, other)
    else:
        user.key(how)
    user.frames(3)


def has_left(user: Desk, how: str) -> bool:
    if how == "Ctrl+Q":
        return user.editor.screen.is_closing
    if how == "Ctrl+O":
        return isinstance(user.editor.dialog, PathDialog)
    return user.scene == (new_scene() if how == "Ctrl+N" else OTHER)


WAYS = ["Ctrl+N", "Ctrl+O", "Ctrl+Q", "drop", "recent"]


@pytest.mark.parametrize("how", WAYS)
def test_nothing_is_asked_where_all_is_saved(user: Desk, how: str, other: Path) -> None:
    leave(user, how, other)
    assert has_left(user, how)


@pytest.mark.parametrize("how", WAYS)
@pytest.mark.parametrize("cancel", ["Cancel", "Escape"])
def test_cancel_keeps_the_changes(user: Desk, how: str, cancel: str, other: Path) -> None:
    edit(user)
    before = state(user.editor)
    leave(user, how, other)
    assert isinstance(user.editor.dialog, Question) and not has_left(user, how)
    user.key("Escape") if cancel == "Escape" else choose(user, "Cancel")
    assert user.editor.dialog is None and changes(before, state(user.editor)) == set()


@pytest.mark.parametrize("how", WAYS)
def test_changes_are_thrown_away_when_told_so(user: Desk, how: str, other: Path) -> None:
    edit(user)
    leave(user, how, other)
    choose(user, "Do not save")
    assert has_left(user, how)


@pytest.mark.parametrize("how", WAYS)
def test_changes_are_saved_first(user: Desk, how: str, other: Path, tmp_path: Path) -> None:
    files.save_to(user.editor, tmp_path / "mine.toml")
    edit(user)
    scene = user.scene
    leave(user, how, other)
    choose(user, "Save")
    assert has_left(user, how) and registry.load(tmp_path / "mine.toml") == scene


@pytest.mark.parametrize("how", WAYS)
def test_an_untitled_scene_gets_a_place_first(user: Desk, how: str, other: Path, tmp_path: Path) -> None:
    edit(user)
    scene = user.scene
    leave(user, how, other)
    choose(user, "Save")
    assert isinstance(user.editor.dialog, PathDialog) and user.editor.dialog.is_saving
    answer(user, "mine")
    assert registry.load(tmp_path / "mine.toml") == scene and has_left(user, how)


def test_giving_up_the_place_gives_up_leaving(user: Desk, tmp_path: Path) -> None:
    edit(user)
    scene = user.scene
    user.key("Ctrl+Q")
    choose(user, "Save")
    answer(user, "x", end="Escape")
    if user.editor.dialog is not None:
        user.key("Escape")
    assert user.editor.dialog is None and not user.editor.screen.is_closing and user.scene is scene


def test_what_cannot_be_saved_is_not_left(
    user: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.save_to(user.editor, tmp_path / "mine.toml")
    edit(user)

    def fail(*_: object, **__: object) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(scene_save, "save", fail)
    user.key("Ctrl+Q")
    choose(user, "Save")
    assert not user.editor.screen.is_closing and user.editor.document.is_dirty
    assert "the disk is full" in user.texts()


def test_enter_takes_the_first_answer(user: Desk, tmp_path: Path) -> None:
    files.save_to(user.editor, tmp_path / "mine.toml")
    edit(user)
    user.key("Ctrl+Q")
    user.frames(3)
    user.key("Enter")
    assert user.editor.screen.is_closing and registry.load(tmp_path / "mine.toml") == user.scene


# ---------------------------------------------------------------------------------------- dropped, imported


def test_a_dropped_mesh_is_added_and_selected(user: Desk, tmp_path: Path) -> None:
    path = tmp_path / "tri.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    assert user.editor.attempt(lambda: files.drop(user.editor, path))
    assert user.editor.selection.names == ("tri",) and user.undo_count == 1
    assert len(user.texts()) == 1 and "tri.obj" in user.texts()[0]
    user.key("Ctrl+Z")
    assert user.scene == SCENE and not user.editor.selection
    user.run("Import mesh…")
    answer(user, "tri.obj")
    assert user.editor.selection.names == ("tri",)


def test_a_scene_is_handed_to_others(user: Desk, tmp_path: Path) -> None:
    user.run("Export glTF…")
    answer(user, "other")
    assert any(text.endswith("other.glb is written") for text in user.texts())
    assert len(user.texts()) > 1, "what glTF cannot hold is said"
    names = {obj.name for obj in registry.load(tmp_path / "other.glb").objects}
    assert {f"other/{obj.name}" for obj in user.scene.objects} <= names
    user.run("Pack…")
    answer(user, "all")
    assert any(text.endswith("all.zip is written") for text in user.texts())
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        assert "all/scene.toml" in archive.namelist()


def test_a_dropped_image_lights_the_scene(user: Desk, tmp_path: Path) -> None:
    path = tmp_path / "sky.exr"
    pixels = np.full((4, 8, 3), 0.5, np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": pixels}).write(str(path))
    user.editor.select(Selection(("lamp",)))
    assert user.editor.attempt(lambda: files.drop(user.editor, path))
    assert user.scene.environment.image is not None and user.editor.selection.names == ("lamp",)
    assert all(place.startswith("environment.") for place in changes(flat(SCENE), flat(user.scene)))
    user.key("Ctrl+Z")
    assert user.scene == SCENE
    user.panel("Scene")
    user.click("Choose…##image")
    answer(user, "sky.exr")
    assert user.scene.environment.image is not None and user.undo_count == 1


def test_an_image_dropped_on_a_slot_is_its_texture(user: Desk, tmp_path: Path) -> None:
    """Also one that would be an environment elsewhere; what is no image is told, and nothing is lost."""
    bitmaps.write_bitmap(tmp_path / "wood.png", A_TEXTURE.bitmap)
    user.editor.select(Selection(("red cube",)))
    user.panel("Object")
    user.frames(2)
    user.click("Textures")
    user.frames(2)
    x, y = user.place("Choose…##normal_texture")
    for across in (0, -80):
        assert textures.slot_at(x + across, y) == ("red", TextureSlot.NORMAL)
    assert textures.slot_at(*user.place("picture")) is None
    slot = textures.slot_at(*user.place("Choose…##base_color_texture"))
    assert user.editor.attempt(lambda: files.drop(user.editor, tmp_path / "wood.png", slot))
    texture = user.scene.materials["red"].base_color_texture
    assert texture is not None and texture.bitmap.source.file == str(tmp_path / "wood.png")
    assert user.undo_count == 1
    (tmp_path / "a.txt").write_text("no image")
    before = user.scene
    assert not user.editor.attempt(lambda: files.drop(user.editor, tmp_path / "a.txt", slot))
    assert user.scene == before and "a.txt" in user.texts()[0]


@pytest.mark.parametrize("name", ["a.docx", "a", "broken.obj", "broken.exr", "broken.toml", "gone.obj"])
def test_what_cannot_be_used_is_a_message(user: Desk, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if "gone" not in name:
        path.write_bytes(b"\x00garbage")
    before, views = state(user.editor), len(user.null.views)
    assert not user.editor.attempt(lambda: files.drop(user.editor, path))
    user.frames(2)
    assert changes(before, state(user.editor)) == {"notices"} and name in user.texts()[0]
    assert all(view.scene is SCENE for view in user.null.views[views:]) and user.undo_count == 0


# ----------------------------------------------------------------------------------------------- pictures


def test_the_picture_is_exported_to_the_path(user: Desk, tmp_path: Path) -> None:
    pictures.export_picture(user.editor)
    user.frames(2)
    assert isinstance(user.editor.dialog, PathDialog) and user.editor.dialog.text == f"{tmp_path}/test.png"
    answer(user, "a.gif")
    assert isinstance(user.editor.dialog, PathDialog) and not user.null.requests
    answer(user, "a.exr")
    assert user.null.requests == [Export(tmp_path / "a.exr", True, 0.0, "agx")]
    (tmp_path / "b.png").write_bytes(b"")
    pictures.export_picture(user.editor)
    answer(user, "b.png")
    assert isinstance(user.editor.dialog, Question) and len(user.null.requests) == 1
    choose(user, "Replace")
    assert len(user.null.requests) == 2


def test_a_clipboard_that_fails_is_a_message(user: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not user.editor.attempt(lambda: clipboard.copy_picture(np.zeros((2, 2, 3), np.uint8)))
    assert len(user.texts()) == 1 and "clipboard" in user.texts()[0]


# ------------------------------------------------------------------------------------------ names, recovery


def test_a_name_is_asked_for_until_it_is_good(user: Desk) -> None:
    user.run("New camera")
    camera.rename_camera(user.editor)
    answer(user, "camera")
    assert user.editor.dialog is not None and user.scene.camera_name == "camera.001"
    answer(user, "top")
    assert user.editor.dialog is None and user.scene.camera_name == "top" and user.undo_count == 2


@pytest.fixture
def crashed(tmp_path: Path) -> Path:
    """A recovery file whose editor is gone, of a scene with a file."""
    lost = Recovery(1.0)
    lost.write(OTHER, tmp_path / "mine.toml")
    assert lost.path is not None and lost._lock is not None
    lost._lock.close()
    return lost.path


def test_nothing_is_asked_after_a_clean_end(user: Desk) -> None:
    files.offer_recovery(user.editor, Recovery(1.0))
    assert user.editor.dialog is None


@pytest.mark.parametrize("choice", ["Recover", "Discard", "Later"])
def test_what_a_crash_left_is_offered(user: Desk, crashed: Path, tmp_path: Path, choice: str) -> None:
    kept = Recovery(1.0)
    files.offer_recovery(user.editor, kept)
    assert isinstance(user.editor.dialog, Question) and "mine.toml" in user.editor.dialog.text
    choose(user, choice)
    assert user.editor.dialog is None and crashed.exists() == (choice == "Later")
    assert user.scene == (OTHER if choice == "Recover" else SCENE)
    assert (kept.path is not None and kept.path.exists()) == (choice == "Recover")
    if choice == "Recover":
        assert user.editor.document.is_dirty and user.editor.document.path == tmp_path / "mine.toml"
    kept.remove()


def test_a_recovery_file_that_is_broken_stays_and_is_a_message(user: Desk, crashed: Path) -> None:
    crashed.write_text("version = 9\n")
    kept = Recovery(1.0)
    files.offer_recovery(user.editor, kept)
    choose(user, "Recover")
    assert user.scene is SCENE and crashed.exists() and len(user.texts()) == 1
    kept.remove()


# ------------------------------------------------------------------------------------------ native dialogs


class Native:
    """The system's dialog, answered after some frames."""

    def __init__(self, answer: object, frames: int = 3) -> None:
        self.answer, self.frames_left = answer, frames

    def ready(self, _timeout: int) -> bool:
        self.frames_left -= 1
        return self.frames_left < 0

    def result(self) -> object:
        return self.answer


@pytest.mark.parametrize("as_list", [True, False])
def test_the_systems_own_dialog_is_used_where_there_is_one(
    user: Desk, other: Path, monkeypatch: pytest.MonkeyPatch, as_list: bool
) -> None:
    monkeypatch.setattr(native, "is_there", lambda: True)
    answers: list[object] = [[], "", [str(other)] if as_list else str(other)]
    monkeypatch.setattr(native.portable_file_dialogs, "open_file", lambda *_: Native(answers.pop(0)))
    for _ in range(2):
        user.key("Ctrl+O")
        user.frames(5)
        assert user.editor.dialog is None and user.scene is SCENE and user.texts() == []
    user.key("Ctrl+O")
    user.frames(5)
    assert user.editor.dialog is None and user.scene == OTHER


def test_the_picture_takes_no_click_while_the_systems_dialog_is_open(
    user: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(native, "is_there", lambda: True)
    monkeypatch.setattr(native.portable_file_dialogs, "open_file", lambda *_: Native("", frames=100))
    user.key("Ctrl+O")
    user.click_at(*user.at_picture(0.5, 0.5))
    assert user.editor.dialog is not None and not user.null.requests
    user.frames(100)
    user.click_at(*user.at_picture(0.5, 0.5))
    assert user.editor.dialog is None and len(user.null.requests) == 1


# ------------------------------------------------------------------------------------------- missing files


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    """A scene file whose two images lie elsewhere."""
    (tmp_path / "elsewhere").mkdir()
    for name in ("wood", "tiles"):
        bitmaps.write_bitmap(tmp_path / "elsewhere" / f"{name}.png", A_TEXTURE.bitmap)
    path = tmp_path / "torn.toml"
    path.write_text(
        'version = 2\n[materials.wood]\nbase_color_texture = "wood.png"\n[materials.tiles]\n'
        'base_color_texture = "tiles.png"\n[[objects]]\nname = "pot"\nmesh = "pot.glb"\nmaterial = "wood"\n'
    )
    return path


def test_files_that_are_missing_are_asked_for_and_found_together(user: Desk, torn: Path) -> None:
    user.key("Ctrl+O")
    answer(user, str(torn))
    assert isinstance(user.editor.dialog, RelinkDialog) and not user.editor.document.is_dirty
    assert [one.path.name for one in user.editor.dialog.missing] == ["pot.glb", "wood.png", "tiles.png"]
    choose(user, "Choose…##tiles.png")
    assert isinstance(user.editor.dialog, PathDialog)
    answer(user, str(torn.parent / "elsewhere" / "nothing.png"))
    assert isinstance(user.editor.dialog, PathDialog) and "no such file" in user.texts()[-1]
    answer(user, str(torn.parent / "elsewhere" / "tiles.png"))
    assert user.texts()[-1] == "2 files are found, 1 missing" and user.undo_count == 1
    assert isinstance(user.editor.dialog, RelinkDialog)
    assert [one.path.name for one in user.editor.dialog.missing] == ["pot.glb"]
    choose(user, "Close")
    assert user.editor.dialog is None
    user.run("Find missing files…")
    assert isinstance(user.editor.dialog, RelinkDialog)
    user.key("Escape")
    user.editor.attempt(lambda: files.save(user.editor))
    saved = torn.read_text()
    assert '"elsewhere/wood.png"' in saved and '"pot.glb"' in saved


def test_a_whole_scene_asks_for_no_files(user: Desk, other: Path) -> None:
    files.open_file(user.editor, other)
    assert user.editor.dialog is None
    assert not command("Find missing files…").is_enabled(user.editor)


def test_what_a_crash_left_is_opened_though_a_file_is_gone(user: Desk, torn: Path, tmp_path: Path) -> None:
    document = Document.open(torn)
    crashed = Recovery(1.0, tmp_path / "kept")
    crashed.write(document.scene, torn)
    left = LeftBehind(crashed.path or tmp_path, torn, 0.0)
    files.start_over(user.editor, Recovery(1.0, tmp_path / "kept").recover(left))
    assert isinstance(user.editor.dialog, RelinkDialog) and len(user.editor.dialog.missing) == 3
    assert user.editor.document.path == torn and user.editor.document.is_dirty


# ------------------------------------------------------------------------------------ read in the background


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Holds up all reading until it is set; nothing is waited for."""
    opened = threading.Event()
    monkeypatch.setattr(job, "QUICK_SECONDS", 0.0)
    for owner, name in ((mesh_files, "load_file"), (registry, "load_with_report")):
        read = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *a, _read=read, **k: (opened.wait(30), _read(*a, **k))[1])
    return opened


def come_to_an_end(user: Desk) -> None:
    for one in user.editor.jobs:
        assert one.wait(30)
    user.frames(3)


def test_a_mesh_is_read_while_the_window_goes_on(user: Desk, tmp_path: Path, gate: threading.Event) -> None:
    trimesh.creation.box().export(tmp_path / "box.ply")
    files.drop(user.editor, tmp_path / "box.ply")
    user.frames(3)
    assert user.shows("job 0") and user.editor.is_waiting and user.undo_count == 0
    user.run("Cube")
    gate.set()
    come_to_an_end(user)
    assert not user.shows("job 0") and user.editor.selection.names == ("box",) and user.undo_count == 2
    user.key("Ctrl+Z")
    assert "cube" in user.scene.object_index and "box" not in user.scene.object_index


def test_how_far_reading_is_is_shown(user: Desk, tmp_path: Path, gate: threading.Event) -> None:
    """The bar of a job whose reader has told it stands still; before, it runs to and fro."""
    trimesh.creation.box().export(tmp_path / "box.glb")
    files.drop(user.editor, tmp_path / "box.glb")
    (begun,) = user.editor.jobs
    assert begun.share is None
    shown: list[float] = []
    bar = notices.imgui.progress_bar
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            notices.imgui, "progress_bar", lambda share, *rest: (shown.append(share), bar(share, *rest))[1]
        )
        user.frames(2)
        begun._note(0.25)
        user.frames(2)
    assert shown[0] < 0 and shown[-1] == 0.25
    gate.set()
    come_to_an_end(user)
    assert begun.share == 0


def test_reading_is_given_up(user: Desk, tmp_path: Path, gate: threading.Event) -> None:
    trimesh.creation.box().export(tmp_path / "box.ply")
    files.drop(user.editor, tmp_path / "box.ply")
    (begun,) = user.editor.jobs
    user.frames(3)
    user.click("Give up##job")
    gate.set()
    assert begun.wait(30) and user.editor.jobs == ()
    user.frames(3)
    assert user.scene is SCENE and user.texts() == []


def test_what_cannot_be_read_is_said_when_that_is_known(
    user: Desk, tmp_path: Path, gate: threading.Event
) -> None:
    (tmp_path / "broken.ply").write_text("no mesh")
    files.drop(user.editor, tmp_path / "broken.ply")
    assert user.texts() == []
    gate.set()
    come_to_an_end(user)
    assert "broken.ply" in user.texts()[-1] and user.scene is SCENE


def test_what_was_edited_while_a_scene_was_read_is_not_lost(
    user: Desk, other: Path, gate: threading.Event
) -> None:
    files.open_file(user.editor, other)
    user.run("Cube")
    gate.set()
    come_to_an_end(user)
    assert isinstance(user.editor.dialog, Question) and "cube" in user.scene.object_index
    choose(user, "Do not save")
    assert user.scene == OTHER and user.editor.document.path == other
