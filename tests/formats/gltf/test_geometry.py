"""glTF: which triangles a file has, however it stores them."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.gltf_files import QUAD, QUAD_FACES, GltfBuilder, write_document

from incpt.core.errors import InputError, InputWarning
from incpt.formats import mesh_files
from incpt.formats.gltf import compression
from incpt.formats.gltf.accessors import as_floats
from incpt.formats.gltf.nodes import composed
from incpt.scene.mesh import Mesh

CORNERS = QUAD[QUAD_FACES].reshape(2, 3, 3)


def mesh_of(path: Path) -> Mesh:
    return mesh_files.load_mesh(path)


def corners(mesh: Mesh) -> npt.NDArray[np.float32]:
    """(F, 3, 3)"""
    return mesh.vertices[mesh.faces]


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_file_of_lines_alone_says_so(tmp_path: Path) -> None:
    builder = GltfBuilder()
    with pytest.raises(InputError, match=r"has no usable face \(no lines have area\)"):
        mesh_of(builder.write(tmp_path / "a.gltf", [builder.quad(mode=1)]))


@pytest.mark.parametrize("suffix", ["gltf", "glb"])
@pytest.mark.parametrize("is_indexed", [True, False])
@pytest.mark.parametrize(
    ("mode", "order"),
    [
        (4, [0, 1, 2, 0, 2, 3]),
        (5, [0, 1, 3, 2]),
        (6, [0, 1, 2, 3]),
    ],
)
def test_all_modes_with_area_give_the_same_quad(
    tmp_path: Path, mode: int, order: list[int], is_indexed: bool, suffix: str
) -> None:
    builder = GltfBuilder()
    if is_indexed:
        primitive: dict[str, Any] = {
            "attributes": {"POSITION": builder.accessor(QUAD)},
            "indices": builder.accessor(np.array(order, np.uint8)),
        }
    else:
        primitive = {"attributes": {"POSITION": builder.accessor(QUAD[order])}}
    mesh = mesh_of(builder.write(tmp_path / f"a.{suffix}", [{**primitive, "mode": mode}]))
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0, 0, 4], [0, 0, 4]])
    assert area(mesh) == pytest.approx(4)


def test_what_has_no_area_is_told(tmp_path: Path) -> None:
    builder = GltfBuilder()
    quad = builder.quad()
    path = builder.write(tmp_path / "a.gltf", [quad, {**quad, "mode": 0}, {**quad, "mode": 3}])
    with pytest.warns(InputWarning) as caught:
        assert len(mesh_files.load_parts(path)) == 1
    assert [str(warning.message) for warning in caught] == [
        f"{path}: left out points of mesh 'mesh 0': have no area",
        f"{path}: left out lines of mesh 'mesh 0': have no area",
    ]


def test_quantised_positions(tmp_path: Path) -> None:
    """Normalised bytes, each four of them in a stride of its own, and plain ones under a scale."""
    builder = GltfBuilder()
    stored = np.zeros((4, 4), np.int8)
    stored[:, :3] = QUAD * 127
    view = builder.view(stored.tobytes(), byteStride=4)
    faces = builder.accessor(QUAD_FACES)
    for name, more, node, factor in (
        ("normalised", {"normalized": True}, {"mesh": 0}, 1.0),
        ("plain", {}, {"mesh": 0, "scale": [1 / 127] * 3}, 1.0),
    ):
        builder.accessors = builder.accessors[:1]
        position = builder.accessor(stored[:, :3], bufferView=view, **more)
        path = builder.write(
            tmp_path / f"{name}.gltf",
            [{"attributes": {"POSITION": position}, "indices": faces}],
            nodes=[node],
            extensionsRequired=["KHR_mesh_quantization"],
        )
        np.testing.assert_allclose(corners(mesh_of(path)), CORNERS * factor, atol=1e-6)


def test_normalised_numbers_reach_from_minus_one_to_one() -> None:
    for kind in (np.int8, np.int16, np.uint8, np.uint16):
        largest, least = np.iinfo(kind).max, np.iinfo(kind).min
        found = as_floats(np.array([least, -largest if least else 0, 0, largest], kind), True)
        assert found.tolist() == ([-1, -1, 0, 1] if least else [0, 0, 0, 1])
        assert as_floats(np.array([largest], kind), False) == [largest]


def test_interleaved_and_sparse(tmp_path: Path) -> None:
    builder = GltfBuilder()
    rows = np.concatenate([QUAD, np.broadcast_to(np.float32([0, 0, 2]), (4, 3))], axis=1)
    view = builder.view(rows.tobytes(), byteStride=24)
    moved = builder.view(np.float32([[1, 5, 0]]).tobytes())
    place = builder.view(np.uint16([2]).tobytes())
    sparse = {
        "count": 1, "indices": {"bufferView": place, "componentType": 5123}, "values": {"bufferView": moved},
    }  # fmt: skip
    position = builder.accessor(QUAD, bufferView=view, sparse=sparse)
    normal = builder.accessor(QUAD, bufferView=view, byteOffset=12)
    # Without a view, a sparse accessor is zero where it says nothing.
    empty = builder.accessor(QUAD[:3], sparse={**sparse})
    builder.accessors[empty].pop("bufferView")
    faces = builder.accessor(QUAD_FACES)
    primitive = {"attributes": {"POSITION": position, "NORMAL": normal}, "indices": faces}
    mesh = mesh_of(builder.write(tmp_path / "a.gltf", [primitive]))
    assert mesh.bounds[1].tolist() == [1, 5, 0]
    assert mesh.normals is not None
    np.testing.assert_array_equal(mesh.normals, np.broadcast_to([0, 0, 1], (2, 3, 3)))
    with pytest.raises(InputError, match=r"no usable face \(1 with zero area\)"):
        mesh_of(builder.write(tmp_path / "b.gltf", [{"attributes": {"POSITION": empty}}]))


@pytest.mark.parametrize(("weights", "top"), [(None, 1.0), ([1.0], 5.0), ([0.5], 3.0)])
@pytest.mark.parametrize("owner", ["mesh", "node"])
def test_morph_targets_at_their_weights(
    tmp_path: Path, weights: list[float] | None, top: float, owner: str
) -> None:
    builder = GltfBuilder()
    moves = np.float32([[0, 0, 0], [0, 0, 0], [0, 4, 0], [0, 4, 0]])
    quad = builder.quad(targets=[{"POSITION": builder.accessor(moves)}])
    given_weights = {} if weights is None else {"weights": weights}
    nodes = [{"mesh": 0, **(given_weights if owner == "node" else {})}]
    meshes = [{"primitives": [quad], **(given_weights if owner == "mesh" else {})}]
    path = builder.write(tmp_path / "a.gltf", [], nodes=nodes, meshes=meshes)
    assert mesh_of(path).bounds[1, 1] == pytest.approx(top)


def test_skins_at_rest_and_bent(tmp_path: Path) -> None:
    """The lower edge hangs on a joint at the origin, the upper one on a joint that is moved and turned; the
    node's own placement counts for nothing."""
    builder = GltfBuilder()
    joints = np.uint8([[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]])
    weights = np.float32([[1, 0, 0, 0]] * 4)
    quad = builder.quad()
    quad["attributes"] |= {"JOINTS_0": builder.accessor(joints), "WEIGHTS_0": builder.accessor(weights)}
    inverse = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    inverse[1, 3, :3] = [0, -1, 0]  # column by column: a move down by one
    turned = [0, math.sin(math.pi / 4), 0, math.cos(math.pi / 4)]
    path = builder.write(
        tmp_path / "a.gltf",
        [quad],
        nodes=[
            {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"children": [2]},
            {"translation": [0, 3, 0], "rotation": turned},
        ],
        skins=[{"joints": [1, 2], "inverseBindMatrices": builder.accessor(inverse.reshape(2, 16))}],
        scenes=[{"nodes": [0, 1]}],
    )
    mesh = mesh_of(path)
    # A quarter turn about y takes x to -z.
    expected = np.float32([[-1, -1, 0], [1, -1, 0], [0, 3, -1], [0, 3, 1]])
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)


