"""Whole renders of textured scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.law import assert_edits_converge
from support.pairs import check, session_of, traced_pairs
from support.parameters import TEXTURES
from support.renders import assert_same_mean, pixels, render, repeat
from support.small_scenes import mixed_scene, small_settings

from incpt.core.affine import Vector
from incpt.core.layout import TextureSlot
from incpt.device.device import Device
from incpt.picture.color import linear_from_srgb
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material, texture_name
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture

Array = npt.NDArray[np.floating]
Vector2 = tuple[float, float]

GREY = float(linear_from_srgb(128 / 255))


def uniform(*values: float) -> Texture:
    """The same numbers everywhere, as floats."""
    return Texture(Bitmap(np.broadcast_to(np.float32(values), (2, 2, len(values)))))


def checker(low: int = 30, high: int = 230, size: int = 8) -> Bitmap:
    yy, xx = np.mgrid[:size, :size]
    pixels = np.where(((xx + yy) % 2)[..., None] == 1, [high, low, low], [low, high, high])
    return Bitmap(pixels.astype(np.uint8))


def bumps() -> Bitmap:
    """A normal map of 16 x 16 pixels with slopes of up to 30 degrees."""
    yy, xx = np.mgrid[:16, :16] / 16 * 2 * np.pi
    slope = np.stack([0.5 * np.sin(xx), 0.5 * np.sin(yy), np.ones_like(xx)], axis=-1)
    normal = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    return Bitmap(((normal + 1) / 2).astype(np.float32))


EVERY_SLOT = Material(
    transmission=1, roughness=0.5, **{texture_name(slot): uniform(1, 1, 1) for slot in TextureSlot}
)


def things(material: Material, with_every_slot: bool = True, **settings: Any) -> Scene:
    """A cube, a mirrored sphere and a cylinder of one material, some with trees, under a lamp and a sky."""
    materials = {"m": material, "floor": Material((0.5, 0.5, 0.5)), "lamp": Material(emission=(9, 9, 9))}
    if with_every_slot:
        # Nothing is made of it: its textures and its transmission ask for kernels that serve all.
        materials["every"] = EVERY_SLOT
    objects = (
        Object("floor", shape("plane"), "floor", scale=(9, 1, 9)),
        Object("cube", shape("cube"), "m", (-1.1, 0.5, 0), (0, 30, 0)),
        Object("sphere", shape("sphere"), "m", (0, 0.5, 0.2), scale=(-1, 1, 1)),
        Object("drum", shape("cylinder"), "m", (1.1, 0.5, 0), (0, 0, 10), (0.8, 1, 0.8)),
        Object("lamp", shape("plane"), "lamp", (0, 3, 1), (180, 0, 0)),
    )
    environment = Environment(color=(0.3, 0.35, 0.4))
    return Scene(
        Camera((0, 1.2, 3.2), (0, 0.4, 0)), environment, materials, objects, small_settings(**settings)
    )


ALIKE: dict[str, tuple[Material, Material]] = {
    "base colour": (
        Material((1, 0.5, 0.8), base_color_texture=Texture(Bitmap(np.full((3, 2, 3), 128, np.uint8)))),
        Material((GREY, 0.5 * GREY, 0.8 * GREY)),
    ),
    "base colour, 16 bits": (
        Material((1, 1, 1), base_color_texture=Texture(Bitmap(np.full((1, 1, 1), 32896, np.uint16)))),
        Material((float(linear_from_srgb(32896 / 65535)),) * 3),
    ),
    "plastic": (
        Material((0.8, 0.3, 0.1), roughness=0.9, metallic_roughness_texture=uniform(0.7, 0.5, 0.25)),
        Material((0.8, 0.3, 0.1), roughness=0.45),
    ),
    "half metal": (
        Material((0.9, 0.6, 0.3), metallic=1, roughness=0.8, metallic_roughness_texture=uniform(0, 0.5, 0.5)),
        Material((0.9, 0.6, 0.3), metallic=0.5, roughness=0.4),
    ),
    "rough metal": (
        Material((1, 1, 1), metallic=1, base_color_texture=uniform(0.9, 0.6, 0.3)),
        Material((0.9, 0.6, 0.3), metallic=1),
    ),
    "flat normals": (
        Material((0.6, 0.5, 0.4), normal_texture=uniform(0.5, 0.5, 1.0)),
        Material((0.6, 0.5, 0.4)),
    ),
    "flat heights": (
        Material((0.6, 0.5, 0.4), bump_texture=uniform(0.7), bump_scale=9),
        Material((0.6, 0.5, 0.4)),
    ),
    "emission": (
        Material((0.2, 0.2, 0.2), emission=(4, 4, 2), emission_texture=uniform(0.5, 0.25, 1.0)),
        Material((0.2, 0.2, 0.2), emission=(2, 1, 2)),
    ),
    "transmission": (
        Material((1, 1, 1), roughness=0.2, transmission=1, transmission_texture=uniform(0.5, 0, 0)),
        Material((1, 1, 1), roughness=0.2, transmission=0.5),
    ),
    "frosted": (
        Material((1, 1, 1), roughness=0.6, transmission=1, metallic_roughness_texture=uniform(0, 0.5, 1)),
        Material((1, 1, 1), roughness=0.3, transmission=1),
    ),
    "specular": (
        Material((0.5, 0.2, 0.1), roughness=0.3, specular_texture=uniform(0, 0, 0, 0.25)),
        Material((0.5, 0.2, 0.1), roughness=0.3, specular=0.25),
    ),
}
"""A material with textures that are the same everywhere, and the one without that it stands for."""


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", ALIKE)
def test_a_texture_that_is_the_same_everywhere_is_a_number(name: str, in_blocks: bool) -> None:
    textured, plain = (pixels(things(material), in_blocks=in_blocks) for material in ALIKE[name])
    # Paths take the same turns but where rounding of half floats decides otherwise.
    different = np.abs(textured - plain).max(axis=2) > 0.02 * plain.max(axis=2) + 1e-3
    assert different.mean() < 0.02
    assert abs(textured.mean() / plain.mean() - 1) < 0.005


def test_kernels_for_textures_shade_what_has_none_as_others_do() -> None:
    material = Material((0.9, 0.6, 0.3), metallic=0.5, roughness=0.4)
    images = [pixels(things(material, with_every_slot=every)) for every in (True, False)]
    different = np.abs(images[0] - images[1]).max(axis=2) > 0.01 * images[1].max(axis=2) + 1e-4
    assert different.mean() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["half metal", "rough metal", "specular"])
def test_albedo_of_textured_layers_is_that_of_plain_ones(name: str) -> None:
    """The table over roughness of the device gives what rows of materials do: a white furnace."""
    textured = replace(ALIKE[name][0], base_color=(1, 1, 1))
    if textured.base_color_texture is not None:
        textured = replace(textured, base_color_texture=uniform(1, 1, 1))
    scene = Scene(
        Camera((1.1, 0.9, 1.4), (0, 0, 0), fov_y=36), Environment((1, 1, 1)), {"m": textured},
        (Object("o", shape("sphere"), "m"),),
    )  # fmt: skip
    np.testing.assert_allclose(render(scene, 256).mean(axis=(0, 1)), 1, atol=0.01)


def test_images_of_floats_make_no_light_and_take_none() -> None:
    """Values below 0 and above 1, in a furnace."""
    wild = Texture(Bitmap(np.float32([[[-3, 7, 1e9]], [[2, -1, 0.5]]])), filter="nearest")
    material = Material(
        (1, 1, 1), metallic=1, base_color_texture=wild, metallic_roughness_texture=wild, emission=(1, 1, 1),
        emission_texture=Texture(Bitmap(np.float32([[[-1, -1, -1]]]))),
    )  # fmt: skip
    scene = Scene(
        Camera((1.1, 0.9, 1.4), (0, 0, 0), fov_y=36), Environment((1, 1, 1)), {"m": material},
        (Object("o", shape("cube"), "m"),),
    )  # fmt: skip
    image = render(scene, 64)
    assert image.min() >= 0 and image.max() < 1.2


def full_of_textures() -> Scene:
    """Different textures in every slot, also of the second set of coordinates, and colours at corners."""
    scene = mixed_scene(max_bounces=3)
    cube = scene.object("red cube").mesh
    rng = np.random.default_rng(3)
    colored = replace(
        cube,
        uvs=(cube.uvs[0], 2 * cube.uvs[0][..., ::-1]),
        colors=rng.uniform(0.2, 1, (len(cube.faces), 3, 4)),
    )
    tiles = Texture(checker(), scale=(3, 2), rotation=20)
    return (
        scene.with_object("red cube", mesh=colored)
        .with_material(
            "red", base_color=(1, 1, 1), base_color_texture=Texture(checker(), uv_set=1, filter="nearest"),
            metallic=1, metallic_roughness_texture=tiles, specular_texture=Texture(checker()),
        )
        .with_material("floor", normal_texture=Texture(bumps(), scale=(5, 5)), normal_scale=0.7)
        .with_material("grey", emission=(1, 2, 3), emission_texture=Texture(checker(0, 255), wrap="mirror"))
        .with_material("glass", transmission_texture=Texture(checker(100, 255)), base_color_texture=tiles)
        .with_material("every", **{name: getattr(EVERY_SLOT, name) for name in ("transmission", *TEXTURES)})
    )  # fmt: skip


@pytest.mark.slow
def test_blocks_and_wavefront_agree() -> None:
    if not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    in_blocks, in_wavefront = (pixels(full_of_textures(), 4, tracer) for tracer in (True, False))
    close = np.isclose(in_blocks, in_wavefront, rtol=1e-3, atol=1e-4).all(axis=2)
    assert close.mean() > 0.98
    assert in_blocks.mean() == pytest.approx(in_wavefront.mean(), rel=0.01)


def test_colours_at_corners_are_those_of_the_surface() -> None:
    cube = shape("cube")
    tint = np.float32([0.5, 0.25, 1.0, 1.0])
    tinted = replace(cube, colors=np.broadcast_to(tint, (12, 3, 4)))
    plain = things(Material((0.4, 0.2, 0.6)))
    others = {o.name: o for o in plain.objects}
    colored = things(Material((0.8, 0.8, 0.6)))
    scenes = [
        replace(scene, objects=(others["floor"], Object("o", mesh, "m", (0, 0.5, 0)), others["lamp"]))
        for scene, mesh in ((plain, cube), (colored, tinted))
    ]
    np.testing.assert_allclose(*[pixels(scene) for scene in scenes], rtol=1e-3, atol=1e-4)


def test_first_hits_and_aovs_see_textures() -> None:
    scene = things(
        Material((1, 1, 1), base_color_texture=Texture(checker(), scale=(0, 0), offset=(0.0625, 0.0625)))
    )
    scene = replace(scene, settings=replace(scene.settings, aovs=True))
    session = Session(scene, device=device())
    session.render(1)
    expected = linear_from_srgb(np.array([30, 230, 230]) / 255)
    hits = session.first_hits()
    on_cube = hits.object_id == 1
    assert on_cube.sum() > 20
    np.testing.assert_allclose(hits.albedo[on_cube], np.broadcast_to(expected, (on_cube.sum(), 3)), atol=1e-5)
    inside = on_cube & np.roll(on_cube, 1, 0) & np.roll(on_cube, -1, 0) & np.roll(on_cube, 1, 1)
    albedo = session.pass_image("albedo")
    assert np.isclose(albedo[inside], expected, atol=1e-4).all(axis=1).mean() > 0.9


def facing(material: Material, **placed: Any) -> npt.NDArray[np.float64]:
    """(3,) the radiance of a wide plane under light from +x, seen from above."""
    sun = Object("sun", shape("plane"), "lamp", (40, 40, 0), (0, 0, 135), (8, 1, 8))
    plane = Object("o", shape("plane"), "m", **{"scale": (2, 1, 2), **placed})
    scene = Scene(
        Camera((0, 5, 0.01), (0, 0, 0), fov_y=8), Environment(), {"m": material, "lamp":
        Material(emission=(99, 99, 99))}, (sun, plane),
    )  # fmt: skip
    return np.asarray(render(scene, 64, max_bounces=0).mean(axis=(0, 1)))


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_normal_maps_lean_along_the_tangent_and_upwards_in_the_image(turn: int) -> None:
    """A map that leans by 45 degrees to one side of the image, on a plane that is turned until that side
    looks to the light: it then is lit at right angles, 2^0.5 times as bright as without a map."""
    flat = facing(Material((0.5, 0.5, 0.5), specular=0))
    lean = np.radians(turn)
    # u grows to +x; up in the image is -z. A turn about +y takes +x to -z.
    towards = (np.cos(lean) / 2**0.5, -np.sin(lean) / 2**0.5, 2**-0.5)
    texture = uniform(*((np.array(towards) + 1) / 2).tolist())
    material = Material((0.5, 0.5, 0.5), specular=0, normal_texture=texture)
    lit = facing(material, rotation=(0, turn, 0))
    np.testing.assert_allclose(lit / flat, 2**0.5, rtol=0.03)
    away = facing(material, rotation=(0, turn + 180, 0))
    np.testing.assert_allclose(away / flat, 0, atol=0.03)


@pytest.mark.parametrize(
    ("leans", "scale"), [((1, 0), (-2, 1, 2)), ((-1, 0), (2, 1, 2)), ((0, 1), (2, 1, -2))]
)
def test_normal_maps_are_mirrored_with_their_object(leans: Vector2, scale: Vector) -> None:
    """Turned so that what the map of a plane that is not mirrored leans to looks away from the light."""
    flat = facing(Material((0.5, 0.5, 0.5), specular=0))
    normal = np.array([*leans, 1]) / 2**0.5
    material = Material((0.5, 0.5, 0.5), specular=0, normal_texture=uniform(*((normal + 1) / 2).tolist()))
    turn = 270 if leans[1] else 0
    bright, dark = (facing(material, rotation=(0, turn + more, 0), scale=scale) for more in (180, 0))
    np.testing.assert_allclose(bright / flat, 2**0.5, rtol=0.03)
    np.testing.assert_allclose(dark / flat, 0, atol=0.03)


def test_the_scale_of_a_normal_map_is_that_of_its_slope() -> None:
    flat = facing(Material((0.5, 0.5, 0.5), specular=0))
    texture = uniform(*((np.array([2**-0.5, 0, 2**-0.5]) + 1) / 2).tolist())
    for scale in (0.0, 0.5, 1.0):
        lit = facing(Material((0.5, 0.5, 0.5), specular=0, normal_texture=texture, normal_scale=scale))
        cosine = (1 + scale) / (2 * (1 + scale**2)) ** 0.5
        np.testing.assert_allclose(lit / flat, cosine * 2**0.5, rtol=0.03)


# Height maps.


def hills(size: int, waves: int = 2) -> Array:
    """(size, size) heights from 0 to 1 that repeat."""
    x = (np.arange(size) + 0.5) / size * 2 * np.pi * waves
    return np.asarray(0.5 + 0.25 * (np.sin(x)[None] + np.cos(x)[:, None]))


def normal_map_of(heights: Array, metres: float) -> Bitmap:
    """Of a height map over a square metre: from the differences of neighbours."""
    size = len(heights)
    along_u = (np.roll(heights, -1, 1) - np.roll(heights, 1, 1)) * size / 2 * metres
    along_v = (np.roll(heights, -1, 0) - np.roll(heights, 1, 0)) * size / 2 * metres
    normals = np.stack([-along_u, along_v, np.ones_like(heights)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Bitmap((normals + 1) / 2)


def seen_normals(
    material: Material, mesh: Mesh, in_blocks: bool = True, size: float = 1.0, **placed: Any
) -> Array:
    """(44, 44, 3) shading normals of most of a thing of that size, seen from above."""
    camera = Camera((0, 5, 0), (0, 0, 0), (0, 0, -1), projection="orthographic", ortho_height=0.9 * size)
    scene = Scene(camera, Environment(), {"m": material}, (Object("o", mesh, "m", **placed),))
    settings = small_settings(size=(44, 44), aovs=True)
    session = session_of(device(), replace(scene, settings=settings), in_blocks, 16)
    session.render(16)
    return session.pass_image("normal")


@pytest.mark.parametrize("in_blocks", [True, False])
def test_a_height_map_is_the_normal_map_of_its_slopes(in_blocks: bool) -> None:
    """Of a plane as it is, of a mirrored and of a turned one, and of a small one."""
    metres, heights = 0.1, hills(64)
    bumped = Material(bump_texture=Texture(Bitmap(heights)), bump_scale=metres)
    mapped = Material(normal_texture=Texture(normal_map_of(heights, metres)))
    plane = shape("plane")
    for placed in ({}, {"scale": (-1, 1, 1)}, {"rotation": (0, 30, 0)}):
        images = [seen_normals(material, plane, in_blocks, **placed) for material in (bumped, mapped)]
        assert np.abs(images[0][..., [0, 2]]).max() > 0.25
        np.testing.assert_allclose(*images, atol=0.012)
    # Slopes are of metres in the world.
    small = seen_normals(replace(bumped, bump_scale=metres / 10), plane, in_blocks, 0.1, scale=(0.1, 1, 0.1))
    whole = seen_normals(bumped, plane, in_blocks)
    np.testing.assert_allclose(small, whole, atol=1e-3)


def test_a_sine_of_heights_has_the_normals_of_its_derivative() -> None:
    """On a turned plane whose texture is scaled, and beside a normal map that leans."""
    waves, metres, size = 2, 0.03, 128
    x = (np.arange(size) + 0.5) / size
    texture = Texture(Bitmap(np.tile(np.sin(2 * np.pi * x) / 2 + 0.5, (4, 1))), scale=(waves, 1))
    image = seen_normals(Material(bump_texture=texture, bump_scale=metres), shape("plane"))
    place = (np.arange(44) + 0.5 - 22) / 44 * 0.9 + 0.5
    slope = metres / 2 * 2 * np.pi * waves * np.cos(2 * np.pi * waves * place)
    expected = np.stack([-slope, np.ones(44), np.zeros(44)], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), atol=0.01)
    lean = np.array([0.8, 0, 1]) / np.hypot(0.8, 1)
    both = Material(
        bump_texture=texture, bump_scale=metres, normal_texture=uniform(*((lean + 1) / 2).tolist())
    )
    expected = np.stack([0.8 - slope, np.ones(44), np.zeros(44)], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    image = seen_normals(both, shape("plane"))
    np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), atol=0.01)


# Textures of emission.


def sign(texture: Texture | None, mesh: Mesh | None = None, **changes: Any) -> Scene:
    """A sign over a floor; one pixel in sixteen of it shines."""
    lamp = Material((0, 0, 0), specular=0, emission=(8, 8, 8), emission_texture=texture, **changes)
    objects = (
        Object("floor", shape("plane"), "floor", scale=(4, 1, 4)),
        Object("sign", mesh or grid(6), "lamp", (0, 1, -0.6), (60, 0, 0), (1.5, 1, 1)),
    )
    materials = {"floor": Material((0.6, 0.6, 0.6), specular=0), "lamp": lamp}
    return Scene(Camera((0, 0.8, 2.5), (0, 0.2, 0), fov_y=45), Environment(), materials, objects)


def grid(cells: int) -> Mesh:
    """A plane of many faces."""
    x = np.linspace(-0.5, 0.5, cells + 1)
    vertices = np.array([(a, 0, b) for b in x for a in x])
    i = np.arange(cells * (cells + 1)).reshape(cells, -1)[:, :-1].ravel()
    faces = np.concatenate(
        [np.stack([i, i + cells + 1, i + 1], 1), np.stack([i + 1, i + cells + 1, i + cells + 2], 1)]
    )
    return Mesh(vertices, faces, uvs=(vertices[faces][..., [0, 2]] + 0.5,))


def windows() -> Texture:
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[2:4, 5:7] = (255, 200, 100)
    pixels[6, 1] = (0, 120, 255)
    return Texture(Bitmap(pixels), filter="nearest")


@pytest.mark.statistics
@pytest.mark.parametrize("double_sided", [False, True])
def test_light_and_bsdf_sampling_find_the_same_light_of_a_texture(double_sided: bool) -> None:
    scene = sign(windows(), double_sided=double_sided)
    both = repeat(scene, 128, max_bounces=0)
    for feature in ("MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"):
        alone = repeat(scene, 512, max_bounces=0, on=Device(features=(feature,)))
        assert_same_mean(both, alone, relative=0.02)


@pytest.mark.slow
def test_a_texture_of_emission_is_as_several_lamps() -> None:
    """The lit pixels of a sign, each a face of its own, against faces of lamps where they are."""
    whole = repeat(sign(windows(), grid(8)), 128, max_bounces=1)
    mesh = grid(8)
    lit = []
    for color, rows, columns in (((1, 0.5776, 0.1274), (2, 4), (5, 7)), ((0, 0.1878, 1), (6, 7), (1, 2))):
        middle = mesh.uvs[0].mean(axis=1) * 8
        inside = ((middle >= [columns[0], rows[0]]) & (middle < [columns[1], rows[1]])).all(axis=1)
        lit.append((color, Mesh(mesh.vertices, mesh.faces[inside])))
    scene = sign(None)
    placed = scene.object("sign")
    dark = Object("dark", mesh, "dark", transform=placed.transform)
    objects = [scene.object("floor"), replace(dark, position=(0, 1, -0.6 - 1e-4))]
    materials = {"floor": scene.materials["floor"], "dark": Material((0, 0, 0), specular=0)}
    for i, (color, part) in enumerate(lit):
        materials[f"lit {i}"] = Material((0, 0, 0), specular=0, emission=tuple(8 * c for c in color))
        objects.append(Object(f"lit {i}", part, f"lit {i}", transform=placed.transform))
    apart = repeat(replace(scene, materials=materials, objects=tuple(objects)), 128, max_bounces=1)
    assert_same_mean(whole, apart, relative=0.02)


def test_faces_that_shine_are_chosen_by_what_they_emit() -> None:
    """Noise of a sign of which little shines is near that of lamps in its place."""
    session = Session(sign(windows(), grid(8)), (32, 32), device=device())
    shares = session._tables.lights
    # 4 pixels of one colour and 1 of the other, of two triangles each.
    assert shares.count == 10


# Edits.

TEXTURE_EDITS: dict[str, Callable[[Scene], Scene]] = {
    "swap": lambda s: s.with_material("red", base_color_texture=Texture(checker(0, 90))),
    "take away": lambda s: s.with_material("red", base_color_texture=None),
    "bumps": lambda s: s.with_material("red", normal_texture=Texture(bumps())),
    "flatten": lambda s: s.with_material("floor", normal_scale=0.1),
    "rough": lambda s: s.with_material("red", bump_texture=Texture(Bitmap(hills(16))), bump_scale=0.2),
    "tile": lambda s: s.with_material("grey", emission_texture=Texture(checker(0, 255), scale=(2, 2))),
    "no glow": lambda s: s.with_material("grey", emission_texture=None),
    "glow": lambda s: s.with_material("red", emission=(2, 2, 2), emission_texture=Texture(checker(0, 255))),
    "unwrap": lambda s: s.with_object("red cube", mesh=replace(s.object("red cube").mesh, uvs=())),
    "bleach": lambda s: s.with_object("red cube", mesh=replace(s.object("red cube").mesh, colors=None)),
    "clear": lambda s: s.with_material("glass", transmission_texture=None),
    "move": lambda s: s.with_object("grey drum", position=(0.4, 0.5, 0.4)),
}


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", TEXTURE_EDITS)
def test_a_path_that_met_nothing_that_changed_brings_the_same(name: str, in_blocks: bool) -> None:
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    old = replace(full_of_textures(), settings=small_settings(max_bounces=3))
    check(traced_pairs(device(), old, TEXTURE_EDITS[name](old), in_blocks))


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["spiral", "impact"])
def test_after_edits_the_picture_is_that_of_a_fresh_start(strategy: str) -> None:
    scene = replace(full_of_textures(), settings=small_settings())
    assert_edits_converge(device(), scene, TEXTURE_EDITS.values(), strategy)
