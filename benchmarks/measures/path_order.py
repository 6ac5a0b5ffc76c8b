"""The same paths of a few tiles in several orders, for `incpt bench steps` to tell what order is worth.

All orders fill the path buffer at once and trace it by one launch of the path tracer, so that neither the
host nor the size of a launch tells them apart.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.render.plan import Cursor, Queue, plan_step
from incpt.render.session import Session
from incpt.render.tiles import IntArray, TileGrid

ROWS, PASSES, TOGETHER = "row by row", "pass after pass", "repetitions together"
ORDERS = (ROWS, PASSES, TOGETHER)
"""One path per pixel and pass, in rows of the picture or, as BASE and REFINE do it, tile by tile; or all
repetitions of a tile together, as INCREMENTAL does it."""


def spiral_tiles(session: Session, steps: int) -> IntArray:
    """(N,) the tiles that so many steps of a session from the start of its queue finish, one at least."""
    slots = session.grid.count * session.settings.sample_rate
    done = int(np.searchsorted(session.queue.ends, steps * slots, side="right"))
    return session.queue.tiles[: max(1, done)]


def ordered_slots(
    order: str, grid: TileGrid, tiles: IntArray, samples: int
) -> tuple[npt.NDArray[np.void], int]:
    """Slots for the paths of samples 0 ... `samples` - 1 of each pixel of `tiles`, and how many pixels wide
    each slot is."""
    if order == TOGETHER:
        queue = Queue.even(tiles, samples, replaces=True)
        none = np.zeros(grid.count, np.int64)
        return plan_step(grid, queue, Cursor(), len(tiles) * samples, none).slots, grid.tile_size
    if order == ROWS:
        pixels = np.flatnonzero(np.isin(grid.tile_of_pixels(), tiles)).astype(np.int32)
        grid, tiles = TileGrid(grid.width, grid.height, 1), pixels
    none = np.zeros(grid.count, np.int64)
    one_pass = plan_step(grid, Queue.even(tiles, 1, replaces=False), Cursor(), len(tiles), none).slots
    slots = np.tile(one_pass, samples)
    passes = np.repeat(np.arange(samples, dtype=np.uint32), len(one_pass))
    slots["first_sample"] += passes
    slots["group_first"] += passes * np.uint32(len(one_pass))
    return slots, grid.tile_size


def pixel_count(grid: TileGrid, tiles: IntArray) -> int:
    """Pixels of `tiles` that lie in the picture."""
    return sum(width * height for width, height in map(grid.size, tiles.tolist()))


class OrderedSession(Session):
    """A session that also traces paths in an order of the caller's; its picture stays as it is."""

    def trace_seconds(self, slots: npt.NDArray[np.void], slot_width_px: int) -> float:
        """How long it takes to trace the paths of `slots`, which are on the device by then."""
        paths = len(slots) * slot_width_px**2
        tile_size = self.settings.tile_size
        wanted = -(-paths // tile_size**2)
        path_buffer = self._state.path_buffer.grown(self.device, wanted, tile_size)
        assert path_buffer.room(tile_size) >= wanted, f"{paths:,} paths do not fit the memory of the device"
        self._state = replace(self._state, path_buffer=path_buffer)
        batch = replace(self._batch(slots, path_buffer), path_count=paths)
        batch.params["tile_size"] = slot_width_px
        self.device.finish()
        began = time.perf_counter()
        self._tracer.trace(batch)
        self.device.finish()
        return time.perf_counter() - began
