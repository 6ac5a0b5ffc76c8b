"""Keys and moves of the mouse in the editor, from its tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from incpt.ui import bindings
from incpt.ui.commands.table import COMMANDS, MENUS, help_lines
from reference.markdown import table


def _table(what: str, lines: Iterable[tuple[str, str]]) -> str:
    # A key with a backtick on it would begin a piece of code.
    escaped = ((keys.replace("`", "\\`"), text) for keys, text in lines)
    return table((what, "what it does"), ((f"**{keys}**", text) for keys, text in escaped))


def keys(navigation: str) -> str:
    """The commands that have keys in one of the two sets."""
    return _table("keys", help_lines(navigation))


def mouse(navigation: str) -> str:
    """Clicks, drags, the wheel, and flying in one of the two sets."""
    return _table("in the picture", bindings.help_lines(navigation))


def modal() -> str:
    """What keys do while something is moved, rotated or scaled by G, R or S, in both sets."""
    return _table("keys", bindings.MODAL_LINES)


def menus() -> str:
    """Every command, by menu, with its help."""
    rows = [
        (one.menu.replace("/", " › "), f"**{one.name}**", one.help)
        for menu in MENUS
        for one in COMMANDS
        if one.menu.split("/")[0] == menu
    ]
    return table(("menu", "command", "what it does"), rows)


PIECES: dict[str, Callable[[], str]] = {
    "menus": menus,
    "keys of transforms": modal,
    **{f"{name} {which}": partial(make, which) for which in ("blender", "plain")
       for name, make in (("keys", keys), ("mouse", mouse))},
}  # fmt: skip
