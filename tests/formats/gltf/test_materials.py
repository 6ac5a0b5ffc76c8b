"""glTF: what materials say, value by value."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.gltf_files import GltfBuilder

from incpt.core.errors import InputError
from incpt.formats import bitmaps, registry
from incpt.formats.import_report import Fate, ImportReport
from incpt.scene.material import Material
from incpt.scene.texture import Bitmap


def read(folder: Path, material: dict[str, Any], **more: Any) -> tuple[Material, ImportReport]:
    """The only material of a quad with texture coordinates."""
    builder = GltfBuilder()
    quad = builder.quad(material=0)
    quad["attributes"]["TEXCOORD_0"] = builder.accessor(np.float32([[0, 1], [1, 1], [1, 0], [0, 0]]))
    path = builder.write(folder / "a.gltf", [quad], materials=[material], **more)
    scene, report = registry.load_with_report(path)
    (made,) = scene.materials.values()
    return made, report


def image(folder: Path, pixel: npt.ArrayLike) -> dict[str, Any]:
    """One texture of one image of 2 x 2 equal pixels."""
    bitmaps.write_bitmap(folder / "p.png", Bitmap(np.tile(np.uint8(pixel), (2, 2, 1))))
    uri = "data:image/png;base64," + base64.b64encode((folder / "p.png").read_bytes()).decode()
    return {"images": [{"uri": uri}], "textures": [{"source": 0}]}


def pixel_of(texture: Any) -> list[int]:
    return texture.bitmap.pixels[0, 0].tolist()  # type: ignore[no-any-return]


def changed(report: ImportReport) -> list[str]:
    return [remark.text for remark in report.of(Fate.CHANGED)]


def test_a_mask_below_its_cutoff(tmp_path: Path) -> None:
    surface = {"metallicFactor": 0, "baseColorFactor": [1, 1, 1, 0.2]}
    made, _ = read(tmp_path, {"alphaMode": "MASK", "pbrMetallicRoughness": surface})
    assert (made.alpha, made.alpha_mode, made.alpha_cutoff, made.metallic) == (0.2, "mask", 0.5, 0)


def test_colours_metal_and_roughness_from_images(tmp_path: Path) -> None:
    surface = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}
    made, report = read(tmp_path, {"pbrMetallicRoughness": surface}, **image(tmp_path, [255, 77, 0]))
    assert (made.base_color, made.metallic, made.roughness) == ((1, 1, 1), 1, 1)
    assert pixel_of(made.base_color_texture) == pixel_of(made.metallic_roughness_texture) == [255, 77, 0]
    assert report.is_whole


def test_what_glows_is_multiplied_with_its_image(tmp_path: Path) -> None:
    table = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}
    made, _ = read(tmp_path, table, **image(tmp_path, [0, 0, 0]))
    assert made.emission == (1, 1, 1) and pixel_of(made.emission_texture) == [0, 0, 0]


def test_specular_and_glossiness(tmp_path: Path) -> None:
    """The reflectance of a dielectric is 0.04 times its specular colour."""
    table = {"diffuseFactor": [1, 0, 0, 0.5], "specularFactor": [0.02, 0.04, 0.08], "glossinessFactor": 0.25}
    material = {"name": "sg", "extensions": {"KHR_materials_pbrSpecularGlossiness": table}}
    made, report = read(tmp_path, {**material, "doubleSided": True, "alphaMode": "BLEND"})
    assert made.base_color == (1, 0, 0) and made.alpha == 0.5 and made.metallic == 0
    assert made.specular_color == pytest.approx((0.5, 1, 2)) and made.roughness == 0.75
    assert made.double_sided and made.alpha_mode == "blend"
    assert changed(report) == [
        "the specular and glossiness of material 'sg': became specular colour and roughness"
    ]


def test_specular_and_glossiness_from_an_image(tmp_path: Path) -> None:
    table = {"specularGlossinessTexture": {"index": 0}, "glossinessFactor": 0.5}
    material = {"extensions": {"KHR_materials_pbrSpecularGlossiness": table}}
    made, _ = read(tmp_path, material, **image(tmp_path, [10, 20, 30, 51]))
    assert made.roughness == 1 and pixel_of(made.specular_color_texture) == [10, 20, 30, 51]
    # Half of a glossiness of 0.2.
    assert pixel_of(made.metallic_roughness_texture) == [0, round(0.9 * 255), 0]
    # At another time it is the same image, of which a sequence would have thousands.
    scene, _ = registry.load_with_report(tmp_path / "a.gltf", time=1.0)
    (again,) = scene.materials.values()
    assert again == made


def test_numbers_out_of_range_are_told(tmp_path: Path) -> None:
    surface = {"roughnessFactor": 1.5, "baseColorFactor": [1, 1, -1, 1]}
    made, report = read(tmp_path, {"pbrMetallicRoughness": surface})
    assert made.roughness == 1 and made.base_color == (1, 1, 0)
    place = "materials[0].pbrMetallicRoughness"
    assert changed(report) == [
        f"{place}.baseColorFactor: -1 is out of range, 0 is used",
        f"{place}.roughnessFactor: 1.5 is out of range, 1 is used",
    ]


def test_occlusion_and_thickness_are_told(tmp_path: Path) -> None:
    volume = {"thicknessFactor": 1, "thicknessTexture": {"index": 0}, "attenuationDistance": 2}
    table = {"name": "m", "occlusionTexture": {"index": 0}, "extensions": {"KHR_materials_volume": volume}}
    made, report = read(tmp_path, table)
    assert made.absorption == (0, 0, 0) and math.copysign(1, made.absorption[0]) == 1
    assert changed(report) == [
        "the occlusion of material 'm': is computed, not read",
        "the thickness of material 'm': is that of the mesh, not read",
    ]


def test_a_set_of_coordinates_that_is_not_read_takes_its_texture_along(tmp_path: Path) -> None:
    surface = {"baseColorTexture": {"index": 0, "texCoord": 2}}
    made, report = read(tmp_path, {"name": "m", "pbrMetallicRoughness": surface}, **image(tmp_path, [9] * 3))
    assert made.base_color_texture is None
    (remark,) = report.of(Fate.LEFT_OUT)
    assert remark.text.startswith("baseColorTexture of material 'm': texCoord: 2 is beyond the 2 sets")


def test_materials_of_one_name_are_told_apart(tmp_path: Path) -> None:
    builder = GltfBuilder()
    quads = [builder.quad(material=number) for number in (0, 1, 0)]
    path = builder.write(tmp_path / "a.gltf", quads, materials=[{"name": "m"}, {"name": "m"}])
    scene, _ = registry.load_with_report(path)
    assert [o.material for o in scene.objects] == ["m", "m.2", "m"]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"alphaMode": "DITHER"}, "alphaMode: 'DITHER'"),
        ({"doubleSided": 1}, "doubleSided: 1 is not true or false"),
        ({"emissiveFactor": [1, 2]}, "emissiveFactor: has 2 numbers; 3 are needed"),
        ({"extensions": []}, "extensions: .* is no object"),
        ({"name": 5}, "name: 5 is no text"),
    ],
)
def test_damaged_materials_are_one_line(tmp_path: Path, table: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"a\.gltf: [^\n]*{message}[^\n]*$"):
        read(tmp_path, table)
