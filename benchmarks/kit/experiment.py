"""Runs the measurements of an experiment that are not there yet, and keeps each as soon as it is."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from incpt.benchmarks.kit.store import Results, Row, Store
from incpt.benchmarks.kit.timing import LoadMeter
from incpt.cli.console import Interruption, Stopped, interruption


@dataclass(frozen=True)
class Outcome:
    """What a task found: `values`, and `rows` where there are several of something.

    None of either: it could not be measured here, for the reason `skipped`, which is printed and not kept.
    `load` is that of the timed part, where work went on after it.
    """

    values: Row = field(default_factory=dict)
    rows: Sequence[Row] = ()
    skipped: str | None = None
    load: Row | None = None


@dataclass(frozen=True)
class Task:
    """One measurement: `subject` says all that it depends on beside machine and code, `weight` about how
    long it takes compared with the other tasks of the experiment."""

    label: str
    subject: Row
    measure: Callable[[Work], Outcome]
    weight: float = 1.0


class Work:
    """What a task tells while it is at it."""

    def __init__(self, progress: TaskProgress, stop: Interruption) -> None:
        self._progress, self._stop = progress, stop
        self._meter = LoadMeter()

    def check(self, fraction: float | None = None) -> None:
        """A place where work can stop without loss: raises KeyboardInterrupt after Ctrl-C. `fraction` is
        how much of the task is done, where it is known."""
        if fraction is not None:
            self._progress.part(fraction)
        self._stop.check()

    def timing_starts(self) -> None:
        """From here on it is measured what others do on the machine: what came before was preparation."""
        self._meter = LoadMeter()

    def load(self) -> Row:
        """The load since timing started."""
        return self._meter.read().as_row()


def run(store: Store, tasks: Sequence[Task], environment: Mapping[str, Any]) -> Results:
    """Measure what `store` does not have, and return the results of all tasks. Raises Stopped after Ctrl-C;
    what is done then stays, and the same command goes on from there."""
    environment = dict(environment)
    keys = [store.key(task.subject, environment) for task in tasks]
    missing = [task for task, key in zip(tasks, keys, strict=True) if not store.has(key)]
    if len(missing) < len(tasks):
        print(f"{len(tasks) - len(missing)} of {len(tasks)} measurements were there", file=sys.stderr)
    done = len(tasks) - len(missing)
    reasons: set[str] = set()
    try:
        with interruption() as stop, task_progress(sum(task.weight for task in missing)) as progress:
            for task in missing:
                stop.check()
                progress.begin(task.label, task.weight)
                work = Work(progress, stop)
                outcome = task.measure(work)
                if outcome.skipped is None:
                    load = work.load() if outcome.load is None else outcome.load
                    store.add(task.subject, environment, load, dict(outcome.values), outcome.rows)
                    done += 1
                elif outcome.skipped not in reasons:
                    reasons.add(outcome.skipped)
                    progress.say(f"skipped: {outcome.skipped}")
                progress.end()
    except KeyboardInterrupt:
        raise Stopped(
            f"stopped with {done} of {len(tasks)} measurements in {store.path}; the same command goes on"
        ) from None
    finally:
        store.export()
    found = store.read()
    wanted = set(keys)
    return Results(found.environments, tuple(r for r in found.records if r.key in wanted))


class TaskProgress:
    """A bar over weighted tasks, with the time that is left."""

    def __init__(self, progress: Progress, total: float) -> None:
        self._progress, self._total = progress, total
        self._task = progress.add_task("", total=max(total, 1e-9), left="")
        self._start = time.perf_counter()
        self._done = 0.0
        self._weight = 0.0

    def begin(self, label: str, weight: float) -> None:
        """The next task; a line of its own where there is no terminal for a bar."""
        self._weight = weight
        self.say(label, only_without_bar=True)
        self._progress.update(self._task, description=label)

    def part(self, fraction: float) -> None:
        """How much of the task is done."""
        self._show(self._done + self._weight * min(max(fraction, 0.0), 1.0))

    def end(self) -> None:
        """The task is done."""
        self._done += self._weight
        self._show(self._done)

    def say(self, line: str, only_without_bar: bool = False) -> None:
        """A line on stderr that stays."""
        if not self._progress.console.is_terminal:
            print(line, file=sys.stderr, flush=True)
        elif not only_without_bar:
            self._progress.console.print(line, markup=False)

    def _show(self, done: float) -> None:
        left = time_left(time.perf_counter() - self._start, done, self._total)
        self._progress.update(self._task, completed=done, left="" if left is None else f"{left} left")


@contextmanager
def task_progress(total: float) -> Iterator[TaskProgress]:
    """A progress bar on stderr, where that is a terminal."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[left]}"),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        yield TaskProgress(progress, total)


def time_left(elapsed_s: float, done: float, total: float) -> str | None:
    """In hours, minutes or seconds, from what the work so far took; None before there is any."""
    if done <= 0 or elapsed_s <= 0:
        return None
    seconds = round(elapsed_s * max(total - done, 0.0) / done)
    if seconds >= 3600:
        return f"{seconds // 3600} h {seconds % 3600 // 60:02} min"
    return f"{seconds // 60} min {seconds % 60:02} s" if seconds >= 60 else f"{seconds} s"
