"""Checks of what callers give: each raises InputError, one line that names the argument, what was given, and
what is wanted.

They need no library, because the command line knows of settings before it loads any.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError, one_line

LONGEST_VALUE = 60
"""Characters of a value that a message quotes."""
MOST_CHOICES = 12
"""That a message lists."""
_PLAIN = (bool, int, float, complex, str, bytes, list, tuple, dict)


def described(value: object) -> str:
    """What was given, in a few words: short plain values as they are, others by their type."""
    if isinstance(value, type):
        return f"the class {value.__name__}"
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return f"an array of shape {shape}"
    if isinstance(value, int) and value.bit_length() > 64:
        return "a whole number of more than 64 bits"
    if value is None or shape == () or isinstance(value, _PLAIN):
        with suppress(ValueError):  # Python refuses to write out the largest numbers.
            text = one_line(repr(value))
            if len(text) <= LONGEST_VALUE:
                return text
    name = type(value).__name__
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"


def require(name: str, value: object, kind: type | tuple[type, ...], wanted: str) -> None:
    """Raises InputError where `value` is of no such type; `wanted` goes on after "is not"."""
    if not isinstance(value, kind):
        raise InputError(f"{name}: {described(value)} is not {wanted}")


def require_bool(name: str, value: object) -> None:
    """Raises InputError."""
    require(name, value, bool, "true or false")


def require_call(name: str, value: object) -> None:
    """Raises InputError for what is neither None nor a function."""
    if value is not None and not callable(value):
        raise InputError(f"{name}: {described(value)} is not a function")


def one_of(name: str, value: object, choices: Collection[str]) -> None:
    """Raises InputError for what is not among these texts."""
    if not isinstance(value, str) or value not in choices:
        some = [*choices][:MOST_CHOICES]
        listed = ", ".join(some) + (", …" if len(choices) > len(some) else "")
        raise InputError(f"{name}: {described(value)} is not known; choose one of {listed}")


def whole(name: str, value: Any, low: int, high: int | None = None) -> int:
    """A whole number of Python or numpy as an int from `low` to `high`. Raises InputError."""
    number = value if type(value) is int else _index(value)
    if number is not None and low <= number and (high is None or number <= high):
        return number
    span = f"from {low} to {high}" if high is not None else f"from {low} on"
    if number is None:
        raise InputError(f"{name}: {described(value)} is not a whole number; use one {span}")
    raise InputError(f"{name}: {described(number)} is out of range; use a whole number {span}")


def _index(value: Any) -> int | None:
    try:
        return None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        return None


def pair(name: str, value: Any, wanted: str) -> tuple[float, float]:
    """Two numbers of Python or numpy as floats, which may be infinite or undefined. Raises InputError."""
    try:
        first, second = value
        if not any(isinstance(one, bool | str) for one in (first, second)):
            return float(first), float(second)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(f"{name}: {described(value)} is not {wanted}")


def path_of(name: str, value: str | os.PathLike[str]) -> Path:
    """The path that a text or a Path names. Raises InputError."""
    if isinstance(value, str | os.PathLike):
        try:
            return Path(value)
        except TypeError:  # one made of bytes
            pass
    raise InputError(f"{name}: {described(value)} is not a path; give a text or a Path")
