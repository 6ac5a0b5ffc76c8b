"""What the editor remembers, to be changed at once: how it looks, how it saves, and its keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from imgui_bundle import imgui

from incpt.ui import bindings
from incpt.ui.dialogs import modal
from incpt.ui.dialogs.help_page import NAVIGATION_TEXTS
from incpt.ui.editor.dialog import Answer
from incpt.ui.preferences import NAVIGATIONS, THEMES, Preferences
from incpt.ui.widgets import focus, places, widgets

KeyRows = Callable[[str, Mapping[str, str]], list[tuple[str, tuple[str, ...]]]]
"""Commands and their keys, of a set of bindings and of what a person gave to commands."""
SCALES = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Scales of the interface that are offered."""
_OF_MONITOR = "monitor"
_WIDTH = 560.0
"""Width of the dialog, in points at a scale of 1."""
_ROWS = 9
"""Height of the list of keys, in rows."""
_SPECIAL = {"KeypadDecimal": "keypad_decimal", "KeypadDivide": "keypad_divide"}
"""imgui's names of keys, where they are not those of the table in lower case."""


class PreferencesDialog:
    """Fields for the preferences. `change` takes them after each change, so that it is seen at once;
    `key_rows` tells the keys of commands."""

    def __init__(
        self, preferences: Preferences, change: Callable[[Preferences], None], key_rows: KeyRows
    ) -> None:
        self.preferences, self._change, self._key_rows = preferences, change, key_rows
        self.asked: str | None = None
        """The command whose keys are pressed next; None: none."""
        self._search = ""

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("Preferences", width=_WIDTH):
            return None
        # What is pressed for a command is not for the dialog, even if it ends the asking.
        takes_keys = self.asked is None and not focus.is_typing()
        changed = self._draw_keys(draw_fields(self.preferences))
        is_closed = modal.buttons(["Close"], takes_keys=takes_keys) is not None
        modal.end()
        if changed != self.preferences:
            self.preferences = changed
            self._change(changed)
        return Answer() if is_closed else None

    def _draw_keys(self, preferences: Preferences) -> Preferences:
        """The keys of all commands; returns the preferences after this frame."""
        imgui.separator_text("Keys")
        imgui.set_next_item_width(-1)
        _, self._search = imgui.input_text_with_hint("##search keys", "Search", self._search)
        places.note("Search keys")
        own = dict(preferences.keys)
        rows = self._key_rows(preferences.navigation, own)
        wanted = self._search.strip().lower()
        height = imgui.get_frame_height_with_spacing() * _ROWS
        if imgui.begin_child("keys", imgui.ImVec2(0, height), imgui.ChildFlags_.borders):
            for name, keys in rows:
                if wanted in name.lower():
                    own = self._draw_row(name, keys, own)
        imgui.end_child()
        if self.asked is not None:
            own = self._take_keys(self.asked, dict(rows), own)
        return replace(preferences, keys=tuple(own.items()))

    def _draw_row(self, name: str, keys: tuple[str, ...], own: dict[str, str]) -> dict[str, str]:
        shown = " or ".join(bindings.printed(one.split("+")) for one in keys) or "none"
        with widgets.row(name):
            if widgets.button(f"{'Press keys…' if self.asked == name else shown}##keys of {name}"):
                self.asked = name
            if imgui.is_item_hovered():
                imgui.set_tooltip("Press others; Esc leaves them, Backspace takes them away")
            if name in own:
                widgets.same_line()
                if widgets.button(f"Reset##keys of {name}"):
                    own = {other: given for other, given in own.items() if other != name}
        return own

    def _take_keys(
        self, name: str, rows: Mapping[str, tuple[str, ...]], own: dict[str, str]
    ) -> dict[str, str]:
        """Give a command what is pressed in this frame; another one that had it loses it."""
        if imgui.is_key_pressed(imgui.Key.escape, False):
            self.asked = None
        elif imgui.is_key_pressed(imgui.Key.backspace, False):
            self.asked = None
            return {**own, name: ""}
        pressed = _pressed_chord()
        if pressed is None or self.asked is None:
            return own
        self.asked = None
        losing = {other: "" for other, keys in rows.items() if pressed in keys}
        return {**own, **losing, name: pressed}


def _pressed_chord() -> str | None:
    """The keys that went down in this frame, as commands have them."""
    io = imgui.get_io()
    are_held = zip(bindings.MODIFIERS, (io.key_ctrl, io.key_shift, io.key_alt), strict=True)
    held = [name for name, is_held in are_held if is_held]
    for key in bindings.KEY_NAMES:
        if imgui.is_key_pressed(getattr(imgui.Key, _SPECIAL.get(key, key.lower())), False):
            return "+".join([*held, key])
    return None


def draw_fields(preferences: Preferences) -> Preferences:
    """How the editor looks and saves; returns the preferences after this frame."""
    themes = [(name, name.capitalize()) for name in THEMES]
    theme = widgets.choice("Theme", preferences.theme, themes, "Of the panels; the picture is as it is")
    scale = preferences.ui_scale
    offered = sorted({*SCALES, *([scale] if scale is not None else [])})
    scales = [(_OF_MONITOR, "As the monitor says"), *((f"{one:g}", f"{100 * one:.0f} %") for one in offered)]
    chosen = widgets.choice("Scale", _OF_MONITOR if scale is None else f"{scale:g}", scales)
    sets = [(name, NAVIGATION_TEXTS[name]) for name in NAVIGATIONS]
    navigation = widgets.choice("Bindings", preferences.navigation, sets, "Keys and moves of the mouse")
    autosave = widgets.number(
        "Autosave", preferences.autosave_seconds, low=1.0, high=3600.0, speed=0.5, unit=" s", decimals=0,
        tip="Between two writes of the recovery file",
    )  # fmt: skip
    fly_speed = widgets.number(
        "Fly speed", preferences.fly_speed, low=0.01, high=1000.0, speed=0.02, unit=" m/s", decimals=2
    )
    return replace(
        preferences,
        theme=theme,
        ui_scale=None if chosen == _OF_MONITOR else float(chosen),
        navigation=navigation,
        autosave_seconds=min(max(autosave, 1.0), 86400.0),
        fly_speed=min(max(fly_speed, 1e-4), 1e6),
    )
