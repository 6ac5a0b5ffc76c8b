"""Images for textures on disk, read and written by OpenImageIO: PNG, JPEG, WebP, TIFF, TGA, HDR, EXR and
others.

It is imported by the functions that read or write a file, because most scenes have no textures.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.checks import path_of, whole
from incpt.core.errors import InputError, in_place, one_line
from incpt.core.files import check_readable, write_atomically
from incpt.formats import basis
from incpt.formats.images import muted
from incpt.formats.usd import archive
from incpt.scene.texture import BITMAP_MAX_SIZE, Bitmap, BitmapSource

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".tga", ".bmp", ".hdr", ".exr")
"""Of files that are offered as textures. Whatever else OpenImageIO knows is read too."""
_COLORS = ("R", "G", "B", "A")

_FileKey = tuple[str, int, int, int | None]
_bitmaps: weakref.WeakValueDictionary[_FileKey, Bitmap] = weakref.WeakValueDictionary()


def load_bitmap(path: str | os.PathLike[str], index: int | None = None) -> Bitmap:
    """Reads an image for textures: 8 and 16 bits as they are, what has more as floats. `index`: one of the
    images of a glTF file, or of the files of a .usdz archive, by number.

    The same file, unchanged, gives the same Bitmap as long as that is in use. Raises InputError, one line
    that names the file: it is missing, damaged, of an unknown type, or too large.
    """
    path = path_of("path", path)
    index = None if index is None else whole("index", index, 0, 65_535)
    check_readable(path)
    with in_place(str(path)):
        if index is None:
            return _known_or(path, None, lambda: read_pixels(path))
        number = index
        return embedded(path, number, lambda: image_within(path, number))


def image_within(path: Path, number: int) -> tuple[bytes, str]:
    """The content of an image within a file, by its number, and the suffix of such files. Raises
    InputError."""
    # They read images by this module.
    if path.suffix.lower() == archive.SUFFIX:
        return archive.image_in(path, number)
    from incpt.formats.gltf.textures import embedded_image

    return embedded_image(path, number)


def embedded(path: Path, index: int, content: Callable[[], tuple[bytes, str]]) -> Bitmap:
    """An image within a file, by number: the same Bitmap as long as that is in use and the file is unchanged.
    `content` gives the bytes of the image, and the suffix of such files. Raises InputError."""
    return _known_or(path, index, lambda: pixels_of(*content()))


def _known_or(path: Path, index: int | None, read: Callable[[], npt.NDArray[Any]]) -> Bitmap:
    status = os.stat(path)
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size, index)
    bitmap = _bitmaps.get(key)
    if bitmap is None:
        bitmap = _bitmaps[key] = Bitmap(read(), BitmapSource(os.path.abspath(path), index))
    return bitmap


def pixels_of(content: bytes, suffix: str) -> npt.NDArray[Any]:
    """(H, W, C) the pixels of a file with that content and suffix. Raises InputError."""
    # The library reads files only.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"image{suffix}"
        path.write_bytes(content)
        return read_pixels(path)


def read_pixels(path: Path) -> npt.NDArray[Any]:
    """(H, W, C) the pixels of a file as `load_bitmap` gives them. Raises InputError that does not name the
    file."""
    try:
        return _read_pixels(path)
    except UnicodeDecodeError:  # Also messages of the library quote what a damaged file has.
        raise InputError("is damaged (it holds bytes that are no text); save it again") from None


def _read_pixels(path: Path) -> npt.NDArray[Any]:
    import OpenImageIO as oiio  # noqa: N813 (its own documents call it so)

    config = oiio.ImageSpec()
    # As glTF has it: colours are not multiplied with alpha.
    config.attribute("oiio:UnassociatedAlpha", 1)
    if path.suffix.lower() in (".glb", ".gltf"):
        raise InputError("may hold several images; name one by its number: `image = 0`")
    if path.suffix.lower() == basis.SUFFIX:
        return basis.pixels_of_ktx2(path.read_bytes())
    with muted():
        file = oiio.ImageInput.open(str(path), config)
    if file is None:
        raise InputError(
            f"is no image that can be read ({_reason(oiio.geterror())}); save it as PNG or OpenEXR"
        )
    try:
        spec = file.spec()
        if max(spec.width, spec.height) > BITMAP_MAX_SIZE:
            raise InputError(
                f"has {spec.width} x {spec.height} pixels, more than {BITMAP_MAX_SIZE} a side; scale it down"
            )
        if spec.deep or spec.depth > 1:
            raise InputError("is a deep or a volume image, which is no texture; save a flat one")
        chosen = _channels(list(spec.channelnames))
        kind = _kind(spec, oiio)
        with muted():
            pixels = file.read_image(0, 0, 0, spec.nchannels, kind)
        if pixels is None:
            raise InputError(f"is damaged ({_reason(file.geterror())}); save it again")
    finally:
        file.close()
    return np.ascontiguousarray(np.asarray(pixels).reshape(spec.height, spec.width, -1)[..., chosen])


def _kind(spec: Any, oiio: Any) -> Any:
    """The type that pixels are read as."""
    base = spec.format.basetype
    if base in (oiio.UINT8, oiio.INT8):
        return oiio.UINT8
    return oiio.UINT16 if base in (oiio.UINT16, oiio.INT16) else oiio.FLOAT


def _channels(names: list[str]) -> list[int]:
    """Which channels of a file to take: red, green, blue and alpha by name, else luminance, else the
    first."""
    places = {name.upper(): i for i, name in reversed(list(enumerate(names)))}
    for wanted in (_COLORS, _COLORS[:3], ("Y", "A"), ("Y",)):
        if all(name in places for name in wanted):
            return [places[name] for name in wanted]
    return list(range(min(len(names), 3) if len(names) != 2 else 1))


def write_bitmap(path: Path, bitmap: Bitmap) -> None:
    """Writes a bitmap exactly, atomically: bytes and 16-bit numbers as .png, floats as .exr, which the
    suffix of `path` has to fit, see `suffix_of`. Raises OutputError."""
    import OpenImageIO as oiio  # noqa: N813 (its own documents call it so)

    pixels = bitmap.pixels
    kind = {"uint8": oiio.UINT8, "uint16": oiio.UINT16, "float32": oiio.FLOAT}[pixels.dtype.name]
    spec = oiio.ImageSpec(bitmap.width, bitmap.height, bitmap.channels, kind)
    spec.channelnames = {1: ("Y",), 2: ("Y", "A"), 3: _COLORS[:3], 4: _COLORS}[bitmap.channels]
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if bitmap.has_alpha:
        spec.alpha_channel = bitmap.channels - 1

    def write(temporary: Path) -> None:
        file = oiio.ImageOutput.create(str(temporary))
        is_written = file is not None and file.open(str(temporary), spec) and file.write_image(pixels)
        error = "" if file is None or is_written else file.geterror()
        if file is not None:
            file.close()
        if not is_written:
            raise OSError(one_line(error or oiio.geterror()))

    write_atomically(path, write)


def suffix_of(bitmap: Bitmap) -> str:
    """Of the file that holds a bitmap exactly."""
    return ".exr" if bitmap.pixels.dtype == np.float32 else ".png"


def digest(bitmap: Bitmap) -> str:
    """A short text that differs for different pixels."""
    pixels = bitmap.pixels
    return hashlib.sha256(f"{pixels.shape}{pixels.dtype}".encode() + pixels.tobytes()).hexdigest()[:12]


def _reason(message: str) -> str:
    return one_line(message)[:80].strip(" .:") or "unknown"
