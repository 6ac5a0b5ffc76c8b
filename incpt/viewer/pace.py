"""How long rendering takes: learnt from steps, to choose the slots of the next one."""

from __future__ import annotations

from collections import deque
from statistics import median

import numpy as np
import numpy.typing as npt

from incpt.render.plan import Cursor, Queue

MOST_BELIEVED = 4.0
"""How many times slower or faster a tile may become from one step to the next."""


class Pace:
    """How fast something is, in paths per second: the median of the last three times, so that a single slow
    one changes nothing."""

    def __init__(self, guess: float) -> None:
        self._guess = guess
        self._speeds: deque[float] = deque(maxlen=3)

    @property
    def speed(self) -> float:
        return median(self._speeds) if self._speeds else self._guess

    def add(self, paths: int, seconds: float) -> None:
        self._speeds.append(paths / max(seconds, 1e-6))


class TileCosts:
    """What a path of each tile takes, seconds. Speed differs tenfold between sky and glass, so that the last
    step says little about the next tiles, but the last pass much."""

    def __init__(self, count: int) -> None:
        self._seconds = np.full(count, np.nan)
        self._last = 0.0

    def add(self, touched: npt.NDArray[np.int32], paths: int, seconds: float) -> None:
        """Learn from a step. A stall of the machine is not believed at once, nor is one that is over."""
        old = self._seconds[touched]
        new = np.full(len(touched), seconds / paths)
        known = np.isfinite(old)
        new[known] = np.clip(new[known], old[known] / MOST_BELIEVED, old[known] * MOST_BELIEVED)
        self._seconds[touched] = new
        self._last = float(np.median(new))

    def slots(self, queue: Queue, cursor: Cursor, area: int, seconds: float, guess: float) -> int:
        """How many slots of `area` paths, from `cursor` on, take so long. `guess`: seconds of a path where
        there is no better knowledge."""
        guess = max(guess, self._last)
        least = int(queue.samples[cursor.tiles :].min())
        place = slice(cursor.tiles, cursor.tiles + 4 + int(8 * seconds / (guess * area * least)))
        ahead, samples = self._seconds[queue.tiles[place]], queue.samples[place]
        per_slot = np.where(np.isfinite(ahead), ahead, guess) * area
        ends = np.cumsum(per_slot * samples) - per_slot[0] * cursor.samples
        whole = int(np.searchsorted(ends, seconds, side="right"))
        slots = int(samples[:whole].sum()) - cursor.samples
        if whole == len(ahead):
            return slots
        begin = ends[whole] - per_slot[whole] * samples[whole]
        return slots + int((seconds - begin) / per_slot[whole])
