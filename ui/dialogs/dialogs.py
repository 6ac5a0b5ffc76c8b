"""Dialogs: what stands over everything else until it is answered. One at a time, as `Editor.dialog`."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from imgui_bundle import imgui
from imgui_bundle import portable_file_dialogs as native

from incpt.core.errors import InputError
from incpt.ui.editor.document import absolute_path
from incpt.ui.widgets import places, theme, widgets

if TYPE_CHECKING:
    from incpt.ui.commands.commands import Command
    from incpt.ui.editor.editor import Editor

_WIDTH = 460.0
"""Of a dialog, in points."""
_LEAST_BUTTON = 76.0
"""Width of its buttons, in points."""


class Dialog(Protocol):
    """Something that waits for an answer."""

    def draw(self, editor: Editor) -> None:
        """Draw it. To go away it calls `close`."""


def draw(editor: Editor) -> None:
    """The open dialog, where there is one."""
    if editor.dialog is not None:
        editor.dialog.draw(editor)


def close(editor: Editor, dialog: Dialog) -> None:
    """Put a dialog away, before what it was asked for happens: that may ask the next question."""
    if editor.dialog is dialog:
        editor.dialog = None


@dataclass(frozen=True)
class Choice:
    """A button of a Question."""

    label: str
    action: Callable[[], object]


class Question:
    """A text and buttons; the first is taken by Enter, the last by Escape."""

    def __init__(self, title: str, text: str, choices: Sequence[Choice]) -> None:
        self.title, self.text, self.choices = title, text, choices

    def draw(self, editor: Editor) -> None:
        """See Dialog."""
        if not _begin(self.title):
            return
        imgui.text_wrapped(self.text)
        imgui.dummy(imgui.ImVec2(0, imgui.get_text_line_height() * 0.5))
        chosen = _buttons([choice.label for choice in self.choices])
        _end()
        if chosen is not None:
            close(editor, self)
            editor.attempt(self.choices[chosen].action)


class TextField:
    """A text to type. What `then` refuses is shown below the field, and the dialog stays."""

    def __init__(self, title: str, label: str, text: str, then: Callable[[str], object]) -> None:
        self.title, self.label, self.text, self.then = title, label, text, then
        self._refusals = widgets.Refusals()
        self._is_asked_again = False

    def draw(self, editor: Editor) -> None:
        """See Dialog."""
        if not _begin(self.title):
            return
        if imgui.is_window_appearing() or self._is_asked_again:
            imgui.set_keyboard_focus_here()
        self._is_asked_again = False
        with widgets.row(self.label) as field:
            _, self.text = imgui.input_text(field, self.text, imgui.InputTextFlags_.auto_select_all)
            places.note(self.label)
        widgets.show_refusals(self._refusals)
        chosen = _buttons(["OK", "Cancel"])
        _end()
        if chosen == 1:
            close(editor, self)
        elif chosen == 0:
            self._refusals = widgets.Refusals()
            self._is_asked_again = not self._refusals.accepted(False, lambda: self.then(self.text) is None)
            if not self._is_asked_again:
                close(editor, self)


class PathDialog:
    """Asks for a file: by the system's own dialog where there is one, else by a path field with the files
    of the folder below it. `kind` is a name with the suffixes that fit; `name` a file to propose."""

    def __init__(
        self,
        title: str,
        kind: tuple[str, tuple[str, ...]],
        is_saving: bool,
        folder: Path,
        then: Callable[[Path], object],
        name: str = "",
    ) -> None:
        self.title, self.kind, self.is_saving, self.then = title, kind, is_saving, then
        self._folder = folder
        """Where a name without a folder belongs: the folder that the dialog began with."""
        self.text = f"{folder}/{name}".replace("//", "/")
        self._is_asked_again = False
        self._native = _native_dialog(title, kind, is_saving, folder) if _has_native_dialogs() else None

    def draw(self, editor: Editor) -> None:
        """See Dialog."""
        if self._native is None:
            self._draw_field(editor)
        elif self._native.ready(0):
            result = self._native.result()
            answer = result if isinstance(result, str) else next(iter(result), "")
            close(editor, self)
            if answer:
                editor.attempt(lambda: self.then(Path(answer)))

    def _draw_field(self, editor: Editor) -> None:
        if not _begin(self.title):
            return
        if imgui.is_window_appearing() or self._is_asked_again:
            imgui.set_keyboard_focus_here()
        self._is_asked_again = False
        imgui.set_next_item_width(-1)
        _, self.text = imgui.input_text("##path", self.text)
        places.note("Path")
        self._draw_folder()
        chosen = _buttons(["Save" if self.is_saving else "Open", "Cancel"])
        _end()
        if chosen == 1:
            close(editor, self)
        elif chosen == 0:
            close(editor, self)
            self._use(editor, lambda: self._take(editor))

    def _use(self, editor: Editor, action: Callable[[], object]) -> None:
        # A path that is refused is asked for again; the message says why.
        if not editor.attempt(action) and editor.dialog is None:
            self._ask_again(editor)

    def _ask_again(self, editor: Editor) -> None:
        editor.dialog, self._is_asked_again = self, True

    def _typed(self) -> Path:
        is_of_home = self.text.startswith("~")
        return absolute_path(self.text if is_of_home else os.path.join(self._folder, self.text))

    def _take(self, editor: Editor) -> None:
        path = self._typed()
        if not self.text.strip() or os.path.isdir(path):
            self.text = f"{path}/".replace("//", "/")
            raise InputError(f"{path}: is a folder; name a file in it")
        if self.is_saving and not path.suffix and len(self.kind[1]) == 1:
            path = path.with_name(path.name + self.kind[1][0])
        if not (self.is_saving and os.path.exists(path)):
            self.then(path)
            return
        replace = Choice("Replace", lambda: self._use(editor, lambda: self.then(path)))
        editor.dialog = Question(
            "Replace file",
            f"{path.name} is there already.",
            (replace, Choice("Cancel", lambda: self._ask_again(editor))),
        )

    def _draw_folder(self) -> None:
        try:
            typed = self._typed()
        except InputError:
            typed = Path(self.text)
        folder = typed if self.text.endswith("/") else typed.parent
        imgui.text_disabled(f"{self.kind[0]} in {folder}")
        if imgui.begin_child(
            "files", imgui.ImVec2(0, imgui.get_text_line_height() * 12), imgui.ChildFlags_.borders
        ):
            if imgui.selectable("../", False)[0]:
                self.text = f"{folder.parent}/".replace("//", "/")
            places.note("../")
            for name in _entries(folder, self.kind[1]):
                if imgui.selectable(name, name == typed.name)[0]:
                    self.text = str(folder / name) + ("/" if name.endswith("/") else "")
                places.note(name)
        imgui.end_child()


class HelpPage:
    """All keys and moves of the mouse, from their tables."""

    def __init__(self, commands: Sequence[Command]) -> None:
        self.commands = commands

    def draw(self, editor: Editor) -> None:
        """See Dialog."""
        from incpt.ui.panels import help_page

        if not _begin("Keys and mouse", width=660.0):
            return
        navigation = help_page.draw(self.commands, editor.preferences.navigation)
        chosen = _buttons(["Close"])
        _end()
        editor.choose_navigation(navigation)
        if chosen is not None:
            close(editor, self)


class About:
    """Version, device, licence."""

    def __init__(self, version: str, device: str) -> None:
        self.version, self.device = version, device

    def draw(self, editor: Editor) -> None:
        """See Dialog."""
        if not _begin("About incpt"):
            return
        imgui.text(f"incpt {self.version}")
        widgets.note(
            "A path tracer that keeps its picture across an edit. The method: P. D. Hann, Incremental "
            "Updates of Path-Traced Scenes during Editing, TU Wien, 2021. MIT licence."
        )
        imgui.text_wrapped(f"Device: {self.device}")
        chosen = _buttons(["Close"])
        _end()
        if chosen is not None:
            close(editor, self)


def _begin(title: str, width: float = _WIDTH) -> bool:
    """Open a modal window in the middle; `_end` closes it where this returned True."""
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    middle = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(middle, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    scale = imgui.get_style().font_scale_dpi
    imgui.set_next_window_size(imgui.ImVec2(width * scale, 0.0), imgui.Cond_.always)
    return imgui.begin_popup_modal(title, None, imgui.WindowFlags_.no_resize)[0]


def _end() -> None:
    imgui.end_popup()


def _buttons(labels: Sequence[str]) -> int | None:
    """Buttons in a row at the right; the one that was pressed. Enter is the first, Escape the last."""
    style = imgui.get_style()
    least = _LEAST_BUTTON * style.font_scale_dpi
    widths = [max(imgui.calc_text_size(label).x + 2 * style.frame_padding.x, least) for label in labels]
    room = imgui.get_content_region_avail().x - sum(widths) - style.item_spacing.x * (len(labels) - 1)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    chosen = None
    for i, (label, width) in enumerate(zip(labels, widths, strict=True)):
        if i > 0:
            imgui.same_line()
        if i == 0:
            imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*theme.ACCENT[:3], 0.75))
        if widgets.button(label, width=width):
            chosen = i
        if i == 0:
            imgui.pop_style_color()
    if imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False):
        chosen = 0
    if imgui.is_key_pressed(imgui.Key.escape, False):
        chosen = len(labels) - 1
    return chosen


def _entries(folder: Path, suffixes: tuple[str, ...]) -> list[str]:
    """Names in a folder: folders with a slash first, then the files that fit."""
    try:
        found = sorted(folder.iterdir(), key=lambda path: path.name.lower())
    except OSError:
        return []
    seen = [path for path in found if not path.name.startswith(".")]
    # os.path, because Path.is_dir raises where a folder may be listed and not entered.
    folders = [f"{path.name}/" for path in seen if os.path.isdir(path)]
    return folders + [path.name for path in seen if path.suffix.lower() in suffixes and os.path.isfile(path)]


def _has_native_dialogs() -> bool:
    # On Linux portable-file-dialogs runs one of these programs, and waits for ever where there is none.
    if not sys.platform.startswith("linux"):
        return True
    return any(map(shutil.which, ("zenity", "kdialog", "matedialog", "qarma")))


def _native_dialog(
    title: str, kind: tuple[str, tuple[str, ...]], is_saving: bool, folder: Path
) -> native.open_file | native.save_file:
    filters = [kind[0], " ".join(f"*{suffix}" for suffix in kind[1])]
    if is_saving:
        return native.save_file(title, str(folder) + "/", filters)
    return native.open_file(title, str(folder) + "/", filters)
