"""Arrays as callers give them: of numbers, and kept apart from the caller's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.checks import described
from incpt.core.errors import InputError

REAL = (int, float, np.integer, np.floating)
"""Types of a number of Python or numpy."""


def numbers(name: str, values: npt.ArrayLike, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """`values` as an array of real numbers of that type; the array itself where it is one. What is too large
    for the type becomes infinite. Raises InputError: what holds no numbers, and for a type of whole numbers
    what it cannot hold."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, OverflowError):  # rows of unequal length
        array = np.empty(0, np.object_)
    if array.dtype.kind not in "biuf":
        raise InputError(f"{name}: {described(values)} is not an array of numbers")
    with np.errstate(over="ignore", invalid="ignore"):
        result: npt.NDArray[Any] = np.asarray(array, dtype)
    if result.dtype.kind in "iu" and array.dtype != result.dtype and not np.array_equal(result, array):
        raise InputError(f"{name}: hold a number that is not whole, or beyond {np.iinfo(result.dtype).max:,}")
    return result


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A C-contiguous array of the same values that nobody can write to: a copy, unless it is one already.

    Without a copy a caller who reuses an array would change a scene that is long made, and those that undo
    goes back to.
    """
    array = np.ascontiguousarray(array)
    if not _is_frozen(array):
        array = array.copy()
        array.flags.writeable = False
    return array


def handed_over(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same array, which its maker gives away and keeps no way to write to, so that `frozen` need not copy
    it."""
    array.flags.writeable = False
    return array


def _is_frozen(array: npt.NDArray[Any]) -> bool:
    memory: Any = array
    while isinstance(memory, np.ndarray):
        if memory.flags.writeable:
            return False
        memory = memory.base
    return memory is None
