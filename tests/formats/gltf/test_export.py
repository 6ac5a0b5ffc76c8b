"""Scenes written as glTF: what both know comes back, and what glTF has no place for is told."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import PIL.Image
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from support.small_scenes import sky

from incpt.cli.main import main
from incpt.core import affine
from incpt.core.errors import InputError, InputWarning
from incpt.core.layout import TextureSlot
from incpt.core.settings import RenderSettings
from incpt.formats import bitmaps, import_report, registry
from incpt.formats.gltf_writer import container
from incpt.formats.gltf_writer.export import _quaternion, export
from incpt.formats.import_report import Fate
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material, texture_name
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.tangents import corner_tangents
from incpt.scene.texture import Bitmap, Texture

DARK = Environment((0.0, 0.0, 0.0))
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
SHEARED = [[1, 0.5, 0, 3], [0, -2, 0.25, 1], [0.1, 0, 1, 0]]


def rich_mesh() -> Mesh:
    """With something of its own at each corner."""
    rng = np.random.default_rng(1)
    unit = rng.normal(size=(2, 4, 3, 3))
    normals, along = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    sides = np.where(rng.random((4, 3, 1)) < 0.5, -1, 1)
    tangents = np.concatenate([along, sides], axis=-1)
    uvs = tuple(rng.random((2, 4, 3, 2)))
    return Mesh(TETRAHEDRON, FACES, normals, uvs=uvs, colors=rng.random((4, 3, 4)), tangents=tangents)


def round_trip(scene: Scene, folder: Path) -> tuple[Scene, list[str]]:
    """What comes back of a scene, and what was told."""
    path = folder / "again.glb"
    with import_report.gathered() as found:
        export(scene, path)
    assert all(remark.file == str(path) for remark in found.report.remarks)
    again, report = registry.load_with_report(path)
    assert not report.of(Fate.LEFT_OUT), "nothing is written that is not read"
    return again, [remark.text for remark in found.report.remarks]


def json_of(path: Path) -> dict[str, Any]:
    content = path.read_bytes()
    size = int.from_bytes(content[12:16], "little")
    document: dict[str, Any] = json.loads(content[20 : 20 + size])
    return document


def assert_alike(found: Any, expected: Any) -> None:
    """The same JSON, but for the last digits of numbers."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for key, value in expected.items():
            assert_alike(found[key], value)
    elif isinstance(expected, list):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert_alike(one, other)
    else:
        assert found == (pytest.approx(expected, abs=1e-12) if isinstance(expected, float) else expected)


def kinds_of_images(path: Path) -> list[str]:
    return [image["mimeType"] for image in json_of(path)["images"]]


def corners(mesh: Mesh) -> npt.NDArray[np.float32]:
    """(F, 3, n) all that a mesh has at its corners."""
    values = (mesh.normals, *mesh.uvs, mesh.colors, mesh.tangents)
    return np.concatenate([mesh.vertices[mesh.faces], *(v for v in values if v is not None)], axis=2)


def test_objects_and_meshes_come_back(tmp_path: Path) -> None:
    rich, cube = rich_mesh(), shape("cube")
    plain = Mesh(np.append(TETRAHEDRON, [[9, 9, 9]], axis=0), FACES)
    materials = {"a": Material(roughness=0.5), "b": Material(base_color=(1, 0, 0))}
    objects = (
        Object("rich", rich, "a", (1, 2, 3), (10, 20, 30), (1, -2, 0.5)),
        Object("rich again", rich, "b", matrix=SHEARED),
        Object("hidden", rich, "b", visible=False),
        Object("plain", plain, "a"),
        Object("cube/with a slash", cube, "b"),
    )
    scene = Scene(Camera(), DARK, materials, objects)
    again, told = round_trip(scene, tmp_path)
    assert [obj.name for obj in again.objects] == [f"again/{obj.name}" for obj in objects]
    for old, new in zip(objects, again.objects, strict=True):
        np.testing.assert_allclose(corners(new.mesh), corners(old.mesh), atol=1e-6)
        np.testing.assert_array_equal(new.mesh.vertices[new.mesh.faces], old.mesh.vertices[old.mesh.faces])
        np.testing.assert_allclose(new.world_from_object, old.world_from_object, atol=1e-9)
        assert (new.material, new.visible) == (old.material, old.visible)
        assert (new.mesh.normals is None) == (old.mesh.normals is None)
    assert len({id(obj.mesh) for obj in again.objects}) == 3, "what is shared stays shared"
    assert again.materials == materials and told == []
    assert len(json_of(tmp_path / "again.glb")["accessors"]) == 12, "arrays of a mesh stand there once"
    assert len(again.object("again/plain").mesh.vertices) == 4, "without what no face uses"
    # What was read from a file of that name gets no longer names by it.
    twice, _ = round_trip(again, tmp_path)
    assert [obj.name for obj in twice.objects] == [obj.name for obj in again.objects]


