"""The menu bar and the keys, both from the table of commands. They return what the user chose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import groupby

from imgui_bundle import imgui

from incpt.ui.commands import files
from incpt.ui.commands.command import Action, Command
from incpt.ui.commands.table import COMMANDS, MENUS, SELECTION_MENU, command
from incpt.ui.editor.editor import Editor
from incpt.ui.widgets import focus, places

_MODIFIERS = {
    "Ctrl": imgui.Key.mod_ctrl,
    "Shift": imgui.Key.mod_shift,
    "Alt": imgui.Key.mod_alt,
}
"""imgui's modifiers, by their names in the table of commands."""
_KEY_NAMES = {"KeypadDecimal": "keypad_decimal", "KeypadDivide": "keypad_divide"}
"""imgui's names of keys, where they are not those of the table in lower case."""
_TITLES = {"add": "Add", "shading": "Shading"}
"""What stands above the commands of a menu at the mouse; that of the selection says what is selected."""
_ANY_POPUP = imgui.PopupFlags_.any_popup


def draw_menu_bar(editor: Editor) -> Action | None:
    """The bar at the top of the window; returns what was chosen in it."""
    if not imgui.begin_main_menu_bar():
        return None
    chosen = None
    for menu in MENUS:
        is_open = imgui.begin_menu(menu)
        places.note(f"menu {menu}")
        if is_open:
            chosen = _draw_entries(editor, menu) or chosen
            if menu == "File":
                chosen = _draw_recent(editor) or chosen
            imgui.end_menu()
    imgui.end_main_menu_bar()
    return chosen


def draw_popups(editor: Editor) -> Action | None:
    """The menus that open at the mouse: what can be added, and what can be done with the selection; returns
    what was chosen in one."""
    if editor.screen.wanted_menu:
        imgui.open_popup(editor.screen.wanted_menu)
        editor.screen = replace(editor.screen, wanted_menu="")
    chosen = None
    for name, groups in _popups().items():
        if not imgui.begin_popup(name):
            continue
        imgui.text_disabled(_popup_title(editor, name))
        for commands in groups:
            imgui.separator()
            chosen = _draw_commands(editor, commands) or chosen
        imgui.end_popup()
    return chosen


def pressed_command(editor: Editor) -> Command | None:
    """The command whose keys went down in this frame; none while a text is typed, a dialog is open, or what
    is under way in the picture takes the keys."""
    if focus.is_typing() or editor.dialog is not None or editor.gesture.takes_keys:
        return None
    if imgui.is_key_pressed(imgui.Key.escape, False) and imgui.is_popup_open("", _ANY_POPUP):
        imgui.internal.close_popup_to_level(0, True)
        return None
    navigation, own = editor.preferences.navigation, dict(editor.preferences.keys)
    for one in COMMANDS:
        if any(imgui.is_key_chord_pressed(key_chord(keys)) for keys in one.keys_in(navigation, own)):
            # A menu at the mouse shows keys, and one that is pressed takes the place of a click there.
            if any(map(imgui.is_popup_open, _popups())):
                imgui.internal.close_popup_to_level(0, True)
            return one
    return None


@cache
def key_chord(keys: str) -> int:
    """imgui's number for keys written like "Ctrl+Shift+S". Raises AttributeError for a key that is none."""
    *modifiers, key = keys.split("+")
    chord = int(getattr(imgui.Key, _KEY_NAMES.get(key, key.lower())))
    for name in modifiers:
        chord |= int(_MODIFIERS[name])
    return chord


@cache
def _popups() -> dict[str, list[list[Command]]]:
    """Groups of commands of the menus that open at the mouse, by name."""
    return {
        "add": [[one for one in COMMANDS if one.menu == "Object/Add"]],
        "shading": [[one for one in COMMANDS if one.menu == "View/Shading"]],
        "selection": [[command(name) for name in names] for names in SELECTION_MENU],
    }


def _popup_title(editor: Editor, name: str) -> str:
    if name in _TITLES:
        return _TITLES[name]
    names = editor.selection.names
    return names[0] if len(names) == 1 else f"{len(names)} selected"


def _draw_entries(editor: Editor, menu: str) -> Action | None:
    group, chosen = None, None
    for place, commands in _by_place(menu):
        if group is not None and commands[0].group != group:
            imgui.separator()
        group = commands[0].group
        if place == menu:
            chosen = _draw_commands(editor, commands) or chosen
        elif imgui.begin_menu(place.removeprefix(f"{menu}/")):
            chosen = _draw_commands(editor, commands) or chosen
            imgui.end_menu()
        if place != menu:
            places.note(f"menu {place}")
    return chosen


def _by_place(menu: str) -> Iterator[tuple[str, list[Command]]]:
    own = [one for one in COMMANDS if one.menu.split("/")[0] == menu]
    for (place, _group), commands in groupby(own, lambda one: (one.menu, one.group)):
        yield place, list(commands)


def _draw_commands(editor: Editor, commands: list[Command]) -> Action | None:
    chosen = None
    for one in commands:
        is_checked = one.checked is not None and one.checked(editor)
        own = dict(editor.preferences.keys)
        keys = next(iter(one.printed_keys(editor.preferences.navigation, own)), "")
        detail = one.detail(editor) if one.detail is not None else None
        label = f"{one.name} {detail}###{one.name}" if detail else one.name
        pressed, _ = imgui.menu_item(label, keys, is_checked, one.is_enabled(editor))
        places.note(one.name)
        if one.help and imgui.is_item_hovered(imgui.HoveredFlags_.delay_normal):
            imgui.set_tooltip(one.help)
        if pressed:
            chosen = one.action
    return chosen


def _draw_recent(editor: Editor) -> Action | None:
    imgui.separator()
    files_there = editor.preferences.recent_files
    chosen = None
    is_open = imgui.begin_menu("Open recent", bool(files_there))
    places.note("menu File/Open recent")
    if is_open:
        for path in files_there:
            if imgui.menu_item_simple(str(path)):
                chosen = path
            places.note(f"recent {path.name}")
        imgui.end_menu()
    return None if chosen is None else lambda editor: files.open_file(editor, chosen)
