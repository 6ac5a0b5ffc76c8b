"""Pictures on disk: OpenEXR (linear radiance, any layers) and PNG (tone-mapped sRGB).

OpenEXR and Pillow are imported by the functions that read or write a file, because most programs that
import incpt do neither before they have rendered something.
"""

from __future__ import annotations

import hashlib
import io
import os
import threading
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import numbers
from incpt.core.checks import described, path_of, require
from incpt.core.errors import InputError, one_line
from incpt.core.files import check_readable, write_atomically, write_bytes
from incpt.core.layout import ENVIRONMENT_MAX_SIZE
from incpt.formats import import_report, registry
from incpt.formats.registry import OPENEXR, FileKind
from incpt.picture.color import linear_from_srgb
from incpt.picture.tone_mapping import tone_map_covered
from incpt.scene.image import Image

Float32Image = npt.NDArray[np.float32]
RINGING = 0.01
"""How far below zero, as a fraction of the mean, a pixel may lie to count as an artefact of compression."""

_quiet_lock = threading.Lock()
_images: weakref.WeakValueDictionary[tuple[str, int, int], Image] = weakref.WeakValueDictionary()
_remarks: weakref.WeakKeyDictionary[Image, tuple[import_report.Remark, ...]] = weakref.WeakKeyDictionary()
"""What was told of images when they were read."""


def write_png(
    path: str | os.PathLike[str], image: npt.ArrayLike, exposure: float = 0.0, curve: str = "agx"
) -> None:
    """Writes a (H, W, 3) picture of linear radiance as 8-bit sRGB, atomically; see `tone_map`. One with the
    shape (H, W, 4) has coverage in its last channel, by which radiance is multiplied already.

    Raises OutputError where the file cannot be written, InputError for an array that is no picture, and for
    a name that says another format.
    """
    path = _named(path, ".png")
    pixels = tone_map_covered(image, exposure, curve)
    if pixels.ndim != 3 or pixels.size == 0:
        raise InputError(f"image: has shape {pixels.shape}; a picture has shape (height, width, 3 or 4)")
    import PIL.Image

    encoded = io.BytesIO()
    PIL.Image.fromarray(pixels).save(encoded, "PNG")
    write_bytes(path, encoded.getvalue())


def write_exr(path: str | os.PathLike[str], layers: Mapping[str, npt.ArrayLike]) -> None:
    """Writes layers of one picture, atomically.

    A (H, W) array is one channel under its name ("depth.Z", "object_id"). A (H, W, n) array is n
    channels, named by the last letters of its name: "RGB" is R, G, B and "normal.XYZ" is normal.X,
    normal.Y, normal.Z. uint32 is kept, everything else becomes float32. Raises OutputError where the
    file cannot be written, InputError for layers that do not fit together, and for a name that says another
    format.
    """
    path = _named(path, ".exr")
    require("layers", layers, Mapping, 'a mapping of names to arrays, such as {"RGB": image}')
    channels: dict[str, npt.NDArray[Any]] = {}
    for name, values in layers.items():
        require("layers", name, str, "the name of a layer")
        kind = np.uint32 if getattr(values, "dtype", None) == np.uint32 else np.float32
        channels.update(_channels(name, numbers(f"layer {name!r}", values, kind)))
    shapes = {channel.shape for channel in channels.values()}
    if len(shapes) != 1 or 0 in next(iter(shapes)):
        raise InputError(f"layers: have sizes {sorted(shapes)}; a picture needs layers of one size")
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}

    def write(temporary: Path) -> None:
        try:
            with muted():
                OpenEXR.File(header, channels).write(str(temporary))
        except RuntimeError as error:
            raise OSError(one_line(error).replace(str(temporary), path.name)) from None

    write_atomically(path, write)


def _named(path: str | os.PathLike[str], suffix: str) -> Path:
    """The path of a file that is to be written. Raises InputError where it ends otherwise."""
    found = path_of("path", path)
    if found.suffix.lower() != suffix:
        raise InputError(f"path: {described(str(path))} does not end in {suffix}, the format that is written")
    return found


