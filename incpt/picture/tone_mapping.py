"""From linear radiance to what a display shows.

The display curve "agx" is AgX by Troy Sobotka in the polynomial form of Benjamin Wrensch ("Minimal AgX
Implementation", iolite-engine.com, 2023), the default look of Blender 4: bright colours run into white
instead of clipping to a primary, and greys stay grey. "filmic" is the curve of John Hable ("Filmic
Tonemapping Operators", filmicgames.com, 2010) for each channel alone: more contrast, saturated highlights.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import REAL, numbers
from incpt.core.checks import described, one_of, require
from incpt.core.errors import InputError
from incpt.picture.color import srgb_from_linear

CURVES = ("agx", "filmic", "srgb")
LARGEST_EXPOSURE = 1000
"""Stops, up or down: a factor that double precision still holds."""
AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
# The rows of the printed digits sum to 1.0001, by which greys took a tint.
AGX_INSET /= AGX_INSET.sum(axis=1, keepdims=True)
"""(3, 3): mixes linear RGB before the curve, so that a saturated colour is none for the curve."""
AGX_OUTSET = np.linalg.inv(AGX_INSET)
"""(3, 3): undoes the mixture after the curve."""
AGX_LOG2_RANGE = (-12.47393, 4.026069)
"""The radiances that become 0 and 1, as powers of two."""
AGX_POLYNOMIAL = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)
"""The curve: factors of x^6 down to 1. It is Wrensch's fit, with a mean squared error of 3.7e-6."""
HABLE_CURVE = (0.15, 0.50, 0.10, 0.20, 0.02, 0.30)
"""Hable's shoulder strength, linear strength and angle, toe strength, numerator and denominator."""
HABLE_WHITE = 11.2
"""The radiance, times its factor, that becomes 1."""
HABLE_EXPOSURE_BIAS = 2.0
"""The factor of the radiance in front of the curve."""
UNDEFINED_PIXEL = (255, 0, 255)
"""What NaN is shown as."""


def tone_map(linear: npt.ArrayLike, exposure: float = 0.0, curve: str = "agx") -> npt.NDArray[np.uint8]:
    """(..., 3) linear radiance to display values 0 to 255, sRGB encoded.

    `exposure` is in stops. `curve` is "agx" (greys stay neutral, mid-grey 0.18 becomes 127, white
    1.0 becomes 201, what is brighter has room), "filmic" (0.18 becomes 100, 1.0 becomes 186, 5.6 and more
    255) or "srgb" (the plain transfer function, clipped at 1).
    Infinite radiance becomes white; undefined pixels (NaN) become magenta, so that they are seen.
    Raises InputError.
    """
    radiance = numbers("image", linear, np.float64)
    encoded = display_values(np.nan_to_num(radiance, posinf=1e30, neginf=0.0), exposure, curve)
    result: npt.NDArray[np.uint8] = np.rint(encoded * 255.0).astype(np.uint8)
    result[np.isnan(radiance).any(axis=-1)] = UNDEFINED_PIXEL
    return result


def tone_map_covered(
    image: npt.ArrayLike, exposure: float = 0.0, curve: str = "agx"
) -> npt.NDArray[np.uint8]:
    """`tone_map` of a picture (..., 3), or of one (..., 4) with the share that each pixel is covered, 0 to 1,
    by which its radiance is multiplied: straight alpha, 0 to 255, is the last channel of what is returned.
    Raises InputError."""
    values = numbers("image", image, np.float64)
    if values.shape[-1:] != (4,):
        return tone_map(values, exposure, curve)
    radiance, alpha = values[..., :3], values[..., 3:]
    own = np.divide(radiance, alpha, out=np.zeros_like(radiance), where=alpha > 0)
    opacity = np.rint(np.clip(alpha, 0.0, 1.0) * 255.0).astype(np.uint8)
    return np.concatenate([tone_map(own, exposure, curve), opacity], axis=-1)


def display_values(
    linear: npt.ArrayLike, exposure: float = 0.0, curve: str = "agx"
) -> npt.NDArray[np.float64]:
    """(..., 3) linear radiance, finite, to display values 0 to 1, which `tone_map` rounds. Raises
    InputError."""
    one_of("curve", curve, CURVES)
    require("exposure", exposure, REAL, "a number of stops")
    if not abs(exposure) <= LARGEST_EXPOSURE:
        span = f"{-LARGEST_EXPOSURE} to {LARGEST_EXPOSURE}"
        raise InputError(f"exposure: {described(exposure)} is out of range; use {span}")
    radiance = np.asarray(linear, np.float64)
    if radiance.shape[-1:] != (3,):
        raise InputError(f"image: has shape {radiance.shape}; a picture has shape (height, width, 3)")
    scaled = np.clip(radiance * 2.0**exposure, 0.0, 1e30)
    shown: npt.NDArray[np.float64] = {"agx": _agx, "filmic": _filmic, "srgb": _srgb}[curve](scaled)
    return np.clip(shown, 0.0, 1.0)


def _srgb(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return srgb_from_linear(np.minimum(linear, 1.0))


def _agx(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    low, high = AGX_LOG2_RANGE
    inset = np.maximum(linear @ AGX_INSET.T, 1e-10)
    x = np.clip((np.log2(inset) - low) / (high - low), 0.0, 1.0)
    result: npt.NDArray[np.float64] = np.polyval(AGX_POLYNOMIAL, x) @ AGX_OUTSET.T
    return result


def _filmic(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    a, b, c, d, e, f = HABLE_CURVE

    def curve(x: npt.NDArray[np.float64] | float) -> npt.NDArray[np.float64]:
        mapped: npt.NDArray[np.float64] = np.asarray(
            (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f
        )
        return mapped

    return _srgb(curve(np.minimum(linear * HABLE_EXPOSURE_BIAS, HABLE_WHITE)) / curve(HABLE_WHITE))
