"""What conductors reflect at normal incidence, by the names that Mitsuba knows them under.

Each number is |(n - 1) / (n + 1)|² over wavelengths, seen in daylight as linear Rec. 709, of the measured
indices n = eta + i k that Mitsuba 3 ships under that name ("data/ior", whose files name luxpop.com as their
source).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.picture.spectra import Spectrum, reflected_color

Array = npt.NDArray[np.float64]

REFLECTANCES: dict[str, Vector] = {
    "a-C": (0.2117, 0.212, 0.1999), "Ag": (0.9715, 0.9599, 0.9153), "Al": (0.9132, 0.9215, 0.9245),
    "AlAs": (0.2824, 0.2644, 0.4483), "AlSb": (0.3507, 0.385, 0.4776), "Au": (1, 0.7823, 0.3435),
    "Be": (0.5391, 0.5379, 0.537), "Cr": (0.6347, 0.6622, 0.7046), "CsI": (0.07854, 0.08098, 0.08559),
    "Cu": (0.9551, 0.6377, 0.5382), "Cu2O": (0.243, 0.2648, 0.273), "Cu_palik": (0.953, 0.6392, 0.5369),
    "CuO": (0.2209, 0.2169, 0.2157), "d-C": (0.1711, 0.1729, 0.1765), "Hg": (0.7815, 0.7796, 0.7784),
    "HgTe": (0.4048, 0.3842, 0.3852), "Ir": (0.7008, 0.6931, 0.6565), "K": (0.9497, 0.9375, 0.9207),
    "Li": (0.9158, 0.889, 0.808), "MgO": (0.07204, 0.07308, 0.07489), "Mo": (0.5585, 0.5791, 0.5704),
    "Na": (0.977, 0.9612, 0.9362), "Nb": (0.5038, 0.507, 0.5049), "Ni": (0.6593, 0.6086, 0.5258),
    "Rh": (0.797, 0.7646, 0.7425), "Se": (0.3158, 0.2697, 0.2756), "Se-e": (0.4392, 0.4217, 0.4557),
    "SiC": (0.2017, 0.2063, 0.2144), "SnTe": (0.365, 0.122, 0.03067), "Ta": (0.3892, 0.3603, 0.4122),
    "Te": (0.5724, 0.5932, 0.5844), "Te-e": (0.6566, 0.6859, 0.6722), "ThF4": (0.04248, 0.04271, 0.04334),
    "TiC": (0.4889, 0.458, 0.445), "TiN": (0.6137, 0.4614, 0.2328), "TiO2": (0.2322, 0.2446, 0.2727),
    "TiO2-e": (0.1936, 0.2046, 0.2287), "V": (0.5111, 0.5278, 0.5651), "VC": (0.4695, 0.4364, 0.4141),
    "VN": (0.4694, 0.4101, 0.3451), "W": (0.5153, 0.4959, 0.4676),
}  # fmt: skip
_SECOND_SOURCE = "_palik"
"""What ends names of further measurements, most of which are the same ones."""
_STEPS = np.arange(380.0, 781.0, 1.0)
"""Nanometres."""


def named_reflectance(name: str) -> Vector:
    """Of a material by its name. Raises InputError."""
    found = REFLECTANCES.get(name) or REFLECTANCES.get(name.removesuffix(_SECOND_SOURCE))
    if found is None:
        raise InputError(f"{name[:40]!r} is not known; choose one of {', '.join(REFLECTANCES)}, none")
    return found


def reflectance(eta: Spectrum | Vector, k: Spectrum | Vector) -> Vector:
    """Of the real and the imaginary part of an index of refraction, each over wavelengths or for red, green
    and blue."""
    over_wavelengths = [one for one in (eta, k) if isinstance(one, Spectrum)]
    if not over_wavelengths:
        found = _reflectance(np.array(eta), np.array(k))
    else:
        found = reflected_color(_STEPS, _reflectance(_at_steps(eta), _at_steps(k)))
    r, g, b = np.clip(found, 0.0, 1.0).tolist()
    return r, g, b


def _at_steps(value: Spectrum | Vector) -> Array:
    if isinstance(value, Spectrum):
        return np.asarray(np.interp(_STEPS, value.wavelengths, value.values))
    return np.full(len(_STEPS), float(np.mean(value)))


def _reflectance(eta: Array, k: Array) -> Array:
    with np.errstate(all="ignore"):
        found = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    return np.nan_to_num(found, nan=1.0)
