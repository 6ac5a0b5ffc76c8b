"""What layers are made of, beside accounts of their own: thin films by the spectrum, sheen by its paper."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import call, direction, uniforms

from incpt.core import layout
from incpt.scene.material import Material
from incpt.tables import albedo

Array = npt.NDArray[np.floating]


def test_exponential_and_logarithm() -> None:
    x = np.concatenate([np.linspace(-87, 87, 4001), [-0.0, 0.0, 1e-6, -1e-6]]).astype(np.float32)
    (found,) = call("scalar", "r[i] = exponential(x[i]);", len(x), x=x)
    np.testing.assert_allclose(found, np.exp(x.astype(np.float64)), rtol=5e-6)
    y = np.concatenate([np.logspace(-37, 37, 4001), [1.0, 0.70710678, 1 - 1e-6, 1 + 1e-6]]).astype(np.float32)
    (found,) = call("scalar", "r[i] = logarithm(x[i]);", len(y), x=y)
    np.testing.assert_allclose(found, np.log(y.astype(np.float64)), rtol=3e-7, atol=1e-9)


# ------------------------------------------------------------------------------------------ thin film

_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
_D65 = np.array([0.95047, 1.0, 1.08883])


def eye(wavelength: Array) -> Array:
    """(3, N) CIE 1931 by C. Wyman, P.-P. Sloan and P. Shirley, Simple Analytic Approximations to the CIE XYZ
    Color Matching Functions, JCGT 2(2), 2013. Wavelengths in nm."""

    def lobe(height: float, middle: float, below: float, above: float) -> Array:
        width = np.where(wavelength < middle, below, above)
        return np.asarray(height * np.exp(-0.5 * ((wavelength - middle) * width) ** 2))

    x = lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
    x += lobe(-0.065, 501.1, 0.0490, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z])


def color_of_film(base_ior: float, film_ior: float, thickness: float, cosine: float) -> Array:
    """(3,) Rec. 709, of the reflectance of a film in air for light that is not polarised: Airy's sum with
    Fresnel's amplitudes, wavelength by wavelength."""
    wavelength = np.arange(360.0, 831.0, 1.0)
    inside = np.sqrt(1 - (1 - cosine**2) / film_ior**2)
    below = np.sqrt(1 - (1 - cosine**2) / base_ior**2)
    phase = np.exp(4j * np.pi * film_ior * thickness * inside / wavelength)
    reflectance = np.zeros(len(wavelength))
    for first, second in (
        ((cosine - film_ior * inside) / (cosine + film_ior * inside),
         (film_ior * inside - base_ior * below) / (film_ior * inside + base_ior * below)),
        ((film_ior * cosine - inside) / (film_ior * cosine + inside),
         (base_ior * inside - film_ior * below) / (base_ior * inside + film_ior * below)),
    ):  # fmt: skip
        reflectance += 0.5 * np.abs((first + second * phase) / (1 + first * second * phase)) ** 2
    weights = eye(wavelength)
    seen = (weights * reflectance).sum(axis=1) / weights.sum(axis=1)
    return np.asarray(_TO_REC709 @ (_D65 * seen))


def kernel_film(base_f0: float, film_ior: float, thickness: float, cosine: npt.ArrayLike) -> Array:
    """(N, 3)"""
    c = np.atleast_1d(np.float32(cosine))
    values = {"f0": [base_f0], "ior": [film_ior], "thick": [thickness]}
    body = """ThinFilm film; film.f0 = vec3(f0[0], f0[0], f0[0]);
        film.ior = ior[0]; film.thickness = thick[0];
        Vec3 f = film_reflectance(&film, c[i]); r[i] = f.x; g[i] = f.y; b[i] = f.z;"""
    numbers = {name: np.float32(value) for name, value in values.items()}
    return np.stack(call("thin_film", body, len(c), ("r", "g", "b"), c=c, **numbers), axis=1)


