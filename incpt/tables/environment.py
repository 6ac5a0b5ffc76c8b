"""The environment of a scene on the device, and how light sampling chooses points of its image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.device.device import Device
from incpt.scene.image import Image
from incpt.tables.alias import luminance


@dataclass(frozen=True, eq=False)
class EnvironmentTables:
    """The buffers of the environment's image, by name, and whether there is one that is not black, or in
    which a sun shines. `irradiance`: the luminance of the image, summed up over the sphere."""

    buffers: Mapping[str, cl.Buffer]
    has_image: bool
    irradiance: float = 0.0


def environment_tables(device: Device, image: Image | None, has_sun: bool = False) -> EnvironmentTables:
    """Those of an environment with that image, or without one; `has_sun`: a sun shines beside it."""
    table = None if image is None else image_density(image)
    if image is not None and table is None and has_sun:
        table = image_density(Image(np.ones_like(image.pixels)))
    if image is None or table is None:
        nothing = np.zeros(1, np.float32)
        arrays = dict.fromkeys(("environment_image", "marginal", "conditional", "texel_pdf"), nothing)
    else:
        arrays = {
            "environment_image": image.pixels,
            "marginal": table.marginal,
            "conditional": table.conditional,
            "texel_pdf": table.texel_pdf,
        }
    buffers = {name: device.upload(array) for name, array in arrays.items()}
    return EnvironmentTables(buffers, table is not None, 0.0 if image is None else _irradiance(image))


def _irradiance(image: Image) -> float:
    """The luminance of a lat-long image, summed up over the sphere."""
    height, width = image.pixels.shape[:2]
    rows = luminance(image.pixels).sum(axis=1) * np.sin((np.arange(height) + 0.5) * np.pi / height)
    return float(rows.sum() * (np.pi / height) * (2 * np.pi / width))


@dataclass(frozen=True, eq=False)
class ImageDensity:
    """Piecewise constant density over the unit square of a lat-long image, rows from +y.

    marginal     (height + 1,) cumulative distribution of rows
    conditional  (height, width + 1) of the texels of each row
    texel_pdf    (height, width) density over the unit square
    """

    marginal: npt.NDArray[np.float32]
    conditional: npt.NDArray[np.float32]
    texel_pdf: npt.NDArray[np.float32]


def image_density(image: Image) -> ImageDensity | None:
    """The density of an image, by luminance times the sine of the polar angle; None where it is black."""
    brightness = luminance(image.pixels)
    # Bilinear interpolation carries a texel's light half a texel further; the density follows it there.
    brightness = (np.roll(brightness, 1, axis=1) + 2 * brightness + np.roll(brightness, -1, axis=1)) / 4
    padded = np.pad(brightness, ((1, 1), (0, 0)), mode="edge")
    brightness = (padded[:-2] + 2 * brightness + padded[2:]) / 4
    height, width = brightness.shape
    weight = brightness * np.sin((np.arange(height) + 0.5) * np.pi / height)[:, None]
    total = weight.sum()
    if not total > 0:
        return None
    rows = weight.sum(axis=1)
    conditional = np.zeros((height, width + 1))
    np.cumsum(weight, axis=1, out=conditional[:, 1:])
    # A black row is never chosen; a ramp keeps its table valid.
    conditional[rows == 0] = np.linspace(0, 1, width + 1)
    conditional /= conditional[:, -1:]
    marginal = np.concatenate([[0.0], np.cumsum(rows)]) / total
    marginal[-1] = 1.0
    return ImageDensity(
        marginal.astype(np.float32),
        conditional.astype(np.float32),
        (weight / total * (width * height)).astype(np.float32),
    )
