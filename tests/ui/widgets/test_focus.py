"""Keys belong to a field only while somebody sees it being typed into; else they are commands."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from imgui_bundle import imgui
from support import ui_harness
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.scene.model import Scene
from incpt.scene.selection import Selection

SCENE = mixed_scene(size=(48, 32))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(("red cube",)))
        made.frames(2)
        yield made


def moved(user: Desk) -> Scene:
    """After an edit that is over, so that there is something to undo."""
    user.type("Position X", "1")
    assert user.scene.object("red cube").position[0] == 1.0
    return user.scene


@pytest.mark.parametrize("keys", ["Tab", "Shift+Tab"])
def test_tab_opens_no_field_where_none_is_typed_into(user: Desk, keys: str) -> None:
    """As it did after Enter had ended the typing: the field before took the keys that followed."""
    moved(user)
    is_snapping = user.editor.preferences.snap.enabled
    user.key(keys)
    assert not imgui.is_any_item_active()
    assert (user.editor.preferences.snap.enabled != is_snapping) == (keys == "Shift+Tab")
    user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_tab_goes_from_field_to_field_while_one_is_typed_into(user: Desk) -> None:
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("1")
    user.key("Tab")
    user.key("Ctrl+A")
    user.write("2")
    user.key("Shift+Tab")
    user.key("Ctrl+A")
    user.write("3")
    user.key("Enter")
    assert user.scene.object("red cube").position == (3.0, 2.0, 0.0)


@pytest.mark.parametrize("button", [0, 1, 2])
def test_a_press_elsewhere_ends_the_typing(user: Desk, button: int) -> None:
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("1")
    user.click_at(*user.at_picture(0.05, 0.05), button)
    assert not imgui.is_any_item_active() and user.scene.object("red cube").position[0] == 1.0
    user.key("Ctrl+Z")
    assert user.scene == SCENE


@pytest.mark.parametrize("button", [0, 1, 2])
def test_a_press_on_the_field_goes_on_with_the_typing(user: Desk, button: int) -> None:
    user.open_field("Position X")
    user.click("Position X", button)
    user.key("Ctrl+A")
    user.write("1")
    user.key("Enter")
    assert user.scene.object("red cube").position[0] == 1.0


def test_a_field_that_is_scrolled_out_of_sight_ends_the_typing(
    user: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ui_harness, "WINDOW", (1000, 700))
    user.frames(3)
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("1")
    user.move(*user.place("Rotation X"))
    for _ in range(30):
        user.wheel(-5.0)
    user.frames(3)
    assert not user.shows("Position X") and not imgui.is_any_item_active()
    user.key("H")
    assert not user.scene.object("red cube").visible and user.scene.object("red cube").position[0] == 1.0


def test_a_key_right_after_the_typing_is_a_command(user: Desk) -> None:
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("1")
    io = imgui.get_io()
    for keys in ((imgui.Key.enter,), (imgui.Key.mod_ctrl, imgui.Key.z)):
        for key in keys:
            io.add_key_event(key, True)
        user.frame()
    for key in (imgui.Key.enter, imgui.Key.z, imgui.Key.mod_ctrl):
        io.add_key_event(key, False)
    user.frames(2)
    assert user.scene == SCENE


def test_a_field_that_was_typed_into_takes_no_keys_while_it_is_dragged(user: Desk) -> None:
    typed = moved(user)
    user.hold_at(user.place("Position X"), (40.0, 0.0))
    assert user.scene != typed
    user.key("Ctrl+Z")
    assert user.scene == typed
    user.release()
