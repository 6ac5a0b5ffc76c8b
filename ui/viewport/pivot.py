"""The point that all of what is selected share when it is turned and scaled: see `Tool.pivot`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.scene.model import Scene

Array = npt.NDArray[np.float64]


def shared_point(scene: Scene, names: tuple[str, ...], pivot: str) -> Array:
    """(3,) where handles stand and what the mouse is measured from, world space: the position of the active
    one, which is the last, or the mean of all positions."""
    chosen = names[-1:] if pivot == "active" else names
    mean: Array = np.mean([scene.placed(name).position for name in chosen], axis=0)
    return mean