def test_another_reader_sees_the_same_triangles(tmp_path: Path) -> None:
    objects = (
        Object("a", rich_mesh(), "m", matrix=SHEARED),
        Object("b", shape("cube"), "m", (0, 5, 0), (0, 45, 0)),
    )
    scene = Scene(Camera(), DARK, {"m": Material()}, objects)
    round_trip(scene, tmp_path)
    theirs = trimesh.load_scene(tmp_path / "again.glb", process=False)
    for obj in objects:
        matrix, name = theirs.graph[obj.name]
        found = affine.apply(matrix[:3], theirs.geometry[name].triangles.reshape(-1, 3))
        ours = affine.apply(obj.world_from_object, obj.mesh.vertices[obj.mesh.faces].reshape(-1, 3))
        np.testing.assert_allclose(found, ours, atol=1e-5)


def test_a_second_trip_changes_nothing(tmp_path: Path) -> None:
    scene = Scene(
        Camera((0, 1, 4), (0, 0.5, 0)), DARK, {"m": Material(metallic=0.5, emission=(5, 2, 0))},
        (Object("a", rich_mesh(), "m", matrix=SHEARED), Object("b", shape("cube"), "m", rotation=(5, 6, 7))),
        lights=(Light("lamp", "spot", (0, 3, 0), (-90, 0, 0), power=40.0, radius=0.0),),
    )  # fmt: skip
    once, _ = round_trip(scene, tmp_path)
    twice, _ = round_trip(once, tmp_path)
    stored = json_of(tmp_path / "again.glb")
    round_trip(twice, tmp_path)
    assert_alike(json_of(tmp_path / "again.glb"), stored)


# ------------------------------------------------------------------------------------------ materials

GLASS: dict[str, Any] = {"transmission": 0.75, "base_color": (1, 0.5, 0.25), "ior": 1.33}
MATERIALS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "white": {"base_color": (1, 1, 1), "metallic": 1.0, "roughness": 1.0},
    "surface": {"base_color": (0.1, 0.2, 0.3), "metallic": 0.25, "roughness": 0.125, "double_sided": True},
    "dielectric": {"specular": 0.5, "specular_color": (2, 1, 0.5), "ior": 1.8},
    "body": {**GLASS, "absorption": (2, 0, 7.5), "dispersion": 0.5},
    "clear body": GLASS,
    "thin": {**GLASS, "thin_walled": True},
    "lamp": {"emission": (17, 0.25, 3)},
    "glow": {"emission": (0.5, 0.25, 0)},
    "mask": {"alpha": 0.5, "alpha_mode": "mask", "alpha_cutoff": 0.25},
    "blend": {"alpha": 0.25, "alpha_mode": "blend"},
    "leaf": {"diffuse_transmission": 0.5, "diffuse_transmission_color": (0.5, 1, 0.25)},
    "coat": {"clearcoat": 0.5, "clearcoat_roughness": 0.25},
    "cloth": {"sheen_color": (0.5, 0.25, 1), "sheen_roughness": 0.75},
    "grooves": {"anisotropy": 0.5, "anisotropy_rotation": 30.0},
    "film": {
        "iridescence": 0.5, "iridescence_ior": 1.5, "iridescence_thickness": 600.0,
        "iridescence_least_thickness": 200.0,
    },
    "sign": {"unlit": True, "base_color": (1, 0, 0)},
}  # fmt: skip
WITHOUT_A_PLACE = {"priority", "bump_scale", "normal_scale", "clearcoat_normal_scale"}
"""Numbers that are lost, or say nothing without a texture."""


