"""What became of the files that a scene was read from: what was read, left out and changed, and why.

Readers tell it where they come upon it, as they would warn: `left_out("3 lines: have no area")`. Whoever asks
for a report gathers it around the call (`gathered`); elsewhere what was left out becomes an InputWarning, so
that nothing goes in silence.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import Enum

from incpt.core.errors import InputError, InputWarning, one_line


class Fate(Enum):
    """What became of a thing in a file."""

    READ = "read"
    LEFT_OUT = "left out"
    CHANGED = "changed"


@dataclass(frozen=True)
class Remark:
    """What became of a thing in a file: one line, "what: why"."""

    fate: Fate
    file: str
    text: str

    def __str__(self) -> str:
        return f"{self.file}: {self.fate.value} {self.text}"


@dataclass(frozen=True)
class ImportReport:
    """All remarks about the files that something was read from, in the order in which they came up, each
    once."""

    remarks: tuple[Remark, ...] = ()

    def of(self, fate: Fate) -> tuple[Remark, ...]:
        """The remarks of one kind."""
        return tuple(remark for remark in self.remarks if remark.fate is fate)

    @property
    def is_whole(self) -> bool:
        """Whether nothing was left out."""
        return not self.of(Fate.LEFT_OUT)

    def check_whole(self) -> None:
        """Raises InputError, one line, where anything was left out."""
        lost = self.of(Fate.LEFT_OUT)
        if lost:
            others = f" (and {len(lost) - 1:,} more)" if len(lost) > 1 else ""
            raise InputError(f"{lost[0]}{others}; leave --strict away to go on without")

    def lines(self) -> list[str]:
        """As text: a line for each remark below the name of its file."""
        lines: list[str] = []
        file = None
        for remark in self.remarks:
            if remark.file != file:
                file = remark.file
                lines.append(f"{file}:")
            lines.append(f"  {remark.fate.value}: {remark.text}")
        return lines


NOTHING_TOLD = ImportReport()
"""Of what was read from no file."""


class Gathered:
    """What is told while files are read."""

    def __init__(self) -> None:
        self._remarks: dict[Remark, None] = {}

    def add(self, *remarks: Remark) -> None:
        self._remarks.update(dict.fromkeys(remarks))

    @property
    def report(self) -> ImportReport:
        return ImportReport(tuple(self._remarks))


_gathered: ContextVar[Gathered | None] = ContextVar("gathered", default=None)
_file: ContextVar[str] = ContextVar("file", default="")


@contextmanager
def gathered() -> Iterator[Gathered]:
    """Inside, what readers tell is gathered in the value that this gives, and nobody is warned."""
    found = Gathered()
    token = _gathered.set(found)
    try:
        yield found
    finally:
        _gathered.reset(token)


@contextmanager
def in_file(file: str) -> Iterator[None]:
    """Inside, what readers tell is about that file."""
    token = _file.set(file)
    try:
        yield
    finally:
        _file.reset(token)


def read(text: str) -> None:
    """Tells what was read as it is: "2 meshes"."""
    _tell_of(Fate.READ, text)


def left_out(text: str) -> None:
    """Tells what was left out, and why: "3 lines: have no area"."""
    _tell_of(Fate.LEFT_OUT, text)


def changed(text: str) -> None:
    """Tells what is another than in the file, and why."""
    _tell_of(Fate.CHANGED, text)


def _tell_of(fate: Fate, text: str) -> None:
    tell(Remark(fate, _file.get(), one_line(text)))


def tell(*remarks: Remark) -> None:
    """Hands remarks to whoever gathers them; without anybody, what was left out becomes InputWarnings."""
    gathering = _gathered.get()
    if gathering is not None:
        gathering.add(*remarks)
        return
    for remark in remarks:
        if remark.fate is Fate.LEFT_OUT:
            warnings.warn(str(remark), InputWarning, stacklevel=3)


def counted(count: int, what: str) -> str:
    """ "1 mesh", "2 meshes": a number with its noun, as remarks have it."""
    plural = f"{what}es" if what.endswith("sh") else f"{what}s"
    return f"{count:,} {what if count == 1 else plural}"
