"""Rectangles of the screen."""

from __future__ import annotations

from incpt.ui.rect import Rect

RECT = Rect(10, 20, 40, 8)


def test_sides_and_middle() -> None:
    assert (RECT.right, RECT.bottom, RECT.size, RECT.middle) == (50, 28, (40, 8), (30, 24))
    assert tuple(RECT) == (10, 20, 40, 8)


def test_points_are_relative_to_the_top_left() -> None:
    assert RECT.relative((10, 20)) == (0, 0) and RECT.relative((50, 28)) == (1, 1)
    assert RECT.relative((20, 22)) == (0.25, 0.25)


def test_left_and_top_belong_to_it_right_and_bottom_do_not() -> None:
    assert RECT.contains((10, 20)) and RECT.contains((49.9, 27.9))
    for outside in ((9.9, 24), (30, 19.9), (50, 24), (30, 28)):
        assert not RECT.contains(outside)


def test_pixels_from_points() -> None:
    assert RECT.scaled(1.5) == Rect(15, 30, 60, 12)


def test_a_part_is_the_inverse_of_relative() -> None:
    part = RECT.part(Rect(0.25, 0.5, 0.5, 0.25))
    assert part == Rect(20, 24, 20, 2) and RECT.relative((part.left, part.top)) == (0.25, 0.5)
