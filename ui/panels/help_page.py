"""The page with all keys and moves of the mouse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from incpt.ui import bindings
from incpt.ui.preferences import NAVIGATIONS
from incpt.ui.widgets import widgets

if TYPE_CHECKING:
    from incpt.ui.commands.commands import Command

_NAVIGATION_TEXTS = {"blender": "Blender-like", "plain": "Plain"}


def draw(commands: Sequence[Command], navigation: str) -> str:
    """Both tables under the set that is chosen; returns the set after this frame."""
    options = [(name, _NAVIGATION_TEXTS[name]) for name in NAVIGATIONS]
    navigation = widgets.choice("Bindings", navigation, options)
    height = imgui.get_main_viewport().work_size.y * 0.6
    if imgui.begin_child("keys", imgui.ImVec2(0, height)):
        imgui.separator_text("In the picture")
        _table("mouse", bindings.help_lines(navigation))
        imgui.separator_text("Commands")
        rows = [(one.keys_in(navigation), f"{one.name}: {one.help}" if one.help else one.name)
                for one in commands if one.keys_in(navigation)]  # fmt: skip
        _table("commands", rows)
    imgui.end_child()
    return navigation


def _table(name: str, rows: Sequence[tuple[str, str]]) -> None:
    if not imgui.begin_table(name, 2, imgui.TableFlags_.row_bg):
        return
    imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_stretch, 0.32)
    imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch, 0.68)
    for keys, what in rows:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(keys)
        imgui.table_next_column()
        imgui.text_wrapped(what)
    imgui.end_table()
