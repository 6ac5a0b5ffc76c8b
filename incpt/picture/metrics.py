"""How far a picture is from a converged one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.picture.tone_mapping import tone_map

FloatImage = npt.NDArray[np.floating[Any]]

RELATIVE_EPSILON = 1e-2
"""Keeps black pixels from counting without bound (Rousselle, Knaus and Zwicker 2011, section 4)."""


def normalized_rmse(image: FloatImage, reference: FloatImage) -> float:
    """Root mean square error of what is displayed, as a fraction of the display's range.

    The figure of the thesis's table 5.1, which compares captured screens: both pictures, (H, W, 3) linear
    radiance, are tone-mapped to 8-bit sRGB first. 0 is equal, 1 is black against white.
    """
    difference = tone_map(image).astype(np.float64) - tone_map(reference).astype(np.float64)
    return float(np.sqrt(np.mean(difference**2)) / 255)


def relative_mse(image: FloatImage, reference: FloatImage) -> float:
    """Mean squared error of linear radiance relative to the reference squared, per channel.

    Unlike the error of the display it sees bright values that the display clips.
    """
    reference = reference.astype(np.float64)
    squared = (image.astype(np.float64) - reference) ** 2
    return float(np.mean(squared / (reference**2 + RELATIVE_EPSILON)))
