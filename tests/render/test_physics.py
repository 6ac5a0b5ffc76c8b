"""Radiance of whole renders against what can be computed by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import direction
from support.renders import assert_same_mean, blocks, render, repeat

from incpt.core.affine import Vector
from incpt.device.device import Device
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

Array = npt.NDArray[np.floating]
CONSTANT = Environment(color=(1, 1, 1))
BLACK = Material((0, 0, 0), specular=0)
WHITE = Material((1, 1, 1), specular=0)
GREY = Material((0.5, 0.5, 0.5), specular=0)


def lamp(r: float, g: float, b: float, double_sided: bool = False) -> Material:
    return Material((0, 0, 0), specular=0, emission=(r, g, b), double_sided=double_sided)


def one_object(
    material: Material, name: str = "cube", environment: Environment = CONSTANT, **placed: Vector
) -> Scene:
    """An object at the origin that fills most of the picture."""
    return Scene(
        Camera(position=(1.1, 0.9, 1.4), target=(0, 0, 0), fov_y=36), environment, {"m": material},
        (Object("o", shape(name), "m", **placed),),
    )  # fmt: skip


# White furnace: what absorbs nothing is invisible in front of light that is the same everywhere.


def test_furnace_white_lambert_is_exact() -> None:
    image = render(one_object(WHITE, rotation=(10, 20, 30)), 16, max_bounces=3)
    np.testing.assert_allclose(image, 1, atol=1e-5)


@pytest.mark.parametrize("roughness", [0.1, 0.4, 0.7, 1.0])
def test_furnace_white_plastic(roughness: float) -> None:
    image = render(one_object(Material((1, 1, 1), roughness=roughness)), 256)
    np.testing.assert_allclose(blocks(image, 8), 1, atol=0.01)


def test_furnace_half_of_everything() -> None:
    material = Material((1, 1, 1), metallic=0.5, roughness=0.3, specular=0.5)
    image = render(one_object(material), 256)
    assert 0.99 < image.mean() < 1.002 and image.max() < 1.1


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.5, 1.0])
def test_furnace_metal_reflects_everything(roughness: float) -> None:
    image = render(one_object(Material((1, 1, 1), metallic=1, roughness=roughness)), 256)
    np.testing.assert_allclose(blocks(image, 8), 1, atol=0.01)
    scene = one_object(Material((1, 1, 1), metallic=1, roughness=roughness))
    once = render(scene, 256, multiple_scattering=False)
    assert blocks(once, 8).max() <= 1.003
    assert once.min() > (0.99 if roughness <= 0.1 else 0.2)
    assert (once.mean() < 0.9) == (roughness >= 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cube", "sphere"])
def test_furnace_glass_is_invisible(name: str) -> None:
    scene = one_object(Material((1, 1, 1), roughness=0, transmission=1), name, rotation=(10, 20, 30))
    image = render(scene, 256, max_bounces=200, transmission_bounces=200, roulette_depth=255)
    assert image.max() <= 1 + 1e-4  # every path brings 1, or nothing where its budget runs out
    # Rounding lets a few rays in where the geometric and the smooth surface disagree.
    np.testing.assert_allclose(image.mean(), 1, atol=2e-3)


@pytest.mark.parametrize("transmission", [0.3, 0.7])
def test_furnace_partly_transmissive(transmission: float) -> None:
    material = Material((1, 1, 1), roughness=0, transmission=transmission, specular=0, ior=1.3)
    image = render(one_object(material), 64, max_bounces=200, transmission_bounces=200, roulette_depth=255)
    np.testing.assert_allclose(image.mean(), 1, atol=2e-3)


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
@pytest.mark.parametrize(
    "values",
    [{}, {"ior": 2.0}, {"specular": 0.0}, {"thin_walled": True}],
    ids=lambda v: "".join(v) or "glass",
)
def test_furnace_rough_glass(roughness: float, values: dict[str, Any]) -> None:
    """It loses nothing; without multiple scattering it loses what meets more than one microfacet."""
    material = Material((1, 1, 1), roughness=roughness, transmission=1, **values)
    many = {"max_bounces": 120, "transmission_bounces": 60, "roulette_depth": 200, "size": (16, 16)}
    image = render(one_object(material), 256, **many)
    np.testing.assert_allclose(image.mean(), 1, atol=0.015)
    assert blocks(image, 8).max() < 1.03
    single = render(one_object(material), 256, **many, multiple_scattering=False)
    assert 0.2 < single.mean() < 1 - 0.02 * roughness


def test_inside_of_glass_is_brighter_by_the_square_of_its_index() -> None:
    # Radiance over n^2 is what stays the same across a boundary without losses.
    scene = replace(
        one_object(Material((1, 1, 1), roughness=0, transmission=1, ior=1.5), scale=(9, 8, 7)),
        camera=Camera(position=(0.5, 0.3, 0.2), target=(1, 0.5, 0.8), fov_y=100),
    )
    image = render(scene, 64, max_bounces=200, transmission_bounces=200, roulette_depth=255)
    # A ray beyond the critical angle on all three axes never leaves a box.
    seen = image[image.min(axis=2) > 0.5]
    assert len(seen) > 400
    np.testing.assert_allclose(np.median(seen), 2.25, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "cube", "cylinder"])
def test_diffuse_body_in_constant_light(name: str) -> None:
    material = Material((0.8, 0.5, 0.2), specular=0)
    image = render(one_object(material, name, Environment(color=(2, 3, 4))), 64)
    expected = np.array(material.base_color) * [2, 3, 4]
    # Directions above the smooth surface but below its facets are lost.
    np.testing.assert_allclose(image[12:20, 12:20].mean(axis=(0, 1)), expected, rtol=2e-3)
    np.testing.assert_allclose(image[0, 0], [2, 3, 4], rtol=1e-6)


# Emitters


def polygon_irradiance(corners: Array, point: Array, normal: Array) -> float:
    """From a polygon (N, 3) of radiance 1, all of it above the horizon. Lambert 1760."""
    v = corners - point
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    following = np.roll(v, -1, axis=0)
    cross = np.cross(v, following)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", v, following))
    return float(abs((angle / sine) @ cross @ normal) / 2)


def floor_below(*objects: Object, materials: dict[str, Material]) -> Scene:
    """A grey floor at y = 0, seen from straight above in a square of 2 x 2 m; row 0 is at z = -1."""
    camera = Camera(position=(0, 0.999, 0), target=(0, 0, 0), up=(0, 0, -1), fov_y=90)
    floor = Object("floor", shape("plane"), "floor", scale=(100, 1, 100))
    return Scene(camera, Environment(), {"floor": GREY, **materials}, (floor, *objects))


def floor_points(size: int) -> npt.NDArray[np.float64]:
    """(size, size, 3) under the pixel centres of `floor_below`."""
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * 0.999
    return np.stack(np.broadcast_arrays(x[None, :], 0.0, x[:, None]), axis=2)


def quad_corners(obj: Object) -> npt.NDArray[np.float64]:
    matrix = obj.world_from_object
    return np.asarray(obj.mesh.vertices @ matrix[:, :3].T + matrix[:, 3])


def _plane(name: str, material: str = "lamp", **placed: Vector) -> Object:
    return Object(name, shape("plane"), material, **placed)


@pytest.mark.slow
@pytest.mark.parametrize(
    "placed",
    [
        {"position": (0.3, 2, 0.2), "rotation": (180, 0, 0)},
        {"position": (0.3, 2, 0.2), "rotation": (160, 10, 20), "scale": (3, 1, 0.2)},
        {"position": (-0.5, 1.6, 0), "rotation": (180, 0, 0), "scale": (-0.5, 2, 1)},
        {"position": (0, 3, 1), "rotation": (0, 0, 0), "scale": (1, -1, 2)},
        {"position": (0, 3, 1), "rotation": (170, 0, 10), "scale": (-1, 5, -2)},
        {"position": (0, 1.5, 0), "rotation": (180, 0, 0), "scale": (0.002, 1, 0.002)},
    ],
    ids=["square", "turned and stretched", "mirrored", "upside down", "mirrored twice", "tiny"],
)
def test_floor_under_a_rectangle(placed: dict[str, Vector]) -> None:
    light = _plane("light", **placed)
    tiny = light.scale[0] < 0.01
    scene = floor_below(light, materials={"lamp": lamp(*((3e6, 2e6, 1e6) if tiny else (3, 2, 1)))})
    image = render(scene, 1024, max_bounces=0)
    corners = quad_corners(light)
    expected = np.array(
        [[polygon_irradiance(corners, p, np.array([0, 1, 0])) for p in row] for row in floor_points(32)]
    )
    expected = 0.5 / np.pi * expected[..., None] * scene.material("lamp").emission
    np.testing.assert_allclose(blocks(image, 2), blocks(expected, 2), rtol=0.04)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=3e-3)


def test_floor_under_several_lights() -> None:
    lights = [
        _plane("a", "a", position=(0.9, 1.5, 0), rotation=(180, 0, 0), scale=(0.3, 1, 0.3)),
        _plane("b", "b", position=(-2, 2.5, 0), rotation=(180, 0, -20)),
        _plane("c", "c", position=(0, 4, -3), rotation=(140, 0, 0), scale=(0.1, 1, 6)),
    ]
    materials = {"a": lamp(9, 0, 0), "b": lamp(0, 3, 0), "c": lamp(0, 0, 20)}
    image = render(floor_below(*lights, materials=materials), 1024, max_bounces=0)
    for channel, light in enumerate(lights):
        corners, power = quad_corners(light), max(materials[light.material].emission)
        expected = [
            polygon_irradiance(corners, p, np.array([0, 1, 0])) for p in floor_points(32).reshape(-1, 3)
        ]
        mean = 0.5 / np.pi * power * np.mean(expected)
        assert image[..., channel].mean() == pytest.approx(mean, rel=0.01)


@pytest.mark.slow
def test_floor_under_a_disk_and_a_sphere() -> None:
    ring = 2 * np.pi * np.arange(96) / 96
    vertices = np.column_stack([np.cos(ring), 0 * ring, np.sin(ring)])
    faces = np.array([[0, i, i + 1] for i in range(1, 95)])  # clockwise from above: looks down
    disk = Object("disk", Mesh(vertices.astype(np.float32), faces), "lamp", position=(0, 2, 0))
    sphere = Object("ball", shape("sphere"), "lamp", position=(0, 3, 0), scale=(2, 2, 2))
    for light, exact in ((disk, 1 / (1 + 2**2)), (sphere, (1 / 3) ** 2)):
        scene = floor_below(light, materials={"lamp": lamp(1, 1, 1)})
        scene = scene.with_camera(fov_y=2.0)
        image = render(scene, 1024, (16, 16), max_bounces=0)
        assert image.mean() == pytest.approx(0.5 * exact, rel=5e-3)  # E / pi = L sin^2


@pytest.mark.parametrize("double_sided", [False, True])
def test_sides_of_an_emitter(double_sided: bool) -> None:
    away = _plane("light", position=(0, 2, 0))  # its front is up, the floor sees its back
    scene = floor_below(away, materials={"lamp": lamp(1, 1, 1, double_sided)})
    front = floor_below(replace(away, rotation=(180, 0, 0)), materials={"lamp": lamp(1, 1, 1)})
    image, expected = render(scene, 512, max_bounces=0), render(front, 512, max_bounces=0)
    if double_sided:
        np.testing.assert_allclose(image.mean(), expected.mean(), rtol=3e-3)
    else:
        assert (image == 0).all()
    # Seen directly, from both sides.
    for height, seen in ((4.0, 1.0), (1.0, float(double_sided))):
        camera = Camera(position=(0, height, 0), target=(0, 2, 0), up=(0, 0, -1), fov_y=10)
        direct = render(replace(scene, camera=camera), 4, max_bounces=0)
        np.testing.assert_allclose(direct, seen, atol=1e-6)


def test_lights_without_area_do_no_harm() -> None:
    light = _plane("light", position=(0.3, 2, 0.2), rotation=(180, 0, 0))
    mesh = light.mesh
    vertices = np.concatenate([mesh.vertices, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]]).astype(np.float32)
    faces = np.concatenate([mesh.faces, [[4, 5, 6], [4, 4, 5], [6, 6, 6]]])
    flat = Mesh(vertices[4:], np.array([[0, 1, 2]]))
    materials = {"lamp": lamp(3, 2, 1)}
    plain = render(floor_below(light, materials=materials), 256, max_bounces=1)
    spoilt = floor_below(
        replace(light, mesh=Mesh(vertices, faces)), Object("line", flat, "lamp", position=(0, 1, 0)),
        materials=materials,
    )  # fmt: skip
    np.testing.assert_allclose(render(spoilt, 256, max_bounces=1).mean(), plain.mean(), rtol=0.01)
    only = floor_below(Object("line", flat, "lamp", position=(0, 1, 0)), materials=materials)
    assert (render(only, 16) == 0).all()


# Counting bounces


@pytest.mark.slow
@pytest.mark.parametrize("max_bounces", [0, 1, 2, 5])
def test_bounces_are_counted_after_the_first_hit(max_bounces: int) -> None:
    # In a closed box whose walls emit 1 and reflect half, every order of scattering adds half the one before.
    box = Object("box", shape("cube"), "wall", scale=(2, 3, 2.5))
    wall = replace(GREY, emission=(1, 1, 1), double_sided=True)
    scene = Scene(Camera((0.2, 0.1, 0.3), (1, 0.5, 0.2), fov_y=80), Environment(), {"wall": wall}, (box,))
    image = render(scene, 1024, max_bounces=max_bounces, roulette_depth=255)
    expected = sum(0.5**k for k in range(max_bounces + 2))
    np.testing.assert_allclose(image.mean(), expected, rtol=2e-3)
    np.testing.assert_allclose(blocks(image, 8), expected, rtol=0.02)


def test_passages_through_glass_are_counted_apart() -> None:
    pane = Object("pane", shape("cube"), "glass", scale=(9, 9, 0.1))
    back = _plane("back", "lamp", position=(0, 0, -2), rotation=(90, 0, 0), scale=(90, 1, 90))
    glass = Material((1, 1, 1), roughness=0, transmission=1)
    scene = Scene(
        Camera((0, 0, 5), (0, 0, 0), fov_y=2), Environment(), {"glass": glass, "lamp": lamp(1, 1, 1)},
        (pane, back),
    )  # fmt: skip
    r = 0.04
    orders = {1: 0.0, 2: (1 - r) ** 2, 3: (1 - r) ** 2, 4: (1 - r) ** 2 * (1 + r**2)}
    for passages, expected in orders.items():
        image = render(scene, 4096, (8, 8), max_bounces=0, transmission_bounces=passages, roulette_depth=255)
        np.testing.assert_allclose(image.mean(), expected, atol=2e-3)


def _cornell_like() -> Scene:
    walls = [
        _plane("floor", "white", scale=(2, 1, 2)),
        _plane("ceiling", "white", position=(0, 2, 0), rotation=(180, 0, 0), scale=(2, 1, 2)),
        _plane("back", "white", position=(0, 1, -1), rotation=(90, 0, 0), scale=(2, 1, 2)),
        _plane("left", "red", position=(-1, 1, 0), rotation=(0, 0, -90), scale=(2, 1, 2)),
        _plane("right", "green", position=(1, 1, 0), rotation=(0, 0, 90), scale=(2, 1, 2)),
    ]
    light = _plane("light", "lamp", position=(0, 1.98, 0), rotation=(180, 0, 0), scale=(0.6, 1, 0.6))
    block = Object("block", shape("cube"), "white", (0.3, 0.3, 0.2), (0, 25, 0), (0.6, 0.6, 0.6))
    materials = {
        "white": Material((0.8, 0.8, 0.8), specular=0), "red": Material((0.8, 0.1, 0.1), specular=0),
        "green": Material((0.1, 0.8, 0.1), specular=0), "lamp": lamp(10, 9, 7),
    }  # fmt: skip
    return Scene(Camera((0, 1, 3.4), (0, 1, 0), fov_y=40), Environment(), materials, (*walls, light, block))


def test_russian_roulette_keeps_the_mean() -> None:
    settings = {"max_bounces": 12, "count": 8}
    early = repeat(_cornell_like(), 64, roulette_depth=0, **settings)
    never = repeat(_cornell_like(), 64, roulette_depth=255, **settings)
    assert_same_mean(early, never, relative=0.01)
    assert blocks(early, 8).var(axis=0).mean() > blocks(never, 8).var(axis=0).mean()  # it did something


# Light sampling, BSDF sampling, and both together


def _plates(environment: Environment, *more: Object) -> Scene:
    lights = [
        _plane("small", "lamp", position=(-0.5, 1.5, -0.5), rotation=(150, 0, 0), scale=(0.4, 1, 0.4)),
        _plane("large", "dim", position=(0.8, 1.2, -1), rotation=(110, 0, 0), scale=(1.5, 1, 1)),
    ]
    materials = {
        "floor": Material((0.6, 0.6, 0.6), roughness=0.6),
        "metal": Material((0.9, 0.7, 0.4), metallic=1, roughness=0.5),
        "lamp": lamp(6, 6, 6),
        "dim": lamp(1, 1.5, 2),
        "frosted": Material((1, 1, 1), roughness=0.6, transmission=1, absorption=(1, 3, 6)),
    }
    plate = Object("plate", shape("cube"), "metal", (-0.5, 0.3, 0), (20, 10, 0), (0.8, 0.1, 0.8))
    floor = _plane("floor", "floor", scale=(4, 1, 4))
    camera = Camera((0, 1.3, 2.6), (0, 0.3, 0), fov_y=40)
    return Scene(camera, environment, materials, (floor, plate, *lights, *more))


_FROSTED = Object("frosted", shape("cube"), "frosted", (0.6, 0.35, 0.3), (0, 30, 0), (0.6, 0.6, 0.6))


def _sky() -> Environment:
    pixels = np.full((16, 32, 3), [0.2, 0.3, 0.4], np.float32)
    pixels[3:6, 8:14] = [6, 5, 4]
    return Environment((1, 1, 1), Image(pixels), rotation_y=40)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        "both",
        *(
            pytest.param(case, marks=pytest.mark.statistics)
            for case in ("environment", "rough glass", "rough glass, direct")
        ),
    ],
)
@pytest.mark.parametrize("technique", ["MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
def test_each_technique_alone_gives_the_same(case: str, technique: str) -> None:
    scene = {
        "environment": _plates(_sky()).without_object("small").without_object("large"),
        "both": _plates(_sky()),
        "rough glass": _plates(Environment(), _FROSTED),
    }[case.removesuffix(", direct")]
    arguments = {"max_bounces": 0 if "direct" in case else 3, "transmission_bounces": 4, "size": (32, 32)}
    both = repeat(scene, 64, **arguments)
    alone = repeat(scene, 128, on=Device(features=(technique,)), **arguments)
    assert_same_mean(both, alone, relative=0.02)
    assert blocks(both, 8).var(axis=0).mean() > 0


# Environment


@pytest.mark.slow
@pytest.mark.parametrize("rotation", [0.0, 90.0, 200.0])
@pytest.mark.parametrize("texel", [(8, 16), (8, 24), (2, 5), (13, 31)])
def test_bright_texel_is_seen_where_openexr_puts_it(rotation: float, texel: tuple[int, int]) -> None:
    row, column = texel
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[row, column] = [4, 2, 1]
    # Longitude grows to the right, from +z towards -x; the rotation is right-handed about +y.
    longitude = ((column + 0.5) / 32 - 0.5) * 2 * np.pi - np.radians(rotation)
    polar = (row + 0.5) / 16 * np.pi
    towards = np.array([-np.sin(polar) * np.sin(longitude), np.cos(polar), np.sin(polar) * np.cos(longitude)])
    camera = Camera((0, 0, 0), tuple(towards), up=(0.1, 1, 0.2), fov_y=8)
    environment = Environment((1, 1, 1), Image(pixels), rotation)
    seen = render(Scene(camera, environment), 4, (8, 8))
    assert seen[3:5, 3:5, 0].min() > 3
    behind = render(Scene(replace(camera, target=tuple(-towards)), environment), 4, (8, 8))
    assert (behind == 0).all()
    # A white plane that faces the texel is lit by it, one that looks away is not.
    for sign, lit in ((1, True), (-1, False)):
        eye = towards * sign * 2 + np.array([0.01, 0.02, 0.015])
        normal = towards * sign
        tangent = np.cross(normal, [0.3, 0.9, -0.2])
        tangent /= np.linalg.norm(tangent)
        bitangent = np.cross(normal, tangent)
        corners = np.array(
            [-tangent - bitangent, tangent - bitangent, tangent + bitangent, bitangent - tangent]
        )
        mesh = Mesh((corners * 5).astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]]))
        scene = Scene(
            Camera(tuple(eye), (0, 0, 0), (0.3, 1, 0.1), 30),
            environment,
            {"m": WHITE},
            (Object("o", mesh, "m"),),
        )
        image = render(scene, 256, (8, 8), max_bounces=0)
        if lit:
            area = np.sin(polar) * (np.pi / 16) * (2 * np.pi / 32)  # a tent of that volume
            np.testing.assert_allclose(image.mean(axis=(0, 1)), np.array([4, 2, 1]) * area / np.pi, rtol=0.05)
        else:
            assert image.max() < 1e-3


def test_black_image_is_black() -> None:
    environment = Environment((1, 1, 1), Image(np.zeros((4, 8, 3), np.float32)))
    assert (render(one_object(GREY, environment=environment), 4) == 0).all()


def test_colour_and_intensity_scale_the_image() -> None:
    image = Image(np.full((4, 8, 3), [1, 2, 3], np.float32))
    seen = render(Scene(environment=Environment((0.5, 1, 2), image, intensity=3)), 4, (8, 8))
    np.testing.assert_allclose(seen, np.broadcast_to([1.5, 6, 18], seen.shape), rtol=1e-5)


def test_up_is_up_and_right_is_right() -> None:
    materials = {"red": lamp(1, 0, 0), "green": lamp(0, 1, 0), "blue": lamp(0, 0, 1)}
    places = {"red": (2, 0, 0), "green": (0, 2, 0), "blue": (0, 0, 0)}
    objects = tuple(Object(colour, shape("cube"), colour, place) for colour, place in places.items())
    image = render(Scene(Camera((0, 0, 9), (0, 0, 0), fov_y=40), Environment(), materials, objects), 4)
    for name, (row, column) in {"red": (16, 26), "green": (5, 16), "blue": (16, 16)}.items():
        np.testing.assert_allclose(image[row, column], materials[name].emission, atol=1e-6)
    assert (image[16, 5] == 0).all() and (image[26, 16] == 0).all()


# Glass


def stack_of_layers(
    indices: list[float], absorption: list[Vector], thickness: list[float], cosine: float
) -> tuple[Array, Array]:
    """Reflectance and transmittance (3,) of layers between air for unpolarised light without interference
    whose cosine in the air is given: boundaries and layers added one by one (Stokes 1862)."""
    sine = np.sqrt(1 - cosine**2)
    chain = [1.0, *indices, 1.0]
    reflect, transmit, reflect_back = np.zeros(3), np.ones(3), np.zeros(3)
    for i in range(len(chain) - 1):
        n1, n2 = chain[i], chain[i + 1]
        c1, c2 = np.sqrt(1 - (sine / n1) ** 2), np.sqrt(1 - (sine / n2) ** 2)
        s, p = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2), (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)
        r = (s**2 + p**2) / 2
        loss = 1 / (1 - reflect_back * r)
        reflect = reflect + transmit**2 * r * loss
        transmit = transmit * (1 - r) * loss
        reflect_back = r + (1 - r) ** 2 * reflect_back * loss
        if i < len(indices):
            passed = np.exp(-np.asarray(absorption[i]) * thickness[i] / c2)
            transmit, reflect_back = transmit * passed, reflect_back * passed**2
    return reflect, transmit


def _layers(bodies: list[tuple[float, float, Material]], angle_deg: float, light_behind: bool) -> Array:
    """(3,) what a camera sees along `angle_deg` to the normal through wide bodies from depth a to depth b,
    with a wall of radiance 1 behind them or behind the camera."""
    z = 6.0 * (-1 if light_behind else 1)
    wall = _plane("wall", "lamp", position=(0, 0, z), rotation=(90, 0, 0), scale=(900, 1, 900))
    materials = {"lamp": lamp(1, 1, 1, double_sided=True)} | {
        f"m{i}": m for i, (_, _, m) in enumerate(bodies)
    }
    slabs = [
        Object(f"slab {i}", shape("cube"), f"m{i}", (0, 0, -(a + b) / 2), (0, 0, 0), (100, 100, b - a))
        for i, (a, b, _) in enumerate(bodies)
    ]
    towards = direction(np.radians(angle_deg), 0.6)
    camera = Camera(tuple(towards * 3), (0, 0, 0), up=(0, 1, 0.1), fov_y=0.2)
    image = render(
        Scene(camera, Environment(), materials, (wall, *slabs)), 2048, (8, 8), max_bounces=60,
        transmission_bounces=100, roulette_depth=255,
    )  # fmt: skip
    return np.asarray(image.mean(axis=(0, 1)))


def _glass(ior: float, absorption: Vector = (0, 0, 0), priority: int = 0) -> Material:
    return Material((1, 1, 1), roughness=0, transmission=1, ior=ior, absorption=absorption, priority=priority)


@pytest.mark.parametrize("angle", [0.0, 40.0, 70.0])
def test_absorption_of_a_slab(angle: float) -> None:
    absorption = (0.3, 1.0, 4.0)
    reflected, transmitted = stack_of_layers([1.52], [absorption], [0.5], float(np.cos(np.radians(angle))))
    bodies = [(0.0, 0.5, _glass(1.52, absorption))]
    np.testing.assert_allclose(_layers(bodies, angle, True), transmitted, atol=3e-3)
    np.testing.assert_allclose(_layers(bodies, angle, False), reflected, atol=3e-3)


@pytest.mark.parametrize("transmission", [0.0, 1.0])
def test_roulette_spares_the_first_scattering_events(transmission: float) -> None:
    material = Material((0.3, 0.3, 0.3), roughness=0.6, transmission=transmission)
    scene = one_object(material, "plane")
    early, never = (render(scene, 4, max_bounces=0, roulette_depth=depth) for depth in (1, 255))
    np.testing.assert_array_equal(early, never)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.5])
@pytest.mark.parametrize("image", [None, Image(np.ones((4, 8, 3)))])
def test_nothing_arrives_through_an_endless_medium(roughness: float, image: Image | None) -> None:
    """A single sheet has no far side: light from there came through an infinite length of glass."""
    glass = Material((1, 1, 1), roughness=roughness, transmission=1, specular=0, absorption=(0, 1, 2))
    scene = Scene(
        Camera((0, 3, 0), (0, 0, 0), fov_y=20), Environment(color=(1, 1, 1), image=image),
        {"glass": glass}, (Object("sheet", shape("plane"), "glass", scale=(9, 1, 9)),),
    )  # fmt: skip
    mean = render(scene, 16, max_bounces=1).mean(axis=(0, 1))
    assert mean[0] > 0.3 and not mean[1:].any()


_GLASS, _LIQUID = (2.0, (0.2, 0.4, 0.0)), (1.333, (0.0, 1.0, 2.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("priorities", "layers"),
    [
        # Glass from 0 to 1, liquid from 0.5 to 2: the higher priority has the part they share.
        ((2, 1), [(*_GLASS, 1.0), (*_LIQUID, 1.0)]),
        ((1, 2), [(*_GLASS, 0.5), (*_LIQUID, 1.5)]),
        ((0, 7), [(*_GLASS, 1.0), (*_LIQUID, 1.0)]),  # 0 is the highest of all
        ((7, 0), [(*_GLASS, 0.5), (*_LIQUID, 1.5)]),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 50.0])
def test_overlapping_bodies_by_priority(
    priorities: tuple[int, int], layers: list[tuple[float, Vector, float]], angle: float
) -> None:
    glass, liquid = _glass(*_GLASS, priority=priorities[0]), _glass(*_LIQUID, priority=priorities[1])
    bodies = [(0.0, 1.0, glass), (0.5, 2.0, liquid)]
    indices, absorption, thickness = (list(column) for column in zip(*layers, strict=True))
    cosine = float(np.cos(np.radians(angle)))
    reflected, transmitted = stack_of_layers(indices, absorption, thickness, cosine)
    np.testing.assert_allclose(_layers(bodies, angle, True), transmitted, atol=3e-3)
    np.testing.assert_allclose(_layers(bodies, angle, False), reflected, atol=3e-3)
    # The order in the scene does not matter, nor the side one looks from.
    np.testing.assert_allclose(_layers(bodies[::-1], angle, True), transmitted, atol=3e-3)
    turned = [(2.0 - b, 2.0 - a, material) for a, b, material in bodies]
    np.testing.assert_allclose(_layers(turned, angle, True), transmitted, atol=3e-3)


def test_a_body_inside_one_of_higher_priority_is_not_there() -> None:
    alone = stack_of_layers([1.5], [(0.1, 0.2, 0.3)], [2.0], 1.0)[1]
    outer = _glass(1.5, (0.1, 0.2, 0.3), priority=2)
    hidden = [
        (0.0, 2.0, outer),
        (0.5, 1.0, _glass(2.0, (9, 9, 9), priority=1)),
        (0.7, 1.5, _glass(1.2, priority=1)),
    ]
    np.testing.assert_allclose(_layers(hidden, 0.0, True), alone, atol=3e-3)
    # Of higher priority it displaces the outer one.
    seen = [(0.0, 2.0, outer), (0.5, 1.0, _glass(2.0, (1, 1, 1), priority=3))]
    air, inner = (0.1, 0.2, 0.3), (1.0, 1.0, 1.0)
    expected = stack_of_layers([1.5, 2.0, 1.5], [air, inner, air], [0.5, 0.5, 1.0], 1.0)[1]
    np.testing.assert_allclose(_layers(seen, 0.0, True), expected, atol=3e-3)


def test_a_hidden_boundary_neither_tints_nor_scatters_nor_counts() -> None:
    outer = _glass(1.5, priority=2)
    hidden = Material((0.2, 0.5, 0.8), roughness=0.6, transmission=1, ior=2.0, priority=1)
    slabs = [Object("outer", shape("cube"), "outer", scale=(100, 100, 2))]
    slabs += [Object(f"hidden {i}", shape("cube"), "hidden", (0, 0, 0.2 * i - 0.3), scale=(90, 90, 0.1))
              for i in range(4)]  # fmt: skip
    wall = _plane("wall", "lamp", position=(0, 0, -6), rotation=(90, 0, 0), scale=(900, 1, 900))
    materials = {"outer": outer, "hidden": hidden, "lamp": lamp(1, 1, 1, double_sided=True)}
    scene = Scene(Camera((0, 0, 3), (0, 0, 0), fov_y=0.2), Environment(), materials, (wall, *slabs))
    image = render(scene, 2048, (8, 8), max_bounces=0, transmission_bounces=2, roulette_depth=255)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), (1 - 0.04) ** 2, atol=3e-3)


def test_liquid_in_a_glass_needs_no_gap() -> None:
    # Overlapping by a little, and by half, is the same picture but for the thickness of the wall.
    wall, liquid = _glass(1.5, priority=2), _glass(1.333, (1, 2, 3), priority=1)
    images = [
        _layers([(0.0, 0.3, wall), (start, 1.2, liquid), (1.0, 1.3, wall)], 30.0, True)
        for start in (0.29, 0.1)
    ]
    np.testing.assert_allclose(images[0], images[1], atol=3e-3)
    expected = stack_of_layers([1.5, 1.333, 1.5], [(0, 0, 0), (1, 2, 3), (0, 0, 0)], [0.3, 0.7, 0.3],
                               float(np.cos(np.radians(30))))[1]  # fmt: skip
    np.testing.assert_allclose(images[0], expected, atol=3e-3)


def test_tint_of_what_goes_through() -> None:
    tinted = Material((0.5, 0.8, 1.0), roughness=0, transmission=1, ior=1.0001)
    np.testing.assert_allclose(_layers([(0.0, 1.0, tinted)], 0.0, True), [0.25, 0.64, 1.0], atol=1e-3)


def test_opaque_body_in_a_medium_is_lit_through_it() -> None:
    # A lamp and a floor in one body of water: both the lamp's shadow rays and the paths are absorbed.
    water = Object("water", shape("cube"), "water", scale=(50, 5, 50))
    light = _plane("light", position=(1.2, 2, 0.2), rotation=(180, 0, 0))
    materials = {"lamp": lamp(3, 3, 3), "water": _glass(1.0001, (0.5, 1, 2))}
    scene = floor_below(light, water, materials=materials).with_camera(position=(0, 4, 0), fov_y=2.0)
    image = render(scene, 1024, (8, 8), max_bounces=0, transmission_bounces=100)
    corners = quad_corners(light)
    grid = (np.arange(40) + 0.5) / 40
    a, b = np.meshgrid(grid, grid)
    points = (
        corners[0]
        + a.ravel()[:, None] * (corners[1] - corners[0])
        + b.ravel()[:, None] * (corners[3] - corners[0])
    )
    for channel, absorption in enumerate((0.5, 1.0, 2.0)):
        distance = np.linalg.norm(points, axis=1)
        kernel = points[:, 1] ** 2 / distance**4 * np.exp(-absorption * distance)
        expected = 0.5 / np.pi * 3 * kernel.mean() * np.exp(-absorption * 2.5)
        assert image[..., channel].mean() == pytest.approx(expected, rel=0.02)


# Light leaks


@pytest.mark.slow
@pytest.mark.parametrize("target", [(1, 1, 0.3), (1, 1, 1), (-1, 0.2, 1), (0.1, -1, -1)], ids=str)
@pytest.mark.parametrize(
    ("size", "rotation", "position"),
    [(1.0, (0, 0, 0), (0, 0, 0)), (1000.0, (0, 0, 0), (0, 0, 0)), (1.0, (33, 21, 77), (5, -3, 2))],
    ids=["aligned", "large", "turned"],
)
def test_a_path_does_not_slip_out_where_it_hits_an_edge(
    target: Vector, size: float, rotation: Vector, position: Vector
) -> None:
    # The whole picture is a few rounding errors wide, so that thousands of hits lie on the edge or corner.
    edge = 2 * size
    bright = Environment(color=(1e6, 1e6, 1e6))
    scene = one_object(GREY, "cube", bright, scale=(edge, edge, edge), rotation=rotation, position=position)
    matrix = scene.objects[0].world_from_object
    eye, place = (tuple(matrix[:, :3] @ p + matrix[:, 3]) for p in ((0.05, 0.02, -0.1), np.array(target) / 2))
    camera = Camera(eye, place, up=(0.2, 1, 0.1), fov_y=0.01)
    image = render(replace(scene, camera=camera), 1024, max_bounces=2, roulette_depth=255)
    assert (image == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cube", "sphere", "cylinder"])
@pytest.mark.parametrize(
    "placed",
    [
        {"scale": (2, 2, 2)},
        {"scale": (-3, 1.7, 2.3), "rotation": (33, 21, 77), "position": (0.1, 0.05, -0.07)},
        {"scale": (1000, 1100, 900), "position": (90, -80, 100)},
    ],
    ids=["aligned", "turned", "large"],
)
def test_no_light_leaks_into_a_closed_body(name: str, placed: dict[str, Vector]) -> None:
    bright = Environment(color=(1e6, 1e6, 1e6))
    scene = replace(one_object(GREY, name, bright, **placed), camera=Camera((0, 0, 0), (1, 0, 0), fov_y=120))
    for target in ((1, 0, 0), (0.2, -1, 0.3)):
        image = render(scene.with_camera(target=target), 256, max_bounces=8, roulette_depth=255)
        assert (image == 0).all()


def test_no_light_leaks_between_the_walls_of_a_room() -> None:
    # Six planes that only share edges in space, with a sun outside that light sampling aims at.
    side = [((0, 0, 0), 0), ((0, 2, 0), 180)]
    walls = [
        _plane(f"y{i}", "wall", position=p, rotation=(r, 0, 0), scale=(2, 1, 2))
        for i, (p, r) in enumerate(side)
    ]
    walls += [_plane(f"z{i}", "wall", position=(0, 1, z), rotation=(r, 0, 0), scale=(2, 1, 2))
              for i, (z, r) in enumerate([(-1, 90), (1, -90)])]  # fmt: skip
    walls += [_plane(f"x{i}", "wall", position=(x, 1, 0), rotation=(0, 0, r), scale=(2, 1, 2))
              for i, (x, r) in enumerate([(-1, -90), (1, 90)])]  # fmt: skip
    sun = Object("sun", shape("sphere"), "lamp", position=(5, 6, 3), scale=(4, 4, 4))
    materials = {"wall": GREY, "lamp": lamp(1e5, 1e5, 1e5, double_sided=True)}
    camera = Camera((0.1, 1.1, 0.2), (1, 0.4, 0.3), fov_y=110)
    scene = Scene(camera, Environment(color=(1e4, 1e4, 1e4)), materials, (*walls, sun))
    for target in ((1, 0.4, 0.3), (-1, 2, -0.5)):
        image = render(scene.with_camera(target=target), 256, max_bounces=4, roulette_depth=255)
        assert (image == 0).all()


# Odd numbers


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.statistics) for seed in range(4, 12))]
)
def test_no_sample_is_undefined_or_negative(seed: int) -> None:
    # Extremes of every parameter at once; `render` asserts that all samples are finite.
    rng = np.random.default_rng(seed)

    def pick(*values: float) -> float:
        return float(rng.choice(values))

    materials, objects = {}, []
    for i in range(8):
        materials[f"m{i}"] = Material(
            (pick(0, 0.5, 1), pick(0, 1), pick(0, 1)), metallic=pick(0, 0, 0.5, 1),
            roughness=pick(0, 0.01, 0.04, 0.3, 1), specular=pick(0, 0.5, 1), ior=pick(1, 1.0001, 1.5, 100),
            transmission=pick(0, 0, 0.5, 1, 1), absorption=(pick(0, 1, 1e9), 0, pick(0, 1)),
            priority=int(pick(0, 1, 2)), emission=(pick(0, 0, 1, 1e9), 0, 0), double_sided=bool(pick(0, 1)),
        )  # fmt: skip
        scale = tuple(pick(-1, 1) * pick(1e-6, 1e-3, 0.5, 1, 3, 1e6) for _ in range(3))
        position = tuple(rng.normal(size=3))
        name = str(rng.choice(["cube", "sphere", "plane", "cylinder"]))
        objects.append(Object(f"o{i}", shape(name), f"m{i}", position, tuple(360 * rng.random(3)), scale))
    pixels = rng.random((4, 8, 3)).astype(np.float32) ** 8 * np.float32(pick(1, 1e9))
    sky = [Environment(), CONSTANT, Environment((1, 1, 1), Image(pixels), 30), Environment((1e9, 0, 0))][
        seed % 4
    ]
    scene = Scene(Camera((0, 0.5, 2), (0, 0, 0)), sky, materials, tuple(objects))
    image = render(scene, 64, (16, 16), max_bounces=8, roulette_depth=int(pick(0, 4)))
    assert image.min() >= 0
