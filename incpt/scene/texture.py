"""Images on surfaces: the pixels, and how a material reads them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import NoneType
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import frozen
from incpt.core.checks import described, one_of, pair, require, require_bool, whole
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, set_number

BITMAP_MAX_SIZE = 16_384
"""Largest width or height of a bitmap, pixels."""
WRAPS = ("repeat", "mirror", "clamp")
"""What is beyond the edges of a bitmap: it again, its mirror image, or the pixels at its edge."""
FILTERS = ("bilinear", "nearest")
"""Between the centres of pixels: interpolated, or the nearest one."""
UV_SETS = 2
"""Sets of texture coordinates that a mesh may have."""


@dataclass(frozen=True)
class BitmapSource:
    """Where a bitmap came from, which is what a scene file stores: a file, and which of its images (glTF), by
    number. Both None: made in Python."""

    file: str | None = None
    index: int | None = None

    def __post_init__(self) -> None:
        require("file", self.file, (str, NoneType), "the path of a file, as a text")
        if self.index is not None:
            object.__setattr__(self, "index", whole("index", self.index, 0))


@dataclass(frozen=True, eq=False)
class Bitmap:
    """An image for textures: `pixels` (H, W, C), the top row first, of 1 channel (grey), 2 (grey, alpha),
    3 (red, green, blue) or 4 (with alpha), not premultiplied.

    uint8 and uint16 stand for 0 to 1, as files have them: what they mean, colours in sRGB or plain numbers,
    is said by what a material uses them for. float32 (float16 too) is linear always. Compared by identity: a
    bitmap is on a device once, however many textures use it. `is_placeholder` tells that it stands for what
    `source` names and could not be read.
    """

    pixels: npt.NDArray[Any]
    source: BitmapSource = BitmapSource()
    is_placeholder: bool = False

    def __post_init__(self) -> None:
        require("source", self.source, BitmapSource, "a BitmapSource")
        require_bool("is_placeholder", self.is_placeholder)
        try:
            pixels = np.asarray(self.pixels)
        except ValueError:  # rows of unequal length
            pixels = np.empty(0, np.object_)
        if pixels.dtype == np.float16 or pixels.dtype == np.float64:
            pixels = pixels.astype(np.float32)
        if pixels.dtype not in (np.uint8, np.uint16, np.float32):
            raise InputError(f"pixels: {described(self.pixels)} is not an array of uint8, uint16 or float32")
        if pixels.ndim == 2:
            pixels = pixels[:, :, None]
        if pixels.ndim != 3 or pixels.shape[2] not in (1, 2, 3, 4) or pixels.size == 0:
            raise InputError(
                f"pixels: have shape {pixels.shape}; a bitmap has shape (height, width, channels), of 1 to 4 "
                "channels"
            )
        if max(pixels.shape[:2]) > BITMAP_MAX_SIZE:
            raise InputError(
                f"pixels: {pixels.shape[1]} x {pixels.shape[0]} are more than {BITMAP_MAX_SIZE} a side; "
                "scale the image down"
            )
        if pixels.dtype == np.float32 and not np.isfinite(pixels).all():
            raise InputError("pixels: hold a number that is not finite; repair the image")
        object.__setattr__(self, "pixels", frozen(pixels))

    @property
    def width(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[0])

    def device_bytes(self, limit: int = 0) -> int:
        """What its pixels take on a device where images have at most `limit` pixels a side (0: any number):
        whole numbers of 8 bits as they are, others as half floats."""
        width, height = fitted_size(self.width, self.height, whole("limit", limit, 0))
        return width * height * self.channels * (1 if self.pixels.dtype == np.uint8 else 2)

    @property
    def channels(self) -> int:
        """1 to 4."""
        return int(self.pixels.shape[2])

    @property
    def has_alpha(self) -> bool:
        """Whether the last channel is alpha."""
        return self.channels in (2, 4)


def fitted_size(width: int, height: int, limit: int) -> tuple[int, int]:
    """The size of an image that is halved until it has at most `limit` pixels a side; 0: as it is."""
    while limit and max(width, height) > limit:
        width, height = -(-width // 2), -(-height // 2)
    return width, height


@dataclass(frozen=True)
class Texture:
    """A bitmap as a material reads it at texture coordinates (u, v), of which (0, 0) is the top left corner
    of the image and (1, 1) the bottom right one, as in glTF.

    bitmap    the image
    uv_set    which texture coordinates of the mesh: 0 or 1
    wrap      beyond the edges, along u and along v: each one of WRAPS; a single text is for both
    filter    one of FILTERS
    offset, rotation, scale   what is read lies at offset + rotation (scale (u, v)): KHR_texture_transform.
              `rotation` is in degrees, counter-clockwise as seen on the image
    """

    bitmap: Bitmap
    uv_set: int = 0
    wrap: tuple[str, str] = ("repeat", "repeat")
    filter: str = "bilinear"
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        require("bitmap", self.bitmap, Bitmap, "a Bitmap; load_bitmap() reads one")
        object.__setattr__(self, "uv_set", whole("uv_set", self.uv_set, 0, UV_SETS - 1))
        wrap = (self.wrap, self.wrap) if isinstance(self.wrap, str) else self.wrap
        if not isinstance(wrap, (tuple, list)) or len(wrap) != 2:
            raise InputError(f"wrap: {described(self.wrap)} is not one or two of {', '.join(WRAPS)}")
        for one in wrap:
            one_of("wrap", one, WRAPS)
        object.__setattr__(self, "wrap", tuple(wrap))
        one_of("filter", self.filter, FILTERS)
        for name in ("offset", "scale"):
            values = pair(name, getattr(self, name), "a list of two numbers")
            if not all(math.isfinite(v) and abs(v) <= LARGEST for v in values):
                raise InputError(f"{name}: {described(list(values))} is out of range; use up to {LARGEST:g}")
            object.__setattr__(self, name, values)
        set_number(self, "rotation", -LARGEST, LARGEST)

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """(2, 3): the place in the image of texture coordinates (u, v, 1)."""
        angle = math.radians(self.rotation)
        sine, cosine = math.sin(angle), math.cos(angle)
        turned = np.array([[cosine, sine], [-sine, cosine]]) * self.scale
        return np.column_stack([turned, self.offset])
