"""The kinds of failure that a user meets, each one line that names the place and the fix."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

LONGEST_MESSAGE = 400
"""Characters of a message; what a bad file quotes of itself may be megabytes."""


class InputError(ValueError):
    """What the user gave is wrong: a file, a key, a name, a number. Exit status 2."""


class DeviceError(RuntimeError):
    """The machine cannot do it: no device, a kernel that does not build, too little memory. Exit status 1."""


class OutputError(RuntimeError):
    """The system refuses to write a result: full disk, folder missing or not writable. Exit status 1.

    Not an InputError: the same command works once there is room or permission.
    """


class InputWarning(UserWarning):
    """Something in the input was left out or looks unintended, but the rest is usable."""


def one_line(text: object) -> str:
    """`text` without line breaks and runs of blanks, cut to LONGEST_MESSAGE characters. What is not to be
    printed becomes a question mark."""
    line = " ".join(str(text).split())
    if not line.isprintable():
        line = "".join(one if one.isprintable() else "?" for one in line)
    return line if len(line) <= LONGEST_MESSAGE else line[: LONGEST_MESSAGE - 2] + " …"


def reason_of(error: Exception) -> str:
    """What an exception of a library says, in a few words for a message."""
    text = one_line(error)[:120].rstrip(".")
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


@contextmanager
def in_place(place: str) -> Iterator[None]:
    """Puts `place: ` before the message of any InputError raised inside: file, then table, then key."""
    try:
        yield
    except InputError as error:
        raise InputError(one_line(f"{place}: {error}")) from None
