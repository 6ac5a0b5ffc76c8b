"""The one table of what the mouse does in the picture, in two sets: as in Blender, and plain.

The viewport looks a press of a button up here, and Help shows the table. Keys of commands stand in
`commands`; the keys that fly stand here, because they are held.

A press that moves less than CLICK_PX until it is released is a click and selects; from there on it is a
drag and moves the camera, even with the button that selects. So no button has to choose between the two.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import Enum

CLICK_PX = 4.0
"""Movement from which on a press is a drag, pixels of the screen at a scale of 1."""

SHIFT, CTRL, ALT = "shift", "ctrl", "alt"
"""The modifier keys, as `Binding.modifiers` names them."""


_PRINTED = {
    CTRL: "Ctrl", SHIFT: "Shift", ALT: "Alt", "KeypadDecimal": "Numpad .", "KeypadDivide": "Numpad /",
    "Comma": ",", "Slash": "/", "Escape": "Esc",
    **{f"Keypad{digit}": f"Numpad {digit}" for digit in range(10)},
}  # fmt: skip
"""What is printed on keys, by their names in the tables where these differ."""
if sys.platform == "darwin":  # imgui takes the key of that place for Ctrl there.
    _PRINTED |= {"Ctrl": "Cmd", "Alt": "Option", CTRL: "Cmd", ALT: "Option"}


KEY_NAMES = (
    *(chr(letter) for letter in range(ord("A"), ord("Z") + 1)),
    *(f"F{number}" for number in range(1, 13)),
    *(f"Keypad{digit}" for digit in range(10)),
    "KeypadDecimal", "KeypadDivide", "Delete", "Insert", "Home", "End", "Space", "Tab", "Comma", "Period",
    "Slash",
)  # fmt: skip
"""The keys that a command may have, beside Escape, by their names in the tables."""
MODIFIERS = ("Ctrl", "Shift", "Alt")
"""What is held with them, in the order in which it is written."""


def is_chord(text: str) -> bool:
    """Whether a text such as "Ctrl+Shift+S" names keys that a command may have."""
    *held, key = text.split("+")
    return key in KEY_NAMES and len(set(held)) == len(held) and set(held) <= set(MODIFIERS)


def printed(keys: Iterable[str]) -> str:
    """Keys that are pressed together, as people read them on a keyboard: "Ctrl + Numpad 1"."""
    return " + ".join(_PRINTED.get(key, key) for key in keys)


class MouseAction(Enum):
    """What the mouse does in the picture."""

    ORBIT = "orbit"
    PAN = "pan"
    DOLLY = "dolly"
    ZOOM = "zoom"
    FLY = "fly"
    SELECT = "select"
    SELECT_MORE = "select more"
    SELECT_OR_MENU = "select or menu"


_CLICK_ACTIONS = (MouseAction.SELECT, MouseAction.SELECT_MORE, MouseAction.SELECT_OR_MENU)


class Button(Enum):
    """What is pressed or turned. A key toggles flying; a button held flies while it is held."""

    LEFT = "left"
    MIDDLE = "middle"
    RIGHT = "right"
    WHEEL = "wheel"
    GRAVE = "`"


@dataclass(frozen=True)
class Binding:
    """One line of the table: `modifiers` are exactly those that must be held."""

    button: Button
    modifiers: frozenset[str]
    action: MouseAction
    description: str

    @property
    def keys(self) -> str:
        """What to do, as Help shows it: "Shift + middle drag"."""
        held = [name for name in (CTRL, ALT, SHIFT) if name in self.modifiers]
        gesture = {Button.WHEEL: "wheel", Button.GRAVE: "`"}.get(self.button)
        if gesture is None:
            is_click = self.action in _CLICK_ACTIONS
            gesture = f"{self.button.value} {'click' if is_click else 'drag'}"
        text = printed([*held, gesture])
        return text[0].upper() + text[1:]


def _binding(keys: str, action: MouseAction, description: str) -> Binding:
    *modifiers, button = keys.split("+")
    return Binding(Button(button), frozenset(modifiers), action, description)


CLICKS = (
    _binding("left", MouseAction.SELECT, "Select what is under the cursor; on nothing: deselect"),
    _binding("right", MouseAction.SELECT_OR_MENU, "The same; on what is selected: what can be done with it"),
    _binding(
        "shift+left", MouseAction.SELECT_MORE, "Add it to the selection; the last one added: take it out"
    ),
    _binding("shift+right", MouseAction.SELECT_MORE, "The same"),
    _binding("ctrl+left", MouseAction.SELECT_MORE, "The same"),
    _binding("ctrl+right", MouseAction.SELECT_MORE, "The same"),
)
"""What clicks do, in both sets."""

_WHEEL = _binding("wheel", MouseAction.ZOOM, "Zoom towards the cursor")
"""What the wheel does in both sets."""

NAVIGATION: dict[str, tuple[Binding, ...]] = {
    # A touchpad has no middle button: Alt with the left button stands in for it, as Blender's "Emulate 3
    # Button Mouse" has it.
    "blender": (
        _binding("middle", MouseAction.ORBIT, "Orbit around the target"),
        _binding("shift+middle", MouseAction.PAN, "Pan"),
        _binding("ctrl+middle", MouseAction.DOLLY, "Move nearer or farther"),
        _WHEEL,
        _binding("alt+left", MouseAction.ORBIT, "Orbit, without a middle button"),
        _binding("alt+shift+left", MouseAction.PAN, "Pan, without a middle button"),
        _binding("alt+ctrl+left", MouseAction.DOLLY, "Move nearer or farther, without a middle button"),
        _binding("shift+`", MouseAction.FLY, "Fly until a click or Escape"),
    ),
    # These are Maya's three moves with Alt, and the bare buttons of viewers such as Sketchfab and Unreal,
    # because many desktops keep Alt + left drag for themselves.
    "plain": (
        _binding("left", MouseAction.ORBIT, "Orbit around the target"),
        _binding("middle", MouseAction.PAN, "Pan"),
        _binding("right", MouseAction.FLY, "Look around, and fly while it is held"),
        _WHEEL,
        _binding("shift+left", MouseAction.PAN, "Pan"),
        _binding("alt+left", MouseAction.ORBIT, "Orbit, as in Maya"),
        _binding("alt+middle", MouseAction.PAN, "Pan, as in Maya"),
        _binding("alt+right", MouseAction.DOLLY, "Move nearer or farther, as in Maya"),
    ),
}
"""Drags, the wheel and keys, by name of the set (`preferences.NAVIGATIONS`)."""


@dataclass(frozen=True)
class FlyKey:
    """A key that flies while it is held: its direction as `camera_moves.fly` takes it."""

    key: str
    forward: float
    right: float
    up: float
    description: str


FLY_KEYS = (
    FlyKey("w", 1, 0, 0, "Fly forward"),
    FlyKey("s", -1, 0, 0, "Fly back"),
    FlyKey("a", 0, -1, 0, "Fly left"),
    FlyKey("d", 0, 1, 0, "Fly right"),
    FlyKey("e", 0, 0, 1, "Fly up"),
    FlyKey("q", 0, 0, -1, "Fly down"),
)
"""The keys that fly, in both sets."""
FLY_FAST = 4.0
"""How much faster the camera flies while Shift is held."""


MODAL_LINES = (
    ("X, Y, Z", "Along that axis of the world; again: along the object's own; again: freely"),
    ("Shift + X, Y, Z", "In the plane across that axis; again: across the object's own"),
    (
        "0 to 9, + and -",
        "By so much: metres, degrees or a factor; + begins the next number of a sum, - turns the sign",
    ),
    ("Tab", "Type the number of the next axis of a move"),
    ("Backspace", "Take the last digit back; without one the mouse counts again"),
    (
        "Ctrl",
        "Snaps as the Gizmo section says: in steps, or to surfaces or vertices; freely, where Snap is on",
    ),
    ("Shift", "A tenth of the mouse's way, and of a step"),
    ("G, R, S", "Move, rotate or scale instead; R while it rotates: a trackball"),
    ("Enter, left click", "Done: one edit to undo"),
    ("Esc, right click", "Give it up: all is as it was"),
)
"""(keys, what they do) while something is moved, turned or scaled by G, R or S, for Help, in both sets."""


def action_for(navigation: str, button: Button, modifiers: Collection[str]) -> MouseAction | None:
    """What a drag with a button, a turn of the wheel or a key does in a set; None: nothing."""
    return _found(NAVIGATION[navigation], button, modifiers)


def click_action(button: Button, modifiers: Collection[str]) -> MouseAction | None:
    """What a click does, in both sets; None: nothing."""
    return _found(CLICKS, button, modifiers)


def is_drag(dx: float, dy: float, scale: float = 1.0) -> bool:
    """Whether a press that moved so many pixels is a drag, on a screen of that scale."""
    return dx * dx + dy * dy >= (CLICK_PX * scale) ** 2


def help_lines(navigation: str) -> list[tuple[str, str]]:
    """(what to do, what it does) for Help: clicks, then the set, then the keys that fly."""
    lines = [(binding.keys, binding.description) for binding in (*CLICKS, *NAVIGATION[navigation])]
    lines += [(fly.key.upper(), f"{fly.description}, while flying") for fly in FLY_KEYS]
    return [*lines, ("Shift", f"Fly {FLY_FAST:g} times as fast")]


def _found(bindings: tuple[Binding, ...], button: Button, modifiers: Collection[str]) -> MouseAction | None:
    held = frozenset(modifiers)
    for binding in bindings:
        if binding.button is button and binding.modifiers == held:
            return binding.action
    return None
