"""Images as values: the pixels, and the file that they came from."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import frozen, numbers
from incpt.core.checks import require, require_bool
from incpt.core.errors import InputError
from incpt.core.layout import ENVIRONMENT_MAX_SIZE


@dataclass(frozen=True, eq=False)
class Image:
    """A lat-long radiance image: `pixels` (H, W, 3) float32, linear; `source` is the file it came from.

    OpenEXR's convention: the centre looks to +z, three quarters to the right is -x, the top row is +y.
    `is_placeholder` tells that it stands for `source`, which could not be read.
    """

    pixels: npt.NDArray[np.float32]
    source: str | None = None
    is_placeholder: bool = False

    def __post_init__(self) -> None:
        pixels = frozen(numbers("pixels", self.pixels, np.float32))
        require("source", self.source, (str, NoneType), "the path of a file, as a text")
        require_bool("is_placeholder", self.is_placeholder)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
            raise InputError(f"image: has shape {pixels.shape}; an environment has shape (height, width, 3)")
        if max(pixels.shape[:2]) > ENVIRONMENT_MAX_SIZE:
            raise InputError(
                f"image: {pixels.shape[1]} x {pixels.shape[0]} pixels are more than "
                f"{ENVIRONMENT_MAX_SIZE} a side; scale it down"
            )
        if not np.isfinite(pixels).all() or pixels.min() < 0:
            raise InputError("image: holds negative, infinite or undefined radiance; repair the file")
        object.__setattr__(self, "pixels", pixels)
