"""Colours and numbers of a scene's materials and lights: constants, spectra, and textures by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from incpt.core.affine import Vector
from incpt.core.errors import InputError, in_place
from incpt.formats import bitmaps, import_report
from incpt.formats.appearance.colored import (
    LUMINANCE,
    WHITE,
    Amount,
    Array,
    Colored,
    NumberImage,
    as_reflectance,
    linear_pixels,
    plain_numbers,
    vector,
)
from incpt.formats.pbrt.document import Document
from incpt.formats.pbrt.parameters import Parameter, Statement
from incpt.picture.color import linear_from_srgb
from incpt.picture.spectra import Spectrum, blackbody_color, emitted_color, reflected_color
from incpt.scene.texture import Bitmap, Texture

_GREY = 0.5
"""What stands for a texture that cannot be read."""
_NUMBER_TYPES = ("float", "integer")
_ILLUMINANTS = {"stdillum-A": 2856.0}
"""Standard illuminants that are black bodies, by their temperatures in kelvin; D65 is white."""
_DEEPEST = 16
"""Textures that name each other."""


class Textures:
    """Reads what parameters say, each texture once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._colors: dict[int, Colored] = {}
        self._amounts: dict[int, Amount] = {}
        self._depth = 0

    def reflectance(self, statement: Statement, name: str, default: float) -> Colored:
        """A colour from 0 to 1. Raises InputError."""
        return as_reflectance(self._color(statement, name, default), f"{name} of {statement}")

    def light(self, statement: Statement, name: str) -> Vector:
        """The colour of a light: a spectrum with a luminance of 1, or red, green and blue as they are. Raises
        InputError."""
        with in_place(name):
            found = statement.parameter(name)
            if found is None:
                return WHITE
            if found.type == "rgb":
                return self._rgb(found)
            if found.type == "blackbody":
                return _bright(blackbody_color(self._kelvin(found)))
            if found.type == "spectrum" and len(found.texts) == 1 and found.texts[0].startswith("stdillum-"):
                return self._illuminant(statement, found.texts[0])
            if found.type == "spectrum":
                return _bright(emitted_color(*self._pairs(found)))
            raise InputError(f"is of type {found.type}; use rgb, spectrum or blackbody")

    def _illuminant(self, statement: Statement, name: str) -> Vector:
        if name in _ILLUMINANTS:
            return _bright(blackbody_color(_ILLUMINANTS[name]))
        if name != "stdillum-D65":
            import_report.changed(f"{name!r} of {statement}: is taken for white")
        return WHITE

    def spectral(self, statement: Statement, name: str) -> Spectrum | Vector | None:
        """A spectrum over wavelengths as it is, anything else as a colour; None where there is none. Raises
        InputError."""
        found = statement.parameters.get(name)
        if found is None:
            return None
        with in_place(name):
            if found.type == "spectrum":
                statement.ignore(name)
                wavelengths, values = self._pairs(found)
                return Spectrum(tuple(wavelengths.tolist()), tuple(values.tolist()))
        return self._color(statement, name, 1.0).rgb

    def amount(self, statement: Statement, name: str, default: float) -> Amount:
        """A number from 0 on. Raises InputError."""
        with in_place(name):
            found = statement.parameter(name)
            if found is None:
                return Amount(default)
            if found.type == "texture":
                return self._texture_amount(self._named(found))
            if found.type not in _NUMBER_TYPES or len(found.numbers) != 1:
                raise InputError("is not one number, nor a texture")
            return Amount(max(float(found.numbers[0]), 0.0))

    def share(self, statement: Statement, name: str, default: float) -> float:
        """A number from 0 to 1 for which a material has no image: of an image the mean. Raises
        InputError."""
        found = self.amount(statement, name, default)
        if found.image is not None:
            import_report.changed(f"{name} of {statement}: the mean of its image, {found.mean:.4g}")
        return min(found.mean, 1.0)

    def image(self, name: str, place: str) -> Bitmap | None:
        """An image file; None, which is told, where it cannot be read. Raises InputError."""
        try:
            return bitmaps.load_bitmap(self._document.file(name))
        except InputError as error:
            import_report.left_out(f"image of {place}: {error}")
            return None

    def _color(self, statement: Statement, name: str, default: float) -> Colored:
        with in_place(name):
            found = statement.parameter(name)
            if found is None:
                return Colored((default,) * 3)
            if found.type == "texture":
                return self._texture_color(self._named(found))
            if found.type == "rgb":
                return Colored(self._rgb(found))
            if found.type == "spectrum":
                return Colored(vector(reflected_color(*self._pairs(found))))
            if found.type in _NUMBER_TYPES and len(found.numbers) == 1:
                return Colored((float(found.numbers[0]),) * 3)
            raise InputError(f"is of type {found.type}; use rgb, spectrum or texture")

    def _rgb(self, found: Parameter) -> Vector:
        if len(found.numbers) != 3:
            raise InputError(f"holds {len(found.numbers)} numbers; write red, green and blue")
        return vector(found.numbers)

    def _kelvin(self, found: Parameter) -> float:
        if len(found.numbers) != 1 or not 100 <= found.numbers[0] <= 1e6:
            raise InputError("is not one temperature from 100 to 1e+06 kelvin")
        return float(found.numbers[0])

    def _pairs(self, found: Parameter) -> tuple[Array, Array]:
        """Wavelengths and values of a spectrum: in the file, or in one beside it."""
        numbers = found.numbers
        if len(found.texts) == 1:
            path = self._document.file(found.texts[0])
            if not path.is_file():
                raise InputError(f"the spectrum {found.texts[0][:40]!r} is not known, nor a file")
            words = [
                word
                for line in path.read_bytes().decode("utf-8", "replace").splitlines()
                for word in line.partition("#")[0].split()
            ]
            try:
                numbers = np.array(words, np.float64)
            except ValueError:
                raise InputError(f"{found.texts[0][:40]!r} holds something else than numbers") from None
        if len(numbers) < 2 or len(numbers) % 2 or not np.isfinite(numbers).all():
            raise InputError("a spectrum is pairs of a wavelength and a value")
        wavelengths, values = numbers[0::2], numbers[1::2]
        if (np.diff(wavelengths) <= 0).any():
            raise InputError("the wavelengths of a spectrum do not ascend; sort them")
        return wavelengths, values

    # ------------------------------------------------------------------------------------------ textures

    def _named(self, found: Parameter) -> Statement:
        name = found.texts[0] if len(found.texts) == 1 else ""
        if name not in self._document.textures:
            raise InputError(f"the texture {name[:40]!r} is not made; correct the name")
        return self._document.textures[name]

    def _within(self, texture: Statement, name: str, default: float) -> Colored:
        """A colour or a texture that a texture is made of. Raises InputError where they name each other."""
        self._depth += 1
        if self._depth > _DEEPEST:
            raise InputError("textures name each other in a circle, or too deep")
        try:
            return self._color(texture, name, default)
        finally:
            self._depth -= 1

    def _texture_color(self, texture: Statement) -> Colored:
        if id(texture) not in self._colors:
            with in_place(texture.place):
                self._colors[id(texture)] = self._new_color(texture)
        return self._colors[id(texture)]

    def _new_color(self, texture: Statement) -> Colored:
        kind = texture.kind
        if kind == "imagemap":
            return self._imagemap(texture)
        if kind == "constant":
            return self._within(texture, "value", 1.0)
        if kind == "scale":
            return self._scaled(texture)
        if kind == "mix":
            first, second = (self._mean(texture, *one) for one in (("tex1", 0.0), ("tex2", 1.0)))
            share = min(float(LUMINANCE @ self._mean(texture, "amount", 0.5)), 1.0)
            return Colored(vector((1 - share) * first + share * second))
        if kind == "checkerboard" and texture.whole("dimension", 2, 2, 3) == 2:
            first, second = (self._mean(texture, *one) for one in (("tex1", 1.0), ("tex2", 0.0)))
            return Colored(WHITE, _checkerboard(texture, np.array([[first, second], [second, first]])))
        texture.ignore(*texture.parameters)
        import_report.left_out(f"{texture}: textures of that type are not read; grey stands for it")
        return Colored((_GREY,) * 3)

    def _mean(self, texture: Statement, name: str, default: float) -> Array:
        """(3,) of what a texture is made of."""
        found = self._within(texture, name, default)
        if found.texture is None:
            return np.array(found.rgb)
        import_report.changed(f"{name} of {texture}: the mean of its image")
        mean = linear_pixels(found.texture.bitmap)[..., :3].mean(axis=(0, 1))
        return np.asarray(mean * np.array(found.rgb))

    def _scaled(self, texture: Statement) -> Colored:
        found = self._within(texture, "tex", 1.0)
        scale = self._mean(texture, "scale", 1.0)
        return found.mapped(lambda colors: colors * scale)

    def _imagemap(self, texture: Statement) -> Colored:
        bitmap = self.image(texture.text("filename"), str(texture))
        placed = None if bitmap is None else _placed(texture, bitmap)
        decode = _decoding(texture)
        scale, inverts = texture.number("scale", 1.0, 0.0), texture.flag("invert", False)
        if bitmap is None or placed is None:
            return Colored((_GREY,) * 3)
        if decode is not linear_from_srgb and bitmap.pixels.dtype.kind != "f":
            placed = replace(placed, bitmap=Bitmap(decode(plain_numbers(bitmap.pixels))))
        found = Colored(WHITE, placed)
        if inverts:
            found = found.mapped(lambda colors: np.clip(1 - colors, 0, None))
        return found if scale == 1 else found.mapped(lambda colors: colors * scale)

    def _texture_amount(self, texture: Statement) -> Amount:
        if id(texture) not in self._amounts:
            found = self._texture_color(texture)
            factor = float(LUMINANCE @ found.rgb)
            if found.texture is None:
                self._amounts[id(texture)] = Amount(max(factor, 0.0))
            else:
                numbers = linear_pixels(found.texture.bitmap)[..., :3] @ LUMINANCE * factor
                image = NumberImage(np.maximum(numbers, 0.0), found.texture)
                self._amounts[id(texture)] = Amount(1.0, image)
        return self._amounts[id(texture)]


