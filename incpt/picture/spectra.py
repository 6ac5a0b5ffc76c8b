"""Spectra as colours: what people measure over wavelengths, in linear Rec. 709.

A spectrum is given by its values at wavelengths in nanometres, in ascending order, between which it is
linear, and outside of which it is 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from incpt.picture.color import REC_709, xyz_from_rgb

Array = npt.NDArray[np.float64]

LUMINANCE_INTEGRAL = 106.857
"""Of the eye's sensitivity over the wavelengths, nm: over it, a spectrum that is 1 everywhere has a luminance
of 1."""
_TABULATED = np.arange(380.0, 781.0, 5.0)
_FINE = np.arange(380.0, 781.0, 1.0)
"""Nanometres: where the tables have entries, and where spectra are looked at."""
_MATCHING = np.array(
    [
        [
        0.00137, 0.00224, 0.00424, 0.00765, 0.01431, 0.02319, 0.04351, 0.07763, 0.13438, 0.21477, 0.2839,
        0.3285, 0.34828, 0.34806, 0.3362, 0.3187, 0.2908, 0.2511, 0.19536, 0.1421, 0.09564, 0.05795,
        0.03201, 0.0147, 0.0049, 0.0024, 0.0093, 0.0291, 0.06327, 0.1096, 0.1655, 0.22575, 0.2904, 0.3597,
        0.43345, 0.51205, 0.5945, 0.6784, 0.7621, 0.8425, 0.9163, 0.9786, 1.0263, 1.0567, 1.0622, 1.0456,
        1.0026, 0.9384, 0.85445, 0.7514, 0.6424, 0.5419, 0.4479, 0.3608, 0.2835, 0.2187, 0.1649, 0.1212,
        0.0874, 0.0636, 0.04677, 0.0329, 0.0227, 0.01584, 0.01136, 0.00811, 0.00579, 0.00411, 0.0029,
        0.00205, 0.00144, 0.001, 0.00069, 0.00048, 0.00033, 0.00023, 0.00017, 0.00012, 0.00008, 0.00006,
        0.00004,
        ],
        [
        0.00004, 0.00006, 0.00012, 0.00022, 0.0004, 0.00064, 0.00121, 0.00218, 0.004, 0.0073, 0.0116,
        0.01684, 0.023, 0.0298, 0.038, 0.048, 0.06, 0.0739, 0.09098, 0.1126, 0.13902, 0.1693, 0.20802,
        0.2586, 0.323, 0.4073, 0.503, 0.6082, 0.71, 0.7932, 0.862, 0.91485, 0.954, 0.9803, 0.99495, 1,
        0.995, 0.9786, 0.952, 0.9154, 0.87, 0.8163, 0.757, 0.6949, 0.631, 0.5668, 0.503, 0.4412, 0.381,
        0.321, 0.265, 0.217, 0.175, 0.1382, 0.107, 0.0816, 0.061, 0.04458, 0.032, 0.0232, 0.017, 0.01192,
        0.00821, 0.00572, 0.0041, 0.00293, 0.00209, 0.00148, 0.00105, 0.00074, 0.00052, 0.00036, 0.00025,
        0.00017, 0.00012, 0.00008, 0.00006, 0.00004, 0.00003, 0.00002, 0.00001,
        ],
        [
        0.00645, 0.01055, 0.02005, 0.03621, 0.06785, 0.1102, 0.2074, 0.3713, 0.6456, 1.03905, 1.3856,
        1.62296, 1.74706, 1.7826, 1.77211, 1.7441, 1.6692, 1.5281, 1.28764, 1.0419, 0.81295, 0.6162,
        0.46518, 0.3533, 0.272, 0.2123, 0.1582, 0.1117, 0.07825, 0.05725, 0.04216, 0.02984, 0.0203, 0.0134,
        0.00875, 0.00575, 0.0039, 0.00275, 0.0021, 0.0018, 0.00165, 0.0014, 0.0011, 0.001, 0.0008, 0.0006,
        0.00034, 0.00024, 0.00019, 0.0001, 0.00005, 0.00003, 0.00002, 0.00001, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        ],
    ]
)  # fmt: skip
"""(3, 81) x, y and z of the CIE 1931 standard observer (CIE 018:2019, table 6)."""
_DAYLIGHT = np.array(
    [
        49.98, 52.31, 54.65, 68.7, 82.75, 87.12, 91.49, 92.46, 93.43, 90.06, 86.68, 95.77, 104.86, 110.94,
        117.01, 117.41, 117.81, 116.34, 114.86, 115.39, 115.92, 112.37, 108.81, 109.08, 109.35, 108.58,
        107.8, 106.3, 104.79, 106.24, 107.69, 106.05, 104.4, 104.22, 104.05, 102.02, 100, 98.17, 96.33,
        96.06, 95.79, 92.24, 88.69, 89.35, 90.01, 89.8, 89.6, 88.65, 87.7, 85.49, 83.29, 83.49, 83.7,
        81.86, 80.03, 80.12, 80.21, 81.25, 82.28, 80.28, 78.28, 74, 69.72, 70.67, 71.61, 72.98, 74.35,
        67.98, 61.6, 65.74, 69.89, 72.49, 75.09, 69.34, 63.59, 55.01, 46.42, 56.61, 66.81, 65.09, 63.38,
    ]
)  # fmt: skip
"""(81,) power of the illuminant D65, 100 at 560 nm (CIE 015:2018, table 5)."""


@dataclass(frozen=True)
class Spectrum:
    """Values at wavelengths in nanometres, in ascending order. Without wavelengths one value is that of all
    of them."""

    wavelengths: tuple[float, ...]
    values: tuple[float, ...]


def reflected_color(wavelengths: npt.ArrayLike, values: npt.ArrayLike) -> Array:
    """(3,) the colour of what reflects these shares of light: in daylight (D65), where 1 is white."""
    seen = _sampled(wavelengths, values) @ _reflectance_weights()
    return np.asarray(np.maximum(seen, 0.0))


def emitted_color(wavelengths: npt.ArrayLike, values: npt.ArrayLike) -> Array:
    """(3,) the colour of light with that power over wavelengths; what is 1 everywhere has a luminance of
    1."""
    return np.asarray(np.maximum(_sampled(wavelengths, values) @ _emission_weights(), 0.0))


def blackbody_color(kelvin: float) -> Array:
    """(3,) of the radiance of a black body, W / (m² sr nm) by Planck's law, as `emitted_color` sees it."""
    metres = _FINE * 1e-9
    with np.errstate(over="ignore"):
        radiance = 1.191043e-16 / metres**5 / np.expm1(1.438777e-2 / (metres * kelvin)) * 1e-9
    return emitted_color(_FINE, radiance)


def _sampled(wavelengths: npt.ArrayLike, values: npt.ArrayLike) -> Array:
    places, heights = np.asarray(wavelengths, np.float64), np.asarray(values, np.float64)
    return np.asarray(np.interp(_FINE, places, heights, 0.0, 0.0))


@lru_cache(maxsize=1)
def _emission_weights() -> Array:
    """(wavelengths, 3) linear red, green and blue of light of one wavelength."""
    matching = np.stack([np.interp(_FINE, _TABULATED, row) for row in _MATCHING], axis=1)
    weights: Array = matching @ np.linalg.inv(xyz_from_rgb(REC_709)).T / LUMINANCE_INTEGRAL
    return weights


@lru_cache(maxsize=1)
def _reflectance_weights() -> Array:
    """The same of a share of daylight; those of all wavelengths add up to 1."""
    lit = _emission_weights() * np.interp(_FINE, _TABULATED, _DAYLIGHT)[:, None]
    weights: Array = lit / lit.sum(axis=0)
    return weights
