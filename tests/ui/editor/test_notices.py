"""Notices: what is said, for how long, and how often."""

from __future__ import annotations

import pytest

from incpt.ui.editor.notices import Notices


def texts(notices: Notices) -> list[str]:
    return [notice.text for notice in notices.said]


def test_what_is_said_again_is_said_once_and_last() -> None:
    notices = Notices()
    for text in ("a", "b", "a"):
        notices = notices.with_notice(text, "error", 0.0)
    assert texts(notices) == ["b", "a"]
    assert texts(notices.with_notice("a", "warning", 0.0)) == ["b", "a", "a"], (
        "of another level it is another"
    )


def test_the_oldest_go_where_there_are_too_many() -> None:
    notices = Notices()
    for i in range(10):
        notices = notices.with_notice(str(i), "warning", float(i))
    assert texts(notices) == ["4", "5", "6", "7", "8", "9"]


@pytest.mark.parametrize(("level", "end"), [("done", 7.0), ("warning", 17.0), ("error", None)])
def test_each_level_has_its_time(level: str, end: float | None) -> None:
    notices = Notices().with_notice("a", level, 2.0)
    assert notices.next_end == end
    if end is not None:
        assert texts(notices.current(end - 0.01)) == ["a"] and texts(notices.current(end)) == []
    else:
        assert texts(notices.current(1e9)) == ["a"]


def test_the_first_end_counts() -> None:
    notices = Notices().with_notice("a", "warning", 0.0).with_notice("b", "done", 1.0)
    assert notices.next_end == 6.0 and Notices().next_end is None


def test_one_is_dismissed() -> None:
    notices = Notices().with_notice("a", "error", 0.0).with_notice("b", "error", 0.0)
    assert texts(notices.without(notices.said[0])) == ["b"]


def test_what_goes_by_itself_fades() -> None:
    notices = Notices().with_notice("a", "done", 2.0).with_notice("b", "error", 2.0)
    good, bad = notices.said
    assert [good.opacity(at) for at in (2.0, 6.0, 6.5, 7.0)] == [1.0, 1.0, 0.5, 0.0]
    assert bad.opacity(1e9) == 1.0
    assert not notices.is_fading(5.9) and notices.is_fading(6.1)
    assert not Notices().with_notice("b", "error", 2.0).is_fading(1e9)
