"""Whole renders of layered materials: furnaces, both techniques, both schedules, edits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.kernels import device
from support.law import assert_edits_converge
from support.pairs import check, traced_pairs
from support.renders import assert_same_mean, pixels, render, repeat
from support.small_scenes import mixed_scene, small_settings

from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture

WHITE = (1.0, 1.0, 1.0)
LACQUER = Material((0.6, 0.1, 0.1), roughness=0.6, clearcoat=0.9, clearcoat_roughness=0.3)
CLOTH = Material((0.2, 0.1, 0.3), specular=0.2, sheen_color=(0.9, 0.5, 0.6), sheen_roughness=0.5)
BRUSHED = Material((0.9, 0.7, 0.4), metallic=1, roughness=0.4, anisotropy=0.7, anisotropy_rotation=30)
OIL = Material((0.1, 0.1, 0.1), roughness=0.3, iridescence=1, iridescence_ior=1.6)
LEAF = Material(
    (0.2, 0.4, 0.1), roughness=0.5, diffuse_transmission=0.6, diffuse_transmission_color=(0.5, 0.7, 0.1)
)
TINTED = Material((0.2, 0.2, 0.6), roughness=0.4, specular_color=(3, 1, 0.4))
WALL = Material(
    (0.9, 1, 0.9), roughness=0.35, transmission=1, thin_walled=True, specular_color=(1, 0.8, 1),
    absorption=(9, 4, 2),
)  # fmt: skip
"""A wall absorbs nothing, whatever bodies of its material would."""
PRISM = Material(WHITE, roughness=0.3, transmission=1, dispersion=4, ior=1.6)
WINDOW = Material(WHITE, roughness=0, transmission=0.9, thin_walled=True)
"""A clear wall."""
SIGN = Material((0.9, 0.5, 0.2), unlit=True)


def room() -> Scene:
    """Something of everything, under a lamp, a light and a sky."""
    materials = {
        "lacquer": LACQUER, "cloth": CLOTH, "brushed": BRUSHED, "oil": OIL, "leaf": LEAF, "tinted": TINTED,
        "wall": WALL, "prism": PRISM, "sign": SIGN, "window": WINDOW, "lamp": Material(emission=(9, 9, 8)),
    }  # fmt: skip
    objects = (
        Object("floor", shape("plane"), "tinted", scale=(8, 1, 8)),
        Object("lacquer", shape("cube"), "lacquer", (-1.5, 0.4, 0), (0, 30, 0), (0.7, 0.8, 0.7)),
        Object("cloth", shape("sphere"), "cloth", (-0.7, 0.4, 0.6), scale=(0.8, 0.8, 0.8)),
        Object("brushed", shape("cylinder"), "brushed", (0, 0.4, -0.2), (0, 0, 20), (0.7, 0.8, 0.7)),
        Object("oil", shape("sphere"), "oil", (0.9, 0.35, 0.6), scale=(0.7, 0.7, 0.7)),
        Object("leaf", shape("plane"), "leaf", (0.9, 0.7, -0.6), (50, 20, 0), (0.9, 1, 0.9)),
        Object("wall", shape("plane"), "wall", (-0.5, 0.6, 1.1), (80, 10, 0), (0.8, 1, 0.8)),
        Object("prism", shape("cube"), "prism", (1.7, 0.4, 0), (20, 40, 0), (0.6, 0.6, 0.6)),
        Object("window", shape("plane"), "window", (1.1, 1.2, 0.6), (40, -30, 0), (1.2, 1, 0.9)),
        Object("sign", shape("plane"), "sign", (0, 1.5, -1.2), (90, 0, 0), (1.5, 1, 0.4)),
        Object("lamp", shape("plane"), "lamp", (0.5, 2.6, -0.6), (180, 0, 0), (0.8, 1, 0.8)),
    )
    lights = (Light("pane", "rectangle", (-1.5, 2.2, 1.5), (-60, -40, 0), size=(0.8, 0.8), radiance=6),)
    camera = Camera((0, 1.5, 4.2), (0, 0.5, 0), fov_y=42)
    return Scene(camera, Environment((0.2, 0.25, 0.3)), materials, objects, small_settings(), lights)


def of_all_kernels(scene: Scene) -> Scene:
    """With materials that nothing is made of, but which ask for the kernels of all traits, whatever an edit
    takes away."""
    spare = {f"spare {name}": material for name, material in room().materials.items()}
    return replace(scene, materials={**scene.materials, **spare})


def test_blocks_and_wavefront_agree() -> None:
    if not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    scene = room()
    images = [
        np.stack([pixels(scene, 16, in_blocks, size=(48, 32), seed=seed) for seed in range(8)])
        for in_blocks in (True, False)
    ]
    assert_same_mean(*images)


@pytest.mark.statistics
@pytest.mark.parametrize("technique", ["MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"])
def test_each_technique_alone_gives_the_same(technique: str) -> None:
    arguments: dict[str, Any] = {"max_bounces": 2, "transmission_bounces": 6, "size": (32, 32)}
    both = repeat(room(), 64, **arguments)
    alone = repeat(room(), 256, on=Device(features=(technique,)), **arguments)
    assert_same_mean(both, alone, relative=0.02)


# ----------------------------------------------------------------------------------------- furnaces

FURNACE = {
    "thin wall": Material(WHITE, roughness=0, transmission=1, thin_walled=True),
    "half a wall": Material(WHITE, roughness=0.2, transmission=0.5, thin_walled=True),
    "half a window": Material(WHITE, roughness=0, transmission=0.5, specular=0.7, thin_walled=True),
    "bubble": Material(WHITE, roughness=0, transmission=1, thin_walled=True, iridescence=1),
    "prism": Material(WHITE, roughness=0, transmission=1, dispersion=3),
    "iridescent glass": Material(WHITE, roughness=0, transmission=1, iridescence=1, iridescence_ior=1.8),
    "tinted glass": Material(WHITE, roughness=0, transmission=1, specular_color=(0.2, 1, 2)),
    "paper": Material(WHITE, specular=0, diffuse_transmission=0.5),
    "brushed": Material(WHITE, metallic=1, roughness=0.5, anisotropy=0.8),
}
"""Things that absorb nothing; what they let through is white."""


@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", FURNACE)
def test_white_things_are_not_seen_in_a_white_world(name: str, in_blocks: bool) -> None:
    """Bodies that enclose something, so that light meets them again and again."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    # Nothing is made of the others, which ask for the same kernels for all.
    materials = {"one": FURNACE[name], **FURNACE}
    objects = (Object("ball", shape("sphere"), "one"), Object("drum", shape("cylinder"), "one", (0.9, 0, 0)))
    scene = Scene(Camera((0.4, 0.6, 3), (0.4, 0, 0), fov_y=40), Environment(WHITE), materials, objects)
    settings = small_settings(max_bounces=60, transmission_bounces=60, roulette_depth=60)
    image = pixels(replace(scene, settings=settings), 64, in_blocks)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 1, atol=0.01)


