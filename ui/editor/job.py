"""A file that is read in a thread, so that the window goes on meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from incpt.formats.reading_progress import watched_by

QUICK_SECONDS = 0.2
"""How long a job is waited for when it begins: most files are read by then, and nothing flickers."""


class Job:
    """`work` runs in a thread, and `then` takes what it gives in the thread of the window, once `finish` is
    called. What it raises, `finish` raises. `label` says what it does.

    Nothing ends a thread from outside: one that is given up reads on to its end, and nobody takes the result.
    """

    def __init__(self, label: str, work: Callable[[], Any], then: Callable[[Any], object]) -> None:
        self.label, self._work, self._then = label, work, then
        self._result: Any = None
        self._error: Exception | None = None
        self._began = time.monotonic()
        self.share: float | None = None
        """How much of it is done, from 0 to 1, once that is known."""
        self._thread = threading.Thread(target=self._run, name=label, daemon=True)
        self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Wait so long at most; returns whether it is done."""
        self._thread.join(seconds)
        return self.is_done

    @property
    def is_done(self) -> bool:
        return not self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """How long it has been at work."""
        return time.monotonic() - self._began

    def finish(self) -> None:
        """Hand over what was read. Raises what reading it raised."""
        if self._error is not None:
            raise self._error
        self._then(self._result)

    def _note(self, share: float) -> None:
        self.share = share

    def _run(self) -> None:
        try:
            with watched_by(self._note):
                self._result = self._work()
        except Exception as error:  # It is raised where somebody can say it.
            self._error = error
