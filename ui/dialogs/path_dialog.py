"""A dialog that asks for a file to open or to write."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from imgui_bundle import imgui

from incpt.core.errors import InputError
from incpt.ui.dialogs import modal, native
from incpt.ui.dialogs.native import FileFilter, NativeDialog
from incpt.ui.dialogs.question import Choice, Question
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.editor.document import absolute_path
from incpt.ui.widgets import places

_LINES = 12
"""Height of the list of files, in lines of text."""


class PathDialog:
    """Asks for a file: by the system's own dialog where there is one, else by a path field with the files
    of the folder below it. `kind` says which files fit; `name` is a file to propose; `before` is a dialog
    that is asked again afterwards, whatever was chosen."""

    def __init__(
        self,
        title: str,
        kind: FileFilter,
        is_saving: bool,
        folder: Path,
        then: Callable[[Path], None],
        name: str = "",
        before: Dialog | None = None,
    ) -> None:
        self.title, self.kind, self.is_saving, self.then = title, kind, is_saving, then
        self._before = before
        self._folder = folder
        """Where a name without a folder belongs: the folder that the dialog began with."""
        self.text = f"{folder}/{name}".replace("//", "/")
        self._wants_focus = False
        self._native = NativeDialog(title, kind, is_saving, folder) if native.is_there() else None

    def draw(self) -> Answer | None:
        """See Dialog."""
        if self._native is None:
            return self._draw_field()
        if not self._native.is_answered:
            return None
        path = self._native.path
        return self._left() if path is None else Answer(lambda: self._use(path), self._before)

    def _draw_field(self) -> Answer | None:
        if not modal.begin(self.title):
            return None
        if imgui.is_window_appearing() or self._wants_focus:
            imgui.set_keyboard_focus_here()
        self._wants_focus = False
        imgui.set_next_item_width(-1)
        _, self.text = imgui.input_text("##path", self.text)
        places.note("Path")
        is_opened = self._draw_folder()
        chosen = modal.buttons(["Save" if self.is_saving else "Open", "Cancel"])
        chosen = 0 if is_opened else chosen
        modal.end()
        if chosen is None:
            return None
        # A path that is refused is asked for again; a notice says why.
        self._wants_focus = True
        return self._left() if chosen == 1 else Answer(self._take, again=self)

    def _left(self) -> Answer:
        return Answer(lambda: self._before)

    def _use(self, path: Path) -> Dialog | None:
        self.then(path)
        return self._before

    def _take(self) -> Dialog | None:
        """Use the path that was typed, or ask whether a file that is there may be replaced. Raises
        InputError for a path that names no file, and what `then` raises."""
        path = self._typed()
        if not self.text.strip() or os.path.isdir(path):
            self.text = f"{path}/".replace("//", "/")
            raise InputError(f"{path}: is a folder; name a file in it")
        if self.is_saving and not path.suffix and len(self.kind.suffixes) == 1:
            path = path.with_name(path.name + self.kind.suffixes[0])
        if not (self.is_saving and os.path.exists(path)):
            return self._use(path)
        return Question(
            "Replace file",
            f"{path.name} is there already.",
            (
                Choice("Replace", Answer(lambda: self._use(path), again=self)),
                Choice("Cancel", Answer(lambda: self)),
            ),
        )

    def _typed(self) -> Path:
        is_of_home = self.text.startswith("~")
        return absolute_path(self.text if is_of_home else os.path.join(self._folder, self.text))

    def _draw_folder(self) -> bool:
        """The files of the folder that is typed; returns whether one was double-clicked."""
        is_opened = False
        try:
            typed = self._typed()
        except InputError:
            typed = Path(self.text)
        folder = typed if self.text.endswith("/") else typed.parent
        imgui.text_disabled(f"{self.kind.name} in {folder}")
        size = imgui.ImVec2(0, imgui.get_text_line_height() * _LINES)
        if imgui.begin_child("files", size, imgui.ChildFlags_.borders):
            if imgui.selectable("../", False)[0]:
                self.text = f"{folder.parent}/".replace("//", "/")
            places.note("../")
            for name in _entries(folder, self.kind.suffixes):
                flags = imgui.SelectableFlags_.allow_double_click
                if imgui.selectable(name, name == typed.name, flags)[0]:
                    self.text = str(folder / name) + ("/" if name.endswith("/") else "")
                    is_double = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
                    is_opened = is_opened or (is_double and not name.endswith("/"))
                places.note(name)
        imgui.end_child()
        return is_opened


def _entries(folder: Path, suffixes: tuple[str, ...]) -> list[str]:
    """Names in a folder: folders with a slash first, then the files that fit."""
    try:
        found = sorted(folder.iterdir(), key=lambda path: path.name.lower())
    except OSError:
        return []
    seen = [path for path in found if not path.name.startswith(".")]
    # Path.is_dir raises where a folder may be listed and not entered; os.path.isdir does not.
    folders = [f"{path.name}/" for path in seen if os.path.isdir(path)]
    return folders + [path.name for path in seen if path.suffix.lower() in suffixes and os.path.isfile(path)]
