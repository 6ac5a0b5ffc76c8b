"""Rectangles of the screen: one type for widgets, pictures and framebuffers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

Point = tuple[float, float]
"""(x, y), counted as the rectangles beside it are."""

_N_co = TypeVar("_N_co", int, float, covariant=True)


@dataclass(frozen=True)
class Rect(Generic[_N_co]):
    """An upright rectangle, counted from the top left, y downwards.

    Its units are points of the user interface, or pixels of the framebuffer where its name ends in `_px`.
    A Rect[int] covers whole pixels.
    """

    left: _N_co
    top: _N_co
    width: _N_co
    height: _N_co

    def __iter__(self) -> Iterator[_N_co]:
        """Left, top, width and height."""
        yield from (self.left, self.top, self.width, self.height)

    @property
    def right(self) -> _N_co:
        return self.left + self.width

    @property
    def bottom(self) -> _N_co:
        return self.top + self.height

    @property
    def size(self) -> tuple[_N_co, _N_co]:
        """Width and height."""
        return self.width, self.height

    @property
    def middle(self) -> Point:
        """The point in its middle."""
        return self.left + self.width / 2, self.top + self.height / 2

    def relative(self, point: Point) -> Point:
        """A point in units of the rectangle: (0, 0) is the top left corner, (1, 1) the bottom right one."""
        return (point[0] - self.left) / self.width, (point[1] - self.top) / self.height

    def contains(self, point: Point) -> bool:
        """Whether the point lies inside; the left and the top edge do, the others do not."""
        x, y = self.relative(point)
        return 0 <= x < 1 and 0 <= y < 1

    def part(self, share: Rect[float]) -> Rect[float]:
        """The part of it that `share` is in units of it; the other way round than `relative`."""
        left, top = self.left + share.left * self.width, self.top + share.top * self.height
        return Rect(left, top, share.width * self.width, share.height * self.height)

    def scaled(self, factor: float) -> Rect[float]:
        """The same rectangle in another unit, `factor` of which make one of this: pixels from points, say."""
        return Rect(self.left * factor, self.top * factor, self.width * factor, self.height * factor)
