"""How a cost grows: a power law through measured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PowerLaw:
    """cost = factor * size^exponent, least squares on logarithms; `error` is the standard error of the
    exponent, None for two points."""

    factor: float
    exponent: float
    error: float | None

    def at(self, size: float) -> float:
        """The cost of a size."""
        return float(self.factor * size**self.exponent)

    def text(self) -> str:
        """Such as n^1.02 ±0.03."""
        spread = "" if self.error is None else f" ±{self.error:.2f}"
        return f"n^{self.exponent:.2f}{spread}"


def fitted(sizes: Sequence[float], costs: Sequence[float]) -> PowerLaw | None:
    """The power law through points; None where there are not two sizes. Sizes and costs that are not
    positive have no logarithm and are left out."""
    points = np.array([(s, c) for s, c in zip(sizes, costs, strict=True) if s > 0 and c > 0], float)
    if len(points) == 0 or len(np.unique(points[:, 0])) < 2:
        return None
    x, y = np.log(points).T
    exponent, offset = np.polyfit(x, y, 1)
    error = None
    if len(x) > 2:
        residual = y - (exponent * x + offset)
        error = float(np.sqrt((residual**2).sum() / (len(x) - 2) / ((x - x.mean()) ** 2).sum()))
    return PowerLaw(float(np.exp(offset)), float(exponent), error)
