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
