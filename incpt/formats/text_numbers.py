"""Numbers in texts of millions of them: numpy reads them at once, and one by one where any is odd."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

_NEWLINE = 10
_IS_BLANK = np.isin(np.arange(256), np.frombuffer(b" \t\n\v\f\r", np.uint8))
"""(256,) which bytes stand between words: as for `bytes.split` and numpy, no other control character."""


def numbers_at_once(text: bytes, dtype: type = np.float64) -> npt.NDArray[Any]:
    """The numbers of a text between blanks; none, where one of the words is no number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            found: npt.NDArray[Any] = np.fromstring(text, dtype, sep=" ")
        except (ValueError, DeprecationWarning):  # the first from numpy 2.3 on
            return np.zeros(0, dtype)
    # It makes a number of blanks alone.
    return found if len(found) != 1 or text.strip() else np.zeros(0, dtype)


def numbers_or_nan(text: bytes) -> npt.NDArray[np.float64]:
    """The number that each word of a text is, NaN for words that are none."""
    found = numbers_at_once(text)
    return found if len(found) else np.array([number_or_nan(word) for word in text.split()], np.float64)


def number_or_nan(word: bytes) -> float:
    """The number that a word is, NaN for one that is none."""
    try:
        return float(word)
    except ValueError:
        return float("nan")


def words_in_lines(text: bytes, lines: int) -> npt.NDArray[np.int64]:
    """(lines,) how many words each line of a text has, of which there are so many."""
    buffer = np.frombuffer(text + b"\n", np.uint8)
    is_word = ~_IS_BLANK[buffer]
    begins = is_word.copy()
    begins[1:] &= ~is_word[:-1]
    before = np.searchsorted(np.flatnonzero(begins), np.flatnonzero(buffer == _NEWLINE))
    assert len(before) == lines, "a text has as many lines as it is said to have"
    return np.diff(before, prepend=0)


def whole_or_negative(values: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Indices of a file as whole numbers; -1 for those that are none, which no list has."""
    if values.dtype.kind in "iu":
        # What is beyond 63 bits becomes negative too.
        return values.astype(np.int64, copy=False)
    with np.errstate(invalid="ignore"):
        usable = (values >= 0) & (values < 1 << 62) & (values == np.floor(values))
    return np.where(usable, values, -1).astype(np.int64)
