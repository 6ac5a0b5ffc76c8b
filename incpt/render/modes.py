"""The three modes of the thesis (section 3.4) and the one transition between them.

BASE         the first coarse picture, from nothing: base queue, what was accumulated is thrown away.
REFINE       the base queue again and again, accumulated.
INCREMENTAL  after a local edit: what it affects comes first, as the strategy says. In the thesis that is the
             spiral queue with a high NoR; each finished tile replaces what was accumulated for it, all others
             keep theirs.
"""

from __future__ import annotations

from enum import Enum
from typing import Protocol


class Mode(Enum):
    """How a session renders at the moment."""

    BASE = "base"
    REFINE = "refine"
    INCREMENTAL = "incremental"


class Event(Enum):
    """What may change the mode: an edit of either kind, or the end of the tile queue."""

    GLOBAL_CHANGE = "global change"
    LOCAL_CHANGE = "local change"
    QUEUE_DONE = "queue done"


class LocalChangePolicy(Protocol):
    """What `next_mode` asks of a strategy."""

    @property
    def keeps_picture(self) -> bool:
        """Whether a local change keeps what the film has and renders it anew tile by tile."""
        ...


def next_mode(mode: Mode, event: Event, strategy: LocalChangePolicy) -> Mode:
    """The mode after `event`; every answer starts a new queue, also where the mode stays the same.

    A local change during BASE starts over under every strategy, because there is no whole picture yet that
    could be kept.
    """
    if event is Event.QUEUE_DONE:
        return Mode.REFINE
    if event is Event.LOCAL_CHANGE and mode is not Mode.BASE and strategy.keeps_picture:
        return Mode.INCREMENTAL
    return Mode.BASE
