"""Which material objects get in place of one that is deleted."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from incpt.ui.dialogs import modal
from incpt.ui.editor.dialog import Answer
from incpt.ui.widgets import widgets


class ReplacementDialog:
    """Asks which of `others` the `users` objects get that have `material`; `then` takes it."""

    def __init__(
        self, material: str, users: int, others: tuple[str, ...], then: Callable[[str], None]
    ) -> None:
        self.material, self.users, self.others, self.then = material, users, others, then
        self.chosen = others[0]

    def draw(self) -> Answer | None:
        """See Dialog."""
        if not modal.begin("Delete material"):
            return None
        who = "1 object has it. Choose another for it."
        if self.users > 1:
            who = f"{self.users:,} objects have it. Choose another for them."
        imgui.text_wrapped(f"{self.material}: {who}")
        options = [(name, name) for name in self.others]
        self.chosen = widgets.choice("Replacement", self.chosen, options)
        pressed = modal.buttons(["Delete", "Cancel"])
        modal.end()
        if pressed is None:
            return None
        return Answer() if pressed == 1 else Answer(lambda: self.then(self.chosen))
