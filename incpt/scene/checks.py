"""Checks of the values that scenes are made from. Each raises InputError with the name and the fix."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError

LARGEST = 1e9
"""Bound on every length, angle and radiance: squares and products of such numbers still fit float32."""


def frozen(values: npt.ArrayLike, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """A C-contiguous array of these values that nobody can write to: a copy, unless they are one already.

    Without a copy a caller who reuses an array would change a scene that is long made, and those that undo
    goes back to.
    """
    array = np.ascontiguousarray(values, dtype)
    if not _is_frozen(array):
        array = array.copy()
        array.flags.writeable = False
    return array


def _is_frozen(array: npt.NDArray[Any]) -> bool:
    memory: Any = array
    while isinstance(memory, np.ndarray):
        if memory.flags.writeable:
            return False
        memory = memory.base
    return memory is None


def set_number(owner: object, name: str, low: float, high: float) -> None:
    """Replaces an attribute of a frozen dataclass by a float within bounds. Raises InputError."""
    object.__setattr__(owner, name, checked_number(name, getattr(owner, name), low, high))


def set_vector(owner: object, name: str, low: float = -LARGEST, high: float = LARGEST) -> None:
    """Replaces an attribute of a frozen dataclass by three floats within bounds. Raises InputError."""
    value = getattr(owner, name)
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)) or len(value) != 3:
        raise InputError(f"{name}: {value!r} is not a list of three numbers")
    object.__setattr__(owner, name, tuple(checked_number(name, v, low, high) for v in value))


def checked_number(name: str, value: Any, low: float, high: float) -> float:
    """A number of Python or numpy as a float from `low` to `high`. Raises InputError that names it `name`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{name}: {value!r} is not a number")
    try:
        number = float(value)
    except OverflowError:
        raise InputError(
            f"{name}: a whole number that large is out of range; use {low:g} to {high:g}"
        ) from None
    if not math.isfinite(number):
        raise InputError(f"{name}: {number} is not a finite number")
    if not low <= number <= high:
        raise InputError(f"{name}: {number:g} is out of range; use {low:g} to {high:g}")
    return number
