"""Open Image Denoise: what artists put over a picture that starts over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from incpt.benchmarks.kit import options
from incpt.picture.denoise import denoise

FloatImage = npt.NDArray[np.float32]

GUIDES = ("albedo", "normal")
"""Passes of the film that it is helped by; the setting `aovs` adds them."""


class Denoiser:
    """Takes the noise away from pictures. Raises InputError where Open Image Denoise is not installed."""

    def __init__(self) -> None:
        options.optional("pyoidn", "restart + OIDN", "denoise")

    def denoised(self, image: FloatImage, guides: Sequence[FloatImage]) -> FloatImage:
        """(H, W, 3) `image`, linear radiance, without its noise; `guides` are pictures of GUIDES."""
        return denoise(image, *guides)
