"""Surfaces that cover what is behind them in part: cl/path/coverage.cl, cl/cpu/cutouts.cl."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.law import assert_edits_converge
from support.pairs import check, traced_pairs
from support.renders import assert_same_mean, pixels, render, repeat
from support.small_scenes import mixed_scene, small_settings

from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture

Array = npt.NDArray[np.floating]
BLACK = Material((0, 0, 0), specular=0, double_sided=True)


def gauze(alpha: float, **changes: Any) -> Material:
    return replace(BLACK, alpha=alpha, alpha_mode="blend", **changes)


def holes() -> Texture:
    """Black, with a pattern of holes on 6 x 6 pixels that has no symmetry."""
    pixels = np.zeros((6, 6, 4), np.uint8)
    pixels[..., 3] = 255
    pixels[1:3, 2:5, 3] = pixels[4, 0, 3] = pixels[5, 3:, 3] = 60
    pixels[0, 0, 3] = 200
    return Texture(Bitmap(pixels), filter="nearest")


def grid(cells: int) -> Mesh:
    x = np.linspace(-0.5, 0.5, cells + 1)
    vertices = np.array([(a, 0, b) for b in x for a in x])
    i = np.arange(cells * (cells + 1)).reshape(cells, -1)[:, :-1].ravel()
    below, above = np.stack([i, i + cells + 1, i + 1], 1), np.stack([i + 1, i + cells + 1, i + cells + 2], 1)
    faces = np.concatenate([below, above])
    return Mesh(vertices, faces, uvs=(vertices[faces][..., [0, 2]] + 0.5,))


@pytest.mark.slow
@pytest.mark.parametrize("layers", [1, 3])
def test_what_is_behind_is_seen_by_its_share(layers: int) -> None:
    """Black gauze of half and more in front of a constant sky."""
    objects = tuple(
        Object(f"{i}", shape("plane"), "m", (0, -0.3 * i, 0), scale=(9, 1, 9)) for i in range(layers)
    )
    scene = Scene(
        Camera((0, 2, 0.01), (0, 0, 0), fov_y=30), Environment((1, 2, 3)), {"m": gauze(0.6)}, objects
    )
    image = repeat(scene, 256, 8, max_bounces=0).mean(axis=0)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 0.4**layers * np.array([1, 2, 3]), rtol=0.01)


def test_rays_go_through_many_layers() -> None:
    mesh = shape("plane")
    objects = tuple(Object(f"{i}", mesh, "m", (0, -0.01 * i, 0), scale=(9, 1, 9)) for i in range(100))
    scene = Scene(
        Camera((0, 2, 0.01), (0, 0, 0), fov_y=30), Environment((1, 1, 1)), {"m": gauze(0.0)}, objects
    )
    np.testing.assert_allclose(render(scene, 4, size=(16, 16), max_bounces=0), 1, atol=1e-6)


def under_a_screen(
    screen: Material | None, mesh: Mesh | None = None, environment: Environment | None = None
) -> Scene:
    """A floor under a screen under a lamp."""
    materials = {
        "floor": Material((0.7, 0.7, 0.7), specular=0), "lamp": Material((0, 0, 0), specular=0, emission=(9,
        8, 7)),
    }  # fmt: skip
    objects = [
        Object("floor", shape("plane"), "floor", scale=(2, 1, 2)),
        Object("lamp", shape("plane"), "lamp", (0.2, 2, 0), (180, 0, 0), (0.4, 1, 0.4)),
    ]
    if screen is not None:
        materials["screen"] = screen
        objects.append(Object("screen", mesh or shape("plane"), "screen", (0, 0.6, 0), (0, 20, 0), (3, 1, 3)))
    camera = Camera((0, 0.5, 1.1), (0, 0, 0), fov_y=40)
    return Scene(camera, environment or Environment(), materials, tuple(objects))


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
def test_light_of_lamps_comes_through_by_its_share(in_blocks: bool) -> None:
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")

    def mean(scene: Scene) -> Array:
        session = Session(scene, (32, 32), replace(scene.settings, max_bounces=0, sample_rate=64), device())
        if not in_blocks:
            session._tracer = Wavefront(session.device)
        session.render(512)
        return np.asarray(session.image().astype(np.float64).mean(axis=(0, 1)))

    free = mean(under_a_screen(None))
    for alpha in (0.0, 0.25, 1.0):
        np.testing.assert_allclose(mean(under_a_screen(gauze(alpha))), (1 - alpha) * free, rtol=0.01)


@pytest.mark.statistics
def test_light_and_bsdf_sampling_find_the_same_light() -> None:
    image = Environment((1, 1, 1))
    scene = under_a_screen(gauze(1, base_color_texture=holes()), environment=image)
    both = repeat(scene, 256, max_bounces=1)
    for feature in ("MIS_ONLY_LIGHT", "MIS_ONLY_BSDF"):
        alone = repeat(scene, 512, max_bounces=1, on=Device(features=(feature,)))
        assert_same_mean(both, alone, relative=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("material", [BLACK, Material((0.8, 0.4, 0.2), roughness=0.4, double_sided=True)])
def test_a_mask_is_as_the_faces_that_it_leaves(material: Material) -> None:
    """A screen with holes against one without the faces where they are, under a lamp and a sky."""
    sky = Environment((0.3, 0.4, 0.5))
    mesh = grid(6)
    masked = replace(
        material,
        base_color_texture=holes_in(material),
        base_color=(1, 1, 1),
        alpha_mode="mask",
        alpha_cutoff=0.5,
    )
    cell = (mesh.uvs[0].mean(axis=1) * 6).astype(int)
    kept = holes().bitmap.pixels[cell[:, 1], cell[:, 0], 3] > 127
    whole = repeat(under_a_screen(masked, mesh, sky), 256, max_bounces=3)
    left = repeat(under_a_screen(material, Mesh(mesh.vertices, mesh.faces[kept]), sky), 256, max_bounces=3)
    assert_same_mean(whole, left, relative=0.01)


def holes_in(material: Material) -> Texture:
    alpha = holes().bitmap.pixels[..., 3:] / np.float32(255)
    color = np.broadcast_to(np.float32(material.base_color), (6, 6, 3))
    return Texture(Bitmap(np.concatenate([color, alpha], axis=2)), filter="nearest")


def test_opaque_materials_take_no_notice_of_alpha() -> None:
    free = render(under_a_screen(replace(BLACK, alpha=1.0)), 16)
    np.testing.assert_array_equal(render(under_a_screen(replace(BLACK, alpha=0.2)), 16), free)


def test_colours_at_corners_have_an_alpha_too() -> None:
    plane = shape("plane")
    clear = np.ones((2, 3, 4), np.float32)
    clear[..., 3] = 0.5
    scenes = [
        under_a_screen(gauze(alpha), mesh)
        for alpha, mesh in ((0.5, plane), (1.0, replace(plane, colors=clear)))
    ]
    images = [render(scene, 256, max_bounces=0).mean(axis=(0, 1)) for scene in scenes]
    np.testing.assert_allclose(*images, rtol=1e-3)


@pytest.mark.slow
def test_what_covers_in_part_and_shines_is_found_by_rays() -> None:
    """Half of the light of a lamp that covers half."""
    shining = Material((0, 0, 0), specular=0, emission=(5, 5, 5), double_sided=True)
    means = [
        repeat(under_a_screen(material), 512, 8, max_bounces=1).mean(axis=(0, 1, 2))
        - repeat(under_a_screen(replace(material, emission=(0, 0, 0))), 512, 8, max_bounces=1).mean(
            axis=(0, 1, 2)
        )
        for material in (shining, replace(shining, alpha=0.5, alpha_mode="blend"))
    ]
    # What bounces between floor and screen is another thing, but both are dark here: the screen reflects
    # nothing.
    np.testing.assert_allclose(means[1], 0.5 * means[0], rtol=0.05)


def leaves(**settings: Any) -> Scene:
    """The mixed scene behind a curtain with holes, with a cube of gauze in it and glass around a leaf."""
    scene = mixed_scene(**settings)
    leaf = replace(
        Material((0.2, 0.7, 0.1), double_sided=True), base_color_texture=holes_in(Material((0.2, 0.7, 0.1)))
    )
    scene = replace(
        scene,
        materials={
            **scene.materials,
            "curtain": replace(leaf, alpha_mode="mask"),
            "gauze": Material((0.9, 0.3, 0.3), alpha=0.5, alpha_mode="blend"),
        },
    )
    return scene.with_object("red cube", material="gauze").with_added(
        Object("curtain", grid(4), "curtain", (0, 0.7, 1.2), (80, 0, 0), (2.2, 1, 1.6)),
        Object(
            "leaf", shape("plane"), "curtain", scene.object("glass ball").position, (30, 20, 0), (0.3, 1, 0.3)
        ),
    )


def test_blocks_and_wavefront_agree() -> None:
    if not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    in_blocks, in_wavefront = (pixels(leaves(max_bounces=3), 4, tracer) for tracer in (True, False))
    close = np.isclose(in_blocks, in_wavefront, rtol=1e-3, atol=1e-4).all(axis=2)
    assert close.mean() > 0.98


EDITS: dict[str, Callable[[Scene], Scene]] = {
    "open": lambda s: s.with_material("curtain", alpha_cutoff=0.9),
    "thin": lambda s: s.with_material("gauze", alpha=0.2),
    "solid": lambda s: s.with_material("gauze", alpha_mode="opaque"),
    "colour": lambda s: s.with_material("curtain", base_color=(0.2, 0.2, 1)),
    "behind": lambda s: s.with_object("grey drum", position=(0.3, 0.5, 0.3)),
    "curtain": lambda s: s.with_object("curtain", position=(0.1, 0.8, 1.1)),
    "other cloth": lambda s: s.with_object("curtain", material="gauze"),
    "cloth to wood": lambda s: s.with_object("curtain", material="grey"),
    "pattern": lambda s: s.with_material("curtain", base_color_texture=holes()),
    "lamp of gauze": lambda s: s.with_material("lamp", alpha=0.5, alpha_mode="blend"),
    "gauze of light": lambda s: s.with_material("gauze", emission=(1, 2, 3)),
    "wood to cloth": lambda s: s.with_object("grey drum", material="curtain"),
}


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False])
@pytest.mark.parametrize("name", EDITS)
def test_a_path_that_met_nothing_that_changed_brings_the_same(name: str, in_blocks: bool) -> None:
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    old = replace(leaves(), settings=small_settings(max_bounces=3))
    check(traced_pairs(device(), old, EDITS[name](old), in_blocks))


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["spiral", "impact"])
def test_after_edits_the_picture_is_that_of_a_fresh_start(strategy: str) -> None:
    scene = replace(leaves(), settings=small_settings())
    # Light that rays alone find takes long to converge, and has its test among the pairs.
    edits = [edit for name, edit in EDITS.items() if name not in ("lamp of gauze", "gauze of light")]
    assert_edits_converge(device(), scene, edits, strategy)