def test_every_number_of_a_material_comes_back(tmp_path: Path) -> None:
    plain = {field.name for field in fields(Material) if not field.name.endswith("_texture")}
    assert plain - WITHOUT_A_PLACE == {name for values in MATERIALS.values() for name in values}
    materials = {name: Material(**values) for name, values in MATERIALS.items()}
    objects = tuple(Object(name, shape("cube"), name) for name in materials)
    again, told = round_trip(Scene(Camera(), DARK, materials, objects), tmp_path)
    assert told == [] and again.materials.keys() == materials.keys()
    for name, old in materials.items():
        for field in fields(Material):
            value = getattr(old, field.name)
            close = value if isinstance(value, bool | str | None) else pytest.approx(value, rel=1e-9)
            assert getattr(again.materials[name], field.name) == close, (name, field.name)
    assert json_of(tmp_path / "again.glb")["extensionsUsed"] == sorted(
        f"KHR_materials_{name}" for name in (
            "anisotropy", "clearcoat", "diffuse_transmission", "dispersion", "emissive_strength", "ior",
            "iridescence", "sheen", "specular", "transmission", "unlit", "volume",
        )
    )  # fmt: skip


def test_every_texture_comes_back(tmp_path: Path) -> None:
    PIL.Image.new("RGB", (3, 2), (200, 80, 30)).save(tmp_path / "a.jpg")
    photo = bitmaps.load_bitmap(tmp_path / "a.jpg")
    exact = Bitmap(np.random.default_rng(2).integers(0, 65_536, (2, 3, 4)).astype(np.uint16))
    grey = Bitmap(np.array([[[0, 255], [90, 12]]], np.uint8))
    looks = [
        Texture(photo, 1, ("mirror", "clamp"), "nearest", (0.25, -1.5), 30.0, (2, -3)),
        Texture(exact, 0, "clamp"),
        Texture(grey, rotation=90.0),
    ]
    slots = [texture_name(slot) for slot in TextureSlot if slot is not TextureSlot.BUMP]
    values: dict[str, Any] = {name: looks[i % 3] for i, name in enumerate(slots)}
    material = Material(**values, normal_scale=-0.5, clearcoat_normal_scale=2.0, emission=(1, 1, 1))
    scene = Scene(Camera(), DARK, {"m": material}, (Object("a", rich_mesh(), "m"),))
    again, told = round_trip(scene, tmp_path)
    assert told == []
    found = again.materials["m"]
    assert found.normal_scale == -0.5 and found.clearcoat_normal_scale == 2
    for name, old in values.items():
        new = getattr(found, name)
        np.testing.assert_array_equal(new.bitmap.pixels, old.bitmap.pixels)
        assert replace(new, bitmap=old.bitmap, rotation=0.0) == replace(old, rotation=0.0), name
        assert new.rotation == pytest.approx(old.rotation)
    assert kinds_of_images(tmp_path / "again.glb") == ["image/jpeg", "image/png", "image/png"]
    assert all(view["byteOffset"] % 4 == 0 for view in json_of(tmp_path / "again.glb")["bufferViews"])
    assert (tmp_path / "a.jpg").read_bytes() in (tmp_path / "again.glb").read_bytes(), "not compressed twice"
    # Also an image that stands in a glTF file itself, and not where its file is another one now.
    (tmp_path / "again.glb").rename(tmp_path / "first.glb")
    PIL.Image.new("RGB", (3, 2), (1, 2, 3)).save(tmp_path / "a.jpg")
    round_trip(registry.load(tmp_path / "first.glb"), tmp_path)
    assert kinds_of_images(tmp_path / "again.glb")[0] == "image/jpeg"
    round_trip(scene, tmp_path)
    assert kinds_of_images(tmp_path / "again.glb") == ["image/png"] * 3


