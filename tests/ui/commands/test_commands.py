"""The table of commands: every one runs wherever it is offered, and no two want the same key."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, places, state

from incpt.scene.arranging import ENDS
from incpt.scene.material import Material
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.scene.shapes import SHAPES
from incpt.scene.transform import Transform
from incpt.ui import bindings
from incpt.ui.bindings import Button, MouseAction
from incpt.ui.commands import command as command_module
from incpt.ui.commands import menus
from incpt.ui.commands.command import Command, run
from incpt.ui.commands.table import COMMANDS, MENUS, command
from incpt.ui.dialogs import native
from incpt.ui.dialogs.help_page import NAVIGATION_TEXTS, HelpPage
from incpt.ui.editor import clipboard
from incpt.ui.editor.document import Document, new_scene
from incpt.ui.panels.display import OVERLAY_TEXTS
from incpt.ui.preferences import NAVIGATIONS, OVERLAYS
from incpt.viewer.renderer import Restart

MIXED = mixed_scene(size=(48, 32))
SCENES = {"mixed": MIXED, "example": Document.example().scene, "empty": Scene()}


@pytest.fixture(autouse=True)
def no_native_dialogs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(native, "is_there", lambda: False)
    monkeypatch.setattr(clipboard, "copy_picture", lambda pixels: None)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(MIXED) as made:
        yield made


def test_names_and_menus() -> None:
    assert {name for name, count in Counter(one.name for one in COMMANDS).items() if count > 1} == set()
    assert {one.menu.split("/")[0] for one in COMMANDS} == set(MENUS)
    assert {shape.capitalize() for shape in SHAPES} <= {one.name for one in COMMANDS}
    assert tuple(OVERLAY_TEXTS) == OVERLAYS
    with pytest.raises(KeyError):
        command("nothing")


@pytest.mark.parametrize("navigation", NAVIGATIONS)
def test_no_two_commands_want_the_same_key(navigation: str) -> None:
    chords = [menus.key_chord(keys) for one in COMMANDS for keys in one.keys_in(navigation)]
    assert len(chords) == len(set(chords)) and all(chords)
    # Of the mouse's bindings only this one is a key.
    grave = [b for b in bindings.NAVIGATION[navigation] if b.button is Button.GRAVE]
    for binding in grave:
        keys = "+".join([name.capitalize() for name in binding.modifiers] + ["Grave_accent"])
        assert menus.key_chord(keys) not in chords


def test_a_key_that_is_none_is_an_error() -> None:
    with pytest.raises(AttributeError):
        menus.key_chord("Ctrl+Nothing")


@pytest.mark.parametrize("navigation", NAVIGATIONS)
def test_dangerous_keys_need_more_than_a_letter_or_are_undone(navigation: str) -> None:
    for name in ("Quit", "New", "Open…", "Save", "Restart"):
        assert all(keys.startswith("Ctrl+") for keys in command(name).keys_in(navigation))


@pytest.mark.slow
@pytest.mark.parametrize("one", COMMANDS, ids=lambda one: one.name)
@pytest.mark.parametrize(
    ("where", "selected"),
    [("empty", 0), *((where, selected) for where in ("mixed", "example") for selected in (0, 1, 2))],
)
def test_every_command_runs_everywhere(one: Command, where: str, selected: int) -> None:
    scene = SCENES[where]
    with desk(scene) as user:
        user.editor.select(Selection(tuple(o.name for o in scene.objects[:selected])))
        user.frames(2)
        before, is_enabled = state(user.editor), one.is_enabled(user.editor)
        user.run(one.name)
        user.frames(2)
        if not is_enabled:
            assert changes(before, state(user.editor)) == set() and not user.null.requests
        # Whatever it did, it can be taken back, but another document; dialogs go away by Escape.
        for _ in range(3):
            user.key("Escape")
        assert user.editor.dialog is None
        while user.editor.document.history.can_undo:
            user.run("Undo")
        assert user.scene == (new_scene() if one.name == "New" else scene)


NEEDS_SELECTION = {
    "Move", "Rotate", "Scale", "Copy", "Duplicate", "Duplicate and move", "Delete", "Rename…", "Hide",
    "Clear position", "Clear rotation", "Clear scale", "Clear all three", "Aim light",
    "Hide unselected", "Drop to the floor", "Local view",
    *(f"{end.capitalize()} {axis}" for axis in "XYZ" for end in ENDS),
}  # fmt: skip
NEEDS_PICTURE = {"Export picture…", "Copy picture", "Pin reference"}
NEEDS_CAMERAS = {"Next camera"}
NEEDS_LOSS = "Find missing files…"
NEEDS_VIEW = {"Through the camera", "Camera to view", "Clear region", "Next saved view"}


def test_what_is_disabled(user: Desk) -> None:
    disabled = {one.name for one in COMMANDS if not one.is_enabled(user.editor)}
    assert disabled == NEEDS_SELECTION | NEEDS_PICTURE | NEEDS_CAMERAS | NEEDS_VIEW | {
        "Undo",
        "Redo",
        "Paste",
        NEEDS_LOSS,
    }
    user.editor.select(Selection(("lamp",)))
    user.run("Delete")
    disabled = {one.name for one in COMMANDS if not one.is_enabled(user.editor)}
    assert disabled == NEEDS_SELECTION | NEEDS_PICTURE | NEEDS_CAMERAS | NEEDS_VIEW | {
        "Redo",
        "Paste",
        NEEDS_LOSS,
    }


def test_keys_are_shown_as_they_are_printed() -> None:
    assert command("Frame selected").printed_keys("blender") == ("Numpad .", "F")
    assert command("Back").printed_keys("plain") == ("Ctrl + Numpad 1",)
    assert command("Local axes").printed_keys("blender") == (",",)
    assert command("Duplicate").printed_keys("blender") == ()


def test_what_a_command_refuses_is_a_message(user: Desk) -> None:
    refused = Command("x", "File", lambda editor: editor.scene.object("nothing"))
    run(user.editor, refused)
    assert len(user.texts()) == 1 and "nothing" in user.texts()[0] and user.scene == MIXED


# ------------------------------------------------------------------------------------- by keys and menus


def test_keys_run_commands_in_both_sets(user: Desk) -> None:
    user.key("A")
    assert len(user.editor.selection) == len(MIXED.objects)
    user.key("Escape")
    assert user.editor.selection, "as in Blender"
    user.key("Alt+A")
    assert not user.editor.selection
    user.editor.choose_navigation("plain")
    user.key("A")
    assert not user.editor.selection
    user.key("Ctrl+A")
    assert len(user.editor.selection) == len(MIXED.objects)
    user.key("Ctrl+D")
    assert len(user.scene.objects) == 2 * len(MIXED.objects)
    user.key("Ctrl+Z")
    user.key("Ctrl+Y")
    assert len(user.scene.objects) == 2 * len(MIXED.objects)


@pytest.mark.parametrize("navigation", NAVIGATIONS)
def test_every_key_runs_its_own_command(user: Desk, navigation: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    monkeypatch.setattr(command_module, "run", lambda editor, one: ran.append(one.name))
    user.editor.choose_navigation(navigation)
    wanted = [(one.name, keys) for one in COMMANDS for keys in one.keys_in(navigation)]
    for _, keys in wanted:
        user.key(keys)
    assert ran == [name for name, _ in wanted]


def test_keys_do_nothing_while_a_dialog_is_open(user: Desk) -> None:
    user.key("F1")
    before = state(user.editor)
    for keys in ("A", "Delete", "F6", "G"):
        user.key(keys)
    assert changes(before, state(user.editor)) == set()


def test_escape_closes_a_dialog_and_keeps_the_selection(user: Desk) -> None:
    user.editor.choose_navigation("plain")
    user.editor.select(Selection(("lamp",)))
    user.key("F1")
    user.key("Escape")
    assert user.editor.dialog is None and user.editor.selection.names == ("lamp",)
    user.key("F1")
    user.click("Close")
    assert user.editor.dialog is None and user.editor.selection.names == ("lamp",)
    user.key("Escape")
    assert not user.editor.selection


def test_menus_run_commands(user: Desk) -> None:
    user.click("menu Object")
    user.frames(2)
    user.click("menu Object/Add")
    user.frames(2)
    user.click("Cylinder")
    assert user.editor.selection.names == ("cylinder",) and user.undo_count == 1
    user.click("menu Object")
    user.frames(2)
    user.click("Delete")
    assert user.scene.objects == MIXED.objects


def test_every_command_stands_in_its_menu(user: Desk) -> None:
    for menu in MENUS:
        shown: set[str] = set()
        for place in dict.fromkeys(one.menu for one in COMMANDS if one.menu.split("/")[0] == menu):
            user.click(f"menu {menu}")
            user.frames(2)
            if place != menu:
                user.click(f"menu {place}")
                user.frames(2)
            shown |= set(places.names())
            user.key("Escape")
            user.key("Escape")
        assert {one.name for one in COMMANDS if one.menu.split("/")[0] == menu} <= shown


def test_a_disabled_entry_of_a_menu_does_nothing(user: Desk) -> None:
    before = state(user.editor)
    for name in ("Delete", "Hide"):
        user.click("menu Object")
        user.frames(2)
        user.click(name)
        user.key("Escape")
    assert changes(before, state(user.editor)) == set()


@pytest.mark.parametrize("navigation", NAVIGATIONS)
def test_help_lists_every_key_and_move(user: Desk, navigation: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from imgui_bundle import imgui

    written: list[str] = []
    for name in ("text_unformatted", "text_wrapped"):
        monkeypatch.setattr(imgui, name, written.append)
    user.editor.choose_navigation(navigation)
    user.key("F1")
    assert isinstance(user.editor.dialog, HelpPage)
    rows = list(pairwise(written))
    for one in COMMANDS:
        if one.keys_in(navigation):
            what = f"{one.name}: {one.help}" if one.help else one.name
            assert (" or ".join(one.printed_keys(navigation)), what) in rows
    for line in bindings.help_lines(navigation):
        assert line in rows


def test_the_set_of_keys_is_chosen_in_help(user: Desk) -> None:
    user.key("F1")
    user.frames(3)  # until the page has its size
    user.choose("Bindings", NAVIGATION_TEXTS["plain"])
    assert user.editor.preferences.navigation == "plain" and isinstance(user.editor.dialog, HelpPage)
    user.key("Escape")
    user.run("Blender-like")
    assert user.editor.preferences.navigation == "blender"


# ------------------------------------------------------------------------------------ what commands change


CHANGES: dict[str, set[str]] = {
    "Select all": {"selection"},
    "Select none": {"selection"},
    "Rotate handles": {"tool.operation"},
    "Scale handles": {"tool.operation"},
    "Local axes": {"tool.space"},
    "Snap": {"preferences.snap.enabled"},
    "Hide": {"scene.objects.red cube.visible"},
    "Clear position": {"scene.objects.red cube.position.1"},
    "Clear rotation": {"scene.objects.red cube.rotation.1"},
    "Clear scale": set(),
    "Clear all three": {"scene.objects.red cube.position.1", "scene.objects.red cube.rotation.1"},
    "Copy": set(),
    "Front": {"viewing"},
    "Lock camera to view": {"viewing"},
    "Split view": {"preferences.display.split"},
    "Tile grid": {"preferences.display.tile_grid"},
    "Outline": {"preferences.display.outline"},
    "Depth": {"preferences.display.overlay"},
    "Match window": {"scene.settings.size.0", "scene.settings.size.1"},
    "Pause": {"control.paused"},
    "Restart": set(),
    "Plain": {"preferences.navigation"},
    "Quit": {"is_closing"},
    "About incpt": {"dialog"},
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_command_changes_what_it_says(user: Desk, name: str) -> None:
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    before = state(user.editor)
    user.run(name)
    assert changes(before, state(user.editor)) == CHANGES[name]
    assert user.null.requests == ([Restart()] if name == "Restart" else [])


def test_duplicate_delete_show_and_reset(user: Desk) -> None:
    user.editor.select(Selection(("lamp", "red cube")))
    user.run("Duplicate")
    assert user.editor.selection.names == ("lamp.001", "red cube.001") and user.undo_count == 1
    added = changes(flat(MIXED), flat(user.scene))
    assert added and all(place.startswith(("objects.lamp.001", "objects.red cube.001")) for place in added)
    user.run("Hide")
    assert not user.scene.object("lamp.001").visible
    user.run("Show all")
    assert user.scene.object("lamp.001").visible
    user.run("Delete")
    assert user.scene == MIXED and not user.editor.selection and user.undo_count == 4
    user.run("Undo")
    assert user.editor.selection.names == ("lamp.001", "red cube.001")


def test_the_add_menu_opens_at_the_mouse(user: Desk) -> None:
    at = user.at_picture(0.4, 0.4)
    user.move(*at)
    user.key("Shift+A")
    user.frames(2)
    assert user.shows("Cylinder") and user.shows("Sun")
    assert np.abs(np.subtract(user.place("Cube"), at)).max() < 200
    user.click("Cylinder")
    assert user.editor.selection.names == ("cylinder",) and user.undo_count == 1
    assert not user.shows("Cylinder")
    user.key("Shift+A")
    user.key("Ctrl+Z")
    assert user.undo_count == 0 and not user.shows("Cylinder"), "no key is lost"


def test_what_is_copied_is_pasted_into_another_scene_too(user: Desk) -> None:
    user.run("Point light")
    user.editor.select(Selection(("point light", "red cube")))
    user.key("Ctrl+C")
    user.key("Ctrl+V")
    assert user.editor.selection.names == ("point light.001", "red cube.001") and user.undo_count == 2
    assert user.scene.materials == MIXED.materials, "the same materials"
    other = new_scene()
    user.editor.start_over(Document(replace(other, materials={**other.materials, "red": Material()})))
    user.key("Ctrl+V")
    assert user.editor.selection.names == ("point light", "red cube")
    assert user.scene.object("red cube").material == "red.001", "it has a different one of that name"
    assert user.scene.material("red.001") == MIXED.material("red")
    user.key("Ctrl+V")
    assert user.editor.selection.names == ("point light.001", "red cube.001")


@pytest.mark.parametrize(("keys", "part"), [("Alt+G", "position"), ("Alt+R", "rotation"), ("Alt+S", "scale")])
def test_one_part_of_each_transform_is_cleared(user: Desk, keys: str, part: str) -> None:
    user.editor.select(Selection(("red cube", "grey drum", "floor")))
    user.key(keys)
    assert {place.split(".")[2] for place in changes(flat(MIXED), flat(user.scene))} == {part}
    for name in user.editor.selection:
        assert getattr(user.scene.object(name), part) == getattr(Transform(), part)
    assert user.undo_count == 1
    user.key(keys)
    assert user.undo_count == 1, "there is nothing left to clear"


def test_the_camera_is_framed_and_reset(user: Desk) -> None:
    user.editor.select(Selection(("glass ball",)))
    user.run("Frame selected")
    closer = user.editor.shown.camera
    assert closer.target == pytest.approx((1.1, 0.5, 0.3)) and user.scene == MIXED
    assert changes(flat(MIXED), flat(user.editor.shown)) <= {
        f"camera.{what}.{i}" for what in ("position", "target") for i in range(3)
    }
    user.key("Home")
    farther = user.editor.shown.camera
    assert math.dist(farther.position, farther.target) > 2 * math.dist(closer.position, closer.target)
    user.run("Camera to view")
    assert user.scene.camera == farther and not user.editor.viewing.is_free and user.undo_count == 1
    user.key("Home")
    user.run("Reset camera")
    assert user.scene == MIXED and user.editor.shown is user.scene


def test_match_window_takes_the_size_of_the_viewport(user: Desk) -> None:
    user.run("Match window")
    assert user.scene.settings.size == (int(user.area.width), int(user.area.height))
    assert tuple(user.picture) == pytest.approx(tuple(user.area))


def test_the_layout_is_reset(user: Desk) -> None:
    area = user.area
    user.run("Reset layout")
    assert not user.editor.screen.wants_first_layout and user.area == area


def test_fly_keys_are_no_commands_while_flying(user: Desk) -> None:
    user.move(*user.at_picture(0.1, 0.1))
    with user.held_keys("Shift+Grave_accent"):
        pass
    assert user.editor.gesture.is_flying and user.editor.is_waiting
    before = state(user.editor)
    with user.held_keys("W"):
        user.frames(3)
    user.key("A")
    changed = changes(before, state(user.editor))
    assert changed == {"viewing"}
    user.key("Escape")
    assert not user.editor.gesture.is_flying and user.undo_count == 0
    assert {key.key.upper() for key in bindings.FLY_KEYS} & {one.keys for one in COMMANDS}  # they would clash
    assert bindings.action_for("blender", Button.GRAVE, ["shift"]) is MouseAction.FLY
