"""The menu bar and the keys, both from the table of commands."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import groupby

from imgui_bundle import imgui

from incpt.ui.commands import actions
from incpt.ui.commands.commands import COMMANDS, MENUS, Command, run
from incpt.ui.editor.editor import Editor
from incpt.ui.widgets import places

_MODIFIERS = {
    "Ctrl": imgui.Key.mod_ctrl,
    "Shift": imgui.Key.mod_shift,
    "Alt": imgui.Key.mod_alt,
}
_KEY_NAMES = {"KeypadDecimal": "keypad_decimal"}
_ANY_POPUP = imgui.PopupFlags_.any_popup


def draw_menu_bar(editor: Editor) -> None:
    """The bar at the top of the window."""
    if not imgui.begin_main_menu_bar():
        return
    for menu in MENUS:
        is_open = imgui.begin_menu(menu)
        places.note(f"menu {menu}")
        if is_open:
            _draw_entries(editor, menu)
            if menu == "File":
                _draw_recent(editor)
            imgui.end_menu()
    imgui.end_main_menu_bar()


def press_keys(editor: Editor) -> None:
    """Run the command whose keys went down in this frame; not while a text is typed, a dialog is open or the
    camera flies, whose keys are letters."""
    if imgui.get_io().want_text_input or editor.dialog is not None or editor.is_flying:
        return
    if imgui.is_key_pressed(imgui.Key.escape, False) and imgui.is_popup_open("", _ANY_POPUP):
        imgui.internal.close_popup_to_level(0, True)
        return
    navigation = editor.preferences.navigation
    for one in COMMANDS:
        keys = one.keys_in(navigation)
        if keys and imgui.is_key_chord_pressed(key_chord(keys)):
            run(editor, one)
            return


@cache
def key_chord(keys: str) -> int:
    """imgui's number for keys written like "Ctrl+Shift+S". Raises AttributeError for a key that is none."""
    *modifiers, key = keys.split("+")
    chord = int(getattr(imgui.Key, _KEY_NAMES.get(key, key.lower())))
    for name in modifiers:
        chord |= int(_MODIFIERS[name])
    return chord


def _draw_entries(editor: Editor, menu: str) -> None:
    group = None
    for place, commands in _by_place(menu):
        if group is not None and commands[0].group != group:
            imgui.separator()
        group = commands[0].group
        if place == menu:
            _draw_commands(editor, commands)
        elif imgui.begin_menu(place.removeprefix(f"{menu}/")):
            _draw_commands(editor, commands)
            imgui.end_menu()
        if place != menu:
            places.note(f"menu {place}")


def _by_place(menu: str) -> Iterator[tuple[str, list[Command]]]:
    own = [one for one in COMMANDS if one.menu.split("/")[0] == menu]
    for (place, _group), commands in groupby(own, lambda one: (one.menu, one.group)):
        yield place, list(commands)


def _draw_commands(editor: Editor, commands: list[Command]) -> None:
    for one in commands:
        is_checked = one.checked is not None and one.checked(editor)
        keys = one.keys_in(editor.preferences.navigation)
        detail = one.detail(editor) if one.detail is not None else None
        label = f"{one.name} {detail}###{one.name}" if detail else one.name
        pressed, _ = imgui.menu_item(label, keys, is_checked, one.is_enabled(editor))
        places.note(one.name)
        if one.help and imgui.is_item_hovered(imgui.HoveredFlags_.delay_normal):
            imgui.set_tooltip(one.help)
        if pressed:
            run(editor, one)


def _draw_recent(editor: Editor) -> None:
    imgui.separator()
    files = editor.preferences.recent_files
    if imgui.begin_menu("Open recent", bool(files)):
        for path in files:
            if imgui.menu_item_simple(str(path)):
                actions.open_file(editor, path)
        imgui.end_menu()
