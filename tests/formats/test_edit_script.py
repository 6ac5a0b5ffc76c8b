"""Edit scripts: what they say is what happens, and what is wrong in them is told with its place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from incpt.core.errors import InputError
from incpt.formats import images, mesh_files
from incpt.formats.edit_script import DEFAULT_CAPTURE, EditScript, load_edits
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.sky import Sky

SCENE = Scene(
    environment=Environment((1, 1, 1)),
    materials={"red": Material((0.8, 0.1, 0.1)), "grey": Material()},
    objects=(Object("red cube", shape("cube"), "red"), Object("ball", shape("sphere"), "grey")),
)


def load_text(folder: Path, text: str) -> EditScript:
    path = folder / "edits.toml"
    path.write_text(text)
    return load_edits(path, SCENE)


def test_every_kind_of_edit(tmp_path: Path) -> None:
    images.write_exr(tmp_path / "sky.exr", {"RGB": np.ones((2, 4, 3))})
    trimesh.creation.box().export(tmp_path / "box.ply")
    script = load_text(
        tmp_path,
        """
        capture = [10, 0, 2]
        [[edits]]
        name = "turn"
        object = "red cube"
        rotation = [0, 30, 35]
        pixel = [3, -4]
        [[edits]]
        step = 5
        object = "red cube"
        material = "grey"
        capture = [7]
        [[edits]]
        step = 5
        material = "red"
        roughness = 0.25
        [[edits]]
        step = 9
        camera = true
        position = [1, 2, 3]
        [[edits]]
        step = 9
        environment = true
        image = "sky.exr"
        [[edits]]
        step = 9
        object = "ball"
        mesh = "box.ply"
        """,
    )
    assert [e.step for e in script] == [0, 5, 5, 9, 9, 9]
    assert [e.label for e in script] == ["turn", "red cube", "red", "camera", "environment", "ball"]
    assert [e.capture for e in script][:3] == [(0, 2, 10), (7,), (0, 2, 10)]
    assert script[0].pixel == (3, -4) and script[1].pixel is None
    scenes = script.scenes(SCENE)
    assert scenes[0] == SCENE.with_object("red cube", rotation=(0, 30, 35))
    assert scenes[1].object("red cube").material == "grey"
    assert scenes[1].object("red cube").rotation == (0, 30, 35)
    assert diff(scenes[1], scenes[2]).materials == {"red"}
    assert scenes[3].camera.position == (1, 2, 3)
    assert scenes[4].environment.image is not None
    assert len(scenes[5].object("ball").mesh.faces) == 12 and len(script) == 6


def test_edits_of_the_base_scene(tmp_path: Path) -> None:
    edits = (
        "[[edits]]\nobject = 'ball'\nposition = [1, 0, 0]\n[[edits]]\nobject = 'ball'\nscale = [2, 2, 2]\n"
    )
    script = load_text(tmp_path, "cumulative = false\n" + edits)
    assert script.scenes(SCENE)[1] == SCENE.with_object("ball", scale=(2, 2, 2))
    assert script[0].capture == DEFAULT_CAPTURE
    both = load_text(tmp_path, edits).scenes(SCENE)[1].object("ball")
    assert both.position == (1, 0, 0) and both.scale == (2, 2, 2)


def test_an_edit_may_give_a_matrix(tmp_path: Path) -> None:
    rows = [[1, 0.5, 0, 1], [0, 2, 0, 2], [0, 0, 1, 3]]
    script = load_text(tmp_path, BALL + f"matrix = {rows}\n" + BALL + "position = [7, 8, 9]\n")
    first, second = (scene.object("ball").world_from_object for scene in script.scenes(SCENE))
    np.testing.assert_array_equal(first, rows)
    np.testing.assert_array_equal(second, np.column_stack([np.array(rows)[:, :3], [7, 8, 9]]))


BALL = "[[edits]]\nobject = 'ball'\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("capture = [0]\n", r"edits: there are none; add an \[\[edits\]\] table"),
        ("[edits]\nstep = 0\n", "edits: there are none"),
        ("edits = [1]\n", r"\[\[edits\]\] 1: is not a table"),
        ("captures = [0]\n" + BALL, "captures: is no known table or key; did you mean 'capture'"),
        ("capture = 3\n" + BALL, "capture: 3 is not a list"),
        ("capture = [-1]\n" + BALL, "capture: -1 is not a step"),
        ("cumulative = 1\n" + BALL, "cumulative: 1 is not true or false"),
        ("[[edits]]\nstep = 0\n", r"\[\[edits\]\] 1: has no target; give one of object, material"),
        ("[[edits]]\nmaterial = 'red'\ncamera = true\n", "has material and camera; give one of"),
        ("[[edits]]\ncamera = 'front'\nfov_y = 3\n", "camera 'front' is not in the scene; it has camera"),
        ("[[edits]]\ncamera = 3\nfov_y = 3\n", "camera: 3 is not true; write camera = true"),
        ("[[edits]]\ncamera = true\nactive = false\n", "active: False is not true; leave it out"),
        (BALL, r"\[\[edits\]\] 1: changes nothing; give new values, such as position"),
        (
            BALL + "positoin = [0, 0, 0]\n",
            "positoin: is no known key of an edit of an object; did you mean 'pos",
        ),
        (BALL + "position = [0, nan, 0]\n", r"\[\[edits\]\] 1: position: nan is not a finite number"),
        (BALL + "name = 'grow'\nscale = [0, 0, 0]\n", r'\[\[edits\]\] 1 \("grow"\): scale: .* flattens'),
        (BALL + "name = 3\nscale = [1, 1, 1]\n", "name: 3 is not a text"),
        (BALL + "step = 1.5\nscale = [1, 1, 1]\n", "step: 1.5 is not a step; use a whole number from 0"),
        (BALL + "pixel = [1]\nscale = [1, 1, 1]\n", r"pixel: \[1\] is not a pair"),
        (
            BALL + "material = 'blue'\n",
            "object 'ball': material 'blue' is not in the scene; it has grey, red",
        ),
        (BALL + "material = ['red']\n", "material: .* is not a text"),
        (BALL + "mesh = 'no.ply'\n", r"mesh: .*no\.ply: no such file"),
        (BALL + "shape = 'cub'\n", "shape 'cub' is not known"),
        (BALL + "part = 'x'\n", "has neither `shape` nor `mesh`"),
        (
            "[[edits]]\nobject = 'bal'\nscale = [1, 1, 1]\n",
            "object 'bal' is not in the scene; it has ball, red cube",
        ),
        (
            "[[edits]]\nmaterial = 'blue'\nroughness = 1\n",
            "material 'blue' is not in the scene; it has grey, red",
        ),
        ("[[edits]]\nmaterial = 'red'\nroughness = 2\n", "roughness: 2 is out of range"),
        ("[[edits]]\nenvironment = true\nimage = 'no.exr'\n", r"image: .*no\.exr: no such file"),
        (BALL + "step = 4\nscale = [1, 1, 1]\n" + BALL + "scale = [2, 1, 1]\n", r"2: step: 0 comes before"),
    ],
)
def test_bad_scripts_are_one_line_that_names_the_edit(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_text(tmp_path, text)
    line = str(caught.value)
    assert line.startswith(f"{tmp_path / 'edits.toml'}: ") and len(line.splitlines()) == 1


def test_several_meshes_need_a_part(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for name in ("a", "b"):
        scene.add_geometry(trimesh.creation.box(), node_name=name)
    scene.export(tmp_path / "two.glb")
    with pytest.raises(InputError, match="holds 2 meshes; choose one with `part`"):
        load_text(tmp_path, BALL + "mesh = 'two.glb'\n")
    script = load_text(tmp_path, BALL + "mesh = 'two.glb'\npart = 'b'\n")
    assert script.scenes(SCENE)[0].object("ball").mesh is mesh_files.load_mesh(tmp_path / "two.glb", "b")


def test_edits_of_cameras_by_name(tmp_path: Path) -> None:
    scene = SCENE.with_camera("top", position=(0, 9, 0.1))
    path = tmp_path / "edits.toml"
    path.write_text("""
        [[edits]]
        camera = "top"
        fov_y = 20
        [[edits]]
        camera = "top"
        active = true
        f_stop = 0.5
        [[edits]]
        camera = true
        near = 0.1
        """)  # fmt: skip
    first, second, third = load_edits(path, scene).scenes(scene)
    assert first.camera == scene.camera and first.cameras["top"].fov_y == 20
    assert second.camera_name == "top" and second.camera == replace(first.cameras["top"], f_stop=0.5)
    assert third.camera == replace(second.camera, near=0.1) and third.cameras["camera"] == scene.camera


def test_an_edit_of_the_sky(tmp_path: Path) -> None:
    script = load_text(tmp_path, "[[edits]]\nenvironment = true\nsky = {sun_elevation = 5, dust = 2}\n")
    (scene,) = script.scenes(SCENE)
    assert scene.environment == replace(SCENE.environment, sky=Sky(5, dust=2))
    with pytest.raises(InputError, match="sky: sun: is no known key"):
        load_text(tmp_path, "[[edits]]\nenvironment = true\nsky = {sun = 5}\n")
