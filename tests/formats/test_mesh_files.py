"""Mesh files: what each format brings, and what becomes of damaged ones."""

from __future__ import annotations

import base64
import json
import struct
import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from incpt.core.errors import InputError, InputWarning
from incpt.formats import mesh_files, mesh_store
from incpt.formats.clean import usable_mesh
from incpt.scene.mesh import Mesh
from incpt.scene.shapes import shape

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64)
TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def write_ply(path: Path, vertices: str, faces: str, extra: str = "") -> Path:
    header = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices.splitlines())}\nproperty float x\n"
        f"property float y\nproperty float z\n{extra}element face {len(faces.splitlines())}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    path.write_text(f"{header}{vertices}\n{faces}\n")
    return path


def gltf(**changes: object) -> dict[str, object]:
    """One triangle with normals, its buffer inside."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    normals = np.array([[0, 0, 1], [0, 0.6, 0.8], [0, 0, 1]], "<f4").tobytes()
    indices = np.array([0, 1, 2], "<u4").tobytes()
    content = positions + normals + indices
    header: dict[str, object] = {
        "asset": {"version": "2.0"},
        "buffers": [
            {"byteLength": len(content), "uri": "data:application/octet-stream;base64," + b64(content)}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 36},
            {"buffer": 0, "byteOffset": 72, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [
            {"name": "triangle", "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}]}
        ],
        "nodes": [{"name": "only", "mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return {**header, **changes}


def b64(content: bytes) -> str:
    return base64.b64encode(content).decode()


def write_gltf(path: Path, **changes: object) -> Path:
    path.write_text(json.dumps(gltf(**changes)))
    return path


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "glb", "gltf", "off"])
def test_every_format_keeps_the_triangles(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"
    made = trimesh.Trimesh(TETRAHEDRON, TETRAHEDRON_FACES, process=False)
    if suffix == "gltf":
        for name, content in trimesh.Scene(made).export(file_type="gltf").items():
            (tmp_path / name).write_bytes(content)
        path = tmp_path / "model.gltf"
    else:
        made.export(path)
    mesh = mesh_files.load_mesh(path)
    expected = TETRAHEDRON[TETRAHEDRON_FACES].reshape(4, 9)
    np.testing.assert_allclose(
        np.sort(mesh.vertices[mesh.faces].reshape(4, 9), axis=0), np.sort(expected, axis=0), atol=1e-6
    )
    assert mesh.normals is None
    assert mesh.source.file == str(path) and mesh.source.part is None


def test_ply_normals_are_taken_where_the_file_has_them(tmp_path: Path) -> None:
    normals = "property float nx\nproperty float ny\nproperty float nz\n"
    path = write_ply(tmp_path / "n.ply", "0 0 0 0 0 2\n1 0 0 0 3 4\n0 1 0 0 0 0", "3 0 1 2", normals)
    mesh = mesh_files.load_mesh(path)
    assert mesh.normals is not None
    # Unit length; the corner without a direction takes the normal of the face.
    np.testing.assert_allclose(mesh.normals[0], [[0, 0, 1], [0, 0.6, 0.8], [0, 0, 1]], atol=1e-6)


def test_obj_normals_stay_with_their_corners(tmp_path: Path) -> None:
    path = tmp_path / "n.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 0 1\nvn 0 1 0\nvn 1 0 0\n"
        "f 1//1 2//2 3//3\nf 2//3 4//1 3//1\n"
    )
    mesh = mesh_files.load_mesh(path)
    assert mesh.normals is not None
    by_corner = {
        (tuple(mesh.vertices[v]), tuple(n))
        for face, normals in zip(mesh.faces, mesh.normals, strict=True)
        for v, n in zip(face, normals, strict=True)
    }
    z, y, x = (0, 0, 1), (0, 1, 0), (1, 0, 0)
    assert by_corner == {
        ((0, 0, 0), z), ((1, 0, 0), y), ((0, 1, 0), x), ((1, 0, 0), x), ((1, 1, 0), z), ((0, 1, 0), z)
    }  # fmt: skip


def test_gltf_normals_and_placement(tmp_path: Path) -> None:
    node = {"name": "only", "mesh": 0, "translation": [0, 0, 5], "scale": [1, 2, 1]}
    mesh = mesh_files.load_mesh(write_gltf(tmp_path / "a.gltf", nodes=[node]))
    np.testing.assert_allclose(mesh.vertices, [[0, 0, 5], [1, 0, 5], [0, 2, 5]])
    assert mesh.normals is not None
    bent = np.array([0, 0.3, 0.8]) / np.hypot(0.3, 0.8)  # by the inverse transpose
    np.testing.assert_allclose(mesh.normals[0], [[0, 0, 1], bent, [0, 0, 1]], atol=1e-6)


def test_a_mirroring_node_keeps_the_outside_outside(tmp_path: Path) -> None:
    node = {"name": "only", "mesh": 0, "scale": [-1, 1, 1]}
    mesh = mesh_files.load_mesh(write_gltf(tmp_path / "a.gltf", nodes=[node]))
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert mesh.normals is not None
    assert (mesh.normals[..., 2] > 0).all()


def test_several_meshes_keep_names_and_placement(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    scene.add_geometry(
        box, node_name="left", transform=trimesh.transformations.translation_matrix([-3, 0, 0])
    )
    scene.add_geometry(
        box.copy(), node_name="right", transform=trimesh.transformations.translation_matrix([3, 0, 0])
    )
    path = tmp_path / "two.glb"
    scene.export(path)
    parts = {part.name: part.mesh for part in mesh_files.load_parts(path)}
    assert set(parts) == {"left", "right"}
    np.testing.assert_allclose(parts["left"].bounds[:, 0], [-3.5, -2.5])
    assert mesh_files.load_mesh(path, "right") is parts["right"]
    assert parts["right"].source.part == "right"
    with pytest.raises(InputError, match="did you mean 'right'"):
        mesh_files.load_mesh(path, "rigth")
    with pytest.raises(InputError, match='choose one of "left", "right"'):
        mesh_files.load_mesh(path)


def test_obj_objects_are_parts(tmp_path: Path) -> None:
    path = tmp_path / "two.obj"
    path.write_text("o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no b\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 4 5 6\n")
    assert sorted(p.name or "" for p in mesh_files.load_parts(path)) == ["a", "b"]
    assert mesh_files.load_mesh(path, "b").bounds[0, 2] == 1


def test_primitives_of_one_node_are_numbered_alike_every_time(tmp_path: Path) -> None:
    primitive = {"attributes": {"POSITION": 0}, "indices": 2}
    for _ in range(2):
        path = write_gltf(
            tmp_path / "p.gltf",
            meshes=[{"primitives": [primitive, primitive]}],
        )
        parts = mesh_files.load_parts(path)
        assert [p.name for p in parts] == ["only.1", "only.2"]


def test_gltf_materials_are_read_when_there_are_some(tmp_path: Path) -> None:
    material = {
        "name": "lamp glass",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 1],
            "metallicFactor": 0,
            "roughnessFactor": 0.1,
        },
        "emissiveFactor": [1, 0, 0.5],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 10},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_specular": {"specularFactor": 0.5},
            "KHR_materials_volume": {"attenuationDistance": 2, "attenuationColor": [0.5, 1, 1]},
        },
    }
    primitive = {"attributes": {"POSITION": 0}, "indices": 2, "material": 0}
    path = write_gltf(tmp_path / "m.gltf", materials=[material], meshes=[{"primitives": [primitive]}])
    part = mesh_files.load_parts(path)[0]
    assert part.material_name == "lamp glass" and part.material is not None
    assert part.material.base_color == (0.5, 0.25, 1) and part.material.emission == (10, 0, 5)
    assert (part.material.metallic, part.material.roughness, part.material.ior) == (0, 0.1, 1.33)
    assert (part.material.transmission, part.material.specular) == (1, 0.5)
    np.testing.assert_allclose(part.material.absorption, [np.log(2) / 2, 0, 0], atol=1e-12)
    broken = write_gltf(
        tmp_path / "b.gltf", materials=[{"pbrMetallicRoughness": 5}], meshes=[{"primitives": [primitive]}]
    )
    with pytest.raises(InputError, match=r"material 'material 0': .*pbrMetallicRoughness: 5 is no object"):
        mesh_files.load_parts(broken)


def test_bad_faces_are_left_out_and_told(tmp_path: Path) -> None:
    vertices = "0 0 0\n1 0 0\n0 1 0\n1 1 0\nnan 0 0\n2 0 0\n0 0 0\n1 0 0\n0 1 0"
    faces = "3 0 1 2\n3 0 1 99\n3 0 1 4\n3 0 1 5\n3 1 2 0\n3 6 7 8\n3 2 1 0\n3 1 3 2\n3 3 3 1"
    path = write_ply(tmp_path / "bad.ply", vertices, faces)
    with pytest.warns(InputWarning) as caught:
        mesh = mesh_files.load_mesh(path)
    message = str(caught[0].message)
    assert len(caught) == 1 and "\n" not in message
    assert message == (
        f"{path}: left out 6 of 9 faces: 1 with an index out of range, "
        "1 with a vertex that is not finite or too far away, 2 with zero area, 2 that come twice"
    )
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 0], [1, 3, 2]]
    assert np.isfinite(mesh.vertices).all()


def test_numbers_that_signal_are_no_numbers() -> None:
    """A NaN of this kind makes numpy warn when anything is done with it."""
    vertices = np.zeros((4, 3), np.float32)
    vertices[1:] = np.eye(3)
    vertices.view(np.uint32)[0, 0] = 0x7F800001
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        counts: dict[str, int] = {}
        mesh = usable_mesh(vertices, TETRAHEDRON_FACES, None, counts)
    assert mesh is not None and len(mesh.faces) == 1
    assert counts["with a vertex that is not finite or too far away"] == 3


def test_obj_with_relative_and_impossible_indices(tmp_path: Path) -> None:
    path = tmp_path / "r.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf -3 -2 -1\n"
        "f 1 2 77\nf 0 1 2\nf 1 2\nf 1 2 5 4 # a quad\n"
    )
    with pytest.warns(
        InputWarning, match="left out 3 of 7 faces: 1 with fewer than three corners, 2 with an index out"
    ):
        mesh = mesh_files.load_mesh(path)
    corners = mesh.vertices[mesh.faces]
    assert len(corners) == 4
    assert (corners[0] == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]).all()
    assert (corners[1] == [[0, 0, 1], [1, 0, 1], [0, 1, 1]]).all()


def test_an_obj_of_an_older_program(tmp_path: Path) -> None:
    path = tmp_path / "l.obj"
    path.write_bytes("# Größe in m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("latin-1"))
    assert len(mesh_files.load_mesh(path).faces) == 1


def test_a_polygon_becomes_a_fan(tmp_path: Path) -> None:
    path = tmp_path / "p.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5\n")
    assert len(mesh_files.load_mesh(path).faces) == 3


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", b"", "is empty"),
        ("a.obj", b"# nothing here\n", "no usable face|is no OBJ"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no usable face"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\n", "no usable face .1 with zero area"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "no usable face .1 with an index out of range"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf a b c\n", "has no usable face"),
        ("a.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "no usable face .1 with a vertex that is not finite"),
        ("a.obj", b"v zero one two\nf 1 1 1\n", "no usable face .1 with a vertex that is not finite"),
        ("a.obj", b"\x89PNG\r\n\x1a\n\x00\x00", "is no OBJ mesh, or a damaged one"),
        ("a.stl", b"solid garbage\nthis is no mesh\n", "is no STL mesh|no usable face"),
        ("a.stl", bytes(84), "is no STL mesh|no usable face"),
        ("a.glb", b"glTF" + bytes(20), "is no GLB mesh"),
        ("a.glb", b"PK\3\4" * 20, "is no GLB mesh"),
        ("a.gltf", b"[1, 2]", "is no object; the file is damaged"),
        ("a.gltf", b"{", "is no GLTF mesh"),
        ("a.gltf", b'{"asset": {"version": "1.0"}}', "asset.version: says glTF 1.0; convert"),
        ("a.glb", b"glTF" + (1).to_bytes(4, "little") + bytes(12), "says version 1.; convert it to glTF 2.0"),
        ("a.gltf", b'{"asset": {"version": "2.0"}}', "no usable face|is no GLTF"),
        ("a.off", b"OFF\n3 1 0\n0 0 0\n", "is no OFF mesh"),
        ("a.npz", b"PK\3\4 no archive", "is no mesh archive"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "is no PLY mesh"),
        ("a.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
         b"property float y\nproperty float z\nelement face 4000000000\n"
         b"property list uchar int vertex_indices\nend_header\n" + bytes(30), "is no PLY mesh"),
        ("a.txt", b"hello", "is no mesh file; .glb, .gltf, .obj"),
    ],
)  # fmt: skip
def test_no_mesh_is_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        mesh_files.load_mesh(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        mesh_files.load_mesh(tmp_path / "none.ply")
    with pytest.raises(InputError, match="is a folder"):
        mesh_files.load_mesh(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        mesh_files.load_mesh(str(tmp_path / "a\0.ply"))


@pytest.mark.parametrize("kept", [10, 100, 300, 0.5, 0.99])
@pytest.mark.parametrize("suffix", ["ply", "glb", "stl"])
def test_truncated_files(tmp_path: Path, suffix: str, kept: float) -> None:
    path = tmp_path / f"cut.{suffix}"
    trimesh.creation.icosphere(subdivisions=2).export(path)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content)) if kept < 1 else int(kept)])
    with pytest.raises(InputError):
        mesh_files.load_mesh(path)


def test_a_node_that_flattens_leaves_no_face(tmp_path: Path) -> None:
    node = {"name": "only", "mesh": 0, "scale": [0, 1, 1]}
    with pytest.raises(InputError, match="no usable face"):
        mesh_files.load_mesh(write_gltf(tmp_path / "a.gltf", nodes=[node]))


def test_an_unchanged_file_gives_the_same_mesh(tmp_path: Path) -> None:
    path = write_ply(tmp_path / "a.ply", "0 0 0\n1 0 0\n0 1 0", "3 0 1 2")
    mesh = mesh_files.load_mesh(path)
    assert mesh_files.load_mesh(tmp_path / "." / "a.ply") is mesh
    write_ply(path, "0 0 0\n1 0 0\n0 1 0\n0 0 1", "3 0 1 3")
    assert mesh_files.load_mesh(path) is not mesh


@pytest.mark.parametrize("name", ["cube", "sphere", "cylinder"])
def test_stored_meshes_come_back_exactly(tmp_path: Path, name: str) -> None:
    mesh = shape(name)
    path = tmp_path / "m.npz"
    mesh_store.store_mesh(path, mesh)
    again = mesh_files.load_mesh(path)
    assert (again.vertices == mesh.vertices).all() and (again.faces == mesh.faces).all()
    assert (again.normals is None) == (mesh.normals is None)
    assert mesh.normals is None or again.normals is not None and (again.normals == mesh.normals).all()
    assert mesh_store.digest(again) == mesh_store.digest(mesh)


def test_stored_meshes_are_checked(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", vertices=TETRAHEDRON, faces=TETRAHEDRON_FACES + 1)
    with pytest.raises(InputError, match="use a vertex outside"):
        mesh_files.load_mesh(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", vertices=TETRAHEDRON)
    with pytest.raises(InputError, match="is no mesh archive"):
        mesh_files.load_mesh(tmp_path / "b.npz")


def write_usda(path: Path) -> None:
    points = ", ".join(str(tuple(point)) for point in TETRAHEDRON.tolist())
    corners = ", ".join(map(str, TETRAHEDRON_FACES.ravel().tolist()))
    path.write_text(
        f'#usda 1.0\ndef Mesh "m"\n{{\npoint3f[] points = [{points}]\nint[] faceVertexCounts = [3, 3, 3, 3]\n'
        f"int[] faceVertexIndices = [{corners}]\n}}\n"
    )


SUFFIXES = ["ply", "obj", "stl", "glb", "gltf", "off", "npz", *(["usda"] if find_spec("pxr") else [])]


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    suffix=st.sampled_from(SUFFIXES),
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=6),
    cut=st.floats(0, 1),
)
def test_damaged_files_raise_input_errors_or_load(
    tmp_path: Path, suffix: str, places: list[tuple[float, int]], cut: float
) -> None:
    path = tmp_path / f"damaged.{suffix}"
    if suffix == "npz":
        mesh_store.store_mesh(path, shape("cube"))
    elif suffix == "gltf":
        write_gltf(path)
    elif suffix == "usda":
        write_usda(path)
    else:
        trimesh.creation.box().export(path)
    content = bytearray(path.read_bytes())
    for place, value in places:
        content[int(place * (len(content) - 1))] = value
    path.write_bytes(content[: len(content) if cut > 0.5 else int(2 * cut * len(content))])
    check_loads_or_explains(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    suffix=st.sampled_from(SUFFIXES),
    content=st.binary(max_size=300),
)
def test_garbage_raises_input_errors(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"garbage.{suffix}"
    path.write_bytes(
        {
            "ply": b"ply\n",
            "off": b"OFF\n",
            "usda": b"#usda 1.0\n",
            "glb": struct.pack("<4sI", b"glTF", 2),
        }.get(suffix, b"")
        + content
    )
    check_loads_or_explains(path)


def check_loads_or_explains(path: Path) -> None:
    message = str(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", InputWarning)
        try:
            assert all(isinstance(part.mesh, Mesh) for part in mesh_files.load_parts(path))
        except InputError as error:
            message = str(error)
    assert message.startswith(str(path)) and len(message.splitlines()) == 1


def test_obj_has_texture_coordinates(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.75\nf 1/1 2/2 3/3\n")
    (part,) = mesh_files.load_parts(path)
    np.testing.assert_allclose(part.mesh.uvs[0], [[[0, 1], [1, 1], [0, 0.25]]], atol=1e-6)


def test_colours_of_ply_are_linear(tmp_path: Path) -> None:
    lines = ["ply", "format ascii 1.0", "element vertex 3"]
    lines += [f"property float {axis}" for axis in "xyz"] + [
        f"property uchar {c}" for c in ("red", "green", "blue")
    ]
    lines += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    path = tmp_path / "a.ply"
    path.write_text(
        "\n".join([*lines, "0 0 0 255 0 128", "1 0 0 255 0 128", "0 1 0 255 0 128", "3 0 1 2", ""])
    )
    (part,) = mesh_files.load_parts(path)
    assert part.mesh.colors is not None
    np.testing.assert_allclose(part.mesh.colors[0, 0], [1, 0, 0.21586, 1], atol=1e-4)
