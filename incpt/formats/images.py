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
from incpt.core.checks import path_of, require
from incpt.core.errors import InputError, one_line
from incpt.core.files import check_readable, write_atomically, write_bytes
from incpt.core.layout import ENVIRONMENT_MAX_SIZE
from incpt.formats import registry
from incpt.formats.registry import OPENEXR, FileKind
from incpt.picture.tone_mapping import tone_map_covered
from incpt.scene.image import Image

Float32Image = npt.NDArray[np.float32]
RINGING = 0.01
"""How far below zero, as a fraction of the mean, a pixel may lie to count as an artefact of compression."""

_quiet_lock = threading.Lock()
_images: weakref.WeakValueDictionary[tuple[str, int, int], Image] = weakref.WeakValueDictionary()


def write_png(
    path: str | os.PathLike[str], image: npt.ArrayLike, exposure: float = 0.0, curve: str = "agx"
) -> None:
    """Writes a (H, W, 3) picture of linear radiance as 8-bit sRGB, atomically; see `tone_map`. One with the
    shape (H, W, 4) has coverage in its last channel, by which radiance is multiplied already.

    Raises OutputError where the file cannot be written, InputError for an array that is no picture.
    """
    path = path_of("path", path)
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
    file cannot be written, InputError for layers that do not fit together.
    """
    path = path_of("path", path)
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
    """Reads an OpenEXR environment image: channels R, G, B (also of one layer, "name.R"), or Y alone.

    The same file, unchanged, gives the same Image as long as that is in use. Raises InputError: a file
    that is missing, damaged, too large or no OpenEXR, other channels, radiance that is negative or not
    finite.
    """
    path = path_of("path", path)
    status = check_readable(path)
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size)
    image = _images.get(key)
    if image is None:
        # What has no suffix of an image may be one all the same; its content is checked.
        row = registry.format_of(path, FileKind.IMAGE) or OPENEXR
        image = _images[key] = row.read(path)
    return image


def read_exr(path: Path) -> Image:
    """The image of an OpenEXR file, see `load_image`. Raises InputError that does not name the file."""
    return Image(_without_ringing(_pixels(path)), source=os.path.abspath(path))


def _without_ringing(pixels: Float32Image) -> Float32Image:
    """Lossy codecs (DWAB, most HDRIs) leave slightly negative pixels beside bright ones: those become 0."""
    negative = pixels < 0
    if negative.any() and pixels.min() >= -RINGING * pixels.mean(dtype=np.float64):
        return np.where(negative, np.float32(0), pixels)
    return pixels


def _pixels(path: Path) -> Float32Image:
    """(H, W, 3) linear radiance of an OpenEXR file. Raises InputError."""
    import OpenEXR

    try:
        with muted():
            header = OpenEXR.File(str(path), header_only=True).header()
            _check_size(header)
            pixels = {
                name: channel.pixels
                for name, channel in OpenEXR.File(str(path), separate_channels=True).channels().items()
            }
    except InputError:
        raise
    except Exception:  # The library raises RuntimeError, ValueError, TypeError … for damaged files.
        raise InputError("is no OpenEXR image, or a damaged one; save it again as OpenEXR") from None
    if pixels and all(isinstance(p, np.ndarray) and p.ndim == 2 for p in pixels.values()):
        for names in _colour_names(set(pixels)):
            planes = [pixels[name] for name in names]
            if len({plane.shape for plane in planes}) == 1:
                with np.errstate(invalid="ignore", over="ignore"):
                    return np.stack(planes, axis=-1).astype(np.float32)
    listed = ", ".join(sorted(pixels)[:12]) or "none"
    raise InputError(f"has no channels R, G, B or Y of full size, but {listed}; save it as RGB")


def _check_size(header: Mapping[str, Any]) -> None:
    """Before the pixels are read: a damaged header may ask for any amount of memory."""
    low, high = header["dataWindow"]
    width, height = (int(high[axis]) - int(low[axis]) + 1 for axis in (0, 1))
    if not (0 < width <= ENVIRONMENT_MAX_SIZE and 0 < height <= ENVIRONMENT_MAX_SIZE):
        raise InputError(
            f"is {width} x {height} pixels; an environment image has 1 to {ENVIRONMENT_MAX_SIZE} a side"
        )


def _colour_names(names: set[str]) -> Iterator[tuple[str, str, str]]:
    """Channel names of red, green and blue, the plain ones first, then those of the first layer."""
    layers = sorted(name[:-1] for name in names if name[-1:] == "R")
    for prefix in ["", *layers]:
        if {prefix + c for c in "RGB"} <= names:
            yield prefix + "R", prefix + "G", prefix + "B"
    # With RY and BY the file is luminance and subsampled chroma, of which Y alone would lose the colour.
    if "Y" in names and not {"RY", "BY"} & names:
        yield "Y", "Y", "Y"


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
