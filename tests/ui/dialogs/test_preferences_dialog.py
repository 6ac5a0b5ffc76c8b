"""The preferences dialog: what is changed in it is seen at once, and keys of commands are one's own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, state

from incpt.scene.selection import Selection
from incpt.ui import bindings
from incpt.ui.commands import menus
from incpt.ui.commands.table import COMMANDS, command, help_lines
from incpt.ui.dialogs.preferences_dialog import PreferencesDialog
from incpt.ui.preferences import Preferences
from incpt.ui.widgets import places, theme

SCENE = mixed_scene(size=(48, 32))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(("red cube",)))
        made.frames(2)
        yield made
    theme._theme[0] = "dark"


def opened(user: Desk) -> PreferencesDialog:
    user.key("Ctrl+Comma")
    user.frames(3)
    dialog = user.editor.dialog
    assert isinstance(dialog, PreferencesDialog)
    return dialog


def test_each_field_changes_one_thing_at_once(user: Desk) -> None:
    dialog = opened(user)
    for label, text, place, value in (
        ("Theme", "Light", "theme", "light"),
        ("Scale", "150 %", "ui_scale", 1.5),
        ("Scale", "As the monitor says", "ui_scale", None),
        ("Bindings", "Plain", "navigation", "plain"),
    ):
        before = state(user.editor)
        user.choose(label, text)
        after = state(user.editor)
        assert changes(before, after) == {f"preferences.{place}"}
        assert after[f"preferences.{place}"] == value
    user.type("Autosave", "12")
    user.type("Fly speed", "5")
    assert user.editor.dialog is dialog, "Enter ended the typing"
    kept = user.editor.preferences
    assert (kept.autosave_seconds, kept.fly_speed) == (12.0, 5.0)
    user.type("Autosave", "0")
    assert user.editor.preferences.autosave_seconds == 1.0
    user.key("Escape")
    assert user.editor.dialog is None and user.undo_count == 0


def give(user: Desk, name: str, keys: str) -> None:
    user.click("Search keys")
    user.key("Ctrl+A")
    user.write(name)
    user.frames(2)
    (button,) = [
        one for one in places.names() if one.endswith(f"##keys of {name}") and not one.startswith("Reset")
    ]
    user.click(button)
    user.frames(2)
    user.key(keys)
    user.frames(2)


def test_a_command_gets_other_keys_and_who_had_them_loses_them(user: Desk) -> None:
    dialog = opened(user)
    give(user, "Hide", "Ctrl+D")
    assert dict(user.editor.preferences.keys) == {"Hide": "Ctrl+D"}
    give(user, "Show all", "Ctrl+D")
    assert dict(user.editor.preferences.keys) == {"Hide": "", "Show all": "Ctrl+D"}
    give(user, "Frame all", "Escape")
    assert user.editor.dialog is dialog and "Frame all" not in dict(user.editor.preferences.keys)
    give(user, "Add…", "Backspace")
    assert dict(user.editor.preferences.keys)["Add…"] == ""
    user.click("Reset##keys of Add…")
    assert "Add…" not in dict(user.editor.preferences.keys)
    user.key("Escape")
    user.frames(2)
    user.run("Hide")
    assert not user.scene.object("red cube").visible
    user.key("Alt+H")
    assert not user.scene.object("red cube").visible, "the keys of the table are no longer its own"
    user.key("Ctrl+D")
    assert user.scene.object("red cube").visible


def test_menus_and_help_tell_them(user: Desk) -> None:
    own = {"Hide": "Ctrl+H", "Move": "", "Scale": "no keys", "Rotate": "Ctrl+Ctrl+X"}
    lines = {what.split(":")[0]: keys for keys, what in help_lines("blender", own)}
    assert lines["Hide"] == "Ctrl + H" and "Move" not in lines
    assert lines["Scale"] == "S" and lines["Rotate"] == "R", "what names no keys counts for nothing"
    assert command("Hide").printed_keys("plain", own) == ("Ctrl + H",)


def test_all_keys_of_the_tables_can_be_given() -> None:
    for navigation in ("blender", "plain"):
        for one in COMMANDS:
            assert all(bindings.is_chord(keys) or keys == "Escape" for keys in one.keys_in(navigation)), one
    assert all(menus.key_chord(key) for key in bindings.KEY_NAMES)
    for wrong in ("", "Ctrl", "ctrl+a", "A+Ctrl", "Escape", "Shift+"):
        assert not bindings.is_chord(wrong)


def test_text_can_be_read_in_either_theme() -> None:
    """At least 4.5 to 1 on the ground of panels, as WCAG 2 asks for."""

    def luminance(color: theme.Rgba) -> float:
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color[:3]]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    for name, colors in (("dark", theme._DARK), ("light", theme._LIGHT)):
        ground = luminance(colors["window_bg"])
        for role, color in theme._TEXTS[name].items():
            low, high = sorted((ground, luminance(color)))
            assert (high + 0.05) / (low + 0.05) >= 4.5, (name, role)
    assert set(theme._DARK) == set(theme._LIGHT)
    assert Preferences().theme in theme.THEMES
