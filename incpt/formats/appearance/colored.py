"""Colours and numbers of surfaces: constants, or images with what they are multiplied by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.formats import import_report
from incpt.picture.color import linear_from_srgb
from incpt.scene.texture import Bitmap, Texture

Array = npt.NDArray[np.float64]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear red, green and blue."""
WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Colored:
    """A colour `rgb`, times what a texture says, times the colours at the corners of a mesh."""

    rgb: Vector
    texture: Texture | None = None
    is_of_vertices: bool = False

    @property
    def is_constant(self) -> bool:
        return self.texture is None and not self.is_of_vertices

    def mapped(self, change: Callable[[Array], Array]) -> Colored:
        """With each colour (..., 3) changed."""
        if self.texture is None:
            return replace(self, rgb=vector(change(np.array(self.rgb))))
        pixels = change(linear_pixels(self.texture.bitmap)[..., :3] * self.rgb)
        return Colored(WHITE, replace(self.texture, bitmap=Bitmap(pixels)), self.is_of_vertices)


@dataclass(frozen=True, eq=False)
class NumberImage:
    """Linear numbers (H, W), where a texture places them. Its bitmap may be in colours."""

    pixels: Array
    texture: Texture

    def with_pixels(self, pixels: Array) -> Texture:
        """The texture with a bitmap of these."""
        return replace(self.texture, bitmap=Bitmap(pixels))


@dataclass(frozen=True, eq=False)
class Amount:
    """A number, or those of an image in its place."""

    value: float
    image: NumberImage | None = None

    @property
    def mean(self) -> float:
        return self.value if self.image is None else float(self.image.pixels.mean())


def as_reflectance(color: Colored, what: str) -> Colored:
    """The colour held within 0 to 1, which is told of `what`."""
    if min(color.rgb) >= 0 and max(color.rgb) <= 1:
        return color
    listed = ", ".join(f"{c:.4g}" for c in color.rgb)
    import_report.changed(f"{what}: {listed} is limited to 0 to 1")
    r, g, b = (min(max(c, 0.0), 1.0) for c in color.rgb)
    return replace(color, rgb=(r, g, b))


def linear_pixels(bitmap: Bitmap) -> Array:
    """(H, W, 3 or 4) linear colours of a bitmap whose whole numbers are in sRGB, with its alpha."""
    pixels = bitmap.pixels
    alpha = plain_numbers(pixels[..., -1:]) if bitmap.has_alpha else None
    colors = pixels[..., :-1] if bitmap.has_alpha else pixels
    plain = plain_numbers(colors)
    linear = plain if pixels.dtype.kind == "f" else linear_from_srgb(plain)
    linear = np.repeat(linear, 3, axis=2) if linear.shape[2] == 1 else linear
    return linear if alpha is None else np.concatenate([linear, alpha], axis=2)


def plain_numbers(pixels: npt.NDArray[Any]) -> Array:
    """Whole numbers as shares of the largest."""
    return pixels / (1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max))


def vector(values: npt.ArrayLike) -> Vector:
    """Three numbers as a colour."""
    r, g, b = np.asarray(values, np.float64).tolist()
    return r, g, b
