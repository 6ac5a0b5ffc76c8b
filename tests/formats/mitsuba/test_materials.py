"""BSDFs: the numbers that materials get of them, and what is said where they are not the same."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support.mitsuba_files import SENSOR, material_of, read, told, write_image

from incpt.formats.appearance.colored import linear_pixels
from incpt.formats.import_report import Fate
from incpt.formats.mitsuba.indices import inner_reflectance
from incpt.picture.color import linear_from_srgb
from incpt.scene.material import Material

AIR = 1.000277
RED, BLUE = (f'<rgb name="reflectance" value="{value}"/>' for value in (".8 .2 .2", ".1 .2 .6"))


def bsdf(kind: str, content: str = "") -> str:
    return f'<bsdf type="{kind}">{content}</bsdf>'


def number(name: str, value: float) -> str:
    return f'<float name="{name}" value="{value}"/>'


def rgb(name: str, value: str) -> str:
    return f'<rgb name="{name}" value="{value}"/>'


def image(name: str, file: str, more: str = "") -> str:
    return (
        f'<texture type="bitmap" name="{name}"><string name="filename" value="{file}"/>'
        f'<boolean name="raw" value="true"/>{more}</texture>'
    )


# ---------------------------------------------------------------------------------------- what is the same


def test_without_a_bsdf_a_shape_is_grey(tmp_path: Path) -> None:
    assert material_of(tmp_path, "") == Material((0.5, 0.5, 0.5), specular=0)


def test_diffuse(tmp_path: Path) -> None:
    assert material_of(tmp_path, bsdf("twosided", bsdf("diffuse", RED))) == Material(
        (0.8, 0.2, 0.2), specular=0
    )
    assert material_of(tmp_path, bsdf("diffuse", number("reflectance", 0.3))).base_color == (0.3, 0.3, 0.3)
    spectrum = '<spectrum name="reflectance" value="380:0, 560:0, 561:.9, 780:.9"/>'
    red, green, blue = material_of(tmp_path, bsdf("diffuse", spectrum)).base_color
    assert red > 0.85 and 0.15 < green < 0.5 and blue < 0.05


def test_dielectrics(tmp_path: Path) -> None:
    glass = material_of(tmp_path, bsdf("dielectric"))
    assert glass == Material((1, 1, 1), transmission=1, roughness=0, ior=1.5046 / AIR)
    water = material_of(tmp_path, bsdf("dielectric", '<string name="int_ior" value="water"/>'))
    assert water.ior == pytest.approx(1.333 / AIR)
    tinted = material_of(tmp_path, bsdf("dielectric", rgb("specular_transmittance", ".9 .5 .1")))
    assert tinted.base_color == (0.9, 0.5, 0.1)
    rough = material_of(
        tmp_path, bsdf("roughdielectric", number("alpha", 0.09) + '<string name="distribution" value="ggx"/>')
    )
    assert rough.roughness == pytest.approx(0.3) and rough.transmission == 1
    wall = material_of(tmp_path, bsdf("thindielectric", number("int_ior", 1.6) + number("ext_ior", 1)))
    assert wall.thin_walled and wall.ior == 1.6 and wall.transmission == 1


def test_bodies_within_bodies_know_what_is_around_them(tmp_path: Path) -> None:
    indices = ((1.333, 1.0), (1.5, 1.333), (1.0, 1.5))
    bodies = (
        bsdf("dielectric", number("int_ior", one) + number("ext_ior", around)) for one, around in indices
    )
    scene, report = read(tmp_path, "\n".join(f'<shape type="sphere">{body}</shape>' for body in bodies))
    water, glass, bubble = (scene.materials[one.material] for one in scene.objects)
    assert (water.ior, glass.ior, bubble.ior) == (1.333, pytest.approx(1.5 / AIR), 1)
    # The deeper one counts where they overlap, and 0 is the highest priority.
    assert (water.priority, glass.priority, bubble.priority) == (1, 2, 0)
    assert sum("ext_ior" in text for text in told(report, Fate.CHANGED)) == 2
    alone = material_of(tmp_path, bsdf("dielectric", number("int_ior", 1.0) + number("ext_ior", 1.5)))
    assert (alone.ior, alone.priority) == (1.5, 0)


def test_conductors(tmp_path: Path) -> None:
    mirror = material_of(tmp_path, bsdf("conductor"))
    assert mirror == Material((1, 1, 1), metallic=1, roughness=0)
    gold = material_of(tmp_path, bsdf("conductor", '<string name="material" value="Au"/>')).base_color
    # What is measured of gold at 450, 550 and 650 nm is near 0.39, 0.82 and 0.97 (Johnson and Christy 1972).
    np.testing.assert_allclose(gold, [0.97, 0.8, 0.37], atol=0.05)
    given = material_of(tmp_path, bsdf("conductor", rgb("eta", "0.2 1 1.5") + rgb("k", "3 2.5 2")))
    expected = [((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2) for n, k in ((0.2, 3), (1, 2.5), (1.5, 2))]
    np.testing.assert_allclose(given.base_color, expected)
    flat = '<spectrum name="{}" value="300:{}, 900:{}"/>'
    over = material_of(tmp_path, bsdf("conductor", flat.format("eta", 0.2, 0.2) + flat.format("k", 3, 3)))
    np.testing.assert_allclose(over.base_color, expected[0])
    half = material_of(tmp_path, bsdf("conductor", rgb("specular_reflectance", ".5 .25 1")))
    assert half.base_color == (0.5, 0.25, 1)


def test_rough_conductors(tmp_path: Path) -> None:
    ggx = '<string name="distribution" value="ggx"/>'
    assert material_of(tmp_path, bsdf("roughconductor", ggx)).roughness == pytest.approx(math.sqrt(0.1))
    # Along u and v alphas are lerp(across, 1, anisotropy²) and roughness² (cl/shading/material.cl).
    for along, across, turn in ((0.4, 0.1, 0), (0.1, 0.4, 90)):
        metal = material_of(
            tmp_path, bsdf("roughconductor", ggx + number("alpha_u", along) + number("alpha_v", across))
        )
        low = metal.roughness**2
        assert (low, low + (1 - low) * metal.anisotropy**2) == (pytest.approx(0.1), pytest.approx(0.4))
        assert metal.anisotropy_rotation == turn


def test_plastics(tmp_path: Path) -> None:
    plain = material_of(tmp_path, bsdf("plastic", rgb("diffuse_reflectance", ".1 .2 .3")))
    assert plain == Material((0.1, 0.2, 0.3), roughness=0, ior=1.49 / AIR)
    nonlinear = material_of(
        tmp_path,
        bsdf("plastic", rgb("diffuse_reflectance", "1 .2 0") + '<boolean name="nonlinear" value="true"/>'),
    )
    # The share of diffuse light that is reflected inside, for an index of 1.49 (Mitsuba's "fresnel.h").
    inner = inner_reflectance(1.49)
    assert inner == pytest.approx(0.593, abs=3e-3)
    np.testing.assert_allclose(nonlinear.base_color, [1, 0.2 * (1 - inner) / (1 - 0.2 * inner), 0], atol=1e-3)
    assert material_of(tmp_path, bsdf("roughplastic", number("alpha", 0.25))).roughness == 0.5


def test_principled(tmp_path: Path) -> None:
    material = material_of(
        tmp_path,
        bsdf(
            "principled",
            rgb("base_color", ".4 .2 .1") + number("metallic", 0.5) + number("roughness", 0.3)
            + number("specular", 0.5) + number("clearcoat", 1) + number("clearcoat_gloss", 1),
        ),
    )  # fmt: skip
    assert material.base_color == (0.4, 0.2, 0.1)
    assert (material.metallic, material.roughness, material.clearcoat) == (0.5, 0.3, 0.25)
    # Disney's specular of 0.5 is a reflectance of 0.04.
    assert ((material.ior - 1) / (material.ior + 1)) ** 2 == pytest.approx(0.04)
    assert material.clearcoat_roughness**2 == pytest.approx(0.001)
    glass = material_of(
        tmp_path,
        bsdf("principled", number("spec_trans", 1) + rgb("base_color", ".25 1 1") + number("eta", 1.3)),
    )
    assert (glass.transmission, glass.ior, glass.base_color) == (1, 1.3, (0.5, 1, 1))
    stretched = material_of(
        tmp_path, bsdf("principled", number("anisotropic", 0.8) + number("roughness", 0.5))
    )
    aspect, low = math.sqrt(1 - 0.9 * 0.8), stretched.roughness**2
    assert low == pytest.approx(0.25 * aspect)
    assert low + (1 - low) * stretched.anisotropy**2 == pytest.approx(0.25 / aspect)
    thin = material_of(
        tmp_path,
        bsdf("principledthin", number("spec_trans", 0.5) + number("diff_trans", 1) + number("eta", 1.4)),
    )
    assert thin.thin_walled and (thin.transmission, thin.diffuse_transmission, thin.ior) == (0.5, 0.5, 1.4)


def test_masks(tmp_path: Path) -> None:
    plain = material_of(tmp_path, bsdf("mask", number("opacity", 0.4) + bsdf("diffuse", RED)))
    assert (plain.alpha, plain.alpha_mode, plain.base_color) == (0.4, "blend", (0.8, 0.2, 0.2))
    write_image(tmp_path / "o.png", [[0, 51], [102, 255]])
    masked = material_of(tmp_path, bsdf("mask", image("opacity", "o.png") + bsdf("diffuse", RED)))
    texture = masked.base_color_texture
    assert texture is not None and (masked.alpha, masked.base_color) == (1, (0.8, 0.2, 0.2))
    np.testing.assert_allclose(texture.bitmap.pixels[..., 3], [[0, 0.2], [0.4, 1]], atol=1e-6)
    np.testing.assert_array_equal(texture.bitmap.pixels[..., :3], 1)
    # The colour's own alpha counts for nothing there.
    write_image(tmp_path / "c.png", np.full((4, 4, 4), 102))
    both = material_of(
        tmp_path, bsdf("mask", image("opacity", "o.png") + bsdf("diffuse", image("reflectance", "c.png")))
    ).base_color_texture
    assert both is not None
    np.testing.assert_allclose(both.bitmap.pixels[::2, ::2, 3], [[0, 0.2], [0.4, 1]], atol=1e-6)
    np.testing.assert_allclose(both.bitmap.pixels[..., :3], 0.4, atol=1e-6)


def test_blends_of_diffuse_bsdfs_are_diffuse(tmp_path: Path) -> None:
    pair = bsdf("diffuse", RED) + bsdf("diffuse", BLUE)
    plain = material_of(tmp_path, bsdf("blendbsdf", number("weight", 0.25) + pair))
    np.testing.assert_allclose(plain.base_color, [0.625, 0.2, 0.3])
    write_image(tmp_path / "w.png", [[0, 51], [51, 255]])
    woven = material_of(tmp_path, bsdf("blendbsdf", image("weight", "w.png") + pair))
    assert woven.base_color_texture is not None
    colors = woven.base_color_texture.bitmap.pixels * np.array(woven.base_color)
    np.testing.assert_allclose(colors[0], [[0.8, 0.2, 0.2], [0.66, 0.2, 0.28]], atol=1e-6)
    np.testing.assert_allclose(colors[1, 1], [0.1, 0.2, 0.6], atol=1e-6)


def test_other_blends_are_the_nearest(tmp_path: Path) -> None:
    rough = bsdf("roughplastic", number("alpha", 0.04)) + bsdf("roughplastic", number("alpha", 0.36))
    mixed = material_of(tmp_path, bsdf("blendbsdf", number("weight", 0.5) + rough))
    assert mixed.roughness == pytest.approx(0.4)
    metal = bsdf("plastic", rgb("diffuse_reflectance", ".2 .4 .6")) + bsdf(
        "roughconductor", number("alpha", 0.25)
    )
    half = material_of(tmp_path, bsdf("blendbsdf", number("weight", 0.5) + metal))
    assert (half.metallic, half.roughness, half.ior) == (0.5, 0.25, 1.49 / AIR)
    np.testing.assert_allclose(half.base_color, [0.6, 0.7, 0.8])
    unlike = bsdf("diffuse", RED) + bsdf("dielectric")
    assert material_of(tmp_path, bsdf("blendbsdf", number("weight", 0.6) + unlike)).transmission == 1
    assert material_of(tmp_path, bsdf("blendbsdf", number("weight", 0.4) + unlike)).transmission == 0


def test_metal_and_paint_are_woven_by_an_image(tmp_path: Path) -> None:
    write_image(tmp_path / "w.png", [[0, 255], [255, 0]])
    pair = bsdf("diffuse", RED) + bsdf("roughconductor", number("alpha", 0.25))
    material = material_of(tmp_path, bsdf("blendbsdf", image("weight", "w.png") + pair))
    base, rough, specular = (
        material.base_color_texture, material.metallic_roughness_texture, material.specular_texture,
    )  # fmt: skip
    assert base is not None and rough is not None and specular is not None
    # At each place either the one or the other.
    np.testing.assert_allclose(base.bitmap.pixels[0], [[0.8, 0.2, 0.2], [1, 1, 1]], atol=1e-6)
    np.testing.assert_allclose(rough.bitmap.pixels[0, :, 1:], [[1, 0], [0.5, 1]], atol=1e-6)
    np.testing.assert_allclose(specular.bitmap.pixels[0, :, 3], [0, 1], atol=1e-6)


def test_bumps_and_normals(tmp_path: Path) -> None:
    write_image(tmp_path / "h.png", [[0, 51], [102, 255]])
    bumpy = material_of(
        tmp_path, bsdf("bumpmap", image("any", "h.png") + number("scale", 0.3) + bsdf("diffuse", RED))
    )
    assert bumpy.bump_scale == 0.3 and bumpy.bump_texture is not None and bumpy.base_color == (0.8, 0.2, 0.2)
    np.testing.assert_allclose(bumpy.bump_texture.bitmap.pixels[..., 0], [[0, 0.2], [0.4, 1]], atol=1e-6)
    write_image(tmp_path / "n.png", np.broadcast_to([200, 100, 220], (2, 2, 3)))
    bent = material_of(tmp_path, bsdf("normalmap", image("normalmap", "n.png") + bsdf("diffuse", RED)))
    # Their green goes along v, downwards in an image, ours upwards.
    assert bent.normal_texture is not None
    np.testing.assert_allclose(bent.normal_texture.bitmap.pixels[0, 0] * 255, [200, 155, 220], atol=1e-3)


# --------------------------------------------------------------------------------------------- textures


def test_images_keep_their_files_unless_they_are_raw(tmp_path: Path) -> None:
    write_image(tmp_path / "c.png", np.full((2, 2, 3), 128))
    plain = '<texture type="bitmap" name="reflectance"><string name="filename" value="c.png"/>{}</texture>'
    encoded = material_of(tmp_path, bsdf("diffuse", plain.format(""))).base_color_texture
    raw = material_of(tmp_path, bsdf("diffuse", image("reflectance", "c.png"))).base_color_texture
    assert encoded is not None and raw is not None
    assert encoded.bitmap.source.file == str(tmp_path / "c.png")
    np.testing.assert_allclose(linear_pixels(encoded.bitmap), linear_from_srgb(128 / 255), atol=1e-6)
    np.testing.assert_allclose(linear_pixels(raw.bitmap), 128 / 255, atol=1e-6)


def test_numbers_of_images_are_linear(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.full((2, 2), 128))
    plain = '<texture type="bitmap" name="alpha"><string name="filename" value="a.png"/></texture>'
    for texture, alpha in ((image("alpha", "a.png"), 128 / 255), (plain, linear_from_srgb(128 / 255))):
        metal = material_of(tmp_path, bsdf("roughconductor", texture))
        rough = metal.metallic_roughness_texture
        assert rough is not None and (metal.roughness, metal.metallic) == (1, 1)
        np.testing.assert_allclose(rough.bitmap.pixels[0, 0], [1, math.sqrt(alpha), 1], atol=1e-5)


def test_how_images_lie(tmp_path: Path) -> None:
    write_image(tmp_path / "c.png", np.zeros((2, 2, 3)))
    placed = image(
        "reflectance", "c.png",
        '<string name="wrap_mode" value="mirror"/><string name="filter_type" value="nearest"/>'
        '<transform name="to_uv"><scale x="2" y="-3"/><rotate z="1" angle="30"/><translate x=".1" y=".2"/>'
        "</transform>",
    )  # fmt: skip
    texture = material_of(tmp_path, bsdf("diffuse", placed)).base_color_texture
    assert texture is not None and (texture.wrap, texture.filter) == (("mirror", "mirror"), "nearest")
    sine, cosine = 0.5, math.sqrt(0.75)
    turn = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag([2, -3])
    np.testing.assert_allclose(texture.matrix, np.column_stack([turn, [0.1, 0.2]]), atol=1e-9)


def test_a_checkerboard_is_four_pixels(tmp_path: Path) -> None:
    board = (
        '<texture type="checkerboard" name="{}"><rgb name="color0" value=".1"/>'
        '<rgb name="color1" value=".9"/></texture>'
    )
    texture = material_of(tmp_path, bsdf("diffuse", board.format("reflectance"))).base_color_texture
    assert texture is not None and texture.filter == "nearest"
    np.testing.assert_allclose(texture.bitmap.pixels[..., 0], [[0.1, 0.9], [0.9, 0.1]], atol=1e-6)
    # Read as numbers its colours have changed places in Mitsuba.
    metal = material_of(tmp_path, bsdf("roughconductor", board.format("alpha")))
    assert metal.metallic_roughness_texture is not None
    np.testing.assert_allclose(
        metal.metallic_roughness_texture.bitmap.pixels[..., 1] ** 2, [[0.9, 0.1], [0.1, 0.9]], atol=1e-6
    )


def test_metal_and_roughness_of_two_images(tmp_path: Path) -> None:
    write_image(tmp_path / "r.png", [[0, 255], [51, 51]])
    write_image(tmp_path / "m.png", [[255, 0], [102, 102]])
    both = image("roughness", "r.png") + image("metallic", "m.png")
    material = material_of(tmp_path, bsdf("principled", both))
    texture = material.metallic_roughness_texture
    assert texture is not None and (material.metallic, material.roughness) == (1, 1)
    np.testing.assert_allclose(texture.bitmap.pixels[..., 1], [[0, 1], [0.2, 0.2]], atol=1e-6)
    np.testing.assert_allclose(texture.bitmap.pixels[..., 2], [[1, 0], [0.4, 0.4]], atol=1e-6)


# ------------------------------------------------------------------------------------------ what is told


CHANGED = {
    bsdf("roughconductor"): "GGX's with the same alpha",
    bsdf("diffuse"): "1 BSDF without 'twosided'",
    bsdf("twosided", bsdf("diffuse") + bsdf("diffuse", RED)): "its back looks like its front",
    bsdf("diffuse", rgb("reflectance", "1.5 .2 .2")): "1.5, 0.2, 0.2 is limited to 0 to 1",
    bsdf("principled"): "like Disney's but not the same",
    bsdf("blendbsdf", number("weight", 0.5) + bsdf("diffuse") + bsdf("dielectric")): "the heavier of the two",
    bsdf("dielectric", number("specular_reflectance", 0.5)): "what is not reflected goes through",
}


@pytest.mark.parametrize("body", CHANGED)
def test_what_is_changed_is_told(body: str, tmp_path: Path) -> None:
    _, report = read(tmp_path, f'<shape type="sphere">{body}</shape>')
    assert any(CHANGED[body] in text for text in told(report, Fate.CHANGED))
    assert report.is_whole


LEFT_OUT = {
    bsdf(
        "measured", '<string name="filename" value="a.bsdf"/>'
    ): "measured bsdf (line 2): nothing here is like it",
    bsdf("diffuse", image("reflectance", "none.png")): "none.png: no such file",
    bsdf("diffuse", '<texture type="volume" name="reflectance"/>'): "textures of that type are not read",
    bsdf("principled", number("flatness", 0.5)): "flatness",
}


@pytest.mark.parametrize("body", LEFT_OUT)
def test_what_is_left_out_is_told_and_grey(body: str, tmp_path: Path) -> None:
    scene, report = read(tmp_path, f'<shape type="sphere">{body}</shape>{SENSOR}')
    assert len(told(report)) == 1 and LEFT_OUT[body] in told(report)[0]
    np.testing.assert_allclose(next(iter(scene.materials.values())).base_color, 0.5)


def test_all_that_maps_is_whole_and_unchanged(tmp_path: Path) -> None:
    _, report = read(
        tmp_path,
        f'<shape type="sphere">{bsdf("twosided", bsdf("diffuse", RED))}</shape>'
        f'<shape type="cube">{bsdf("dielectric")}</shape>{SENSOR}'
        '<integrator type="path"/><emitter type="constant"/>',
    )
    assert not told(report) and not told(report, Fate.CHANGED)
