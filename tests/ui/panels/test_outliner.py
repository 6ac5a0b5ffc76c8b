"""The list of objects."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, state

from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.widgets import places

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


def rows(user: Desk) -> list[str]:
    """The names in sight."""
    return [name.removeprefix("object ") for name in places.names() if name.startswith("object ")]


@pytest.fixture(scope="module")
def crowd() -> Scene:
    """Ten thousand objects."""
    cube = SCENE.object("red cube")
    return replace(SCENE, objects=tuple(replace(cube, name=f"cube {i}") for i in range(10_000)))


def test_f2_types_the_name_in_its_row(user: Desk) -> None:
    user.click("object lamp")
    user.key("F2")
    user.frames(2)
    assert user.editor.dialog is None and not user.shows("object lamp")
    user.write("x")  # No command: the field has the keys.
    user.key("Escape")
    user.frames(2)
    assert user.shows("object lamp") and user.undo_count == 0
    user.key("F2")
    user.frames(2)
    user.write("panel")
    user.key("Enter")
    assert user.scene.object("panel") and user.editor.selection.names == ("panel",) and user.undo_count == 1
    user.key("F2")
    user.frames(2)
    user.write("floor")
    user.key("Enter")
    user.frames(2)
    assert "taken" in user.texts()[-1] and user.shows("object panel") and user.undo_count == 1
    user.key("F2")
    user.frames(2)
    user.write("kept")
    user.click_at(*user.at_picture(0.02, 0.02))
    assert user.scene.object("kept"), "a press elsewhere gives the name"


def test_a_row_that_is_renamed_may_go(user: Desk) -> None:
    user.run("Cube")
    user.key("F2")
    user.frames(2)
    user.run("Undo")
    user.frames(2)
    assert not user.shows("rename cube") and user.shows("object lamp")


def test_a_search_hides_no_row_that_is_renamed(user: Desk) -> None:
    user.click("object lamp")
    user.click("Search")
    user.write("floor")
    user.key("Enter")
    user.key("F2")
    user.frames(2)
    assert user.shows("rename lamp")


def test_what_is_selected_or_added_is_scrolled_to(crowd: Scene) -> None:
    with desk(crowd) as user:
        assert "cube 0" in rows(user) and len(rows(user)) < 100
        user.editor.select(Selection(("cube 1", "cube 7000")))
        user.frames(3)
        assert "cube 7000" in rows(user) and "cube 0" not in rows(user)
        seen = rows(user)
        user.editor.select(Selection(("cube 7000", seen[3])))
        user.frames(3)
        assert rows(user) == seen, "what is in sight stays where it is"
        user.wheel_at(f"object {seen[3]}", 0.1)
        cut_off = min(rows(user), key=lambda name: user.height(f"object {name}"))
        user.click(f"object {cut_off}")
        assert user.height(f"object {cut_off}") == user.height(f"object {rows(user)[5]}")
        user.run("Sphere")
        user.frames(2)
        assert "sphere" in rows(user)
        user.wheel_at("object sphere", 500.0)
        assert "sphere" not in rows(user), "the list is scrolled to it once"


def test_ten_thousand_rows_take_no_longer_than_a_few(crowd: Scene) -> None:
    def seconds(scene: Scene) -> float:
        with desk(scene) as user:
            start = time.perf_counter()
            user.frames(20)
            return (time.perf_counter() - start) / 20

    # Five times as long is 15 ms; drawing all rows would take half a second.
    assert seconds(crowd) < max(5 * seconds(SCENE), 0.05)
