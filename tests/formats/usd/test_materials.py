"""Materials of USD files: UsdPreviewSurface, its images, and display colours."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.usd_files import (
    METRES,
    QUAD,
    bound_quad,
    load_usda,
    placed,
    preview_surface,
    uv_texture,
    write_usda,
)

from incpt.formats import bitmaps, registry, scene_save
from incpt.formats.import_report import Fate, ImportReport
from incpt.formats.registry import load_with_report
from incpt.scene.material import Material
from incpt.scene.model import Scene
from incpt.scene.texture import Bitmap, Texture

pxr = pytest.importorskip("pxr")

ST = 'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")'
PIXELS = np.arange(2 * 2 * 4, dtype=np.uint8).reshape(2, 2, 4) * 15


def look_of(folder: Path, inputs: str, shaders: str = "", more: str = ST) -> tuple[Material, ImportReport]:
    """The material of these inputs, where an image of PIXELS lies beside the file."""
    bitmaps.write_bitmap(folder / "image.png", Bitmap(PIXELS))
    scene, report = load_usda(folder, preview_surface(inputs, shaders) + bound_quad(more))
    return scene.materials[scene.objects[0].material], report


def test_defaults_are_those_of_the_specification(tmp_path: Path) -> None:
    material, report = look_of(tmp_path, "")
    assert material == Material(
        base_color=(0.18,) * 3, roughness=0.5, clearcoat_roughness=0.01, alpha_cutoff=0.5
    )
    assert report.is_whole and not report.of(Fate.CHANGED)


def test_metal_and_clearcoat(tmp_path: Path) -> None:
    material, _ = look_of(
        tmp_path,
        """color3f inputs:diffuseColor = (1, 0.5, 0.25)
        float inputs:metallic = 0.75
        float inputs:roughness = 0.25
        float inputs:ior = 1.8
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.125
        color3f inputs:emissiveColor = (3, 2, 1)""",
    )
    assert (material.base_color, material.metallic, material.roughness) == ((1, 0.5, 0.25), 0.75, 0.25)
    assert material.ior == pytest.approx(1.8) and material.emission == (3, 2, 1)
    assert (material.clearcoat, material.clearcoat_roughness) == (0.5, 0.125)


def test_specular_workflow_reflects_its_colour(tmp_path: Path) -> None:
    """At normal incidence: 0.04 times the specular colour of an index of 1.5."""
    material, _ = look_of(
        tmp_path, "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.5, 0.25, 0.02)"
    )
    np.testing.assert_allclose(0.04 * np.array(material.specular_color), (0.5, 0.25, 0.02), rtol=1e-6)
    assert material.metallic == 0 and material.ior == 1.5


def test_opacity(tmp_path: Path) -> None:
    material, report = look_of(tmp_path, "float inputs:opacity = 0.25")
    assert (material.alpha, material.alpha_mode, material.transmission) == (0.25, "blend", 0)
    assert "what it does not cover reflects nothing" in report.of(Fate.CHANGED)[0].text
    material, _ = look_of(tmp_path, "float inputs:opacity = 0.25\nfloat inputs:opacityThreshold = 0.5")
    assert (material.alpha, material.alpha_mode, material.alpha_cutoff) == (0.25, "mask", 0.5)
    material, _ = look_of(tmp_path, "float inputs:opacity = 0\nfloat inputs:roughness = 0")
    assert material.is_clear_wall and material.alpha == 1
    material, report = look_of(tmp_path, 'float inputs:opacity = 0\ntoken inputs:opacityMode = "presence"')
    assert (material.alpha, material.alpha_mode) == (0, "blend") and not report.of(Fate.CHANGED)


COLOR = "color3f inputs:diffuseColor.connect = </look/image.outputs:rgb>"


def test_images_stay_what_they_are(tmp_path: Path) -> None:
    material, report = look_of(tmp_path, COLOR, uv_texture("image.png"))
    texture = material.base_color_texture
    assert texture is not None and material.base_color == (1, 1, 1) and report.is_whole
    # Its alpha means nothing to an opaque material.
    assert texture.bitmap.source.file == str(tmp_path / "image.png") and material.alpha_mode == "opaque"
    assert (texture.uv_set, texture.wrap) == (0, ("repeat", "repeat"))


def test_wrapping_and_factors(tmp_path: Path) -> None:
    inputs = """token inputs:wrapS = "mirror"
        token inputs:wrapT = "black"
        float4 inputs:scale = (0.5, 0.25, 1, 1)"""
    material, report = look_of(tmp_path, COLOR, uv_texture("image.png", inputs))
    assert material.base_color == (0.5, 0.25, 1)
    assert material.base_color_texture is not None and material.base_color_texture.wrap == ("mirror", "clamp")
    assert "is not black beyond its edges" in report.of(Fate.CHANGED)[0].text


@pytest.mark.parametrize("space", ["raw", "sRGB"])
def test_color_spaces(tmp_path: Path, space: str) -> None:
    """A raw image of colours becomes floats; numbers of an sRGB image are linear."""
    inputs = f'token inputs:sourceColorSpace = "{space}"'
    material, _ = look_of(
        tmp_path,
        f"{COLOR}\nfloat inputs:roughness.connect = </look/image.outputs:g>",
        uv_texture("image.png", inputs),
    )
    color, rough = material.base_color_texture, material.metallic_roughness_texture
    assert color is not None and rough is not None
    plain = PIXELS / 255
    linear = (
        plain
        if space == "raw"
        else np.where(plain <= 0.04045, plain / 12.92, ((plain + 0.055) / 1.055) ** 2.4)
    )
    if space == "raw":
        np.testing.assert_allclose(color.bitmap.pixels[..., :3], plain[..., :3], atol=1e-6)
    else:
        np.testing.assert_array_equal(color.bitmap.pixels, PIXELS)
    np.testing.assert_allclose(rough.bitmap.pixels[..., 1], linear[..., 1], atol=1e-6)


def test_bias_is_put_into_the_image(tmp_path: Path) -> None:
    inputs = """token inputs:sourceColorSpace = "raw"
        float4 inputs:scale = (-1, -1, -1, 1)
        float4 inputs:bias = (1, 1, 1, 0)"""
    material, _ = look_of(tmp_path, COLOR, uv_texture("image.png", inputs))
    assert material.base_color_texture is not None
    np.testing.assert_allclose(
        material.base_color_texture.bitmap.pixels, 1 - PIXELS[..., :3] / 255, atol=1e-6
    )


def test_packed_metal_and_roughness_stay_one_image(tmp_path: Path) -> None:
    material, _ = look_of(
        tmp_path,
        """float inputs:metallic.connect = </look/image.outputs:b>
        float inputs:roughness.connect = </look/image.outputs:g>""",
        uv_texture("image.png", 'token inputs:sourceColorSpace = "raw"'),
    )
    texture = material.metallic_roughness_texture
    assert texture is not None and texture.bitmap.source.file == str(tmp_path / "image.png")
    assert (material.metallic, material.roughness) == (1, 1)


def test_opacity_of_an_image(tmp_path: Path) -> None:
    alpha = "float inputs:opacity.connect = </look/image.outputs:{}>\nfloat inputs:opacityThreshold = 0.5"
    material, _ = look_of(tmp_path, f"{COLOR}\n{alpha.format('a')}", uv_texture("image.png"))
    assert material.alpha_mode == "mask" and material.base_color_texture is not None
    assert material.base_color_texture.bitmap.source.file is not None
    material, _ = look_of(
        tmp_path, alpha.format("r"), uv_texture("image.png", 'token inputs:sourceColorSpace = "raw"')
    )
    assert material.base_color_texture is not None
    np.testing.assert_allclose(
        material.base_color_texture.bitmap.pixels[..., 3], PIXELS[..., 0] / 255, atol=1e-6
    )


@pytest.mark.parametrize(("y", "green"), [(2, PIXELS[..., 1]), (-2, 255 - PIXELS[..., 1])])
def test_normal_maps(tmp_path: Path, y: int, green: Any) -> None:
    """Green goes up; where the scale turns it down it is turned in the image."""
    inputs = f"""token inputs:sourceColorSpace = "raw"
        float4 inputs:scale = (2, {y}, 2, 1)
        float4 inputs:bias = (-1, {-y // 2}, -1, 0)"""
    material, report = look_of(
        tmp_path,
        "normal3f inputs:normal.connect = </look/image.outputs:rgb>",
        uv_texture("image.png", inputs),
    )
    assert material.normal_texture is not None and material.normal_scale == 1 and not report.of(Fate.CHANGED)
    np.testing.assert_array_equal(material.normal_texture.bitmap.pixels[..., 1], green)


def test_transforms_of_textures(tmp_path: Path) -> None:
    """By the specification: coordinates are scaled, turned counter-clockwise, and moved."""
    transform = """def Shader "placing" {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </look/reader.outputs:result>
            float inputs:rotation = 30
            float2 inputs:scale = (2, 3)
            float2 inputs:translation = (0.1, 0.2)
            float2 outputs:result
        }"""
    shaders = uv_texture("image.png", placed_by="placing") + transform
    material, _ = look_of(tmp_path, COLOR, shaders)
    assert material.base_color_texture is not None
    turn = math.radians(30)
    for s, t in ((0.0, 0.0), (1.0, 0.0), (0.3, 0.7)):
        wanted = (
            2 * s * math.cos(turn) - 3 * t * math.sin(turn) + 0.1,
            2 * s * math.sin(turn) + 3 * t * math.cos(turn) + 0.2,
        )
        u, v = read_at(material.base_color_texture, s, 1 - t)
        assert (u, 1 - v) == pytest.approx(wanted)


def read_at(texture: Texture, u: float, v: float) -> tuple[float, float]:
    """Where a texture is read for coordinates, by KHR_texture_transform."""
    angle = math.radians(texture.rotation)
    x, y = u * texture.scale[0], v * texture.scale[1]
    return (
        math.cos(angle) * x + math.sin(angle) * y + texture.offset[0],
        -math.sin(angle) * x + math.cos(angle) * y + texture.offset[1],
    )


def test_a_second_set_of_coordinates(tmp_path: Path) -> None:
    second = (
        uv_texture("image.png", name="glow", placed_by="other")
        + """def Shader "other" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "light"
            float2 outputs:result
        }"""
    )
    shaders = uv_texture("image.png") + second.replace('def Shader "reader"', 'def Shader "reader2"')
    both = f'{ST}\ntexCoord2f[] primvars:light = [(0.5, 0.5)] (interpolation = "constant")'
    bitmaps.write_bitmap(tmp_path / "image.png", Bitmap(PIXELS))
    inputs = f"{COLOR}\ncolor3f inputs:emissiveColor.connect = </look/glow.outputs:rgb>"
    scene, report = load_usda(tmp_path, preview_surface(inputs, shaders) + bound_quad(both))
    material, mesh = scene.materials["look"], scene.objects[0].mesh
    assert (
        material.base_color_texture is not None and material.emission_texture is not None and report.is_whole
    )
    assert (material.base_color_texture.uv_set, material.emission_texture.uv_set) == (0, 1)
    np.testing.assert_allclose(mesh.uvs[1], 0.5)
    assert np.ptp(mesh.uvs[0]) == 1


def test_colours_of_primvars(tmp_path: Path) -> None:
    reader = """def Shader "paint" {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "displayColor"
            float3 outputs:result
        }"""
    colors = """color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.25, 0.5, 0.75)] (
            interpolation = "vertex")"""
    inputs = "color3f inputs:diffuseColor.connect = </look/paint.outputs:result>"
    scene, report = load_usda(tmp_path, preview_surface(inputs, reader) + bound_quad(colors))
    assert report.is_whole and scene.materials["look"].base_color == (1, 1, 1)
    found = scene.objects[0].mesh.colors
    assert found is not None
    at_last = scene.objects[0].mesh.faces == 3
    np.testing.assert_allclose(found[at_last], [(0.25, 0.5, 0.75, 1)])


def test_display_colours_without_a_material(tmp_path: Path) -> None:
    varying = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")'
    two = QUAD.replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    body = f"""def Mesh "even" {{ {QUAD} color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]
            float[] primvars:displayOpacity = [0.5]
        }}
        def Mesh "uneven" {{ {two} {varying} }}
        def Sphere "like" {{
            color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]
            float[] primvars:displayOpacity = [0.5]
        }}"""
    scene, report = load_usda(tmp_path, body)
    even, uneven, like = (scene.materials[one.material] for one in scene.objects)
    assert report.is_whole and even is like
    assert even.base_color == pytest.approx((0.1, 0.2, 0.3)) and (even.alpha, even.alpha_mode) == (
        0.5,
        "blend",
    )
    assert scene.objects[0].mesh.colors is None
    assert uneven.base_color == (1, 1, 1) and uneven.alpha_mode == "opaque"
    colors = scene.objects[1].mesh.colors
    assert colors is not None
    np.testing.assert_allclose(colors[:, 0], [(1, 0, 0, 1), (0, 1, 0, 1)])


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    inputs = (
        f"{COLOR}\nfloat inputs:displacement = 0.1\nfloat inputs:roughness.connect = </look/noise.outputs:r>"
    )
    noise = """def Shader "noise" {
            uniform token info:id = "MyNoise"
            float outputs:r
        }"""
    gone = uv_texture("gone.png", "float4 inputs:fallback = (0.25, 0.5, 0.75, 1)") + noise
    material, report = look_of(tmp_path, inputs, gone)
    assert material.base_color == (0.25, 0.5, 0.75)
    said = " | ".join(one.text for one in report.of(Fate.LEFT_OUT))
    assert "diffuseColor of material 'look': 'gone.png': no such file" in said
    assert "displacement of material 'look': surfaces stay" in said
    assert "roughness of material 'look': reads MyNoise" in said


def test_other_shaders_are_said(tmp_path: Path) -> None:
    body = preview_surface("").replace("UsdPreviewSurface", "PxrSurface") + bound_quad()
    scene, report = load_usda(tmp_path, body)
    assert scene.objects[0].material == "grey"
    assert "material 'look': its shader is PxrSurface" in report.of(Fate.LEFT_OUT)[0].text


def test_surfaces_that_shine_on_both_sides(tmp_path: Path) -> None:
    body = preview_surface("color3f inputs:emissiveColor = (1, 1, 1)")
    quads = bound_quad() + bound_quad("uniform bool doubleSided = 1").replace('"quad"', '"both"')
    scene, _ = load_usda(tmp_path, body + quads)
    assert [scene.materials[one.material].double_sided for one in scene.objects] == [False, True]


def archive(folder: Path) -> Path:
    from pxr import UsdUtils

    bitmaps.write_bitmap(folder / "image.png", Bitmap(PIXELS))
    write_usda(folder / "a.usda", preview_surface(COLOR, uv_texture("image.png")) + bound_quad(ST))
    assert UsdUtils.CreateNewUsdzPackage(str(folder / "a.usda"), str(folder / "a.usdz"))
    return folder / "a.usdz"


def test_images_in_archives(tmp_path: Path) -> None:
    """The same pixels, found again by their number, as a scene file names them."""
    path = archive(tmp_path)
    (tmp_path / "image.png").unlink()
    scene, report = load_with_report(path)
    texture = scene.materials[scene.objects[0].material].base_color_texture
    assert report.is_whole and texture is not None
    np.testing.assert_array_equal(texture.bitmap.pixels, PIXELS)
    source = texture.bitmap.source
    assert source.file == str(path) and source.index is not None
    assert bitmaps.load_bitmap(path, source.index) is texture.bitmap
    scene_save.save(scene, tmp_path / "saved.toml")
    again = registry.load(tmp_path / "saved.toml")
    assert again.materials == scene.materials and again.objects[0].mesh is scene.objects[0].mesh


def test_materials_of_subsets(tmp_path: Path) -> None:
    two = QUAD.replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    subset = """def GeomSubset "upper" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </paint>
    }"""
    paint = preview_surface("color3f inputs:diffuseColor = (1, 0, 0)", name="paint")
    mesh = bound_quad(subset).replace(QUAD, two)
    scene, _ = load_usda(tmp_path, preview_surface("") + paint + mesh)
    assert {one.name: one.material for one in scene.objects} == {"a/quad": "look", "a/quad/upper": "paint"}


def test_a_material_from_above_and_per_instance(tmp_path: Path) -> None:
    body = (
        preview_surface("", name="one")
        + preview_surface("", name="two")
        + f"""
        class Xform "asset" {{
            def Mesh "m" {{ {QUAD} }}
        }}
        def Xform "a" (instanceable = true
            references = </asset>
            prepend apiSchemas = ["MaterialBindingAPI"]) {{
            rel material:binding = </one>
        }}
        def Xform "b" (instanceable = true
            references = </asset>
            prepend apiSchemas = ["MaterialBindingAPI"]) {{
            rel material:binding = </two>
            {placed("double3 translate = (3, 0, 0)")}
        }}"""
    )
    scene, _ = load_usda(tmp_path, body, METRES)
    assert [one.material for one in scene.objects] == ["one", "two"]
    assert scene.objects[0].mesh is scene.objects[1].mesh


def test_the_glTF_twin_has_the_same_values(tmp_path: Path) -> None:  # noqa: N802 (the name of the format)
    """The same surface as both formats say it."""
    from support.gltf_files import GltfBuilder

    values = {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0.25, "roughnessFactor": 0.75}
    look = {"name": "look", "pbrMetallicRoughness": values, "emissiveFactor": [0.5, 0.25, 0]}
    builder = GltfBuilder()
    twin: Scene = load_with_report(
        builder.write(tmp_path / "a.gltf", [builder.quad(material=0)], materials=[look])
    )[0]
    material, _ = look_of(
        tmp_path,
        """color3f inputs:diffuseColor = (0.8, 0.4, 0.2)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.75
        float inputs:clearcoatRoughness = 0
        color3f inputs:emissiveColor = (0.5, 0.25, 0)""",
        more="",
    )
    other = twin.materials[twin.objects[0].material]
    for name in ("base_color", "metallic", "roughness", "emission", "ior", "specular", "clearcoat_roughness"):
        assert getattr(material, name) == pytest.approx(getattr(other, name))
