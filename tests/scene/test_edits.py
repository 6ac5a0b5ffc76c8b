"""Edits of objects and materials, from scene to scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.formats import insert
from incpt.formats.images import write_exr
from incpt.formats.registry import FileKind
from incpt.scene import edits
from incpt.scene.camera import Camera
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import SHAPES, shape

SCENE = Scene(
    camera=Camera(target=(1.0, 0.4, -2.0)),
    materials={"red": Material((0.8, 0.1, 0.1)), "blue": Material((0.1, 0.1, 0.8)), "grey": Material()},
    objects=(
        Object("cube", shape("cube"), "red", (0, 0.5, 0), (10, 20, 30), (1, 2, 3)),
        Object("ball", shape("sphere"), "red", (2, 0.5, 0), visible=False),
        Object("floor", shape("plane"), "blue"),
    ),
)
TWO_TRIANGLES = "".join(
    f"o {name}\nv 0 {y} 0\nv 1 {y} 0\nv 0 {y + 1} 0\nf {i} {i + 1} {i + 2}\n"
    for name, y, i in (("a", 3, 1), ("b", 5, 4))
)


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_stands_on_the_floor_below_the_target(name: str) -> None:
    scene, names = edits.add_shape(SCENE, name)
    assert diff(SCENE, scene).added == set(names) and len(names) == 1
    low, high = scene.object(names[0]).world_bounds
    assert low[1] == pytest.approx(0) and (low + high)[[0, 2]] / 2 == pytest.approx([1, -2])
    assert scene.object(names[0]).material == "grey"


def test_a_shape_stands_where_it_is_told_and_is_made_of_that() -> None:
    scene, (name,) = edits.add_shape(SCENE, "cube", at=(5, 6, 7), material="blue")
    new = scene.object(name)
    assert name == "cube.001" and new.position == (5, 6.5, 7) and new.material == "blue"


def test_a_floor_below_zero_is_found_at_the_target() -> None:
    assert edits.floor_point(SCENE.with_camera(target=(1, -3, 2))) == (1, -3, 2)


def test_a_first_shape_brings_a_material() -> None:
    scene, (name,) = edits.add_shape(Scene(), "sphere")
    assert scene.object(name).material in scene.materials


@pytest.mark.parametrize(("name", "material"), [("cone", None), ("cube", "gold")])
def test_shapes_and_materials_that_are_not_there_are_refused(name: str, material: str | None) -> None:
    with pytest.raises(InputError, match=r"cone|gold"):
        edits.add_shape(SCENE, name, material=material)


def test_the_parts_of_a_mesh_file_keep_their_arrangement(tmp_path: Path) -> None:
    path = tmp_path / "pair.obj"
    path.write_text(TWO_TRIANGLES)
    scene, names = insert.add_mesh(SCENE, path)
    first, second = (scene.object(name).world_bounds for name in sorted(names))
    assert sorted(names) == ["pair/a", "pair/b"]
    assert second[0] - first[0] == pytest.approx([0, 2, 0])
    assert first[0] == pytest.approx([0.5, 0, -2]) and first[1][0] == pytest.approx(1.5)
    again, more = insert.add_mesh(scene, path)
    assert not set(more) & set(names) and len(again.objects) == 7


def test_materials_of_a_file_come_along_without_replacing_others(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(GLTF)
    scene, (name,) = insert.add_mesh(SCENE, tmp_path / "a.gltf")
    assert scene.object(name).material == "red.001"
    assert (
        scene.materials["red.001"].base_color == (0, 1, 0)
        and scene.materials["red"] == SCENE.materials["red"]
    )
    scene, (name,) = insert.add_mesh(scene.without_object(name), tmp_path / "a.gltf")
    assert scene.object(name).material in scene.materials


GLTF = (
    '{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],'
    ' "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],'
    ' "materials": [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [0, 1, 0, 1]}}],'
    ' "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,'
    'AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],'
    ' "bufferViews": [{"buffer": 0, "byteLength": 36}],'
    ' "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",'
    ' "min": [0, 0, 0], "max": [1, 1, 0]}]}'
)


def test_dropped_files_are_told_apart_by_their_suffix(tmp_path: Path) -> None:
    kinds = {"a.TOML": FileKind.SCENE, "b.exr": FileKind.IMAGE, "c.PLY": FileKind.MESH}
    assert {name: insert.file_kind(name) for name in kinds} == kinds
    with pytest.raises(InputError, match="cannot be used"):
        insert.drop_file(SCENE, tmp_path / "a.docx")
    with pytest.raises(InputError, match="open it"):
        insert.drop_file(SCENE, tmp_path / "a.toml")
    with pytest.raises(InputError, match="no such file"):
        insert.drop_file(SCENE, tmp_path / "a.ply")


def test_a_dropped_image_becomes_the_environment(tmp_path: Path) -> None:
    path = tmp_path / "sky.exr"
    write_exr(path, {"RGB": np.full((2, 4, 3), 2.0, np.float32)})
    dark = replace(SCENE, environment=Environment((0, 0, 0), rotation_y=30))
    scene, names = insert.drop_file(dark, path)
    assert names == () and diff(dark, scene).environment_image
    assert scene.environment.radiance == (1, 1, 1) and scene.environment.rotation_y == 30
    tinted = scene.with_environment(color=(1, 0.5, 0.2), intensity=3)
    assert insert.drop_file(tinted, path)[0].environment == tinted.environment


def test_duplicates_share_mesh_and_material() -> None:
    scene, names = edits.duplicate(SCENE, ("cube", "floor"))
    assert names == ("cube.001", "floor.001") and diff(SCENE, scene).added == set(names)
    assert replace(scene.object("cube.001"), name="cube") == SCENE.object("cube")
    assert edits.duplicate(scene, ("cube.001",))[1] == ("cube.002",)


def test_delete_and_hide() -> None:
    assert [o.name for o in edits.delete(SCENE, ("cube", "floor")).objects] == ["ball"]
    hidden = edits.set_visible(SCENE, ("cube", "ball"), False)
    assert diff(SCENE, hidden).moved == {"cube"}
    assert edits.set_visible(hidden, ("cube",), True) == SCENE
    assert edits.set_visible(SCENE, ("ball",), False) is SCENE


def test_renaming_keeps_the_place_and_refuses_names_in_use() -> None:
    scene = edits.rename(SCENE, "cube", " red  cube ")
    assert [o.name for o in scene.objects] == ["red cube", "ball", "floor"]
    assert edits.rename(SCENE, "cube", "cube") is SCENE
    for name in ("ball", "", "  \n"):
        with pytest.raises(InputError, match=r"taken|empty"):
            edits.rename(SCENE, "cube", name)


def test_materials_are_assigned_by_name() -> None:
    assert diff(SCENE, edits.assign_material(SCENE, ("cube", "floor"), "blue")).reassigned == {"cube"}
    with pytest.raises(InputError, match="gold"):
        edits.assign_material(SCENE, (), "gold")


def test_materials_come_and_go() -> None:
    scene, name = edits.add_material(SCENE)
    assert name == "material" and edits.delete_material(scene, name) == SCENE
    scene, name = edits.duplicate_material(SCENE, "red")
    assert name == "red.001" and scene.materials[name] == SCENE.materials["red"]
    with pytest.raises(InputError, match="used by cube, ball"):
        edits.delete_material(SCENE, "red")
    with pytest.raises(InputError, match="cannot take its own place"):
        edits.delete_material(SCENE, "red", "red")
    assert edits.purge_materials(scene).materials.keys() == {"red", "blue"}
    assert edits.material_users(SCENE) == {"red": 2, "blue": 1}


def test_a_material_is_deleted_and_another_takes_its_place() -> None:
    scene = edits.delete_material(SCENE, "red", "grey")
    assert "red" not in scene.materials and [o.material for o in scene.objects] == ["grey", "grey", "blue"]
    assert edits.delete_material(SCENE, "grey", "red") == edits.delete_material(SCENE, "grey")


def test_renaming_a_material_keeps_its_place_and_users() -> None:
    scene = edits.rename_material(SCENE, "red", "rose")
    assert list(scene.materials) == ["rose", "blue", "grey"]
    assert [o.material for o in scene.objects] == ["rose", "rose", "blue"]
    assert edits.rename_material(scene, "rose", "red") == SCENE
    for name in ("blue", " "):
        with pytest.raises(InputError, match=r"taken|empty"):
            edits.rename_material(SCENE, "red", name)


def test_bounds_of_what_is_named_or_of_all_that_is_shown() -> None:
    assert np.array_equal(edits.bounds_of(SCENE, ("ball",)), SCENE.object("ball").world_bounds)  # type: ignore[arg-type]
    shown = edits.bounds_of(SCENE)
    assert shown is not None and shown[1][0] < 2
    assert edits.bounds_of(Scene()) is None


def matrix_of(
    position: tuple[float, float, float] = (0, 0, 0),
    rotation: tuple[float, float, float] = (0, 0, 0),
    scale: tuple[float, float, float] = (1, 1, 1),
) -> npt.NDArray[np.float64]:
    return np.vstack([affine.compose(position, rotation, scale), [0, 0, 0, 1]])


vectors = st.tuples(*[st.floats(-5, 5)] * 3)
degrees = st.tuples(*[st.floats(-180, 180)] * 3)


@settings(max_examples=60, deadline=None)
@given(vectors, degrees, st.floats(0.1, 5), vectors)
def test_a_group_keeps_its_shape(
    move: tuple[float, float, float],
    turn: tuple[float, float, float],
    size: float,
    pivot: tuple[float, float, float],
) -> None:
    """Under moves, turns and even scaling every corner goes where the matrix says."""
    delta = matrix_of(move, turn, (size, size, size))
    about = matrix_of(pivot) @ delta @ matrix_of(tuple(-p for p in pivot))  # type: ignore[arg-type]
    scene = edits.transform_objects(SCENE, ("cube", "ball"), delta, pivot)
    assert diff(SCENE, scene).moved <= {"cube", "ball"}
    for name in ("cube", "ball"):
        old, new = SCENE.object(name), scene.object(name)
        corners = affine.box_corners(old.mesh.bounds)
        expected = affine.apply(about[:3], affine.apply(old.world_from_object, corners))
        found = affine.apply(new.world_from_object, corners)
        np.testing.assert_allclose(found, expected, atol=1e-3)
        assert new.scale == pytest.approx([s * size for s in old.scale], rel=1e-4)


def test_moving_keeps_angles_and_scale_to_the_bit() -> None:
    moved = edits.transform_objects(SCENE, ("cube",), matrix_of((1, 2, 3))).object("cube")
    assert moved == replace(SCENE.object("cube"), position=(1, 2.5, 3))


def test_turning_keeps_the_scale_and_scaling_the_angles_to_the_bit() -> None:
    noise = 1 + np.float32(1e-7)
    turned = edits.transform_objects(SCENE, ("cube",), matrix_of(rotation=(0, 40, 0)) * noise).object("cube")
    assert turned.scale == (1, 2, 3) and turned.rotation != (10, 20, 30)
    scaled = edits.transform_objects(SCENE, ("cube",), matrix_of(scale=(2, 2, 2))).object("cube")
    assert scaled.rotation == (10, 20, 30) and scaled.scale == pytest.approx((2, 4, 6))


def test_numbers_stay_within_what_a_scene_allows() -> None:
    tiny = edits.transform_objects(SCENE, ("cube",), matrix_of(scale=(1e-12, 1e-12, 1e-12))).object("cube")
    assert min(tiny.scale) == 1e-6
    flat = edits.transform_objects(SCENE, ("cube",), matrix_of(scale=(1, 0, 1))).object("cube")
    assert flat == SCENE.object("cube")
    far = edits.transform_objects(SCENE, ("cube",), matrix_of((1e12, 0, 0))).object("cube")
    assert far.position == (1e9, 0.5, 0)


@given(st.lists(st.sampled_from(["a", "a.001", "a.002", "b", "1.001"]), unique=True))
def test_unique_names_are_unique(taken: list[str]) -> None:
    for name in ("a", "a.001", "1.001", ".001"):
        new = edits.unique_name(name, taken)
        assert new not in taken and (new == name) == (name not in taken)


def test_cameras_are_added_and_renamed() -> None:
    view = replace(SCENE.camera, fov_y=20)
    scene, name = edits.add_camera(SCENE, view)
    assert name == "camera.001" == scene.camera_name and scene.camera == view
    assert dict(scene.cameras) == {"camera": SCENE.camera, "camera.001": view}
    renamed = edits.rename_camera(scene, "camera.001", "close")
    assert renamed.camera_name == "close" and list(renamed.cameras) == ["camera", "close"]
    assert list(edits.rename_camera(renamed, "camera", "far").cameras) == ["far", "close"]
    assert edits.rename_camera(renamed, "close", "close") == renamed
    for new in ("camera", ""):
        with pytest.raises(InputError):
            edits.rename_camera(renamed, "close", new)


def test_what_is_copied_comes_with_its_materials() -> None:
    copied = edits.copied(SCENE, ("cube", "floor"))
    assert copied and set(copied.materials) == {"red", "blue"} and not edits.copied(SCENE, ())
    scene, names = edits.paste(SCENE, copied)
    assert names == ("cube.001", "floor.001") and scene.materials == SCENE.materials
    assert replace(scene.object("cube.001"), name="cube") == SCENE.object("cube")
    other = Scene(materials={"red": Material(metallic=1.0)})
    scene, names = edits.paste(other, copied)
    assert names == ("cube", "floor") and list(scene.materials) == ["red", "red.001", "blue"]
    assert scene.object("cube").material == "red.001" and scene.object("floor").material == "blue"
    with pytest.raises(InputError, match="nothing"):
        edits.copied(SCENE, ("nothing",))
