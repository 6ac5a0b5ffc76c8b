"""Checks of the numbers that scenes are made from. Each raises InputError with the name and the fix."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from incpt.core.arrays import REAL
from incpt.core.checks import described
from incpt.core.errors import InputError

LARGEST = 1e9
"""Bound on every length, angle and radiance: squares and products of such numbers still fit float32."""


def set_number(owner: object, name: str, low: float, high: float) -> None:
    """Replaces an attribute of a frozen dataclass by a float within bounds. Raises InputError."""
    object.__setattr__(owner, name, checked_number(name, getattr(owner, name), low, high))


def set_vector(owner: object, name: str, low: float = -LARGEST, high: float = LARGEST) -> None:
    """Replaces an attribute of a frozen dataclass by three floats within bounds. Raises InputError."""
    value = getattr(owner, name)
    if not is_list(value) or len(value) != 3:
        raise InputError(f"{name}: {described(value)} is not a list of three numbers")
    object.__setattr__(owner, name, tuple([checked_number(name, v, low, high) for v in value]))


def is_list(value: Any) -> bool:
    """Whether it is a list, a tuple or the like, or an array that has a length."""
    # The first two are told quickly, and are what nearly all are.
    if isinstance(value, (tuple, list)):
        return True
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes))


def checked_number(name: str, value: Any, low: float, high: float) -> float:
    """A number of Python or numpy as a float from `low` to `high`. Raises InputError that names it `name`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, REAL):
        raise InputError(f"{name}: {described(value)} is not a number")
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
