"""The page with all keys and moves of the mouse, from their tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from imgui_bundle import imgui

from incpt.ui import bindings
from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.preferences import NAVIGATIONS
from incpt.ui.widgets import widgets

Line = tuple[str, str]
"""Keys or a move of the mouse, and what it does."""

NAVIGATION_TEXTS = {"blender": "Blender-like", "plain": "Plain"}
"""How the page names the sets of bindings."""
_WIDTH = 660.0
"""Width of the dialog, in points at a scale of 1."""
_HEIGHT_SHARE = 0.6
"""Height of the tables as a share of the window's."""


class HelpPage:
    """Two tables under the set of bindings that is chosen. `command_lines` gives the lines of the commands in
    a set; `choose` takes the set that the user chooses here."""

    def __init__(
        self,
        command_lines: Callable[[str], Sequence[Line]],
        navigation: str,
        choose: Callable[[str], None],
    ) -> None:
        self.navigation = navigation
        self._command_lines, self._choose = command_lines, choose

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("Keys and mouse", width=_WIDTH):
            return None
        chosen = _draw_tables(self._command_lines(self.navigation), self.navigation)
        is_closed = modal.buttons(["Close"]) is not None
        modal.end()
        if is_closed:
            return Answer(lambda: self._choose(chosen))
        return Answer(lambda: self._with_navigation(chosen)) if chosen != self.navigation else None

    def _with_navigation(self, navigation: str) -> Dialog:
        self._choose(navigation)
        self.navigation = navigation
        return self


def _draw_tables(command_lines: Sequence[Line], navigation: str) -> str:
    options = [(name, NAVIGATION_TEXTS[name]) for name in NAVIGATIONS]
    chosen = widgets.choice("Bindings", navigation, options)
    height = imgui.get_main_viewport().work_size.y * _HEIGHT_SHARE
    if imgui.begin_child("keys", imgui.ImVec2(0, height)):
        imgui.separator_text("In the picture")
        _draw_table("mouse", bindings.help_lines(navigation))
        imgui.separator_text("While it is moved, rotated or scaled by keys")
        _draw_table("modal", bindings.MODAL_LINES)
        imgui.separator_text("Commands")
        _draw_table("commands", command_lines)
    imgui.end_child()
    return chosen


def _draw_table(name: str, lines: Sequence[Line]) -> None:
    if not imgui.begin_table(name, 2, imgui.TableFlags_.row_bg):
        return
    imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_stretch, 0.32)
    imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch, 0.68)
    for keys, what in lines:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(keys)
        imgui.table_next_column()
        imgui.text_wrapped(what)
    imgui.end_table()