def _channels(name: str, values: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
    prefix, dot, letters = name.rpartition(".")
    if values.ndim == 2 and name:
        return {name: np.ascontiguousarray(values)}
    if values.ndim != 3 or len(letters) != values.shape[2] or len(set(letters)) != len(letters):
        raise InputError(
            f"layer {name!r}: has shape {values.shape}; use (H, W), or (H, W, 3) named like 'RGB'"
        )
    return {prefix + dot + c: np.ascontiguousarray(values[..., i]) for i, c in enumerate(letters)}


def load_image(path: str | os.PathLike[str]) -> Image:
    """Reads an environment image: OpenEXR (channels R, G, B, also of one layer, "name.R"; Y alone, or with
    chroma), Radiance (.hdr), or an image as displays show it (.png, .jpg ...).

    The same file, unchanged, gives the same Image as long as that is in use. What is changed on the way, such
    as primaries other than those of Rec. 709, is told, see `import_report`. Raises InputError: a file that is
    missing, damaged, too large or no image, other channels, radiance that is negative or not finite.
    """
    path = path_of("path", path)
    status = check_readable(path)
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size)
    image = _images.get(key)
    if image is None:
        # What has no suffix of an image may be one all the same; its content is checked.
        row = registry.format_of(path, FileKind.IMAGE) or OPENEXR
        with import_report.gathered() as told:
            image = _images[key] = row.read(path)
        _remarks[image] = told.report.remarks
    import_report.tell(*_remarks[image])
    return image


def read_exr(path: Path) -> Image:
    """The image of an OpenEXR file, see `load_image`. Raises InputError that does not name the file."""
    # It mutes the library by this module.
    from incpt.formats import exr

    return Image(_without_ringing(exr.read_colors(path)), source=os.path.abspath(path))


def read_other(path: Path) -> Image:
    """The image of a file that is no OpenEXR: Radiance as it is, others as displays show them. Raises
    InputError that does not name the file."""
    from incpt.formats import bitmaps

    pixels = bitmaps.read_pixels(path)
    largest = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}.get(pixels.dtype)
    colors = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    if largest is not None:
        colors = linear_from_srgb(np.arange(largest + 1) / largest).astype(np.float32)[colors]
        import_report.changed("the environment is an image for displays: it has no bright lights")
    _check_size(colors.shape[1], colors.shape[0])
    return Image(np.asarray(colors, np.float32), source=os.path.abspath(path))


def _without_ringing(pixels: Float32Image) -> Float32Image:
    """Lossy codecs (DWAB, most HDRIs) leave slightly negative pixels beside bright ones: those become 0."""
    negative = pixels < 0
    if negative.any() and pixels.min() >= -RINGING * pixels.mean(dtype=np.float64):
        return np.where(negative, np.float32(0), pixels)
    return pixels


def _check_size(width: int, height: int) -> None:
    if not (0 < width <= ENVIRONMENT_MAX_SIZE and 0 < height <= ENVIRONMENT_MAX_SIZE):
        raise InputError(
            f"is {width} x {height} pixels; an environment image has 1 to {ENVIRONMENT_MAX_SIZE} a side"
        )


@contextmanager
def muted() -> Iterator[None]:
    """Mutes the process's stdout and stderr: OpenEXR prints each error there before it raises it, and some
    on Python's stdout, which would keep it and print it later."""
    import OpenEXR

    with _quiet_lock, redirect_stdout(io.StringIO()):
        saved = []
        with suppress(OSError):  # A process may have been started without them.
            saved = [(number, os.dup(number)) for number in (1, 2)]
        null = os.open(os.devnull, os.O_WRONLY)
        try:
            for number, _ in saved:
                os.dup2(null, number)
            yield
        finally:
            # OpenEXR's threads may still be at work, and print, after one of them has raised an error. Taking
            # them away waits for their end.
            threads = OpenEXR.global_thread_count()
            OpenEXR.set_global_thread_count(0)
            OpenEXR.set_global_thread_count(threads)
            for number, copy in saved:
                os.dup2(copy, number)
                os.close(copy)
            os.close(null)


def digest(pixels: Float32Image) -> str:
    """A short text that differs for different pixels."""
    return hashlib.sha256(f"{pixels.shape}".encode() + pixels.tobytes()).hexdigest()[:12]
