"""The textures of a scene on a device: bitmaps in a pool that all scenes share, and how materials read them.

Every bitmap is uploaded once, however many textures and scenes use it, and stays as long as one of them does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from weakref import WeakValueDictionary

import numpy as np
import pyopencl as cl

from incpt.core import layout
from incpt.core.errors import DeviceError
from incpt.core.layout import TextureFlag, TextureSlot
from incpt.device.device import Device
from incpt.scene.material import Material, texture_of
from incpt.scene.texture import Bitmap, BitmapSource, Texture
from incpt.tables import albedo, texels
from incpt.tables.range_buffer import Range, RangeBuffer

_MOST_WORDS = layout.NO_INDEX
_COLORS = (
    TextureSlot.BASE_COLOR, TextureSlot.EMISSION, TextureSlot.SPECULAR_COLOR, TextureSlot.SHEEN_COLOR,
    TextureSlot.DIFFUSE_TRANSMISSION_COLOR,
)  # fmt: skip
"""Slots that read colours, which are in sRGB where pixels are whole numbers."""
_WHITE = Bitmap(np.full((1, 1, 4), 255, np.uint8), BitmapSource())


class TexturePool:
    """The pixels of bitmaps on a device, and the tables that textured materials need whatever scene they are
    in; see `of` for the one that its sessions share."""

    def __init__(self, device: Device) -> None:
        self._words = RangeBuffer(device, "words of textures", np.uint32, _MOST_WORDS)
        self._held: WeakValueDictionary[tuple[int, bool], _PooledBitmap] = WeakValueDictionary()
        self.buffers = {
            "byte_values": device.upload(texels.byte_values()),
            "albedos": device.upload(albedo.rows()),
        }

    @staticmethod
    def of(device: Device) -> TexturePool:
        """The pool that all sessions of a device share. It goes when the last of its users goes."""
        pool = _POOLS.get(device)
        if pool is None:
            pool = _POOLS[device] = TexturePool(device)
        return pool

    @property
    def packings(self) -> int:
        """How often bitmaps have moved to other places so far."""
        return self._words.packings

    @property
    def texels(self) -> cl.Buffer:
        """The buffer of all pixels. It may be another one after the next `hold`."""
        return self._words.buffer

    def hold(self, wanted: Iterable[tuple[Bitmap, bool]]) -> dict[tuple[Bitmap, bool], _PooledBitmap]:
        """Handles of bitmaps, as colours or as plain numbers; those that are not on the device are uploaded.

        Raises DeviceError where there is no room for them.
        """
        self._words.shrink()
        found: dict[tuple[Bitmap, bool], _PooledBitmap] = {}
        for bitmap, is_color in wanted:
            # Bytes are the same for both.
            form = is_color and bitmap.pixels.dtype == np.uint16
            pooled = self._held.get((id(bitmap), form))
            if pooled is None:
                (words,) = self._words.add([texels.texel_words(bitmap, is_color)])
                pooled = self._held[id(bitmap), form] = _PooledBitmap(bitmap, words)
            found[bitmap, is_color] = pooled
        return found


class _PooledBitmap:
    """A bitmap on the device, which stays there as long as somebody holds this."""

    def __init__(self, bitmap: Bitmap, words: Range) -> None:
        self.bitmap, self.words = bitmap, words


class TextureTables:
    """The textures of a scene's materials.

    numbers    the row of each texture, as colours or as plain numbers
    slots      bits of the slots that some material reads textures for
    byte_count of the bitmaps on the device
    """

    def __init__(
        self, device: Device, pool: TexturePool, materials: Iterable[Material], limit: int = 0
    ) -> None:
        self.pool, self._limit = pool, limit
        self._device = device
        self.numbers: dict[tuple[Texture, bool], int] = {}
        self.slots = 0
        white = Texture(_WHITE)
        wanted = [(white, False)]
        for material in materials:
            for slot in TextureSlot:
                texture = texture_of(material, slot)
                if texture is not None:
                    self.slots |= 1 << slot
                    wanted.append((texture, slot in _COLORS))
        for key in wanted:
            self.numbers.setdefault(key, len(self.numbers))
        self._bitmaps = pool.hold(
            (self._fitted(texture, is_color), is_color) for texture, is_color in self.numbers
        )
        self._buffer = self._uploaded()

    def has(self, slot: TextureSlot) -> bool:
        """Whether some material has a texture in that slot."""
        return bool(self.slots >> slot & 1)

    @property
    def byte_count(self) -> int:
        """Bytes of the bitmaps on the device."""
        return sum(4 * pooled.words.count for pooled in set(self._bitmaps.values()))

    @property
    def buffer(self) -> cl.Buffer:
        """Rows of layout.TEXTURE that refer to places in the pool as they are now."""
        if self._packings != self.pool.packings:
            self._buffer = self._uploaded()
        return self._buffer

    def numbers_of(self, material: Material) -> list[int]:
        """The rows that a material reads, slot by slot; 0 is white."""
        textures = ((texture_of(material, slot), slot in _COLORS) for slot in TextureSlot)
        return [0 if texture is None else self.numbers[texture, is_color] for texture, is_color in textures]

    def emission_number(self, material: Material) -> int:
        """The row that its emission is multiplied with."""
        return self.numbers_of(material)[TextureSlot.EMISSION]

    def _fitted(self, texture: Texture, is_color: bool) -> Bitmap:
        return texels.fitted(texture.bitmap, is_color, self._limit)

    def _uploaded(self) -> cl.Buffer:
        self._packings = self.pool.packings
        rows = np.zeros(len(self.numbers), layout.TEXTURE)
        for row, (texture, is_color) in zip(rows, self.numbers, strict=True):
            _describe(row, texture, is_color, self._bitmaps[self._fitted(texture, is_color), is_color])
        return self._device.upload(rows)


def _describe(row: np.void, texture: Texture, is_color: bool, pooled: _PooledBitmap) -> None:
    bitmap = pooled.bitmap
    flags = texels.texture_flags(bitmap, is_color)
    if texture.filter == "nearest":
        flags |= TextureFlag.NEAREST
    for axis, how in zip("UV", texture.wrap, strict=True):
        if how != "repeat":
            flags |= TextureFlag[f"{how.upper()}_{axis}"]
    row["first_word"], row["width"], row["height"] = pooled.words.first, bitmap.width, bitmap.height
    row["channels"], row["flags"], row["uv_set"] = bitmap.channels, flags, texture.uv_set
    row["matrix"] = texture.matrix.ravel()


def texture_tables(device: Device, materials: Mapping[str, Material], limit: int = 0) -> TextureTables:
    """Those of these materials, with at most `limit` pixels a side (0: as they are). Raises DeviceError where
    the device has no room for their bitmaps."""
    try:
        return TextureTables(device, TexturePool.of(device), materials.values(), limit)
    except DeviceError as error:
        raise DeviceError(f"textures: {error}; or halve large ones by texture_limit in [render]") from None


_POOLS: WeakValueDictionary[Device, TexturePool] = WeakValueDictionary()
