"""Indices of refraction by the names that Mitsuba knows, and what boundaries between two of them reflect."""

from __future__ import annotations

import numpy as np

from incpt.core.errors import InputError
from incpt.formats.mitsuba.node import Node

INDICES = {
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277, "carbon dioxide": 1.00045,
    "water": 1.333, "acetone": 1.36, "ethanol": 1.361, "carbon tetrachloride": 1.461, "glycerol": 1.4729,
    "benzene": 1.501, "silicone oil": 1.52045, "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458,
    "pyrex": 1.47, "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544,
    "amber": 1.55, "pet": 1.575, "diamond": 2.419,
}  # fmt: skip
"""At about 589 nm, between 0 and 20 degrees Celsius (E. Hecht, *Optics*; Mitsuba's "ior.h")."""
AIR = INDICES["air"]


def index(node: Node, name: str, default: str) -> float:
    """A property that is a number or the name of a substance. Raises InputError."""
    value = node.value(name)
    if value is None or isinstance(value, str):
        word = default if value is None else value.lower()
        if word not in INDICES:
            raise InputError(
                f"{name}: {word[:40]!r} is not known; write a number or one of {', '.join(INDICES)}"
            )
        return INDICES[word]
    return node.number(name, 1.0, 0.1, 100.0)


def inner_reflectance(ior: float) -> float:
    """What a smooth boundary reflects of diffuse light that comes from inside: 1 - (1 - F) / ior² for what it
    reflects of such light from outside, F, the mean of Fresnel's formula over directions."""
    cosine = np.sqrt((np.arange(1024) + 0.5) / 1024)
    cos_t = np.sqrt(1 - (1 - cosine**2) / ior**2)
    parallel = (ior * cosine - cos_t) / (ior * cosine + cos_t)
    perpendicular = (cosine - ior * cos_t) / (cosine + ior * cos_t)
    outer = float((parallel**2 + perpendicular**2).mean() / 2)
    return 1 - (1 - outer) / ior**2
