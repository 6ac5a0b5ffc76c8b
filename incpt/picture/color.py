"""Colours: from what files and people write to linear values."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def linear_from_srgb(encoded: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """What values from 0 to 1 in sRGB stand for (IEC 61966-2-1)."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
