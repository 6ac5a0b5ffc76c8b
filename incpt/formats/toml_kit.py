"""Reading TOML with errors that name line, table and key."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Collection, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError, one_line
from incpt.core.files import read_bytes

_LARGEST_INTEGER = 1 << 63
"""TOML promises 64 bits; Python would read any number of digits."""


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError with line and column, but without the file's name."""
    content = read_bytes(path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"line {line}: is not UTF-8 text; save it as UTF-8") from None
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:
        message = one_line(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
        at = f"line {place[1]}, column {place[2]}: " if place else ""
        reason = message[: place.start()] if place else message
        raise InputError(one_line(f"{at}is no valid TOML ({reason})")) from None
    except RecursionError:
        raise InputError("is no valid TOML (nested too deeply)") from None
    _check_integers(table)
    return table


def _check_integers(table: dict[str, Any]) -> None:
    left: list[tuple[str, Any]] = list(table.items())
    while left:
        key, value = left.pop()
        if isinstance(value, dict):
            left += value.items()
        elif isinstance(value, list):
            left += [(key, item) for item in value]
        elif isinstance(value, int) and not -_LARGEST_INTEGER <= value < _LARGEST_INTEGER:
            raise InputError(f"{one_line(key)}: a whole number of more than 64 bits; use a smaller one")


def check_keys(table: Mapping[str, Any], known: Collection[str], what: str = "key") -> None:
    """Raises InputError for the first key that is not known, with the one that was meant."""
    for key in table:
        if key not in known:
            close = get_close_matches(key, known, 1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
            raise InputError(f"{key}: is no known {what}; {hint}")


def table_of(tables: Mapping[str, Any], key: str) -> dict[str, Any]:
    """The table under `key`, empty where there is none. Raises InputError for anything but a table."""
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{key}: is not a table; write [{key}] and its keys below")
    return table


def text_of(table: Mapping[str, Any], key: str, why: str) -> str:
    """The text under `key`. Raises InputError where it is missing, empty, or not a text."""
    if key not in table:
        raise InputError(f"{key}: is missing; {why}")
    value = table[key]
    if not isinstance(value, str) or not value:
        raise InputError(f"{key}: {value!r} is not a text; {why}")
    return value


def quoted(name: str) -> str:
    """A name as it stands in a message: in quotes, on one line, not too long."""
    text = json.dumps(name, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + '…"'
