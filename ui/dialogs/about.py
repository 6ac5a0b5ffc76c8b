"""What the program is."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer
from incpt.ui.widgets import widgets


@dataclass(frozen=True)
class About:
    """Version, device, licence."""

    version: str
    device: str

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("About incpt"):
            return None
        imgui.text(f"incpt {self.version}")
        widgets.note(
            "A path tracer that keeps its picture across an edit. The method: P. D. Hann, Incremental "
            "Updates of Path-Traced Scenes during Editing, TU Wien, 2021. MIT licence."
        )
        imgui.text_wrapped(f"Device: {self.device}")
        chosen = modal.buttons(["Close"])
        modal.end()
        return None if chosen is None else Answer()
