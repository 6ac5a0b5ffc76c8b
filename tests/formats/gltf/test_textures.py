"""glTF: textures, and what meshes have at their corners, number by number."""

from __future__ import annotations

import base64
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.gltf_files import GltfBuilder, write_document

from incpt.core.errors import InputError, InputWarning
from incpt.core.layout import TextureSlot
from incpt.formats import basis, bitmaps, mesh_files, scene_save
from incpt.formats.mesh_scene import scene_around
from incpt.formats.registry import load
from incpt.scene.material import texture_of
from incpt.scene.mesh_part import MeshPart
from incpt.scene.texture import Bitmap

POSITIONS = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.uint16([[0, 1, 2], [0, 2, 3]])
UVS = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]])
PIXELS = np.arange(36, dtype=np.uint8).reshape(3, 4, 3) * 7


class Writer(GltfBuilder):
    """A quad with a material."""

    def __init__(self) -> None:
        super().__init__()
        self.more: dict[str, Any] = {}

    def _whole(self, attributes: dict[str, int], material: dict[str, Any]) -> dict[str, Any]:
        primitive = {
            "attributes": {"POSITION": self.accessor(POSITIONS), **attributes},
            "indices": self.accessor(FACES.ravel()),
            "material": 0,
        }
        nodes = [{"mesh": 0, **self.more.pop("node", {})}]
        return self.document([primitive], nodes=nodes, materials=[material], **self.more)

    def write_gltf(self, path: Path, attributes: dict[str, int], material: dict[str, Any]) -> Path:
        return write_document(path, self._whole(attributes, material), self.content)

    write_glb = write_gltf


def png(folder: Path) -> bytes:
    bitmaps.write_bitmap(folder / "made.png", Bitmap(PIXELS))
    return (folder / "made.png").read_bytes()


def only_part(path: Path) -> MeshPart:
    (part,) = mesh_files.load_parts(path)
    assert part.material is not None
    return part


def test_images_of_each_kind_are_read(tmp_path: Path) -> None:
    content = png(tmp_path)
    (tmp_path / "with space.png").write_bytes(content)
    for kind in ("file", "data", "view"):
        for suffix in ("gltf", "glb"):
            writer = Writer()
            image = {
                "file": {"uri": "with%20space.png"},
                "data": {"uri": "data:image/png;base64," + base64.b64encode(content).decode()},
                "view": {"bufferView": 0, "mimeType": "image/png"},
            }[kind]
            writer.view(content)
            writer.more = {"images": [image], "textures": [{"source": 0}]}
            material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
            write = writer.write_gltf if suffix == "gltf" else writer.write_glb
            path = write(tmp_path / f"{kind}.{suffix}", {"TEXCOORD_0": writer.accessor(UVS)}, material)
            part = only_part(path)
            assert part.material is not None
            texture = part.material.base_color_texture
            assert texture is not None
            np.testing.assert_array_equal(texture.bitmap.pixels, PIXELS)
            np.testing.assert_array_equal(part.mesh.uvs[0], UVS[FACES])
            # And by way of a scene file.
            scene = scene_around(path)
            scene_save.save(scene, tmp_path / "saved.toml")
            again = load(tmp_path / "saved.toml")
            stored = next(iter(again.materials.values())).base_color_texture
            assert stored is not None
            np.testing.assert_array_equal(stored.bitmap.pixels, PIXELS)
            assert not list(tmp_path.glob("saved.*.png")), "the image is in the file already"


