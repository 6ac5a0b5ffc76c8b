"""The free view: looking at the scene is no edit of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk, flat

from incpt.formats import registry
from incpt.scene.camera import Camera
from incpt.scene.selection import Selection
from incpt.ui.commands import files
from incpt.ui.editor.viewing import ShownScenes

SCENE = mixed_scene(size=(48, 32)).with_environment(image=None)
ASIDE = Camera((5.0, 3.0, 1.0), (1.0, 0.5, 0.0))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.look(ASIDE, "Orbit")
        made.frames(2)
        yield made


def test_moving_the_view_is_no_edit(user: Desk) -> None:
    editor = user.editor
    assert editor.scene is SCENE and not editor.document.is_dirty and user.undo_count == 0
    assert editor.shown.camera is ASIDE and user.null.views[-1].scene is editor.shown
    assert editor.shown == replace(SCENE, camera=ASIDE) and editor.shown is editor.shown


def test_edits_under_a_free_view_keep_the_camera(user: Desk) -> None:
    editor = user.editor
    editor.select(Selection(("red cube",)))
    user.run("Move")
    user.write("2")
    user.key("Enter")
    assert editor.scene.camera == SCENE.camera and user.undo_count == 1
    assert {p.split(".")[1] for p in flat(editor.scene).items() - flat(SCENE).items() for p in p[:1]} == {
        "red cube"
    }
    assert editor.shown.camera is ASIDE and editor.view.scene.objects == editor.scene.objects
    user.key("Ctrl+Z")
    assert editor.scene == SCENE and editor.shown.camera is ASIDE, "undo leaves the view alone"


def test_a_transform_that_is_given_up_leaves_the_scene(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.run("Move")
    user.move(*user.at_picture(0.6, 0.6))
    assert user.editor.view.before is not None and user.editor.view.before.camera is ASIDE
    user.key("Escape")
    user.frames(2)
    assert user.scene == SCENE and user.undo_count == 0 and user.editor.viewing.camera is ASIDE


def test_the_camera_goes_to_the_view_as_one_edit(user: Desk) -> None:
    user.run("Camera to view")
    assert user.scene == replace(SCENE, camera=ASIDE) and user.undo_count == 1
    assert not user.editor.viewing.is_free
    user.key("Ctrl+Z")
    assert user.scene == SCENE and user.editor.shown == SCENE


def test_the_view_goes_to_the_camera_and_back(user: Desk) -> None:
    user.key("Keypad0")
    assert user.editor.shown is SCENE
    user.key("Keypad0")
    assert user.editor.viewing.camera is ASIDE and user.scene is SCENE


def test_a_new_camera_has_the_view(user: Desk) -> None:
    user.run("New camera")
    assert user.scene.cameras["camera"] == SCENE.camera and user.scene.camera == ASIDE
    assert not user.editor.viewing.is_free and user.undo_count == 1


def test_a_change_of_the_camera_is_seen(user: Desk) -> None:
    user.panel("Scene")
    user.type("Field of view", "70")
    assert user.scene == SCENE.with_camera(fov_y=70) and user.editor.shown is user.scene
    user.editor.look(ASIDE, "Orbit")
    user.key("Ctrl+Z")
    assert user.editor.shown is user.scene and user.scene == SCENE


def test_what_is_added_stands_where_the_view_looks(user: Desk) -> None:
    user.run("Cube")
    assert user.scene.object("cube").position[0] == ASIDE.target[0] and user.scene.camera == SCENE.camera


def test_saving_keeps_the_camera_and_says_so(user: Desk, tmp_path: Path) -> None:
    files.save_to(user.editor, tmp_path / "a.toml")
    assert registry.load(tmp_path / "a.toml") == SCENE
    assert "this view is no part of it" in user.texts()[-1]
    user.run("Camera to view")
    files.save_to(user.editor, tmp_path / "a.toml")
    assert registry.load(tmp_path / "a.toml").camera == ASIDE and user.texts()[-1].endswith("is saved")


def test_another_document_is_seen_through_its_camera(user: Desk) -> None:
    user.run("New")
    assert not user.editor.viewing.is_free and user.editor.viewing.left is None
    assert user.editor.shown is user.scene


def test_the_same_scene_and_camera_are_shown_as_the_same() -> None:
    shown = ShownScenes()
    first = shown.of(SCENE, ASIDE)
    moved = replace(first, objects=first.objects[:1])
    scene = shown.edited(moved, ASIDE, SCENE.camera)
    assert scene.camera == SCENE.camera and scene.objects == moved.objects
    assert shown.of(scene, ASIDE) is moved, "nobody takes it for another edit"
    for i in range(40):
        shown.of(replace(SCENE, objects=SCENE.objects[: 1 + i % 2]), ASIDE)
        assert shown.of(SCENE, ASIDE) is first, "what is used is kept"
    assert shown.edited(SCENE, ASIDE, SCENE.camera) is SCENE and shown.of(SCENE, None) is SCENE
