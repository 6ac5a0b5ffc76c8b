"""STL files: text and bytes told apart by their content, shared vertices, colours of facets."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from incpt.core.errors import InputError
from incpt.formats import import_report, mesh_files, registry
from incpt.formats.import_report import Fate
from incpt.formats.welding import welded
from incpt.scene.mesh import Mesh

FACETS = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [-0.0, 1, 0]]], np.float32)
UP = (0.0, 0.0, 1.0)


def in_bytes(
    header: bytes = b"", attributes: tuple[int, ...] = (0, 0), normal: tuple[float, ...] = UP
) -> bytes:
    rows = (struct.pack("<12fH", *normal, *f.ravel(), a) for f, a in zip(FACETS, attributes, strict=True))
    return header.ljust(80, b"\0") + struct.pack("<I", 2) + b"".join(rows)


def in_text(name: str = "a part", facets: np.ndarray = FACETS) -> str:
    def facet(corners: np.ndarray) -> str:
        vertices = "".join("   vertex {:g} {:g} {:g}\n".format(*corner) for corner in corners)
        return f" facet normal 0 0 1\n  outer loop\n{vertices}  endloop\n endfacet\n"

    return f"solid {name}\n{''.join(map(facet, facets))}endsolid {name}\n"


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "a.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def mesh_of(folder: Path, content: str | bytes) -> Mesh:
    return mesh_files.load_mesh(written(folder, content))


def told(path: Path, fate: Fate = Fate.LEFT_OUT) -> list[str]:
    return [remark.text for remark in registry.load_with_report(path)[1].of(fate)]


@pytest.mark.parametrize(
    "content",
    [
        in_bytes(),
        in_bytes(b"solid in bytes, with a facet"),
        in_text(),
        in_text().upper(),
        in_text().replace("\n", "\r\n").replace(" ", "\t"),
        " \n" + in_text("").replace("endsolid", "EndSolid"),
        in_text().replace("endsolid a part\n", ""),
    ],
)
def test_text_and_bytes_give_the_same_mesh_with_shared_vertices(tmp_path: Path, content: str | bytes) -> None:
    mesh = mesh_of(tmp_path, content)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert mesh.normals is None and mesh.colors is None
    assert told(tmp_path / "a.stl") == told(tmp_path / "a.stl", Fate.CHANGED) == []


def test_several_solids_are_parts(tmp_path: Path) -> None:
    path = written(
        tmp_path, in_text("left") + in_text("right side", FACETS + np.float32(3)) + in_text("left")
    )
    parts = {part.name: part.mesh for part in mesh_files.load_parts(path)}
    assert list(parts) == ["left", "right side", "left.2"]
    assert parts["right side"].vertices.min() == 3
    assert mesh_files.load_mesh(path, "right side") is parts["right side"]


def test_facets_of_other_than_three_vertices(tmp_path: Path) -> None:
    text = in_text().replace("   vertex 1 0 0\n", "   vertex 1 0 0\n   vertex 1 0.5 0\n", 1)
    text = text.replace("   vertex 0 1 0\n", "").replace("vertex -0 1 0", "vertex 0,5 1 0")
    path = written(tmp_path, text.replace("endsolid a part", "facet normal 0 0 1 outer loop vertex 0 0 0"))
    assert told(path) == [
        "the last facet of solid 'a part': the file ends within it",
        "1 of 3 faces: 1 with a vertex that is not finite or too far away",
    ]
    path = written(tmp_path, in_text() + in_text("b").replace("   vertex 1 1 0\n", ""))
    assert told(path) == ["2 of 4 faces: 2 with fewer than three corners"]


RED, GREEN = 31, 31 << 5


@pytest.mark.parametrize(
    ("header", "attributes", "expected"),
    [
        (b"", (1 << 15 | RED << 10, 1 << 15 | GREEN), [[1, 0, 0], [0, 1, 0]]),
        (b"", (1 << 15 | 16, 0), [[0, 0, 0.22927], [0.8, 0.8, 0.8]]),
        (b"COLOR=\x80\xff\0\xff", (RED, GREEN), [[1, 0, 0], [0, 1, 0]]),
        (b"COLOR=\x80\xff\0\xff", (16 << 10, 1 << 15), [[0, 0, 0.22927], [0.21586, 1, 0]]),
    ],
)
def test_colours_of_viscam_and_magics(
    tmp_path: Path, header: bytes, attributes: tuple[int, int], expected: list[list[float]]
) -> None:
    (part,) = mesh_files.load_file(written(tmp_path, in_bytes(header, attributes))).parts
    assert part.mesh.colors is not None and part.material is not None
    for corner in range(3):
        np.testing.assert_allclose(part.mesh.colors[:, corner, :3], expected, atol=1e-4)
    assert part.material.base_color == (1, 1, 1) and part.material.alpha_mode == "opaque"


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    assert told(written(tmp_path, in_bytes(attributes=(5, 0)) + b"behind")) == [
        "6 bytes behind the last facet: the file counts 2",
        "the 16 bits of 1 facet: are no colours of VisCAM or Magics",
    ]
    magics = in_bytes(b"COLOR=\xff\xff\xff\xffMATERIAL=\1\1\1\1")
    assert told(written(tmp_path, magics)) == [
        "the material of the header: says how shiny Magics shows the file"
    ]
    turned = told(written(tmp_path, in_bytes(normal=(0, 0, -1))), Fate.CHANGED)
    assert turned == ["normals of 2 facets: point inwards by the order of the vertices, which counts"]


def test_a_file_that_ends_early(tmp_path: Path) -> None:
    for content in (in_bytes()[:-1], in_bytes()[:83]):
        with pytest.raises(InputError, match="it ends within its facets"):
            mesh_of(tmp_path, content)


def test_welding_keeps_the_order_and_what_is_not_finite() -> None:
    nan = float("nan")
    corners = np.array([[3, 0, 0], [0, 1, 0], [-0.0, 1, 0], [nan, 0, 0], [3, 0, 0], [0, 0, 0]], np.float32)
    vertices, numbers = welded(corners)
    assert numbers.tolist() == [0, 1, 1, 2, 0, 3]
    np.testing.assert_array_equal(vertices, corners[[0, 1, 3, 5]])
    rng = np.random.default_rng(5)
    many = rng.integers(0, 9, (5000, 3)).astype(np.float32)
    vertices, numbers = welded(many)
    assert len(vertices) == len(np.unique(many, axis=0))
    np.testing.assert_array_equal(vertices[numbers], many)
    with import_report.gathered():
        assert welded(np.zeros((0, 3), np.float32))[0].shape == (0, 3)