@pytest.mark.parametrize("thickness", [0.0, 80.0, 150.0, 250.0, 330.0, 420.0, 560.0, 800.0, 1500.0])
@pytest.mark.parametrize(("base_ior", "film_ior"), [(1.5, 1.3), (1.5, 2.0), (3.0, 1.6)])
def test_colours_of_films_are_those_of_their_spectrum(
    thickness: float, base_ior: float, film_ior: float
) -> None:
    """Gaussians for the eye, and polarisations that are taken together, leave a few hundredths."""
    base_f0 = ((base_ior - 1) / (base_ior + 1)) ** 2
    for cosine in (1.0, 0.8):
        found = kernel_film(base_f0, film_ior, thickness, cosine)[0]
        expected = color_of_film(base_ior, film_ior, thickness, cosine)
        np.testing.assert_allclose(found, expected, atol=0.035)


def test_films_differ_in_colour() -> None:
    """Those tests would pass for grey."""
    blue, yellow = (color_of_film(1.5, 2.0, thickness, 1.0) for thickness in (210.0, 290.0))
    assert np.ptp(blue) > 0.1 and np.ptp(yellow) > 0.1 and np.argmin(blue) != np.argmin(yellow)


def test_a_film_that_is_no_film_reflects_as_what_is_below() -> None:
    cosine = np.linspace(0.02, 1, 50)
    below = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    across, along = (
        (cosine - 1.5 * below) / (cosine + 1.5 * below),
        (1.5 * cosine - below) / (1.5 * cosine + below),
    )
    expected = np.repeat(((across**2 + along**2) / 2)[:, None], 3, axis=1)
    for film_ior, thickness in ((1.3, 0.0), (1.0, 900.0)):  # nothing, and a film of air
        np.testing.assert_allclose(kernel_film(0.04, film_ior, thickness, cosine), expected, atol=3e-3)


# ---------------------------------------------------------------------------------------------- sheen


def paper_sheen(roughness: float, wo: Array, wi: Array) -> Array:
    """D V cos of Estevez and Kulla 2017, in double precision, without the bound on the albedo."""
    alpha = max(roughness**2, layout.MIN_SHEEN_ALPHA)
    h = wo + wi
    h = h / np.linalg.norm(h, axis=0)
    sine = np.sqrt(np.clip(1 - h[2] ** 2, 0, 1))
    d = (2 + 1 / alpha) * sine ** (1 / alpha) / (2 * np.pi)
    t = (1 - alpha) ** 2
    a, b, c, e, f = (
        t * narrow + (1 - t) * wide
        for narrow, wide in (
            (25.3245, 21.5473), (3.32435, 3.82987), (0.16801, 0.19823), (-1.27393, -1.97760),
            (-4.85967, -4.32054),
        )
    )  # fmt: skip

    def masking(x: Array) -> Array:
        def fitted(y: Array) -> Array:
            return np.asarray(a / (1 + b * y**c) + e * y + f)

        return np.where(x < 0.5, np.exp(fitted(x)), np.exp(2 * fitted(np.asarray(0.5)) - fitted(1 - x)))

    return np.asarray(d / (4 * wo[2] * (1 + masking(wo[2]) + masking(wi[2]))))


