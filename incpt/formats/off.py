"""OFF files (Geomview's Object File Format), as text: vertices, polygons, and colours of both.

The word at the beginning says what vertices have behind their positions: N normals, C colours, ST texture
coordinates.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats import import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.far_origin import nearer
from incpt.formats.import_report import counted
from incpt.formats.polygons import triangles_of
from incpt.formats.text_numbers import numbers_or_nan, whole_or_negative, words_in_lines
from incpt.formats.vertex_attributes import VertexAttributes, material_of_colors
from incpt.picture.color import linear_from_srgb
from incpt.scene.mesh import MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_KEYWORD = re.compile(rb"(?P<uvs>ST)?(?P<colors>C)?(?P<normals>N)?(?P<homogeneous>4)?(?P<dimension>n)?OFF")
_GREY = (0.8, 0.8, 0.8, 1.0)
"""Of faces without a colour beside others that have one, linear."""


def read_off(path: Path) -> MeshFile:
    """The mesh of an OFF file; see `mesh_files.load_file`. Raises InputError."""
    text = _plain(read_bytes(path))
    keyword = _KEYWORD.match(text)
    has = keyword.groupdict() if keyword else {}
    if has.get("homogeneous") or has.get("dimension"):
        raise InputError("is an OFF file of another dimension; only those of three are read")
    if re.match(rb"\s*BINARY", text[keyword.end() :] if keyword else b""):
        raise InputError("is an OFF file in bytes; save it as text")
    lines = _Lines(text[keyword.end() :] if keyword else text)
    vertices, faces = lines.counts
    with np.errstate(all="ignore"):
        values = lines.vertices(vertices)
        positions, normals, attributes = _at_vertices(values, has)
        positions = nearer(positions)
        sizes, corners, colors = lines.faces(vertices, faces)
        triangles = triangles_of(sizes, positions, corners)
    color_at = None
    if colors is not None and attributes.colors is not None:
        import_report.left_out("colours of faces: those of vertices are used")
    elif colors is not None:
        attributes = replace(attributes, colors=colors)
        color_at = np.repeat(triangles.polygons[:, None], 3, axis=1)
    counts = dict.fromkeys(("in all", "with fewer than three corners"), triangles.too_small)
    mesh = usable_mesh(positions, triangles.faces, normals, counts, attributes, color_at=color_at)
    tell_of_faces(counts)
    assert mesh is not None, "a file without a usable face is refused"
    import_report.read(f"{counted(counts['in all'], 'triangle')}, {counted(vertices, 'point')}")
    mesh = replace(mesh, source=MeshSource(file=os.path.abspath(path)))
    return MeshFile((MeshPart(None, mesh, *material_of_colors(mesh)),))


def _plain(content: bytes) -> bytes:
    """The text without comments, with lines that end alike."""
    text = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return re.sub(rb"#[^\n]*", b"", text).strip()


class _Lines:
    """The numbers of a text without its keyword, line by line. Raises InputError."""

    def __init__(self, text: bytes) -> None:
        words = words_in_lines(text, text.count(b"\n") + 1)
        words = words[words > 0]
        values = numbers_or_nan(text)
        head = whole_or_negative(values[: int(words[0]) if len(words) else 0]).tolist()
        if len(head) < 2 or min(head[:2]) < 0:
            raise InputError("is no OFF mesh, or a damaged one (it does not begin with its counts)")
        self.counts: tuple[int, int] = head[0], head[1]
        """Of vertices and faces."""
        self._words, self._values = words[1:], values[int(words[0]) :]
        if sum(self.counts) > len(self._words):
            raise InputError("is no OFF mesh, or a damaged one (it has fewer lines than it counts)")
        rest = len(self._words) - sum(self.counts)
        if rest:
            import_report.left_out(f"{counted(rest, 'line')} behind the last face: the file counts fewer")

    def vertices(self, count: int) -> Array:
        """(V, n) the numbers of the first lines, at least three each."""
        words = self._words[:count]
        if not count or words[0] < 3 or (words != words[0]).any():
            raise InputError("is no OFF mesh, or a damaged one (its vertices have not as many numbers each)")
        return self._values[: int(words.sum())].reshape(count, -1)

    def faces(self, behind: int, count: int) -> tuple[Indices, Indices, Array | None]:
        """How many corners polygons have (P,), their vertices (C,), and linear colours (P, 4) if any has one,
        of the lines behind so many others."""
        words = self._words[behind : behind + count]
        ends = np.cumsum(words) + int(self._words[:behind].sum())
        starts = ends - words
        sizes = whole_or_negative(self._values[starts])
        is_cut = (sizes < 0) | (sizes >= words)
        if is_cut.any():
            import_report.left_out(
                f"{counted(int(is_cut.sum()), 'face')}: a line ends before its last corner"
            )
            sizes = np.where(is_cut, 0, sizes)
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        corners = whole_or_negative(self._values[np.repeat(starts, sizes) + 1 + within])
        return sizes, corners, self._face_colors(starts + 1 + sizes, np.where(is_cut, 0, words - 1 - sizes))

    def _face_colors(self, places: Indices, rest: Indices) -> Array | None:
        """From where so many numbers stand behind the corners of each face."""
        has_color = (rest == 3) | (rest == 4)
        others = int(((rest > 0) & ~has_color).sum())
        if others:
            import_report.left_out(f"colours of {counted(others, 'face')}: are numbers of a list of colours")
        if not has_color.any():
            return None
        last = len(self._values) - 1
        chosen = self._values[np.minimum(places[has_color][:, None] + np.arange(4), last)]
        chosen[rest[has_color] == 3, 3] = np.nan
        colors = np.full((len(rest), 4), _GREY)
        colors[has_color] = _linear(chosen)
        return colors


def _at_vertices(values: Array, has: dict[str, bytes | None]) -> tuple[Array, Array | None, VertexAttributes]:
    """Positions (V, 3), normals (V, 3) and what else stands at vertices, from their numbers (V, n)."""
    place, normals = 3, None
    uvs: tuple[Array, ...] = ()
    if has.get("normals") and values.shape[1] >= 6:
        place, normals = 6, values[:, 3:6]
    last = values.shape[1]
    if has.get("uvs") and last >= place + 2:
        last -= 2
        uvs = (values[:, last:] * [1, -1] + [0, 1],)
    # Many files have colours which their first word does not name.
    colors = _linear(values[:, place:last]) if last - place in (3, 4) else None
    if colors is None and last > place:
        import_report.left_out(f"{last - place} numbers behind each position: the first word names none")
    return values[:, :3], normals, VertexAttributes(uvs, colors)


def _linear(colors: Array) -> Array:
    """(N, 4) from colours of three or four numbers, as displays show them: up to 255, or to 1 if none is
    larger. An alpha that is no number is 1."""
    shares = colors / (255 if (colors > 1).any() else 1)
    linear = np.ones((len(shares), 4))
    linear[:, :3] = linear_from_srgb(shares[:, :3])
    if shares.shape[1] == 4:
        linear[:, 3] = np.nan_to_num(shares[:, 3], nan=1.0)
    return linear
