"""Images of UsdUVTexture, as colours and numbers, where UsdPrimvarReader and UsdTransform2d place them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Ar

from incpt.core.errors import InputError
from incpt.formats import bitmaps, import_report
from incpt.formats.appearance.colored import (
    WHITE,
    Amount,
    Colored,
    NumberImage,
    linear_pixels,
    plain_numbers,
    vector,
)
from incpt.formats.usd.archive import image_in, names_in
from incpt.formats.usd.shading import Inputs, Source
from incpt.formats.usd.stage import OpenStage
from incpt.picture.color import linear_from_srgb
from incpt.scene.checks import LARGEST
from incpt.scene.texture import UV_SETS, Bitmap, Texture

Array = npt.NDArray[np.float64]
TEXTURE, TRANSFORM = "UsdUVTexture", "UsdTransform2d"
_READER = "UsdPrimvarReader_"
_WRAPS = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "useMetadata": "repeat"}
_CHANNELS = "rgba"
_ONES, _ZEROS = (1.0,) * 4, (0.0,) * 4


class Bitmaps:
    """The images of a stage, each read once."""

    def __init__(self, opened: OpenStage) -> None:
        self._opened = opened
        self.moment = opened.moment

    def bitmap(self, asset: Any) -> Bitmap:
        """That of an asset that an input names. Raises InputError."""
        if not hasattr(asset, "resolvedPath"):
            raise InputError("names no file")
        if "<UDIM>" in str(asset.path):
            raise InputError(f"{str(asset.path)[:60]!r}: images of many tiles (UDIM) are not read")
        resolved = self._opened.file(asset)
        outer, inner = Ar.SplitPackageRelativePathOuter(resolved)
        if not inner:
            return bitmaps.load_bitmap(resolved)
        path = Path(outer)
        names = names_in(path)
        if inner not in names:
            raise InputError(f"{inner[:80]!r}: is in a package within a package; unpack it")
        number = names.index(inner)
        return bitmaps.embedded(path, number, lambda: image_in(path, number))


@dataclass(frozen=True, eq=False)
class UvImage:
    """What a UsdUVTexture gives: pixels times `scale` plus `bias`, in the linear colours of sRGB images."""

    texture: Texture
    is_srgb: bool
    scale: tuple[float, ...]
    bias: tuple[float, ...]

    def colored(self) -> Colored:
        """Its colours. The bitmap stays as it is, where that says the same."""
        bitmap = self.texture.bitmap
        is_whole = bitmap.pixels.dtype.kind == "u"
        if any(self.bias[:3]) or min(self.scale[:3]) < 0 or (is_whole != self.is_srgb):
            linear = self._linear()[..., :3] * self.scale[:3] + self.bias[:3]
            return Colored(WHITE, replace(self.texture, bitmap=Bitmap(np.clip(linear, 0, LARGEST))))
        return Colored(vector(self.scale[:3]), self.texture)

    def plane(self, output: str) -> NumberImage:
        """Its numbers of one channel, "r" for example."""
        channel = _CHANNELS.find(output) if len(output) == 1 else 0
        linear = self._linear()
        numbers = linear[..., channel] if channel < linear.shape[2] else np.ones(linear.shape[:2])
        return NumberImage(numbers * self.scale[channel] + self.bias[channel], self.texture)

    def is_plain(self, *channels: str) -> bool:
        """Whether these channels are numbers of the file itself."""
        numbers = [_CHANNELS.index(one) for one in channels]
        unscaled = all(self.scale[i] == 1 and self.bias[i] == 0 for i in numbers)
        return unscaled and not self.is_srgb and self.texture.bitmap.channels >= 3

    def _linear(self) -> Array:
        """(H, W, 3 or 4)"""
        bitmap = self.texture.bitmap
        if self.is_srgb and bitmap.pixels.dtype.kind == "u":
            return linear_pixels(bitmap)
        numbers = plain_numbers(bitmap.pixels).astype(np.float64)
        if bitmap.channels <= 2:
            numbers = np.concatenate([np.repeat(numbers[..., :1], 3, axis=2), numbers[..., 1:]], axis=2)
        if self.is_srgb:
            numbers[..., :3] = linear_from_srgb(numbers[..., :3])
        return numbers


class UvTextures:
    """The textures of one material. `uv_names` are the primvars that place them, in the order of the sets of
    texture coordinates that they become."""

    def __init__(self, images: Bitmaps, label: str) -> None:
        self._images, self._label = images, label
        self.uv_names: list[str] = []
        self._known: dict[str, UvImage] = {}

    def image(self, source: Source) -> UvImage:
        """That of a UsdUVTexture. Raises InputError."""
        path = str(source.shader.GetPath())
        if path not in self._known:
            self._known[path] = self._read(Inputs(source.shader, self._images.moment))
        return self._known[path]

    def _read(self, inputs: Inputs) -> UvImage:
        bitmap = self._images.bitmap(inputs.value("file", None))
        texture = self._placed(
            inputs, Texture(bitmap, wrap=(self._wrap(inputs, "S"), self._wrap(inputs, "T")))
        )
        space = inputs.text("sourceColorSpace", "auto")
        # Without a word of it, whole numbers of colours are in sRGB.
        is_srgb = (
            bitmap.pixels.dtype.kind == "u" and bitmap.channels >= 3 if space == "auto" else space == "sRGB"
        )
        return UvImage(texture, is_srgb, inputs.numbers("scale", _ONES), inputs.numbers("bias", _ZEROS))

    def _wrap(self, inputs: Inputs, along: str) -> str:
        wrap = inputs.text(f"wrap{along}", "useMetadata")
        if wrap == "black":
            import_report.changed(f"a texture of material {self._label!r}: is not black beyond its edges")
        return _WRAPS.get(wrap, "clamp")

    def _placed(self, inputs: Inputs, texture: Texture) -> Texture:
        source = inputs.source("st")
        values: dict[str, Any] = {}
        if source is not None and source.kind == TRANSFORM:
            inner = Inputs(source.shader, self._images.moment)
            values, source = _transformed(inner), inner.source("in")
        name = "st"
        if source is not None and source.kind.startswith(_READER):
            name = Inputs(source.shader, self._images.moment).text("varname", "st")
        elif source is not None:
            import_report.left_out(
                f"a {source.kind or 'shader'} in material {self._label!r}: places textures in no known way"
            )
        return replace(texture, uv_set=self._set_of(name), **values)

    def _set_of(self, name: str) -> int:
        if name not in self.uv_names:
            if len(self.uv_names) >= UV_SETS:
                raise InputError(f"{name[:40]!r} is beyond the {UV_SETS} sets of texture coordinates")
            self.uv_names.append(name)
        return self.uv_names.index(name)


def _transformed(inputs: Inputs) -> dict[str, Any]:
    """The placement by a UsdTransform2d, which scales, turns and moves coordinates whose v goes up, as that
    of a Texture, whose v goes down."""
    angle = inputs.number("rotation", 0.0)
    scale = inputs.numbers("scale", (1.0, 1.0))
    move = inputs.numbers("translation", (0.0, 0.0))
    cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    # With v' = 1 - v before and after: what (0, 1) becomes, and what is missing to (0, 1).
    offset = move[0] - sine * scale[1], 1 - move[1] - cosine * scale[1]
    return {"offset": offset, "rotation": angle, "scale": scale}


def amount(image: UvImage, output: str) -> Amount:
    """Numbers of one channel."""
    return Amount(1.0, image.plane(output))
