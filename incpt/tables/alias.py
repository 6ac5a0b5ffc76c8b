"""Choosing among many by their weights in constant time, and what weighs a colour."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def luminance(color: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Rec. 709 luminance of linear colours (..., 3)."""
    return np.asarray(np.asarray(color, np.float64) @ _LUMINANCE)


def alias_table(
    weights: npt.NDArray[np.floating],
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
    """Walker's alias table by Vose's method (1991): cell i stands for i with probability[i], else for
    alias[i]."""
    count = len(weights)
    scaled = (np.asarray(weights, np.float64) * (count / np.sum(weights))).tolist()
    probability, alias = np.ones(count, np.float32), np.arange(count, dtype=np.uint32)
    small = [i for i, w in enumerate(scaled) if w < 1.0]
    large = [i for i, w in enumerate(scaled) if w >= 1.0]
    while small and large:
        i, j = small.pop(), large[-1]
        probability[i], alias[i] = scaled[i], j
        scaled[j] -= 1.0 - scaled[i]
        if scaled[j] < 1.0:
            small.append(large.pop())
    return probability, alias
