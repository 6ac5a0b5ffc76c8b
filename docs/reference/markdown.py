"""Markdown from values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; bars in cells are escaped."""
    lines = [headings, ["---"] * len(headings), *([_cell(text) for text in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def code(value: object) -> str:
    """A piece of code within a line, also one that holds a backtick."""
    text = str(value)
    return f"`` {text} ``" if "`" in text else f"`{text}`"


def toml(value: Any) -> str:
    """A value as a scene file has it, as code."""
    if isinstance(value, bool):
        return code(str(value).lower())
    if isinstance(value, str):
        return code(f'"{value}"')
    if isinstance(value, tuple):
        return code(f"[{', '.join(toml(one).strip('`') for one in value)}]")
    return code(value)


def one_of(values: Iterable[str]) -> str:
    """Texts of which one is chosen."""
    *others, last = [toml(value) for value in values]
    return f"{', '.join(others)} or {last}" if others else last


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
