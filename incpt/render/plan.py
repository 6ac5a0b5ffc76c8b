"""Queues of tiles, and the plan of a step.

The path buffer of a step has room for a number of *slots*, each for one repetition of a tile with one
path per pixel. `plan_step` fills them from a queue of tiles, each repeated as often as the queue says: NoR
times after a local edit (thesis, sections 3.1 to 3.4):

    tiles completed per step = slots / NoR     (400 x 400 pixels, tile 10, NoR 4: 1600 / 4 = 400)

The thesis prints 10 for that example; its formula, buffer / (tile area * NoR), gives 400.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from incpt.core import layout
from incpt.render.impact.findings import Findings
from incpt.render.tiles import BoolArray, IntArray, TileGrid

CountArray = npt.NDArray[np.int64]
SPARSE_STEP = 4
"""Pixels from one to the next of a sparse entry, and tiles that it reaches over, in x and y."""


@dataclass(frozen=True)
class Cursor:
    """How far a queue is done: the first `tiles` of it, and `samples` of the next one."""

    tiles: int = 0
    samples: int = 0


@dataclass(frozen=True, eq=False)
class Queue:
    """Tiles in the order in which they are rendered. Nobody can write to the arrays any more.

    tiles     (N,) the order. Where a tile comes again, a step ends before it does.
    samples   (N,) paths per pixel of each of them, one at least. Each path per pixel fills a slot.
    replaces  whether a finished tile replaces what the film has of it, with samples counted from 0 (BASE,
              INCREMENTAL), or is added to it and counts on from there (REFINE).
    subsets   (N,) None: all entries are whole tiles, as those with -1 are. An entry with a number from 0 to
              15 is sparse: of each square of 4 x 4 pixels it takes the one with that number, row by row, over
              the 4 x 4 tiles from its tile on. It has one sample, with the index before the first one of
              tiles.
    singles   (N,) whether the paths of an entry have no partners in the scene before the edit; None: no
              entry's have.
    worth     (grid.count,) samples of the scene as it is now that each tile is worth, where that is not how
              many were drawn; None: it is.
    findings  what was known of a change when the queue was planned; None: nothing yet, or nobody asks.
    """

    tiles: IntArray
    samples: CountArray
    replaces: bool
    subsets: npt.NDArray[np.int8] | None = None
    singles: npt.NDArray[np.bool_] | None = None
    worth: CountArray | None = None
    findings: Findings | None = None

    def __post_init__(self) -> None:
        for array in (self.tiles, self.samples, self.subsets, self.singles, self.worth):
            if array is not None:
                array.flags.writeable = False

    @classmethod
    def even(cls, tiles: IntArray, samples: int, replaces: bool) -> Queue:
        """A queue with the same number of samples for each tile."""
        return cls(tiles, np.full(len(tiles), samples, np.int64), replaces)

    @cached_property
    def ends(self) -> CountArray:
        """(N,) the slots up to the end of each tile, itself included."""
        return np.cumsum(self.samples)

    @property
    def slot_count(self) -> int:
        """The slots that the whole queue fills."""
        return int(self.ends[-1])

    def slots_before(self, cursor: Cursor) -> int:
        """The slots that are done where `cursor` stands."""
        return (int(self.ends[cursor.tiles - 1]) if cursor.tiles else 0) + cursor.samples


@dataclass(frozen=True, eq=False)
class Plan:
    """One step: `slots` (layout.SLOT) says which tile and sample is in which slot, `finished` which tiles
    are complete after it, in queue order, and `finished_samples` how many samples each of them got; `cursor`
    is where the next step goes on. Sparse entries finish no tile."""

    slots: npt.NDArray[np.void]
    finished: IntArray
    finished_samples: CountArray
    cursor: Cursor


def plan_step(
    grid: TileGrid,
    queue: Queue,
    cursor: Cursor,
    slot_count: int,
    sample_counts: npt.NDArray[np.integer],
    first_sample: int = 0,
    stale: BoolArray | None = None,
) -> Plan:
    """Fill up to `slot_count` slots from where `cursor` stands in `queue`, but not past its end.

    `sample_counts` (grid.count,) is how many samples were drawn of each tile; it must not change while a tile
    is under way. The first of them had the index `first_sample`. Tiles that are `stale` (grid.count,) replace
    what the film has of auxiliary images.

    The repetitions of a tile in this step form a group of neighbouring slots with consecutive sample indices.
    Where a tile has more samples than there are slots, its groups follow in the next steps: FIRST marks the
    group that starts the tile, LAST the one that completes it.
    """
    begin = queue.slots_before(cursor)
    end = min(begin + slot_count, queue.slot_count, _slots_without_repetition(queue, cursor, slot_count))
    assert slot_count > 0 and begin < end, "a step needs a slot and a queue that is not done"

    last = int(np.searchsorted(queue.ends, end))
    place = slice(cursor.tiles, last + 1)
    tiles, tile_end = queue.tiles[place], queue.ends[place]
    tile_begin = tile_end - queue.samples[place]
    group_begin, group_end = np.maximum(tile_begin, begin), np.minimum(tile_end, end)
    sample_of_tile = group_begin - tile_begin
    completes = group_end == tile_end

    groups = np.zeros(len(tiles), layout.SLOT)
    groups["tile_x"], groups["tile_y"] = grid.origin(tiles)
    groups["pixel_step"] = 1
    groups["first_sample"] = first_sample + sample_of_tile
    if not queue.replaces:
        groups["first_sample"] += sample_counts[tiles].astype(np.uint32)
    groups["group_first"] = group_begin - begin
    groups["group_count"] = group_end - group_begin
    groups["flags"] = (
        (sample_of_tile == 0) * int(layout.SlotFlag.FIRST)
        + completes * int(layout.SlotFlag.LAST)
        + queue.replaces * int(layout.SlotFlag.REPLACE)
    )
    if queue.singles is not None:
        groups["flags"] += queue.singles[place] * np.uint32(layout.SlotFlag.SINGLE)
    if stale is not None:
        groups["flags"] += stale[tiles] * np.uint32(layout.SlotFlag.REPLACE_AOVS)
    finishes = completes
    if queue.subsets is not None:
        subset = queue.subsets[place]
        _thin_out(groups, subset, first_sample)
        finishes = completes & (subset < 0)
    return Plan(
        slots=np.repeat(groups, groups["group_count"]),
        finished=tiles[finishes],
        finished_samples=queue.samples[place][finishes],
        cursor=Cursor(last + 1) if completes[-1] else Cursor(last, end - int(tile_begin[-1])),
    )


def _slots_without_repetition(queue: Queue, cursor: Cursor, slot_count: int) -> int:
    """The slots of a queue up to where a tile comes again in a step of so many slots. Sparse entries do not
    count, whose pixels have a sample of their own."""
    tiles = queue.tiles[cursor.tiles : cursor.tiles + slot_count]
    first = np.unique(tiles, return_index=True)[1]
    if queue.subsets is not None or len(first) == len(tiles):
        return queue.slot_count
    again = int(np.setdiff1d(np.arange(len(tiles)), first)[0])
    return int(queue.ends[cursor.tiles + again - 1])


def _thin_out(groups: npt.NDArray[np.void], subset: npt.NDArray[np.int8], first_sample: int) -> None:
    """Let the groups with a subset take one pixel of each square of 4 x 4."""
    sparse = subset >= 0
    assert not sparse.any() or first_sample > 0, "the sample of sparse entries has the index before the first"
    groups["pixel_step"][sparse] = SPARSE_STEP
    groups["first_sample"][sparse] = first_sample - 1
    groups["tile_x"][sparse] += subset[sparse].astype(np.uint32) % SPARSE_STEP
    groups["tile_y"][sparse] += subset[sparse].astype(np.uint32) // SPARSE_STEP


def counts_after(queue: Queue, plan: Plan, counts: CountArray) -> CountArray:
    """(grid.count,) the samples behind each tile after a step of `queue`, from those before it."""
    after = counts.copy()
    after[plan.finished] = plan.finished_samples + (0 if queue.replaces else counts[plan.finished])
    return after


def is_done(queue: Queue, cursor: Cursor) -> bool:
    """Whether every tile of the queue is complete."""
    return cursor.tiles == len(queue.tiles)