def _bright(color: Array) -> Vector:
    """With a luminance of 1."""
    luminance = float(LUMINANCE @ color)
    return vector(color / luminance) if luminance > 0 else (0.0, 0.0, 0.0)


def _decoding(texture: Statement) -> Callable[[Array], Array]:
    """From whole numbers, as shares of the largest, to linear ones. Raises InputError."""
    default = "sRGB" if texture.text("filename").lower().endswith(".png") else "linear"
    words = texture.text("encoding", default).split()
    if words == ["sRGB"]:
        return linear_from_srgb
    if words == ["linear"]:
        return lambda values: values
    try:
        gamma = float(words[1]) if len(words) == 2 and words[0] == "gamma" else math.nan
    except ValueError:
        gamma = math.nan
    if not 0.1 <= gamma <= 10:
        raise InputError('encoding: is not known; write sRGB, linear, or a gamma such as "gamma 2.2"')
    return lambda values: values**gamma


def _placed(texture: Statement, bitmap: Bitmap) -> Texture:
    """An image where the mapping of a texture puts it; (0, 0) is at its bottom left there."""
    su, sv, du, dv = _mapping(texture)
    wrap = texture.text("wrap", "repeat")
    if wrap not in ("repeat", "clamp"):
        import_report.changed(f"wrap of {texture}: {wrap!r} becomes 'clamp'")
        wrap = "clamp"
    nearest = texture.text("filter", "bilinear") == "point"
    texture.ignore("maxanisotropy")
    return Texture(
        bitmap,
        wrap=(wrap, wrap),
        filter="nearest" if nearest else "bilinear",
        offset=(du, 1 - sv - dv),
        scale=(su, sv),
    )


def _checkerboard(texture: Statement, pixels: Array) -> Texture:
    """Two fields by two, as four pixels, which is exactly the same."""
    su, sv, du, dv = _mapping(texture)
    return Texture(Bitmap(pixels), filter="nearest", offset=(du / 2, (sv + dv) / 2), scale=(su / 2, -sv / 2))


def _mapping(texture: Statement) -> tuple[float, float, float, float]:
    """Scales and offsets of u and v. Raises InputError."""
    if texture.text("mapping", "uv") != "uv":
        import_report.changed(f"mapping of {texture}: is by u and v")
        texture.ignore("v1", "v2")
    u, v = texture.number("uscale", 1.0), texture.number("vscale", 1.0)
    return u, v, texture.number("udelta", 0.0), texture.number("vdelta", 0.0)
