"""Packed scenes: what is in the folder, that nothing outside is needed, and that the picture is the same."""

from __future__ import annotations

import shutil
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from support.gltf_files import GltfBuilder
from support.renders import pixels
from support.small_scenes import sky, small_settings

from incpt.cli.main import main
from incpt.core.errors import InputError, OutputError
from incpt.formats import bitmaps, images, mesh_store, registry
from incpt.formats.pack import pack
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.texture import Bitmap, Texture


def gathered_scene(folder: Path) -> Scene:
    """Of a scene file with meshes and images from everywhere: shapes, parts of a glTF file with an image in
    it, an image beside, one made in Python."""
    PIL.Image.new("RGB", (2, 2), (200, 80, 30)).save(folder / "wood grain.jpg")
    images.write_exr(folder / "sky.exr", {"RGB": sky().pixels})
    builder = GltfBuilder()
    uv = builder.accessor(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    quad = builder.quad(material=0)
    quad["attributes"]["TEXCOORD_0"] = uv
    image = builder.view((folder / "wood grain.jpg").read_bytes())
    builder.write(
        folder / "quad.glb",
        [quad],
        materials=[{"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"bufferView": image, "mimeType": "image/jpeg"}],
    )
    opened = registry.load(folder / "quad.glb")
    beside = Texture(bitmaps.load_bitmap(folder / "wood grain.jpg"), scale=(2, 3), wrap=("mirror", "clamp"))
    made = Texture(Bitmap(np.array([[[0.5, 2.0, 0.25]]], np.float32)))
    materials = {
        **opened.materials,
        "beside": Material(base_color_texture=beside, roughness=0.5),
        "made": Material(base_color_texture=made),
    }
    other = replace(shape("sphere"), source=mesh_store.MeshSource())
    objects = (
        *opened.objects,
        Object("A b", other, "beside", (1, 0, 0), scale=(0.4, 0.4, 0.4)),
        Object("a-b", replace(shape("cube"), source=mesh_store.MeshSource()), "made", (-1, 0, 0)),
        Object("again", other, "made", (0, -1, 0), rotation=(10, 20, 30)),
        Object("shape", shape("cylinder"), "made", (0, 1, -1)),
    )
    environment = Environment((1.0, 1.0, 1.0), images.load_image(folder / "sky.exr"))
    lamp = Light("lamp", "point", (0, 0, 2), power=30.0)
    return replace(
        opened, materials=materials, objects=objects, environment=environment, lights=(lamp,),
        settings=small_settings(size=(24, 16)),
    )  # fmt: skip


def test_the_picture_is_the_same_without_the_files_that_it_came_from(tmp_path: Path) -> None:
    sources = tmp_path / "sources"
    sources.mkdir()
    scene = gathered_scene(sources)
    pack(scene, tmp_path / "made")
    shutil.rmtree(sources)
    shutil.move(tmp_path / "made", tmp_path / "moved")
    found = {path.relative_to(tmp_path / "moved").as_posix() for path in (tmp_path / "moved").rglob("*.*")}
    assert found == {
        "scene.toml", "meshes/a-b.npz", "meshes/a-b.2.npz", "meshes/quad.npz",
        "textures/sky.exr", "textures/wood-grain.jpg", "textures/quad-0.png", "textures/texture.exr",
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = registry.load(tmp_path / "moved" / "scene.toml")
    assert again.settings == scene.settings and again.lights == scene.lights and again.camera == scene.camera
    by_name = {obj.name: obj.mesh for obj in again.objects}
    assert by_name["A b"] is by_name["again"], "what is shared stays shared"
    np.testing.assert_array_equal(pixels(again, 4), pixels(scene, 4))


def test_archives(tmp_path: Path) -> None:
    scene = gathered_scene(tmp_path)
    for name in ("a.zip", "b.zip"):
        (tmp_path / name).write_bytes(b"an older file")
        pack(scene, tmp_path / name)
    with zipfile.ZipFile(tmp_path / "a.zip") as archive, zipfile.ZipFile(tmp_path / "b.zip") as other:
        assert {name.replace("a/", "b/", 1) for name in archive.namelist()} == set(other.namelist())
        assert archive.read("a/scene.toml") == other.read("b/scene.toml")
        archive.extractall(tmp_path / "out")
    assert registry.load(tmp_path / "out" / "a" / "scene.toml").names == scene.names


def test_folders_that_hold_something_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    pack(Scene(), tmp_path / "made")
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["scene.toml"]
    with pytest.raises(InputError, match="made: has something in it; name a new folder"):
        pack(Scene(), tmp_path / "made")
    with pytest.raises(OutputError, match="cannot be written"):
        pack(Scene(), tmp_path / "none" / "made")


def test_nothing_is_left_of_what_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(environment=Environment((1, 1, 1), Image(np.ones((2, 4, 3)))))
    odd = replace(scene, materials={"\ud800": Material()})
    with pytest.raises(InputError, match="no valid text"):
        pack(odd, tmp_path / "made")
    with pytest.raises(InputError, match="no valid text"):
        pack(odd, tmp_path / "made.zip")
    assert list(tmp_path.iterdir()) == []


def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1000 0\nf 1 2 3\nl 1 2\n")
    assert main(["pack", str(tmp_path / "a.obj"), str(tmp_path / "made"), "--unit", "mm"]) == 0
    out, error = capsys.readouterr()
    assert out == f"{tmp_path / 'made'}: written\n" and "left out 1 line without area" in error
    (obj,) = registry.load(tmp_path / "made" / "scene.toml").objects
    assert obj.world_bounds[1].tolist() == [0.001, 1, 0]
    arguments = ["pack", str(tmp_path / "a.obj"), str(tmp_path / "b"), "--strict"]
    assert main(arguments) == 2 and not (tmp_path / "b").exists()