def test_a_quarter_of_a_weight(tmp_path: Path) -> None:
    """Weights are normalised bytes, and the joints share a vertex."""
    builder = GltfBuilder()
    joints = np.uint8([[0, 1, 0, 0]] * 4)
    weights = np.uint8([[192, 63, 0, 0]] * 4)
    quad = builder.quad()
    quad["attributes"] |= {
        "JOINTS_0": builder.accessor(joints), "WEIGHTS_0": builder.accessor(weights, normalized=True),
    }  # fmt: skip
    path = builder.write(
        tmp_path / "a.gltf", [quad], nodes=[{"mesh": 0, "skin": 0}, {}, {"translation": [0, 0, 255]}],
        skins=[{"joints": [1, 2]}], scenes=[{"nodes": [0, 1, 2]}],
    )  # fmt: skip
    np.testing.assert_allclose(mesh_of(path).vertices, QUAD + np.float32([0, 0, 63]), atol=1e-4)


@pytest.mark.parametrize(
    ("skin", "message"),
    [
        ({"joints": []}, "joints: are none"),
        ({"joints": [7]}, "not among the nodes"),
        ({"joints": [1]}, "JOINTS_0: go to 1 of 1"),
        ({"joints": [1, 1], "inverseBindMatrices": 0}, "type: has 3 components; 16 are needed"),
        (None, "skins: has 1 entries, none is number 3"),
    ],
)
def test_damaged_skins_are_one_line(tmp_path: Path, skin: dict[str, Any] | None, message: str) -> None:
    builder = GltfBuilder()
    quad = builder.quad()
    quad["attributes"] |= {
        "JOINTS_0": builder.accessor(np.uint8([[0, 1, 0, 0]] * 4)),
        "WEIGHTS_0": builder.accessor(np.float32([[1, 0, 0, 0]] * 4)),
    }
    nodes = [{"mesh": 0, "skin": 3 if skin is None else 0}, {}]
    path = builder.write(tmp_path / "a.gltf", [quad], nodes=nodes, skins=[skin or {"joints": [1]}])
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{message}[^\n]*$"):
        mesh_of(path)


