"""Pictures under a sky: the sun's light, its place, and how it is sampled."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import SIGNIFICANCE, call, device, direction_p_value, uniforms
from support.pairs import check, session_of, traced_pairs
from support.renders import render
from support.small_scenes import mixed_scene

from incpt.core import layout
from incpt.device.device import Device
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.sky import Sky

SUN_ONLY = Sky(40, air=0, dust=0, ozone=0, ground=0, sun_size=30)


def floor_under(sky: Sky, intensity: float = 1.0, rotation: float = 0.0) -> Scene:
    """A matte plane that fills the picture."""
    floor = Object("floor", shape("plane"), "grey", scale=(50, 1, 50))
    return Scene(
        Camera((0, 5, 0), (0, 0, 0), (0, 0, -1), fov_y=20),
        Environment((1, 1, 1), rotation_y=rotation, intensity=intensity, sky=sky),
        {"grey": Material((0.5, 0.5, 0.5), specular=0)},
        (floor,),
    )


def skied(sky: Sky | None = None, **settings: object) -> Scene:
    sky = Sky(25, sun_size=4) if sky is None else sky
    return mixed_scene(**settings).with_environment(sky=sky, intensity=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("technique", [None, "MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
def test_a_matte_floor_reflects_the_irradiance_of_the_sun(technique: str | None) -> None:
    own = device() if technique is None else Device(features=(technique,))
    expected = 0.5 / math.pi * np.array(SUN_ONLY.sun_irradiance) * math.sin(math.radians(40))
    # The mean of a cosine over a cap is that of its middle times (1 + cos of its radius) / 2.
    expected *= (1 + math.cos(math.radians(15))) / 2
    image = render(floor_under(SUN_ONLY), 4096, (8, 8), own)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
def test_sun_and_sky_add_up(technique: str) -> None:
    sky = Sky(40, sun_size=20)
    pixels = sky.image.pixels[:256].astype(float)
    latitude = np.pi / 2 - (np.arange(256) + 0.5) * np.pi / 512
    weight = np.cos(latitude) * np.sin(latitude) * (np.pi / 512) * (2 * np.pi / 1024)
    received = (pixels * weight[:, None, None]).sum(axis=(0, 1))
    sun = np.array(sky.sun_irradiance) * math.sin(math.radians(40)) * (1 + math.cos(math.radians(10))) / 2
    image = render(floor_under(sky, 0.01), 4096, (8, 8), Device(features=(technique,)))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 0.01 * 0.5 / np.pi * (received + sun), rtol=0.02)


@pytest.mark.parametrize("rotation", [0.0, 130.0])
def test_the_sun_is_seen_where_it_stands(rotation: float) -> None:
    sky = Sky(20, sun_size=6)
    angle = math.radians(rotation)
    towards = np.array([math.sin(angle) * math.cos(math.radians(20)), math.sin(math.radians(20)),
                        math.cos(angle) * math.cos(math.radians(20))])  # fmt: skip
    camera = Camera((0, 0, 0), tuple(towards.tolist()), fov_y=12)
    scene = Scene(camera, Environment((1, 1, 1), rotation_y=rotation, sky=sky))
    image = render(scene, 64, (96, 96))
    y, x = np.mgrid[:96, :96] + 0.5
    away = np.hypot(x - 48, y - 48) / 48 * math.tan(math.radians(6))
    inside, outside = away < math.tan(math.radians(2.85)), away > math.tan(math.radians(3.15))
    around = sky.image.pixels[int((90 - 20) / 180 * 512), 512]
    # Beside the sun's 10^5 the sky about it is next to nothing.
    np.testing.assert_allclose(
        image[inside], np.tile(np.add(sky.sun_radiance, around), (inside.sum(), 1)), rtol=0.02
    )
    assert image[outside].max() < 3 * around.max()


def test_directions_towards_the_sun_are_spread_evenly() -> None:
    params = np.zeros(1, layout.PARAMS)
    sky = Sky(35, sun_size=60)
    params["sun_direction"], params["sun_chord"] = sky.sun_direction, sky.sun_chord
    u, v = uniforms(1 << 17, 2, 5)
    body = """
    const Params own = params[0];
    Uniform2 uv = {u[i], v[i]};
    Vec3 w = sample_sun(&own, uv);
    x[i] = w.x; y[i] = w.y; z[i] = w.z; m[i] = (float)meets_sun(&own, w); p[i] = sun_pdf(&own);"""
    x, y, z, meets, pdf = call(
        "sun", body, len(u), ("x", "y", "z", "m", "p"), ("SUN",), params=params, u=u, v=v
    )
    directions = np.array([x, y, z])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=0), 1, atol=1e-6)
    assert meets.mean() > 0.999
    cosine = math.cos(math.radians(30))

    def density(d: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.where(np.array(sky.sun_direction) @ d > cosine, float(pdf[0]), 0.0)

    p_value, total = direction_p_value(directions, np.ones(len(u), np.bool_), density, subdivision=64)
    assert p_value > SIGNIFICANCE and total == pytest.approx(1, abs=2e-3)


def test_a_true_sun_has_no_noise_to_speak_of() -> None:
    """Light sampling finds half a degree, which no chance would."""
    sky = replace(SUN_ONLY, sun_size=0.545)
    image = render(floor_under(sky), 16, (16, 16))
    expected = 0.5 / math.pi * np.array(sky.sun_irradiance) * math.sin(math.radians(40))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=1e-2)
    # Nine in ten samples look for it.
    assert image.std() < 0.12 * image.mean()


@pytest.mark.slow
@pytest.mark.parametrize("sky", [Sky(25, sun_size=4), Sky(25, sun_disc=False)], ids=["sun", "no sun"])
def test_blocks_and_wavefront_agree(sky: Sky) -> None:
    scene, images = skied(sky, size=(53, 37), base_nor=8), []
    for in_blocks in (True, False):
        session = session_of(device(), scene, in_blocks, 8)
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "sky", [Sky(60), Sky(25, sun_size=9), Sky(25, sun_disc=False), Sky(-4), None], ids=str
)
def test_another_sky_starts_the_picture_over(sky: Sky | None) -> None:
    scene = skied(base_nor=4, strategy="spiral")
    session = Session(scene, device=device())
    session.render(4)
    session.edit(scene.with_object("red cube", position=(0.2, 0.5, 0)))
    session.step()
    session.edit(session.scene.with_environment(sky=sky, rotation_y=40))
    assert session.mode is Mode.BASE
    session.render(4)
    fresh = Session(replace(session.scene), settings=session.settings, device=device())
    fresh.render(4)
    np.testing.assert_array_equal(session.image(), fresh.image())


def test_tables_are_made_anew_for_the_air_alone() -> None:
    scene = skied()
    session = Session(scene, device=device())
    first = session._tables.environment
    session.edit(scene.with_environment(sky=Sky(25, sun_size=9, sun_intensity=2)))
    assert session._tables.environment is first and "SUN" in session._tables.variant
    session.edit(scene.with_environment(sky=Sky(26)))
    assert session._tables.environment is not first
    session.edit(scene.with_environment(sky=Sky(26, sun_disc=False)))
    assert "SUN" not in session._tables.variant and session._tables.sun_probability == 0


@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
def test_pairs_of_paths_have_the_same_sun(in_blocks: bool) -> None:
    scene = skied()
    moved = scene.with_object("red cube", position=(0.15, 0.5, -0.1))
    check(traced_pairs(device(), scene, moved, in_blocks), 0.5)
