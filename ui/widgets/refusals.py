"""Values that their owner refuses: a field keeps the last good one, and says why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from incpt.core.errors import InputError, one_line
from incpt.ui.widgets import widgets

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
D = TypeVar("D", bound="DataclassInstance")


class Refusals:
    """What the fields of a panel refused in this frame, in the words of the error."""

    def __init__(self) -> None:
        self.messages: list[str] = []

    def accepted(self, old: T, make: Callable[[], T]) -> T:
        """`make()`, or the old value where that raises InputError: the field keeps the last good one."""
        try:
            return make()
        except InputError as error:
            self.messages.append(_as_labelled(one_line(str(error))))
            return old

    def changed(self, owner: D, **fields: Any) -> D:
        """A dataclass with other values of some fields; `owner` itself where they are what they were, or
        where it refuses them."""
        if all(getattr(owner, name) == value for name, value in fields.items()):
            return owner
        return self.accepted(owner, lambda: replace(owner, **fields))


def _as_labelled(message: str) -> str:
    """A message whose first word is the name of a parameter, as in files, with the label of the field that
    was changed in its place."""
    name, colon, rest = message.partition(": ")
    is_parameter = bool(colon) and name.isidentifier() and name.islower()
    return f"{widgets.edited_label()}: {rest}" if is_parameter and widgets.edited_label() else message
