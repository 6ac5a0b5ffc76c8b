"""The values of properties, each written as an element of its own: <float>, <rgb>, <transform> ..."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats.mitsuba.node import Color
from incpt.formats.mitsuba.transforms import number, numbers, vector, words
from incpt.picture.color import linear_from_srgb
from incpt.picture.spectra import Spectrum, blackbody_color
from incpt.scene.checks import LARGEST

Attributes = Mapping[str, str]
FileNamed = Callable[[str], Path]
"""Finds a file that the scene names. Raises InputError."""


def value_of(tag: str, attributes: Attributes, file_named: FileNamed) -> object:
    """The value of such an element. Raises InputError."""
    text = attributes.get("value", "")
    if tag == "float":
        return number(text)
    if tag == "integer":
        return _whole(text)
    if tag == "boolean":
        if text.lower() not in ("true", "false"):
            raise InputError(f"{text[:40]!r} is neither true nor false")
        return text.lower() == "true"
    if tag == "string":
        return text
    if tag in ("vector", "point"):
        return vector(attributes, 0.0)
    if tag == "spectrum":
        return _spectrum(attributes, file_named)
    return _COLORS[tag](attributes)


def _whole(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        raise InputError(f"{text[:40]!r} is not a whole number") from None
    if abs(value) > LARGEST:
        raise InputError(f"{value:.3g} is out of range; use up to {LARGEST:g}")
    return value


def _rgb(attributes: Attributes) -> Color:
    text = attributes.get("value", "")
    found = _hexadecimal(text) or numbers(text, 1, 3)
    return _color(found * 3 if len(found) == 1 else found)


def _srgb(attributes: Attributes) -> Color:
    text = attributes.get("value", "")
    found = _hexadecimal(text) or numbers(text, 1, 3)
    return _color(linear_from_srgb(found * 3 if len(found) == 1 else found).tolist())


def _hexadecimal(text: str) -> list[float]:
    """From "#rrggbb", else nothing."""
    digits = text.strip()
    if not digits.startswith("#"):
        return []
    try:
        whole = int(digits[1:], 16)
    except ValueError:
        whole = -1
    if len(digits) != 7 or whole < 0:
        raise InputError(f"{text[:40]!r} is no colour; write three numbers")
    return [(whole >> shift & 255) / 255 for shift in (16, 8, 0)]


def _color(values: list[float]) -> Color:
    red, green, blue = values
    return Color((red, green, blue))


def _blackbody(attributes: Attributes) -> Color:
    """Of Mitsuba 0.x: "5000K"."""
    kelvin = number(attributes.get("temperature", "").strip().rstrip("kK"))
    if not 100 <= kelvin <= 1e6:
        raise InputError(f"temperature: {kelvin:g} is out of range; use 100 to 1e+06 kelvin")
    scale = number(attributes.get("scale", "1"))
    return _color((scale * blackbody_color(kelvin)).tolist())


_COLORS: dict[str, Callable[[Attributes], Color]] = {"rgb": _rgb, "srgb": _srgb, "blackbody": _blackbody}
VALUE_TAGS = ("float", "integer", "boolean", "string", "vector", "point", "spectrum", *_COLORS)
"""Elements that are values."""


def _spectrum(attributes: Attributes, file_named: FileNamed) -> Spectrum:
    if ("value" in attributes) == ("filename" in attributes):
        raise InputError("<spectrum> needs either a value or a filename")
    if "filename" in attributes:
        return spectrum_of_file(file_named(attributes["filename"]))
    found = words(attributes["value"])
    if len(found) == 1 and ":" not in found[0]:
        return Spectrum((), (number(found[0]),))
    pairs = [word.split(":") for word in found]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError("a spectrum is one number, or pairs of a wavelength and a value, such as 400:0.5")
    return spectrum([(number(first), number(second)) for first, second in pairs])


def spectrum_of_file(path: Path) -> Spectrum:
    """Of a file with a wavelength and a value in each line. Raises InputError."""
    pairs = []
    for line in read_bytes(path).decode("utf-8", "replace").splitlines():
        found = words(line.partition("#")[0])
        if found:
            if len(found) < 2:
                raise InputError(f"{path.name}: has a line without a wavelength and a value")
            pairs.append((number(found[0]), number(found[1])))
    return spectrum(pairs)


def spectrum(pairs: list[tuple[float, float]]) -> Spectrum:
    """Raises InputError."""
    if len(pairs) < 2:
        raise InputError("a spectrum over wavelengths has two of them or more")
    wavelengths, values = zip(*pairs, strict=True)
    if any(second <= first for first, second in pairwise(wavelengths)):
        raise InputError("the wavelengths of a spectrum do not ascend; sort them")
    return Spectrum(wavelengths, values)
