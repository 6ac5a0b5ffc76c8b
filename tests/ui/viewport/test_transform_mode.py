"""G, R and S in the editor: one entry of the history each, or none; keys and mouse belong to it meanwhile."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imgui_bundle import imgui
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat

from incpt.scene import placing
from incpt.scene.light import Light
from incpt.scene.selection import Selection
from incpt.ui.commands import files
from incpt.ui.preferences import NAVIGATIONS, SnapSettings

SCENE = mixed_scene(size=(48, 32)).with_added_light(Light("spot", "spot", (-1.5, 2.0, 0.0)))
CUBE = (0.0, 0.5, 0.0)
FLT_MAX = float(np.finfo(np.float32).max)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(("red cube",)))
        made.move(*made.at_picture(0.6, 0.5))
        made.frames(2)
        yield made


def position(user: Desk, name: str = "red cube") -> tuple[float, float, float]:
    return user.scene.placed(name).position


def test_g_x_number_enter_moves_and_the_panel_agrees(user: Desk) -> None:
    user.key("G")
    user.key("X")
    user.write("1.5")
    assert position(user) == (1.5, 0.5, 0.0) and user.editor.view.before is SCENE
    assert user.shows("transform") and not user.shows("gizmo") and user.editor.gesture.hint
    typed = user.scene
    user.move(*user.at_picture(0.3, 0.3))
    assert user.scene is typed, "the number counts, and the same scene is nothing new"
    user.key("Enter")
    assert position(user) == (1.5, 0.5, 0.0) and user.editor.view.before is None
    assert user.undo_count == 1 and user.editor.document.history.undo_label == "Move"
    assert not user.shows("transform") and user.shows("gizmo") and not user.editor.gesture.hint
    user.type("Position Y", "2")
    assert position(user) == (1.5, 2.0, 0.0) and user.undo_count == 2
    user.key("Ctrl+Z")
    user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_the_header_stands_clear_of_the_captions_of_a_split_view(user: Desk) -> None:
    user.key("G")
    user.frames(2)
    above = user.place("transform")[1]
    user.key("Escape")
    user.run("Split view")
    user.key("G")
    user.frames(2)
    assert user.place("transform")[1] > above + imgui.get_font_size()
    user.key("Escape")


@pytest.mark.parametrize("end", ["click", "Enter", "KeypadEnter"])
def test_the_picture_follows_the_mouse_until_the_end(user: Desk, end: str) -> None:
    x, y = user.at_picture(0.6, 0.5)
    user.key("G")
    seen = []
    for step in range(1, 5):
        user.move(x + 20 * step, y)
        seen.append(user.null.views[-1])
    assert len({view.scene.placed("red cube").position for view in seen}) == 4
    assert all(view.before is SCENE for view in seen)
    if end == "click":
        user.press()
        user.release()
    else:
        user.key("Keypad_enter" if end == "KeypadEnter" else end)
    assert user.null.views[-1].before is None
    moved = user.scene
    assert position(user)[0] > 0.1 and user.undo_count == 1
    user.move(x + 200, y)
    user.frames(3)
    assert user.scene is moved and user.editor.selection.names == ("red cube",)
    assert not user.null.requests, "the click that ended it picks nothing"


@pytest.mark.parametrize("end", ["Escape", "right click"])
@pytest.mark.parametrize("keys", ["G", "R", "S"])
def test_giving_up_leaves_the_very_scene(user: Desk, keys: str, end: str) -> None:
    x, y = user.at_picture(0.6, 0.5)
    user.key(keys)
    user.move(x + 50, y + 30)
    user.move(x + 90, y + 60)
    assert user.scene != SCENE
    if end == "Escape":
        user.key(end)
    else:
        user.press(1)
        user.move(x + 95, y + 60)
        user.release(1)
    user.frames(2)
    assert user.scene is SCENE and user.undo_count == 0 and not user.null.requests
    assert user.editor.selection.names == ("red cube",) and not user.editor.gesture.is_held


def test_r_and_s_with_several_and_lights(user: Desk) -> None:
    user.editor.select(Selection(("spot", "red cube")))
    user.frames(2)
    user.key("R")
    user.key("Y")
    user.write("180")
    user.key("Enter")
    middle = (-0.75, 1.25, 0.0)
    assert position(user, "spot") == pytest.approx((2 * middle[0] + 1.5, 2.0, 0.0), abs=1e-9)
    assert position(user) == pytest.approx((-1.5, 0.5, 0.0), abs=1e-9)
    assert {place.split(".")[1] for place in changes(flat(SCENE), flat(user.scene))} == {"spot", "red cube"}
    user.key("S")
    user.write("2")
    user.key("Enter")
    assert user.scene.placed("red cube").scale == (2.0, 2.0, 2.0) and user.undo_count == 2


def test_the_key_that_begins_it_is_no_input_of_it(user: Desk) -> None:
    """A second R is for the trackball."""
    user.key("R")
    user.write("90")
    user.key("Enter")
    turn = placing.turn_matrix(SCENE.camera.image_plane(1.0)[2], 90)
    expected = turn @ SCENE.object("red cube").world_from_object[:, :3]
    np.testing.assert_allclose(user.scene.object("red cube").world_from_object[:, :3], expected, atol=1e-9)


def test_keys_and_mouse_belong_to_it_meanwhile(user: Desk) -> None:
    row = user.place("object lamp")
    user.key("G")
    for keys in ("H", "A", "Delete", "F6", "Ctrl+Z", "B", "F"):
        user.key(keys)
    user.move(*row)
    user.frames(2)
    assert imgui.get_current_context().hovered_id == 0, "no panel is under the mouse"
    user.wheel(1.0)
    user.press()
    user.release()
    user.frames(2)
    assert user.editor.selection.names == ("red cube",)
    assert {place[:25] for place in changes(flat(SCENE), flat(user.scene))} == {"objects.red cube.position"}
    user.click("object lamp")
    assert user.editor.selection.names == ("lamp",)


def test_ctrl_turns_the_snapping_of_the_preferences_round(user: Desk) -> None:
    x, y = user.at_picture(0.6, 0.5)
    user.key("G")
    user.key("X")
    with user.held_keys("Ctrl"):
        user.move(x + 103, y)
        assert position(user)[0] / 0.1 == pytest.approx(round(position(user)[0] / 0.1), abs=1e-9)
    assert position(user)[0] / 0.1 != pytest.approx(round(position(user)[0] / 0.1), abs=1e-3)
    user.key("Escape")
    user.editor.change_snap(SnapSettings(True, move_m=0.5))
    user.key("G")
    user.key("X")
    user.move(x + 250, y)
    user.key("Enter")
    assert position(user)[0] > 0 and position(user)[0] % 0.5 == 0


def test_copies_are_moved_at_once_and_taken_back_at_once(user: Desk) -> None:
    user.key("Shift+D")
    user.key("Z")
    user.write("2")
    user.key("Enter")
    assert user.editor.selection.names == ("red cube.001",) and position(user, "red cube.001") == (0, 0.5, 2)
    assert position(user) == CUBE
    assert user.undo_count == 1 and user.editor.document.history.undo_label == "Duplicate"
    user.key("Ctrl+Z")
    assert user.scene == SCENE and user.editor.selection.names == ("red cube",)
    user.key("Shift+D")
    user.move(*user.at_picture(0.8, 0.4))
    user.key("Escape")
    assert position(user, "red cube.001") == CUBE, "as in Blender the copy stays, where it was made"
    assert user.undo_count == 1


def test_copies_of_what_is_hidden_are_made_all_the_same(user: Desk) -> None:
    user.run("Hide")
    user.key("Shift+D")
    assert user.editor.selection.names == ("red cube.001",) and not user.editor.gesture.hint
    assert user.undo_count == 2


@pytest.mark.parametrize("keys", ["G", "R", "S", "B"])
def test_a_mouse_that_leaves_the_window_stays_where_it_was(user: Desk, keys: str) -> None:
    x, y = user.at_picture(0.6, 0.5)
    user.key(keys)
    user.move(x + 30, y + 20)
    there = user.scene
    user.move(-FLT_MAX, -FLT_MAX)  # what imgui is told then
    user.frames(2)
    assert user.scene is there
    user.key("Escape")
    user.key(keys)
    user.frames(2)
    assert user.scene == SCENE
    user.move(x, y)
    assert user.editor.gesture.hint


def test_what_comes_from_elsewhere_ends_it(user: Desk) -> None:
    user.key("G")
    user.move(*user.at_picture(0.8, 0.4))
    other = SCENE.with_object("lamp", visible=False)
    user.editor.propose(other, "Other")
    user.frames(2)
    assert user.scene is other and not user.editor.gesture.hint
    user.key("G")
    user.move(*user.at_picture(0.6, 0.4))
    files.quit_(user.editor)
    user.frames(2)
    assert user.editor.dialog is not None and user.scene == other and not user.editor.gesture.hint
    user.key("Escape")
    user.click("object lamp")
    assert user.editor.selection.names == ("lamp",), "the mouse is the panels' again"


@pytest.mark.parametrize("navigation", NAVIGATIONS)
def test_both_sets_of_keys_have_it(user: Desk, navigation: str) -> None:
    user.editor.choose_navigation(navigation)
    turn = "R" if navigation == "blender" else "Shift+R"
    for keys, label in (("G", "Move"), (turn, "Rotate"), ("S", "Scale")):
        user.key(keys)
        user.write("2")
        user.key("Enter")
        assert user.editor.document.history.undo_label == label
    assert user.undo_count == 3


def test_nothing_begins_without_a_selection_or_while_a_field_is_typed_into(user: Desk) -> None:
    user.open_field("Position X")
    user.key("G")
    assert not user.editor.gesture.hint
    user.key("Escape")
    user.run("Hide")
    user.key("G")
    assert not user.editor.gesture.hint
    user.editor.select(Selection())
    user.key("G")
    assert not user.editor.gesture.hint


def test_from_the_menu_it_begins_where_the_mouse_is(user: Desk) -> None:
    user.click("menu Object")
    user.frames(2)
    user.click("menu Object/Transform")
    user.frames(2)
    user.click("Move")
    assert user.editor.gesture.hint and user.scene is SCENE
    x, y = user.at_picture(0.5, 0.5)
    user.move(x, y)
    user.press()
    user.release()
    assert user.undo_count == 1 and not user.editor.gesture.hint


def test_the_tool_of_the_gizmo_stays(user: Desk) -> None:
    tool = user.editor.tool
    user.key("S")
    user.key("Escape")
    assert user.editor.tool == tool


# Random gestures beside a list of scenes with a cursor, which is what undo has to be.

GESTURES = st.one_of(
    st.tuples(
        st.sampled_from("GRS"),
        st.sampled_from(("", "X", "YY", "ZZZ", "Shift+X")),
        st.sampled_from(("", "2", "0.5+1", "1-")),
        st.sampled_from(("Enter", "Escape", "click", "right click")),
    ),
    st.sampled_from(("Ctrl+Z", "Ctrl+Shift+Z")),
)


def work(user: Desk, operation: str, axes: str, text: str, end: str) -> None:
    user.move(*user.at_picture(0.6, 0.5))
    user.key(operation)
    user.move(*user.at_picture(0.7, 0.4))
    for axis in [axes] if "+" in axes else axes:
        user.key(axis)
    user.write(text)
    if "click" in end:
        user.press(1 if "right" in end else 0)
        user.release(1 if "right" in end else 0)
    else:
        user.key(end)
    user.frame()


@settings(max_examples=12, deadline=None)
@given(st.lists(GESTURES, min_size=1, max_size=6))
def test_any_gestures_leave_the_history_that_a_list_has(gestures: list[tuple[str, ...] | str]) -> None:
    scenes, cursor = [SCENE], 0
    with desk(SCENE) as user:
        user.editor.select(Selection(("red cube", "spot")))
        for gesture in gestures:
            before = user.scene
            if isinstance(gesture, str):
                user.key(gesture)
                step = -1 if gesture == "Ctrl+Z" else 1
                cursor = min(max(cursor + step, 0), len(scenes) - 1)
            else:
                work(user, *gesture)
                if gesture[3] in ("Escape", "right click"):
                    assert user.scene is before
                elif user.scene != before:
                    scenes[cursor + 1 :] = [user.scene]
                    cursor += 1
                places = changes(flat(before), flat(user.scene))
                assert all(place.split(".")[1] in ("red cube", "spot") for place in places)
                assert gesture[2] or gesture[3] in ("Escape", "right click") or places, "the mouse moved it"
            assert user.scene == scenes[cursor] and not user.editor.gesture.hint
            assert user.editor.selection.names == ("red cube", "spot")
