"""STL files, as text and in bytes: facets of three vertices each, which are put together here.

The format is of 3D Systems (1989). What a file is follows from its content: files in bytes may begin with the
word `solid`, as those of text have to. Colours are read in the two ways that programs write them into the 16
bits which the format keeps free for each facet: that of VisCAM and SolidView, and that of Materialise Magics.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats import import_report
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.far_origin import far_offset
from incpt.formats.import_report import counted
from incpt.formats.names import Names
from incpt.formats.polygons import triangles_of
from incpt.formats.text_numbers import number_or_nan, numbers_at_once
from incpt.formats.vertex_attributes import NO_ATTRIBUTES, VertexAttributes, material_of_colors
from incpt.formats.welding import welded
from incpt.picture.color import linear_from_srgb
from incpt.scene.mesh import MeshSource
from incpt.scene.mesh_part import MeshFile, MeshPart

Floats = npt.NDArray[np.float32]
Corners = npt.NDArray[np.floating[Any]]

_HEADER, _FACET = 80, 50
"""Bytes before the number of facets in a file of bytes, and of each facet."""
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_SOLID = re.compile(rb"solid\b[ \t]*([^\r\n]*)")
_INDENT = 200
"""Bytes before that word on its line that are looked at."""
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_WORDS = (b"endfacet", b"endloop", b"facet", b"normal", b"outer", b"loop", b"vertex")
_GREY = (0.8, 0.8, 0.8)
"""Of facets without a colour beside others that have one, linear."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """Facets (F, 3, 3) with their normals (F, 3), or None, and linear colours (F, 4), or None. `too_small`
    more had fewer than three corners."""

    name: str
    facets: Corners
    normals: Corners | None = None
    colors: npt.NDArray[np.float64] | None = None
    too_small: int = 0


def read_stl(path: Path) -> MeshFile:
    """The solids of an STL file with shared vertices; see `mesh_files.load_file`. Raises InputError."""
    content = read_bytes(path)
    solids = list(_solids_of_text(content)) if _is_text(content) else [_solid_of_bytes(content)]
    counts = dict.fromkeys(("in all", "with fewer than three corners"), sum(one.too_small for one in solids))
    parts, names = [], Names()
    offset = far_offset(np.concatenate([one.facets.reshape(-1, 3) for one in solids] or [np.zeros((0, 3))]))
    for solid in solids:
        vertices, places = welded(_near(solid.facets, offset).reshape(-1, 3))
        faces = places.reshape(-1, 3)
        colors = NO_ATTRIBUTES if solid.colors is None else VertexAttributes(colors=solid.colors)
        color_at = np.repeat(np.arange(len(faces))[:, None], 3, axis=1)
        mesh = usable_mesh(vertices, faces, None, counts, colors, color_at=color_at)
        if mesh is not None:
            parts.append(MeshPart(names.new(solid.name or "solid"), mesh, *material_of_colors(mesh)))
    tell_of_faces(counts)
    _tell_of_normals(solids)
    import_report.read(f"{counted(len(parts), 'solid')}, {counted(counts['in all'], 'facet')}")
    if len(parts) == 1:
        parts = [replace(parts[0], name=None)]
    source = MeshSource(file=os.path.abspath(path))
    return MeshFile(
        tuple(replace(one, mesh=replace(one.mesh, source=replace(source, part=one.name))) for one in parts)
    )


def _near(facets: Corners, offset: npt.NDArray[np.float64] | None) -> Floats:
    """Facets in single precision, less what is taken off of their coordinates."""
    with np.errstate(over="ignore"):
        return (facets if offset is None else facets - offset).astype(np.float32)


def _is_text(content: bytes) -> bool:
    """Whether a file is of text: it is not as long as its number of facets would make a file of bytes, begins
    with `solid`, and names a facet or its end."""
    if len(content) == _HEADER + 4 + _FACET * _count_of_facets(content):
        return False
    begins = content[:1024].lstrip().lower().startswith(b"solid")
    return begins and re.search(rb"facet|endsolid", content, re.IGNORECASE) is not None


def _count_of_facets(content: bytes) -> int:
    return int.from_bytes(content[_HEADER : _HEADER + 4], "little")


def _solid_of_bytes(content: bytes) -> _Solid:
    count = _count_of_facets(content)
    behind = len(content) - (_HEADER + 4 + _FACET * count)
    if len(content) < _HEADER + 4 or behind < 0:
        raise InputError("is no STL mesh, or a damaged one (it ends within its facets)")
    if behind:
        import_report.left_out(f"{behind:,} bytes behind the last facet: the file counts {count:,}")
    rows = np.frombuffer(content, _ROW, count, _HEADER + 4)
    return _Solid("", rows["corners"], rows["normal"], _colors(content[:_HEADER], rows["attribute"]))


def _colors(header: bytes, attributes: npt.NDArray[np.uint16]) -> npt.NDArray[np.float64] | None:
    """(F, 4) linear colours of facets, if they have any. With `COLOR=` in the header they are those of
    Magics: red in the lowest bits, and the highest is set where the colour of the header counts. Else they
    are those of VisCAM: blue in the lowest bits, and the highest is set where there is a colour."""
    is_marked = attributes >= 1 << 15
    place = header.find(b"COLOR=") + 6
    if place >= 6 and len(header) >= place + 4:
        default = linear_from_srgb(np.frombuffer(header, np.uint8, 3, place) / 255)
        has_own, shifts = ~is_marked, (0, 5, 10)
        if b"MATERIAL=" in header:
            import_report.left_out("the material of the header: says how shiny Magics shows the file")
    elif is_marked.any():
        default, has_own, shifts = np.array(_GREY), is_marked, (10, 5, 0)
    else:
        unknown = int((attributes != 0).sum())
        if unknown:
            import_report.left_out(
                f"the 16 bits of {counted(unknown, 'facet')}: are no colours of VisCAM or Magics"
            )
        return None
    shares = np.stack([(attributes >> shift) & 31 for shift in shifts], axis=1) / 31
    colors = np.where(has_own[:, None], linear_from_srgb(shares), default)
    return np.concatenate([colors, np.ones((len(colors), 1))], axis=1)


def _solids_of_text(content: bytes) -> Iterator[_Solid]:
    text = content if b"vertex" in content else content.lower()
    begin, name = None, ""
    for line in _lines_of_solids(text):
        if begin is not None:
            yield _solid_of_text(text[begin : line.start], name)
        begin = None if line.is_end else line.end
        name = content[line.name : line.end].decode("utf-8", "replace").strip()
    if begin is not None:
        yield _solid_of_text(text[begin:], name)


class _SolidLine(NamedTuple):
    """A line that begins a solid or ends one: its first place, that of a name in it, and that behind it."""

    start: int
    name: int
    end: int
    is_end: bool


def _lines_of_solids(text: bytes) -> Iterator[_SolidLine]:
    for found in _SOLID.finditer(text):
        near = text[max(found.start() - _INDENT, 0) : found.start()]
        before = re.split(rb"[\r\n]", near)[-1]
        if before.strip() in (b"", b"end"):
            start = found.start() - len(before)
            yield _SolidLine(start, found.start(1), found.end(), before.strip() == b"end")


def _solid_of_text(text: bytes, name: str) -> _Solid:
    facets = text.count(b"endloop")
    plain = text
    for word in _WORDS:
        plain = plain.replace(word, b"")
    numbers = numbers_at_once(plain, np.float64)
    if len(numbers) == 12 * facets == 4 * text.count(b"vertex"):
        rows = numbers.reshape(-1, 4, 3)
        return _Solid(name, rows[:, 1:], rows[:, 0])
    return _odd_solid(text, name)


def _odd_solid(text: bytes, name: str) -> _Solid:
    """That of a text in which facets have other than three vertices, or something that is no number."""
    *loops, rest = [_VERTEX.findall(loop) for loop in re.split(rb"(?i)endloop", text)]
    if rest:
        import_report.left_out(f"the last facet of solid {name!r}: the file ends within it")
    corners = [[number_or_nan(word) for word in words] for loop in loops for words in loop]
    vertices = np.array(corners, np.float64).reshape(-1, 3)
    sizes = np.array([len(loop) for loop in loops], np.int64)
    found = triangles_of(sizes, vertices, np.arange(len(vertices)))
    return _Solid(name, vertices[found.faces], too_small=found.too_small)


def _tell_of_normals(solids: list[_Solid]) -> None:
    """Tells of facets whose vertices go round the other way than their normals say."""
    turned = 0
    for solid in solids:
        if solid.normals is not None:
            a, b, c = (solid.facets[:, corner] for corner in range(3))
            with np.errstate(all="ignore"):
                turned += int((np.einsum("fi,fi->f", np.cross(b - a, c - a), solid.normals) < 0).sum())
    if turned:
        import_report.changed(
            f"normals of {counted(turned, 'facet')}: point inwards by the order of the vertices, which counts"
        )