def test_a_skin_without_joints_leaves_its_mesh_at_its_node(tmp_path: Path) -> None:
    builder = GltfBuilder()
    nodes = [{"mesh": 0, "skin": 0, "translation": [5, 0, 0]}, {}]
    path = builder.write(tmp_path / "a.gltf", [builder.quad()], nodes=nodes, skins=[{"joints": [1]}])
    np.testing.assert_allclose(mesh_of(path).vertices, QUAD + np.float32([5, 0, 0]))


def test_draco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    draco = pytest.importorskip("DracoPy")
    ball = trimesh.creation.icosphere(subdivisions=2)
    code = draco.encode(ball.vertices.astype(np.float32), ball.faces.astype(np.uint32), quantization_bits=16)
    unique = draco.decode(code).attributes[0]["unique_id"]
    builder = GltfBuilder()
    builder.view(code)
    count, faces = len(ball.vertices), ball.faces.size
    builder.accessors = [
        {"componentType": 5126, "count": count, "type": "VEC3"},
        {"componentType": 5125, "count": faces, "type": "SCALAR"},
    ]
    extension = {"bufferView": 0, "attributes": {"POSITION": unique}}
    primitive = {
        "attributes": {"POSITION": 0}, "indices": 1,
        "extensions": {"KHR_draco_mesh_compression": extension},
    }  # fmt: skip
    path = builder.write(tmp_path / "a.glb", [primitive], extensionsRequired=["KHR_draco_mesh_compression"])
    mesh = mesh_of(path)
    assert len(mesh.faces) == len(ball.faces) and area(mesh) == pytest.approx(ball.area, rel=1e-3)
    # Stored uncompressed beside it, it is read without the library.
    plain = builder.quad(extensions={"KHR_draco_mesh_compression": extension})
    both = builder.write(tmp_path / "b.glb", [plain], extensionsUsed=["KHR_draco_mesh_compression"])
    without(monkeypatch, "DracoPy")
    assert area(mesh_of(both)) == pytest.approx(4)
    del mesh
    with pytest.raises(InputError, match="Draco; `pip install DracoPy`, or export it uncompressed"):
        mesh_of(builder.write(tmp_path / "c.glb", [primitive]))


def compressed(folder: Path, code: bytes) -> Path:
    """A file of a triangle that Draco is said to have compressed to that."""
    builder = GltfBuilder()
    builder.view(code)
    builder.accessors = [
        {"componentType": 5126, "count": 3, "type": "VEC3"},
        {"componentType": 5125, "count": 3, "type": "SCALAR"},
    ]
    extension = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": extension}
    return builder.write(folder / "a.glb", [primitive], extensionsRequired=list(extension))


