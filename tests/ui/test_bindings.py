"""The table of what the mouse does."""

from __future__ import annotations

import pytest

from incpt.ui import bindings
from incpt.ui.bindings import ALT, CTRL, NAVIGATION, SHIFT, Button, MouseAction
from incpt.ui.preferences import NAVIGATIONS


def test_every_navigation_that_can_be_chosen_is_there_and_can_do_everything() -> None:
    assert set(NAVIGATION) == set(NAVIGATIONS)
    for table in NAVIGATION.values():
        assert {b.action for b in table} == {
            MouseAction.ORBIT, MouseAction.PAN, MouseAction.DOLLY, MouseAction.ZOOM, MouseAction.FLY
        }  # fmt: skip


@pytest.mark.parametrize("table", [*NAVIGATION.values(), bindings.CLICKS])
def test_no_gesture_means_two_things(table: tuple[bindings.Binding, ...]) -> None:
    gestures = [(b.button, b.modifiers) for b in table]
    assert len(set(gestures)) == len(gestures)
    assert all(b.modifiers <= {SHIFT, CTRL, ALT} for b in table)


@pytest.mark.parametrize(
    ("navigation", "button", "modifiers", "action"),
    [
        ("blender", Button.MIDDLE, (), MouseAction.ORBIT),
        ("blender", Button.MIDDLE, (SHIFT,), MouseAction.PAN),
        ("blender", Button.MIDDLE, [CTRL], MouseAction.DOLLY),
        ("blender", Button.LEFT, {ALT, SHIFT}, MouseAction.PAN),
        ("blender", Button.GRAVE, {SHIFT}, MouseAction.FLY),
        ("blender", Button.LEFT, (), None),
        ("blender", Button.RIGHT, (), None),
        ("blender", Button.MIDDLE, (SHIFT, CTRL), None),
        ("plain", Button.LEFT, (), MouseAction.ORBIT),
        ("plain", Button.LEFT, (ALT,), MouseAction.ORBIT),
        ("plain", Button.MIDDLE, (ALT,), MouseAction.PAN),
        ("plain", Button.RIGHT, (ALT,), MouseAction.DOLLY),
        ("plain", Button.RIGHT, (), MouseAction.FLY),
        ("plain", Button.WHEEL, (), MouseAction.ZOOM),
        ("plain", Button.WHEEL, (CTRL,), None),
    ],
)
def test_drags(
    navigation: str, button: Button, modifiers: tuple[str, ...], action: MouseAction | None
) -> None:
    assert bindings.action_for(navigation, button, modifiers) is action


def test_clicks_select_with_the_left_and_the_right_button() -> None:
    for button, action in ((Button.LEFT, MouseAction.SELECT), (Button.RIGHT, MouseAction.SELECT_OR_MENU)):
        assert bindings.click_action(button, ()) is action
        assert bindings.click_action(button, {CTRL}) is MouseAction.SELECT_MORE
        assert bindings.click_action(button, [SHIFT]) is MouseAction.SELECT_MORE
        assert bindings.click_action(button, {ALT}) is None
    assert bindings.click_action(Button.MIDDLE, ()) is None


def test_a_click_may_tremble() -> None:
    assert not bindings.is_drag(2, -3) and bindings.is_drag(0, -4) and bindings.is_drag(3, 3)
    assert not bindings.is_drag(3, 3, scale=2) and bindings.is_drag(6, 6, scale=2)


def test_help_tells_every_gesture_once() -> None:
    lines = dict(bindings.help_lines("blender"))
    assert lines["Shift + middle drag"] == "Pan" and lines["Wheel"].startswith("Zoom")
    assert "Shift + `" in lines and "Ctrl + left click" in lines and "W" in lines
    for navigation in NAVIGATION:
        keys = [keys for keys, _ in bindings.help_lines(navigation)]
        assert len(set(keys)) == len(keys)


def test_opposite_fly_keys_cancel() -> None:
    assert not any(sum(getattr(k, axis) for k in bindings.FLY_KEYS) for axis in ("forward", "right", "up"))