def test_meshes_have_what_materials_want_of_them(tmp_path: Path) -> None:
    """Files are not valid else."""
    texture = Texture(Bitmap(np.zeros((1, 1, 3), np.uint8)), uv_set=1)
    materials = {
        "plain": Material(),
        "image": Material(base_color_texture=texture),
        "grooves": Material(anisotropy_rotation=0.5),
        "coat": Material(clearcoat_normal_texture=texture),
    }
    flat = Mesh(TETRAHEDRON, FACES)
    objects = tuple(Object(name, flat, name) for name in materials)
    again, _ = round_trip(Scene(Camera(), DARK, materials, objects), tmp_path)
    plain, image, grooves, coat = (obj.mesh for obj in again.objects)
    assert plain.uvs == () and plain.normals is None and grooves.uvs == ()
    assert len(image.uvs) == 2 and not any(uvs.any() for uvs in image.uvs)
    assert len(coat.uvs) == 2 and coat.tangents is not None
    np.testing.assert_allclose(grooves.tangents, corner_tangents(flat), atol=1e-6)
    a, b, c = (TETRAHEDRON[FACES[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert grooves.normals is not None
    np.testing.assert_allclose(grooves.normals, np.repeat(normals[:, None], 3, axis=1), atol=1e-6)


def test_images_of_floats_become_16_bits(tmp_path: Path) -> None:
    values = np.array([[[0.5, 0.0, 1.0, 0.25]], [[2.0, -1.0, 0.75, 1.0]]], np.float32)
    texture = Texture(Bitmap(values))
    material = Material(base_color_texture=texture, normal_texture=texture)
    scene = Scene(Camera(), DARK, {"m": material}, (Object("a", rich_mesh(), "m"),))
    again, told = round_trip(scene, tmp_path)
    assert told == ["an image of floats: what is below 0 or above 1 is cut off"]
    color, normal = again.materials["m"].base_color_texture, again.materials["m"].normal_texture
    assert color is not None and normal is not None
    np.testing.assert_allclose(normal.bitmap.pixels / 65_535, np.clip(values, 0, 1), atol=1e-5)
    assert color.bitmap.pixels[0, 0].tolist() == [48_192, 0, 65_535, 16_384], "half of the light in sRGB"


# ------------------------------------------------------------------------------- cameras and lights


def test_cameras_come_back(tmp_path: Path) -> None:
    cameras = {
        "side": Camera((4, 1, 0), (0, 1, 0), near=0.5),
        "plan": Camera((0, 9, 0), (0, 0, 0), (0, 0, -1), projection="orthographic", ortho_height=3.0),
        "long": Camera((0, 1, 9), (0, 1, 0), focal_length=85.0, sensor_fit="vertical"),
    }
    objects = (Object("a", shape("cube"), "m"),)
    scene = Scene(cameras["plan"], DARK, {"m": Material()}, objects, camera_name="plan", cameras=cameras)
    again, told = round_trip(scene, tmp_path)
    assert again.camera_name == "plan" and list(again.cameras) == ["plan", "side", "long"] and told == []
    places = np.random.default_rng(3).random((9, 2))
    for name, old in cameras.items():
        new = again.cameras[name]
        for mine, theirs in zip(new.rays(places, 16 / 9), old.rays(places, 16 / 9), strict=True):
            np.testing.assert_allclose(mine, theirs, atol=2e-3 if name != "side" else 1e-9)
        assert new.fov_y_at(16 / 9) == pytest.approx(old.fov_y_at(16 / 9))
    assert again.cameras["side"].near == 0.5
    lens = json_of(tmp_path / "again.glb")["cameras"][0]["orthographic"]
    width, height = scene.settings.size
    assert lens["ymag"] == 1.5 and lens["xmag"] == pytest.approx(1.5 * width / height)
    assert lens["zfar"] > 9.5


def test_lights_come_back(tmp_path: Path) -> None:
    lights = (
        Light("point", "point", (1, 2, 3), power=50.0, color=(1, 0.5, 0.25), radius=0.0),
        Light(
            "spot", "spot", (0, 3, 0), (-90, 0, 0), power=20.0, spot_angle=50.0, spot_blend=0.3, radius=0.0
        ),
        Light("sun", "sun", rotation=(-60, 30, 0), irradiance=2.0, color=(4, 2, 1), angle=0.0, visible=False),
        Light("ball", "point", radius=0.25, radiance=100.0, casts_shadows=False),
    )
    objects = (Object("a", shape("cube"), "m"),)
    again, told = round_trip(Scene(Camera(), DARK, {"m": Material()}, objects, lights=lights), tmp_path)
    assert told == [
        "the size of light 'ball': glTF has no place for it",
        "the lack of shadows of light 'ball': glTF has no place for it",
    ]
    for old, new in zip(lights, again.lights, strict=True):
        assert (new.name, new.kind, new.visible) == (f"again/{old.name}", old.kind, old.visible)
        np.testing.assert_allclose(new.axes[2], old.axes[2], atol=1e-12)
        assert new.position == pytest.approx(old.position)
        # All light that it gives, whatever its size was.
        assert new.watts == pytest.approx(old.watts)
        assert new.cone == pytest.approx(old.cone)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_lights_with_a_surface_become_one(tmp_path: Path, kind: str) -> None:
    light = Light("panel", kind, (1, 2, 3), (30, 40, 0), (2, 2, 2), power=30.0, radius=0.5, size=(1, 3))
    again, told = round_trip(Scene(Camera(), DARK, {}, (), lights=(light,)), tmp_path)
    assert told == [f"light 'panel': is a surface that glows, because glTF has no {kind}"]
    (obj,) = again.objects
    material = again.materials[obj.material]
    assert material.emission == pytest.approx(light.emitted) and not material.double_sided
    a, b, c = (affine.apply(obj.world_from_object, obj.mesh.vertices[obj.mesh.faces[:, i]]) for i in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1) / 2
    assert areas.sum() == pytest.approx(light.area, rel=2e-3 if kind == "sphere" else 1e-6)
    if kind == "sphere":
        assert (((a - light.position) * normals).sum(axis=1) > 0).all()
    else:
        np.testing.assert_allclose(normals / (2 * areas[:, None]), [-light.axes[2]] * len(a), atol=1e-6)
    places = np.concatenate([a, b, c])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    np.testing.assert_allclose(middle, light.position, atol=1e-2)


def test_what_has_no_place_is_told_once(tmp_path: Path) -> None:
    bump = Texture(Bitmap(np.zeros((1, 1, 1), np.uint8)))
    materials = {f"m{i}": Material(bump_texture=bump, priority=i, transmission=1.0) for i in range(5)}
    objects = tuple(Object(name, shape("cube"), name) for name in materials)
    camera = Camera(f_stop=2.0, shift_x=0.1)
    environment = Environment((1, 1, 1), sky())
    scene = Scene(camera, environment, materials, objects, RenderSettings(size=(64, 64)))
    with pytest.warns(InputWarning) as caught:
        export(scene, tmp_path / "a.glb")
    assert [str(one.message).removeprefix(f"{tmp_path / 'a.glb'}: left out ") for one in caught] == [
        "the height map of material 'm0', 'm1', 'm2', 'm3' and 1 more: glTF has no place for it",
        "the priority among nested bodies of material 'm1', 'm2', 'm3', 'm4': glTF has no place for it",
        "the depth of field of camera 'camera': glTF has no place for it",
        "the shift of camera 'camera': glTF has no place for it",
        "the environment: glTF has no place for light from far away but suns",
        "how the scene is rendered: glTF has no place for it",
    ]


@given(st.tuples(*[st.floats(-180, 180)] * 3), st.sampled_from([0, 90, 180, 179.9999999, 1e-9]))
def test_quaternions_turn_as_their_matrices(angles: tuple[float, float, float], first: float) -> None:
    for rotation in (angles, (first, *angles[1:]), (first, first, angles[2])):
        matrix = affine.rotation_matrix(rotation)
        x, y, z, w = _quaternion(matrix)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        np.testing.assert_allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, matrix, atol=1e-12)


def test_only_glb_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"a.gltf: a scene is exported as .glb; end its name so"):
        export(Scene(), tmp_path / "a.gltf")
    monkeypatch.setattr(container, "_MOST_BYTES", 1000)
    scene = Scene(Camera(), DARK, {"m": Material()}, (Object("a", shape("cube"), "m"),))
    with pytest.raises(InputError, match=r"more than a \.glb file can; write fewer objects"):
        export(scene, tmp_path / "a.glb")
    assert list(tmp_path.iterdir()) == []


def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\n")
    assert main(["export", str(tmp_path / "a.obj"), str(tmp_path / "b.glb")]) == 0
    out, error = capsys.readouterr()
    assert out.splitlines()[:3] == [
        f"{tmp_path / 'b.glb'}: written",
        f"{tmp_path / 'b.glb'}:",
        "  left out: the environment: glTF has no place for light from far away but suns",
    ]
    assert "left out 1 line without area" in error
    assert len(registry.load(tmp_path / "b.glb").objects) == 1
