"""What the JSON of a glTF file refers to: accessors, textures, and the images in it."""

from __future__ import annotations

import base64
import binascii
import math
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.core.files import read_bytes
from incpt.formats import bitmaps
from incpt.scene.texture import UV_SETS, Bitmap, Texture

_COMPONENTS = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp"}


class GltfData:
    """A file and its JSON. What is read stays in memory as long as this does."""

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self.path, self.header = path, header
        self._buffers: dict[int, bytes] = {}
        self._bitmaps: dict[int, Bitmap] = {}

    def values(self, number: int) -> npt.NDArray[np.float64]:
        """(count, components) what an accessor has; whole numbers that stand for 0 to 1 or -1 to 1 as these.

        Raises InputError where the file does not have it, or stores it sparsely.
        """
        accessor = self.header["accessors"][number]
        dtype, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _COUNTS[accessor["type"]]
        count = int(accessor["count"])
        if "sparse" in accessor or "bufferView" not in accessor:
            raise InputError(f"accessor {number}: is stored sparsely, which cannot be read; export it plain")
        view = self.header["bufferViews"][accessor["bufferView"]]
        content = self._buffer(view["buffer"])
        first = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
        stride = int(view.get("byteStride", 0)) or dtype.itemsize * width
        if first < 0 or stride < 0 or first + (count - 1) * stride + dtype.itemsize * width > len(content):
            raise InputError(f"accessor {number}: reaches beyond the end of its buffer; the file is damaged")
        raw = np.ndarray((count, width), dtype, content, first, (stride, dtype.itemsize))
        values = raw.astype(np.float64)
        if dtype.kind in "iu" and accessor.get("normalized"):
            values = np.maximum(values / (2.0 ** (8 * dtype.itemsize - (dtype.kind == "i")) - 1), -1.0)
        return values

    def texture(self, table: dict[str, Any]) -> Texture:
        """The texture that a material names by a table with `index`. Raises InputError, KeyError and kin."""
        entry = _at(self.header["textures"], table["index"])
        sources = [entry.get("extensions", {}).get("EXT_texture_webp", {}).get("source"), entry.get("source")]
        image = next(source for source in sources if source is not None)
        sampler = _at(self.header["samplers"], entry["sampler"]) if "sampler" in entry else {}
        transform = table.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set = int(transform.get("texCoord", table.get("texCoord", 0)))
        along_u, along_v = (_WRAPS.get(sampler.get(key, 0), "repeat") for key in ("wrapS", "wrapT"))
        return Texture(
            self.bitmap(image),
            uv_set=min(uv_set, UV_SETS - 1),
            wrap=(along_u, along_v),
            filter="nearest" if sampler.get("magFilter") == _NEAREST else "bilinear",
            offset=tuple(transform.get("offset", (0.0, 0.0))),
            rotation=math.degrees(transform.get("rotation", 0.0)),
            scale=tuple(transform.get("scale", (1.0, 1.0))),
        )

    def bitmap(self, number: int) -> Bitmap:
        """An image of the file, or beside it. Raises InputError."""
        if number not in self._bitmaps:
            with in_place(f"image {number}"):
                file = self._image_file(number)
                if file is not None:
                    bitmap = bitmaps.load_bitmap(file)
                else:
                    bitmap = bitmaps.embedded(self.path, number, lambda: self.image(number))
                self._bitmaps[number] = bitmap
        return self._bitmaps[number]

    def image(self, number: int) -> tuple[bytes, str]:
        """The content of an image that the file holds, and the suffix of such files. Raises InputError."""
        image = _at(self.header["images"], number)
        if "bufferView" in image:
            view = self.header["bufferViews"][image["bufferView"]]
            first = int(view.get("byteOffset", 0))
            content = self._buffer(view["buffer"])[first : first + int(view["byteLength"])]
            return content, _SUFFIXES.get(str(image.get("mimeType")), ".png")
        head, content = _data_uri(image["uri"])
        return content, next((suffix for kind, suffix in _SUFFIXES.items() if kind in head), ".png")

    def _image_file(self, number: int) -> Path | None:
        """The file of an image that stands beside the glTF file."""
        uri = _at(self.header["images"], number).get("uri", "data:")
        return None if uri.startswith("data:") else self.path.parent / urllib.parse.unquote(uri)

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            uri = self.header["buffers"][number].get("uri")
            if uri is None:
                self._buffers[number] = _binary_chunk(read_bytes(self.path))
            elif uri.startswith("data:"):
                self._buffers[number] = _data_uri(uri)[1]
            else:
                self._buffers[number] = read_bytes(self.path.parent / urllib.parse.unquote(uri))
        return self._buffers[number]


def _at(values: list[dict[str, Any]], index: Any) -> dict[str, Any]:
    """Raises IndexError also for what is no place in a list to a file, but one to Python."""
    if isinstance(index, bool) or not isinstance(index, int) or index < 0:
        raise IndexError(f"{index!r} is no index")
    return values[index]


def _binary_chunk(content: bytes) -> bytes:
    """The second chunk of a .glb file."""
    first = 20 + int.from_bytes(content[12:16], "little")
    length = int.from_bytes(content[first : first + 4], "little")
    return content[first + 8 : first + 8 + length]


def _data_uri(uri: str) -> tuple[str, bytes]:
    """What a data URI says of its content, and the content. Raises InputError."""
    head, _, text = uri.partition(",")
    try:
        return head, base64.b64decode(text) if head.endswith(";base64") else urllib.parse.unquote_to_bytes(
            text
        )
    except (binascii.Error, ValueError):
        raise InputError("has a data URI that is no base64; the file is damaged") from None
