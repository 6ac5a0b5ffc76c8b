"""Skies: against published values, Blender's, and what follows from the formulas."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from incpt.core.errors import InputError
from incpt.scene import sky as model
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.model import Scene
from incpt.scene.sky import HEIGHT, WIDTH, Sky

LUMENS_PER_WATT = 683.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
AIRLESS = Sky(air=0, dust=0, ozone=0, sun_elevation=50, ground=0)


def seen(sky: Sky, elevation: float, azimuth: float) -> np.ndarray:
    """Radiance of the image in a direction; azimuths count from the sun's, degrees."""
    row = int((90 - elevation) / 180 * HEIGHT)
    return sky.image.pixels[row, int((0.5 + azimuth / 360) * WIDTH) % WIDTH]


def test_the_sun_outside_of_the_atmosphere_is_as_bright_as_measured() -> None:
    # The luminous solar constant: 128 klx (Allen, Astrophysical Quantities) to 134 klx (Darula et al. 2005).
    assert 126e3 < LUMENS_PER_WATT * (LUMINANCE @ AIRLESS.sun_irradiance) < 134e3
    assert not AIRLESS.image.pixels.any()


def test_air_scatters_as_measured() -> None:
    # Vertical optical depth of air at 550 nm: 0.0973 (Bucholtz 1995). Ozone's at 600 nm: 0.0385 at 300 DU.
    columns = model._columns(np.array([0.0, 6.36e6]), np.array([0.0, 1.0]))
    depths = columns[:, None] * model._extinctions()
    at = {w: i for i, w in enumerate(model._WAVELENGTHS.tolist())}
    middle = (depths[0, at[540]] * depths[0, at[560]]) ** 0.5
    assert middle == pytest.approx(0.0973, rel=0.03)
    assert depths[2, at[600]] == pytest.approx(5.02e-25 * 8.07e22, rel=0.03)


def test_the_way_through_air_at_the_horizon_is_that_of_chapman() -> None:
    # The column along the horizon by that overhead: sqrt(pi R / 2 H) for an exponential atmosphere.
    overhead, along = (
        model._columns(np.array([0.0, 6.36e6]), np.array(way)) for way in ([0.0, 1.0], [1.0, 0.0])
    )
    assert along[0] / overhead[0] == pytest.approx(math.sqrt(math.pi * 6.36e6 / 2 / 8e3), rel=0.03)
    assert (model._columns(np.array([0.0, 6.36e6]), np.array([0.8, -0.6])) > 1e12).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sky", "elevation", "azimuth", "blender"),
    [
        (Sky(60), 60, 90, (1.441, 2.031, 3.419)),
        (Sky(60), 60, 180, (0.930, 1.438, 2.585)),
        (Sky(60), 30, 90, (1.433, 2.197, 3.729)),
        (Sky(15), 60, 90, (0.602, 0.958, 1.579)),
        (Sky(15), 60, 180, (0.587, 0.956, 1.595)),
        (Sky(15), 30, 90, (0.961, 1.502, 2.312)),
        (Sky(2), 60, 90, (0.265, 0.375, 0.480)),
        (Sky(2), 30, 90, (0.441, 0.600, 0.697)),
        (Sky(15, dust=0, ozone=0), 30, 90, (1.111, 1.670, 2.415)),
        (Sky(15, dust=5), 60, 90, (0.678, 0.951, 1.450)),
        (Sky(30, air=2, ozone=3, altitude=2000), 60, 180, (0.770, 1.339, 2.341)),
        (Sky(30, air=2, ozone=3, altitude=2000), 30, 90, (1.363, 2.284, 3.607)),
    ],
)
def test_skies_are_those_of_blender(
    sky: Sky, elevation: float, azimuth: float, blender: tuple[float, ...]
) -> None:
    # Read off panoramas of Blender 4.5 (sky texture "Nishita", no sun). Towards the horizon and the sun its
    # integrals, of 32 steps of equal length, are up to a tenth too low.
    np.testing.assert_allclose(seen(sky, elevation, azimuth), blender, rtol=0.1)
    assert LUMINANCE @ seen(sky, elevation, azimuth) == pytest.approx(LUMINANCE @ blender, rel=0.07)


