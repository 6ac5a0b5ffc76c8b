"""The rows of a PLY file behind its header: where the values of each element stand, and what they are.

Rows with lists may differ in length, and where one begins is known only when the one before it has been read.
Where all have the length of the first, as in meshes of triangles alone, numpy reads them at once; else the
rows are walked through, which takes a fraction of a microsecond for each, and then read at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.import_report import counted
from incpt.formats.ply.header import Element, Header, Property
from incpt.formats.text_numbers import numbers_or_nan, whole_or_negative, words_in_lines

Values = npt.NDArray[Any]
Indices = npt.NDArray[np.int64]


class Body(ABC):
    """The values behind a header. Places count in bytes, or in numbers where they stand as text."""

    size: int

    @abstractmethod
    def width(self, kind: str) -> int:
        """How many places a value takes."""

    @abstractmethod
    def in_steps(self, first: int, steps: tuple[int, ...], shape: tuple[int, ...], kind: str) -> Values:
        """An array of that shape, which begins at a place and goes on in steps of so many along each axis."""

    @abstractmethod
    def at(self, places: Indices, kind: str) -> Values:
        """The values at places."""

    def lines_from(self, first: int, count: int) -> tuple[Indices, Indices] | None:
        """Where so many lines begin and end, the first of which is at a place; None where rows are not to be
        read as lines."""
        return None

    @abstractmethod
    def counter(self, kind: str) -> Callable[[int], int]:
        """What gives the whole number at a place, or raises IndexError, ValueError or OverflowError."""


class BinaryBody(Body):
    """Values in bytes of an order."""

    def __init__(self, content: bytes, first: int, order: str) -> None:
        self._content = memoryview(content)[first:]
        self._order = order
        self.size = len(self._content)

    def width(self, kind: str) -> int:
        return int(kind[1])

    def in_steps(self, first: int, steps: tuple[int, ...], shape: tuple[int, ...], kind: str) -> Values:
        return np.ndarray(shape, self._order + kind, self._content, first, steps)

    def at(self, places: Indices, kind: str) -> Values:
        everywhere = self.in_steps(0, (1,), (max(self.size - self.width(kind) + 1, 0),), kind)
        return np.asarray(everywhere[places])

    def counter(self, kind: str) -> Callable[[int], int]:
        content, width, is_signed = self._content, self.width(kind), kind[0] == "i"
        if kind == "u1":
            return content.__getitem__
        order: Any = "little" if self._order == "<" else "big"
        return lambda place: int.from_bytes(content[place : place + width], order, signed=is_signed)


class TextBody(Body):
    """Values as words of a text."""

    def __init__(self, content: bytes, first: int) -> None:
        self._text = content[first:].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self._values = numbers_or_nan(self._text)
        self._ends: Indices | None = None
        self.size = len(self._values)

    def take_lines(self, count: int) -> bool:
        """Has rows read as lines from now on, if there are so many lines. Whether it is so."""
        words = words_in_lines(self._text, self._text.count(b"\n") + 1)
        words = words[words > 0]
        if len(words) == count:
            self._ends = np.cumsum(words)
        return self._ends is not None

    def lines_from(self, first: int, count: int) -> tuple[Indices, Indices] | None:
        if self._ends is None:
            return None
        number = int(np.searchsorted(self._ends, first, side="right"))
        ends = self._ends[number : number + count]
        return np.concatenate([[first], ends[:-1]])[:count], ends

    def width(self, kind: str) -> int:
        return 1

    def in_steps(self, first: int, steps: tuple[int, ...], shape: tuple[int, ...], kind: str) -> Values:
        strides = tuple(step * self._values.itemsize for step in steps)
        return np.lib.stride_tricks.as_strided(self._values[first:], shape, strides, writeable=False)

    def at(self, places: Indices, kind: str) -> Values:
        return np.asarray(self._values[places])

    def counter(self, kind: str) -> Callable[[int], int]:
        values = self._values
        return lambda place: int(values[place])


@dataclass(frozen=True)
class _Places:
    """Where the values of a property stand in so many rows: in steps from the first, or each at its own
    place. `sizes` are those of lists, one for all or one for each row."""

    first: int | Indices
    step: int = 0
    sizes: int | Indices = 1


class Rows:
    """The rows of an element. Raises InputError where the file ends before them."""

    def __init__(self, element: Element, body: Body, first: int) -> None:
        self.name, self.count = element.name, element.count
        self._body = body
        self._properties = {one.name: one for one in element.properties}
        self._places: dict[str, _Places] = {}
        self.end = first
        """The place behind them."""
        if element.count and element.properties:
            lines = body.lines_from(first, element.count)
            self.end = self._in_lines(*lines) if lines else self._alike(first) or self._walked(first)

    def __contains__(self, name: str) -> bool:
        return name in self._properties

    @property
    def names(self) -> list[str]:
        """Of the properties, in their order."""
        return list(self._properties)

    def kind(self, name: str) -> str:
        """The type of a property."""
        return self._properties[name].kind

    def is_list(self, name: str) -> bool:
        """Whether a property is a list."""
        return self._properties[name].count_kind is not None

    def numbers(self, name: str) -> Values:
        """(rows,) the values of a property that is a number. Raises InputError for a list."""
        if self.is_list(name):
            raise InputError(f"property {name!r} of {self.name!r} is a list; it should be a number")
        if not self.count:
            return np.zeros(0, self.kind(name))
        places = self._places[name]
        if isinstance(places.first, int):
            return self._body.in_steps(places.first, (places.step,), (self.count,), self.kind(name))
        return self._body.at(places.first, self.kind(name))

    def lists(self, name: str) -> tuple[Indices, Values]:
        """The lengths (rows,) of lists, and their values, one list after the other. Raises InputError for a
        number."""
        if not self.is_list(name):
            raise InputError(f"property {name!r} of {self.name!r} is a number; it should be a list")
        kind = self.kind(name)
        if not self.count:
            return np.zeros(0, np.int64), np.zeros(0, kind)
        places, width = self._places[name], self._body.width(kind)
        if isinstance(places.first, int) and isinstance(places.sizes, int):
            shape, steps = (self.count, places.sizes), (places.step, width)
            sizes = np.full(self.count, places.sizes, np.int64)
            return sizes, self._body.in_steps(places.first, steps, shape, kind).reshape(-1)
        sizes = np.asarray(places.sizes, np.int64)
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        return sizes, self._body.at(np.repeat(places.first, sizes) + width * within, kind)

    def _alike(self, first: int) -> int:
        """Finds the places where all rows are as long as the first one. The place behind them; 0 if they are
        not."""
        body, place = self._body, first
        counts: list[tuple[int, Property, int]] = []
        found: dict[str, tuple[int, int]] = {}
        for one in self._properties.values():
            size = 1
            if one.count_kind is not None:
                size = self._count(body.counter(one.count_kind), place)
                counts.append((place, one, size))
                place += body.width(one.count_kind)
            found[one.name] = place, size
            place += size * body.width(one.kind)
        step = place - first
        if step * self.count > body.size - first:
            return 0
        for at, one, size in counts:
            assert one.count_kind is not None
            if not (body.in_steps(at, (step,), (self.count,), one.count_kind) == size).all():
                return 0
        self._places = {name: _Places(at, step, size) for name, (at, size) in found.items()}
        return first + step * self.count

    def _in_lines(self, starts: Indices, ends: Indices) -> int:
        """Finds the places from where lines begin and end, which may have more numbers than their rows. The
        place behind the rows."""
        place, last = starts, self._body.size - 1
        for one in self._properties.values():
            if one.count_kind is None:
                self._places[one.name] = _Places(place)
                place = place + 1
            else:
                sizes = whole_or_negative(self._body.at(np.minimum(place, last), one.count_kind))
                self._places[one.name] = _Places(place + 1, sizes=sizes)
                if (sizes < 0).any() or (sizes > self._body.size).any():
                    raise self._cut()
                place = place + 1 + sizes
        if (place > ends).any():
            raise self._cut()
        longer = int((place < ends).sum())
        if longer:
            import_report.left_out(
                f"numbers at the end of {counted(longer, 'row')} of {self.name!r}: the header names none"
            )
        return int(ends[-1])

    def _walked(self, first: int) -> int:
        """Finds the places row by row. The place behind the rows."""
        steps, tail = self._steps()
        sizes, starts, end = array("q"), array("q"), self._body.size
        place = first
        for _ in range(self.count):
            starts.append(place)
            for before, counter, width in steps:
                place += before
                size = self._count(counter, place)
                sizes.append(size)
                place += size * width
            place += tail
            if place > end:
                raise self._cut()
        self._set_places(np.array(starts, np.int64), np.array(sizes, np.int64).reshape(self.count, -1))
        return place

    def _steps(self) -> tuple[list[tuple[int, Callable[[int], int], int]], int]:
        """For each list the places before its count since the end of the list before it, what reads the
        count, and the places of a value and the count; and the places behind the last list."""
        steps, before = [], 0
        for one in self._properties.values():
            if one.count_kind is None:
                before += self._body.width(one.kind)
            else:
                steps.append((before, self._body.counter(one.count_kind), self._body.width(one.kind)))
                before = self._body.width(one.count_kind)
        return steps, before

    def _set_places(self, starts: Indices, sizes: Indices) -> None:
        """From where rows begin, and the sizes (rows, lists) of their lists."""
        place, number = starts, 0
        for one in self._properties.values():
            if one.count_kind is None:
                self._places[one.name] = _Places(place)
                place = place + self._body.width(one.kind)
            else:
                place = place + self._body.width(one.count_kind)
                self._places[one.name] = _Places(place, sizes=sizes[:, number])
                place = place + sizes[:, number] * self._body.width(one.kind)
                number += 1

    def _count(self, counter: Callable[[int], int], place: int) -> int:
        try:
            size = counter(place)
        except (IndexError, ValueError, OverflowError):
            raise self._cut() from None
        if size < 0 or size > self._body.size:
            raise self._cut()
        return size

    def _cut(self) -> InputError:
        return InputError(
            f"is no PLY mesh, or a damaged one (it ends within the {self.count:,} rows of {self.name!r})"
        )


def read_rows(header: Header, content: bytes) -> tuple[list[Rows], int]:
    """The rows of each element, and how much is left behind them. Raises InputError.

    In a text rows follow each other as numbers do, wherever lines end. Where that does not come out even, and
    there is a line for each row, they are read as lines: some programs write more than their headers name.
    """
    if header.order:
        return _rows_of(header, BinaryBody(content, header.size, header.order))
    body = TextBody(content, header.size)
    try:
        found, left = _rows_of(header, body)
    except InputError:
        if not body.take_lines(sum(element.count for element in header.elements)):
            raise
        return _rows_of(header, body)
    if left and body.take_lines(sum(element.count for element in header.elements)):
        return _rows_of(header, body)
    return found, left


def _rows_of(header: Header, body: Body) -> tuple[list[Rows], int]:
    found: list[Rows] = []
    for element in header.elements:
        found.append(Rows(element, body, found[-1].end if found else 0))
    return found, body.size - (found[-1].end if found else 0)