@pytest.mark.parametrize("sequential", [False, True])
def test_memory_of_draco_is_bounded_before_it_is_taken(tmp_path: Path, sequential: bool) -> None:
    """Both of its encodings, whose counts of points and faces are read as the library reads them."""
    draco = pytest.importorskip("DracoPy")
    ball = trimesh.creation.icosphere(subdivisions=3)
    code = draco.encode(
        ball.vertices.astype(np.float32), ball.faces.astype(np.uint32), preserve_order=sequential
    )
    place = 11 if code[8] == 0 else 12
    assert code[8] == (0 if sequential else 1)
    first, place = compression._varint(memoryview(code), place)
    second, end = compression._varint(memoryview(code), place)
    counts = (len(ball.faces), len(ball.vertices))
    assert (first, second) == (counts if sequential else counts[::-1])
    many = code[:place] + b"\xff\xff\xff\xff\x0f" + code[end:]
    with pytest.raises(InputError, match=r"promises 4,294,9\d\d,\d{3} points and faces in \d+ bytes"):
        mesh_of(compressed(tmp_path, many))


def without(monkeypatch: pytest.MonkeyPatch, library: str) -> None:
    found = importlib.import_module

    def missing(name: str, package: str | None = None) -> Any:
        if name == library:
            raise ImportError(name)
        return found(name, package)

    monkeypatch.setattr("incpt.formats.gltf.compression.import_module", missing)


