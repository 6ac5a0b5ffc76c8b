"""What a command is: an action with a name, a place in the menus and keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from incpt.ui import bindings
from incpt.ui.editor.editor import Editor

NO_KEYS: Mapping[str, str] = MappingProxyType({})
"""Nobody has given keys to commands."""
Action = Callable[[Editor], object]
"""What a command does. What it refuses it raises; the editor shows it."""
Test = Callable[[Editor], bool]
"""Tells something about a command in the state that the editor is in."""


@dataclass(frozen=True)
class Command:
    """`menu` may name a submenu after a slash; a line is drawn in menus where `group` changes. `keys` such
    as "Ctrl+Shift+S", several after commas; `plain_keys` where the plain set differs. `checked` for what is
    on or off; `detail` stands behind the name in menus: what would be undone."""

    name: str
    menu: str
    action: Action
    keys: str = ""
    plain_keys: str | None = None
    enabled: Test | None = None
    checked: Test | None = None
    detail: Callable[[Editor], str | None] | None = None
    group: int = 0
    help: str = ""

    def keys_in(self, navigation: str, own: Mapping[str, str] = NO_KEYS) -> tuple[str, ...]:
        """The keys in one of the two sets, each of which is enough; none where it has none. `own` are those
        that a person gave to commands, by name, in either set."""
        keys = self.plain_keys if navigation == "plain" and self.plain_keys is not None else self.keys
        given = own.get(self.name)
        if given is not None and (not given or bindings.is_chord(given)):
            keys = given
        return tuple(keys.split(", ")) if keys else ()

    def printed_keys(self, navigation: str, own: Mapping[str, str] = NO_KEYS) -> tuple[str, ...]:
        """The same as people read them on a keyboard: "Ctrl + Numpad 1"."""
        return tuple(bindings.printed(keys.split("+")) for keys in self.keys_in(navigation, own))

    def is_enabled(self, editor: Editor) -> bool:
        return self.enabled is None or self.enabled(editor)


def run(editor: Editor, one: Command) -> None:
    """Do what a command says, where it is enabled; what it refuses becomes a notice."""
    if one.is_enabled(editor):
        editor.attempt(lambda: one.action(editor))
