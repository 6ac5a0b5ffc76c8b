"""Rules of timing: what else the machine does is measured, and medians are given with their spread.

Every measurement is repeated. The repetitions of compared programs take turns, each turn in the opposite
order of the one before, so that a machine that slows down or is shared slows all of them alike. Before a
program is timed it has run once (compilers, caches, memory). While it is timed, the processor time that
*other* processes get is measured: where that is more than a twentieth of the machine, the result says so.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import psutil

from incpt.benchmarks.kit.environment import usable_cores

BUSY_SHARE = 0.05
"""Share of the machine's cores used by others from which a measurement counts as one on a busy machine."""

_TICKS_S = 0.04

T = TypeVar("T")


@dataclass(frozen=True)
class Load:
    """What others did during a measurement: `other_cores` is the mean number of cores that they kept busy
    (time that a hypervisor took away included), `load_average` the system's own figure at the end."""

    seconds: float
    other_cores: float
    load_average: float
    cores: int

    @property
    def busy(self) -> bool:
        """Whether this was a busy machine. Systems count processor time in ticks, so that of a short
        measurement little can be said."""
        return self.other_cores > BUSY_SHARE * self.cores + _TICKS_S / self.seconds

    def as_row(self) -> dict[str, float | bool]:
        """Columns of a result."""
        return {
            "busy": self.busy,
            "other_cores": round(self.other_cores, 3),
            "load_average": round(self.load_average, 2),
        }


class LoadMeter:
    """Measures from where it is made to `read`."""

    def __init__(self) -> None:
        self._process = psutil.Process()
        self._start = time.perf_counter()
        self._machine, self._own = _machine_seconds(), self._own_seconds()

    def read(self) -> Load:
        """The load since this was made."""
        seconds = max(time.perf_counter() - self._start, 1e-9)
        machine, own = _machine_seconds() - self._machine, self._own_seconds() - self._own
        average = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
        return Load(seconds, max(0.0, (machine - own) / seconds), average, usable_cores())

    def _own_seconds(self) -> float:
        # Those of workers that run count, and of those that have ended.
        total = sum(self._process.cpu_times()[:4])
        for child in self._process.children(recursive=True):
            try:
                total += sum(child.cpu_times()[:2])
            except psutil.Error:
                continue
        return float(total)


def _machine_seconds() -> float:
    """Processor time that all processes had, and what was stolen from the machine, in seconds.

    Inside a container /proc/stat may be the host's; there is nothing better to read.
    """
    times = psutil.cpu_times()
    parts = ("user", "nice", "system", "irq", "softirq", "steal")
    return float(sum(getattr(times, part, 0.0) for part in parts))


def interleaved(programs: Sequence[T], repetitions: int) -> list[tuple[int, T]]:
    """(repetition, program) in the order of measuring: turn after turn, every other one backwards."""
    return [
        (repetition, program)
        for repetition in range(repetitions)
        for program in (programs if repetition % 2 == 0 else reversed(programs))
    ]


@dataclass(frozen=True)
class Summary:
    """Median of repeated measurements, and the least and the greatest of them."""

    median: float
    low: float
    high: float
    count: int

    @property
    def spread(self) -> float:
        """Half the range as a fraction of the median."""
        return (self.high - self.low) / (2 * self.median) if self.median else 0.0

    def text(self, digits: int = 3) -> str:
        """Such as 1.23 ±4 %; one measurement has no spread."""
        number = significant(self.median, digits)
        return number if self.count < 2 else f"{number} ±{100 * self.spread:.0f} %"


def summary(values: Sequence[float]) -> Summary:
    """Of one value at least."""
    return Summary(statistics.median(values), min(values), max(values), len(values))


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, without an exponent where it stays readable."""
    if value == 0 or not 1e-4 <= abs(value) < 1e9:
        return f"{value:.{digits}g}"
    decimals = max(0, digits - 1 - _order(value))
    return f"{value:,.{decimals}f}"


def _order(value: float) -> int:
    return int(f"{abs(value):e}".split("e")[1])
