"""What the editor has to say: errors stay until they are read, good news goes away by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

LEVELS = ("done", "warning", "error")
"""What a message is: good news, a remark, or something that failed."""
_SECONDS = {"done": 5.0, "warning": 15.0}
"""How long a message of a level is shown; one of another level stays until it is dismissed."""
_MOST = 6
"""How many messages are shown at once."""


@dataclass(frozen=True)
class Message:
    """One line, one of LEVELS, and when it was said, in seconds of the clock."""

    text: str
    level: str
    at: float


class Messages:
    """The messages that are shown, the latest last. `now` is a clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._messages: list[Message] = []

    def add(self, text: str, level: str) -> None:
        """Say something; what is said already is said anew and not twice."""
        assert level in LEVELS
        kept = [m for m in self._messages if (m.text, m.level) != (text, level)]
        self._messages = [*kept, Message(text, level, self._now())][-_MOST:]

    def dismiss(self, message: Message) -> None:
        self._messages = [m for m in self._messages if m is not message]

    def current(self) -> list[Message]:
        """The messages that are shown still."""
        now = self._now()
        self._messages = [
            m for m in self._messages if m.level not in _SECONDS or now - m.at < _SECONDS[m.level]
        ]
        return list(self._messages)

    @property
    def next_end(self) -> float | None:
        """When the first of them goes away by itself."""
        ends = [m.at + _SECONDS[m.level] for m in self._messages if m.level in _SECONDS]
        return min(ends, default=None)