@pytest.mark.slow
def test_integrals_have_converged(monkeypatch: pytest.MonkeyPatch) -> None:
    skies = [Sky(15), Sky(40, dust=4), Sky(3)]
    usual = [sky.image.pixels[: HEIGHT // 2].astype(float) for sky in skies]
    model._image.cache_clear()
    for name, value in {"_VIEW_STEPS": 96, "_SUN_STEPS": 48, "_ELEVATIONS": 112, "_AZIMUTHS": 13}.items():
        monkeypatch.setattr(model, name, value)
    for sky, before in zip(skies, usual, strict=True):
        finer = sky.image.pixels[: HEIGHT // 2]
        assert np.abs(before - finer).mean() < 3e-3 * finer.mean()
        assert np.abs(before - finer).max() < 0.02 * finer.max()
    model._image.cache_clear()


@pytest.mark.slow
def test_a_sky_is_even_and_its_colours_are_those_of_the_day() -> None:
    for elevation in (70, 20, 1, -3, -90):
        pixels = Sky(elevation).image.pixels
        np.testing.assert_allclose(pixels, pixels[:, ::-1], rtol=1e-3, atol=1e-6)
        assert np.isfinite(pixels).all()
    noon, dusk = seen(Sky(60), 80, 180), seen(Sky(0), 3, 0)
    assert noon[2] > 1.5 * noon[0] and dusk[0] > 3 * dusk[2]
    # Without ozone a sky at dusk is not blue overhead.
    assert seen(Sky(-2), 88, 0)[2] / seen(Sky(-2), 88, 0)[0] > 1.3 * (
        seen(Sky(-2, ozone=0), 88, 0)[2] / seen(Sky(-2, ozone=0), 88, 0)[0]
    )


def test_the_ground_reflects_what_it_gets() -> None:
    sky = Sky(40, ground=0.5)
    pixels = sky.image.pixels.astype(float)
    latitude = np.pi / 2 - (np.arange(HEIGHT // 2) + 0.5) * np.pi / HEIGHT
    weight = np.cos(latitude) * np.sin(latitude) * (np.pi / HEIGHT) * (2 * np.pi / WIDTH)
    received = (pixels[: HEIGHT // 2] * weight[:, None, None]).sum(axis=(0, 1))
    received = received + math.sin(math.radians(40)) * np.array(sky.sun_irradiance)
    np.testing.assert_allclose(pixels[-1, 0], 0.5 / np.pi * received, rtol=1e-4)
    assert not Sky(40, ground=0).image.pixels[HEIGHT // 2 :].any()


def test_a_larger_sun_is_dimmer_and_as_strong() -> None:
    small, large = Sky(30, sun_size=0.5), Sky(30, sun_size=10)
    assert small.sun_irradiance == large.sun_irradiance
    for sky in (small, large):
        solid_angle = 2 * math.pi * (1 - math.cos(math.radians(sky.sun_size) / 2))
        np.testing.assert_allclose(np.multiply(sky.sun_radiance, solid_angle), sky.sun_irradiance, rtol=1e-9)
    assert small.image is large.image is replace(small, sun_disc=False, sun_intensity=3).image
    assert replace(small, sun_intensity=3).sun_irradiance == pytest.approx(
        [3 * c for c in small.sun_irradiance]
    )


def test_the_sun_sets() -> None:
    strengths = [sum(Sky(e, sun_size=2).sun_irradiance) for e in (3, 1.01, 0.5, 0, -0.5, -0.99, -1.01)]
    assert strengths == sorted(strengths, reverse=True) and strengths[-1] == 0 < strengths[-2]
    half = [sum(Sky(e, sun_size=2, air=0, dust=0, ozone=0).sun_irradiance) for e in (5, 0)]
    assert half[1] == pytest.approx(half[0] / 2)
    assert Sky(3).has_sun and not Sky(-3).has_sun
    assert not Sky(sun_disc=False).has_sun and not Sky(sun_intensity=0).has_sun


def test_what_changes_with_a_sky() -> None:
    scene = Scene(environment=Environment((1, 1, 1), sky=Sky(30)))
    other = scene.with_environment(sky=Sky(30, sun_size=3))
    assert diff(scene, other).environment and not diff(scene, other).environment_image
    for changed in (Sky(31), Sky(30, sun_disc=False), None):
        change = diff(scene, scene.with_environment(sky=changed))
        assert change.environment_image and change.is_global
    assert not diff(scene, scene.with_environment(sky=Sky(30))).is_global


def test_an_image_and_a_sky_take_each_others_place() -> None:
    image = Image(np.ones((2, 4, 3), np.float32))
    with pytest.raises(InputError, match=r"^sky: there is an image too"):
        Environment((1, 1, 1), image, sky=Sky())
    scene = Scene(environment=Environment((1, 1, 1), image))
    with_sky = scene.with_environment(sky=Sky())
    assert with_sky.environment.sky == Sky() and with_sky.environment.image is None
    assert with_sky.with_environment(image=image).environment == scene.environment
    assert with_sky.with_environment(intensity=2).environment.sky == Sky()


@pytest.mark.parametrize(
    ("name", "value"),
    [("sun_elevation", 91), ("sun_size", 0), ("sun_intensity", -1), ("altitude", -1), ("air", 11),
     ("dust", None), ("ozone", float("nan")), ("ground", 1.1), ("sun_disc", 1)],
)  # fmt: skip
def test_every_field_is_checked(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: "):
        Sky(**{name: value})