@pytest.mark.parametrize("roughness", [0.2, 0.35, 0.6, 1.0])
def test_sheen_is_that_of_its_paper(roughness: float) -> None:
    z, phi, y, psi = (a.astype(np.float64) for a in uniforms(4000, 4, 21))
    wo = direction(np.arccos(0.98 * z + 0.02), 6.3 * phi)
    wi = direction(np.arccos(0.98 * y + 0.02), 6.3 * psi)
    body = """LayeredBsdf s; s.sheen_alpha = MAX(rough[0] * rough[0], MIN_SHEEN_ALPHA);
        s.sheen_color = vec3(1.0f, 0.5f, 0.0f);
        Vec3 f = eval_sheen(&s, vec3(ox[i], oy[i], oz[i]), vec3(ix[i], iy[i], iz[i]), 0.5f, 0.5f);
        r[i] = f.x; g[i] = f.y; b[i] = f.z;"""
    inputs = {f"{p}{c}": np.float32(w[k]) for p, w in (("o", wo), ("i", wi)) for k, c in enumerate("xyz")}
    features = (f"TRAITS {1 << layout.MaterialTrait.SHEEN}u",)
    r, g, b = call("layers", body, 4000, ("r", "g", "b"), features, rough=np.float32([roughness]), **inputs)
    expected = paper_sheen(roughness, wo, wi)
    np.testing.assert_allclose(r, expected, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(g, 0.5 * r, rtol=1e-6)
    assert (b == 0).all()


@pytest.mark.parametrize("row", [6, 12, 20, 31])
def test_albedo_of_sheen(row: int) -> None:
    """By another sum over the hemisphere, of finer steps."""
    last = layout.ALBEDO_TABLE_SIZE - 1
    n, m = 2000, 300
    t = (np.arange(n) + 0.5) / n
    phi = (np.arange(m) + 0.5) * 2 * np.pi / m
    wi = direction(np.arccos(t**2)[:, None], phi[None, :]).reshape(3, -1)
    area = np.repeat(2 * t / n, m) * 2 * np.pi / m
    for column in (2, 6, 14, 24, 31):
        wo = direction(np.arccos(column / last), 0.0)[:, None]
        expected = float((paper_sheen(row / last, wo, wi) * area).sum())
        assert albedo.sheen_table()[row, column] == pytest.approx(expected, rel=0.02, abs=2e-3)


# -------------------------------------------------------------------------------------- stretched GGX


@pytest.mark.parametrize(("row", "step"), [(2, 3), (5, 7), (9, 2), (13, 5)])
def test_albedo_of_stretched_reflections(row: int, step: int) -> None:
    """A and B by a sum over all half vectors, in double precision."""
    across = max((row / (layout.STRETCHED_ROUGHNESSES - 1)) ** 2, layout.MIN_ALPHA)
    along = across + (1 - across) * step / (layout.STRETCHED_STEPS - 1)
    n, m = 1200, 240
    s = (np.arange(n) + 0.5) / n
    t = 1 - (1 - s) ** 2
    radius = np.sqrt(t / (1 - t))
    phi = (np.arange(m) + 0.5) * 2 * np.pi / m
    # Slopes of GGX, stretched; the density of half vectors is D cos.
    x, y = along * radius[:, None] * np.cos(phi), across * radius[:, None] * np.sin(phi)
    h = np.stack([-x, -y, np.ones_like(x)]) / np.sqrt(1 + x**2 + y**2)
    stored = albedo.stretched_rows()[row, step]
    for column in (3, 8, 15):
        cosine = (column / (layout.STRETCHED_COSINES - 1)) ** 2
        for place, azimuth in enumerate(np.arcsin(np.sqrt([1.0, 0.5, 0.0]))):
            wo = direction(np.arccos(cosine), azimuth)
            o_h = np.einsum("i,ijk->jk", wo, h)
            wi = 2 * o_h * h - wo[:, None, None]
            good = (o_h > 0) & (wi[2] > 0)

            def root(w: Array) -> Array:
                return np.asarray(np.sqrt((along * w[0]) ** 2 + (across * w[1]) ** 2 + w[2] ** 2))

            g2 = 2 * wo[2] * wi[2] / (wo[2] * root(wi) + wi[2] * root(wo))
            value = np.where(good, g2 * o_h / (wo[2] * h[2]), 0) * (2 * (1 - s))[:, None]
            schlick = (1 - np.clip(o_h, 0, 1)) ** 5
            expected = [value.mean(), (value * schlick).mean()]
            np.testing.assert_allclose(stored[6 * column + 2 * place :][:2], expected, atol=0.012)


def test_rows_of_what_is_not_stretched_are_those_of_the_plain_table() -> None:
    row = 2 * (layout.STRETCHED_ROUGHNESSES - 1) // 3
    roughness = row / (layout.STRETCHED_ROUGHNESSES - 1)
    plain = albedo.layer_row(Material((1, 1, 1), metallic=1, roughness=roughness))
    cosines = np.linspace(0, 1, layout.STRETCHED_COSINES)[3:] ** 2
    expected = np.interp(
        cosines, np.linspace(0, 1, layout.ALBEDO_TABLE_SIZE), plain[: layout.ALBEDO_TABLE_SIZE]
    )
    for place in range(3):
        found = albedo.stretched_rows()[row, 0][2 * place :: 6][: layout.STRETCHED_COSINES][3:]
        np.testing.assert_allclose(found, expected, atol=0.01)
