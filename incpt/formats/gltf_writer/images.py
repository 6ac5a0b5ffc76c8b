"""Images and textures of glTF files: PNG and JPEG as they are, all others as PNG."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats import bitmaps, import_report
from incpt.formats.gltf_writer.container import Container
from incpt.picture.color import srgb_from_linear
from incpt.scene.texture import Bitmap, BitmapSource, Texture

_WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
_FILTERS = {"nearest": (9728, 9728), "bilinear": (9729, 9987)}
"""Those for images that are seen large and small."""
_KINDS = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg"}
_BEGINNINGS = {"image/png": b"\x89PNG\r\n\x1a\n", "image/jpeg": b"\xff\xd8\xff"}


class Images:
    """Writes each image, sampler and texture once."""

    def __init__(self, container: Container) -> None:
        self._container = container
        self._images: dict[tuple[Bitmap, bool], int] = {}
        self._samplers: dict[tuple[Any, ...], int] = {}
        self._textures: dict[tuple[int, int], int] = {}

    def texture(self, texture: Texture, is_color: bool) -> dict[str, Any]:
        """What a material names a texture by. `is_color`: whether whole numbers in it are sRGB."""
        source = self._image(texture.bitmap, is_color)
        sampler = self._sampler(texture)
        key = source, sampler
        if key not in self._textures:
            self._textures[key] = self._container.add("textures", {"source": source, "sampler": sampler})
        table: dict[str, Any] = {"index": self._textures[key]}
        if texture.uv_set:
            table["texCoord"] = texture.uv_set
        transform: dict[str, Any] = {}
        if texture.offset != (0.0, 0.0):
            transform["offset"] = list(texture.offset)
        if texture.rotation:
            transform["rotation"] = math.radians(texture.rotation)
        if texture.scale != (1.0, 1.0):
            transform["scale"] = list(texture.scale)
        if transform:
            table["extensions"] = self._container.extension("KHR_texture_transform", transform)
        return table

    def _sampler(self, texture: Texture) -> int:
        near, far = _FILTERS[texture.filter]
        along_u, along_v = (_WRAPS[wrap] for wrap in texture.wrap)
        key = near, far, along_u, along_v
        if key not in self._samplers:
            table = {"magFilter": near, "minFilter": far, "wrapS": along_u, "wrapT": along_v}
            self._samplers[key] = self._container.add("samplers", table)
        return self._samplers[key]

    def _image(self, bitmap: Bitmap, is_color: bool) -> int:
        key = bitmap, is_color and bitmap.pixels.dtype == np.float32
        if key not in self._images:
            content, kind = _stored(bitmap) or (_as_png(bitmap, is_color), "image/png")
            table = {"bufferView": self._container.view(content), "mimeType": kind}
            self._images[key] = self._container.add("images", table)
        return self._images[key]


def _stored(bitmap: Bitmap) -> tuple[bytes, str] | None:
    """The content and the type of the file that a bitmap came from, where that still holds it and glTF can
    have it."""
    source = bitmap.source
    if source.file is None:
        return None
    try:
        if source.index is None:
            content, suffix = read_bytes(Path(source.file)), Path(source.file).suffix.lower()
        else:
            content, suffix = bitmaps.image_within(Path(source.file), source.index)
        kind = _KINDS.get(suffix)
        # Names of files say what they like.
        if kind is None or not content.startswith(_BEGINNINGS[kind]):
            return None
        is_same = np.array_equal(bitmaps.pixels_of(content, suffix), bitmap.pixels)
    except InputError:
        return None
    return (content, kind) if is_same else None


def _as_png(bitmap: Bitmap, is_color: bool) -> bytes:
    """The content of a PNG file. Floats become 16 bits from 0 to 1, in sRGB where they are colours."""
    if bitmap.pixels.dtype == np.float32:
        pixels = np.clip(bitmap.pixels, 0, 1).astype(np.float64)
        if (pixels != bitmap.pixels).any():
            import_report.changed("an image of floats: what is below 0 or above 1 is cut off")
        colors = pixels[..., : bitmap.channels - 1] if bitmap.has_alpha else pixels
        if is_color:
            colors[...] = srgb_from_linear(colors)
        bitmap = Bitmap(np.rint(pixels * 65_535).astype(np.uint16))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.png"
        bitmaps.write_bitmap(path, replace(bitmap, source=BitmapSource()))
        return path.read_bytes()
