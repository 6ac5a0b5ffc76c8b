"""Checks of what callers give, and the words for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from incpt.core.arrays import frozen, numbers
from incpt.core.checks import described, one_of, pair, path_of, require, whole
from incpt.core.errors import InputError
from incpt.scene.material import Material
from incpt.scene.model import Object

HUGE = 10**5000
"""A number that Python refuses to write out."""


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "None"),
        (5, "5"),
        ("red", "'red'"),
        ([1, 2], "[1, 2]"),
        ("a\nb" * 100, "a str"),
        (list(range(100)), "a list"),
        (HUGE, "a whole number of more than 64 bits"),
        (np.zeros((4, 3)), "an array of shape (4, 3)"),
        (np.float32(2), repr(np.float32(2))),
        (Material(), "a Material"),
        (Object, "the class Object"),
        (object(), "an object"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_what_was_given_is_told_in_a_few_words(value: object, words: str) -> None:
    assert described(value) == words


def test_a_type_is_required() -> None:
    require("mesh", 5, int, "a number")
    with pytest.raises(InputError, match=r"^mesh: 'cube' is not a Mesh; load one$"):
        require("mesh", "cube", (int, Material), "a Mesh; load one")


@pytest.mark.parametrize("value", [3, np.int64(3), np.array(3), np.uint8(3)])
def test_whole_numbers_of_any_library(value: Any) -> None:
    number = whole("nor", value, 1, 3)
    assert number == 3 and type(number) is int


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (True, "nor: True is not a whole number; use one from 1 to 9"),
        (3.0, "nor: 3.0 is not a whole number; use one from 1 to 9"),
        ("3", "nor: '3' is not a whole number; use one from 1 to 9"),
        (np.array([3, 4]), r"nor: an array of shape \(2,\) is not a whole number; use one from 1 to 9"),
        (0, "nor: 0 is out of range; use a whole number from 1 to 9"),
        (10, "nor: 10 is out of range; use a whole number from 1 to 9"),
        (HUGE, "nor: a whole number of more than 64 bits is out of range; use a whole number from 1 to 9"),
        (-HUGE, "nor: a whole number of more than 64 bits is out of range; use a whole number from 1 to 9"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_other_numbers_are_refused(value: Any, message: str) -> None:
    with pytest.raises(InputError, match=rf"^{message}$"):
        whole("nor", value, 1, 9)


def test_whole_numbers_without_an_end() -> None:
    assert whole("spp", 10**9, 0) == 10**9
    with pytest.raises(InputError, match=r"^spp: -1 is out of range; use a whole number from 0 on$"):
        whole("spp", -1, 0)


def test_pairs() -> None:
    for value in ((1, 2.5), [1, 2.5], np.array([1, 2.5])):
        assert pair("pixel", value, "a pixel") == (1.0, 2.5)
    for wrong in (
        "ab",
        (1,),
        (1, 2, 3),
        5,
        None,
        (1, "2"),
        (1, None),
        (True, 2),
        (HUGE, 1),
        {"a": 1, "b": 2},
    ):
        with pytest.raises(InputError, match=r"^pixel: .* is not a pixel$"):
            pair("pixel", wrong, "a pixel")


def test_paths(tmp_path: Path) -> None:
    class Bytes:
        def __fspath__(self) -> bytes:
            return b"a"

    assert path_of("path", "a/b") == path_of("path", Path("a/b")) == Path("a/b")
    for wrong in (5, None, b"a", np.zeros((2, 2)), Bytes()):
        with pytest.raises(InputError, match=r"^path: .* is not a path; give a text or a Path$"):
            path_of("path", wrong)  # type: ignore[arg-type]


def test_choices() -> None:
    one_of("curve", "agx", ("agx", "srgb"))
    for wrong in ("", "AGX", 5, None, ["agx"], np.array(["agx", "agx"])):
        with pytest.raises(InputError, match=r"^curve: .* is not known; choose one of agx, srgb$"):
            one_of("curve", wrong, ("agx", "srgb"))


def test_arrays_of_numbers() -> None:
    for values in ([[1, 2], [3, 4]], np.array([[1, 2], [3, 4]], np.int8), np.array([[1.0, 2], [3, 4]])):
        for dtype in (np.float32, np.int32):
            found = numbers("faces", values, dtype)
            assert found.dtype == dtype and found.tolist() == [[1, 2], [3, 4]]
    own = np.zeros(3, np.float32)
    assert numbers("vertices", own, np.float32) is own
    assert np.isinf(numbers("vertices", [1e300], np.float32)).all()


@pytest.mark.parametrize("wrong", ["abc", None, [[1], [2, 3]], [None], [object()], {"a": 1}, [1j], [["1"]]])
def test_what_holds_no_numbers_is_refused(wrong: Any) -> None:
    with pytest.raises(InputError, match=r"^faces: .* is not an array of numbers$"):
        numbers("faces", wrong, np.float32)


@pytest.mark.parametrize("wrong", [[0.5], [np.nan], [2**31], [-(2.0**40)], np.array([2**32], np.uint64)])
def test_whole_numbers_are_not_rounded_and_do_not_wrap_around(wrong: Any) -> None:
    with pytest.raises(
        InputError, match=r"^faces: hold a number that is not whole, or beyond 2,147,483,647$"
    ):
        numbers("faces", wrong, np.int32)


def test_frozen_arrays_are_copied_once() -> None:
    own = np.arange(6.0).reshape(2, 3)
    kept = frozen(own)
    own[:] = 0
    assert kept.tolist() == [[0, 1, 2], [3, 4, 5]] and not kept.flags.writeable
    assert frozen(kept) is kept and frozen(kept.T).flags.c_contiguous
