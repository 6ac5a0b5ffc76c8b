"""Colours: from what files and people write to linear values, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities x, y of red, green, blue and white (ITU-R BT.709), as OpenEXR has them."""
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""From XYZ to the responses in which whites are adapted (Lam, "Metamerism and Colour Constancy", 1985)."""


def linear_from_srgb(encoded: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """What values from 0 to 1 in sRGB stand for (IEC 61966-2-1)."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.0) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """The inverse of `linear_from_srgb`; what is above 1 goes on along the same curve."""
    x = np.asarray(linear, np.float64)
    return np.where(x <= 0.04045 / 12.92, x * 12.92, 1.055 * np.maximum(x, 0.0) ** (1 / 2.4) - 0.055)


def xyz_from_rgb(chromaticities: Sequence[float]) -> npt.NDArray[np.float64]:
    """(3, 3) from linear red, green and blue with these chromaticities (as REC_709) to XYZ, with a luminance
    of 1 for white (SMPTE RP 177). Not finite where no light has such chromaticities."""
    x, y = np.reshape(np.asarray(chromaticities, np.float64), (4, 2)).T
    with np.errstate(all="ignore"):
        columns = np.stack([x / y, np.ones(4), (1 - x - y) / y])
        primaries, white = columns[:, :3], columns[:, 3]
        try:
            return np.asarray(primaries * np.linalg.solve(primaries, white))
        except np.linalg.LinAlgError:
            return np.full((3, 3), np.nan)


def rec709_from_rgb(chromaticities: Sequence[float]) -> npt.NDArray[np.float64]:
    """(3, 3) from linear red, green and blue with these chromaticities to those of Rec. 709, white to white
    (Bradford). Not finite where no light has such chromaticities."""
    to_xyz = xyz_from_rgb(chromaticities)
    own, wanted = _BRADFORD @ to_xyz.sum(axis=1), _BRADFORD @ xyz_from_rgb(REC_709).sum(axis=1)
    with np.errstate(all="ignore"):
        adapted = np.linalg.inv(_BRADFORD) @ np.diag(wanted / own) @ _BRADFORD
    return np.asarray(np.linalg.inv(xyz_from_rgb(REC_709)) @ adapted @ to_xyz)
