"""How long rendering takes: learnt from steps, to choose the slots of the next one. All of it are values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from statistics import median

import numpy as np
import numpy.typing as npt

from incpt.render.plan import Cursor, Queue
from incpt.render.tiles import TileGrid

MOST_BELIEVED = 4.0
"""How many times slower or faster a tile may become from one step to the next."""
REMEMBERED = 3
"""Measurements of which a pace is the median, so that a single slow one changes nothing."""


@dataclass(frozen=True)
class Pace:
    """How fast something is, in paths per second; `guess` where nothing was measured."""

    guess: float
    measured: tuple[float, ...] = ()

    @property
    def speed(self) -> float:
        return median(self.measured) if self.measured else self.guess

    def after(self, paths: int, seconds: float) -> Pace:
        """The pace once so many paths took so long."""
        speeds = (*self.measured, paths / max(seconds, 1e-6))
        return replace(self, measured=speeds[-REMEMBERED:])


@dataclass(frozen=True, eq=False)
class TileCosts:
    """What a path of each tile takes, (grid.count,) seconds, NaN where nothing is known. Speed differs
    tenfold between sky and glass, so that the last step says little about the next tiles, but the last pass
    much.

    `last` is the median over the tiles of the last step, 0 before there was one.
    """

    grid: TileGrid
    seconds: npt.NDArray[np.float64]
    last: float = 0.0

    @classmethod
    def unknown(cls, grid: TileGrid) -> TileCosts:
        """The costs of which nothing is known yet."""
        return cls(grid, np.full(grid.count, np.nan))

    def after(self, touched: npt.NDArray[np.int32], paths: int, seconds: float) -> TileCosts:
        """The costs after a step over the tiles `touched`. A stall of the machine is not believed at once,
        nor is one that is over."""
        old = self.seconds[touched]
        new = np.full(len(touched), seconds / paths)
        known = np.isfinite(old)
        new[known] = np.clip(new[known], old[known] / MOST_BELIEVED, old[known] * MOST_BELIEVED)
        learnt = self.seconds.copy()
        learnt[touched] = new
        return replace(self, seconds=learnt, last=float(np.median(new)))

    def slots(self, queue: Queue, cursor: Cursor, area: int, seconds: float, guess: float) -> int:
        """How many slots of `area` paths, from `cursor` on, take so long. `guess`: seconds of a path where
        there is no better knowledge."""
        guess = max(guess, self.last)
        least = int(queue.samples[cursor.tiles :].min())
        place = slice(cursor.tiles, cursor.tiles + 4 + int(8 * seconds / (guess * area * least)))
        ahead, samples = self.seconds[queue.tiles[place]], queue.samples[place]
        per_slot = np.where(np.isfinite(ahead), ahead, guess) * area
        ends = np.cumsum(per_slot * samples) - per_slot[0] * cursor.samples
        whole = int(np.searchsorted(ends, seconds, side="right"))
        slots = int(samples[:whole].sum()) - cursor.samples
        if whole == len(ahead):
            return slots
        begin = ends[whole] - per_slot[whole] * samples[whole]
        return slots + int((seconds - begin) / per_slot[whole])
