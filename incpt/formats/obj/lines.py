"""The text of an OBJ file: vertices, and runs of faces that have their state in common.

Files have millions of lines, of which neighbours are alike. So numpy finds the lines and their keywords, and
reads the numbers of neighbours at once; where anything is odd, lines are read one by one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats.text_numbers import number_or_nan, numbers_at_once, words_in_lines

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Corners = npt.NDArray[np.int32]

NOWHERE, IMPOSSIBLE = -1, -2
"""Indices in place of one that a corner does not have, and of a position that is not there."""
_NEWLINE, _TAB, _SPACE = b"\n\t "
_FREQUENT = (b"v", b"vt", b"vn", b"f")
_MOST_LINES = 1 << 16
"""Lines that are read at once, so that few are read again where one is odd."""
_WIDTHS = {b"v": 3, b"vt": 2, b"vn": 3}
"""Numbers that are used of a line; those of `vt` may be one, and of `v` six or seven, with a colour."""
_WITH_COLORS = (6, 7)
_STATES = {b"o": "object", b"g": "group", b"usemtl": "material"}
_WAYS: Mapping[tuple[float, float], list[int]] = {
    (0, 0): [0], (1, 0): [0, 1], (2, 1): [0, 2], (2, 0): [0, 1, 2],
}  # fmt: skip
"""Which indices a run of corners has, by the slashes and the double ones of each. All corners of a run are
written in one of these ways as a rule, and then numpy reads them at once."""
_CURVES = frozenset(b"vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con".split())
"""Keywords of free-form curves and surfaces."""
_UNUSED = frozenset(
    b"mg bevel c_interp d_interp lod shadow_obj trace_obj ctech stech maplib usemap call csh".split()
)
"""Keywords of what makes no difference here, or comes from another file."""


@dataclass(frozen=True)
class State:
    """What faces belong to: an object `o`, groups `g`, a material `usemtl`, a smoothing group `s` or 0."""

    object: str = ""
    group: str = ""
    material: str = ""
    smoothing: int = 0


@dataclass(frozen=True, eq=False)
class FaceRun:
    """Polygons that follow each other under one state: how many corners each has (P,), and the indices of
    position, texture coordinates and normal at each corner (C, 3), counted from 0; NOWHERE, or of positions
    IMPOSSIBLE, where there is none."""

    state: State
    sizes: Indices
    corners: Corners


@dataclass
class ObjText:
    """What the lines of a file say."""

    vertices: Array = field(default_factory=lambda: np.zeros((0, 3)))
    colors: Array | None = None
    uvs: Array = field(default_factory=lambda: np.zeros((0, 2)))
    normals: Array = field(default_factory=lambda: np.zeros((0, 3)))
    runs: list[FaceRun] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    lines: int = 0
    points: int = 0
    curves: int = 0
    unknown: dict[str, int] = field(default_factory=dict)
    unreadable: list[str] = field(default_factory=list)
    """Corners of faces that are no indices."""
    out_of_range: dict[str, int] = field(default_factory=dict)
    """How many corners of faces name texture coordinates, and normals, that the file does not have so far."""


def decoded(content: bytes) -> bytes:
    """The same text as UTF-8 without a byte order mark: files are UTF-16 too, and Latin-1 where they are of
    older programs."""
    for mark, encoding in ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if content.startswith(mark):
            try:
                return content.decode(encoding).encode()
            except UnicodeDecodeError:
                raise InputError(
                    "has a byte order mark, and no text behind it; the file is damaged"
                ) from None
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def plain_text(content: bytes) -> bytes:
    """The text without comments and indents, with lines that end alike, and with those that go on in the next
    one put together."""
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\\n" in content:
        content = content.replace(b"\\\n", b" ")
    if b"#" in content:
        content = re.sub(rb"#[^\n]*", b"", content)
    if content[:1] in (b" ", b"\t") or b"\n " in content or b"\n\t" in content:
        content = re.sub(rb"(?m)^[ \t]+", b"", content)
    return content if content.endswith(b"\n") else content + b"\n"


def read_text(content: bytes) -> ObjText:
    """What the lines say. Raises InputError for a line that is none of OBJ's."""
    lines = _Lines(plain_text(content))
    found = ObjText()
    rows: dict[bytes, list[Array]] = {name: [] for name in (*_WIDTHS, b"color")}
    for key, width in _WIDTHS.items():
        for chosen in _at_once(lines.of(key)):
            numbers = _numbers(lines.text(chosen, key), len(chosen))
            if key == b"v":
                rows[b"color"].append(_colors_of(numbers))
            rows[key].append(_fitted(numbers, width))
    found.vertices, found.uvs, found.normals = (
        np.concatenate([np.zeros((0, _WIDTHS[name])), *rows[name]]) for name in _WIDTHS
    )
    colors = np.concatenate([np.zeros((0, 3)), *rows[b"color"]])
    found.colors = None if np.isnan(colors).all() else np.nan_to_num(colors, nan=1.0)
    _read_faces(found, lines)
    return found


