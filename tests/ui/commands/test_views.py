"""Saved views: kept beside the scene file, gone to without an edit, and never in the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.formats import scene_save
from incpt.scene.camera import Camera
from incpt.ui import preferences, saved_views
from incpt.ui.commands import files, views
from incpt.ui.editor.document import Document

SCENE = mixed_scene(size=(48, 32)).with_environment(image=None)
ASIDE = Camera((5.0, 3.0, 1.0), (1.0, 0.5, 0.0), focal_length=35.0, blades=5, projection="orthographic")
BELOW = Camera((0.0, 0.1, 4.0), (0.0, 1.0, 0.0))


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(preferences.CONFIG_DIR, str(tmp_path / "config"))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def save_two(user: Desk) -> None:
    for camera in (ASIDE, BELOW):
        user.editor.look(camera, "Orbit")
        user.run("Save view")


def test_views_are_gone_to_one_after_the_other_without_an_edit(user: Desk) -> None:
    assert not views.has_saved(user.editor)
    save_two(user)
    assert list(user.editor.viewing.saved) == ["View 1", "View 2"]
    user.run("Through the camera")
    for expected in (ASIDE, BELOW, ASIDE):
        user.key("Shift+B")
        assert user.editor.shown.camera == expected
    assert user.scene is SCENE and user.undo_count == 0
    user.panel("Scene")
    user.choose("Saved view", "View 2")
    assert user.editor.shown.camera == BELOW and user.editor.viewing.last_saved == "View 2"


def test_they_are_renamed_and_deleted(user: Desk) -> None:
    save_two(user)
    user.panel("Scene")
    for typed, names in (
        ("", ["View 1", "View 2"]),
        ("View 1", ["View 1", "View 2"]),
        ("low", ["View 1", "low"]),
    ):
        user.click("Rename…##views")
        user.frames(3)
        user.key("Ctrl+A")
        if typed:
            user.write(typed)
        else:
            user.key("Delete")
        user.key("Enter")
        user.frames(2)
        assert list(user.editor.viewing.saved) == names
        if user.editor.dialog is not None:
            user.key("Escape")
            user.frames(2)
    user.click("Delete##views")
    assert dict(user.editor.viewing.saved) == {"View 1": ASIDE}
    user.run("Save view")
    assert list(user.editor.viewing.saved) == ["View 1", "View 2"]


def test_they_are_there_again_when_the_file_is_opened(user: Desk, tmp_path: Path) -> None:
    save_two(user)
    files.save_to(user.editor, tmp_path / "a.toml")
    user.run("Save view")
    scene_save.save(SCENE, tmp_path / "b.toml")
    files.start_over(user.editor, Document.open(tmp_path / "b.toml"))
    assert not user.editor.viewing.saved
    files.start_over(user.editor, Document.open(tmp_path / "a.toml"))
    assert dict(user.editor.viewing.saved) == {"View 1": ASIDE, "View 2": BELOW, "View 3": BELOW}
    assert "view" not in (tmp_path / "a.toml").read_text().lower()


@pytest.mark.parametrize(
    "text", ["no TOML [", "1 = 2", '["/a.toml"]\n"View" = 3', '["/a.toml"."View"]\nfov_y = "wide"']
)
def test_what_cannot_be_used_is_left_out(text: str) -> None:
    saved_views.path().parent.mkdir()
    saved_views.path().write_text(text)
    assert saved_views.of_scene(Path("/a.toml")) == {}
    saved_views.keep(Path("/a.toml"), {"other": ASIDE})
    assert saved_views.of_scene(Path("/a.toml")) == {"other": ASIDE}


def test_what_another_version_wrote_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    saved_views.keep(Path("/a.toml"), {"one": ASIDE})
    saved_views.path().write_text(saved_views.path().read_text() + "warp = 1.5\n")
    assert saved_views.of_scene(Path("/a.toml")) == {"one": ASIDE}
    monkeypatch.setattr(saved_views, "MOST_SCENES", 2)
    for name in "bc":
        saved_views.keep(Path(f"/{name}.toml"), {"one": replace(ASIDE, fov_y=12)})
    assert saved_views.of_scene(Path("/a.toml")) == {} and saved_views.of_scene(Path("/c.toml"))
    saved_views.keep(Path("/c.toml"), {})
    assert saved_views.of_scene(Path("/c.toml")) == {} and saved_views.of_scene(None) == {}
