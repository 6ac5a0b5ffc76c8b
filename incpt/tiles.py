"""Tiles: the grid over the image, the order in which they are rendered, and the plan of a step.

The path buffer of a step has room for a number of *slots*, each for one copy of one tile with one path
per pixel. `plan` fills them from a queue of tiles, each repeated NoR times (thesis, sections 3.1 to 3.4):

    tiles completed per step = slots / NoR     (400 x 400 pixels, tile 10, NoR 4: 1600 / 4 = 400)

The thesis prints 10 for that example; its formula, buffer / (tile area * NoR), gives 400.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from incpt import layout

IntArray = npt.NDArray[np.int32]
Index = TypeVar("Index", int, IntArray)

FARTHEST_TILE = 1 << 30
"""Bound on the tile coordinates of a point of change: squares of them still fit 64 bits."""


@dataclass(frozen=True)
class TileGrid:
    """Square tiles of `tile_size` pixels over an image of `width` x `height`, numbered row by row from the
    top left; those at the right and the bottom edge are cut."""

    width: int
    height: int
    tile_size: int

    @property
    def columns(self) -> int:
        return -(-self.width // self.tile_size)

    @property
    def rows(self) -> int:
        return -(-self.height // self.tile_size)

    @property
    def count(self) -> int:
        return self.columns * self.rows

    def origin(self, tile: Index) -> tuple[Index, Index]:
        """The first pixel (x, y) of a tile, or of each of an array of tiles."""
        return tile % self.columns * self.tile_size, tile // self.columns * self.tile_size

    def size(self, tile: int) -> tuple[int, int]:
        """Width and height of a tile in pixels, after the cut."""
        x, y = self.origin(tile)
        return min(self.tile_size, self.width - x), min(self.tile_size, self.height - y)

    def tile_at(self, x_px: Index, y_px: Index) -> Index:
        """The tile that holds a pixel of the image, or each of an array of pixels."""
        return y_px // self.tile_size * self.columns + x_px // self.tile_size

    def tile_of_pixels(self) -> IntArray:
        """(height, width) the tile of every pixel, to spread a value per tile over the image."""
        x = np.arange(self.width, dtype=np.int32)
        y = np.arange(self.height, dtype=np.int32)
        return self.tile_at(x[None, :], y[:, None])


def base_queue(grid: TileGrid) -> IntArray:
    """(count,) all tiles, row by row from the top left."""
    return np.arange(grid.count, dtype=np.int32)


def spiral_queue(grid: TileGrid, point_px: tuple[float, float]) -> IntArray:
    """(count,) all tiles along the spiral of the thesis (source code 4.1) around a point, in pixels.

    From the tile of the point one step right, one down, two left, two up, three right ...: an imaginary
    square that grows around the point, of which the tiles outside the image are left out. The point may
    lie anywhere; where it is not finite the spiral starts at the centre of the image.

    Each tile's place along the spiral is computed instead of walked to, and the tiles sorted by it: a walk
    from a point d tiles away takes d^2 steps.
    """
    if not all(map(math.isfinite, point_px)):
        point_px = (grid.width / 2, grid.height / 2)
    center_x, center_y = (
        math.floor(min(max(p / grid.tile_size, -FARTHEST_TILE), FARTHEST_TILE)) for p in point_px
    )
    dx = np.arange(grid.columns, dtype=np.int64)[None, :] - center_x
    dy = np.arange(grid.rows, dtype=np.int64)[:, None] - center_y
    return np.argsort(_spiral_place(dx, dy), axis=None).astype(np.int32)


def _spiral_place(dx: npt.NDArray[np.int64], dy: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    # Ring r follows the (2r - 1)^2 tiles inside it. It starts at (r, 1 - r) and has 2r tiles on each side.
    ring = np.maximum(np.abs(dx), np.abs(dy))
    up_to_here = np.select(
        [
            (dx == ring) & (dy > -ring),  # right side, downwards
            (dy == ring) & (dx < ring),  # bottom, leftwards
            (dx == -ring) & (dy < ring),  # left side, upwards
        ],
        [ring - 1 + dy, 3 * ring - 1 - dx, 5 * ring - 1 - dy],
        7 * ring - 1 + dx,  # top, rightwards
    )
    return np.where(ring == 0, 0, (2 * ring - 1) ** 2 + up_to_here)


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


def plan(
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
