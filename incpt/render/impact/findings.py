"""Findings: what pairs of paths say of a change so far, for whoever looks at the picture.

How far a change has been found follows from what allocation believes of the tiles. Of the variance of a path
the correlated share goes on being refined as if nothing had happened; what the edit cost is the uncorrelated
share u, of which a tile has m samples where it had n0. The error that is left of the edit is therefore

    u (1 / m - 1 / n0)      in each tile that any path found changed, 0 once m >= n0

and `Findings.error_left` is its root over that of a single sample a pixel, u, both summed up over the
picture. Shrinkage is not in it, so that it rather says too much than too little: the picture that is shown
is better. Over four edits (a cube and a ball moved, a colour, a lamp) of a kept picture of 256 samples it
fell with the measured share of visible error, as where 0.25, 0.89, 0.74 and 1.0 were told and 0.07, 0.11,
0.27 and 0.29 left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incpt.render.impact.tile_sums import FloatArray, TileSums


@dataclass(frozen=True, eq=False)
class Findings:
    """What is known of a change; arrays have a value for each tile, (grid.count,). Nobody can write to them.

    error_left  the share of the visible error of the change that is left: 1 as long as nothing is known, 0
                where the picture is as good as before the edit.
    error       standard error of each tile that is left of the edit, root mean square over its pixels, as a
                share of the range of the display.
    touched     the share of the paths that met something that changed.
    singles     the share of those that were traced without a partner, so that the old picture tells nothing
                of what they brought.
    weight      b, with which deviations of the old values of pairs are taken off: 0 where the tile starts
                over, 1 where the old picture holds but for a difference. 0 where no path is touched.
    """

    error_left: float
    error: FloatArray
    touched: FloatArray
    singles: FloatArray
    weight: FloatArray

    def __post_init__(self) -> None:
        for array in (self.error, self.touched, self.singles, self.weight):
            array.flags.writeable = False


def findings(sums: TileSums, uncorrelated: FloatArray) -> Findings:
    """What sums over the tiles say of the change. `uncorrelated` (tiles,): u, as allocation believes it."""
    is_touched = sums.touched > 0
    started_over = np.where(is_touched, uncorrelated, 0.0)
    # Where a pixel has no sample yet, those around stand for it.
    drawn = np.maximum(_ratio(sums.samples, sums.pixels), 1.0)
    kept = np.maximum(_ratio(sums.kept, sums.pixels), 1e-9)
    left = started_over * np.maximum(1 / drawn - 1 / kept, 0.0)
    whole = float((started_over * sums.pixels).sum())
    weight = _ratio(sums.products, sums.squares_old) * _ratio(sums.pairs, sums.samples)
    return Findings(
        error_left=float(np.sqrt((left * sums.pixels).sum() / whole)) if whole > 0 else 0.0,
        error=np.sqrt(left),
        touched=_ratio(sums.touched, sums.samples),
        singles=np.clip(_ratio(sums.samples - sums.pairs, sums.touched), 0.0, 1.0),
        weight=np.where(is_touched, np.clip(weight, 0.0, 1.0), 0.0),
    )


def _ratio(values: FloatArray, by: FloatArray) -> FloatArray:
    return np.divide(values, by, out=np.zeros_like(values), where=by > 0)
