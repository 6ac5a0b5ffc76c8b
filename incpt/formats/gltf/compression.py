"""Compressed geometry of glTF files, decoded by libraries: meshopt by view, Draco by primitive."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.checks import one_of
from incpt.core.errors import InputError, reason_of
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DRACO = "KHR_draco_mesh_compression"
_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
_MOST_TIMES_LARGER = 2048
"""How many times as large as its code decoded content may be: meshopt's vertex codec needs a byte for 1,024
zeros at least."""
_DRACO_HEADER = 11
"""Bytes of the header of Draco's code, of which the eighth says what is encoded, and the ninth how."""
_DRACO_MESH, _DRACO_EDGEBREAKER = 1, 1


def decoded_view(table: Table, document: Document) -> memoryview:
    """The content of a buffer view that meshopt has compressed; `table` is that of the extension. Raises
    InputError."""
    with table.in_messages():
        first, length = table.whole("byteOffset", 0, 1 << 53, 0), table.whole("byteLength", 1, 1 << 53)
        stride, count = table.whole("byteStride", 1, 256), table.whole("count", 1, 1 << 40)
        mode, kind = table.text("mode"), table.text("filter", "NONE")
        one_of("mode", mode, _MODES)
        one_of("filter", kind, _FILTERS)
        content = document.content(table.whole("buffer", 0, 1 << 31))
        if first + length > len(content) or stride * count > _MOST_TIMES_LARGER * length:
            raise InputError(f"has {count} values in {length} bytes; the file is damaged")
        decode = _library("meshopt", "is compressed by meshopt", "incpt[gltf]").decode_gltf_buffer
        code = bytes(content[first : first + length])
        rows = _decoded(lambda: decode(code, count, stride, mode, None if kind == "NONE" else kind))
        decoded = memoryview(np.ascontiguousarray(rows).tobytes())
        if len(decoded) != stride * count:
            raise InputError(f"holds {len(decoded)} bytes, not {stride * count}; the file is damaged")
        return decoded


def decoded_primitive(
    table: Table, content: memoryview
) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[np.int64]]:
    """The attributes by name, (V, width) each as stored, and the faces (F, 3) of a primitive that Draco has
    compressed into `content`; `table` is that of the extension. Raises InputError."""
    with table.in_messages():
        decode = _library("DracoPy", "is compressed by Draco", "DracoPy").decode
        _check_draco(content)
        mesh = _decoded(lambda: decode(bytes(content)))
        by_number = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        names = table.table("attributes")
        found = {}
        for name in names:
            values = by_number.get(names.whole(name, 0, 1 << 31))
            if values is None:
                raise InputError(f"attributes.{name}: is not among what was compressed; the file is damaged")
            found[name] = np.asarray(values).reshape(len(values), -1)
        faces = getattr(mesh, "faces", None)
        if faces is None:
            raise InputError("holds points without faces")
        return found, np.asarray(faces, np.int64).reshape(-1, 3)


def _check_draco(code: memoryview) -> None:
    """Raises InputError where a header promises far more than its code can hold, before memory is taken for
    it. The layout is that of the specification "Draco 3D Graphics Compression", of version 2.2, to which all
    encoders of glTF write; other versions are left to the library."""
    header = bytes(code[:_DRACO_HEADER])
    if header[:5] != b"DRACO" or tuple(header[5:7]) != (2, 2) or header[7] != _DRACO_MESH:
        return
    # An edgebreaker's code begins with the kind of its traversal; then it counts points and faces, and a
    # sequential one faces and points.
    place = _DRACO_HEADER + (1 if header[8] == _DRACO_EDGEBREAKER else 0)
    counts = []
    for _ in range(2):
        count, place = _varint(code, place)
        counts.append(count)
    # Three coordinates of four bytes for a point, and as many indices for a face.
    if 12 * sum(counts) > _MOST_TIMES_LARGER * len(code):
        raise InputError(f"promises {sum(counts):,} points and faces in {len(code)} bytes; it is damaged")


def _varint(code: memoryview, place: int) -> tuple[int, int]:
    """A number of seven bits a byte, the lowest first, and the place behind it."""
    value = 0
    for number, byte in enumerate(code[place : place + 10]):
        value |= (byte & 127) << (7 * number)
        if byte < 128:
            return value, place + number + 1
    raise InputError("ends within its header; the file is damaged")


def _library(name: str, what: str, package: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{what}; `pip install {package}`, or export it uncompressed") from None


def _decoded(decode: Callable[[], Any]) -> Any:
    try:
        return decode()
    except MemoryError:
        raise InputError("needs more memory than there is; the file may be damaged") from None
    except Exception as error:  # The libraries raise errors of many types for damaged content.
        raise InputError(f"cannot be decoded ({reason_of(error)}); the file is damaged") from None
