"""The mouse in the picture: clicks, moves of the camera, the gizmo, the bar of the split view."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, state, tell

from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.selection import Selection
from incpt.ui.preferences import SnapSettings
from incpt.ui.viewport.viewport import Outcome
from incpt.viewer.renderer import Pick, PickBox, Picked, PickedBox

SCENE = mixed_scene(size=(48, 32))
FLT_MAX = float(np.finfo(np.float32).max)
LIT = SCENE.with_added_light(Light("spot", "spot", (-1.0, 1.2, 0.0)), Light("far", "point", (1.5, 1.2, 0.0)))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def test_a_click_picks_and_clicks_on_nothing_deselect(user: Desk) -> None:
    for button in (0, 1):
        where = user.at_picture(0.5, 0.5)
        user.null.picks = dict.fromkeys([(0.5, 0.5)], "red cube")
        user.click_at(*where, button)
        (request,) = user.null.requests
        assert isinstance(request, Pick) and not request.additive
        assert (
            request.point == pytest.approx((0.5, 0.5), abs=2e-3)
            and user.editor.control.point == request.point
        )
        tell(user, Picked(request.point, "red cube", False))
        assert user.editor.selection.names == ("red cube",)
        user.null.requests.clear()
        user.click_at(*user.at_picture(0.05, 0.05), button)
        assert not user.editor.selection
        user.null.requests.clear()
    assert user.scene is SCENE and user.undo_count == 0


@pytest.mark.parametrize("key", ["Ctrl", "Shift"])
def test_a_key_picks_more_than_one(user: Desk, key: str) -> None:
    user.editor.select(Selection(("lamp",)))
    with user.held_keys(key):
        user.click_at(*user.at_picture(0.3, 0.1))
    assert isinstance(user.null.requests[-1], Pick) and user.null.requests[-1].additive
    tell(user, Picked((0.3, 0.1), "red cube", True))
    assert user.editor.selection.names == ("lamp", "red cube")
    tell(user, Picked((0.3, 0.1), "lamp", True))
    assert user.editor.selection.names == ("red cube", "lamp"), "it is the active one now"
    tell(user, Picked((0.3, 0.1), "lamp", True))
    assert user.editor.selection.names == ("red cube",)
    tell(user, Picked((0.3, 0.1), None, True))
    assert user.editor.selection.names == ("red cube",)
    tell(user, Picked((0.3, 0.1), None, False))
    assert user.editor.selection.names == ()


def test_a_right_click_on_what_is_selected_opens_its_menu(user: Desk) -> None:
    user.editor.select(Selection(("lamp", "red cube")))
    x, y = map(math.floor, user.at_picture(0.5, 0.5))
    where = float(x), float(y)
    user.null.picks = {user.picture.relative(where): "grey drum"}
    user.click_at(*where, 1)
    assert user.editor.selection.names == ("grey drum",) and not user.shows("Rename…")
    user.click_at(*where, 1)
    user.frames(2)
    assert user.editor.selection.names == ("grey drum",) and user.shows("Rename…")
    user.click("Hide")
    assert not user.scene.object("grey drum").visible and user.undo_count == 1
    user.click_at(*where, 1)
    user.frames(2)
    user.key("X")
    assert not user.shows("Rename…") and "grey drum" not in user.scene.object_index, "its keys work too"
    user.null.picks = {}
    user.click_at(*where, 1)
    user.frames(2)
    assert not user.shows("Rename…")


def test_a_light_has_its_menu_too(user: Desk) -> None:
    user.editor.propose(LIT, "Light", selection=Selection(("spot",)))
    user.frames(2)
    user.click("light spot", 1)
    user.frames(2)
    assert user.shows("Rename…")
    user.key("Escape")
    assert not user.shows("Rename…") and user.editor.selection.names == ("spot",)
    user.editor.select(Selection(("lamp",)))
    user.click("light spot", 1)
    user.frames(2)
    assert not user.shows("Rename…") and user.editor.selection.names == ("spot",)


@pytest.mark.parametrize(
    ("key", "selected"),
    [
        ("", ("spot", "red cube", "lamp")),
        ("Shift", ("grey drum", "spot", "red cube", "lamp")),
        ("Ctrl", ("grey drum",)),
    ],
)
def test_a_box_selects_what_is_seen_in_it(user: Desk, key: str, selected: tuple[str, ...]) -> None:
    user.editor.propose(LIT, "Light")
    user.editor.select(Selection(("grey drum",) if key != "Ctrl" else ("grey drum", "lamp", "spot")))
    user.frames(2)
    at = user.place("light spot")
    user.key("B")
    assert user.editor.gesture.hint
    with user.held_keys(key) if key else nullcontext():
        user.drag_at((at[0] - 30, at[1] - 20), (100.0, 150.0))
    request = user.null.requests[-1]
    assert isinstance(request, PickBox) and request.takes_out == (key == "Ctrl")
    corner = user.picture.relative((at[0] - 30, at[1] - 20))
    assert request.low == pytest.approx(corner, abs=2e-3)
    assert request.high == pytest.approx(user.picture.relative((at[0] + 70, at[1] + 130)), abs=2e-3)
    tell(user, PickedBox(("red cube", "lamp"), request.takes_out))
    assert user.editor.selection.names == selected
    assert not user.editor.gesture.hint and user.undo_count == 1


@pytest.mark.parametrize("end", ["Escape", "right click"])
def test_a_box_is_given_up(user: Desk, end: str) -> None:
    user.editor.select(Selection(("grey drum",)))
    user.key("B")
    user.hold_at(user.at_picture(0.2, 0.2), (60.0, 60.0))
    if end == "Escape":
        user.key(end)
    else:
        user.press(1)
        user.release(1)
    user.release()
    user.frames(2)
    assert user.editor.selection.names == ("grey drum",) and not user.null.requests
    assert not user.editor.gesture.hint and user.scene is SCENE


def test_a_click_beside_the_picture_deselects(user: Desk) -> None:
    beside = (user.area.left + 20, user.area.top + 20)
    assert beside[1] < user.picture.top
    user.editor.select(Selection(("lamp",)))
    with user.held_keys("Ctrl"):
        user.click_at(*beside)
    assert user.editor.selection.names == ("lamp",)
    user.click_at(*beside)
    assert user.editor.selection.names == () and not user.null.requests and user.editor.control.point is None


def test_a_pick_of_what_is_gone_selects_nothing(user: Desk) -> None:
    user.editor.select(Selection(("lamp",)))
    tell(user, Picked((0.5, 0.5), "gone", False))
    assert user.editor.selection.names == ()
    user.editor.select(Selection(("lamp",)))
    tell(user, Picked((0.5, 0.5), "gone", True))
    assert user.editor.selection.names == ("lamp",)


def told(labels: list[str], look: Callable[..., None]) -> Callable[..., None]:
    """`look`, with its labels noted."""

    def note(camera: Camera, label: str, *arguments: Any) -> None:
        labels.append(label)
        look(camera, label, *arguments)

    return note


@pytest.mark.parametrize(
    ("navigation", "button", "modifiers", "label"),
    [
        ("blender", 2, "", "Orbit"),
        ("blender", 2, "Shift", "Pan"),
        ("blender", 2, "Ctrl", "Dolly"),
        ("blender", 0, "Alt", "Orbit"),
        ("plain", 0, "", "Orbit"),
        ("plain", 2, "", "Pan"),
        ("plain", 0, "Shift", "Pan"),
        ("plain", 1, "Alt", "Dolly"),
        ("plain", 1, "", "Fly"),
    ],
)
def test_a_drag_moves_the_camera(
    user: Desk, navigation: str, button: int, modifiers: str, label: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels: list[str] = []
    monkeypatch.setattr(user.editor, "look", told(labels, user.editor.look))
    user.editor.choose_navigation(navigation)
    start = user.at_picture(0.2, 0.2)
    if modifiers:
        with user.held_keys(modifiers):
            user.drag_at(start, (60.0, 40.0), button=button)
    else:
        user.drag_at(start, (60.0, 40.0), button=button)
    user.frames(2)
    changed = changes(flat(SCENE), flat(user.editor.shown))
    assert changed and all(place.startswith("camera.") for place in changed)
    assert user.scene is SCENE and user.null.views[-1].scene is user.editor.shown and set(labels) == {label}
    assert not user.null.requests and not user.editor.gesture.is_flying


def test_a_view_that_is_locked_moves_the_camera_as_one_edit(user: Desk) -> None:
    user.run("Lock camera to view")
    user.drag_at(user.at_picture(0.2, 0.2), (60.0, 40.0), button=2)
    changed = changes(flat(SCENE), flat(user.scene))
    assert changed and all(place.startswith("camera.") for place in changed)
    assert user.editor.document.history.undo_label == "Orbit" and user.undo_count == 1
    user.key("Ctrl+Z")
    assert user.scene == SCENE and not user.editor.viewing.is_free


def test_a_drag_with_the_selecting_button_alone_does_nothing_in_blenders_set(user: Desk) -> None:
    user.drag_at(user.at_picture(0.2, 0.2), (60.0, 40.0))
    assert user.scene is SCENE and not user.null.requests


def test_a_camera_drag_is_given_up_by_escape(user: Desk) -> None:
    x, y = user.at_picture(0.2, 0.2)
    user.editor.select(Selection(("lamp",)))
    user.hold_at((x, y), (60.0, 40.0), button=2)
    assert user.editor.viewing.is_free and user.editor.view.before is SCENE
    user.key("Escape")
    user.move(x + 100, y)
    user.release(2)
    user.frames(2)
    assert (
        user.editor.shown is SCENE
        and not user.editor.viewing.is_free
        and user.editor.selection.names == ("lamp",)
    )


def test_a_mouse_that_leaves_the_window_turns_no_camera_that_flies(user: Desk) -> None:
    user.move(*user.at_picture(0.2, 0.2))
    user.key("Shift+Grave_accent")
    user.move(*user.at_picture(0.25, 0.2))
    camera = user.editor.shown.camera
    assert camera != SCENE.camera
    user.move(-FLT_MAX, -FLT_MAX)  # what imgui is told then
    assert user.editor.shown.camera == camera and user.editor.gesture.is_flying
    user.key("Escape")


def test_turns_of_the_wheel_are_one_move_until_they_rest(user: Desk) -> None:
    user.move(*user.at_picture(0.2, 0.2))
    for _ in range(3):
        user.wheel(1.0)
        user.frames(3)
    assert user.editor.is_waiting and user.editor.view.before is SCENE
    user.rest(1.0)
    assert not user.editor.is_waiting and user.editor.view.before is None and user.scene is SCENE


def test_turns_of_the_wheel_are_one_entry_where_the_view_is_locked(user: Desk) -> None:
    user.run("Lock camera to view")
    user.move(*user.at_picture(0.2, 0.2))
    for _ in range(3):
        user.wheel(1.0)
        user.frames(3)
    assert user.editor.is_waiting and user.editor.document.history.before is SCENE
    user.rest(1.0)
    assert not user.editor.is_waiting and user.undo_count == 1
    user.wheel(-1.0)
    user.rest(1.0)
    assert user.undo_count == 2


def test_the_wheel_belongs_to_the_panel_under_it(user: Desk) -> None:
    user.move(*user.place("object red cube"))
    user.frame()
    user.wheel(1.0)
    assert user.scene is SCENE


def test_the_gizmo_moves_what_is_selected(user: Desk) -> None:
    user.editor.select(Selection(("red cube", "lamp")))
    user.frames(2)
    x, y = user.place("gizmo")
    user.drag_at((x + 60, y), (60.0, 0.0))
    moved = changes(flat(SCENE), flat(user.scene))
    assert {p.split(".")[1] for p in moved} == {"red cube", "lamp"} and all(".position." in p for p in moved)
    by = [
        np.subtract(user.scene.object(name).position, SCENE.object(name).position)
        for name in ("red cube", "lamp")
    ]
    np.testing.assert_allclose(by[0], by[1], atol=1e-6)
    assert by[0][0] > 0.01 and np.abs(by[0][1:]).max() < 1e-5
    assert user.place("gizmo") == pytest.approx((x + 60, y), abs=1.0)  # it follows the mouse
    assert user.undo_count == 1 and user.editor.document.history.undo_label == "Move"
    user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_the_gizmo_moves_in_steps(user: Desk) -> None:
    user.editor.preferences = replace(user.editor.preferences, snap=SnapSettings(True, move_m=0.25))
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    x, y = user.place("gizmo")
    user.drag_at((x + 60, y), (300.0, 0.0), steps=12)
    moved = user.scene.object("red cube").position[0]
    assert moved > 0 and moved / 0.25 == pytest.approx(round(moved / 0.25), abs=1e-4)


def test_the_gizmo_turns_and_scales(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.run("Scale handles")
    x, y = user.place("gizmo")
    user.drag_at((x, y), (60.0, 0.0))
    assert {p.split(".")[2] for p in changes(flat(SCENE), flat(user.scene))} == {"scale"}
    user.key("Ctrl+Z")
    assert user.scene == SCENE


@pytest.mark.parametrize(
    ("pivot", "parts"), [("Own origins", {"scale"}), ("Median point", {"scale", "position"})]
)
def test_the_gizmo_and_keys_scale_about_the_pivot(user: Desk, pivot: str, parts: set[str]) -> None:
    user.editor.select(Selection(("red cube", "lamp")))
    user.run(pivot)
    user.run("Scale handles")
    x, y = user.place("gizmo")
    user.drag_at((x, y), (60.0, 0.0))
    assert {p.split(".")[2] for p in changes(flat(SCENE), flat(user.scene))} == parts
    user.key("Ctrl+Z")
    user.run("Scale")
    user.write("2")
    user.key("Enter")
    assert {p.split(".")[2] for p in changes(flat(SCENE), flat(user.scene))} == parts


@pytest.mark.parametrize("keys", ["Escape", "Ctrl+Z"])
def test_a_drag_of_the_gizmo_is_given_up(user: Desk, keys: str) -> None:
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    x, y = user.place("gizmo")
    user.hold_at((x + 60, y), (60.0, 0.0))
    assert user.viewport.gizmo.is_using and user.scene != SCENE
    user.key(keys)
    assert user.scene == SCENE
    user.move(x + 200, y)
    user.move(x + 220, y)
    user.release()
    user.frames(2)
    assert user.scene == SCENE and user.editor.selection.names == ("red cube",)
    user.drag_at((x + 60, y), (60.0, 0.0))
    assert user.scene != SCENE and user.undo_count == 1


@pytest.mark.parametrize("keys", ["Ctrl+V", "Delete", "A", "H"])
def test_an_edit_under_a_drag_of_the_gizmo_ends_it(user: Desk, keys: str) -> None:
    user.editor.select(Selection(("red cube",)))
    user.run("Copy")
    x, y = user.place("gizmo")
    user.hold_at((x + 60, y), (60.0, 0.0))
    user.key(keys)
    scene = user.scene
    user.move(x + 200, y)
    user.move(x + 220, y)
    user.release()
    user.frames(2)
    assert user.scene == scene


def test_the_camera_moves_with_the_gizmo_under_the_mouse(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    x, y = user.place("gizmo")
    user.move(x, y)
    user.frames(2)
    assert user.viewport.gizmo.is_over
    user.wheel(1.0)
    user.rest(1.0)
    zoomed = user.editor.viewing.camera
    assert zoomed is not None and zoomed != SCENE.camera
    user.drag_at((x, y), (60.0, 0.0), button=2)
    assert user.editor.viewing.camera != zoomed and user.scene is SCENE


def test_the_bar_of_the_split_view_is_dragged(user: Desk) -> None:
    user.run("Split view")
    before = state(user.editor)
    width = user.picture.width
    user.drag("split bar", width / 4)
    after = state(user.editor)
    assert changes(before, after) == {"preferences.display.split_position"}
    assert after["preferences.display.split_position"] == pytest.approx(0.75, abs=0.01)
    user.drag("split bar", width)
    assert user.editor.preferences.display.split_position == 1.0
    assert not user.null.requests and user.undo_count == 0


def test_hidden_objects_have_no_gizmo(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.run("Hide")
    assert not user.shows("gizmo")


def test_a_hand_that_rests_changes_nothing(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    user.begin()
    editor = user.editor
    outcome = user.viewport.update(
        editor.scene, editor.selection, editor.tool, editor.preferences, user.picture
    )
    user.end()
    assert outcome == Outcome(editor.scene, editor.selection, editor.preferences.display)


def test_handles_and_fields_agree_about_uniform_scale() -> None:
    front = replace(SCENE.with_object("red cube", rotation=(0, 0, 0), scale=(1, 2, 1)),
                    camera=Camera((0, 0.5, 5), (0, 0.5, 0)))  # fmt: skip
    with desk(front) as user:
        user.editor.select(Selection(("red cube",)))
        user.run("Scale handles")
        x, y = user.place("gizmo")
        for is_uniform, expected in ((True, (1, 2, 1)), (False, (1, 0, 0))):
            user.editor.tool = replace(user.editor.tool, is_uniform=is_uniform)
            start = 80.0
            while user.scene is front and start < 400:
                user.drag_at((x + start, y), (30.0, 0.0))
                start += 10
            grown = np.subtract(user.scene.object("red cube").scale, (1, 2, 1))
            assert grown[0] > 0.05
            np.testing.assert_allclose(grown, grown[0] * np.array(expected), atol=1e-4)
            assert user.undo_count == 1
            user.key("Ctrl+Z")
