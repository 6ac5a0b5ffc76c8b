"""What the hand does while something is under way in the picture, read from imgui."""

from __future__ import annotations

from enum import Enum

from imgui_bundle import imgui

from incpt.ui.rect import Point
from incpt.ui.viewport.modal_transform import OPERATIONS, Input

_AXIS_KEYS = ("x", "y", "z")


class Ending(Enum):
    """How what is under way ends."""

    CONFIRMED = "confirmed"
    GIVEN_UP = "given up"


def mouse(otherwise: Point) -> Point:
    """Where the mouse is, in points; `otherwise` while it is outside of the window."""
    position = imgui.get_mouse_pos()
    return (position.x, position.y) if imgui.is_mouse_pos_valid() else otherwise


def ending() -> Ending | None:
    """Whether it ends in this frame: by Escape or the right button, or by Enter or the left one."""
    if is_given_up():
        return Ending.GIVEN_UP
    is_entered = _is_pressed("enter") or _is_pressed("keypad_enter")
    return Ending.CONFIRMED if is_entered or imgui.is_mouse_clicked(imgui.MouseButton_.left) else None


def is_given_up() -> bool:
    """Whether Escape or the right button is pressed in this frame."""
    return _is_pressed("escape") or imgui.is_mouse_clicked(imgui.MouseButton_.right)


def transform_input(last_mouse: Point, is_snapping: bool) -> Input:
    """A frame's input of a transform. The mouse stays at `last_mouse` while it is outside of the window;
    `is_snapping` is what the preferences say, which Ctrl turns round."""
    io = imgui.get_io()
    plane = "shift+" if io.key_shift else ""
    keys = [f"{plane}{key}" for key in _AXIS_KEYS if _is_pressed(key)]
    keys += [key for key in OPERATIONS if _is_pressed(key)]
    keys += ["backspace"] if imgui.is_key_pressed(imgui.Key.backspace, True) else []
    keys += ["tab"] if _is_pressed("tab") else []
    text = "".join(map(chr, io.input_queue_characters))
    return Input(mouse(last_mouse), tuple(keys), text, io.key_shift, is_snapping != io.key_ctrl)


def take_mouse(is_taken: bool) -> None:
    """Keep the mouse from panels and menus from the next frame on, or leave it to them again."""
    io = imgui.get_io()
    flag = imgui.ConfigFlags_.no_mouse.value
    io.config_flags = (io.config_flags | flag) if is_taken else (io.config_flags & ~flag)


def _is_pressed(key: str) -> bool:
    return imgui.is_key_pressed(getattr(imgui.Key, key), False)
