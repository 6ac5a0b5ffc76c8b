"""PLY files: what each encoding, type, order and name of properties becomes, and what is said of the rest."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.core.errors import InputError
from incpt.formats import import_report, mesh_files, registry
from incpt.formats.import_report import Fate
from incpt.formats.ply.header import Element, Property, read_header
from incpt.formats.ply.rows import BinaryBody, Rows, TextBody, read_rows
from incpt.scene.mesh import Mesh

Row = Sequence[object]
_CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
_CODES |= {"float": "f", "double": "d"}
XYZ = ("float x", "float y", "float z")
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
DIFFUSE = ("uchar diffuse_red", "uchar diffuse_green", "uchar diffuse_blue")
FACES = ("list uchar int vertex_indices",)


def ply(encoding: str, *elements: tuple[str, Sequence[str], Sequence[Row]], comments: str = "") -> bytes:
    """The bytes of a file. A property is as in the header; a row has a list where the property is one."""
    header = f"ply\nformat {encoding} 1.0\n{comments}"
    body = b""
    order = ">" if encoding == "binary_big_endian" else "<"
    for name, properties, rows in elements:
        header += f"element {name} {len(rows)}\n" + "".join(f"property {one}\n" for one in properties)
        for row in rows:
            words: list[str] = []
            for one, value in zip(properties, row, strict=True):
                *kinds, _ = one.removeprefix("list ").split()
                values = list(value) if isinstance(value, list | tuple) else [value]
                counted = [len(values), *values] if len(kinds) == 2 else values
                codes = [_CODES[kinds[0]], *[_CODES[kinds[-1]]] * len(values)][-len(counted) :]
                words += map(str, counted)
                if encoding != "ascii":
                    body += struct.pack(order + "".join(codes), *counted)
            if encoding == "ascii":
                body += (" ".join(words) + "\n").encode()
    return f"{header}end_header\n".encode() + body


def written(folder: Path, content: bytes, name: str = "a.ply") -> Path:
    (folder / name).write_bytes(content)
    return folder / name


def mesh_of(folder: Path, content: bytes) -> Mesh:
    with import_report.gathered():
        return mesh_files.load_mesh(written(folder, content))


def told(path: Path, fate: Fate = Fate.LEFT_OUT) -> list[str]:
    return [remark.text for remark in registry.load_with_report(path)[1].of(fate)]


ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_any_order_and_type_of_properties(tmp_path: Path, encoding: str) -> None:
    vertices = [
        (7, 1, 0.0, 255, 0.0, 0.0, 0, 51),
        (7, 1, 1.0, 255, 0.0, 0.0, 0, 51),
        (7, 1, 1.0, 255, 2.0, 0.0, 0, 51),
        (7, 1, 0.0, 255, 2.0, 0.0, 0, 51),
        (7, 1, 0.0, 255, 4.0, 0.0, 0, 51),
    ]
    properties = (
        "char charge", "short nz", "double x", "uchar red", "float y", "double z", "ushort nx", "uchar blue",
    )  # fmt: skip
    faces = [([9, 9], 1, [0, 1, 2]), ([], 2, [0, 2, 3, 4]), ([8], 3, [2, 1, 0])]
    content = ply(
        encoding,
        ("vertex", properties, vertices),
        ("edge", ("int vertex1",), [(1,)]),
        ("face", ("list int short groups", "uint area", "list ushort uint vertex_index"), faces),
    )
    mesh, path = mesh_of(tmp_path, content), tmp_path / "a.ply"
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [2, 1, 0]], (
        "the fourth corner of the quad is in line"
    )
    assert mesh.vertices.tolist() == [[v[2], v[4], v[5]] for v in vertices]
    assert mesh.normals is None and mesh.colors is None, "two of three are neither normals nor colours"
    assert told(path) == [
        "properties of 'vertex' (charge, nz, red, nx, blue): nothing here is like them",
        "1 row of 'edge': the element is not known",
        "properties of 'face' (groups, area): nothing here is like them",
        "1 of 4 faces: 1 with zero area",
    ]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_triangles_and_quads_mixed(tmp_path: Path, encoding: str) -> None:
    rows = [([0, 1, 2],), ([0, 1, 2, 3],), ([0, 2, 3],), ([],), ([3, 2, 1, 0],), ([1, 2],)]
    path = written(tmp_path, ply(encoding, ("vertex", XYZ, SQUARE), ("face", FACES, rows)))
    assert mesh_files.load_mesh(path).faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]
    assert told(path) == ["4 of 8 faces: 2 with fewer than three corners, 2 that come twice"]


def test_concave_faces_keep_their_notches(tmp_path: Path) -> None:
    u = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (2, 3, 0), (2, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
    mesh = mesh_of(tmp_path, ply("ascii", ("vertex", XYZ, u), ("face", FACES, [(list(range(8)),)])))
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(float) for i in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(7)


def test_a_polygon_with_a_corner_that_is_not_there_goes_as_a_whole(tmp_path: Path) -> None:
    rows = [([0, 1, 2, 3],), ([0, 1, 2, 77],), ([0, -1, 2],)]
    path = written(tmp_path, ply("binary_little_endian", ("vertex", XYZ, SQUARE), ("face", FACES, rows)))
    assert told(path) == ["3 of 5 faces: 3 with an index out of range"]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_strips(tmp_path: Path, encoding: str) -> None:
    points = [(x, y, 0) for x in range(4) for y in range(2)]
    strips = [([0, 2, 1, 3, -1, 4, 6, 5],), ([4, 6, 5, 7, -1],), ([-1, -1, 2, 4],)]
    content = ply(encoding, ("vertex", XYZ, points), ("tristrips", ("list int int vertex_indices",), strips))
    mesh = mesh_of(tmp_path, content)
    assert mesh.faces.tolist() == [[0, 2, 1], [2, 3, 1], [4, 6, 5], [6, 7, 5]]
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize(
    ("properties", "value", "expected"),
    [
        (("uchar red", "uchar green", "uchar blue"), (255, 0, 128), (1, 0, 0.21586, 1)),
        (DIFFUSE, (255, 0, 128), (1, 0, 0.21586, 1)),
        (("ushort red", "ushort green", "ushort blue"), (65535, 0, 32896), (1, 0, 0.21586, 1)),
        (("float red", "float green", "float blue"), (1, 0, 0.5), (1, 0, 0.5, 1)),
        (("float r", "float g", "float b", "float a"), (2, 0.25, 0.5, 0.75), (1, 0.25, 0.5, 0.75)),
        (("uchar alpha", "uchar blue", "uchar green", "uchar red"), (51, 0, 0, 255), (1, 0, 0, 0.2)),
    ],
)  # fmt: skip
def test_colours(tmp_path: Path, properties: Sequence[str], value: Row, expected: Row) -> None:
    corners = [(*corner, *value) for corner in SQUARE]
    content = ply(
        "binary_big_endian", ("vertex", (*XYZ, *properties), corners), ("face", FACES, [([0, 1, 2],)])
    )
    path = written(tmp_path, content)
    (part,) = mesh_files.load_file(path).parts
    assert part.mesh.colors is not None and part.material is not None
    np.testing.assert_allclose(part.mesh.colors, np.broadcast_to(expected, (1, 3, 4)), atol=1e-5)
    # What has colours is not grey below them, and shows what is behind it where they say so.
    assert part.material.base_color == (1, 1, 1)
    assert part.material.alpha_mode == ("opaque" if expected[3] == 1 else "blend")
    assert len(told(path, Fate.CHANGED)) == (value[0] == 2), "what is above 1 is told"


@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v"])
def test_texture_coordinates_of_vertices_begin_at_the_bottom(tmp_path: Path, names: str) -> None:
    u, v = names.split()
    corners = [(*corner, corner[0], 0.25) for corner in SQUARE]
    content = ply(
        "ascii", ("vertex", (*XYZ, f"float {u}", f"float {v}"), corners), ("face", FACES, [([0, 1, 2],)])
    )
    assert mesh_of(tmp_path, content).uvs[0].tolist() == [[[0, 0.75], [1, 0.75], [1, 0.75]]]


def test_texture_coordinates_and_colours_of_faces(tmp_path: Path) -> None:
    faces = [
        ([0, 1, 2, 3], [0.5, 0, 1, 0, 1, 1, 0, 1], 255, 0, 0),
        ([2, 1, 0], [], 0, 255, 0),
        ([3, 1, 0], [0.5, 0.5, 0.25], 0, 0, 255),
    ]
    properties = (*FACES, "list uchar float texcoord", "uchar red", "uchar green", "uchar blue")
    path = written(
        tmp_path, ply("binary_little_endian", ("vertex", XYZ, SQUARE), ("face", properties, faces))
    )
    mesh = mesh_files.load_mesh(path)
    assert mesh.uvs[0].tolist() == [
        [[0.5, 1], [1, 1], [1, 0]], [[0.5, 1], [1, 0], [0, 0]], [[0, 1]] * 3, [[0, 1]] * 3
    ]  # fmt: skip
    assert mesh.colors is not None
    assert mesh.colors[:, 0, :3].tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert told(path) == ["texture coordinates of 1 face: are not two for each corner"]


def test_images_that_comments_name(tmp_path: Path) -> None:
    PIL.Image.new("RGB", (1, 1), (255, 0, 0)).save(tmp_path / "red.png")
    PIL.Image.new("RGB", (1, 1), (0, 255, 0)).save(tmp_path / "green one.png")
    uvs = [0.0] * 6
    faces = [([0, 1, 2], uvs, 1), ([0, 2, 3], uvs, 0), ([2, 1, 0], uvs, -1), ([3, 2, 0], uvs, 2)]
    comments = "".join(f"comment TextureFile {n}\n" for n in ("red.png", "green one.png", "gone.png"))
    properties = (*FACES, "list uchar float texcoord", "int texnumber")
    content = ply("ascii", ("vertex", XYZ, SQUARE), ("face", properties, faces), comments=comments)
    path = written(tmp_path, content)
    parts = {part.name: part for part in mesh_files.load_file(path).parts}
    shown = {
        name: None if part.material is None or part.material.base_color_texture is None
        else part.material.base_color_texture.bitmap.pixels[0, 0].tolist()
        for name, part in parts.items()
    }  # fmt: skip
    assert shown == {"image -1": None, "image 0": [255, 0, 0], "image 1": [0, 255, 0], "image 2": None}
    assert [len(part.mesh.vertices) for part in parts.values()] == [3] * 4
    (lost,) = told(path)
    assert lost.startswith("image gone.png: ") and lost.endswith("no such file; check the path")
    outside = written(tmp_path, content.replace(b"gone.png", b"../gone.png"), "b.ply")
    assert "leads out of the folder" in told(outside)[0]
    odd = written(tmp_path, content.replace(b"gone.png", b"go\0ne.png"), "c.ply")
    assert told(odd) == ["image go?ne.png: 'go\\x00ne.png' is no name of a file"]


def test_ends_of_lines(tmp_path: Path) -> None:
    content = ply("ascii", ("vertex", XYZ, SQUARE), ("face", FACES, [([0, 1, 2],)]))
    for end in (b"\r\n", b"\r"):
        assert mesh_of(tmp_path, content.replace(b"\n", end)).faces.tolist() == [[0, 1, 2]]
    corners = [(10, 0, 0), (1, 0, 0), (0, 1, 0)]
    rows = ("vertex", ("uchar x", *XYZ[1:]), corners), ("face", FACES, [([0, 1, 2],)])
    content = ply("binary_little_endian", *rows)
    head, tail = content.split(b"end_header\n")
    # Also where the last line of the header alone ends otherwise.
    assert mesh_of(tmp_path, head + b"end_header\r\n" + tail).vertices[:, 0].tolist() == [10, 1, 0]
    for end in (b"\n", b"\r\n", b"\r"):
        # The first byte of the rows is that of a line's end too.
        mesh = mesh_of(tmp_path, (head + b"end_header\n").replace(b"\n", end) + tail)
        assert mesh.vertices[:, 0].tolist() == [10, 1, 0]


def test_rows_that_are_not_lines_and_numbers_that_are_none(tmp_path: Path) -> None:
    content = ply("ascii", ("vertex", XYZ, SQUARE), ("face", FACES, [([0, 1, 2],), ([0, 2, 3],)]))
    head, tail = content.split(b"end_header\n")
    path = written(
        tmp_path, head + b"end_header\n" + tail.replace(b"\n", b" ").replace(b" ", b"\n\n") + b" 9 9"
    )
    assert len(mesh_files.load_mesh(path).faces) == 2
    assert told(path) == ["2 numbers behind the last element: the header names none"]
    older = content.replace(b"element vertex", b"Created by hand\nelement vertex")
    assert told(written(tmp_path, older, "older.ply")) == [
        "line 3: 'Created by hand' is no line of a PLY header"
    ]
    longer = written(tmp_path, content.replace(b"3 0 1 2", b"3 0 1 2 9 1 1 1"), "longer.ply")
    assert mesh_files.load_mesh(longer).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert told(longer) == ["numbers at the end of 1 row of 'face': the header names none"]
    last = written(tmp_path, content.replace(b"3 0 2 3", b"3 0 2 3 1 1"), "last.ply")
    assert told(last) == ["numbers at the end of 1 row of 'face': the header names none"]
    shorter = content.replace(b"3 0 1 2\n3 0 2 3", b"3 0 1 2 9\n3 0 2")
    with pytest.raises(InputError, match="it ends within the 2 rows of 'face'"):
        mesh_of(tmp_path, shorter)
    odd = written(tmp_path, content.replace(b"\n0 1 0\n", b"\n-1.#IND 1 0\n"), "odd.ply")
    assert told(odd) == ["1 of 2 faces: 1 with a vertex that is not finite or too far away"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"element face 1", b"element face 0", "is a cloud of 4 points without faces; make a surface"),
        (b"element face 1", b"element face 10000000000", "it ends within the 10,000,000,000 rows of 'face'"),
        (b"element vertex 4", b"element vertex 4000000000", "ends within the 4,000,000,000 rows of 'vertex'"),
        (b"element vertex 4", b"element vertex -4", "line 3: 'element vertex -4' is no line of a PLY header"),
        (b"element face 1", b"element face 1" + b"0" * 30, "line 7: .*more rows than any file can hold"),
        (b"float x", b"floaty x", "line 4: type 'floaty' is not known"),
        (b"float y", b"float x", "line 5: property 'x' stands twice in 'vertex'"),
        (b"float x", b"float w", "has no vertices with x, y and z"),
        (b"vertex_indices", b"corners", "has no list 'vertex_indices' in 'face'"),
        (b"list uchar int v", b"int v", "'vertex_indices' of 'face' is a number; it should be a list"),
        (b"property float x", b"property list uchar float x", "ends within"),
        (b"format binary_little_endian 1.0\n", b"", "its header names no format"),
        (b"binary_little_endian", b"binary", "line 2: format 'binary' is none of ascii"),
        (b"element vertex 4\n", b"", "line 3: property 'x' belongs to no element"),
        (b"end_header", b"end", "it has no header"),
    ],
)
def test_damaged_headers_are_named(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    content = ply("binary_little_endian", ("vertex", XYZ, SQUARE), ("face", FACES, [([0, 1, 2],)]))
    assert old in content
    path = written(tmp_path, content.replace(old, new))
    with pytest.raises(InputError, match=message):
        mesh_files.load_mesh(path)


_PROPERTY = st.tuples(st.sampled_from([*_CODES]), st.sampled_from([None, "uchar", "ushort", "int"]))


@given(st.data(), st.sampled_from(ENCODINGS), st.lists(_PROPERTY, min_size=1, max_size=4), st.integers(0, 5))
def test_rows_are_what_was_written(
    data: st.DataObject, encoding: str, kinds: list[tuple[str, str | None]], count: int
) -> None:
    """Whatever types and lists stand beside each other, alike in length or not."""
    small = st.integers(0, 100)
    longest = data.draw(st.integers(0, 3))
    lengths = st.integers(0, 3) if data.draw(st.booleans()) else st.just(longest)
    rows = [
        tuple(
            data.draw(small) if counter is None else [data.draw(small) for _ in range(data.draw(lengths))]
            for _, counter in kinds
        )
        for _ in range(count)
    ]
    names = [f"{kind} p{i}" if c is None else f"list {c} {kind} p{i}" for i, (kind, c) in enumerate(kinds)]
    content = ply(
        encoding, ("first", ("uchar one",), [(1,)]), ("some", names, rows), ("last", ("int z",), [(5,)])
    )
    header = read_header(content)
    (_, found, last), left = read_rows(header, content)
    assert left == 0
    if encoding == "ascii" and longest:
        body = TextBody(content, header.size)
        # Lists alone may be rows without a number but their counts.
        if body.take_lines(count + 2):
            found = Rows(header.elements[1], body, 1)
    for i, (_, counter) in enumerate(kinds):
        column = [row[i] for row in rows]
        if counter is None:
            assert found.numbers(f"p{i}").tolist() == column
        else:
            sizes, values = found.lists(f"p{i}")
            assert sizes.tolist() == [len(one) for one in column]
            assert values.tolist() == [value for one in column for value in one]
    assert last.numbers("z").tolist() == [5]


def test_counts_are_compared_with_the_bytes_before_memory_is_taken() -> None:
    start = b"ply\nformat binary_little_endian 1.0\nend_header\n"
    header = read_header(start)

    def end(element: Element, content: bytes) -> int:
        return Rows(element, BinaryBody(start + content, header.size, "<"), 0).end

    lists = [Property("b", "f8", "u4")]
    row = struct.pack("<Id", 1, 5.0)
    assert end(Element("a", 2, lists), 2 * row) == 24
    for count, content in (
        (1, struct.pack("<Id", 1 << 30, 5.0)),
        (3, 2 * row),
        (3, bytes(4) + row + row[:4]),  # The last row begins, and all have another length than the first.
        (1 << 60, 2 * row),
        (1 << 60, bytes(4) + row),
    ):
        with pytest.raises(InputError, match=f"ends within the {count:,} rows? of 'a'"):
            end(Element("a", count, lists), content)
    for content in (b"\xff" * 40, b"\1" + bytes(8) + b"\xff" * 40):
        with pytest.raises(InputError, match="ends within"):
            end(Element("a", 3, [Property("b", "f8", "i1")]), content)
    assert end(Element("a", 1 << 60), b"") == 0, "rows of nothing take nothing"
