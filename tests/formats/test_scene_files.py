"""Scene files: what is saved comes back, and every bad file is one line that names the place."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.parameters import TEXTURES

from incpt.core import affine
from incpt.core.errors import InputError, InputWarning, OutputError
from incpt.core.settings import RenderSettings
from incpt.formats import images, mesh_files, mesh_store, registry, scene_save
from incpt.scene import summary
from incpt.scene.camera import Camera
from incpt.scene.change import diff
from incpt.scene.checks import LARGEST
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import ALPHA_MODES, Material
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.sky import Sky
from incpt.scene.texture import FILTERS, WRAPS, Bitmap, Texture
from incpt.scene.transform import Transform

SCENES = Path(__file__).parents[2] / "scenes"
VALID = """
version = 1
[camera]
position = [0, 1.2, 5]
[environment]
color = [1, 1, 1]
[materials.red]
base_color = [0.8, 0.1, 0.1]
[[objects]]
name = "red cube"
shape = "cube"
material = "red"
position = [0, 0.5, 0]
"""
SHEARED = [[1.0, 0.1, 0.2, 0.3], [0.0, 1.0, 1 / 3, 2.0], [0.0, -0.7, 1.1, -1e-7]]


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def load_text(folder: Path, text: str) -> Scene:
    path = folder / "a.toml"
    path.write_text(text)
    return registry.load(path)


def assert_same(a: Scene, b: Scene) -> None:
    """Equal, with meshes and images compared by content: a new file gives new ones."""
    assert (a.camera, a.settings, dict(a.materials)) == (b.camera, b.settings, dict(b.materials))
    assert a.camera_name == b.camera_name and list(a.cameras.items()) == list(b.cameras.items())
    assert replace(a.environment, image=None) == replace(b.environment, image=None)
    assert (a.environment.image is None) == (b.environment.image is None)
    if a.environment.image is not None and b.environment.image is not None:
        np.testing.assert_array_equal(a.environment.image.pixels, b.environment.image.pixels)
    assert len(a.objects) == len(b.objects)
    for left, right in zip(a.objects, b.objects, strict=True):
        assert replace(left, mesh=shape("cube")) == replace(right, mesh=shape("cube"))
        assert mesh_store.digest(left.mesh) == mesh_store.digest(right.mesh)


def test_a_scene_file_gives_what_it_says(tmp_path: Path) -> None:
    scene = load_text(
        tmp_path,
        VALID
        + "rotation = [0, 30, 0]\nscale = [1, 2, 1]\nvisible = false\n[render]\nsize = [64, 32]\nnor = 16\n"
        + '[materials."a lamp"]\nemission = [1, 2, 3]\ndouble_sided = true\npriority = 2\n',
    )
    assert scene.camera == Camera((0, 1.2, 5))
    assert scene.settings == RenderSettings(size=(64, 32), nor=16)
    cube = scene.object("red cube")
    assert cube.mesh is shape("cube") and cube.scale == (1, 2, 1) and not cube.visible
    assert scene.material("a lamp") == Material(emission=(1, 2, 3), double_sided=True, priority=2)


CAMERAS = """
version = 1
active_camera = "the top"
[environment]
color = [1, 1, 1]
[materials.red]
[[objects]]
name = "red cube"
shape = "cube"
material = "red"
[cameras.front]
position = [0, 1, 9]
[cameras."the top"]
position = [0, 9, 0.1]
projection = "orthographic"
"""


def test_a_scene_may_have_several_cameras(tmp_path: Path) -> None:
    scene = load_text(tmp_path, CAMERAS)
    assert list(scene.cameras) == ["front", "the top"] and scene.camera_name == "the top"
    assert scene.camera == Camera((0, 9, 0.1), projection="orthographic") == scene.cameras["the top"]
    assert scene.cameras["front"] == Camera((0, 1, 9))
    assert load_text(tmp_path, CAMERAS.replace('active_camera = "the top"', "")).camera_name == "front"
    both = load_text(tmp_path, VALID + "[cameras.top]\nfov_y = 20\n")
    assert list(both.cameras) == ["camera", "top"] and both.camera_name == "camera"
    for one in (scene, both, scene.with_active_camera("front"), scene.without_camera("front")):
        scene_save.save(one, tmp_path / "b.toml")
        assert_same(registry.load(tmp_path / "b.toml"), one)


def test_a_scene_may_have_a_sky(tmp_path: Path) -> None:
    scene = load_text(
        tmp_path, VALID.replace("color = [1, 1, 1]", "[environment.sky]\nsun_elevation = 7\ndust = 3")
    )
    assert scene.environment == Environment((1, 1, 1), sky=Sky(7, dust=3))
    dimmed = scene.with_environment(intensity=0.1, rotation_y=30)
    for one in (dimmed, dimmed.with_environment(sky=Sky(sun_disc=False, ground=0.0))):
        scene_save.save(one, tmp_path / "b.toml")
        assert registry.load(tmp_path / "b.toml").environment == one.environment


def test_a_scene_of_one_camera_is_saved_as_before(tmp_path: Path) -> None:
    scene_save.save(Scene(Camera(fov_y=33)), tmp_path / "a.toml")
    text = (tmp_path / "a.toml").read_text()
    assert "[camera]" in text and "cameras" not in text and "active" not in text and "shift" not in text


@pytest.mark.parametrize("rows", [SHEARED, [*SHEARED, [0, 0, 0, 1]]])
def test_an_object_may_stand_by_a_matrix(tmp_path: Path, rows: list[list[float]]) -> None:
    scene = load_text(tmp_path, VALID.replace("position = [0, 0.5, 0]", f"matrix = {rows}"))
    cube = scene.object("red cube")
    np.testing.assert_array_equal(cube.world_from_object, SHEARED)
    scene_save.save(scene, tmp_path / "b.toml")
    text = (tmp_path / "b.toml").read_text()
    assert "matrix" in text and "rotation" not in text.split("[[objects]]")[1]
    again = registry.load(tmp_path / "b.toml")
    assert_same(again, scene)
    assert not diff(scene, again).is_local and again.object("red cube").transform.matrix == tuple(
        map(tuple, SHEARED)
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]\nscale = [1, 2, 1]", "stands beside .*scale"),
        ("matrix = [[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0]]", "flattens the object"),
        ("matrix = [[1, 0, 0, 0], [0, inf, 0, 0], [0, 0, 1, 0]]", "inf is not a finite number"),
        ("matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]", "its last row is"),
        ('matrix = "upright"', "is not a list of rows"),
    ],
)
def test_a_bad_matrix_is_told_where_it_stands(tmp_path: Path, line: str, message: str) -> None:
    text = VALID.replace("position = [0, 0.5, 0]", line)
    with pytest.raises(InputError, match=rf'\[\[objects\]\] 1 \("red cube"\): matrix: .*{message}'):
        load_text(tmp_path, text)


def test_an_image_without_a_color_is_taken_as_it_is(tmp_path: Path) -> None:
    images.write_exr(tmp_path / "sky.exr", {"RGB": np.ones((2, 4, 3))})
    scene = load_text(tmp_path, VALID.replace("color = [1, 1, 1]", 'image = "sky.exr"'))
    assert scene.environment.color == (1, 1, 1) and scene.environment.image is not None


def test_objects_share_meshes_also_across_loads(tmp_path: Path) -> None:
    trimesh.creation.icosphere().export(tmp_path / "ball.ply")
    ball = '[[objects]]\nname = "{}"\nmesh = "ball.ply"\nmaterial = "red"\n'
    scene = load_text(tmp_path, VALID + ball.format("a") + ball.format("b"))
    assert scene.object("a").mesh is scene.object("b").mesh
    again = registry.load(tmp_path / "a.toml")
    assert diff(scene, again) == diff(scene, scene)


def two_boxes(path: Path) -> None:
    scene = trimesh.Scene()
    for name, x in (("left", -3), ("right", 3)):
        placed = trimesh.transformations.translation_matrix([x, 0, 0])
        scene.add_geometry(trimesh.creation.box(), node_name=name, transform=placed)
    scene.export(path)


def test_several_meshes_in_one_file(tmp_path: Path) -> None:
    two_boxes(tmp_path / "two.glb")
    boxes = '[[objects]]\nname = "boxes"\nmesh = "two.glb"\nmaterial = "red"\n'
    scene = load_text(tmp_path, VALID + boxes)
    assert [o.name for o in scene.objects] == ["red cube", "boxes/left", "boxes/right"]
    scene_save.save(scene, tmp_path / "b.toml")
    assert 'part = "left"' in (tmp_path / "b.toml").read_text()
    assert registry.load(tmp_path / "b.toml") == scene
    one = load_text(tmp_path, VALID + boxes + 'part = "right"\n')
    assert [o.name for o in one.objects] == ["red cube", "boxes"]
    assert one.object("boxes").mesh.bounds[0, 0] == 2.5
    with pytest.raises(InputError, match=r"\[\[objects\]\] 2 \(\"boxes\"\): part: 'rigth' .* mean 'right'"):
        load_text(tmp_path, VALID + boxes + 'part = "rigth"\n')
    with pytest.raises(InputError, match="has that name too"):
        load_text(tmp_path, VALID + boxes + boxes)


def test_a_mesh_file_makes_a_scene(tmp_path: Path) -> None:
    scene = registry.load(SCENES / "bunny.ply")
    assert [o.name for o in scene.objects] == ["bunny"]
    assert any(scene.environment.radiance)
    # The camera sees all of it: every corner of the bounds lies within the field of view.
    corners = affine.box_corners(scene.objects[0].world_bounds)
    camera = scene.camera
    pixels, in_front = camera.project(corners, 1.0)
    pixels = pixels * (100, 100)
    assert in_front.all() and (pixels > 0).all() and (pixels < 100).all()
    two_boxes(tmp_path / "two.glb")
    assert [o.name for o in registry.load(tmp_path / "two.glb").objects] == ["two/left", "two/right"]


def test_saving_keeps_files_relative(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "deep" / "er").mkdir(parents=True)
    trimesh.creation.box().export(tmp_path / "assets" / "box.ply")
    images.write_exr(tmp_path / "assets" / "sky.exr", {"RGB": np.ones((2, 4, 3))})
    text = VALID.replace('shape = "cube"', 'mesh = "assets/box.ply"')
    scene = load_text(tmp_path, text.replace("[1, 1, 1]", '[1, 1, 1]\nimage = "assets/sky.exr"'))
    saved = tmp_path / "deep" / "er" / "b.toml"
    scene_save.save(scene, saved)
    assert 'mesh = "../../assets/box.ply"' in saved.read_text()
    assert 'image = "../../assets/sky.exr"' in saved.read_text()
    assert os.listdir(saved.parent) == ["b.toml"]
    assert registry.load(saved) == scene


def test_render_holds_only_what_differs(tmp_path: Path) -> None:
    scene_save.save(load_text(tmp_path, VALID), tmp_path / "b.toml")
    assert "[render]" not in (tmp_path / "b.toml").read_text()
    scene_save.save(Scene(settings=RenderSettings(nor=64, slots_per_step=7)), tmp_path / "b.toml")
    assert "[render]\nnor = 64\nslots_per_step = 7\n" in (tmp_path / "b.toml").read_text()


def test_what_was_made_in_python_is_written_beside(tmp_path: Path) -> None:
    sphere = shape("sphere")
    bent = replace(sphere, vertices=sphere.vertices * 2)  # still says that it is the built-in sphere
    bare = Mesh(sphere.vertices, sphere.faces)
    trimesh.creation.box().export(tmp_path / "box.ply")
    box = mesh_files.load_mesh(tmp_path / "box.ply")
    gone = replace(box, source=MeshSource(file=str(tmp_path / "gone.ply")))
    edited = replace(box, vertices=box.vertices + 1)
    meshes = {"bent": bent, "bare one": bare, "edited": edited, "gone": gone, "same": box, "/": bare}
    pixels = np.random.default_rng(0).random((4, 8, 3), np.float32)
    scene = Scene(
        environment=Environment((1, 1, 1), Image(pixels)),
        materials={"m": Material()},
        objects=tuple(Object(name, mesh, "m") for name, mesh in meshes.items()),
    )
    scene_save.save(scene, tmp_path / "b.toml")
    assert_same(registry.load(tmp_path / "b.toml"), scene)
    stored = sorted(os.listdir(tmp_path))
    assert len([name for name in stored if name.endswith(".npz")]) == 4  # `bare` is stored once
    assert 'mesh = "box.ply"' in (tmp_path / "b.toml").read_text()
    scene_save.save(scene, tmp_path / "b.toml")
    assert sorted(os.listdir(tmp_path)) == stored


def test_a_failed_save_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bare = Mesh(shape("cube").vertices, shape("cube").faces)
    scene = Scene(materials={"m": Material()}, objects=(Object("a", bare, "m"),))
    path = tmp_path / "b.toml"
    path.write_text("old")
    replaced = os.replace

    def full(source: Any, target: Any) -> None:
        if str(target).endswith(".toml"):
            raise OSError(28, "No space left on device")
        replaced(source, target)

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match=r"b\.toml: cannot be written \(no space left on device\)"):
        scene_save.save(scene, path)
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["b.toml"]
    monkeypatch.undo()
    with pytest.raises(InputError, match="no valid text"):
        scene_save.save(Scene(materials={"\ud800": Material()}), path)
    with pytest.raises(OutputError, match="no such file or directory"):
        scene_save.save(Scene(), tmp_path / "none" / "b.toml")
    with pytest.raises(InputError, match=r"end its name with \.toml"):
        scene_save.save(scene, tmp_path / "b.json")
    assert os.listdir(tmp_path) == ["b.toml"]


def test_scenes_that_show_nothing_load_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(InputWarning) as caught:
        load_text(tmp_path, "version = 1")
    messages = [str(w.message) for w in caught]
    assert len(messages) == 2 and all(
        m.startswith(str(tmp_path / "a.toml: the scene has no ")) for m in messages
    )
    with pytest.warns(InputWarning, match="has no light"):
        load_text(tmp_path, VALID.replace("color = [1, 1, 1]", ""))
    load_text(tmp_path, VALID.replace("color = [1, 1, 1]", "").replace("0.1]", "0.1]\nemission = [1, 1, 1]"))


def test_describe_counts(tmp_path: Path) -> None:
    scene = load_text(
        tmp_path,
        VALID
        + "[materials.lamp]\nemission = [1, 1, 1]\n"
        + '[[objects]]\nname = "l"\nshape = "cube"\nmaterial = "lamp"\n',
    )
    lines = summary.describe(scene)
    assert "objects: 2" in lines and "materials: 2" in lines
    assert "meshes: 1 with 12 triangles; 24 triangles placed" in lines
    assert "lights: 0" in lines and "emissive objects: 1 with 12 triangles" in lines
    assert "bounds: (-0.5, -0.5, -0.5) to (0.5, 1, 0.5) metres" in lines
    assert "textures: none" in lines
    wood = Texture(Bitmap(np.zeros((512, 1024, 3), np.uint8)))
    with_textures = scene.with_material("red", base_color_texture=wood, emission_texture=wood)
    assert "textures: 1 image, 1.5 MiB on a device" in summary.describe(with_textures)
    unwrapped = with_textures.with_material("red", base_color_texture=replace(wood, uv_set=1))
    assert any("no texture coordinates" in line for line in summary.describe(unwrapped))
    assert not any("no texture coordinates" in line for line in summary.describe(with_textures))
    with_image = scene.with_environment(image=Image(np.ones((2, 4, 3), np.float32)))
    assert "environment: radiance (1, 1, 1) times made in Python, 4 x 2 pixels" in summary.describe(
        with_image
    )
    dark = summary.describe(Scene())
    assert "environment: none" in dark and sum(line.startswith("warning: ") for line in dark) == 2


OBJECT = '[[objects]]\nname = "b"\nmaterial = "red"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("version = 1\n[camera\n", "line 2, column 8: is no valid TOML"),
        ("version = 1\nversion = 1\n", "line 2, column 12: is no valid TOML"),
        ("x = " + "[" * 3000 + "]" * 3000, "is no valid TOML"),
        ("[camera]\n", "version: is missing; write `version = 2`"),
        ("version = 3\n", "version: 3 cannot be read; this program reads versions 1 and 2"),
        ("version = true\n", "version: True cannot be read"),
        ("version = '1'\n", "version: '1' cannot be read"),
        (VALID + "[enviroment]\n", "enviroment: is no known table or key; did you mean 'environment'"),
        (VALID + "[zzz]\n", "zzz: is no known table or key; known are version, camera"),
        ("version = 1\ncamera = 3\n", r"camera: is not a table; write \[camera\]"),
        ("version = 1\n[objects]\n", r"objects: is one table; write \[\[objects\]\]"),
        ("version = 1\nobjects = [3]\n", r"\[\[objects\]\] 1: is not a table"),
        ("version = 1\n[materials]\nred = 1\n", r"\[materials.red\]: is not a table"),
        ("version = 1\n[camera]\nfov = 4\n", r"\[camera\]: fov: is no known key; did you mean 'fov_y'\?"),
        ("version = 1\n[camera]\nfov_y = 0\n", r"\[camera\]: fov_y: 0 is out of range; use 0.01 to 179"),
        (
            "version = 1\n[camera]\nposition = [0, 0]\n",
            r"\[camera\]: position: \[0, 0\] is not a list of three",
        ),
        ("version = 1\n[camera]\nposition = [0, 0, '1']\n", r"\[camera\]: position: '1' is not a number"),
        ("version = 1\n[camera]\nposition = [0, true, 1]\n", r"\[camera\]: position: True is not a number"),
        ("version = 1\n[camera]\nposition = {x = 1, y = 2, z = 3}\n", "is not a list of three"),
        ("version = 1\n[camera]\nposition = 1979-05-27\n", "is not a list of three"),
        ("version = 1\n[camera]\nup = [0, 0, 0]\n", r"\[camera\]: up: has no length"),
        ("version = 1\n[camera]\nblades = 2\n", r"\[camera\]: blades: 2 make no aperture; use 3 or more"),
        ("version = 1\n[environment]\nsky = true\n", r"\[environment\]: sky: is not a table"),
        ("version = 1\n[environment.sky]\nelevation = 3\n", r"sky: elevation: is no known key"),
        ("version = 1\n[environment.sky]\nair = -3\n", r"\[environment\]: sky: air: -3 is out of range"),
        ("version = 1\ncameras = 3\n", r"cameras: is not a table"),
        ("version = 1\n[cameras]\ntop = 3\n", r"\[cameras.top\]: is not a table"),
        ("version = 1\n[cameras.top]\nfov = 3\n", r"\[cameras.top\]: fov: is no known key"),
        ("version = 1\n[camera]\n[cameras.camera]\n", r"\[cameras.camera\]: is the name of the table"),
        ("version = 1\nactive_camera = 'x'\n", r"active_camera: 'x' is not in \[cameras\]; it has camera"),
        ("version = 1\nactive_camera = 3\n", r"active_camera: 3 is not a text"),
        ("version = 1\n[environment]\ncolor = [-1, 0, 0]\n", r"\[environment\]: color: -1 is out of range"),
        ("version = 1\n[environment]\nintensity = nan\n", "intensity: nan is not a finite number"),
        (
            "version = 1\n[environment]\nimage = 'no.exr'\n",
            r"\[environment\]: image: .*no\.exr: no such file",
        ),
        ("version = 1\n[environment]\nimage = 'a.toml'\n", r"image: .*a\.toml: is no OpenEXR image"),
        ("version = 1\n[environment]\nimage = '.'\n", "image: .*: is a folder"),
        ("version = 1\n[environment]\nimage = 3\n", "image: 3 is not a text"),
        ('version = 1\n[environment]\nimage = "a\\u0000.exr"\n', "image: .*cannot be read"),
        ("version = 1\n[render]\nsize = [0, 10]\n", r"\[render\]: size \(width\): 0 is out of range"),
        ("version = 1\n[render]\nsize = [100000, 100000]\n", r"\[render\]: size"),
        ("version = 1\n[render]\nsize = 10\n", r"\[render\]: size: 10 is not a pair"),
        ("version = 1\n[render]\nnor = 1.5\n", r"\[render\]: nor: 1.5 is not a whole number"),
        ("version = 1\n[render]\nstrategy = 'best'\n", r"\[render\]: strategy: 'best' is not known"),
        ("version = 1\n[render]\nstrategy = ['best']\n", r"\[render\]: strategy: .* is not known"),
        (
            "version = 1\n[render]\nseed = 99999999999999999999999\n",
            "seed: a whole number of more than 64 bits",
        ),
        ("version = 1\n[render]\nseed = 0x" + "f" * 9000, "seed: a whole number of more than 64 bits"),
        ("version = 1\n[camera]\nfov_y = 1" + "0" * 5000, "is no valid TOML"),
        (VALID.replace("0.8,", "1.8,"), r"\[materials.red\]: base_color: 1.8 is out of range; use 0 to 1"),
        (VALID.replace("0.8,", "inf,"), r"\[materials.red\]: base_color: inf is not a finite number"),
        (VALID.replace("base_color", "basecolor"), "basecolor: is no known key; did you mean 'base_color'"),
        (VALID.replace(".red]", '."a b"]'), "'red' is not in .materials.; add"),
        (VALID.replace(".red]", ".redd]"), "material: 'red' is not in .materials.; did you mean 'redd'"),
        (VALID.replace('material = "red"', ""), r'1 \("red cube"\): material: is missing; name one of'),
        (VALID.replace('material = "red"', 'material = ["red"]'), "material: .* is not a text"),
        (
            VALID.replace("0.5", "nan"),
            r'\[\[objects\]\] 1 \("red cube"\): position: nan is not a finite number',
        ),
        (VALID.replace("0.5", "1e300"), r'\("red cube"\): position: 1e\+300 is out of range'),
        (VALID + "scale = [1, 0, 1]\n", r'\("red cube"\): scale: .* flattens the object'),
        (VALID + "visible = 1\n", r'\("red cube"\): visible: 1 is not true or false'),
        (VALID + "rotate = [1, 0, 1]\n", "rotate: is no known key; did you mean 'rotation'"),
        (VALID.replace('name = "red cube"', ""), r"\[\[objects\]\] 1: name: is missing"),
        (VALID.replace('"red cube"', '""'), r"\[\[objects\]\] 1: name: '' is not a text"),
        (VALID.replace('"red cube"', "3"), r"\[\[objects\]\] 1: name: 3 is not a text"),
        (VALID + OBJECT, r'\[\[objects\]\] 2 \("b"\): has neither `shape` nor `mesh`'),
        (VALID + OBJECT + "shape = 'cube'\nmesh = 'b.ply'\n", "has both `shape` and `mesh`"),
        (VALID + OBJECT + "shape = 'cub'\n", "shape 'cub' is not known; choose one of cube, sphere"),
        (VALID + OBJECT + "shape = ['cube']\n", "shape: .* is not a text"),
        (VALID + OBJECT + "shape = 'cube'\npart = 'x'\n", "part: belongs to a mesh file"),
        (VALID + OBJECT + "mesh = 'no.ply'\n", r'2 \("b"\): mesh: .*no\.ply: no such file'),
        (VALID + OBJECT + "mesh = 'a.toml'\n", r"mesh: .*a\.toml: is no mesh file; \.glb"),
        (
            VALID + OBJECT.replace('"b"', '"red cube"') + "shape = 'cube'\n",
            r"name: \[\[objects\]\] 1 has that name",
        ),
    ],
)
def test_bad_scenes_are_one_line_that_names_the_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_text(tmp_path, text)
    line = str(caught.value)
    assert line.startswith(str(tmp_path / "a.toml") + ": " if text else str(tmp_path / "a.toml"))
    assert len(line.splitlines()) == 1 and len(line) < 1000


def test_files_that_are_no_scene(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        registry.load(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a folder"):
        registry.load(tmp_path)
    (tmp_path / "a.docx").write_text("hello")
    with pytest.raises(
        InputError, match=r"use a scene \(\.toml, \.xml, \.pbrt\) or a mesh \(\.glb, .*\.ply, \.stl"
    ):
        registry.load(tmp_path / "a.docx")
    (tmp_path / "a.toml").write_bytes(b"version = 1\n\xff\xfe")
    with pytest.raises(InputError, match="line 2: is not UTF-8"):
        registry.load(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbf" + VALID.encode())
    assert len(registry.load(tmp_path / "a.toml").objects) == 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(InputError, match="is not a regular file"):
        registry.load(tmp_path / "a.toml")


numbers = st.floats(-LARGEST, LARGEST)
vectors = st.tuples(numbers, numbers, numbers)
fractions = st.floats(0, 1)
radiances = st.tuples(*[st.floats(0, LARGEST)] * 3)
names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)
BITMAPS = [
    Bitmap(np.arange(24 * channels, dtype=dtype).reshape(4, 6, channels) * 7)
    for dtype, channels in ((np.uint8, 3), (np.uint16, 4), (np.float32, 3), (np.uint8, 1), (np.uint16, 2))
]
textures_strategy = st.builds(
    Texture,
    st.sampled_from(BITMAPS),
    uv_set=st.integers(0, 1),
    wrap=st.tuples(st.sampled_from(WRAPS), st.sampled_from(WRAPS)),
    filter=st.sampled_from(FILTERS),
    offset=st.tuples(numbers, numbers),
    rotation=numbers,
    scale=st.tuples(numbers, numbers),
)
MATERIAL_VALUES: dict[str, st.SearchStrategy[Any]] = {
    "base_color": st.tuples(fractions, fractions, fractions),
    "metallic": fractions,
    "roughness": fractions,
    "specular": fractions,
    "ior": st.floats(1, 100),
    "transmission": fractions,
    "absorption": radiances,
    "priority": st.integers(0, 1000),
    "emission": radiances,
    "double_sided": st.booleans(),
    "alpha": fractions,
    "alpha_mode": st.sampled_from(ALPHA_MODES),
    "alpha_cutoff": fractions,
    "normal_scale": st.floats(0, 100),
    "specular_color": radiances,
    "clearcoat": fractions,
    "clearcoat_roughness": fractions,
    "clearcoat_normal_scale": st.floats(-100, 100),
    "bump_scale": st.floats(-1000, 1000),
    "sheen_color": st.tuples(fractions, fractions, fractions),
    "sheen_roughness": fractions,
    "anisotropy": fractions,
    "anisotropy_rotation": numbers,
    "iridescence": fractions,
    "iridescence_ior": st.floats(1, 100),
    "iridescence_thickness": st.floats(0, 1e5),
    "iridescence_least_thickness": st.floats(0, 1e5),
    "diffuse_transmission": fractions,
    "diffuse_transmission_color": st.tuples(fractions, fractions, fractions),
    "thin_walled": st.booleans(),
    "dispersion": st.floats(0, 100),
    "unlit": st.booleans(),
    **dict.fromkeys(TEXTURES, st.one_of(st.none(), textures_strategy)),
}
materials_strategy = st.builds(Material, **MATERIAL_VALUES)


def test_files_are_tried_with_every_parameter_of_materials() -> None:
    assert set(MATERIAL_VALUES) == {field.name for field in fields(Material)}


skies = st.none() | st.builds(
    Sky, st.floats(-90, 90), st.booleans(), st.floats(0.1, 30), st.floats(0, 10), st.floats(0, 5e4),
    st.floats(0, 10), st.floats(0, 10), st.floats(0, 10), fractions,
)  # fmt: skip


@st.composite
def lenses(draw: st.DrawFn, position: Any) -> Camera:
    """A camera with any of its fields."""
    target = tuple(p + 1e3 if p < 0 else p - 1e3 for p in position)
    ranges = {
        "fov_y": (1, 179), "ortho_height": (1e-3, 1e6), "focal_length": (0, 500), "sensor_width": (1, 100),
        "sensor_height": (1, 100), "shift_x": (-2, 2), "shift_y": (-2, 2), "f_stop": (0, 64),
        "focus_distance": (0, 1e6), "blade_rotation": (-360, 360), "near": (0, 1e3),
    }  # fmt: skip
    values: dict[str, Any] = {
        name: draw(st.floats(*draw(st.sampled_from([(low, low), (low, high)]))))
        for name, (low, high) in ranges.items()
    }
    values["projection"] = draw(st.sampled_from(["perspective", "orthographic"]))
    values["sensor_fit"] = draw(st.sampled_from(["auto", "horizontal", "vertical"]))
    values["blades"] = draw(st.sampled_from([0, 3, 7]))
    assert set(values) | {"position", "target", "up"} == {field.name for field in fields(Camera)}
    return Camera(position, target, **values)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    materials = draw(st.dictionaries(names, materials_strategy, min_size=1, max_size=3))
    side = st.one_of(st.floats(1e-6, LARGEST), st.floats(-LARGEST, -1e-6))
    shear = st.floats(-2, 2)
    placements = st.one_of(
        st.builds(Transform, vectors, vectors, st.tuples(side, side, side)),
        st.builds(
            lambda x, y, z, a, b, c: Transform.from_matrix([[1, a, b, x], [0, 1, c, y], [0, 0, -1, z]]),
            *[numbers] * 3,
            *[shear] * 3,
        ),
    )
    objects = [
        Object(
            name,
            shape(draw(st.sampled_from(["cube", "plane"]))),
            draw(st.sampled_from(sorted(materials))),
            transform=draw(placements),
            visible=draw(st.booleans()),
        )
        for name in draw(st.lists(names, unique=True, max_size=3))
    ]
    position = draw(vectors)
    settings = RenderSettings(
        size=(draw(st.integers(1, 4000)), draw(st.integers(1, 4000))),
        seed=draw(st.integers(0, 2**32 - 1)),
        nor=draw(st.integers(1, 1024)),
        slots_per_step=draw(st.none() | st.integers(1, 1000)),
        strategy=draw(st.sampled_from(["restart", "spiral"])),
    )
    return Scene(
        draw(lenses(position)),
        Environment(draw(radiances), None, draw(numbers), draw(st.floats(0, LARGEST)), draw(skies)),
        materials,
        tuple(objects),
        settings,
        camera_name=draw(names),
        cameras={name: draw(lenses(position)) for name in draw(st.lists(names, max_size=2))},
    )


@pytest.mark.slow
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scene=scenes())
def test_any_scene_survives_a_file(tmp_path: Path, scene: Scene) -> None:
    scene_save.save(scene, tmp_path / "random.toml")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        again = registry.load(tmp_path / "random.toml")
    assert untextured(again) == untextured(scene)
    assert list(again.materials) == list(scene.materials)
    for name, material in scene.materials.items():
        for slot in TEXTURES:
            assert_same_texture(getattr(again.materials[name], slot), getattr(material, slot))


def untextured(scene: Scene) -> Scene:
    none = dict.fromkeys(TEXTURES)
    return replace(scene, materials={name: replace(m, **none) for name, m in scene.materials.items()})


def assert_same_texture(a: Texture | None, b: Texture | None) -> None:
    assert (a is None) == (b is None)
    if a is not None and b is not None:
        assert replace(a, bitmap=b.bitmap) == b
        assert a.bitmap.pixels.dtype == b.bitmap.pixels.dtype
        np.testing.assert_array_equal(a.bitmap.pixels, b.bitmap.pixels)


FULL = VALID + 'rotation = [0, 30, 0]\n[render]\nsize = [64, 32]\nstrategy = "spiral"\nseed = 3\n'
WORDS = [*b"0123456789.,[]{}\"'=\n#-+_enaif\\\0 \xff\xc3", *b"truefalsnd"]


@pytest.mark.slow
@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    edits=st.lists(
        st.tuples(st.integers(0, len(FULL)), st.integers(0, 6), st.lists(st.sampled_from(WORDS), max_size=5)),
        min_size=1,
        max_size=4,
    )
)
def test_mutated_scene_files_raise_input_errors_or_load(
    tmp_path: Path, edits: list[tuple[int, int, list[int]]]
) -> None:
    content = FULL.encode()
    for start, length, new in edits:
        content = content[:start] + bytes(new) + content[start + length :]
    check_loads_or_explains(tmp_path / "mutated.toml", content)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
def test_garbage_raises_input_errors(tmp_path: Path, content: bytes) -> None:
    check_loads_or_explains(tmp_path / "garbage.toml", content)
    check_loads_or_explains(tmp_path / "garbage.toml", b"version = 1\n" + content)


VALUES = [
    *["nan", "-inf", "1e400", "-1", "0", "[]", "[[]]", "{}", '""', "true", "'x'", "99999999999999999999"],
    *["[1, 2, 3]", "[nan, 1, 2]", "['a', 1, 2]", "12:00:00", "[{}, 1, 2]", "[0, 0, 0]"],
]


@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(line=st.integers(0, len(FULL.splitlines()) - 1), value=st.sampled_from(VALUES))
def test_wrong_values_raise_input_errors_or_load(tmp_path: Path, line: int, value: str) -> None:
    lines = FULL.splitlines()
    key, equals, _ = lines[line].partition("=")
    lines[line] = f"{key} = {value}" if equals else lines[line] + value
    check_loads_or_explains(tmp_path / "wrong.toml", "\n".join(lines).encode())


def check_loads_or_explains(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    message = str(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        try:
            assert isinstance(registry.load(path), Scene)
        except InputError as error:
            message = str(error)
    assert message.startswith(str(path)) and len(message.splitlines()) == 1
