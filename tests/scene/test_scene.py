"""The scene, the difference between two, the built-in shapes and the geometry of placement and camera."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.scene.camera import Camera
from incpt.scene.change import Change, diff
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh, MeshSource, is_deformation
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import SHAPES, shape

SCENE = Scene(
    environment=Environment((1, 1, 1), Image(np.ones((2, 4, 3), np.float32))),
    materials={"red": Material((0.8, 0.1, 0.1)), "grey": Material()},
    objects=(Object("cube", shape("cube"), "red"), Object("ball", shape("sphere"), "grey")),
)


def test_nothing_changed() -> None:
    change = diff(SCENE, SCENE)
    assert change == Change() and not change.is_global and not change.is_local
    assert diff(SCENE, replace(SCENE)) == Change()


@pytest.mark.parametrize(
    "values", [{"position": (1, 0, 0)}, {"rotation": (0, 9, 0)}, {"scale": (2, 1, 1)}, {"visible": False}]
)
def test_a_moved_object(values: dict[str, object]) -> None:
    change = diff(SCENE, SCENE.with_object("cube", **values))
    assert change == Change(moved=frozenset({"cube"})) and change.is_local and not change.is_global


def test_meshes_deform_or_are_others() -> None:
    ball = shape("sphere")
    bent = replace(ball, vertices=ball.vertices * 2)
    assert diff(SCENE, SCENE.with_object("ball", mesh=bent)) == Change(deformed=frozenset({"ball"}))
    assert diff(SCENE, SCENE.with_object("ball", mesh=shape("cube"))) == Change(reshaped=frozenset({"ball"}))
    assert not is_deformation(ball, replace(ball, normals=None))


def test_materials_and_their_use() -> None:
    assert diff(SCENE, SCENE.with_material("red", roughness=0.5)).materials == {"red"}
    assert diff(SCENE, SCENE.with_material("red", roughness=1.0)) == Change()
    assert diff(SCENE, SCENE.with_material("new")) == Change(materials_added_or_removed=True)
    assert diff(SCENE, SCENE.with_object("cube", material="grey")).reassigned == {"cube"}


def test_objects_come_go_and_change_places() -> None:
    extra = Object("extra", shape("plane"), "grey")
    more = SCENE.with_added(extra)
    assert diff(SCENE, more) == Change(added=frozenset({"extra"}))
    assert diff(more, SCENE) == Change(removed=frozenset({"extra"}))
    assert more.without_object("extra") == SCENE
    assert diff(SCENE, replace(SCENE, objects=SCENE.objects[::-1])) == Change(reordered=True)
    renamed = diff(SCENE, SCENE.with_object("cube", name="box"))
    assert renamed.added == {"box"} and renamed.removed == {"cube"} and renamed.objects == {"box", "cube"}


def test_the_active_camera_is_one_of_all() -> None:
    front, top = SCENE.camera, Camera((0, 9, 0.1))
    scene = SCENE.with_camera("top", position=top.position)
    assert dict(scene.cameras) == {"camera": front, "top": top} and scene.camera == front
    assert diff(SCENE, scene) == Change()  # it is not seen through
    above = scene.with_active_camera("top")
    assert above.camera == top and diff(scene, above) == Change(camera=True)
    # What is changed of the active one is changed in its place.
    tilted = replace(above, camera=replace(top, fov_y=20))
    assert list(tilted.cameras) == ["camera", "top"] and tilted.cameras["top"].fov_y == 20
    assert above.with_camera(fov_y=20) == tilted == above.with_camera("top", fov_y=20)
    assert tilted.without_camera("top") == SCENE and scene.without_camera("top") == SCENE
    assert dict(above.without_camera("camera").cameras) == {"top": top}
    with pytest.raises(InputError, match="is the only one; add another before"):
        SCENE.without_camera("camera")
    for wrong in ("side", 3):
        with pytest.raises(InputError, match="is not in the scene; it has camera, top"):
            scene.with_active_camera(wrong)  # type: ignore[arg-type]
    for copied in (copy.deepcopy(above), pickle.loads(pickle.dumps(above))):
        assert (copied.camera_name, dict(copied.cameras)) == ("top", dict(above.cameras))


def test_a_new_angle_ends_a_focal_length() -> None:
    long = SCENE.with_camera(focal_length=85)
    assert long.camera.focal_length == 85
    assert long.with_camera(fov_y=30).camera == replace(SCENE.camera, fov_y=30)
    assert long.with_camera(fov_y=30, focal_length=50).camera.focal_length == 50


def test_global_changes() -> None:
    assert diff(SCENE, SCENE.with_camera(fov_y=50)) == Change(camera=True)
    assert diff(SCENE, SCENE.with_environment(rotation_y=50)) == Change(environment=True)
    image = Image(np.ones((2, 4, 3), np.float32))
    change = diff(SCENE, SCENE.with_environment(image=image))
    assert change.environment_image and change.is_global and not change.is_local


def test_scenes_do_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        SCENE.camera = Camera()  # type: ignore[misc]
    with pytest.raises(TypeError):
        SCENE.materials["red"] = Material()  # type: ignore[index]
    with pytest.raises(ValueError, match="read-only"):
        shape("cube").vertices[0, 0] = 3
    edited = SCENE.with_object("cube", position=(1, 2, 3))
    assert SCENE.object("cube").position == (0, 0, 0)
    assert edited.object("ball") is SCENE.object("ball")


def test_scenes_are_copied_and_pickled() -> None:
    assert SCENE.object_index == {"cube": 0, "ball": 1}
    for again in (copy.deepcopy(SCENE), pickle.loads(pickle.dumps(SCENE))):
        assert again.object("ball").material == "grey" and again.materials == SCENE.materials
        assert again.with_material("grey", roughness=0).material("grey").roughness == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SCENE.object("kube"), "object 'kube' is not in the scene; it has ball, cube"),
        (lambda: SCENE.material("blue"), "material 'blue' is not in the scene; it has grey, red"),
        (lambda: Scene().object("a"), "it has none"),
        (lambda: SCENE.with_object("cube", colour=3), "colour: is no property of object; it has name, mesh"),
        (
            lambda: SCENE.with_object("cube", material="blue"),
            "object 'cube': material 'blue' is not in the scene",
        ),
        (lambda: SCENE.with_object("cube", material=["red"]), "is not the name of a material"),
        (lambda: SCENE.with_object("cube", mesh="cube"), "mesh: 'cube' is not a Mesh"),
        (lambda: SCENE.with_object("cube", name=""), "name: '' is not a name"),
        (lambda: SCENE.with_object("cube", name="ball"), "objects: two are named 'ball'"),
        (lambda: SCENE.with_object("cube", scale=(1, 0, 1)), "flattens the object"),
        (lambda: SCENE.with_object("cube", position=(1, 0, 10**400)), "position: a whole number that large"),
        (lambda: SCENE.with_object("cube", position="abc"), "position: 'abc' is not a list of three numbers"),
        (lambda: SCENE.with_camera(target=Camera().position), "target: is the same point as position"),
        (lambda: SCENE.with_material("red", priority=1.5), "priority: 1.5 is not a whole number"),
        (lambda: SCENE.with_material("red", priority=1001), "priority: 1001 is out of range"),
        (lambda: SCENE.with_material("red", double_sided=1), "double_sided: 1 is not true or false"),
        (lambda: shape("torus"), "shape 'torus' is not known; choose one of cube"),
        (lambda: Mesh(np.zeros((3, 2)), np.zeros((1, 3))), r"vertices: have shape \(3, 2\)"),
        (lambda: Mesh(np.zeros((3, 3)), np.zeros((0, 3))), r"faces: have shape \(0, 3\)"),
        (lambda: Mesh(np.zeros((3, 3)), np.full((1, 3), 3)), "faces: use a vertex outside 0 to 2"),
        (lambda: Mesh(np.full((3, 3), np.nan), np.zeros((1, 3))), "not finite"),
        (
            lambda: Mesh(np.zeros((3, 3)), np.zeros((1, 3)), np.zeros((1, 3))),
            r"normals: need shape \(1, 3, 3\)",
        ),
        (lambda: Image(np.zeros((2, 2))), "image: has shape"),
        (lambda: Image(np.full((2, 2, 3), -1.0)), "image: holds negative"),
        (lambda: Image(np.zeros((1, 5000, 3))), "image: 5000 x 1 pixels are more than 4096"),
        (
            lambda: Scene(materials={str(i): Material() for i in range(65_535)}),
            "materials: 65535 are more than",
        ),
    ],
)
def test_impossible_values(make: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()  # type: ignore[operator]


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_closed_and_face_outwards(name: str) -> None:
    mesh = shape(name)
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    volume = (a * np.cross(b, c)).sum() / 6
    expected = {
        "cube": (6, 1),
        "sphere": (math.pi, math.pi / 6),
        "plane": (1, 0),
        "cylinder": (1.5 * math.pi, math.pi / 4),
    }
    np.testing.assert_allclose((area, volume), expected[name], rtol=2e-3, atol=1e-9)
    if name == "plane":
        assert (np.cross(b - a, c - a)[:, 1] > 0).all()
    else:
        edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        places = np.unique(mesh.vertices, axis=0, return_inverse=True)[1].ravel()[edges]
        forward = set(map(tuple, places.tolist()))
        assert len(forward) == len(edges) and forward == {(v, u) for u, v in forward}
    if mesh.normals is not None:
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1, atol=1e-6)
        assert ((mesh.normals * np.cross(b - a, c - a)[:, None, :]).sum(axis=2) > 0).all()


angles = st.floats(-720, 720)


@given(rotation=st.tuples(angles, angles, angles))
def test_rotation_is_about_x_then_y_then_z(rotation: tuple[float, float, float]) -> None:
    matrix = affine.rotation_matrix(rotation)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) > 0
    parts = [
        affine.rotation_matrix([a if i == axis else 0 for i, a in enumerate(rotation)]) for axis in range(3)
    ]
    np.testing.assert_allclose(matrix, parts[2] @ parts[1] @ parts[0], atol=1e-12)


def test_rotations_are_right_handed() -> None:
    np.testing.assert_allclose(affine.rotation_matrix((90, 0, 0)) @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(affine.rotation_matrix((0, 90, 0)) @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(affine.rotation_matrix((0, 0, 90)) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_placement_and_bounds() -> None:
    obj = Object("a", shape("cube"), "m", (1, 2, 3), (0, 90, 0), (4, 1, 2))
    np.testing.assert_allclose(obj.world_bounds, [[0, 1.5, 1], [2, 2.5, 5]], atol=1e-9)
    inverse = affine.invert(obj.world_from_object)
    there = affine.apply(obj.world_from_object, np.array([[0.1, 0.2, 0.3]]))
    np.testing.assert_allclose(affine.apply(inverse, there), [[0.1, 0.2, 0.3]], atol=1e-12)
    assert sorted(map(tuple, affine.box_corners(np.array([[0, 0, 0], [1, 1, 1]])))) == [
        (x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)
    ]


def test_what_a_scene_is_made_of_stays_as_it_was() -> None:
    """Whoever goes on with the arrays that a mesh or an image was made from changes neither."""
    vertices, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    normals = np.ones((1, 3, 3), np.float32)
    pixels = np.ones((2, 4, 3), np.float32)
    mesh, image = Mesh(vertices, faces, normals), Image(pixels)
    view = vertices.view()
    view.flags.writeable = False
    viewed = Mesh(view, faces)
    for array in (vertices, faces, normals, pixels):
        array.fill(0)
    assert mesh.vertices.sum() == viewed.vertices.sum() == 3 and mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.normals is not None and mesh.normals.min() == 1 and image.pixels.min() == 1
    again = replace(mesh, source=MeshSource(file="a.ply"))
    assert again.vertices is mesh.vertices  # what nobody can write to is not copied
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 5