def test_the_pane_of_gltf_is_a_thin_wall() -> None:
    """What is straight behind it is seen straight through it: (1 - r) / (1 + r) of it, where r = 0.04 is what
    one of its sides reflects."""
    materials = {
        "pane": Material(WHITE, roughness=0, transmission=1, thin_walled=True),
        "lamp": Material(emission=(5, 2, 1)),
    }
    objects = (
        Object("pane", shape("plane"), "pane", (0, 0, 0), (90, 0, 0), (2, 1, 2)),
        Object("lamp", shape("plane"), "lamp", (0, 0, -3), (90, 0, 0), (0.3, 1, 0.3)),
    )
    scene = Scene(Camera((0, 0, 3), (0, 0, 0), fov_y=2), Environment((0, 0, 0)), materials, objects)
    image = render(scene, 1024, size=(8, 8), transmission_bounces=8)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), np.array([5, 2, 1]) * 0.96 / 1.04, rtol=0.01)


@pytest.mark.parametrize("in_blocks", [True, pytest.param(False, marks=pytest.mark.statistics)])
def test_light_behind_a_window_is_sampled(in_blocks: bool) -> None:
    """As much arrives through a clear wall as through one that is tinted by next to nothing, with a fraction
    of the noise."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    spread, mean = [], []
    for tint in (1.0, 0.9999):
        window = Material((tint,) * 3, roughness=0, transmission=1, thin_walled=True)
        assert window.is_clear_wall == (tint == 1)
        materials = {
            "floor": Material((0.5, 0.5, 0.5), specular=0), "window": window,
            "lamp": Material((0, 0, 0), specular=0, emission=(20, 20, 20)),
        }  # fmt: skip
        objects = (
            Object("floor", shape("plane"), "floor", scale=(4, 1, 4)),
            Object("window", shape("plane"), "window", (0, 1, 0), (10, 0, 0), (4, 1, 4)),
            Object("lamp", shape("plane"), "lamp", (0, 2, 0), (180, 0, 0), (0.3, 1, 0.3)),
        )
        scene = Scene(
            Camera((0, 0.6, 1.4), (0, 0, 0), fov_y=50), Environment((0, 0, 0)), materials, objects,
            small_settings(size=(16, 16), max_bounces=1, transmission_bounces=8),
        )  # fmt: skip
        images = [pixels(scene, 64, in_blocks, seed=seed) for seed in range(8)]
        spread.append(float(np.std(images, axis=0).mean()))
        mean.append(float(np.mean(images)))
    assert mean[0] == pytest.approx(mean[1], rel=0.05)
    assert spread[0] < 0.3 * spread[1]


def test_a_window_mirrors_as_much_as_both_of_its_sides() -> None:
    """At 45 degrees, a lamp."""
    materials = {"window": WINDOW, "lamp": Material((0, 0, 0), specular=0, emission=(5, 5, 5))}
    materials["window"] = replace(WINDOW, transmission=1)
    objects = (
        Object("window", shape("plane"), "window", scale=(3, 1, 3)),
        Object("lamp", shape("plane"), "lamp", (2, 2, 0), (0, 0, 135), (1, 1, 1)),
    )
    scene = Scene(Camera((-2, 2, 0), (0, 0, 0), fov_y=1), Environment((0, 0, 0)), materials, objects)
    image = render(scene, 1024, size=(8, 8), transmission_bounces=4)
    c, inside = np.sqrt(0.5), np.sqrt(1 - 0.5 / 1.5**2)
    across, along = (c - 1.5 * inside) / (c + 1.5 * inside), (1.5 * c - inside) / (1.5 * c + inside)
    f = (across**2 + along**2) / 2
    np.testing.assert_allclose(image.mean(), 5 * 2 * f / (1 + f), rtol=0.02)


def test_a_window_is_picked_and_not_what_is_behind() -> None:
    scene = room().with_object("window", position=(0, 0.5, 1.5), rotation=(90, 0, 0), scale=(9, 1, 9))
    session = Session(scene, device=device())
    assert {session.pick(at) for at in ((5, 5), (22, 14), (30, 9), (40, 2))} == {"window"}


def test_a_sheet_is_as_bright_behind_as_it_lets_through() -> None:
    """A Lambertian sheet in even light from one side has, on the other, its share of it."""
    sheet = Material(
        (0, 0, 0), specular=0, diffuse_transmission=0.8, diffuse_transmission_color=(1, 0.5, 0.25)
    )
    objects = (
        Object("sheet", shape("plane"), "sheet", (0, 0, 0), (90, 0, 0), (1, 1, 1)),
        # Half a world of light: a wide lamp close behind, and darkness in front.
        Object("lamp", shape("plane"), "lamp", (0, 0, -0.01), (90, 0, 0), (50, 1, 50)),
    )
    materials = {"sheet": sheet, "lamp": Material((0, 0, 0), specular=0, emission=WHITE)}
    scene = Scene(Camera((0, 0, 2), (0, 0, 0), fov_y=20), Environment((0, 0, 0)), materials, objects)
    image = render(scene, 256, size=(8, 8))
    np.testing.assert_allclose(image.mean(axis=(0, 1)), [0.8, 0.4, 0.2], rtol=0.02)


def test_colours_part_in_a_prism_as_snell_says() -> None:
    """Through a prism with its axis along y a narrow lamp is seen in each colour where the index of
    refraction of that colour puts it."""
    ior, dispersion, apex = 1.5, 5.0, np.radians(20)
    half = 0.5 * np.tan(apex / 2)
    corners = np.array(
        [[0, y, 0.5] for y in (-2, 2)] + [[x, y, -0.5] for x in (-2 * half, 2 * half) for y in (-2, 2)]
    )
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1], [2, 3, 5], [2, 5, 4], [0, 2, 4], [1, 5, 3]]
    )  # fmt: skip
    body = Mesh(corners.astype(np.float32), faces.astype(np.int32))
    materials = {"prism": Material(WHITE, roughness=0, transmission=1, ior=ior, dispersion=dispersion)}
    # A ray along +x meets the side whose normal leans back by half the apex.
    spread = 0.025 * (ior - 1) * dispersion
    for channel, index in enumerate((ior - spread, ior, ior + spread)):
        inside = np.arcsin(np.sin(apex / 2) / index)
        leaving = np.arcsin(np.clip(index * np.sin(apex - inside), -1, 1))
        turned = leaving - apex / 2  # towards the base, which is at -z
        toward = np.array([np.cos(turned), 0, -np.sin(turned)])
        scene = Scene(
            Camera((-4, 0, 0), (0, 0, 0), fov_y=0.02), Environment((0, 0, 0)),
            {**materials, "lamp": Material((0, 0, 0), specular=0, emission=WHITE)},
            (
                Object("prism", body, "prism"),
                Object("lamp", shape("sphere"), "lamp", tuple((30 * toward).tolist()), scale=(0.3, 9, 0.3)),
            ),
        )  # fmt: skip
        image = render(scene, 256, size=(4, 4), max_bounces=1, transmission_bounces=8).mean(axis=(0, 1))
        assert image.argmax() == channel and image[channel] > 0.7
        assert (np.delete(image, channel) < 0.05 * image[channel]).all()


def test_unlit_surfaces_shine_with_their_base_colour_and_reflect_nothing() -> None:
    texture = Texture(Bitmap(np.full((1, 1, 3), 0.5, np.float32)))
    for material, expected in (
        (SIGN, SIGN.base_color),
        (replace(SIGN, base_color_texture=texture, metallic=1.0, clearcoat=1.0), [0.45, 0.25, 0.1]),
    ):
        materials = {"sign": material}
        # From behind too, and whatever shines on it.
        for turn in (90, -90):
            scene = Scene(
                Camera((0, 0, 2), (0, 0, 0), fov_y=20), Environment((3, 3, 3)), materials,
                (Object("sign", shape("plane"), "sign", (0, 0, 0), (turn, 0, 0), (2, 1, 2)),),
            )  # fmt: skip
            image = render(scene, 16, size=(4, 4))
            np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), rtol=1e-4)


def test_unlit_surfaces_have_their_base_colour_in_auxiliary_images() -> None:
    scene = room().with_object("sign", position=(0, 0.5, 1), scale=(20, 1, 20))
    session = Session(scene, device=device(), settings=replace(scene.settings, aovs=True))
    session.render(1)
    albedo = session.pass_image("albedo")
    np.testing.assert_allclose(albedo[14, 22], SIGN.base_color, rtol=1e-4)
    np.testing.assert_allclose(session.first_hits().albedo[14, 22], SIGN.base_color, rtol=1e-4)


# -------------------------------------------------------------------------------- numbers and textures


def uniform(*values: float) -> Texture:
    """The same numbers everywhere, as floats."""
    return Texture(Bitmap(np.broadcast_to(np.float32(values), (2, 2, len(values)))))


ALIKE: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "specular tint": ({"specular_color": (1.5, 0.5, 0.25)},
                      {"specular_color": (3, 1, 1), "specular_color_texture": uniform(0.5, 0.5, 0.25)}),
    "clearcoat": ({"clearcoat": 0.5, "clearcoat_roughness": 0.25},
                  {"clearcoat": 1, "clearcoat_roughness": 0.5, "clearcoat_texture": uniform(0.5, 0, 0),
                   "clearcoat_roughness_texture": uniform(0, 0.5, 0)}),
    "sheen": ({"sheen_color": (0.5, 0.25, 0.5), "sheen_roughness": 0.25},
              {"sheen_color": (1, 1, 0.5), "sheen_roughness": 0.5,
               "sheen_color_texture": uniform(0.5, 0.25, 1),
               "sheen_roughness_texture": uniform(0, 0, 0, 0.5)}),
    "anisotropy": ({"anisotropy": 0.5, "anisotropy_rotation": 120},
                   {"anisotropy": 1, "anisotropy_rotation": 30, "anisotropy_texture": uniform(0.5, 1, 0.5)}),
    "iridescence": ({"iridescence": 0.5, "iridescence_thickness": 300},
                    {"iridescence": 1, "iridescence_thickness": 500, "iridescence_least_thickness": 100,
                     "iridescence_texture": uniform(0.5, 0, 0),
                     "iridescence_thickness_texture": uniform(0, 0.5, 0)}),
    "translucency": ({"diffuse_transmission": 0.5, "diffuse_transmission_color": (0.5, 0.25, 0.5)},
                     {"diffuse_transmission": 1, "diffuse_transmission_color": (1, 1, 0.5),
                      "diffuse_transmission_texture": uniform(0, 0, 0, 0.5),
                      "diffuse_transmission_color_texture": uniform(0.5, 0.25, 1)}),
}  # fmt: skip
"""Numbers, and textures that say the same."""


@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", ALIKE)
def test_a_texture_that_is_the_same_everywhere_is_a_number(name: str, in_blocks: bool) -> None:
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    plain, textured = ({"base_color": (0.5, 0.5, 0.5), "roughness": 0.4, **values} for values in ALIKE[name])
    every = {f"every {i}": Material(**values) for i, (_, values) in enumerate(ALIKE.values())}
    images = []
    for values in (plain, textured):
        scene = room()
        scene = replace(scene, materials={**scene.materials, **every, "lacquer": Material(**values)})
        images.append(pixels(scene, 8, in_blocks))
    np.testing.assert_allclose(images[0], images[1], rtol=2e-3, atol=2e-3)
    assert np.abs(images[0] - pixels(room(), 8, in_blocks)).max() > 0.01  # it is seen


@pytest.mark.parametrize("in_blocks", [True, False])
def test_a_clearcoat_lies_smooth_on_bumps_unless_it_has_some(in_blocks: bool) -> None:
    """A black base that looks all to one side below a coat: the coat mirrors a lamp where a flat one does;
    with the same map of its own it does so no more."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    leaning = np.float32([np.sin(0.4), 0, np.cos(0.4)]) / 2 + 0.5
    lean = Texture(Bitmap(np.broadcast_to(leaning, (2, 2, 3))))
    coat = Material((0, 0, 0), roughness=1, specular=0, clearcoat=1, clearcoat_roughness=0.2)
    means = {}
    for name, material in {
        "flat": replace(coat, clearcoat_normal_texture=uniform(0.5, 0.5, 1)),
        "bumps below": replace(coat, normal_texture=lean, clearcoat_normal_texture=uniform(0.5, 0.5, 1)),
        "no map of its own": replace(coat, normal_texture=lean),
        "bumps on it": replace(coat, clearcoat_normal_texture=lean),
    }.items():
        scene = Scene(
            Camera((-2, 2, 0), (0, 0, 0), fov_y=8), Environment((0, 0, 0)),
            {"coat": material, "lamp": Material((0, 0, 0), specular=0, emission=(9, 9, 9))},
            (
                Object("floor", shape("plane"), "coat", scale=(3, 1, 3)),
                Object("lamp", shape("plane"), "lamp", (2, 2, 0), (0, 0, 135), (0.5, 1, 0.5)),
            ),
            small_settings(size=(16, 16)),
        )  # fmt: skip
        means[name] = float(pixels(scene, 64, in_blocks).mean())
    assert means["flat"] > 0.1
    # The frame in which the coat is sampled is that of the base: the same up to noise.
    assert means["bumps below"] == pytest.approx(means["flat"], rel=0.05)
    assert means["no map of its own"] == pytest.approx(means["flat"], rel=0.05)
    assert means["bumps on it"] < 0.05 * means["flat"]


