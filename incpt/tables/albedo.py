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

from incpt.core.layout import (
    ALBEDO_TABLE_SIZE,
    GLASS_STEPS,
    LEAST_ALBEDO_LOSS,
    MIN_ALPHA,
    MIN_SHEEN_ALPHA,
    SHEEN_NARROW,
    SHEEN_WIDE,
    STRETCHED_COSINES,
    STRETCHED_ROUGHNESSES,
    STRETCHED_STEPS,
)
from incpt.scene.material import Material

Array = npt.NDArray[np.floating]

_SAMPLES = 1024
_STRETCHED_SAMPLES = _GLASS_SAMPLES = 512
_SHEEN_COSINES, _SHEEN_ANGLES = 128, 32
"""Points of the sums over the hemisphere."""
GLASS_TABLE_SHAPE = (GLASS_STEPS, GLASS_STEPS, GLASS_STEPS, 2)
"""See `glass_table`."""


@lru_cache(maxsize=1)
def table() -> Array:
    """(2, roughness, cosine) A and B at ALBEDO_TABLE_SIZE roughnesses and cosines from 0 to 1."""
    grid = np.linspace(0.0, 1.0, ALBEDO_TABLE_SIZE)
    alpha = np.maximum(grid**2, MIN_ALPHA)[:, None, None]
    cosine = np.maximum(grid, 1e-3)[None, :, None]
    return _reflected((np.sqrt(1 - cosine**2), np.zeros(1), cosine), (alpha, alpha), _SAMPLES)


def _reflected(wo: tuple[Array, Array, Array], alpha: tuple[Array, Array], samples: int) -> Array:
    """(2, ...) A and B for directions wo and roughnesses along both axes, whose last dimension is 1."""
    # A golden-ratio lattice; a grid resolves the edge where reflections sink below the surface far worse.
    index = np.arange(samples)
    u, v = index * ((5**0.5 - 1) / 2) % 1, (index + 0.5) / samples
    h = _visible_normal(wo, alpha, u, v)
    o_h = sum(a * b for a, b in zip(wo, h, strict=True))
    wi = [2 * o_h * b - a for a, b in zip(wo, h, strict=True)]

    def lambda_(w: Sequence[Array]) -> Array:
        slope2 = ((alpha[0] * w[0]) ** 2 + (alpha[1] * w[1]) ** 2) / np.clip(w[2], 1e-6, None) ** 2
        return np.asarray((np.sqrt(1 + slope2) - 1) / 2)

    # Sampling visible normals leaves G2 / G1 as the weight of a reflection.
    masking = lambda_(wo)
    weight = np.where(wi[2] > 0, (1 + masking) / (1 + masking + lambda_(wi)), 0.0)
    schlick = (1 - np.clip(o_h, 0, 1)) ** 5
    return np.stack([weight.mean(axis=-1), (weight * schlick).mean(axis=-1)])


def _visible_normal(
    wo: Sequence[Array],
    alpha: tuple[Array, Array],
    u: Array,
    v: Array,
) -> list[Array]:
    # Dupuy and Benyoub 2023, as sample_stretched_normal in cl/base/sampling.cl.
    x, y, z = alpha[0] * wo[0], alpha[1] * wo[1], wo[2]
    length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    height = (1 - v) * (1 + z) - z
    radius = np.sqrt(np.clip(1 - height**2, 0, 1))
    hx = alpha[0] * (radius * np.cos(2 * np.pi * u) + x)
    hy = alpha[1] * (radius * np.sin(2 * np.pi * u) + y)
    hz = np.maximum(height + z, 1e-9)
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    return [hx / length, hy / length, hz / length]


