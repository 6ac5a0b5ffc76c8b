"""A text with buttons below it."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer


@dataclass(frozen=True)
class Choice:
    """A button of a Question, and the answer that it gives."""

    label: str
    answer: Answer


@dataclass(frozen=True)
class Question:
    """A text and buttons; Enter presses the first of them, Escape the last."""

    title: str
    text: str
    choices: tuple[Choice, ...]

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin(self.title):
            return None
        imgui.text_wrapped(self.text)
        imgui.dummy(imgui.ImVec2(0, imgui.get_text_line_height() * 0.5))
        chosen = modal.buttons([choice.label for choice in self.choices])
        modal.end()
        return None if chosen is None else self.choices[chosen].answer
