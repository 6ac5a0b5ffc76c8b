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

_FILE = "cell_statistics"
_RULES = layout.CLASSES * len(layout.RulePlane)
_VISIBLE = (1e-3, 14.0)
"""Radiances between which the display shows an error; AgX clips at 1.8e-4 and at 16.3."""


class Statistics:
    """What is known of the pairs of a picture of `width` x `height` pixels, as of the last `update`.

    cells         layout.CellPlane of each class, a float for each cell.
    column_rules  what follows for pixels: layout.RulePlane, each for each class, interpolated along rows.
    spans         of each patch the columns near which anything changes: the first, and that behind
                  the last; and the same of the update before.
    """

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.patches = patches = Patches(device, width, height)

        def planes(count: int) -> cl.Buffer:
            return device.empty(4 * count * patches.cells)

        self.cells = planes(layout.CLASSES * len(layout.CellPlane))
        self.column_rules = device.empty(4 * _RULES * width * patches.cell_rows)
        self.spans = device.empty(16 * patches.count)
        device.fill(self.spans, 0, 16 * patches.count)
        self._rules = planes(_RULES)
        self._cell_sums = planes(layout.CLASSES * len(layout.CellSum))
        self._slopes = device.upload(squared_slopes())

    def update(self, film: Film, guides: Guides) -> None:
        """Take in what the film has of pairs."""
        self._pool(self.patches, self._values(film, guides))

    def tile_sums(
        self, film: Film, guides: Guides, grid: TileGrid, shrunk: Mapping[str, cl.Buffer]
    ) -> TileSums:
        """Sums over the tiles of a grid over the picture, from what the film has; variances of the picture
        are those of the last `update`, and `shrunk` is what shrinkage says of it. It waits for the
        device."""
        device, rows = self.patches.device, grid.rows * len(layout.TileSum)
        columns, sums = device.empty(4 * rows * grid.width), device.empty(4 * rows * grid.columns)
        values = {**self._values(film, guides), **shrunk, "columns": columns}
        self._sum_columns(self.patches, grid, values, sums)
        found = device.read(sums, np.empty((len(layout.TileSum), grid.count), np.float32))
        named = {one.name.lower(): found[one].astype(np.float64) for one in layout.TileSum}
        return TileSums(pixels=_tile_pixels(grid), **named)

    def idle_launches(self, film: Film, guides: Guides) -> list[Callable[[], None]]:
        """The launches of all kernels, with nothing to do; see `Device.built`."""
        scratch = dict.fromkeys(("columns", "shown_image", "shown_shares"), self._cell_sums)
        values, nothing = self._values(film, guides) | scratch, self.patches.nothing
        grid = TileGrid(1, 0, 1)
        # Sums of tiles may be so many that PoCL's grid is a large one.
        return [
            partial(self._pool, nothing, values),
            *(
                partial(self._sum_columns, nothing, grid, values, self._cell_sums, size)
                for size in BUILD_SIZES
            ),
        ]

    def _values(self, film: Film, guides: Guides) -> dict[str, Any]:
        return {
            "anchor_sums": film.radiance_sums(),
            "pairs": film.planes(PAIR_SUMS),
            "labels": guides.labels,
            "cell_sums": self._cell_sums,
            "cells": self.cells,
            "rules": self._rules,
            "spans": self.spans,
            "has_target": int(guides.has_target),
            "slopes": self._slopes,
        }

    def _pool(self, patches: Patches, values: Mapping[str, Any]) -> None:
        patches.launch("measure_cells", _FILE, values)
        patches.launch_cells("pool_cells", _FILE, values, layout.CLASSES)
        spread_cells(patches, _RULES, self._rules, self.column_rules)
        patches.launch_items("find_spans", _FILE, values, max(patches.count, 1))

    def _sum_columns(
        self, patches: Patches, grid: TileGrid, values: Mapping[str, Any], sums: cl.Buffer, least: int = 1
    ) -> None:
        own = {**values, "row_count": grid.tile_size}
        patches.launch("tile_columns", "tile_columns", own, rows=grid.tile_size)
        rows = grid.rows * len(layout.TileSum)
        own = {
            "row_total": rows,
            "column_total": grid.width,
            "column_count": grid.tile_size,
            "column_sums": values["columns"],
            "square_sums": sums,
        }
        patches.launch_items("sum_columns", "sum_columns", own, max(rows * grid.columns, least))


def spread_cells(patches: Patches, planes: int, cells: cl.Buffer, columns: cl.Buffer) -> None:
    """Interpolate planes with a float for each cell along the rows: to `columns`, with a float for each
    column of pixels of each row of cells."""
    values = {"plane_total": planes, "cell_values": cells, "column_values": columns}
    patches.launch_rows("spread_cells", _FILE, values, planes * patches.cell_rows)


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