def test_all_slots_and_how_they_are_read(tmp_path: Path) -> None:
    (tmp_path / "made.png").write_bytes(png(tmp_path))
    writer = Writer()
    writer.more = {
        "images": [{"uri": "made.png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}, {"magFilter": 9729}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}, {"source": 0}],
    }
    transform = {"offset": [0.1, 0.2], "rotation": np.pi / 4, "scale": [2, 3], "texCoord": 1}
    material = {
        "name": "all",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": transform}},
            "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
        },
        "normalTexture": {"index": 2, "scale": 0.5},
        "emissiveTexture": {"index": 2},
        "emissiveFactor": [1, 0.5, 0.25],
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": {"index": 2}},
            "KHR_materials_specular": {"specularTexture": {"index": 1}},
        },
    }
    uvs = writer.accessor((UVS * 65535).astype(np.uint16), normalized=True)
    colors = np.uint8([[255, 0, 51, 255]] * 4)
    tangents = np.float32([[1, 0, 0, -1]] * 4)
    attributes = {
        "TEXCOORD_0": writer.accessor(UVS), "TEXCOORD_1": uvs, "COLOR_0": writer.accessor(colors,
        normalized=True), "TANGENT": writer.accessor(tangents), "NORMAL": writer.accessor(np.float32([[0, 0,
        1]] * 4)),
    }  # fmt: skip
    part = only_part(writer.write_gltf(tmp_path / "all.gltf", attributes, material))
    made, mesh = part.material, part.mesh
    assert made is not None and made.normal_scale == 0.5
    base, rough, normal = made.base_color_texture, made.metallic_roughness_texture, made.normal_texture
    assert base is not None and rough is not None and normal is not None
    assert (base.wrap, base.filter, base.uv_set) == (("clamp", "mirror"), "nearest", 1)
    assert (base.offset, base.scale) == ((0.1, 0.2), (2, 3)) and base.rotation == pytest.approx(45)
    assert (rough.wrap, rough.filter, rough.uv_set) == (("repeat", "repeat"), "bilinear", 1)
    assert (normal.uv_set, normal.filter) == (0, "bilinear")
    assert made.emission_texture == normal and made.transmission_texture == normal
    assert made.specular_texture is not None and made.specular_texture.bitmap is base.bitmap
    np.testing.assert_allclose(mesh.uvs[1], UVS[FACES], atol=1e-5)
    assert mesh.colors is not None and mesh.tangents is not None
    np.testing.assert_allclose(mesh.colors, np.broadcast_to([1, 0, 0.2, 1], (2, 3, 4)), atol=1e-6)
    np.testing.assert_array_equal(mesh.tangents, np.broadcast_to([1, 0, 0, -1], (2, 3, 4)))


_LAYERS = {
    "anisotropy": {"anisotropyStrength": 0.6, "anisotropyRotation": np.pi / 2, "anisotropyTexture": 0},
    "clearcoat": {
        "clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.2, "clearcoatTexture": 0,
        "clearcoatRoughnessTexture": 0, "clearcoatNormalTexture": 0,
    },
    "diffuse_transmission": {
        "diffuseTransmissionFactor": 0.3, "diffuseTransmissionColorFactor": [0.1, 0.2, 0.3],
        "diffuseTransmissionTexture": 0, "diffuseTransmissionColorTexture": 0,
    },
    "dispersion": {"dispersion": 0.4},
    "iridescence": {
        "iridescenceFactor": 0.8, "iridescenceIor": 1.4, "iridescenceThicknessMinimum": 150,
        "iridescenceThicknessMaximum": 350, "iridescenceTexture": 0, "iridescenceThicknessTexture": 0,
    },
    "sheen": {
        "sheenColorFactor": [0.4, 0.5, 0.6], "sheenRoughnessFactor": 0.3, "sheenColorTexture": 0,
        "sheenRoughnessTexture": 0,
    },
    "specular": {"specularColorFactor": [2, 1, 0.5], "specularColorTexture": 0},
    "transmission": {"transmissionFactor": 0.9},
    "unlit": {},
    "volume": {"thicknessFactor": 0.0},
}  # fmt: skip
"""What extensions of materials say; a texture is the number of one."""
_LAYERS_READ = {
    "anisotropy": 0.6, "anisotropy_rotation": 90.0, "clearcoat": 0.7, "clearcoat_roughness": 0.2,
    "clearcoat_normal_scale": 0.25, "diffuse_transmission": 0.3,
    "diffuse_transmission_color": (0.1, 0.2, 0.3), "dispersion": 0.4, "iridescence": 0.8,
    "iridescence_ior": 1.4, "iridescence_least_thickness": 150.0, "iridescence_thickness": 350.0,
    "sheen_color": (0.4, 0.5, 0.6), "sheen_roughness": 0.3, "specular_color": (2.0, 1.0, 0.5),
    "transmission": 0.9, "unlit": True, "thin_walled": True,
}  # fmt: skip


def test_every_extension_of_materials_is_read(tmp_path: Path) -> None:
    (tmp_path / "made.png").write_bytes(png(tmp_path))
    writer = Writer()
    writer.more = {"images": [{"uri": "made.png"}], "textures": [{"source": 0}]}
    extensions = {
        f"KHR_materials_{name}": {
            key: {"index": value, "scale": 0.25} if key.endswith("Texture") else value
            for key, value in table.items()
        }
        for name, table in _LAYERS.items()
    }
    material = {"name": "all", "extensions": extensions}
    made = only_part(writer.write_gltf(tmp_path / "all.gltf", {}, material)).material
    assert made is not None
    for name, value in _LAYERS_READ.items():
        assert getattr(made, name) == pytest.approx(value), name
    asked = sum(key.endswith("Texture") for table in _LAYERS.values() for key in table)
    assert asked == sum(texture_of(made, slot) is not None for slot in TextureSlot)


