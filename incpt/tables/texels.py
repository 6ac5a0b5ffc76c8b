"""The pixels of bitmaps as kernels read them, see cl/base/texture.cl.

Bytes stay bytes, also those of colours in sRGB, which kernels look up. What has more than eight bits becomes
half floats, and is linear.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.layout import TextureFlag
from incpt.picture.color import linear_from_srgb
from incpt.scene.texture import Bitmap

LARGEST_HALF = 65504.0


@cache
def byte_values() -> npt.NDArray[np.float32]:
    """(512,) what a byte stands for, and what one of a colour in sRGB does."""
    plain = np.arange(256) / 255
    return np.concatenate([plain, linear_from_srgb(plain)]).astype(np.float32)


def stored_as_half(bitmap: Bitmap) -> bool:
    """Whether its pixels become half floats."""
    return bitmap.pixels.dtype != np.uint8


def texture_flags(bitmap: Bitmap, is_color: bool) -> TextureFlag:
    """How its pixels are stored, and what they mean as colours, or as plain numbers."""
    flags = TextureFlag(0)
    if stored_as_half(bitmap):
        flags |= TextureFlag.HALF
    elif is_color:
        flags |= TextureFlag.SRGB
    if bitmap.channels < 3:
        flags |= TextureFlag.GREY
    if bitmap.has_alpha:
        flags |= TextureFlag.ALPHA
    return flags


def texel_words(bitmap: Bitmap, is_color: bool) -> npt.NDArray[np.uint32]:
    """Its pixels row by row as words, and one more, because a pixel is read from two words at once."""
    values: npt.NDArray[Any] = bitmap.pixels
    if values.dtype != np.uint8:
        values = np.clip(_linear(bitmap, is_color), -LARGEST_HALF, LARGEST_HALF).astype(np.float16)
    content = values.tobytes()
    return np.frombuffer(content + bytes(-len(content) % 4 + 4), np.uint32)


def linear_colors(bitmap: Bitmap) -> npt.NDArray[np.float32]:
    """(H, W, 3) linear red, green and blue."""
    values = _linear(bitmap, is_color=True)
    return np.repeat(values[..., :1], 3, axis=2) if bitmap.channels < 3 else values[..., :3]


def _linear(bitmap: Bitmap, is_color: bool) -> npt.NDArray[np.float32]:
    """(H, W, C) what the pixels stand for: alpha is no colour."""
    pixels = bitmap.pixels
    if pixels.dtype == np.float32:
        return pixels
    largest = np.iinfo(pixels.dtype).max
    if not is_color:
        return (pixels / np.float32(largest)).astype(np.float32)
    table = linear_from_srgb(np.arange(largest + 1) / largest).astype(np.float32)
    values: npt.NDArray[np.float32] = table[pixels]
    if bitmap.has_alpha:
        values[..., -1] = pixels[..., -1] / np.float32(largest)
    return values
