"""Statistics of pairs: how samples of the new and of the old scene spread, and how they go together.

They are pooled over cells of the picture (layout.CELL_SIZE), each class of pixels for itself, and taken from
neighbouring cells too where there are few samples: see cl/impact/cell_statistics.cl. Sums over tiles say
where more samples are worth most: cl/impact/tile_columns.cl.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import layout
from incpt.device.device import BUILD_SIZES, Device
from incpt.picture.tone_mapping import display_values
from incpt.render.film import Film
from incpt.render.impact.guides import Guides
from incpt.render.impact.patches import Patches
from incpt.render.impact.sums import PAIR_SUMS
from incpt.render.impact.tile_sums import TileSums
from incpt.render.tiles import TileGrid

_CLASSES = 2
_CELL_SUMS = _CLASSES * len(layout.CellSum)
_FILE = "cell_statistics"
_VISIBLE = (1e-3, 14.0)
"""Radiances between which the display shows an error; AgX clips at 1.8e-4 and at 16.3."""


class Statistics:
    """What is known of the pairs of a picture of `width` x `height` pixels, as of the last `update`."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.patches = patches = Patches(device, width, height)
        self.cells = device.empty(4 * _CLASSES * len(layout.CellPlane) * patches.cells)
        """layout.CellPlane of both classes."""
        self.activities = device.empty(4 * patches.count)
        """layout.Activity of each patch."""
        self._cell_sums = device.empty(4 * _CELL_SUMS * patches.cells)
        cell_rows = -(-height // layout.CELL_SIZE)
        self._columns = device.empty(4 * _CELL_SUMS * width * cell_rows)
        self._slopes = device.upload(squared_slopes())

    def update(self, film: Film, guides: Guides) -> None:
        """Take in what the film has of pairs."""
        self._pool(self.patches, self._values(film, guides))

    def tile_sums(self, film: Film, guides: Guides, grid: TileGrid) -> TileSums:
        """Sums over the tiles of a grid over the picture, from what the film has; variances of the picture
        are those of the last `update`. It waits for the device."""
        rows = grid.rows * len(layout.TileSum)
        columns = self.patches.device.empty(4 * rows * grid.width)
        sums = self.patches.device.empty(4 * rows * grid.columns)
        values = self._values(film, guides) | {"columns": columns}
        self.patches.launch_columns("tile_columns", "tile_columns", values, grid.tile_size)
        self._sum_columns(rows, grid.width, grid.tile_size, columns, sums)
        found = self.patches.device.read(sums, np.empty((len(layout.TileSum), grid.count), np.float32))
        named = {one.name.lower(): found[one].astype(np.float64) for one in layout.TileSum}
        return TileSums(pixels=_tile_pixels(grid), **named)

    def idle_launches(self, film: Film, guides: Guides) -> list[Callable[[], None]]:
        """The launches of all kernels, with nothing to do; see `Device.built`."""
        values, nothing = self._values(film, guides), self.patches.nothing
        launches: list[Callable[[], None]] = []
        for size in BUILD_SIZES:
            launches += [
                partial(self._pool, nothing, values, size),
                partial(nothing.launch_columns, "tile_columns", "tile_columns", values, 1, size),
            ]
        return launches

    def _values(self, film: Film, guides: Guides) -> dict[str, Any]:
        return {
            "anchor_sums": film.radiance_sums(),
            "pairs": film.planes(PAIR_SUMS),
            "labels": guides.labels,
            "columns": self._columns,
            "cell_sums": self._cell_sums,
            "cells": self.cells,
            "activities": self.activities,
            "slopes": self._slopes,
        }

    def _pool(self, patches: Patches, values: Mapping[str, Any], least: int = 1) -> None:
        patches.launch_columns("cell_columns", _FILE, values, layout.CELL_SIZE, least)
        cell_rows = _CELL_SUMS * -(-patches.height // layout.CELL_SIZE)
        self._sum_columns(cell_rows, patches.width, layout.CELL_SIZE, self._columns, self._cell_sums, least)
        patches.launch_items("pool_cells", _FILE, values, max(_CLASSES * patches.cells, least))
        patches.launch_items("mark_patches", _FILE, values, max(patches.count, least))

    def _sum_columns(
        self, rows: int, columns: int, count: int, sums: cl.Buffer, squares: cl.Buffer, least: int = 1
    ) -> None:
        values = {
            "row_total": rows,
            "column_total": columns,
            "column_count": count,
            "column_sums": sums,
            "square_sums": squares,
        }
        items = max(rows * -(-columns // count), least)
        self.patches.launch_items("sum_columns", "sum_columns", values, items)


@cache
def squared_slopes() -> npt.NDArray[np.float32]:
    """(SLOPE_OCTAVES * SLOPES_PER_OCTAVE,) squared slope of the default display curve for greys, display
    range (0 to 1) over radiance, at the middle of the radiances of each entry: what an error of radiance
    counts for who looks. Those that are shown black or white count as the nearest that are not."""
    entries = np.arange(layout.SLOPE_OCTAVES * layout.SLOPES_PER_OCTAVE)
    octave, part = np.divmod(entries, layout.SLOPES_PER_OCTAVE)
    exponent = octave + layout.SLOPE_FIRST_OCTAVE - 127.0
    radiance = np.clip(2.0**exponent * (1 + (part + 0.5) / layout.SLOPES_PER_OCTAVE), *_VISIBLE)
    low, high = (
        display_values(np.repeat(value[:, None], 3, axis=1))[:, 0]
        for value in (0.95 * radiance, 1.05 * radiance)
    )
    return np.asarray(((high - low) / (0.1 * radiance)) ** 2, np.float32)


@cache
def _tile_pixels(grid: TileGrid) -> npt.NDArray[np.float64]:
    """(grid.count,) pixels of each tile, after the cut at the edges."""
    widths = np.minimum(grid.tile_size, grid.width - np.arange(grid.columns) * grid.tile_size)
    heights = np.minimum(grid.tile_size, grid.height - np.arange(grid.rows) * grid.tile_size)
    return np.outer(heights, widths).ravel().astype(np.float64)