def test_meshopt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meshopt = pytest.importorskip("meshopt")
    rows = np.zeros((4, 4), np.float32)
    rows[:, :3] = QUAD
    codes = [
        (meshopt.encode_gltf_buffer(rows, "ATTRIBUTES"), 16, 4, "ATTRIBUTES"),
        (meshopt.encode_gltf_buffer(QUAD_FACES.astype(np.uint32), "TRIANGLES"), 4, 6, "TRIANGLES"),
    ]
    content = b"".join(code + bytes(-len(code) % 4) for code, *_ in codes)
    views, first = [], 0
    for code, stride, count, mode in codes:
        extension = {
            "buffer": 0, "byteOffset": first, "byteLength": len(code), "byteStride": stride, "count": count,
            "mode": mode,
        }  # fmt: skip
        extensions = {"EXT_meshopt_compression": extension}
        views.append({"buffer": 1, "byteLength": stride * count, "extensions": extensions})
        first += len(code) + -len(code) % 4
    builder = GltfBuilder()
    builder.views = views
    position, faces = builder.accessor(QUAD, bufferView=0), builder.accessor(QUAD_FACES, bufferView=1)
    builder.accessors[faces]["componentType"] = 5125
    fallback = {"byteLength": 100, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    document = builder.document(
        [{"attributes": {"POSITION": position}, "indices": faces}],
        buffers=[{"byteLength": len(content)}, fallback],
        extensionsRequired=["EXT_meshopt_compression"],
    )
    path = write_document(tmp_path / "a.gltf", document, content)
    np.testing.assert_allclose(corners(mesh_of(path)), CORNERS)
    views[0]["extensions"]["EXT_meshopt_compression"]["count"] = 1 << 30
    with pytest.raises(InputError, match=r"has 1073741824 values in \d+ bytes; the file is damaged"):
        mesh_of(write_document(tmp_path / "b.gltf", document, content))
    without(monkeypatch, "meshopt")
    views[0]["extensions"]["EXT_meshopt_compression"]["count"] = 4
    with pytest.raises(InputError, match=r"by meshopt; `pip install incpt\[gltf\]`"):
        mesh_of(write_document(tmp_path / "c.gltf", document, content))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 10**15, "bufferView": None}, "claims 1000000000000000 values without storing them"),
        ({"count": 10**6, "bufferView": None}, "claims 1000000 values without storing them"),
        ({"count": 3000}, r"has 3000 values to byte 36000 of a view of 48 bytes"),
        ({"count": -3}, "count: -3 is out of range"),
        ({"count": 0}, "count: 0 is out of range"),
        ({"count": "four"}, "count: 'four' is no whole number"),
        ({"bufferView": 7}, "bufferViews: has 2 entries, none is number 7"),
        ({"bufferView": -1}, "bufferView: -1 is out of range"),
        ({"byteOffset": 40}, "to byte 88 of a view of 48 bytes"),
        ({"type": "VEC2"}, "has 2 components; 3 are needed"),
        ({"type": "MAT3"}, "'MAT3' is none of SCALAR"),
        ({"componentType": 5124}, "componentType: 5124 is none of 5120"),
        ({"sparse": {"count": 9}}, "sparse.count: 9 is out of range; 1 to 4"),
    ],
)
def test_damaged_accessors_are_one_line(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    builder = GltfBuilder()
    quad = builder.quad()
    builder.accessors[0] |= change
    if builder.accessors[0]["bufferView"] is None:
        del builder.accessors[0]["bufferView"]
    path = builder.write(tmp_path / "a.gltf", [quad])
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{message}[^\n]*$"):
        mesh_of(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"buffers": [{"byteLength": 1 << 40}]}, "says that it has 1099511627776 bytes, but has 60"),
        ({"buffers": [{"byteLength": 20}]}, "reaches to byte 48 of a buffer of 20"),
        ({"bufferViews": [{"buffer": 5, "byteLength": 48}] * 2}, "buffers: has 1 entries, none is number 5"),
        ({"nodes": [{"mesh": 3}]}, "meshes: has 1 entries, none is number 3"),
        ({"meshes": 7}, "meshes: 7 is no list"),
        ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "have no POSITION"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 9}]}]}, "mode: 9 is out of"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]}, "materials: has 0"),
    ],
)
def test_damaged_files_are_one_line(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    builder = GltfBuilder()
    path = builder.write(tmp_path / "a.glb", [builder.quad()], **change)
    with pytest.raises(InputError, match=rf"^{path}: [^\n]*{message}[^\n]*$"):
        mesh_of(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1),
    dtype=st.sampled_from(["float32", "uint16", "uint8", "int8", "int16"]),
    is_normalized=st.booleans(),
    padding=st.integers(0, 3),
    index=st.sampled_from(["uint8", "uint16", "uint32"]),
)
def test_accessors_and_placements_as_trimesh_reads_them(
    tmp_path: Path, seed: int, dtype: str, is_normalized: bool, padding: int, index: str
) -> None:
    """Random vertices of any type, in rows with gaps, under a chain of two random nodes."""
    random = np.random.default_rng(seed)
    kind = np.dtype(dtype)
    scale = 1 if kind.kind == "f" else np.iinfo(kind).max
    values = (random.uniform(-1 if kind.kind != "u" else 0, 1, (12, 3)) * scale).astype(kind)
    builder = GltfBuilder()
    size = -(-kind.itemsize * 3 // 4) * 4 + 4 * padding
    rows = np.zeros((12, size), np.uint8)
    rows[:, : kind.itemsize * 3] = values.view(np.uint8).reshape(12, -1)
    view = builder.view(rows.tobytes(), byteStride=size)
    is_normalized = is_normalized and kind.kind != "f"
    position = builder.accessor(values, bufferView=view, normalized=is_normalized)
    faces = builder.accessor(random.permutation(12).astype(index))
    nodes = [
        {
            "translation": random.normal(size=3).tolist(), "rotation": unit(random.normal(size=4)),
            "scale": random.uniform(-2, 2, 3).tolist(), "children": [1],
        },
        {"mesh": 0, "matrix": affine(random)},
    ]  # fmt: skip
    path = builder.write(
        tmp_path / "a.glb", [{"attributes": {"POSITION": position}, "indices": faces}], nodes=nodes
    )
    ours = corners(mesh_of(path))
    scene = trimesh.load_scene(path, process=False)
    # trimesh takes normalised whole numbers as they are stored.
    (geometry,) = scene.geometry.values()
    (node,) = scene.graph.nodes_geometry
    stored = np.float64(geometry.vertices)
    if is_normalized:
        stored = np.maximum(stored / scale, -1)
    theirs = trimesh.transform_points(stored, scene.graph.get(node)[0])[geometry.faces]
    if np.linalg.det(scene.graph.get(node)[0]) < 0:
        theirs = theirs[:, ::-1]
    # Faces without area are left out here; random ones have some.
    assert len(ours) == len(theirs)
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-4 * np.abs(theirs).max())


def unit(values: npt.NDArray[np.float64]) -> list[float]:
    length = float(np.linalg.norm(values))
    return (values / length).tolist() if length > 1e-6 else [0.0, 0.0, 0.0, 1.0]


def affine(random: np.random.Generator) -> list[float]:
    matrix = np.eye(4)
    matrix[:3] = random.normal(size=(3, 4))
    return matrix.T.ravel().tolist()


@given(st.integers(0, 2**32 - 1))
def test_quaternions_turn_as_trimesh_says(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, y, z, w = quaternion = random.normal(size=4)
    ours = composed(np.zeros(3), quaternion, np.ones(3))
    np.testing.assert_allclose(ours, trimesh.transformations.quaternion_matrix([w, x, y, z]), atol=1e-9)
