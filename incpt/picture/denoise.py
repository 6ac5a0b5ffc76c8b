"""Denoising for whoever looks: Open Image Denoise, and how much of what it makes is shown.

A denoiser trades noise for bias. Where a picture has little noise left the bias is the larger of the two, and
a denoised picture would be worse than the picture. So both are mixed, cell by cell, by what is known of the
noise. With N the picture, D the denoised one, and s² the variance of N, all as a display would show them,

    N + w (D - N),    w = s² / mean((N - D)²) over a cell, at most 1

is the mixture with the least error, if the noise of N is independent of D: Stein's estimator with D as its
target (Green and Strawderman, "A James-Stein Type Estimator for Combining Unbiased and Possibly Biased
Estimators", JASA 1991). What D has of the noise makes w a little too large. As samples come in w goes to
zero, so that what is shown still converges to the right picture.

The noise is measured between pictures of the same scene with different numbers of samples (`NoiseGauge`).
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import numbers
from incpt.core.errors import InputError

Float32Array = npt.NDArray[np.float32]

CELL = 16
"""Edge of the cells of a picture in which noise is measured and mixed, pixels."""
MIDDLE_GREY = 0.18
"""The radiance that displays show half as bright as the brightest."""
ALL_NOISE_SPP = 4
"""Up to so many samples nothing but noise is taken to part a picture from what is denoised of it."""
LEAST_SHARE = 0.02
"""Shares of a denoised picture below this are left out, so that what has converged is not touched."""


def is_available() -> bool:
    """Whether Open Image Denoise is installed."""
    return find_spec("pyoidn") is not None


def require_denoiser() -> None:
    """Raises InputError where Open Image Denoise is not installed."""
    if not is_available():
        raise InputError('denoise: Open Image Denoise is not installed; run: pip install "incpt[denoise]"')


def denoise(
    image: npt.ArrayLike, albedo: npt.ArrayLike | None = None, normal: npt.ArrayLike | None = None
) -> Float32Array:
    """(H, W, 3) `image`, linear radiance, without its noise. It is helped by what is seen: base colour and
    shading normal (H, W, 3) of the first surface, as the passes "albedo" and "normal" of `Session.pass_image`
    or as `FirstHits` has them. What is not finite counts as black.

    Raises InputError for arrays of other shapes, and where Open Image Denoise is not installed.
    """
    color = np.nan_to_num(np.maximum(_picture("image", image), 0), posinf=0.0)
    guides = [None if guide is None else _picture(name, guide)
              for name, guide in (("albedo", albedo), ("normal", normal))]  # fmt: skip
    if any(guide is not None and guide.shape != color.shape for guide in guides):
        raise InputError(f"albedo, normal: have not the shape of the image, {color.shape}")
    require_denoiser()
    import pyoidn

    if guides[0] is None:
        # The library takes normals beside base colours only.
        return np.asarray(pyoidn.denoise(color, hdr=True), np.float32)
    limits = ((0, 1), (-1, 1))
    clipped = [None if guide is None else np.clip(guide, *limit)
               for guide, limit in zip(guides, limits, strict=True)]  # fmt: skip
    return np.asarray(pyoidn.denoise(color, *clipped, hdr=True), np.float32)


def _picture(name: str, values: npt.ArrayLike) -> Float32Array:
    picture: Float32Array = np.ascontiguousarray(numbers(name, values, np.float32))
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
        raise InputError(f"{name}: has shape {picture.shape}; a picture has shape (height, width, 3)")
    return picture


class NoiseGauge:
    """Measures the noise of a picture as it gains samples. What it knows is of one size; of another one it
    starts anew."""

    def __init__(self) -> None:
        self._shown: Float32Array | None = None
        self._spp: npt.NDArray[np.float64] | None = None
        self._per_sample: npt.NDArray[np.float64] | None = None

    def begin(self) -> None:
        """The next picture is of another scene: it says nothing beside the last one. What is known of the
        noise of a sample stays, since most of a picture stays as noisy as it was."""
        self._shown = self._spp = None

    def knows(self, shape: tuple[int, ...]) -> bool:
        """Whether anything is known of the noise of pictures of that shape."""
        height, width = shape[:2]
        cells = -(-height // CELL), -(-width // CELL)
        return self._spp is not None and self._per_sample is not None and self._per_sample.shape == cells

    def look(self, image: Float32Array, spp: npt.NDArray[np.integer]) -> None:
        """Take in a picture (H, W, 3) of linear radiance, and the samples (H, W) behind its pixels. Where
        they are more than those of the last one, the new ones are taken to have been added to it."""
        shown, samples = as_shown(image), cell_means(spp)
        if self._per_sample is None or self._per_sample.shape != samples.shape:
            self._per_sample = np.full(samples.shape, np.nan)
        elif self._shown is not None and self._spp is not None and self._shown.shape == shown.shape:
            more = (samples > self._spp) & (self._spp >= 1)
            difference = cell_means(((shown - self._shown) ** 2).mean(axis=2))
            # Of the mean of n samples, of which n0 were there before, the variance has changed by that much.
            gained = np.divide(1.0, self._spp, where=more, out=np.ones_like(samples)) - np.divide(
                1.0, samples, where=more, out=np.zeros_like(samples)
            )
            self._per_sample = np.where(more, difference / gained, self._per_sample)
        self._shown, self._spp = shown, samples

    def variance(self) -> npt.NDArray[np.float64]:
        """(rows, columns) the variance of each cell of the last picture, of display values from 0 to 1.
        Infinite where it has so few samples that it is all noise. Cells that were not seen to gain samples
        are taken for as noisy as half of the others; all are NaN where none was."""
        assert self._spp is not None and self._per_sample is not None, "no picture was looked at"
        per_sample = self._per_sample
        known = per_sample[np.isfinite(per_sample)]
        if len(known):
            per_sample = np.where(np.isfinite(per_sample), per_sample, np.median(known))
        return np.where(self._spp <= ALL_NOISE_SPP, np.inf, per_sample / np.maximum(self._spp, 1))


def mixed(image: Float32Array, denoised: Float32Array, variance: npt.NDArray[np.float64]) -> Float32Array:
    """(H, W, 3) linear radiance: the picture, and of the denoised one as much as its noise asks for, see the
    module. `variance` (rows, columns) is that of cells, infinite where all of it is noise, NaN where
    nothing is known of it: nothing is taken there."""
    noisy, clean = as_shown(image), as_shown(denoised)
    apart = cell_means(((noisy - clean) ** 2).mean(axis=2))
    with np.errstate(invalid="ignore"):
        share = np.clip(variance / np.maximum(apart, 1e-12), 0.0, 1.0)
    share[~(share >= LEAST_SHARE)] = 0.0
    weight = _over_pixels(share, image.shape[:2])[..., None]
    shown = noisy + weight * (clean - noisy)
    radiance = MIDDLE_GREY * shown / np.maximum(1 - shown, 1e-6)
    return np.where(weight > 0, radiance, image).astype(np.float32)


def as_shown(image: Float32Array) -> Float32Array:
    """Linear radiance from 0 on to display values from 0 to 1, by a curve that is quick to turn back."""
    radiance = np.nan_to_num(np.maximum(image, 0), posinf=1e6)
    return np.asarray(radiance / (radiance + np.float32(MIDDLE_GREY)), np.float32)


def cell_means(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """(rows, columns) means of (H, W) values over cells, which the edges of the picture cut."""
    height, width = values.shape
    rows, columns = np.arange(0, height, CELL), np.arange(0, width, CELL)
    sums = np.add.reduceat(np.add.reduceat(values.astype(np.float64), rows, axis=0), columns, axis=1)
    counts = np.outer(np.diff([*rows, height]), np.diff([*columns, width]))
    return np.asarray(sums / counts)


def _over_pixels(cells: npt.NDArray[np.float64], size: tuple[int, int]) -> Float32Array:
    """(H, W) values of cells, interpolated between their middles, so that no edge of a cell is seen."""
    result = cells
    for axis in (0, 1):
        at = np.clip((np.arange(size[axis]) + 0.5) / CELL - 0.5, 0, cells.shape[axis] - 1)
        first = np.minimum(at.astype(np.intp), max(cells.shape[axis] - 2, 0))
        second = np.minimum(first + 1, cells.shape[axis] - 1)
        part = np.expand_dims(at - first, 1 - axis)
        result = np.take(result, first, axis) * (1 - part) + np.take(result, second, axis) * part
    return result.astype(np.float32)
