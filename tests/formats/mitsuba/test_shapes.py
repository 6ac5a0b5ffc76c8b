"""Shapes: where their points are, which way they face, which part of an image lies where."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from support.mitsuba_files import read, told, write_image, written

from incpt.core.errors import InputError
from incpt.formats import registry, scene_save
from incpt.formats.import_report import Fate
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object

Array = npt.NDArray[np.float64]
TEXTURED = (
    '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
    '<string name="filename" value="a.png"/></texture></bsdf>'
)
TURNED = (
    '<transform name="to_world"><scale x="2"/><rotate y="1" angle="90"/><translate x="1" y="2" z="3"/>'
    "</transform>"
)


def shape_of(folder: Path, body: str) -> Object:
    (found,) = read(folder, body)[0].objects
    return found


def world(obj: Object) -> Array:
    """(F, 3, 3) corners of its faces in world space."""
    matrix = obj.world_from_object
    corners: Array = obj.mesh.vertices[obj.mesh.faces] @ matrix[:, :3].T + matrix[:, 3]
    return corners


def facing(obj: Object) -> Array:
    """(F, 3) unit normals of its faces, on the side that is outside in object space."""
    a, b, c = np.moveaxis(world(obj), 1, 0)
    normals = np.cross(b - a, c - a) * np.sign(np.linalg.det(obj.world_from_object[:, :3]))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def uv_at(obj: Object, point: Array) -> Array:
    """Texture coordinates of the corner that is nearest to a point."""
    corners = world(obj)
    place = np.unravel_index(np.linalg.norm(corners - point, axis=2).argmin(), corners.shape[:2])
    return np.asarray(obj.mesh.uvs[0][place])


@pytest.mark.parametrize(
    ("kind", "area"),
    [("rectangle", 4), ("disk", math.pi), ("cube", 24), ("sphere", 4 * math.pi), ("cylinder", 2 * math.pi)],
)
def test_shapes_have_the_size_of_mitsubas(kind: str, area: float, tmp_path: Path) -> None:
    obj = shape_of(tmp_path, f'<shape type="{kind}"/>')
    a, b, c = np.moveaxis(world(obj), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(area, rel=1e-3)
    low = {"rectangle": (-1, -1, 0), "disk": (-1, -1, 0), "cylinder": (-1, -1, 0)}.get(kind, (-1, -1, -1))
    np.testing.assert_allclose(obj.world_bounds[0], low, atol=1e-3)
    np.testing.assert_allclose(obj.world_bounds[1], [1, 1, -low[2] if kind != "cylinder" else 1], atol=1e-3)


@pytest.mark.parametrize("kind", ["cube", "sphere", "cylinder"])
def test_closed_shapes_face_outwards(kind: str, tmp_path: Path) -> None:
    middle = np.array([0, 0, 0.5 if kind == "cylinder" else 0])
    for flips, sign in (("", 1), ('<boolean name="flip_normals" value="true"/>', -1)):
        obj = shape_of(tmp_path, f'<shape type="{kind}">{flips}</shape>')
        out = world(obj).mean(axis=1) - middle
        out[:, 2] *= kind != "cylinder"
        assert ((facing(obj) * out).sum(axis=1) * sign > 0).all()
        if obj.mesh.normals is not None:
            turned = obj.mesh.normals.mean(axis=1) @ np.linalg.inv(obj.world_from_object[:, :3])
            assert ((turned * out).sum(axis=1) * sign > 0).all()


def test_a_rectangle_faces_z_and_its_image_stands_on_its_head(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.zeros((2, 2, 3)))
    obj = shape_of(tmp_path, f'<shape type="rectangle">{TEXTURED}</shape>')
    np.testing.assert_allclose(facing(obj), [[0, 0, 1]] * 2)
    # The top row of an image is at v = 0, which is the lower edge.
    np.testing.assert_array_equal(uv_at(obj, np.array([-1, -1, 0])), [0, 0])
    np.testing.assert_array_equal(uv_at(obj, np.array([1, 1, 0])), [1, 1])


def test_steps_of_a_transform_follow_each_other(tmp_path: Path) -> None:
    obj = shape_of(tmp_path, f'<shape type="rectangle">{TURNED}</shape>')
    # (2, 0, 0) is turned to (0, 0, -2).
    np.testing.assert_allclose(obj.world_bounds, [[1, 1, 1], [1, 3, 5]], atol=1e-6)
    np.testing.assert_allclose(facing(obj), [[1, 0, 0]] * 2, atol=1e-6)
    mirrored = shape_of(
        tmp_path, '<shape type="cube"><transform name="to_world"><scale x="-1"/></transform></shape>'
    )
    assert ((facing(mirrored) * world(mirrored).mean(axis=1)).sum(axis=1) > 0).all()


def test_an_axis_of_any_length_only_turns(tmp_path: Path) -> None:
    turn = '<transform name="to_world"><rotate y="2" angle="90"/></transform>'
    scene, report = read(tmp_path, f'<shape type="cube">{turn}</shape>')
    np.testing.assert_allclose(scene.objects[0].world_bounds, [[-1] * 3, [1] * 3], atol=1e-9)
    assert any("axis of length 2" in text for text in told(report, Fate.CHANGED))


def test_longitudes_of_a_sphere(tmp_path: Path) -> None:
    obj = shape_of(
        tmp_path, '<shape type="sphere"><point name="center" x="1"/><float name="radius" value="3"/></shape>'
    )
    np.testing.assert_allclose(obj.world_bounds, [[-2, -3, -3], [4, 3, 3]], atol=1e-2)
    # u is the angle from +x to +y over a turn, v that from +z over half a turn.
    for direction, uv in (((0, 1, 0), (0.25, 0.5)), ((-1, 0, 0), (0.5, 0.5)), ((0.6, 0, 0.8), (0, 0.2048))):
        found = uv_at(obj, 3 * np.array(direction) + [1, 0, 0])
        assert abs((found[0] - uv[0] + 0.5) % 1 - 0.5) < 0.02 and found[1] == pytest.approx(uv[1], abs=0.02)


def test_a_cylinder_between_two_points(tmp_path: Path) -> None:
    obj = shape_of(
        tmp_path,
        '<shape type="cylinder"><point name="p0" x="1" y="2" z="3"/><point name="p1" x="4" y="2" z="3"/>'
        '<float name="radius" value=".5"/></shape>',
    )
    np.testing.assert_allclose(obj.world_bounds, [[1, 1.5, 2.5], [4, 2.5, 3.5]], atol=1e-3)


OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 1 0 1\n3 0 1 2\n3 0 2 3\n"
)


def test_texture_coordinates_of_files(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.zeros((2, 2, 3)))
    (tmp_path / "a.obj").write_text(OBJ + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    (tmp_path / "a.ply").write_text(PLY)

    def v_of_first(kind: str, more: str = "") -> float:
        body = f'<shape type="{kind}"><string name="filename" value="a.{kind}"/>{more}{TEXTURED}</shape>'
        return float(uv_at(shape_of(tmp_path, body), np.zeros(3))[1])

    turned, unturned = (f'<boolean name="flip_tex_coords" value="{one}"/>' for one in ("true", "false"))
    assert (v_of_first("obj"), v_of_first("obj", unturned)) == (1, 0)
    assert (v_of_first("ply"), v_of_first("ply", turned)) == (0, 1)


def test_files_without_normals_get_smooth_ones(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(PLY)
    body = '<shape type="ply"><string name="filename" value="a.ply"/>{}</shape>'
    smooth, flat = (
        shape_of(tmp_path, body.format(more)) for more in ("", '<boolean name="face_normals" value="true"/>')
    )
    assert flat.mesh.normals is None and smooth.mesh.normals is not None
    own = facing(smooth)
    # At the corner of one face its own; at those of both the mean, by angles of 45° and 45° at the origin ...
    angles = [
        math.acos(np.clip(np.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))
        for a, b in (((1, 0, 0), (1, 1, 0)), ((1, 1, 0), (0, 1, 1)))
    ]
    mean = angles[0] * own[0] + angles[1] * own[1]
    np.testing.assert_allclose(smooth.mesh.normals[0, 1], own[0], atol=1e-6)
    np.testing.assert_allclose(smooth.mesh.normals[0, 0], mean / np.linalg.norm(mean), atol=1e-6)
    assert flat.mesh.source.file == str(tmp_path / "a.ply")


def test_materials_of_obj_files_count_for_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"mtllib missing.mtl\n{OBJ}usemtl red\nf 1 2 3\ng back\nf 1 3 4\n")
    scene, report = read(tmp_path, '<shape type="obj" id="s"><string name="filename" value="a.obj"/></shape>')
    assert len(scene.objects) == 2 and len(scene.materials) == 1
    assert all(one.name.startswith("s/") for one in scene.objects)
    assert report.is_whole


def test_colours_of_vertices_count_where_they_are_asked_for(tmp_path: Path) -> None:
    colored = PLY.replace("float u", "uchar red").replace("float v", "uchar green\nproperty uchar blue")
    head, _, faces = colored.partition("0 0 0 0 0\n")
    vertices = "0 0 0 255 0 0\n1 0 0 255 0 0\n1 1 0 0 255 0\n0 1 1 0 0 255\n"
    (tmp_path / "a.ply").write_text(head + vertices + faces[faces.index("3 0 1 2") :])
    attribute = (
        '<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">'
        '<string name="name" value="vertex_color"/></texture></bsdf>'
    )
    body = '<shape type="ply"><string name="filename" value="a.ply"/>{}</shape>'
    mesh = shape_of(tmp_path, body.format(attribute)).mesh
    assert mesh.colors is not None
    np.testing.assert_array_equal(mesh.colors[0], [[1, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]])
    assert shape_of(tmp_path, body.format("")).mesh.colors is None
    (tmp_path / "a.ply").write_text(PLY)
    scene, report = read(tmp_path, body.format(attribute))
    assert any("colours at the vertices" in text for text in told(report))
    # Grey stands for them.
    np.testing.assert_array_equal(
        scene.objects[0].mesh.colors, np.broadcast_to([0.5, 0.5, 0.5, 1], (2, 3, 4))
    )


def test_instances_share_the_meshes_of_their_group(tmp_path: Path) -> None:
    place = '<transform name="to_world">{}</transform>'
    larger = place.format('<scale value="2"/>')
    group = (
        f'<shape type="shapegroup" id="g"><shape type="sphere">{larger}</shape><shape type="cube"/></shape>'
    )
    turned = place.format('<rotate z="1" angle="90"/><translate x="5"/>')
    scene, report = read(
        tmp_path,
        f'{group}<shape type="instance" id="a"><ref id="g"/></shape>'
        f'<shape type="instance"><ref id="g"/>{turned}</shape>',
    )
    assert report.is_whole
    assert [one.name for one in scene.objects] == ["a/sphere", "a/cube", "g/sphere", "g/cube"]
    assert scene.objects[0].mesh is scene.objects[2].mesh and scene.objects[1].mesh is scene.objects[3].mesh
    np.testing.assert_allclose(scene.objects[2].world_bounds, [[3, -2, -2], [7, 2, 2]], atol=1e-2)


def serialized(version: int, doubles: bool = False) -> bytes:
    """A file of two meshes: a triangle with normals and texture coordinates, and a bare one."""

    def mesh(flags: int, size: float, *extra: object) -> bytes:
        kind = "<f8" if doubles else "<f4"
        vertices = np.array([[0, 0, 0], [size, 0, 0], [0, size, 0]])
        content = struct.pack("<I", flags | (0x2000 if doubles else 0x1000))
        content += b"name\0" if version == 4 else b""
        content += struct.pack("<QQ", 3, 1) + vertices.astype(kind).tobytes()
        content += b"".join(np.asarray(one).astype(kind).tobytes() for one in extra)
        content += np.array([0, 1, 2], "<u4").tobytes()
        return struct.pack("<HH", 0x041C, version) + zlib.compress(content)

    first = mesh(3, 1.0, [[0, 0, 1]] * 3, [[0, 0], [1, 0], [0, 0.25]])
    second = mesh(0, 2.0)
    kind = "<Q" if version == 4 else "<I"
    return first + second + struct.pack(kind, 0) + struct.pack(kind, len(first)) + struct.pack("<I", 2)


@pytest.mark.parametrize(("version", "doubles"), [(3, False), (4, False), (4, True)])
def test_serialized_meshes(version: int, doubles: bool, tmp_path: Path) -> None:
    (tmp_path / "a.serialized").write_bytes(serialized(version, doubles))
    body = (
        '<shape type="serialized"><string name="filename" value="a.serialized"/>'
        '<integer name="shape_index" value="{}"/></shape>'
    )
    first, second = (shape_of(tmp_path, body.format(number)).mesh for number in range(2))
    np.testing.assert_array_equal(first.uvs[0], [[[0, 0], [1, 0], [0, 0.25]]])
    np.testing.assert_array_equal(first.normals, [[[0, 0, 1]] * 3])
    np.testing.assert_array_equal(second.vertices[1], [2, 0, 0])
    assert any(
        "shape_index: 2 is not in the file" in text for text in told(read(tmp_path, body.format(2))[1])
    )


def test_damaged_serialized_meshes_are_left_out(tmp_path: Path) -> None:
    good = serialized(4)
    random = np.random.default_rng(1)
    for _ in range(150):
        damaged = bytearray(good)
        for place in random.integers(0, len(good), 3):
            damaged[place] = random.integers(0, 256)
        (tmp_path / "a.serialized").write_bytes(damaged[: random.integers(1, len(good) + 1)])
        read(tmp_path, '<shape type="serialized"><string name="filename" value="a.serialized"/></shape>')


def test_what_cannot_be_shown_is_left_out(tmp_path: Path) -> None:
    scene, report = read(
        tmp_path,
        '<shape type="ply"><string name="filename" value="none.ply"/></shape><shape type="bsplinecurve"/>'
        '<shape type="cube"><transform name="to_world"><scale x="0"/></transform></shape>'
        '<shape type="sphere"><bsdf type="null"/></shape><shape type="sphere"/>',
    )
    assert [one.name for one in scene.objects] == ["sphere"]
    (missing, curve, flat) = told(report)
    assert "none.ply: no such file" in missing and "bsplinecurve" in curve and "flattens" in flat


def test_a_scene_is_saved_and_read_again(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(PLY)
    path = written(
        tmp_path,
        '<shape type="ply"><string name="filename" value="a.ply"/><boolean name="face_normals" value="true"/>'
        f'</shape><shape type="sphere">{TURNED}</shape><shape type="rectangle"/><emitter type="constant"/>',
    )
    scene = registry.load(path)
    scene_save.save(scene, tmp_path / "b.toml")
    again = registry.load(tmp_path / "b.toml")
    for one, other in zip(scene.objects, again.objects, strict=True):
        assert one.transform == other.transform
        np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    assert (scene.materials, scene.camera, scene.settings) == (again.materials, again.camera, again.settings)


def test_a_group_may_not_be_multiplied_without_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("incpt.formats.mitsuba.shapes.MOST_OBJECTS", 8)
    group = '<shape type="shapegroup" id="g">' + '<shape type="cube"/>' * 3 + "</shape>"
    with pytest.raises(InputError, match="more than 8 objects"):
        read(tmp_path, group + '<shape type="instance"><ref id="g"/></shape>' * 3)


def test_like_shapes_share_one_mesh(tmp_path: Path) -> None:
    scene, _ = read(tmp_path, '<shape type="cube"/>' * 3 + '<shape type="rectangle"/>' * 2)
    meshes: list[Mesh] = [one.mesh for one in scene.objects]
    assert len({id(mesh) for mesh in meshes}) == 2
