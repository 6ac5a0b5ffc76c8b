"""The values that materials are made of: colours, roughness, masks, and what is between two of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from incpt.core.affine import Vector
from incpt.formats import import_report
from incpt.formats.appearance.colored import Amount, Array, Colored, NumberImage, linear_pixels
from incpt.scene.material import Material
from incpt.scene.texture import Bitmap, Texture

Look = dict[str, Any]
"""Values of a Material by their names."""
MATTE: Look = {"base_color": (0.5, 0.5, 0.5), "specular": 0.0}
"""Of shapes without a BSDF."""


def tinted(color: Colored) -> Look:
    """A base colour, with its image where it has one."""
    look: Look = {"base_color": color.rgb}
    return look if color.texture is None else {**look, "base_color_texture": color.texture}


def roughened(alpha: Amount) -> Look:
    """Roughness, whose square is alpha."""
    if alpha.image is None:
        return {"roughness": math.sqrt(min(alpha.value, 1.0))}
    roughness = np.sqrt(alpha.image.pixels)
    return {"roughness": 1.0, "metallic_roughness_texture": _packed(alpha.image, roughness, 1.0)}


def _packed(place: NumberImage, roughness: Array | float, metallic: Array | float) -> Texture:
    """A texture with roughness (H, W) as green and metal as blue, as glTF has it."""
    red, green, blue = np.broadcast_arrays(np.ones_like(place.pixels), roughness, metallic)
    return place.with_pixels(np.clip(np.stack([red, green, blue], axis=2), 0, 1))


def metal_and_roughness(place: str, metal: Amount, rough: Amount) -> Look:
    """Of Disney's BSDF, where alpha is the square of roughness too."""
    lies = rough.image or metal.image
    if lies is None:
        return {"metallic": min(metal.value, 1.0), "roughness": min(rough.value, 1.0)}
    if metal.image is not None and not _lie_alike(metal.image, lies):
        import_report.changed(
            f"metallic of {place}: the mean of its image, which lies otherwise than roughness"
        )
        metal = Amount(metal.mean)
    green, blue = (one.value if one.image is None else one.image.pixels for one in (rough, metal))
    return {"metallic": 1.0, "roughness": 1.0, "metallic_roughness_texture": _packed(lies, green, blue)}


def stretched(metal: Amount, rough: Amount, anisotropy: float) -> Look:
    """The same where reflections are stretched: its alphas are r² / a and r² a for a² = 1 - 0.9
    anisotropy."""
    alpha, aspect = min(rough.mean, 1.0) ** 2, math.sqrt(1 - 0.9 * anisotropy)
    low, high = alpha * aspect, min(alpha / aspect, 1.0)
    stretch = math.sqrt((high - low) / (1 - low)) if high > low else 0.0
    return {"metallic": min(metal.mean, 1.0), "roughness": math.sqrt(low), "anisotropy": stretch}


def _lie_alike(first: NumberImage, second: NumberImage) -> bool:
    """Whether each pixel of the one has its counterpart in the other."""
    return first.pixels.shape == second.pixels.shape and _is_placed_alike(first.texture, second.texture)


def _is_placed_alike(first: Texture, second: Texture) -> bool:
    """Whether two textures differ in their bitmaps alone."""
    return replace(first, bitmap=second.bitmap) == second


def with_alpha(place: str, base: Texture | None, opacity: NumberImage) -> Texture:
    """A texture of a base colour whose alpha is an opacity."""
    alpha = np.clip(opacity.pixels, 0, 1)[..., None]
    if base is None:
        return opacity.with_pixels(np.concatenate([np.ones((*alpha.shape[:2], 3)), alpha], axis=2))
    if not _is_placed_alike(base, opacity.texture):
        import_report.changed(f"opacity of {place}: lies as the colour beside it does")
    colors = linear_pixels(base.bitmap)[..., :3]
    height, width = (max(pair) for pair in zip(colors.shape[:2], alpha.shape[:2], strict=True))
    both = [_resized(one, height, width) for one in (colors, alpha)]
    return replace(base, bitmap=Bitmap(np.concatenate(both, axis=2)))


