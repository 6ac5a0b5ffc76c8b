"""The list of objects."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, state

SCENE = mixed_scene(size=(48, 32))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def test_the_outliner_selects_hides_and_renames(user: Desk) -> None:
    user.click("object lamp")
    assert user.editor.selection.names == ("lamp",)
    with user.held_keys("Ctrl"):
        user.click("object red cube")
    assert user.editor.selection.names == ("lamp", "red cube")
    with user.held_keys("Shift"):
        user.click("object floor")
    assert set(user.editor.selection.names) == {"lamp", "red cube", "floor"}
    assert user.editor.selection.active == "floor"
    before = state(user.editor)
    user.click("visible floor")
    assert changes(before, state(user.editor)) == {"scene.objects.floor.visible"} and user.undo_count == 1
    user.click("visible floor")
    assert changes(before, state(user.editor)) == set()
    user.open_field("object lamp")
    user.key("Ctrl+A")
    user.write("panel")
    user.key("Enter")
    assert user.scene.object("panel") and user.editor.selection.names == ("panel",)


def test_the_search_leaves_what_fits(user: Desk) -> None:
    before = state(user.editor)
    user.click("Search")
    user.write("L")
    assert {o.name for o in SCENE.objects if user.shows(f"object {o.name}")} == {
        "floor", "glass ball", "lamp",
    }  # fmt: skip
    user.write("zz")
    assert not any(user.shows(f"object {o.name}") for o in SCENE.objects)
    assert changes(before, state(user.editor)) == set()
