"""What the editor knows of dialogs: something is drawn until it is answered. The dialogs themselves stand in
`ui/dialogs`, above the editor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


class Dialog(Protocol):
    """Something that waits for an answer."""

    def draw(self) -> Answer | None:
        """Draw it, and return the answer in the frame in which it is given."""


def _nothing() -> None:
    pass


@dataclass(frozen=True)
class Answer:
    """How a dialog is left. It is put away before `action` runs, because that may ask the next question.

    action   what was chosen; by default nothing. A dialog that it returns is asked next.
    again    the dialog that is asked again where `action` is refused, unless that asked something itself.
    explain  takes the reason of a refusal; by default the reason becomes a notice.
    """

    action: Callable[[], Dialog | None] = _nothing
    again: Dialog | None = None
    explain: Callable[[str], object] | None = None
