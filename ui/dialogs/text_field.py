"""A text to type."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer
from incpt.ui.widgets import places, widgets


class TextField:
    """A text to type. Where `then` refuses it, the reason is shown below the field, and the dialog stays."""

    def __init__(self, title: str, label: str, text: str, then: Callable[[str], None]) -> None:
        self.title, self.label, self.text, self.then = title, label, text, then
        self._refusal = ""
        self._wants_focus = False

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin(self.title):
            return None
        if imgui.is_window_appearing() or self._wants_focus:
            imgui.set_keyboard_focus_here()
        self._wants_focus = False
        with widgets.row(self.label) as field:
            _, self.text = imgui.input_text(field, self.text, imgui.InputTextFlags_.auto_select_all)
            places.note(self.label)
        if self._refusal:
            widgets.note(self._refusal, "warning")
        chosen = modal.buttons(["OK", "Cancel"])
        modal.end()
        if chosen is None:
            return None
        return Answer() if chosen == 1 else Answer(lambda: self.then(self.text), self, self._explain)

    def _explain(self, reason: str) -> None:
        self._refusal, self._wants_focus = reason, True
