"""Lights that are objects of their own: what they bring to a floor, by hand, and how rays meet them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import integrate
from support.kernels import device
from support.renders import assert_same_mean, blocks, render, repeat

from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

Array = npt.NDArray[np.float64]
GREY = Material((0.5, 0.5, 0.5), specular=0)
DOWN = (-90, 0, 0)
"""The rotation of a light that shines down."""


def over_floor(*lights: Light, objects: tuple[Object, ...] = (), extent: float = 1.0) -> Scene:
    """A grey floor at y = 0, seen from straight above in a square of 2 x 2 m times `extent`; row 0 is at
    z = -extent."""
    camera = Camera(position=(0, extent, 0), target=(0, 0, 0), up=(0, 0, -1), fov_y=90)
    floor = Object("floor", shape("plane"), "floor", scale=(100 * extent, 1, 100 * extent))
    return Scene(camera, Environment(), {"floor": GREY}, (floor, *objects), lights=lights)


def points(size: int = 32, extent: float = 1.0) -> Array:
    """(size, size, 3) under the pixel centres of `over_floor`."""
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * extent
    return np.stack(np.broadcast_arrays(x[None, :], 0.0, x[:, None]), axis=2)


def irradiance(light: Light, at: Array) -> Array:
    """(...) on a floor that looks up, at points (..., 3), for a light that is white and wholly above it."""
    to_light = np.asarray(light.position) - at
    d2 = (to_light**2).sum(axis=-1)
    emitted = light.emitted[0]
    if light.kind == "sun":
        factor = 1.0 if not light.has_size else light.face
        return np.full(d2.shape, emitted * factor * light.axes[2][1])
    cosine = to_light[..., 1] / np.sqrt(d2)
    if light.kind in ("point", "sphere"):
        area = np.pi * light.half_size[0] ** 2 if light.has_size else 1.0
        return np.asarray(emitted * area * cosine / d2)
    if light.kind == "spot":
        assert not light.has_size
        inner, outer = light.cone
        along = np.einsum("...i,i", to_light, light.axes[2]) / np.sqrt(d2)
        t = np.clip((along - outer) / max(inner - outer, 1e-9), 0, 1)
        return np.asarray(emitted * t**2 * (3 - 2 * t) * cosine / d2)
    # Flat ones: the midpoint rule over their surface.
    u = (np.arange(200) + 0.5) / 100 - 1
    a, b = (v.ravel() for v in np.meshgrid(u, u))
    if light.kind == "disk":
        inside = a**2 + b**2 <= 1
        a, b = a[inside], b[inside]
    x, y, z = light.axes
    on_light = light.position + a[:, None] * light.half_size[0] * x + b[:, None] * light.half_size[1] * y
    result = np.zeros(at.shape[:-1])
    for place in np.ndindex(result.shape):
        way = on_light - at[place]
        squared = (way**2).sum(axis=1)
        shining = np.maximum(way @ z, 0)
        result[place] = np.mean(shining * np.maximum(way[:, 1], 0) / squared**2)
    return result * emitted * light.area


CASES = {
    "point": Light("l", "point", (0.2, 1.5, -0.1), radius=0, power=100),
    "ball": Light("l", "point", (0.3, 1.2, 0.1), radius=0.7, power=100),
    "small ball": Light("l", "point", (0.3, 1.2, 0.1), radius=0.004, power=100),
    "sphere": Light("l", "sphere", (-0.3, 1.5, 0.1), radius=0.4, radiance=10, scale=(2, 1, 0.5)),
    "spot": Light("l", "spot", (0, 1.5, 0), DOWN, radius=0, spot_angle=50, spot_blend=0.5, power=30),
    "sharp spot": Light("l", "spot", (0.5, 1.5, 0), (-70, 0, 0), radius=0, spot_angle=70, spot_blend=0),
    "rectangle": Light("l", "rectangle", (0.3, 2, 0.2), (-100, 10, 20), size=(3, 0.2), power=50),
    "near rectangle": Light("l", "rectangle", (0, 0.5, 0), DOWN, size=(1.5, 1.0), radiance=2),
    "small rectangle": Light("l", "rectangle", (0.1, 1, 0), (-80, 0, 0), size=(0.01, 0.02), power=5),
    "disk": Light("l", "disk", (-0.3, 1, 0.2), (-80, 0, 5), (1, 2, 1), radius=0.3, power=50),
    "sun": Light("l", "sun", rotation=(-50, 20, 0), irradiance=5),
    "wide sun": Light("l", "sun", rotation=(-70, 20, 0), angle=20, irradiance=5),
    "point sun": Light("l", "sun", rotation=(-50, 20, 0), angle=0, irradiance=5),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_floor_under_a_light(name: str) -> None:
    light, kind = CASES[name], CASES[name].kind
    # What is seen of the light itself, and its shadows on itself, are no part of it.
    scene = over_floor(replace(light, camera_visible=False))
    image = render(scene, 256, max_bounces=0)
    finer = 1 if kind in ("rectangle", "disk") else 16  # edges of cones need it
    expected = irradiance(light, points(32 * finer)) * 0.5 / np.pi
    assert expected.max() > 0
    squares = blocks(expected[..., None] * np.ones(3), 4 * finer)
    np.testing.assert_allclose(blocks(image, 4), squares, rtol=0.03, atol=0.01 * squares.max())
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected.mean(), rtol=4e-3)


@pytest.mark.parametrize("kind", ["point", "sphere", "spot", "rectangle", "disk"])
@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_power_comes_out(kind: str, radius: float) -> None:
    """The light through a sphere around a lamp is its power."""
    if radius == 0 and kind not in ("point", "spot"):
        pytest.skip("these have a size")
    light = Light("l", kind, power=70, radius=radius, size=(0.3, 0.1), color=(1, 0.5, 0), spot_blend=0.4)
    assert light.watts == pytest.approx((70, 35, 0))
    # From far away intensity is radiance times the face that is seen, at an angle from -z.
    if light.kind in ("rectangle", "disk"):

        def intensity(angle: float) -> float:
            return max(np.cos(angle), 0) * light.emitted[0] * light.area
    else:
        inner, outer = light.cone if kind == "spot" else (-2, -3)

        def intensity(angle: float) -> float:
            t = np.clip((np.cos(angle) - outer) / (inner - outer), 0, 1)
            return float(t * t * (3 - 2 * t) * light.emitted[0] * (light.face if light.has_size else 1))

    total, _ = integrate.quad(lambda a: intensity(a) * 2 * np.pi * np.sin(a), 0, np.pi, points=[np.pi / 6])
    assert total == pytest.approx(70, rel=1e-4)


def camera_at(*lights: Light, environment: Environment | None = None) -> Scene:
    return Scene(
        Camera((0, 0, 3), (0, 0, 0), fov_y=40), environment or Environment(), {"floor": GREY},
        (Object("behind", shape("cube"), "floor", (0, 0, -3), scale=(20, 20, 1)),), lights=lights,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("light", "seen"),
    [
        (Light("l", "sphere", radius=0.5, radiance=3), True),
        (Light("l", "point", radius=0.5, radiance=3), True),
        (Light("l", "rectangle", rotation=(0, 180, 0), radiance=3), True),
        (Light("l", "rectangle", rotation=(0, 180, 0), radiance=3, casts_shadows=False), True),
        (Light("l", "rectangle", radiance=3), False),
        (Light("l", "rectangle", radiance=3, double_sided=True), True),
        (Light("l", "disk", rotation=(0, 180, 0), radius=0.5, radiance=3), True),
        (Light("l", "disk", rotation=(0, 180, 0), radius=0.5, radiance=3, camera_visible=False), False),
        (Light("l", "sphere", radius=0.5, radiance=3, visible=False), False),
        (Light("l", "spot", rotation=(0, 180, 0), radius=0.5, radiance=3, spot_angle=40), True),
        (Light("l", "spot", radius=0.5, radiance=3, spot_angle=40), False),
        (Light("l", "sphere", position=(0, 0, 3), radius=0.9, radiance=3), False),
    ],
    ids=lambda value: f"{value.kind} {value.casts_shadows}" if isinstance(value, Light) else "",
)
def test_lights_that_the_camera_sees(light: Light, seen: bool) -> None:
    image = render(camera_at(light), 16, max_bounces=0)
    middle = image[14:18, 14:18]
    if seen:
        np.testing.assert_allclose(middle, 3, rtol=1e-5)
    else:
        # A wall far behind, lit or not.
        assert middle.max() < 1


def test_sun_is_seen_in_the_sky() -> None:
    sun = Light("l", "sun", rotation=(0, 180, 0), angle=10, irradiance=2)
    scene = replace(camera_at(sun, environment=Environment((0.1, 0.1, 0.1))), objects=())
    scene = replace(scene, camera=Camera((0, 0, 0), (0, 0, -1), fov_y=40))
    image = render(scene, 64)
    np.testing.assert_allclose(image[15:17, 15:17], 0.1 + sun.emitted[0], rtol=1e-5)
    np.testing.assert_allclose(image[:8], 0.1, rtol=1e-6)
    share = np.pi * np.tan(np.radians(5)) ** 2 / (2 * np.tan(np.radians(20))) ** 2
    np.testing.assert_allclose((image - 0.1).mean(), sun.emitted[0] * share, rtol=0.01)
    hidden = scene.with_light("l", camera_visible=False)
    np.testing.assert_allclose(render(hidden, 4), 0.1, rtol=1e-6)


def test_shadows() -> None:
    roof = Object("roof", shape("cube"), "floor", (0, 0.3, 0), scale=(0.5, 0.01, 0.5))
    for light in (
        Light("l", "point", (0, 0.8, 0), radius=0.01, power=10, camera_visible=False),
        Light("l", "rectangle", (0, 0.8, 0), DOWN, size=(0.05, 0.05), power=10, camera_visible=False),
        Light("l", "sun", rotation=DOWN, irradiance=3, camera_visible=False),
        Light("l", "spot", (0, 0.8, 0), DOWN, radius=0, power=10, spot_angle=150),
    ):
        scene = over_floor(light, objects=(roof,))
        below = scene.with_camera(position=(0.0, 0.1, 0.0), target=(0, 0, 0))
        dark, lit = render(below, 16, max_bounces=0), render(scene, 16, max_bounces=0)
        assert dark.max() == 0 < lit[0, 0].min()
        shadowless = below.with_light("l", casts_shadows=False)
        expected = render(replace(shadowless, objects=scene.objects[:1]), 16, max_bounces=0)
        np.testing.assert_allclose(render(shadowless, 16, max_bounces=0), expected, rtol=1e-4)
        assert expected.min() > 0


def test_a_light_hides_what_is_behind_it() -> None:
    """From its shining side; from the other one it is not there."""
    front = Light("front", "rectangle", (0, 0.5, 0), DOWN, size=(9, 9), radiance=1e-6)
    lamp = Light("lamp", "point", (0, 1, 0), radius=0.1, power=100)
    assert render(over_floor(front, lamp), 16, max_bounces=0).max() < 1e-5
    turned = over_floor(front, lamp).with_light("front", rotation=(90, 0, 0))
    np.testing.assert_allclose(
        render(turned.with_camera(position=(0, 0.4, 0)), 64, max_bounces=0),
        render(over_floor(lamp).with_camera(position=(0, 0.4, 0)), 64, max_bounces=0), rtol=0.02,
    )  # fmt: skip


def plates(*lights: Light, sky: bool = False) -> Scene:
    """Glossy plates, on which both techniques count, under lights; and a lamp of triangles."""
    pixels = np.full((16, 32, 3), [0.2, 0.3, 0.4], np.float32)
    pixels[3:6, 8:14] = [6, 5, 4]
    materials = {
        "metal": Material((0.9, 0.8, 0.7), metallic=1, roughness=0.25),
        "plastic": Material((0.3, 0.5, 0.2), roughness=0.5),
        "lamp": Material((0, 0, 0), specular=0, emission=(9, 8, 7)),
    }
    objects = (
        Object("floor", shape("plane"), "plastic", scale=(9, 1, 9)),
        Object("plate", shape("cube"), "metal", (0, 0.4, -0.4), (40, 0, 0), (2, 0.1, 1.2)),
        Object("lamp", shape("plane"), "lamp", (1.3, 1.2, 0), (0, 0, 120), (0.3, 1, 0.3)),
    )
    environment = Environment((0.3, 0.3, 0.3), Image(pixels)) if sky else Environment()
    return Scene(Camera((0, 1, 2.4), (0, 0.4, 0), fov_y=45), environment, materials, objects, lights=lights)


FOUND = {
    "rectangle": Light("l", "rectangle", (-0.5, 1.3, -0.6), (-60, 0, 0), size=(0.8, 0.3), radiance=8),
    "disk": Light("l", "disk", (-0.5, 1.3, -0.6), (-60, 0, 0), radius=0.3, radiance=8),
    "ball": Light("l", "point", (-0.4, 1.1, -0.4), radius=0.25, radiance=8),
    "spot": Light("l", "spot", (-0.4, 1.3, -0.4), (-60, 0, 0), radius=0.2, radiance=20, spot_angle=100),
    "sun": Light("l", "sun", rotation=(-40, 190, 0), angle=15, irradiance=1),
    "hidden": Light("l", "sphere", (0, 0.9, 0.3), radius=0.2, radiance=8, camera_visible=False),
}


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
@pytest.mark.parametrize(
    "names",
    [
        *FOUND,
        "rectangle,ball,sun",
        pytest.param("disk,spot,sky", marks=pytest.mark.statistics),
        pytest.param("glass,ball,sky", marks=pytest.mark.statistics),
    ],
)
def test_each_technique_alone_gives_the_same(names: str, technique: str) -> None:
    chosen = [replace(FOUND[name], name=name) for name in names.split(",") if name in FOUND]
    scene = plates(*chosen, sky="sky" in names)
    if "glass" in names:
        frosted = Material((0.9, 1, 0.9), transmission=1, roughness=0.4, absorption=(1, 0, 1))
        ball = Object("frosted", shape("cube"), "glass", (0.7, 0.4, 0.5), (0, 30, 0), (0.5, 0.8, 0.3))
        scene = scene.with_material("glass", **vars(frosted)).with_added(ball)
    arguments: dict[str, Any] = {"max_bounces": 2, "transmission_bounces": 4, "size": (32, 32)}
    both = repeat(scene, 64, **arguments)
    alone = repeat(scene, 256, on=Device(features=(technique,)), **arguments)
    assert_same_mean(both, alone, relative=0.02)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (8000.0, 100.0, -6000.0)])
@pytest.mark.parametrize("kind", ["point", "sphere", "spot", "rectangle", "disk"])
def test_far_from_the_origin(kind: str, offset: tuple[float, float, float]) -> None:
    """Where a float is a millimetre wide."""
    light = Light("l", kind, (0, 1, 0), DOWN, size=(0.5, 0.5), radius=0.25, power=50, spot_angle=160,
                  camera_visible=False)  # fmt: skip
    scene = over_floor(light)

    def moved(position: Any) -> Any:
        return tuple(np.add(position, offset).tolist())

    far = replace(
        scene.with_object("floor", position=offset).with_light("l", position=moved(light.position)),
        camera=replace(scene.camera, position=moved(scene.camera.position), target=offset),
    )
    a, b = (render(one, 64, max_bounces=0) for one in (scene, far))
    np.testing.assert_allclose(b.mean(), a.mean(), rtol=5e-3)
    np.testing.assert_allclose(blocks(b, 8), blocks(a, 8), rtol=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["point", "sphere", "spot", "rectangle", "disk"])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e4])
def test_at_every_scale(kind: str, size: float) -> None:
    """Lamps of a micrometre, and of ten kilometres, over floors of their size."""
    light = Light("l", kind, (0, size, 0), DOWN, size=(size, size), radius=0.4 * size, radiance=3,
                  spot_angle=160, camera_visible=False)  # fmt: skip
    unit = replace(light, position=(0, 1, 0), size=(1, 1), radius=0.4)
    a = render(over_floor(unit), 64, max_bounces=0)
    b = render(over_floor(light, extent=size), 64, max_bounces=0)
    np.testing.assert_allclose(b.mean(), a.mean(), rtol=3e-3)
    np.testing.assert_allclose(blocks(b, 8), blocks(a, 8), rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("names", ["rectangle,ball,disk,spot,sun,hidden", "ball,sky", "glass,disk,spot,sun"])
def test_blocks_and_wavefront_agree(names: str) -> None:
    if not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    chosen = [replace(FOUND[name], name=name) for name in names.split(",") if name in FOUND]
    chosen.append(Light("shadowless", "point", (1, 1, 1), power=20, casts_shadows=False))
    scene = plates(*chosen, sky="sky" in names)
    if "glass" in names:
        ball = Object("clear", shape("sphere"), "glass", (0.5, 0.4, 0.5), scale=(0.7, 0.7, 0.7))
        scene = scene.with_material("glass", transmission=1.0, roughness=0.0, absorption=(1, 0, 1))
        scene = scene.with_added(ball)
    images = []
    for in_blocks in (False, True):
        session = Session(scene, (53, 37), RenderSettings(base_nor=8, roulette_depth=1), device())
        session._tracer = session._tracer if in_blocks else Wavefront(device())
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


def test_lights_are_picked_where_they_are_seen() -> None:
    ball = Light("ball", "sphere", (0.5, 0, 0), radius=0.3)
    pane = Light("pane", "rectangle", (-0.5, 0, 0), (0, 180, 0), size=(0.5, 0.5))
    sun = Light("sun", "sun", rotation=(0, 190, 0), angle=3)
    scene = replace(camera_at(ball, pane, sun), camera=Camera((0, 0, 3), (0, 0, 0), fov_y=40))
    session = Session(scene, (40, 40), device=device())

    def at(point: tuple[float, float, float]) -> str | None:
        (place,), _ = scene.camera.project(np.array([point]), 1.0)
        return session.pick_point((float(place[0]), float(place[1])))

    assert at((0.5, 0.1, 0)) == "ball" and at((-0.5, 0.1, 0)) == "pane" and at((0, 0, 0)) == "behind"
    session.edit(scene.with_light("pane", camera_visible=False).with_object("behind", position=(0, 0, 1.5)))
    assert at((-0.5, 0.1, 0)) == at((0.5, 0.1, 0)) == "behind"
    session.edit(replace(scene, objects=()).with_light("pane", rotation=(0, 0, 0)))
    towards_sun = np.array(scene.camera.position) + 9 * sun.axes[2]
    assert at((-0.5, 0.1, 0)) is None and at(tuple(towards_sun.tolist())) == "sun"


@pytest.mark.parametrize("in_blocks", [False, True], ids=["wavefront", "blocks"])
@pytest.mark.parametrize(
    "light",
    [
        Light("l", "sphere", (0, 0, 0.5), radius=0.5, radiance=3),
        Light("l", "rectangle", rotation=(0, 180, 0), size=(3, 3), radiance=3),
    ],
    ids=lambda light: light.kind,
)
def test_media_absorb_what_lights_send(light: Light, in_blocks: bool) -> None:
    """Two or three metres through a fog without refraction, straight to the light."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    fog = Material((1, 1, 1), roughness=0, ior=1.0, transmission=1, absorption=(0.5, 0, 1))
    scene = camera_at(light).with_material("fog", **vars(fog))
    scene = scene.with_added(Object("fog", shape("cube"), "fog", scale=(9, 9, 9)))
    settings = RenderSettings(max_bounces=0, base_nor=8)
    session = Session(scene, (32, 32), settings, device())
    session._tracer = session._tracer if in_blocks else Wavefront(device())
    session.render(8)
    distance = 2.0 if light.kind == "sphere" else 3.0
    np.testing.assert_allclose(
        session.image()[14:18, 14:18].mean(axis=(0, 1)),
        3 * np.exp(-distance * np.array([0.5, 0, 1])),
        rtol=0.01,
    )
