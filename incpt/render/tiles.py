"""Tiles: the grid over the image, and orders of its tiles (thesis, sections 3.1 to 3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
NO_TILES: IntArray = np.zeros(0, np.int32)
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
