"""Colours and numbers of a scene's materials and lights: constants, spectra, and images on surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from incpt.core.affine import Vector
from incpt.core.checks import one_of
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
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.node import Color, Node
from incpt.formats.mitsuba.transforms import number, numbers, words
from incpt.formats.mitsuba.values import spectrum, spectrum_of_file
from incpt.picture.spectra import Spectrum, blackbody_color, emitted_color, reflected_color
from incpt.scene.texture import FILTERS, WRAPS, Bitmap, Texture

VERTEX_COLOR = "vertex_color"
"""The attribute of a mesh that is read: what our meshes have at their corners."""
_PLACEHOLDER = 0.5
"""What stands for an image that cannot be read: the reflectance that Mitsuba takes where none is given."""
_SHEAR = 1e-4


class Textures:
    """Reads what properties say, each image once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._colors: dict[int, Colored] = {}
        self._amounts: dict[int, Amount] = {}

    def reflectance(self, node: Node, name: str, default: float) -> Colored:
        """A colour from 0 to 1. Raises InputError."""
        with in_place(name):
            value = node.value(name)
            found = Colored((default,) * 3) if value is None else self._colored(value, reflected_color)
            return as_reflectance(found, f"{name} of {node}")

    def emission(self, node: Node, name: str) -> Colored:
        """The colour of light; 1 where none is given. Raises InputError."""
        with in_place(name):
            value = node.value(name)
            found = Colored(WHITE) if value is None else self._colored(value, emitted_color)
            if min(found.rgb) < 0:
                import_report.changed(f"{name} of {node}: what is below 0 is 0")
            r, g, b = (max(c, 0.0) for c in found.rgb)
            return replace(found, rgb=(r, g, b))

    def amount(self, node: Node, name: str, default: float) -> Amount:
        """A number from 0 on. Raises InputError."""
        with in_place(name):
            value = node.value(name)
            if value is None:
                return Amount(default)
            if isinstance(value, Node) and value.tag == "texture":
                return self._image_amount(value)
            found = self._colored(value, reflected_color)
            return Amount(max(float(LUMINANCE @ found.rgb), 0.0))

    def share(self, node: Node, name: str, default: float) -> float:
        """A number from 0 to 1 for which a material has no image: of an image the mean. Raises
        InputError."""
        found = self.amount(node, name, default)
        if found.image is not None:
            import_report.changed(f"{name} of {node}: the mean of its image, {found.mean:.4g}")
        return min(found.mean, 1.0)

    def spectral(self, node: Node, name: str, default: float) -> Spectrum | Vector:
        """A spectrum over wavelengths as it is, anything else as a colour. Raises InputError."""
        value = node.value(name)
        with in_place(name):
            if isinstance(value, Node) and value.tag == "spectrum":
                value = self._spectrum(value)
            if isinstance(value, Spectrum) and value.wavelengths:
                return value
            return (default,) * 3 if value is None else self._colored(value, reflected_color).rgb

    def _colored(self, value: object, seen: Callable[[Any, Any], Array]) -> Colored:
        """`seen` says which colour a spectrum has."""
        if isinstance(value, Node):
            if value.tag == "texture":
                return self._texture(value)
            if value.tag != "spectrum":
                raise InputError(f"a <{value.tag}> is no colour")
            value = self._spectrum(value)
        if isinstance(value, Color):
            return Colored(value.rgb)
        if isinstance(value, Spectrum):
            if value.wavelengths:
                return Colored(vector(seen(value.wavelengths, value.values)))
            # The same at all wavelengths: white as a reflectance, as light a bit red.
            return Colored(vector(value.values[0] * seen((300.0, 900.0), (1.0, 1.0))))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError("is no colour; write <rgb> with three numbers")
        return Colored((float(value),) * 3)

    def _spectrum(self, node: Node) -> Color | Spectrum:
        """A spectrum that is an object of its own."""
        if node.kind == "blackbody":
            kelvin = node.number("temperature", 5000.0, 100.0, 1e6)
            node.ignore("wavelength_min", "wavelength_max")
            return Color(vector(node.number("scale", 1.0) * blackbody_color(kelvin)))
        if node.kind == "uniform":
            return Spectrum((), (node.number("value", 1.0),))
        if node.kind in ("d65", "srgb", "rgb"):
            scale = node.number("scale", 1.0)
            value = node.value("color" if node.has("color") else "value")
            color = WHITE if value is None else self._colored(value, reflected_color).rgb
            return Color(vector(scale * np.array(color)))
        if node.kind in ("regular", "irregular"):
            return self._measured(node)
        raise InputError(
            f"a spectrum of type {node.kind!r} is not known; write one of rgb, blackbody, regular"
        )

    def _measured(self, node: Node) -> Spectrum:
        """Of a list of values, at wavelengths as even as they come or as they are listed."""
        if node.has("filename"):
            return spectrum_of_file(self._document.file(node.text("filename")))
        value = node.value("value")
        if isinstance(value, Spectrum):
            return value
        values = [number(word) for word in words(node.text("values"))]
        if node.kind == "irregular":
            wavelengths = numbers(node.text("wavelengths"), len(values))
        else:
            low, high = node.number("wavelength_min", 360.0), node.number("wavelength_max", 830.0)
            wavelengths = np.linspace(low, high, len(values)).tolist()
        return spectrum(list(zip(wavelengths, values, strict=True)))

    def _texture(self, node: Node) -> Colored:
        """A texture as colours, made once."""
        if id(node) not in self._colors:
            with in_place(node.place):
                self._colors[id(node)] = self._new_texture(node)
        return self._colors[id(node)]

    def _new_texture(self, node: Node) -> Colored:
        if node.kind == "bitmap":
            found = self._bitmap(node)
            if found is None:
                return Colored((_PLACEHOLDER,) * 3)
            if _is_raw(node) and found.bitmap.pixels.dtype.kind != "f":
                found = replace(found, bitmap=Bitmap(plain_numbers(found.bitmap.pixels)))
            return Colored(WHITE, found)
        if node.kind == "checkerboard":
            first, second = (self._checker_color(node, *one) for one in (("color0", 0.4), ("color1", 0.2)))
            return Colored(WHITE, self._checkerboard(node, np.array([[first, second], [second, first]])))
        if node.kind == "mesh_attribute":
            return _mesh_attribute(node)
        import_report.left_out(f"{node}: textures of that type are not read; grey stands for it")
        node.ignore(*node.values, *node.objects)
        return Colored((_PLACEHOLDER,) * 3)

    def _checker_color(self, node: Node, name: str, default: float) -> Vector:
        found = self.reflectance(node, name, default)
        if found.texture is not None:
            import_report.changed(f"{name} of {node}: the mean of its image")
            return vector(linear_pixels(found.texture.bitmap)[..., :3].mean(axis=(0, 1)) * found.rgb)
        return found.rgb

    def _checkerboard(self, node: Node, pixels: Array) -> Texture:
        """Its four fields as four pixels, which is exactly the same."""
        return self._placed(node, Texture(Bitmap(pixels), filter="nearest"))

    def _bitmap(self, node: Node) -> Texture | None:
        """The image of a bitmap texture; None, which is told, where it cannot be read."""
        node.ignore("format", "accel", "raw")
        wrap, filtered = node.text("wrap_mode", "repeat"), node.text("filter_type", "bilinear")
        one_of("wrap_mode", wrap, WRAPS)
        one_of("filter_type", filtered, FILTERS)
        name = node.text("filename")
        try:
            bitmap = bitmaps.load_bitmap(self._document.file(name))
        except InputError as error:
            import_report.left_out(f"image of {node}: {error}")
            node.ignore("to_uv")
            return None
        return self._placed(node, Texture(bitmap, wrap=(wrap, wrap), filter=filtered))

    def _placed(self, node: Node, texture: Texture) -> Texture:
        """A texture under the transform of texture coordinates of its node."""
        matrix = node.matrix("to_uv")
        first, second = matrix[:2, 0], matrix[:2, 1]
        scale_u = float(np.hypot(*first))
        along = first / scale_u if scale_u > 0 else np.array([1.0, 0.0])
        across = np.array([-along[1], along[0]])
        if abs(float(second @ along)) > _SHEAR * max(float(np.hypot(*second)), 1e-9):
            import_report.changed(f"to_uv of {node}: the shear of texture coordinates is left out")
        angle = math.degrees(math.atan2(-along[1], along[0]))
        offset = (float(matrix[0, 3]), float(matrix[1, 3]))
        return replace(texture, offset=offset, rotation=angle, scale=(scale_u, float(second @ across)))

    def _image_amount(self, node: Node) -> Amount:
        """A texture as numbers, made once."""
        if id(node) not in self._amounts:
            with in_place(node.place):
                self._amounts[id(node)] = self._new_amount(node)
        return self._amounts[id(node)]

    def _new_amount(self, node: Node) -> Amount:
        if node.kind == "checkerboard":
            first, second = (
                float(LUMINANCE @ self._checker_color(node, *one))
                for one in (("color0", 0.4), ("color1", 0.2))
            )
            # Where Mitsuba reads numbers of it, its two colours have changed places ("checkerboard.cpp").
            values = np.array([[second, first], [first, second]])
            return Amount(1.0, NumberImage(values, self._checkerboard(node, values)))
        if node.kind != "bitmap":
            return Amount(float(LUMINANCE @ self._texture(node).rgb))
        found = self._bitmap(node)
        if found is None:
            return Amount(_PLACEHOLDER)
        pixels = found.bitmap.pixels
        linear = plain_numbers(pixels) if _is_raw(node) else linear_pixels(found.bitmap)
        has_color = linear.shape[2] >= 3
        values = linear[..., :3] @ LUMINANCE if has_color else linear[..., 0]
        return Amount(1.0, NumberImage(np.maximum(values, 0.0), found))


def _is_raw(node: Node) -> bool:
    return node.flag("raw", False)


def _mesh_attribute(node: Node) -> Colored:
    scale = min(max(node.number("scale", 1.0), 0.0), 1.0)
    name = node.text("name")
    if name != VERTEX_COLOR:
        import_report.left_out(
            f"attribute {name!r} of {node}: only {VERTEX_COLOR!r} is read; grey stands for it"
        )
        return Colored((_PLACEHOLDER,) * 3)
    return Colored((scale,) * 3, is_of_vertices=True)