@lru_cache(maxsize=1)
def stretched_rows() -> npt.NDArray[np.float32]:
    """(roughness, step, STRETCHED_ROW_SIZE): A and B of reflections that are stretched along x, for the
    roughness across and for alpha along x in equal steps from that across to 1.

    A row has both at each root of a cosine, for directions along y, between the axes and along x (the square
    of the cosine of the azimuth is 0, 1/2, 1; a parabola serves between them), then their means over the
    hemisphere.
    """
    across = np.maximum(np.linspace(0.0, 1.0, STRETCHED_ROUGHNESSES) ** 2, MIN_ALPHA)
    steps = np.linspace(0.0, 1.0, STRETCHED_STEPS)
    cosine = np.maximum(np.linspace(0.0, 1.0, STRETCHED_COSINES), 0.03) ** 2
    sine, azimuth = np.sqrt(1 - cosine**2)[:, None, None], np.arcsin(np.sqrt([1.0, 0.5, 0.0]))[:, None]
    wo = (sine * np.cos(azimuth), sine * np.sin(azimuth), cosine[:, None, None])
    found = []
    for alpha in across:
        along = (alpha + (1 - alpha) * steps)[:, None, None, None]
        found.append(_reflected(wo, (along, np.full_like(along, alpha)), _STRETCHED_SAMPLES))
    values = np.moveaxis(np.array(found), 1, -1)  # roughness, step, cosine, azimuth, A or B
    # Over the azimuth a parabola through these three has the mean of 1/4, 1/2, 1/4 of them.
    over_azimuth = np.einsum("rscpk,p->rsck", values, [0.25, 0.5, 0.25])
    fine = np.linspace(0.0, 1.0, 513) ** 2
    place = np.sqrt(fine) * (STRETCHED_COSINES - 1)
    low = np.minimum(place.astype(int), STRETCHED_COSINES - 2)
    t = (place - low)[:, None]
    between = over_azimuth[:, :, low] * (1 - t) + over_azimuth[:, :, low + 1] * t
    weighted = between * (2 * fine)[:, None]
    means = ((weighted[:, :, 1:] + weighted[:, :, :-1]) / 2 * np.diff(fine)[:, None]).sum(axis=2)
    flat = values.reshape(*values.shape[:2], -1)
    return np.concatenate([flat, means], axis=2).astype(np.float32)


@lru_cache(maxsize=1)
def glass_table() -> npt.NDArray[np.float32]:
    """GLASS_TABLE_SHAPE: the share of the light that a rough boundary reflects or
    lets through at once, by (eta - 1) / (eta + 1) from -1/2 to 1/2, roughness from 0 to 1, and root of the
    cosine from 0 to 1: of one that reflects totally or not at all, and of one that reflects as Fresnel says.
    The rest meets more microfacets.

    As `eval_rough_boundary` has it: masking correlates with height for what is reflected alone.
    """
    grid = np.linspace(0.0, 1.0, GLASS_STEPS)
    alpha = np.maximum(grid**2, MIN_ALPHA)[:, None, None]
    cosine = np.maximum(grid, 0.03)[None, :, None] ** 2
    wo = (np.sqrt(1 - cosine**2), np.zeros(1), cosine)
    index = np.arange(_GLASS_SAMPLES)
    u, v = index * ((5**0.5 - 1) / 2) % 1, (index + 0.5) / _GLASS_SAMPLES
    h = _visible_normal(wo, (alpha, alpha), u, v)
    o_h = sum(a * b for a, b in zip(wo, h, strict=True))

    def lambda_(mu: Array) -> Array:
        mu2 = np.clip(mu**2, 1e-12, 1.0)
        return np.asarray((np.sqrt(1 + alpha**2 * (1 - mu2) / mu2) - 1) / 2)

    mirrored = 2 * o_h * h[2] - cosine
    masking = lambda_(cosine)
    reflected = np.where(mirrored > 0, (1 + masking) / (1 + masking + lambda_(mirrored)), 0.0)
    found = []
    for step in np.linspace(-0.5, 0.5, GLASS_STEPS):
        eta = (1 + step) / (1 - step)
        inside = np.sqrt(np.clip(1 - (1 - o_h**2) / eta**2, 0.0, 1.0))
        across = ((o_h - eta * inside) / (o_h + eta * inside)) ** 2
        along = ((eta * o_h - inside) / (eta * o_h + inside)) ** 2
        fresnel = np.where(inside > 0, (across + along) / 2, 1.0)
        behind = (o_h / eta - inside) * h[2] - cosine / eta
        passed = np.where(behind < 0, 1 / (1 + lambda_(behind)), 0.0)
        shares = (np.floor(fresnel), fresnel)
        both = [(share * reflected + (1 - share) * passed).mean(axis=-1) for share in shares]
        found.append(np.stack(both, axis=-1))
    return np.array(found, np.float32)


