"""Directional albedo of the dielectric specular layer, which couples it to the Lambertian base.

The layer's albedo is linear in the reflectance at normal (F0) and at grazing incidence (F90), since
Schlick's term separates: E = F0 (A - B) + F90 B, where A is the albedo of a GGX surface that reflects
everything and B its part weighted with (1 - <wo, h>)^5. Both are integrated once, over the cosine of wo
and over roughness; per material one row of E goes to the device.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from incpt.core.layout import ALBEDO_TABLE_SIZE, LEAST_ALBEDO_LOSS, MIN_ALPHA
from incpt.scene.material import Material

Array = npt.NDArray[np.floating]

_SAMPLES = 1024


@lru_cache(maxsize=1)
def table() -> Array:
    """(2, roughness, cosine) A and B at ALBEDO_TABLE_SIZE roughnesses and cosines from 0 to 1."""
    grid = np.linspace(0.0, 1.0, ALBEDO_TABLE_SIZE)
    alpha = np.maximum(grid**2, MIN_ALPHA)[:, None, None]
    cosine = np.maximum(grid, 1e-3)[None, :, None]
    # A golden-ratio lattice; a grid resolves the edge where reflections sink below the surface far worse.
    index = np.arange(_SAMPLES)[None, None, :]
    u, v = index * ((5**0.5 - 1) / 2) % 1, (index + 0.5) / _SAMPLES
    wo = np.broadcast_arrays(np.sqrt(1 - cosine**2), 0.0, cosine)
    h = _visible_normal(wo, alpha, u, v)
    o_h = sum(a * b for a, b in zip(wo, h, strict=True))
    mu_i = 2 * o_h * h[2] - cosine

    def lambda_(mu: Array) -> Array:
        mu2 = np.clip(mu, 1e-6, 1.0) ** 2
        return np.asarray((np.sqrt(1 + alpha**2 * (1 - mu2) / mu2) - 1) / 2)

    # Sampling visible normals leaves G2 / G1 as the weight of a reflection.
    weight = np.where(mu_i > 0, (1 + lambda_(cosine)) / (1 + lambda_(cosine) + lambda_(mu_i)), 0.0)
    schlick = (1 - np.clip(o_h, 0, 1)) ** 5
    return np.stack([weight.mean(axis=2), (weight * schlick).mean(axis=2)])


def _visible_normal(
    wo: Sequence[Array],
    alpha: Array,
    u: Array,
    v: Array,
) -> list[Array]:
    # Dupuy and Benyoub 2023, as sample_visible_normal in cl/base/sampling.cl.
    x, y, z = alpha * wo[0], alpha * wo[1], wo[2]
    length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    height = (1 - v) * (1 + z) - z
    radius = np.sqrt(np.clip(1 - height**2, 0, 1))
    hx, hy = alpha * (radius * np.cos(2 * np.pi * u) + x), alpha * (radius * np.sin(2 * np.pi * u) + y)
    hz = np.maximum(height + z, 1e-9)
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    return [hx / length, hy / length, hz / length]


@lru_cache(maxsize=1)
def rows() -> npt.NDArray[np.float32]:
    """(roughness, ALBEDO_ROW_SIZE): A at all cosines, B at all cosines, and their means over the hemisphere,
    for materials whose textures change what the albedo depends on."""
    a, b = table()
    means = [[_mean(first), _mean(second)] for first, second in zip(a, b, strict=True)]
    return np.concatenate([a, b, means], axis=1).astype(np.float32)


def layer_row(material: Material) -> npt.NDArray[np.float32]:
    """(LAYER_SIZE,) the albedo by cosine of what reflects at once, layer and metal in their shares;
    1 / (1 - its mean over the hemisphere); and the colour of what scatters again on the metal in it."""
    place = material.roughness * (ALBEDO_TABLE_SIZE - 1)
    low = min(int(place), ALBEDO_TABLE_SIZE - 2)
    a, b = table()[:, low] + (table()[:, low + 1] - table()[:, low]) * (place - low)
    f0 = ((material.ior - 1) / (material.ior + 1)) ** 2
    layer = material.specular * (f0 * (a - b) + b)
    albedo = layer + (a - layer) * material.metallic
    color = material.metallic * _scattered_again(np.asarray(material.base_color), _mean(a))
    return np.array([*albedo, 1 / max(1 - _mean(albedo), 1e-6), *color], np.float32)


def _mean(albedo: Array) -> float:
    """Over the hemisphere, weighted with the cosine: exactly that of what kernels interpolate linearly."""
    mu = np.linspace(0.0, 1.0, ALBEDO_TABLE_SIZE)
    first, last = albedo[:-1] * (2 * mu[:-1] + mu[1:]), albedo[1:] * (mu[:-1] + 2 * mu[1:])
    return float(mu[1] / 3 * np.sum(first + last))


def _scattered_again(f0: Array, albedo: float) -> Array:
    """(3,) the share of the light lost to microfacets in the way that metal of reflectance `f0` sends back
    after all, where `albedo` is the mean share that is not lost: a series of reflections, each with the mean
    reflectance of Schlick's Fresnel term (Kulla and Conty 2017)."""
    if 1 - albedo < LEAST_ALBEDO_LOSS:
        return np.zeros(3)
    fresnel = f0 + (1 - f0) / 21
    return np.asarray(fresnel**2 * albedo / (1 - fresnel * (1 - albedo)))
