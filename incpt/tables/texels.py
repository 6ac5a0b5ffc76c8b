"""The pixels of bitmaps as kernels read them, see cl/base/texture.cl.

Bytes stay bytes, also those of colours in sRGB, which kernels look up. What has more than eight bits becomes
half floats, and is linear.
"""

from __future__ import annotations

from functools import cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from incpt.core.layout import TextureFlag
from incpt.picture.color import linear_from_srgb, srgb_from_linear
from incpt.scene.texture import Bitmap, fitted_size

LARGEST_HALF = 65504.0
_ROWS_AT_ONCE = 256
"""Rows that are halved together: a large image as floats would take several times its memory."""
_FITTED: WeakKeyDictionary[Bitmap, dict[tuple[bool, int], Bitmap]] = WeakKeyDictionary()
"""Smaller versions of bitmaps, as colours or as plain numbers, by their limits."""


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


def fitted(bitmap: Bitmap, is_color: bool, limit: int) -> Bitmap:
    """The bitmap, halved until it has at most `limit` pixels a side (0: as it is); the same one again as long
    as the bitmap lives."""
    if fitted_size(bitmap.width, bitmap.height, limit) == (bitmap.width, bitmap.height):
        return bitmap
    known = _FITTED.setdefault(bitmap, {})
    if (is_color, limit) not in known:
        smaller = bitmap
        while max(smaller.width, smaller.height) > limit:
            smaller = _halved(smaller, is_color)
        known[is_color, limit] = smaller
    return known[is_color, limit]


def _halved(bitmap: Bitmap, is_color: bool) -> Bitmap:
    """Half as wide and half as high: means over four pixels, of what they stand for. Colours count as much as
    they cover, so that what is transparent brings none in."""
    height = -(-bitmap.height // 2)
    rows = [_halved_rows(bitmap, is_color, slice(first, first + _ROWS_AT_ONCE))
            for first in range(0, height, _ROWS_AT_ONCE)]  # fmt: skip
    return Bitmap(np.concatenate(rows))


def _halved_rows(bitmap: Bitmap, is_color: bool, rows: slice) -> npt.NDArray[Any]:
    dtype = bitmap.pixels.dtype
    strip = bitmap.pixels[2 * rows.start : 2 * rows.stop]
    strip = np.pad(strip, [(0, len(strip) % 2), (0, strip.shape[1] % 2), (0, 0)], mode="edge")
    values = _linear(Bitmap(strip), is_color).astype(np.float32)
    height, width, channels = values.shape
    fours = values.reshape(height // 2, 2, width // 2, 2, channels)
    means: npt.NDArray[np.float32] = fours.mean(axis=(1, 3))
    if bitmap.has_alpha:
        covered = fours[..., -1:]
        colors = (fours[..., :-1] * covered).sum(axis=(1, 3)) / np.maximum(covered.sum(axis=(1, 3)), 1e-12)
        means[..., :-1] = np.where(means[..., -1:] > 0, colors, means[..., :-1])
    if dtype == np.float32:
        return means
    if is_color:
        count = channels - bitmap.has_alpha
        means[..., :count] = srgb_from_linear(means[..., :count])
    return np.rint(means * np.iinfo(dtype).max).astype(dtype)


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
