"""Panels that are hidden, and the picture alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import WINDOW, Desk, desk

from incpt.scene.selection import Selection
from incpt.ui.preferences import PANELS, Preferences

SCENE = mixed_scene(size=(48, 32))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(("lamp",)))
        made.frames(2)
        yield made


def test_a_panel_is_hidden_and_shown_again(user: Desk) -> None:
    assert user.shows("Position X") and user.shows("Search")
    user.run("Object")
    assert not user.shows("Position X") and user.editor.preferences.hidden_panels == ("Object",)
    user.run("Outliner")
    assert not user.shows("Search") and user.editor.preferences.hidden_panels == ("Outliner", "Object")
    for name in PANELS[2:]:
        user.run(name)
    assert user.editor.preferences.hidden_panels == PANELS
    width = user.area.width
    user.run("Outliner")
    assert user.shows("Search") and user.area.width < width, "the picture had their place"
    user.run("Reset layout")
    assert not user.editor.preferences.hidden_panels and user.shows("Position X")


def test_a_hidden_outliner_comes_back_for_a_name(user: Desk) -> None:
    user.run("Outliner")
    user.run("Picture alone")
    user.run("Rename…")
    user.frames(2)
    assert user.shows("rename lamp") and not user.editor.preferences.hidden_panels


def test_what_was_hidden_stays_hidden_at_the_next_start() -> None:
    with desk(SCENE, Preferences(hidden_panels=("Outliner",))) as user:
        assert not user.shows("Search")


@pytest.mark.parametrize("back", ["Escape", "Ctrl+Space"])
def test_the_picture_has_the_window_alone(user: Desk, back: str) -> None:
    usual = user.area
    user.key("Ctrl+Space")
    user.frames(2)
    assert user.area.size == WINDOW and not user.shows("menu File") and not user.shows("Position X")
    user.key("Ctrl+Z")
    user.run("Move")
    user.key("Escape")
    assert user.editor.screen.is_alone, "Esc gave up the move"
    user.key(back)
    user.frames(2)
    assert user.area == usual and user.shows("Position X") and user.shows("menu File")


def test_the_screen_is_filled_by_one_command_and_left_by_escape(user: Desk) -> None:
    user.key("F11")
    assert user.editor.screen.is_full_screen and user.editor.screen.is_alone
    user.key("Escape")
    assert not user.editor.screen.is_full_screen and not user.editor.screen.is_alone
