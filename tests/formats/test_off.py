"""OFF files: what their first word promises, colours of vertices and faces, and what is damaged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from incpt.core.errors import InputError
from incpt.formats import mesh_files, registry
from incpt.formats.import_report import Fate
from incpt.scene.mesh_part import MeshPart

SQUARE = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


def off(word: str, vertices: list[str], faces: list[str]) -> str:
    return "\n".join([word, f"{len(vertices)} {len(faces)} 0", *vertices, *faces, ""])


def part_of(folder: Path, text: str) -> MeshPart:
    (folder / "a.off").write_text(text)
    (part,) = mesh_files.load_file(folder / "a.off").parts
    return part


def told(folder: Path) -> list[str]:
    return [remark.text for remark in registry.load_with_report(folder / "a.off")[1].of(Fate.LEFT_OUT)]


@pytest.mark.parametrize(
    "text",
    [
        off("OFF", SQUARE, ["3 0 1 2", "3 0 2 3"]),
        off("OFF", SQUARE, ["4 0 1 2 3"]),
        off("OFF", SQUARE, ["3 0 1 2", "3 0 2 3"]).replace("OFF\n", "OFF"),
        off("OFF", SQUARE, ["3 0 1 2", "3 0 2 3"]).replace("OFF\n", "# A square\n\n"),
        off("OFF # text", SQUARE, ["4 0 1 2 3 # all"]).replace("\n", "\r\n\r\n\t "),
    ],
)
def test_ways_of_writing(tmp_path: Path, text: str) -> None:
    mesh = part_of(tmp_path, text).mesh
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.colors is None
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert told(tmp_path) == []


@pytest.mark.parametrize(
    ("word", "rest"),
    [
        ("COFF", "255 0 128 51"),
        ("COFF", "1 0 0.50196 0.2"),
        ("OFF", "255 0 128 51"),
        ("COFF", "255 0 128"),
        ("NCOFF", "255 0 128 51"),
        ("STCNOFF", "0 0 2 255 0 128 51 0.25 0.75"),
    ],
)
def test_what_vertices_have(tmp_path: Path, word: str, rest: str) -> None:
    text = off(word, [f"{v} {rest}" for v in SQUARE], ["4 0 1 2 3"])
    if word == "NCOFF":  # None of Geomview's words: the parts of one have their order.
        with pytest.raises(InputError, match="does not begin with its counts"):
            part_of(tmp_path, text)
        return
    part, alpha = part_of(tmp_path, text), 1.0 if rest.count(" ") == 2 else 0.2
    assert part.mesh.colors is not None and part.material is not None
    np.testing.assert_allclose(part.mesh.colors[0, 0], [1, 0, 0.21586, alpha], atol=1e-4)
    assert part.material.base_color == (1, 1, 1)
    assert part.material.alpha_mode == ("opaque" if alpha == 1 else "blend")
    if "N" in word:
        assert part.mesh.normals is not None and (part.mesh.normals == [0, 0, 1]).all()
        assert (part.mesh.uvs[0] == [0.25, 0.25]).all()


def test_colours_of_faces(tmp_path: Path) -> None:
    part = part_of(
        tmp_path, off("OFF", SQUARE, ["3 0 1 2 255 0 0", "3 0 2 3 0 0 255 51", "3 2 1 0", "3 3 2 0 7"])
    )
    assert part.mesh.colors is not None
    expected = [[1, 0, 0, 1], [0, 0, 1, 0.2], [0.8, 0.8, 0.8, 1], [0.8, 0.8, 0.8, 1]]
    np.testing.assert_allclose(part.mesh.colors[:, 0], expected, atol=1e-6)
    assert told(tmp_path) == ["colours of 1 face: are numbers of a list of colours"]
    part_of(tmp_path, off("COFF", [f"{v} 1 1 1 1" for v in SQUARE], ["3 0 1 2 0 0 1"]))
    assert told(tmp_path) == ["colours of faces: those of vertices are used"]


def test_damage_is_told(tmp_path: Path) -> None:
    faces = ["4 0 1 2 3", "4 0 1 2", "3 0 1 9", "x 0 1 2", "2 0 1"]
    part_of(tmp_path, off("OFF", [f"{v} 5" for v in SQUARE], faces) + "3 0 1 2\n")
    assert told(tmp_path) == [
        "1 line behind the last face: the file counts fewer",
        "1 numbers behind each position: the first word names none",
        "2 faces: a line ends before its last corner",
        "4 of 6 faces: 3 with fewer than three corners, 1 with an index out of range",
    ]


def test_control_characters_are_no_blanks(tmp_path: Path) -> None:
    part_of(tmp_path, off("OFF", SQUARE, ["3 0 1 2", "3 0 \1 2", "\0", "3 0 2 3"]))
    assert told(tmp_path) == [
        "1 face: a line ends before its last corner",
        "2 of 4 faces: 1 with fewer than three corners, 1 with an index out of range",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("4OFF\n1 1 1\n", "of another dimension"),
        ("nOFF\n4\n1 1 1\n", "of another dimension"),
        ("OFF BINARY\n\1\2", "in bytes; save it as text"),
        ("OFF\n", "does not begin with its counts"),
        ("OFF\n4000000000 4000000000 0\n0 0 0\n", "fewer lines than it counts"),
        ("OFF\n3 1 0\n0 0 0\n0 0\n0 1 0\n3 0 1 2\n", "vertices have not as many numbers each"),
        ("OFF\n0 1 0\n3 0 1 2\n", "vertices have not as many numbers each"),
    ],
)
def test_no_mesh_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part_of(tmp_path, text)
