"""Objects of a JSON text, read with checks: whatever a damaged file holds, an InputError names its place."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

from incpt.core.checks import described
from incpt.core.errors import InputError, one_line
from incpt.formats import import_report
from incpt.scene.checks import LARGEST, checked_number

LARGEST_INDEX = 1 << 31
_LARGEST_NUMBER = 1e300
"""Whatever is finite."""


class Table:
    """An object of the JSON. `place` names it in messages, such as `meshes[3].primitives[0]`. All methods
    raise InputError for what is not of the type that they give."""

    def __init__(self, values: Any, place: str) -> None:
        if not isinstance(values, dict):
            raise InputError(f"{place or 'JSON'}: {described(values)} is no object; the file is damaged")
        self._values = values
        self.place = place

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    @contextmanager
    def in_messages(self) -> Iterator[None]:
        """Puts the place before the message of any InputError raised inside that does not begin with it."""
        try:
            yield
        except InputError as error:
            text = str(error)
            named = text if text.startswith(self.place) else f"{self.place}: {text}"
            raise InputError(one_line(named)) from None

    def _at(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key

    def described(self, *keys: str) -> str:
        """What stands under keys, as a text that differs where anything there does."""
        return json.dumps([self._values.get(key) for key in keys], sort_keys=True)

    def any(self, key: str) -> Any:
        """What stands under a key, None where nothing does."""
        return self._values.get(key)

    def table(self, key: str) -> Table:
        """The object under a key; an empty one where there is none."""
        return Table(self._values.get(key, {}), self._at(key))

    def extension(self, *names: str) -> Table:
        """What the first extension of these names that is there says; an empty object where none is."""
        extensions = self.table("extensions")
        return extensions.table(next((name for name in names if name in extensions), names[0]))

    def entries(self, key: str) -> list[Any]:
        """The list under a key; an empty one where there is none."""
        values = self._values.get(key, [])
        if not isinstance(values, list):
            raise InputError(f"{self._at(key)}: {described(values)} is no list; the file is damaged")
        return values

    def tables(self, key: str) -> Iterator[Table]:
        """The objects of the list under a key."""
        for number, values in enumerate(self.entries(key)):
            yield Table(values, f"{self._at(key)}[{number}]")

    def item(self, key: str, number: int) -> Table:
        """One object of the list under a key, by a number that may lie beyond its end."""
        values = self.entries(key)
        if not 0 <= number < len(values):
            raise InputError(f"{self._at(key)}: has {len(values)} entries, none is number {number}")
        return Table(values[number], f"{self._at(key)}[{number}]")

    def index(self, key: str) -> int | None:
        """A number that counts from 0, None where there is none."""
        return self.whole(key, 0, LARGEST_INDEX) if key in self else None

    def indices(self, key: str) -> list[int]:
        """A list of numbers that count from 0."""
        return [_whole(f"{self._at(key)}[{i}]", v, 0, LARGEST_INDEX) for i, v in enumerate(self.entries(key))]

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number within bounds; without a default it has to be there."""
        return _whole(self._at(key), self._values.get(key, default), low, high)

    def number(self, key: str, default: float, low: float = -LARGEST, high: float = LARGEST) -> float:
        """A finite number; one beyond the bounds becomes the bound, and is told of."""
        return _bounded(self._at(key), self._values[key], low, high) if key in self else default

    def numbers(
        self, key: str, default: Collection[float], low: float = -LARGEST, high: float = LARGEST
    ) -> tuple[float, ...]:
        """As many finite numbers as the default has; those beyond the bounds become the bound, and are told
        of."""
        if key not in self:
            return tuple(default)
        values = self.entries(key)
        if len(values) != len(default):
            raise InputError(f"{self._at(key)}: has {len(values)} numbers; {len(default)} are needed")
        return tuple(_bounded(self._at(key), value, low, high) for value in values)

    def text(self, key: str, default: str = "") -> str:
        """A text."""
        value = self._values.get(key, default)
        if not isinstance(value, str):
            raise InputError(f"{self._at(key)}: {described(value)} is no text; the file is damaged")
        # JSON may escape halves of characters, which no file and no terminal can be given.
        return value.encode("utf-8", "replace").decode()

    def flag(self, key: str, default: bool = False) -> bool:
        """True or false."""
        value = self._values.get(key, default)
        if not isinstance(value, bool):
            raise InputError(f"{self._at(key)}: {described(value)} is not true or false; the file is damaged")
        return value


def _bounded(place: str, value: Any, low: float, high: float) -> float:
    found = checked_number(place, value, -_LARGEST_NUMBER, _LARGEST_NUMBER)
    if low <= found <= high:
        return found
    bound = min(max(found, low), high)
    import_report.changed(f"{place}: {found:g} is out of range, {bound:g} is used")
    return bound


def _whole(place: str, value: Any, low: int, high: int) -> int:
    # JSON has one type of numbers: 3.0 is the whole number 3 as well.
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{place}: {described(value)} is no whole number; the file is damaged")
    if not low <= value <= high:
        raise InputError(f"{place}: {described(value)} is out of range; {low} to {high} are possible")
    return value
