"""What pairs of paths say of each tile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TileSums:
    """Sums over the pixels of each tile, (grid.count,) all. Squares and products are means over the channels,
    and weighted by the squared slope of the display curve where the shown picture stands on it.

    pixels         how many there are
    samples        of the scene as it is now
    pairs          of these, those with a known value in the anchor's scene
    touched        of these samples, those that met something that changed
    kept           samples behind the anchor's picture
    freedom_new    degrees of freedom of `squares_new`: samples - 1 of each pixel, where there are two
    freedom_pairs  of `squares_old` and `products`: pairs - 1 of each pixel, where there are two
    squares_new    squared deviations of new samples from the mean of their pixel
    squares_old    the same of the old values of pairs
    products       products of both deviations
    squares_kept   squared deviations of the old values of pairs from the old picture, which they refine; of
                   as many degrees of freedom as there are pairs
    differences    squared differences of the two values of a pair
    error          variances of the picture that is shown
    noise          variances of samples of the change, and `shown_noise`, how much of them shrinkage shows
    """

    pixels: FloatArray
    samples: FloatArray
    pairs: FloatArray
    touched: FloatArray
    kept: FloatArray
    freedom_new: FloatArray
    freedom_pairs: FloatArray
    squares_new: FloatArray
    squares_old: FloatArray
    products: FloatArray
    squares_kept: FloatArray
    differences: FloatArray
    error: FloatArray
    noise: FloatArray
    shown_noise: FloatArray