@lru_cache(maxsize=1)
def rows() -> npt.NDArray[np.float32]:
    """(roughness, ALBEDO_ROW_SIZE): A at all cosines, B at all cosines, and their means over the hemisphere,
    for materials whose textures change what the albedo depends on, and for clearcoats; then the albedo of
    sheen at all roots of cosines."""
    a, b = table()
    means = [[_mean(first), _mean(second)] for first, second in zip(a, b, strict=True)]
    return np.concatenate([a, b, means, sheen_table()], axis=1).astype(np.float32)


@lru_cache(maxsize=1)
def sheen_table() -> Array:
    """(roughness, cosine) what a white sheen reflects, at ALBEDO_TABLE_SIZE roughnesses and roots of cosines
    from 0 to 1: the distribution and masking of A. Conty Estevez and C. Kulla, Production Friendly Microfacet
    Sheen BRDF, SIGGRAPH Courses 2017. It is above 1 at grazing angles where the roughness is low."""
    grid = np.linspace(0.0, 1.0, ALBEDO_TABLE_SIZE)
    mu_o = np.maximum(grid**2, 1e-4)[:, None, None]
    t = (np.arange(_SHEEN_COSINES) + 0.5) / _SHEEN_COSINES
    mu_i, area = (t**2)[None, :, None], (2 * t / _SHEEN_COSINES)[None, :, None]
    phi = (np.arange(_SHEEN_ANGLES) + 0.5) * np.pi / _SHEEN_ANGLES
    sine_o, sine_i = np.sqrt(1 - mu_o**2), np.sqrt(1 - mu_i**2)
    length2 = 2 + 2 * (mu_o * mu_i + sine_o * sine_i * np.cos(phi))
    # sine^2 of the half vector's angle
    sine2 = np.clip(1 - (mu_o + mu_i) ** 2 / length2, 0.0, 1.0)
    found = []
    for roughness in grid:
        alpha = max(roughness**2, MIN_SHEEN_ALPHA)
        d = (2 + 1 / alpha) / (2 * np.pi) * sine2 ** (0.5 / alpha)
        masking = 1 + sheen_lambda(mu_o, alpha) + sheen_lambda(mu_i, alpha)
        found.append((d / (4 * mu_o * masking) * area).mean(axis=2).sum(axis=1) * 2 * np.pi)
    return np.array(found)


def sheen_lambda(cosine: Array, alpha: float) -> Array:
    """Lambda of Smith's masking for sheen: the paper's fit, between those of a narrow and of a wide one."""
    share = (1 - alpha) ** 2
    a, b, c, d, e = share * np.array(SHEEN_NARROW) + (1 - share) * np.array(SHEEN_WIDE)

    def fitted(x: Array) -> Array:
        return np.asarray(a / (1 + b * x**c) + d * x + e)

    middle = float(fitted(np.asarray(0.5)))
    return np.asarray(np.exp(np.where(cosine < 0.5, fitted(cosine), 2 * middle - fitted(1 - cosine))))


def layer_row(material: Material) -> npt.NDArray[np.float32]:
    """(LAYER_SIZE,) the albedo by cosine of what reflects at once, layer and metal in their shares;
    1 / (1 - its mean over the hemisphere); and the colour of what scatters again on the metal in it."""
    place = material.roughness * (ALBEDO_TABLE_SIZE - 1)
    low = min(int(place), ALBEDO_TABLE_SIZE - 2)
    a, b = table()[:, low] + (table()[:, low + 1] - table()[:, low]) * (place - low)
    f0 = min(((material.ior - 1) / (material.ior + 1)) ** 2 * max(material.specular_color), 1.0)
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
