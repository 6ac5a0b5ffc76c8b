"""Emitters: how much light comes from where."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from support.mitsuba_files import read, told, write_image

from incpt.core import affine
from incpt.formats import images
from incpt.formats.import_report import Fate
from incpt.formats.lat_long import turned as turned_image
from incpt.picture.spectra import blackbody_color, emitted_color
from incpt.scene.environment import Environment

Array = npt.NDArray[np.float64]


def emitter(kind: str, content: str) -> str:
    return f'<emitter type="{kind}">{content}</emitter>'


def rgb(name: str, value: str) -> str:
    return f'<rgb name="{name}" value="{value}"/>'


def test_points(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path, emitter("point", rgb("intensity", "2 3 4") + '<point name="position" x="1" y="2" z="3"/>')
    )
    (light,) = scene.lights
    assert (light.kind, light.position, light.has_size) == ("point", (1, 2, 3), False)
    np.testing.assert_allclose(light.emitted, [2, 3, 4])


def test_spots_shine_along_z(tmp_path: Path) -> None:
    content = (
        rgb("intensity", "2 3 4")
        + '<float name="cutoff_angle" value="30"/><float name="beam_width" value="{}"/>'
        '<transform name="to_world"><lookat origin="0 5 0" target="3 1 0" up="0 0 1"/></transform>'
    )
    scene, report = read(tmp_path, emitter("spot", content.format(30)))
    (light,) = scene.lights
    np.testing.assert_allclose(light.emitted, [2, 3, 4])
    np.testing.assert_allclose(-light.axes[2], [0.6, -0.8, 0], atol=1e-9)
    assert (light.spot_angle, light.spot_blend) == (60, 0) and not told(report, Fate.CHANGED)[1:]
    soft, report = read(tmp_path, emitter("spot", content.format(15)))
    assert soft.lights[0].spot_blend == 0.5
    np.testing.assert_allclose(soft.lights[0].emitted, [2, 3, 4])
    assert any("not linearly" in text for text in told(report, Fate.CHANGED))


def test_light_from_far_away(tmp_path: Path) -> None:
    given = rgb("irradiance", "2 3 4") + '<vector name="direction" x="3" y="-4" z="0"/>'
    turned = rgb("irradiance", "2 3 4") + (
        '<transform name="to_world"><lookat origin="0 0 0" target="3 -4 0" up="0 0 1"/></transform>'
    )
    for content in (given, turned):
        (light,) = read(tmp_path, emitter("directional", content))[0].lights
        assert light.kind == "sun" and not light.has_size
        np.testing.assert_allclose(-light.axes[2], [0.6, -0.8, 0], atol=1e-9)
        np.testing.assert_allclose(light.emitted, [2, 3, 4])


def test_area_lights_are_materials_that_shine(tmp_path: Path) -> None:
    lamp = emitter("area", rgb("radiance", "5 6 7"))
    scene, _ = read(tmp_path, f'<shape type="sphere">{lamp}</shape>')
    material = scene.materials["sphere"]
    # Without a BSDF a lamp reflects nothing.
    assert (material.emission, material.base_color, material.double_sided) == ((5, 6, 7), (0, 0, 0), False)
    white = '<bsdf type="diffuse" id="white"/>'
    scene, _ = read(
        tmp_path,
        f'{white}<shape type="cube" id="lamp"><ref id="white"/>{lamp}</shape>'
        '<shape type="cube"><ref id="white"/></shape>',
    )
    assert scene.materials["lamp"].emission == (5, 6, 7) and scene.materials["lamp"].base_color == (0.5,) * 3
    assert not scene.materials["white"].is_emissive
    write_image(tmp_path / "e.png", np.full((2, 2, 3), 99))
    image = '<texture type="bitmap" name="radiance"><string name="filename" value="e.png"/></texture>'
    scene, _ = read(tmp_path, f'<shape type="sphere">{emitter("area", image)}</shape>')
    assert scene.materials["sphere"].emission == (1, 1, 1)
    assert scene.materials["sphere"].emission_texture is not None


def test_colours_of_light(tmp_path: Path) -> None:
    def radiance(content: str) -> tuple[float, ...]:
        return read(tmp_path, emitter("constant", content))[0].environment.radiance

    assert radiance("") == (1, 1, 1)
    assert radiance('<float name="radiance" value="2"/>') == (2, 2, 2)
    # The same at all wavelengths is not the white of displays.
    flat = radiance('<spectrum name="radiance" value="2"/>')
    np.testing.assert_allclose(flat, 2 * emitted_color((300, 900), (1, 1)))
    np.testing.assert_allclose(radiance('<spectrum name="radiance" value="300:2, 900:2"/>'), flat, rtol=1e-9)
    listed = '<string name="values" value="2, 2"/><{0} name="wavelength{1}" value="{2}"/>'
    regular = listed.format("float", "_min", 300) + '<float name="wavelength_max" value="900"/>'
    for kind, content in (("irregular", listed.format("string", "s", "300, 900")), ("regular", regular)):
        spectrum = f'<spectrum type="{kind}" name="radiance">{content}</spectrum>'
        np.testing.assert_allclose(radiance(spectrum), flat, rtol=1e-9)
    black = '<spectrum type="blackbody" name="radiance"><float name="temperature" value="3000"/></spectrum>'
    np.testing.assert_allclose(radiance(black), blackbody_color(3000))


def lookup(environment: Environment, direction: Array) -> Array:
    """The radiance that comes from a direction: the pixel there."""
    picture = environment.picture
    assert picture is not None
    local = affine.rotation_matrix((0.0, environment.rotation_y, 0.0)).T @ direction
    height, width = picture.pixels.shape[:2]
    column = int((0.5 - math.atan2(local[0], local[2]) / (2 * math.pi)) * width) % width
    row = min(int(math.acos(np.clip(local[1], -1, 1)) / math.pi * height), height - 1)
    return np.asarray(picture.pixels[row, column] * np.array(environment.radiance))


@pytest.mark.parametrize(
    "turn",
    ["", '<rotate y="1" angle="70"/>', '<rotate x="1" angle="90"/><rotate z="1" angle="40"/>',
     '<rotate y="1" angle="-180"/><matrix value="0 0 -1 1 0 0 -1 0 0"/>', '<scale x="-1"/>'],
)  # fmt: skip
def test_environments_are_turned_as_theirs(turn: str, tmp_path: Path) -> None:
    if "matrix" in turn:
        turn = turn.replace("0 0 -1 1 0 0 -1 0 0", "0 0 -1 -1 0 0 0 1 0")
    pixels = np.zeros((32, 64, 3), np.float32)
    pixels[4:8, 9:15] = [8, 4, 2]
    images.write_exr(tmp_path / "e.exr", {"RGB": pixels})
    scene, _ = read(
        tmp_path,
        emitter(
            "envmap",
            '<string name="filename" value="e.exr"/><float name="scale" value="0.5"/>'
            f'<transform name="to_world">{turn}</transform>',
        ),
    )
    steps, _ = read(tmp_path, f'<shape type="cube"><transform name="to_world">{turn}</transform></shape>')
    matrix = steps.objects[0].world_from_object[:, :3]
    # Mitsuba's own convention: u is the angle from -z to +x ... over a turn, v that from +y ("envmap.cpp").
    u, v = 12 / 64, 6 / 32
    phi, theta = u * 2 * math.pi, v * math.pi
    local = np.array([math.sin(phi) * math.sin(theta), math.cos(theta), -math.cos(phi) * math.sin(theta)])
    np.testing.assert_allclose(lookup(scene.environment, matrix @ local), [4, 2, 1], rtol=1e-5)
    np.testing.assert_allclose(lookup(scene.environment, -(matrix @ local)), 0, atol=1e-6)


def test_a_turned_image_keeps_its_light() -> None:
    pixels = np.random.default_rng(3).random((48, 96, 3)).astype(np.float32)
    turned = turned_image(pixels, affine.rotation_matrix((40.0, 20.0, 70.0)))

    def light(image: npt.NDArray[np.float32]) -> Array:
        weights = np.sin((np.arange(48) + 0.5) * np.pi / 48)[:, None, None]
        return np.asarray((image * weights).mean(axis=(0, 1)) / weights.mean())

    np.testing.assert_allclose(light(turned), light(pixels), rtol=0.01)


def test_a_sky_stands_where_its_sun_is_told(tmp_path: Path) -> None:
    scene, report = read(
        tmp_path,
        emitter(
            "sunsky",
            '<vector name="sun_direction" x="0.6" y="0.8" z="0"/>'
            '<transform name="to_world"><rotate x="1" angle="-90"/></transform>',
        ),
    )
    # The zenith is y, and the sun stands 53 degrees high over +x.
    (sun,) = scene.lights
    np.testing.assert_allclose(sun.axes[2], [0.6, 0.8, 0], atol=1e-9)
    assert scene.environment.sky is not None
    assert scene.environment.sky.sun_elevation == pytest.approx(math.degrees(math.asin(0.8)))
    assert scene.environment.rotation_y == pytest.approx(90)
    assert any("another model" in text for text in told(report, Fate.CHANGED))


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    body = (
        emitter("projector", "") + emitter("envmap", '<string name="filename" value="none.exr"/>')
        + emitter("constant", "") + emitter("constant", "")
    )  # fmt: skip
    scene, report = read(tmp_path, body)
    projector, missing, second = told(report)
    assert "projector emitter" in projector and "none.exr: no such file" in missing and "another" in second
    assert scene.environment.radiance == (1, 1, 1)
