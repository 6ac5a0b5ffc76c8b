"""What the editor has to say: errors stay until they are read, good news goes away by itself."""

from __future__ import annotations

from dataclasses import dataclass

LEVELS = ("done", "warning", "error")
"""What a notice is: good news, a remark, or something that failed."""
_SECONDS = {"done": 5.0, "warning": 15.0}
"""How long a notice of a level is shown; one of another level stays until it is dismissed."""
FADE_SECONDS = 1.0
"""How long it takes a notice to fade before it goes."""
_MOST = 6
"""How many notices are shown at once."""


@dataclass(frozen=True)
class Notice:
    """One line, one of LEVELS, and when it was said, in seconds of the editor's clock."""

    text: str
    level: str
    at: float

    @property
    def end(self) -> float | None:
        """When it goes away by itself, in seconds of the same clock; None: it does not."""
        return self.at + _SECONDS[self.level] if self.level in _SECONDS else None

    def opacity(self, now: float) -> float:
        """1, and less while it fades."""
        return 1.0 if self.end is None else min(max((self.end - now) / FADE_SECONDS, 0.0), 1.0)


@dataclass(frozen=True)
class Notices:
    """What was said and not dismissed, the latest last."""

    said: tuple[Notice, ...] = ()

    def with_notice(self, text: str, level: str, now: float) -> Notices:
        """With one more; what is said already is said anew and not twice."""
        assert level in LEVELS
        kept = [one for one in self.said if (one.text, one.level) != (text, level)]
        return Notices((*kept, Notice(text, level, now))[-_MOST:])

    def without(self, notice: Notice) -> Notices:
        """Without one that was dismissed."""
        return Notices(tuple(one for one in self.said if one is not notice))

    def current(self, now: float) -> Notices:
        """Without those that are over."""
        return Notices(tuple(one for one in self.said if one.end is None or now < one.end))

    def is_fading(self, now: float) -> bool:
        """Whether one of them looks otherwise from frame to frame."""
        return self.next_end is not None and now >= self.next_end - FADE_SECONDS

    @property
    def next_end(self) -> float | None:
        """When the first of them goes away by itself; None: none does."""
        return min((one.end for one in self.said if one.end is not None), default=None)
