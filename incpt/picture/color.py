"""Colours: from what files and people write to linear values, and back."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def linear_from_srgb(encoded: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """What values from 0 to 1 in sRGB stand for (IEC 61966-2-1)."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.0) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """The inverse of `linear_from_srgb`; what is above 1 goes on along the same curve."""
    x = np.asarray(linear, np.float64)
    return np.where(x <= 0.04045 / 12.92, x * 12.92, 1.055 * np.maximum(x, 0.0) ** (1 / 2.4) - 0.055)
