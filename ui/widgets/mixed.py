"""Fields of several objects at once: which of them do not show the same for all, and say so.

A panel draws the values of one object. Run silently for each of the others, the same panel tells what its
fields would show: nothing has to be declared for a field to know that values differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")

TEXT = "mixed"
"""What a field shows in place of values that differ."""
_MOST_COMPARED = 100
"""How many objects are looked at, so that a frame does not become long."""

_shown: list[dict[str, object] | None] = [None]
"""Values by label while a panel is run silently; a list of one, so that functions can set it."""
_labels: list[frozenset[str]] = [frozenset()]
"""The fields whose values differ, in the panel that is drawn."""
_given: list[set[str]] = [set()]
"""Those of them to which a value was given in this panel, though it may be the one that the first has."""


@contextmanager
def marking(draw: Callable[[T], object], one: T, others: Sequence[T]) -> Iterator[None]:
    """Inside, fields say where the values of `one` are not those of `others`. `draw` draws the fields of
    any of them."""
    _labels[0] = _differing(draw, one, others[-_MOST_COMPARED:]) if others else frozenset()
    _given[0] = set()
    try:
        yield
    finally:
        _labels[0] = frozenset()


def is_in(label: str) -> bool:
    """Whether the field of that label shows values that differ."""
    return label in _labels[0]


def give(label: str) -> None:
    """For fields: a value was chosen or typed."""
    if is_in(label):
        _given[0].add(label)


def given() -> frozenset[str]:
    """The fields with values that differ to which one was given in the panel drawn last."""
    return frozenset(_given[0])


def is_silent() -> bool:
    """Whether nothing is drawn now."""
    return _shown[0] is not None


def is_told(label: str, value: object) -> bool:
    """For fields: whether nothing is drawn now; then the value is taken note of."""
    shown = _shown[0]
    if shown is None:
        return False
    shown[label] = value
    return True


def _differing(draw: Callable[[T], object], one: T, others: Sequence[T]) -> frozenset[str]:
    own = _values(draw, one)
    found: set[str] = set()
    for other in others:
        values = _values(draw, other)
        # What the other has no field for is no other value.
        found.update(label for label, value in own.items() if values.get(label, value) != value)
    return frozenset(found)


def _values(draw: Callable[[T], object], one: T) -> dict[str, object]:
    shown: dict[str, object] = {}
    _shown[0] = shown
    try:
        draw(one)
    finally:
        _shown[0] = None
    return shown