def _read_faces(found: ObjText, lines: _Lines) -> None:
    """Takes in the faces, and the lines between them that say what they belong to."""
    state, faces, first = State(), lines.of(b"f"), 0
    for number in [*lines.others.tolist(), lines.count]:
        words = lines.words(number)
        is_face = words[:1] == [b"fo"]
        then = state if is_face or not words else _said(found, state, words)
        if then != state or is_face or number == lines.count:
            last = int(np.searchsorted(faces, number))
            for chosen in _at_once(faces[first:last]):
                _add_run(found, state, lines, chosen, b"f")
            if is_face:
                _add_run(found, state, lines, np.array([number]), b"fo")
            state, first = then, last


def _add_run(found: ObjText, state: State, lines: _Lines, chosen: Indices, key: bytes) -> None:
    totals = np.stack([np.searchsorted(lines.of(name), chosen) for name in _WIDTHS], axis=1)
    found.runs.append(FaceRun(state, *_faces(found, lines.text(chosen, key), totals)))


class _Lines:
    """The lines of a text, of which those with the same of v, vt, vn and f are read together, wherever they
    stand: what a vertex is does not depend on the lines around it."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        buffer = np.frombuffer(content, np.uint8)
        self._ends = np.flatnonzero(buffer == _NEWLINE)
        self._starts = np.concatenate([[0], self._ends[:-1] + 1])
        kinds = _kinds(buffer, self._starts, self._ends)
        self._numbers = {key: np.flatnonzero(kinds == kind) for kind, key in enumerate(_FREQUENT)}
        self.others = np.flatnonzero(kinds == len(_FREQUENT))
        """The numbers of all other lines."""
        self.count = len(kinds)

    def of(self, key: bytes) -> Indices:
        """The numbers of the lines with one of these keywords."""
        return self._numbers[key]

    def words(self, number: int) -> list[bytes]:
        """The keyword of a line, and what follows it; nothing of a blank line, or behind the last."""
        if number == self.count:
            return []
        return self._content[self._starts[number] : self._ends[number]].split(None, 1)

    def text(self, chosen: Indices, key: bytes) -> bytes:
        """Lines with a keyword, without it."""
        starts, ends = self._starts[chosen], self._ends[chosen]
        if chosen[-1] - chosen[0] + 1 == len(chosen):
            blank = b" " * len(key)
            text = self._content[starts[0] : ends[-1]]
            return blank + text[len(key) :].replace(b"\n" + key, b"\n" + blank)
        begins = (starts + len(key)).tolist()
        return b"\n".join(self._content[a:b] for a, b in zip(begins, ends.tolist(), strict=True))


def _at_once(numbers: Indices) -> Iterator[Indices]:
    """The numbers of lines, in portions that are read together."""
    for first in range(0, len(numbers), _MOST_LINES):
        yield numbers[first : first + _MOST_LINES]


def _kinds(buffer: npt.NDArray[np.uint8], starts: Indices, ends: Indices) -> npt.NDArray[np.uint8]:
    """(lines,) the place of each line's keyword in _FREQUENT, or one behind the last."""
    kinds = np.full(len(starts), len(_FREQUENT), np.uint8)
    for number, key in enumerate(_FREQUENT):
        fits = ends - starts >= len(key)
        for place, byte in enumerate(key):
            fits &= buffer[np.minimum(starts + place, ends)] == byte
        behind = buffer[np.minimum(starts + len(key), ends)]
        kinds[fits & np.isin(behind, (_SPACE, _TAB, _NEWLINE))] = number
    return kinds


