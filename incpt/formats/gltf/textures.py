"""Textures of glTF files, and the images in and beside them."""

from __future__ import annotations

import math
from pathlib import Path

from incpt.core.errors import InputError, in_place
from incpt.formats import basis, bitmaps, import_report
from incpt.formats.gltf.accessors import Accessors
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table
from incpt.scene.texture import UV_SETS, Bitmap, Texture

_WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp", "image/ktx2": basis.SUFFIX}
_BASIS = "KHR_texture_basisu"


class Textures:
    """The textures of a file, each image read once."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document, self._accessors = document, accessors
        self._bitmaps: dict[int, Bitmap | InputError] = {}

    def texture(self, table: Table) -> Texture:
        """What a material names by a table with `index`. Raises InputError."""
        entry = self._document.item("textures", table.whole("index", 0, 1 << 31))
        sampler = Table({}, "")
        number = entry.index("sampler")
        if number is not None:
            sampler = self._document.item("samplers", number)
        transform = table.extension("KHR_texture_transform")
        uv_set = (transform if "texCoord" in transform else table).whole("texCoord", 0, 1 << 31, 0)
        if uv_set >= UV_SETS:
            raise InputError(f"texCoord: {uv_set} is beyond the {UV_SETS} sets that are read")
        along_u, along_v = (_WRAPS.get(sampler.whole(key, 0, 1 << 31, 0), "repeat") for key in _WRAP_KEYS)
        return Texture(
            self._bitmap(_source(entry)),
            uv_set=uv_set,
            wrap=(along_u, along_v),
            filter="nearest" if sampler.whole("magFilter", 0, 1 << 31, 0) == _NEAREST else "bilinear",
            offset=transform.numbers("offset", (0.0, 0.0)),  # type: ignore[arg-type]
            rotation=math.degrees(transform.number("rotation", 0.0)),
            scale=transform.numbers("scale", (1.0, 1.0)),  # type: ignore[arg-type]
        )

    def _bitmap(self, number: int) -> Bitmap:
        if number not in self._bitmaps:
            try:
                with in_place(f"image {number}"):
                    self._bitmaps[number] = self._read(number)
            except InputError as error:
                self._bitmaps[number] = error
        found = self._bitmaps[number]
        if isinstance(found, InputError):
            raise InputError(str(found))
        return found

    def _read(self, number: int) -> Bitmap:
        """An image of the file, or beside it. Raises InputError."""
        uri = self._document.item("images", number).text("uri", "data:")
        if uri.startswith("data:"):
            return bitmaps.embedded(self._document.path, number, lambda: self.image(number))
        return bitmaps.load_bitmap(self._document.file(uri))

    def image(self, number: int) -> tuple[bytes, str]:
        """The content of an image that the file holds, and the suffix of such files. Raises InputError."""
        table = self._document.item("images", number)
        if "bufferView" in table:
            content, kind = self._accessors.view(table.whole("bufferView", 0, 1 << 31))[0], ""
        else:
            read, kind = self._document.uri(table.text("uri"))
            content = memoryview(read)
        return bytes(content), _SUFFIXES.get(kind or table.text("mimeType"), ".png")


_WRAP_KEYS = ("wrapS", "wrapT")


def _source(texture: Table) -> int:
    """The number of the image of a texture: of several that of the best that can be read. Raises
    InputError."""
    choices = [texture.extension("EXT_texture_webp").index("source"), texture.index("source")]
    choices.append(texture.extension(_BASIS).index("source"))
    found = next((number for number in choices if number is not None), None)
    if found is None:
        raise InputError(f"{texture.place}: names no image that can be read")
    return found


def embedded_image(path: Path, number: int) -> tuple[bytes, str]:
    """The content of an image of a glTF file, by number, and the suffix of such files. Raises InputError."""
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise InputError("has no images by number; leave `image` out")
    document = Document(path)
    count = len(document.root.entries("images"))
    if number >= count:
        raise InputError(f"image: {number} is not in the file, which has {count}")
    with in_place(f"image {number}"), import_report.in_file(str(path)):
        return Textures(document, Accessors(document)).image(number)
