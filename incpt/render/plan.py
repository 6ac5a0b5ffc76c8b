"""Tiles: the grid over the image, the order in which they are rendered, and the plan of a step.

The path buffer of a step has room for a number of *slots*, each for one copy of one tile with one path
per pixel. `plan` fills them from a queue of tiles, each repeated NoR times (thesis, sections 3.1 to 3.4):

    tiles completed per step = slots / NoR     (400 x 400 pixels, tile 10, NoR 4: 1600 / 4 = 400)

The thesis prints 10 for that example; its formula, buffer / (tile area * NoR), gives 400.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.render.tiles import IntArray, TileGrid


@dataclass(frozen=True, eq=False)
class Queue:
    """Tiles in the order in which they are rendered.

    tiles     (N,) the order.
    samples   paths per pixel of each tile: NoR times the sample rate. Each fills a slot.
    replaces  whether a finished tile replaces what the film has of it, with samples counted from 0 (BASE,
              INCREMENTAL), or is added to it and counts on from there (REFINE).
    """

    tiles: IntArray
    samples: int
    replaces: bool


@dataclass(frozen=True)
class Cursor:
    """How far a queue is done: the first `tiles` of it, and `samples` of the next one."""

    tiles: int = 0
    samples: int = 0


@dataclass(frozen=True, eq=False)
class Plan:
    """One step: `slots` (layout.SLOT) says which tile and sample is in which slot, `finished` which tiles
    are complete after it, in queue order; `cursor` is where the next step goes on."""

    slots: npt.NDArray[np.void]
    finished: IntArray
    cursor: Cursor


def plan_step(
    grid: TileGrid, queue: Queue, cursor: Cursor, slot_count: int, sample_counts: npt.NDArray[np.integer]
) -> Plan:
    """Fill up to `slot_count` slots from where `cursor` stands in `queue`, but not past its end.

    `sample_counts` (grid.count,) is what the film holds of each tile; it must not change while a tile is
    under way. The copies of a tile in this step form a group of neighbouring slots with consecutive sample
    indices. Where a tile has more samples than there are slots, its groups follow in the next steps: FIRST
    marks the group that starts the tile, LAST the one that completes it.
    """
    per_tile = queue.samples
    begin = cursor.tiles * per_tile + cursor.samples
    end = min(begin + slot_count, len(queue.tiles) * per_tile)
    assert slot_count > 0 and begin < end, "a step needs a slot and a queue that is not done"

    place = np.arange(cursor.tiles, (end - 1) // per_tile + 1, dtype=np.int64)
    group_begin = np.maximum(place * per_tile, begin)
    group_end = np.minimum((place + 1) * per_tile, end)
    first_sample = group_begin - place * per_tile
    completes = group_end == (place + 1) * per_tile
    tiles = queue.tiles[place]

    groups = np.zeros(len(place), layout.SLOT)
    groups["tile_x"], groups["tile_y"] = grid.origin(tiles)
    groups["first_sample"] = first_sample if queue.replaces else first_sample + sample_counts[tiles]
    groups["group_first"] = group_begin - begin
    groups["group_count"] = group_end - group_begin
    groups["flags"] = (
        (first_sample == 0) * int(layout.SlotFlag.FIRST)
        + completes * int(layout.SlotFlag.LAST)
        + queue.replaces * int(layout.SlotFlag.REPLACE)
    )
    return Plan(
        slots=np.repeat(groups, groups["group_count"]),
        finished=tiles[completes],
        cursor=Cursor(*divmod(end, per_tile)),
    )


def is_done(queue: Queue, cursor: Cursor) -> bool:
    """Whether every tile of the queue is complete."""
    return cursor.tiles == len(queue.tiles)
