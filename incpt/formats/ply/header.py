"""The header of a PLY file: which elements follow it, and what each row of them holds."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.formats import import_report

_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_KINDS = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float16": "f2", "float32": "f4", "float64": "f8",
}  # fmt: skip
"""Types by the names that files give them, as numpy calls them without their order of bytes."""
_END = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\r|\n|$)")
_MOST_DIGITS = 18
_KEYWORDS = ("format", "element", "property")
"""Of lines without which what follows cannot be read."""


@dataclass(frozen=True)
class Property:
    """What each row of an element has: a number, or where there is a `count_kind` a list of numbers behind
    their count."""

    name: str
    kind: str
    count_kind: str | None = None


@dataclass
class Element:
    """So many rows that have the same properties, in this order."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass
class Header:
    """`order` is that of bytes, "<" or ">", or "" where numbers stand as text; the rows begin behind `size`
    bytes."""

    size: int
    order: str | None = None
    elements: list[Element] = field(default_factory=list)
    textures: list[str] = field(default_factory=list)
    """Files that comments name as images."""


def read_header(content: bytes) -> Header:
    """The header at the beginning of a file. Raises InputError."""
    end = _END.search(content)
    if not content.startswith((b"ply\n", b"ply\r", b"ply ")) or end is None:
        raise InputError("is no PLY mesh, or a damaged one (it has no header)")
    size = end.end()
    # Where lines end with \r alone, what looks like the second half of a line's end is the first byte behind.
    if end[1] == b"\r\n" and b"\n" not in content[: end.start() + 1]:
        size -= 1
    header = Header(size)
    lines = content[: end.start()].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for number, line in enumerate(lines[1:], 2):
        try:
            _read_line(header, line)
        except InputError as error:
            if line.split(None, 1)[0] in _KEYWORDS:
                raise InputError(f"line {number}: {error}") from None
            import_report.left_out(f"line {number}: {error}")
    if header.order is None:
        raise InputError("is no PLY mesh, or a damaged one (its header names no format)")
    return header


def _read_line(header: Header, line: str) -> None:
    words = line.split()
    match words:
        case [] | ["obj_info", *_]:
            pass
        case ["comment", *_]:
            found = re.match(r"\s*comment\s+TextureFile\s+(\S.*)", line, re.IGNORECASE)
            if found:
                header.textures.append(found[1].strip().strip('"'))
        case ["format", name, *_]:
            if name not in _ORDERS:
                raise InputError(f"format {described(name)} is none of {', '.join(_ORDERS)}")
            header.order = _ORDERS[name]
        case ["element", name, count] if count.isdecimal() and count.isascii():
            if len(count) > _MOST_DIGITS:
                raise InputError(f"element {described(name)}: has more rows than any file can hold")
            header.elements.append(Element(name, int(count)))
        case ["property", "list", count_kind, kind, name]:
            _add(header, Property(name, _kind(kind), _kind(count_kind)))
        case ["property", kind, name]:
            _add(header, Property(name, _kind(kind)))
        case _:
            raise InputError(f"{described(line.strip())} is no line of a PLY header")


def _kind(name: str) -> str:
    if name not in _KINDS:
        raise InputError(f"type {described(name)} is not known; use one of {', '.join([*_KINDS][:8])}")
    return _KINDS[name]


def _add(header: Header, one: Property) -> None:
    if not header.elements:
        raise InputError(f"property {described(one.name)} belongs to no element; the file is damaged")
    element = header.elements[-1]
    if any(other.name == one.name for other in element.properties):
        raise InputError(f"property {described(one.name)} stands twice in {element.name!r}")
    element.properties.append(one)