@pytest.mark.parametrize("in_blocks", [True, False])
def test_reflections_are_stretched_across_the_grooves(in_blocks: bool) -> None:
    """On brushed metal the reflection of a lamp is longer along the tangent, and turned with it."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    extents = []
    for turn in (0, 90):
        brushed = Material(WHITE, metallic=1, roughness=0.25, anisotropy=0.6, anisotropy_rotation=turn)
        scene = Scene(
            Camera((0, 4, 0), (0, 0, 0), up=(0, 0, -1), fov_y=60), Environment((0, 0, 0)),
            {"floor": brushed},
            (Object("floor", shape("plane"), "floor", scale=(6, 1, 6)),),
            small_settings(size=(32, 32)),
            (Light("ball", "sphere", (0, 4.5, 0), radius=0.1, radiance=100, camera_visible=False),),
        )  # fmt: skip
        image = pixels(scene, 64, in_blocks, max_bounces=1).mean(axis=2)
        place = np.arange(32) - 15.5
        across, up = image.sum(axis=0), image.sum(axis=1)
        extents.append([np.sqrt((w * place**2).sum() / w.sum()) for w in (across, up)])
    (along_u, across_u), (turned_u, turned_v) = extents
    assert along_u > 1.3 * across_u
    assert turned_v == pytest.approx(along_u, rel=0.1) and turned_u == pytest.approx(across_u, rel=0.1)


# ------------------------------------------------------------------------------------------- edits

EDITS: dict[str, Callable[[Scene], Scene]] = {
    "polish": lambda s: s.with_material("lacquer", clearcoat_roughness=0.1),
    "no coat": lambda s: s.with_material("lacquer", clearcoat=0),
    "fuzz": lambda s: s.with_material("cloth", sheen_color=(0.1, 0.9, 0.2), sheen_roughness=0.8),
    "turn": lambda s: s.with_material("brushed", anisotropy_rotation=100, anisotropy=0.9),
    "film": lambda s: s.with_material("oil", iridescence_thickness=250),
    "leaf": lambda s: s.with_material("leaf", diffuse_transmission=0.1),
    "tint": lambda s: s.with_material("tinted", specular_color=(0.2, 1, 3)),
    "wall": lambda s: s.with_material("wall", thin_walled=False),
    "prism": lambda s: s.with_material("prism", dispersion=0.5),
    "frost a window": lambda s: s.with_material("window", roughness=0.4),
    "move a window": lambda s: s.with_object("window", position=(0.7, 1.0, 0.8)),
    "sign": lambda s: s.with_material("sign", unlit=False),
    "move a leaf": lambda s: s.with_object("leaf", position=(0.6, 0.9, -0.4)),
}


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", EDITS)
def test_a_path_that_met_nothing_that_changed_brings_the_same(name: str, in_blocks: bool) -> None:
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    old = of_all_kernels(replace(room(), settings=small_settings(max_bounces=3)))
    check(traced_pairs(device(), old, EDITS[name](old), in_blocks))


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["spiral", "impact"])
def test_after_edits_the_picture_is_that_of_a_fresh_start(strategy: str) -> None:
    assert_edits_converge(device(), of_all_kernels(room()), EDITS.values(), strategy)


@pytest.mark.slow
def test_a_material_gets_its_first_layer_by_an_edit() -> None:
    """The kernels become others with it, and are what they were when it goes."""
    added: list[Callable[[Scene], Scene]] = [
        lambda s: s.with_material("red", clearcoat=1.0, sheen_color=(0.5, 0.5, 0.9), sheen_roughness=0.4),
        lambda s: s.with_material("red", clearcoat=0.0, sheen_color=(0, 0, 0)),
    ]
    scene = mixed_scene()
    assert_edits_converge(device(), scene, added[:1], "impact")
    assert_edits_converge(device(), scene, added, "spiral")
