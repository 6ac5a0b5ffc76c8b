"""What the commands share on the terminal: a progress bar for paths, and a Ctrl-C that stops cleanly."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from incpt.core.errors import one_line

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.table import Table


class Stopped(Exception):  # noqa: N818 - what the user asked for is no error
    """A command was interrupted and kept what it had; the message says what."""


class Interruption:
    """Whether Ctrl-C was pressed. `check` is for places where work can stop without loss."""

    def __init__(self) -> None:
        self.requested = False

    def check(self) -> None:
        """Raises KeyboardInterrupt where Ctrl-C was pressed."""
        if self.requested:
            raise KeyboardInterrupt

    def _on_signal(self, signum: int, frame: FrameType | None) -> None:
        if self.requested:  # pressed again: whoever does that does not want to wait for the step's end
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def interruption() -> Iterator[Interruption]:
    """Inside, the first Ctrl-C only sets a flag, so that no step is torn in the middle."""
    state = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield state  # signals reach the main thread only
        return
    previous = signal.signal(signal.SIGINT, state._on_signal)
    try:
        yield state
    finally:
        signal.signal(signal.SIGINT, previous)


class PathProgress:
    """A bar that counts paths, with their rate and what they make in samples per pixel."""

    def __init__(self, progress: Progress, what: str, total: int, pixels: int) -> None:
        self._progress = progress
        self._task = progress.add_task(what, total=total, rate="", spp="")
        self._what = what
        self._pixels = pixels
        self._start = time.perf_counter()
        self._paths = 0

    def describe(self, what: str) -> None:
        """What is being done now; a line of its own where there is no terminal for a bar."""
        if what != self._what and not self._progress.console.is_terminal:
            print(what, file=sys.stderr)
        self._what = what
        self._progress.update(self._task, description=what)

    def advance(self, paths: int) -> None:
        """So many paths more are done."""
        self._paths += paths
        seconds = max(time.perf_counter() - self._start, 1e-9)
        self._progress.update(
            self._task,
            completed=self._paths,
            rate=f"{self._paths / seconds / 1e6:.2f} Mpaths/s",
            spp=f"{self._paths / self._pixels:.0f} spp",
        )


@contextmanager
def path_progress(what: str, total: int, pixels: int) -> Iterator[PathProgress]:
    """A progress bar on stderr for `total` paths of an image of so many `pixels`."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[spp]}"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        yield PathProgress(progress, what, total, pixels)


INTERRUPTED = 130
"""Exit status of a command that Ctrl-C stopped: 128 + SIGINT, as shells have it."""


def complain(message: str, status: int) -> int:
    """Prints a line to stderr; returns `status`."""
    print(f"incpt: {one_line(message)}", file=sys.stderr)
    return status


def print_table(table: Table) -> None:
    """Prints a table to stdout, at the width of the terminal where there is one."""
    from rich.console import Console

    console = Console()
    # Without a terminal rich takes 80 columns, too few for a replay's table.
    (console if console.is_terminal else Console(width=120)).print(table)