@pytest.mark.parametrize(
    ("transmission", "thickness", "is_thin"), [(1, 0, True), (1, 0.5, False), (0, 0, False)]
)
def test_the_thickness_of_a_volume_decides_between_wall_and_body(
    tmp_path: Path, transmission: float, thickness: float, is_thin: bool
) -> None:
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": transmission},
        "KHR_materials_volume": {"thicknessFactor": thickness, "attenuationDistance": 2.0},
    }
    made = only_part(Writer().write_gltf(tmp_path / "a.gltf", {}, {"extensions": extensions})).material
    assert made is not None and made.thin_walled is is_thin


@pytest.mark.parametrize(
    ("extension", "key"),
    [
        ("transmission", "transmissionFactor"), ("volume", "thicknessFactor"), ("dispersion", "dispersion"),
        ("anisotropy", "anisotropyRotation"), ("iridescence", "iridescenceThicknessMaximum"),
        ("clearcoat", "clearcoatFactor"), ("sheen", "sheenColorFactor"),
    ],
)  # fmt: skip
def test_what_is_no_number_is_told_with_its_material(tmp_path: Path, extension: str, key: str) -> None:
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    extensions[f"KHR_materials_{extension}"] = {key: "much"}  # type: ignore[dict-item]
    path = Writer().write_gltf(tmp_path / "a.gltf", {}, {"name": "paint", "extensions": extensions})
    with pytest.raises(InputError, match=r"material 'paint': .*'much'"):
        mesh_files.load_parts(path)


def test_placements_turn_tangents_too(tmp_path: Path) -> None:
    """A quarter turn about z, mirrored in y: the side of v changes."""
    for scale, side in (([1, 1, 1], 1), ([1, -1, 1], -1)):
        writer = Writer()
        writer.more = {"node": {"rotation": [0, 0, 2**-0.5, 2**-0.5], "scale": scale}}
        attributes = {
            "TEXCOORD_0": writer.accessor(UVS), "NORMAL": writer.accessor(np.float32([[0, 0, 1]] * 4)),
            "TANGENT": writer.accessor(np.float32([[1, 0, 0, 1]] * 4)),
        }  # fmt: skip
        mesh = only_part(writer.write_gltf(tmp_path / f"{side}.gltf", attributes, {})).mesh
        assert mesh.tangents is not None
        np.testing.assert_allclose(mesh.tangents, np.broadcast_to([0, 1, 0, side], (2, 3, 4)), atol=1e-6)


@pytest.mark.parametrize("index", [99, -1, "0", None])
def test_a_texture_that_cannot_be_found_leaves_the_rest_of_its_material(
    index: object, tmp_path: Path
) -> None:
    writer = Writer()
    writer.more = {"images": [{"uri": "made.png"}], "textures": [{"source": 0}]}
    material = {
        "name": "leaf", "alphaMode": "MASK", "alphaCutoff": 1.5,
        "normalTexture": {"index": index, "scale": -1},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": index}, "roughnessFactor": 0.25},
    }  # fmt: skip
    path = writer.write_gltf(tmp_path / "a.gltf", {"TEXCOORD_0": writer.accessor(UVS)}, material)
    with pytest.warns(InputWarning, match=r"a.gltf: left out normalTexture of material 'leaf': "):
        made = only_part(path).material
    assert made is not None and made.base_color_texture is None
    assert (made.alpha_mode, made.alpha_cutoff, made.normal_scale, made.roughness) == ("mask", 1.5, -1, 0.25)


def test_images_in_a_file_are_the_same_wherever_they_come_from(tmp_path: Path) -> None:
    writer = Writer()
    writer.view(png(tmp_path))
    writer.more = {"images": [{"bufferView": 0, "mimeType": "image/png"}], "textures": [{"source": 0}]}
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    path = writer.write_glb(tmp_path / "a.glb", {"TEXCOORD_0": writer.accessor(UVS)}, material)
    scene = scene_around(path)
    scene_save.save(scene, tmp_path / "saved.toml")
    assert load(tmp_path / "saved.toml") == scene
    with pytest.raises(InputError, match="name one by its number"):
        bitmaps.load_bitmap(path)


