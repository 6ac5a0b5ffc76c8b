"""Which tiles get how many samples, and which of them pairs: from what was measured of each tile.

The variance of what a tile shows after m samples, of which the old picture has n0 behind it, is about

    V(m) = u / m + v rho^2 / (n0 + m),    u = v (1 - rho^2)

where v is the variance of a path and rho the correlation of paths in both scenes with the same random
numbers: the uncorrelated share starts over, the correlated one goes on being refined. Samples go where V
falls fastest per cost, g(m) / cost with g(m) = u / m^2 + v rho^2 / (n0 + m)^2, until all tiles are level: the
steps of water filling. A path costs 1, and its partner 1 more where it met something that changed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from incpt.render.impact.tile_sums import TileSums
from incpt.render.plan import CountArray

FloatArray = npt.NDArray[np.float64]

PAIRS_FIRST = 2.0
"""Pairs per pixel before a tile may do without partners."""
NEIGHBOURS_WEIGHT = 0.5
"""Samples that the tiles around count for in what is believed of a tile."""
SHOWN_TWICE = 2.0
"""Noise that is shown counts so many times, since more of it will be with more samples."""
LEAST_SHOWN = 1e-2
"""The least share of its noise that a tile counts as showing: a change that drowned in noise is found so."""
LEAST_SHARE = 1e-3
"""The least variance of a tile, over the mean of all: no tile is left without samples for ever, since what
was never seen there cannot have been measured."""
_LEAST_SAMPLES = 1e-6
_GAIN_SPAN, _LEVEL_STEPS, _SAMPLE_STEPS = 40.0, 16, 4
"""By how much gains are searched below the highest, in powers of e; steps of bisection for gains, which leave
0.03 % of the samples open, and of Newton's method for samples, which leave less than 1 %."""
_UNKNOWN_TOUCHED = 0.3
"""The share of paths that have a partner, while no path of a tile is there."""


@dataclass(frozen=True, eq=False)
class Allocation:
    """(tiles,) samples per pixel to draw next, 0 where there are enough, and whether they go without
    partners."""

    samples: CountArray
    singles: npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TileVariances:
    """What is believed of each tile, (tiles,) all.

    uncorrelated  u, of a pair at the best weight, or v where a tile does without partners
    correlated    v rho^2, or 0 there
    singles       whether it does
    cost          of a sample, in paths
    samples       m, samples per pixel so far
    kept          n0, samples behind the old picture
    """

    uncorrelated: FloatArray
    correlated: FloatArray
    singles: npt.NDArray[np.bool_]
    cost: FloatArray
    samples: FloatArray
    kept: FloatArray

    def gain(self, samples: FloatArray) -> FloatArray:
        """How fast the variance falls with each path, at so many samples."""
        return (self.uncorrelated / samples**2 + self.correlated / (self.kept + samples) ** 2) / self.cost


def worth(sums: TileSums) -> FloatArray:
    """(tiles,) samples of a fresh picture that each tile is worth: 1 / n = (1 - rho^2) / m + rho^2 / (n0 +
    m), 0 where none was drawn yet."""
    pixels = np.maximum(sums.pixels, 1)
    m, n0 = sums.samples / pixels, sums.kept / pixels
    v = _ratio(sums.squares_new, sums.freedom_new)
    old = _ratio(sums.squares_old, sums.freedom_pairs)
    covariance = np.clip(_ratio(sums.products, sums.freedom_pairs), 0, np.sqrt(v * old))
    # A tile that is black in both scenes has no noise at all.
    rho2 = np.where(v * old > 0, covariance**2 / np.maximum(v * old, 1e-300), 1.0 * (v <= 0))
    rho2 = np.where((sums.freedom_new > 0) & (sums.freedom_pairs > 0), np.minimum(rho2, 1), 0)
    rho2 = np.where(sums.touched == 0, 1.0, rho2)
    drawn = np.maximum(m, 1e-9)
    return np.where(m > 0, 1 / ((1 - rho2) / drawn + rho2 / (n0 + drawn)), 0.0)


