"""OpenEXR files of every kind as colours: parts and layers, luminance and chroma, windows, primaries.

What has no single colour for each pixel is refused. OpenEXR is imported by the functions that read a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.layout import ENVIRONMENT_MAX_SIZE
from incpt.formats import import_report
from incpt.formats.images import muted
from incpt.picture.color import REC_709, rec709_from_rgb, xyz_from_rgb

Float32Image = npt.NDArray[np.float32]

_SAME = 1e-3
"""Chromaticities that differ by less are the same."""
_ENVMAP_CUBE = 1


def read_colors(path: Path) -> Float32Image:
    """(H, W, 3) linear red, green and blue of Rec. 709 in the display window of the first part that has
    colours, black where the file has no pixels. Conversions are told. Raises InputError."""
    import OpenEXR

    try:
        with muted():
            headers = [part.header for part in OpenEXR.File(str(path), header_only=True).parts]
        for header in headers:
            _check_kind(header)
        with muted():
            parts = OpenEXR.File(str(path), separate_channels=True).parts
            channels = [{name: one.pixels for name, one in part.channels.items()} for part in parts]
        if len(channels) != len(headers):
            raise RuntimeError("the library leaves out parts that it cannot read")
    except InputError:
        raise
    except Exception:  # The library raises RuntimeError, ValueError, TypeError … for damaged files.
        raise InputError("is no OpenEXR image, or a damaged one; save it again as OpenEXR") from None
    for header, planes in zip(headers, channels, strict=True):
        colors = _colors(planes, header)
        if colors is not None:
            return _windowed(_in_rec709(colors, header), header)
    names = sorted({name for planes in channels for name in planes})
    listed = ", ".join(names[:12]) or "none"
    raise InputError(f"has no channels R, G, B or Y of full size, but {listed}; save it as RGB")


def _check_kind(header: Mapping[str, Any]) -> None:
    """Before the pixels are read: a damaged header may ask for any amount of memory. Raises InputError."""
    import OpenEXR

    if header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise InputError("is a deep image, whose pixels have several colours; flatten it")
    if int(header.get("envmap", 0)) == _ENVMAP_CUBE:
        raise InputError("is a cube map; save it as latitude and longitude")
    for window in ("dataWindow", "displayWindow"):
        width, height = _size(header[window])
        if not (0 < width <= ENVIRONMENT_MAX_SIZE and 0 < height <= ENVIRONMENT_MAX_SIZE):
            raise InputError(
                f"is {width} x {height} pixels; an environment image has 1 to {ENVIRONMENT_MAX_SIZE} a side"
            )


def _size(window: Any) -> tuple[int, int]:
    low, high = window
    return int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1


def _colors(planes: Mapping[str, Any], header: Mapping[str, Any]) -> Float32Image | None:
    """(H, W, 3) the colours of a part, by its primaries; None where it has none."""
    whole = {
        name: plane for name, plane in planes.items() if isinstance(plane, np.ndarray) and plane.ndim == 2
    }
    for names in _color_names(set(whole)):
        found = [whole[name] for name in names]
        if len({plane.shape for plane in found}) == 1:
            with np.errstate(invalid="ignore", over="ignore"):
                return np.stack(found, axis=-1).astype(np.float32)
    if {"Y", "RY", "BY"} <= whole.keys():
        return _from_chroma(whole["Y"], whole["RY"], whole["BY"], header)
    return None


def _color_names(names: set[str]) -> Iterator[tuple[str, str, str]]:
    """Channel names of red, green and blue, the plain ones first, then those of the first layer."""
    layers = sorted(name[:-1] for name in names if name[-1:] == "R")
    for prefix in ["", *layers]:
        if {prefix + c for c in "RGB"} <= names:
            yield prefix + "R", prefix + "G", prefix + "B"
    # With RY and BY the file is luminance and subsampled chroma, of which Y alone would lose the colour.
    if "Y" in names and not {"RY", "BY"} & names:
        yield "Y", "Y", "Y"


def _from_chroma(
    luminance: npt.NDArray[Any], red: npt.NDArray[Any], blue: npt.NDArray[Any], header: Mapping[str, Any]
) -> Float32Image:
    """(H, W, 3) of luminance Y, and of (R - Y) / Y and (B - Y) / Y for every second pixel, interpolated
    between these ("Technical Introduction to OpenEXR", luminance/chroma images)."""
    weights = xyz_from_rgb(_chromaticities(header))[1]
    y = luminance.astype(np.float64)
    r, b = ((_enlarged(chroma.astype(np.float64), y.shape) + 1) * y for chroma in (red, blue))
    g = (y - weights[0] * r - weights[2] * b) / weights[1]
    return np.asarray(np.maximum(np.stack([r, g, b], axis=-1), 0), np.float32)


def _enlarged(plane: npt.NDArray[np.float64], shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """A plane of every n-th pixel, interpolated to all of `shape`."""
    for axis in (0, 1):
        step = -(-shape[axis] // plane.shape[axis])
        at = np.minimum(np.arange(shape[axis]) / step, plane.shape[axis] - 1)
        first = at.astype(np.intp)
        second = np.minimum(first + 1, plane.shape[axis] - 1)
        part = np.expand_dims(at - first, 1 - axis)
        plane = np.take(plane, first, axis) * (1 - part) + np.take(plane, second, axis) * part
    return plane


def _in_rec709(colors: Float32Image, header: Mapping[str, Any]) -> Float32Image:
    """The same colours by the primaries of Rec. 709, as near as these can show them."""
    chromaticities = _chromaticities(header)
    if np.allclose(chromaticities, REC_709, atol=_SAME):
        return colors
    matrix = rec709_from_rgb(chromaticities)
    if not np.isfinite(matrix).all():
        import_report.left_out("chromaticities: no light has them; colours are taken for those of Rec. 709")
        return colors
    converted = colors.astype(np.float64) @ matrix.T
    outside = float((converted < -1e-6 * np.abs(converted).max(initial=0)).any(axis=-1).mean())
    beyond = f"; {100 * outside:.2g} % of the pixels are beyond them, and clipped" if outside else ""
    import_report.changed(f"colours: converted to the primaries and the white of Rec. 709{beyond}")
    return np.where(colors == 0, colors, np.maximum(converted, 0)).astype(np.float32)


def _chromaticities(header: Mapping[str, Any]) -> Sequence[float]:
    """Those of a header, or of Rec. 709. Raises InputError."""
    found: Any = header.get("chromaticities", REC_709)
    try:
        return [float(number) for number in found]
    except TypeError:  # The library knows the attribute by its name, and not by its damaged type.
        raise InputError("chromaticities: are no numbers; the file is damaged") from None


def _windowed(colors: Float32Image, header: Mapping[str, Any]) -> Float32Image:
    """The data window in the display window."""
    data, display = header["dataWindow"], header["displayWindow"]
    width, height = _size(display)
    left, top = (int(data[0][axis]) - int(display[0][axis]) for axis in (0, 1))
    if (left, top) == (0, 0) and colors.shape[:2] == (height, width):
        return colors
    result = np.zeros((height, width, 3), np.float32)
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + colors.shape[1], width), min(top + colors.shape[0], height)
    if x0 < x1 and y0 < y1:
        result[y0:y1, x0:x1] = colors[y0 - top : y1 - top, x0 - left : x1 - left]
    import_report.changed(
        "the image: has pixels in a part of its frame only, or beyond it; the rest is black"
    )
    return result
