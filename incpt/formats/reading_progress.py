"""How far reading is, told to whoever waits for it.

What a file consists of is not known before it is read, so that readers count their objects, which are most of
the work. Where one file names others, the objects of the outer one count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

_STEPS = 100
"""Shares that are told at most."""


class _Watch:
    """Who is told, and whether objects are being counted already."""

    def __init__(self, watcher: Callable[[float], None]) -> None:
        self.tell, self.counts = watcher, False


_watch: ContextVar[_Watch | None] = ContextVar("watch", default=None)


@contextmanager
def watched_by(watcher: Callable[[float], None]) -> Iterator[None]:
    """Inside, what is read is told to a function as shares, from 0 to 1."""
    token = _watch.set(_Watch(watcher))
    try:
        yield
    finally:
        _watch.reset(token)


def each(values: Sequence[T]) -> Iterator[T]:
    """The values one after the other, while it is told how many of them are done."""
    watch = _watch.get()
    if watch is None or watch.counts:
        yield from values
        return
    step = max(len(values) // _STEPS, 1)
    watch.counts = True
    try:
        for done, value in enumerate(values):
            if done % step == 0:
                watch.tell(done / len(values))
            yield value
    finally:
        watch.counts = False