def test_an_image_that_cannot_be_read_is_left_out_and_told(tmp_path: Path) -> None:
    damaged = base64.b64encode(png(tmp_path)[:40]).decode()
    for name, image, words in (
        ("missing", {"uri": "nowhere.png"}, "nowhere.png: no such file"),
        (
            "damaged",
            {"uri": "data:image/png;base64," + damaged},
            "image 0: is",
        ),
        ("odd", {"uri": "data:image/png;base64,###"}, "image 0: "),
        ("basis", {"uri": "data:image/ktx2;base64,AAAA"}, "image 0: is no KTX2 image, or a damaged one"),
    ):
        writer = Writer()
        writer.more = {"images": [image], "textures": [{"source": 0}]}
        material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "roughnessFactor": 0.5}}
        path = writer.write_gltf(tmp_path / f"{name}.gltf", {"TEXCOORD_0": writer.accessor(UVS)}, material)
        with pytest.warns(InputWarning, match=rf"^[^\n]*{name}.gltf: left out baseColor[^\n]*{words}[^\n]*$"):
            made = only_part(path).material
        assert made is not None and made.base_color_texture is None and made.roughness == 0.5


def ktx2(color: tuple[int, int, int, int]) -> bytes:
    """4 x 4 pixels of one colour, in UASTC: a block of mode 8 (code 0x17, 5 bits), then 8 bits a channel."""
    bits = 0x17 | sum(value << 5 + 8 * channel for channel, value in enumerate(color))
    sample = struct.pack("<HBBIII", 0, 127, 3, 0, 0, 0xFFFFFFFF)
    # UASTC (166), BT.709, sRGB, blocks of 4 x 4 pixels in 16 bytes.
    described = struct.pack("<IIHH16B", 44, 0, 2, 40, 166, 1, 2, 0, 3, 3, 0, 0, 16, *[0] * 7) + sample
    header = struct.pack("<9I", 0, 1, 4, 4, 0, 0, 1, 1, 0) + struct.pack("<4I2Q", 104, 44, 0, 0, 0, 0)
    level = struct.pack("<3Q", 160, 16, 16)
    start = b"\xabKTX 20\xbb\r\n\x1a\n" + header + level + described
    return start.ljust(160, b"\0") + bits.to_bytes(16, "little")


def test_basis_universal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("opengl_basisu")
    (tmp_path / "a.ktx2").write_bytes(ktx2((200, 100, 50, 255)))
    writer = Writer()
    texture = {"extensions": {"KHR_texture_basisu": {"source": 0}}}
    writer.more = {"images": [{"uri": "a.ktx2"}], "textures": [texture]}
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    path = writer.write_gltf(tmp_path / "a.gltf", {"TEXCOORD_0": writer.accessor(UVS)}, material)
    made = only_part(path).material
    assert made is not None and made.base_color_texture is not None
    pixels = made.base_color_texture.bitmap.pixels
    assert pixels.shape == (4, 4, 4) and (pixels == [200, 100, 50, 255]).all()

    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr("incpt.formats.basis.import_module", missing)
    with pytest.raises(InputError, match=r"Basis Universal \(KTX2\); `pip install incpt\[gltf\]`"):
        basis.pixels_of_ktx2(ktx2((0, 0, 0, 0)))


def test_of_several_images_the_one_that_can_be_read_is_taken(tmp_path: Path) -> None:
    (tmp_path / "made.png").write_bytes(png(tmp_path))
    basis = {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}
    webp = {"source": 1, "extensions": {"EXT_texture_webp": {"source": 0}}}
    for texture in (basis, webp):
        writer = Writer()
        writer.more = {"images": [{"uri": "made.png"}, {"uri": "other.ktx2"}], "textures": [texture]}
        material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
        path = writer.write_gltf(tmp_path / "a.gltf", {"TEXCOORD_0": writer.accessor(UVS)}, material)
        made = only_part(path).material
        assert made is not None and made.base_color_texture is not None


def test_a_damaged_accessor_is_one_line(tmp_path: Path) -> None:
    writer = Writer()
    uvs = writer.accessor(UVS)
    writer.accessors[uvs]["count"] = 4_000_000
    path = writer.write_gltf(tmp_path / "a.gltf", {"TEXCOORD_0": uvs}, {})
    with pytest.raises(InputError, match=r"^[^\n]*a.gltf: [^\n]*$"):
        mesh_files.load_parts(path)