def _numbers(piece: bytes, lines: int) -> Array:
    """(lines, n) the numbers of each line, NaN where it has fewer, or what is none."""
    words = words_in_lines(piece, lines)
    width = int(words.max(initial=0))
    if width == 0 or (words == width).all():
        numbers = numbers_at_once(piece)
        if len(numbers) == width * lines:
            return numbers.reshape(lines, width)
    result = np.full((lines, width), np.nan)
    for row, line in zip(result, piece.split(b"\n"), strict=True):
        fields = line.split()
        row[: len(fields)] = [number_or_nan(word) for word in fields]
    return result


def _said(found: ObjText, state: State, words: list[bytes]) -> State:
    """The state behind a line that is no vertex and no face."""
    key, rest = words[0], b"".join(words[1:]).strip().decode("utf-8", "replace")
    if key in _STATES:
        changed: dict[str, Any] = {_STATES[key]: rest}
        return replace(state, **changed)
    if key == b"s":
        number = rest.lower()
        smoothing = 0 if number in ("off", "0", "") else int(number) if number.isdigit() else 1
        return replace(state, smoothing=smoothing)
    if key == b"mtllib":
        found.libraries.append(rest)
    elif key in (b"l", b"p"):
        found.lines += key == b"l"
        found.points += key == b"p"
    elif key in _CURVES:
        found.curves += 1
    elif key not in _UNUSED:
        if not re.fullmatch(rb"[A-Za-z_][\w.-]{0,30}", key):
            raise InputError(f"is no OBJ mesh, or a damaged one ({key[:20]!r} is no keyword)")
        name = key.decode()
        found.unknown[name] = found.unknown.get(name, 0) + 1
    return state


def _fitted(numbers: Array, width: int) -> Array:
    """(lines, width): more numbers are left away, and of texture coordinates a missing one is 0."""
    if numbers.shape[1] < width:
        filler = 0.0 if width == 2 else np.nan
        missing = np.full((len(numbers), width - numbers.shape[1]), filler)
        numbers = np.concatenate([numbers, missing], axis=1)
    return numbers[:, :width]


def _colors_of(numbers: Array) -> Array:
    """(lines, 3) what stands behind the position, NaN where there is none."""
    colors = np.full((len(numbers), 3), np.nan)
    if numbers.shape[1] in _WITH_COLORS:
        colors[:] = numbers[:, 3:6]
    return colors


def _faces(found: ObjText, piece: bytes, totals: Indices) -> tuple[Indices, Corners]:
    """Sizes and corners of faces, see FaceRun. `totals` (lines, 3): how many of each kind of vertex stand
    before the line of each."""
    sizes = words_in_lines(piece, len(totals))
    written = _corners(piece, int(sizes.sum()), found.unreadable)
    totals = np.repeat(totals, sizes, axis=0)
    corners = np.where(written > 0, written - 1, written + totals)
    outside = (corners < 0) | (corners >= totals)
    for column, name in ((1, "texture coordinates"), (2, "normals")):
        count = int((outside & (written != 0))[:, column].sum())
        if count:
            found.out_of_range[name] = found.out_of_range.get(name, 0) + count
    corners[(written == 0) | outside] = NOWHERE
    # What is not there beside the position is no mistake.
    corners[:, 0][corners[:, 0] == NOWHERE] = IMPOSSIBLE
    return sizes, corners.astype(np.int32)


def _corners(piece: bytes, count: int, unreadable: list[str]) -> Indices:
    """(count, 3) the numbers of `v`, `v/vt`, `v//vn` and `v/vt/vn`; 0 where there is none, and for all of a
    corner that is no numbers, which is added to `unreadable`."""
    result = np.zeros((count, 3), np.int64)
    if count == 0:
        return result
    columns = _WAYS.get((piece.count(b"/") / count, piece.count(b"//") / count))
    if columns is not None:
        numbers = numbers_at_once(piece.replace(b"/", b" "), np.int64)
        if len(numbers) == len(columns) * count:
            result[:, columns] = numbers.reshape(count, -1)
            return result
    for row, word in zip(result, piece.split(), strict=True):
        try:
            indices = [int(text or 0) for text in word.split(b"/")[:3]]
        except ValueError:
            unreadable.append(word[:20].decode("utf-8", "replace"))
            continue
        row[: len(indices)] = [index if abs(index) < 1 << 62 else 0 for index in indices]
    return result