def _resized(pixels: Array, height: int, width: int) -> Array:
    """(height, width, C) of the nearest pixels."""
    rows = np.arange(height) * pixels.shape[0] // height
    columns = np.arange(width) * pixels.shape[1] // width
    resized: Array = pixels[rows][:, columns]
    return resized


def upright(texture: Texture) -> Texture:
    """A normal map whose green goes along v, downwards in the image, as one where it goes up."""
    pixels = np.array(texture.bitmap.pixels[..., :3])
    largest = 1.0 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
    pixels[..., 1:2] = largest - pixels[..., 1:2]
    return replace(texture, bitmap=Bitmap(pixels))


def blended(first: Look, second: Look, weight: Amount) -> Look | None:
    """What is between two opaque materials, number by number, exactly of two Lambertian ones. None where
    something else than numbers differs, or an image."""
    own, other = (
        {name: getattr(Material(**look), name) for name in {*first, *second}} for look in (first, second)
    )
    unlike = [name for name, value in own.items() if value != other[name]]
    plain = all(
        isinstance(own[name], float | tuple) and isinstance(other[name], float | tuple) for name in unlike
    )
    images = any(isinstance(value, Texture) for value in (*own.values(), *other.values()))
    if not plain or (images and unlike) or max(own.get("transmission", 0), other.get("transmission", 0)) > 0:
        return None
    if "ior" in unlike and 1 in (own.get("metallic"), other.get("metallic")):
        # That of metal says nothing.
        own["ior"] = other["ior"] = (other if own.get("metallic") == 1 else own)["ior"]
    mixed = {name: _mixed(value, other[name], min(weight.mean, 1.0)) for name, value in own.items()}
    return mixed if weight.image is None else {**mixed, **_woven(own, other, weight.image)}


def _mixed(first: Any, second: Any, share: float) -> Any:
    if first == second:
        return first
    return between(first, second, share) if isinstance(first, tuple) else (1 - share) * first + share * second


def _woven(first: Look, second: Look, weight: NumberImage) -> Look:
    """The values of two materials that images may say, by a weight at each place."""
    share = np.clip(weight.pixels, 0, 1)
    look: Look = {}
    if first["base_color"] != second["base_color"]:
        colors = (1 - share[..., None]) * first["base_color"] + share[..., None] * second["base_color"]
        look |= {"base_color": (1.0, 1.0, 1.0), "base_color_texture": weight.with_pixels(colors)}
    default = Material()
    rough, metal, specular = (
        (1 - share) * first.get(name, getattr(default, name))
        + share * second.get(name, getattr(default, name))
        for name in ("roughness", "metallic", "specular")
    )
    if np.ptp(rough) > 0 or np.ptp(metal) > 0:
        look |= {"roughness": 1.0, "metallic": 1.0}
        look["metallic_roughness_texture"] = _packed(weight, rough, metal)
    if np.ptp(specular) > 0:
        # Its share stands in alpha.
        pixels = np.concatenate([np.ones((*share.shape, 3)), specular[..., None]], axis=2)
        look |= {"specular": 1.0, "specular_texture": weight.with_pixels(pixels)}
    return look


def between(first: Vector, second: Vector, share: float) -> Vector:
    """A share of the second colour and the rest of the first."""
    r, g, b = ((1 - share) * a + share * c for a, c in zip(first, second, strict=True))
    return r, g, b


def product(first: Vector, second: Vector) -> Vector:
    """Colour by colour."""
    r, g, b = (a * c for a, c in zip(first, second, strict=True))
    return r, g, b


def hue(color: Colored) -> Vector:
    """A colour with a luminance of 1; white for an image."""
    luminance = 0.2126 * color.rgb[0] + 0.7152 * color.rgb[1] + 0.0722 * color.rgb[2]
    if color.texture is not None or luminance <= 0:
        return (1.0, 1.0, 1.0)
    r, g, b = (min(c / luminance, 1.0) for c in color.rgb)
    return r, g, b
