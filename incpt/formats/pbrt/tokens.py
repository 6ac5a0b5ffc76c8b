"""The words of a pbrt file: directives, texts in quotation marks, numbers, and lists in brackets."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError

# A list of plain numbers is taken as a whole, because meshes stand in the file with all their vertices.
_WORD = re.compile(
    r"""[ \t\r\f\v]+ | \#[^\n]* | (?P<line>\n)
    | \[(?P<numbers>[^\[\]"\#a-df-zA-DF-Z]*)\]
    | "(?P<text>[^"\n]*)" | (?P<bracket>[\[\]]) | (?P<word>[^\s"\[\]\#]+)""",
    re.VERBOSE,
)
Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Token:
    """A word and its line. `text` is a directive, a number or a bracket; `quoted` what stands between
    quotation marks; `numbers` a list of plain numbers."""

    line: int
    text: str = ""
    quoted: str | None = None
    numbers: Numbers | None = None


def tokens_of(content: str) -> Iterator[Token]:
    """Raises InputError that names the line."""
    line, place = 1, 0
    while place < len(content):
        match = _WORD.match(content, place)
        if match is None:
            raise InputError(f"line {line}: a quotation mark has no end; close it in its line")
        place = match.end()
        kind = match.lastgroup
        if kind == "line":
            line += 1
        elif kind == "numbers":
            yield Token(line, numbers=_numbers(match["numbers"], line))
            line += match["numbers"].count("\n")
        elif kind == "text":
            yield Token(line, quoted=match["text"])
        elif kind is not None:
            yield Token(line, text=match[kind])


def _numbers(text: str, line: int) -> Numbers:
    try:
        found = np.array(text.split(), np.float64)
    except ValueError:
        raise InputError(f"line {line}: {text.strip()[:40]!r} holds something else than numbers") from None
    return finite(found, line)


def finite(numbers: Numbers, line: int) -> Numbers:
    """Raises InputError where one is not."""
    if not np.isfinite(numbers).all():
        raise InputError(f"line {line}: holds a number that is not finite")
    return numbers