def variances(sums: TileSums, columns: int) -> TileVariances:
    """What to believe of each tile of a grid with so many columns. Where few samples are there, the squared
    differences of pairs and the tiles around fill in."""
    pixels = np.maximum(sums.pixels, 1)
    m, pairs, freedom = sums.samples / pixels, sums.pairs / pixels, sums.freedom_new / pixels
    v = _ratio(sums.squares_new, sums.freedom_new)
    old = _ratio(sums.squares_old, sums.freedom_pairs)
    covariance = np.clip(_ratio(sums.products, sums.freedom_pairs), 0, np.sqrt(v * old))
    covered = np.where(old > 0, covariance**2 / np.maximum(old, 1e-300), 0.0)
    measured = np.maximum(v - covered, 0)
    # One pair in each pixel tells half of what two would.
    of_differences = np.minimum(0.5 * pairs, 1.0)
    known = freedom + of_differences
    differences = _ratio(sums.differences, sums.pairs)
    own = _ratio(measured * freedom + differences * of_differences, known)
    unchanged = np.maximum(_ratio(sums.squares_kept, sums.pairs) - differences, 0)
    correlated = _ratio(covered * freedom + unchanged * of_differences, known)
    believed = np.minimum(known, 1.0)
    around = _ratio(_smoothed(own * believed, columns), _smoothed(believed, columns))
    uncorrelated = (own * known + around * NEIGHBOURS_WEIGHT) / (known + NEIGHBOURS_WEIGHT)
    touched = np.where(sums.samples > 0, _ratio(sums.touched, sums.samples), _UNKNOWN_TOUCHED)
    singles = (sums.freedom_new > 0) & (v < uncorrelated * (1 + touched)) & (pairs >= PAIRS_FIRST)
    uncorrelated = np.where(singles, v, uncorrelated)
    # Noise that shrinkage does not show need not be sampled away.
    shown = np.where(sums.noise > 0, SHOWN_TWICE * _ratio(sums.shown_noise, sums.noise), 1)
    uncorrelated = uncorrelated * np.clip(shown, LEAST_SHOWN, 1)
    least = LEAST_SHARE * max(float(uncorrelated.mean()), 1e-30)
    return TileVariances(
        uncorrelated=np.maximum(uncorrelated, least),
        correlated=np.where(singles, 0.0, correlated),
        singles=singles,
        cost=np.where(singles, 1.0, 1 + touched),
        samples=m,
        kept=sums.kept / pixels,
    )


def allocate(
    tiles: TileVariances, pixels: FloatArray, budget: float, random: np.random.Generator
) -> Allocation:
    """Samples worth about `budget` paths, for tiles of so many pixels. Parts of a sample are rounded at
    random, so that tiles which need a hundredth of one get theirs too. At least one tile gets a sample."""
    needed = np.maximum(_levelled(tiles, pixels, budget) - tiles.samples, 0)
    samples = np.floor(needed + random.random(len(needed))).astype(np.int64)
    if not samples.any():
        samples[np.argmax(needed)] = 1
    return Allocation(samples, tiles.singles)


def _levelled(tiles: TileVariances, pixels: FloatArray, budget: float) -> FloatArray:
    """(tiles,) samples at which the gain is the same everywhere, or lower where there are more already."""
    # Natural logarithms of the gain. At the highest of all nobody needs a sample more.
    high = float(np.log(tiles.gain(np.maximum(tiles.samples, _LEAST_SAMPLES)).max()))
    low = high - _GAIN_SPAN
    for _ in range(_LEVEL_STEPS):
        level = 0.5 * (low + high)
        needed = np.maximum(_samples_at(tiles, np.exp(level)) - tiles.samples, 0)
        if float((needed * tiles.cost * pixels).sum()) > budget:
            low = level
        else:
            high = level
    return _samples_at(tiles, np.exp(high))


def _samples_at(tiles: TileVariances, gain: float) -> FloatArray:
    """(tiles,) the samples at which the gain has come down to that.

    By Newton's method for gain^(-1/2), which is linear in the samples where only one of both terms counts and
    concave everywhere: from below it comes closer with each step, and never goes beyond."""
    alone = np.sqrt(tiles.uncorrelated / (tiles.cost * gain))
    refined = np.sqrt(tiles.correlated / (tiles.cost * gain)) - tiles.kept
    samples = np.maximum(np.maximum(alone, refined), _LEAST_SAMPLES)
    for _ in range(_SAMPLE_STEPS):
        own, all_samples = 1 / samples, 1 / (tiles.kept + samples)
        of_own, of_all = tiles.uncorrelated * own**2, tiles.correlated * all_samples**2
        there = (of_own + of_all) / tiles.cost
        slope = (of_own * own + of_all * all_samples) / tiles.cost
        samples = samples + there * (np.sqrt(there / gain) - 1) / slope
    return samples


def _smoothed(values: FloatArray, columns: int) -> FloatArray:
    """Values per tile, each with a part of those around: a Gaussian of one tile."""
    weights = np.exp(-0.5 * np.arange(-2, 3) ** 2.0)
    weights /= weights.sum()
    image = values.reshape(-1, columns)
    for axis in (0, 1):
        padded = np.pad(image, [(2, 2) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        length = image.shape[axis]
        image = sum(
            weight * np.take(padded, range(k, k + length), axis=axis) for k, weight in enumerate(weights)
        )
    return np.asarray(image).ravel()


def _ratio(a: FloatArray, b: FloatArray) -> FloatArray:
    """a / b, 0 where b is."""
    return np.where(b > 0, a / np.where(b > 0, b, 1), 0.0)
