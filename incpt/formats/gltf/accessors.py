"""Arrays of a glTF file: buffer views, and accessors of every kind that they store."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.formats.gltf import compression
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table

COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_UNSTORED_PER_BYTE = 64
"""How many values accessors without data, which are zeros in memory all the same, may claim for each byte of
the file and those beside it: they say what morph targets leave as it is, and the mesh itself is stored."""
_ALWAYS_UNSTORED = 1 << 16
_LARGEST_COUNT = 1 << 60

Array = npt.NDArray[Any]


class Accessors:
    """The arrays of a file by their numbers. What is decompressed stays in memory as long as this does."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._decompressed: dict[int, memoryview] = {}

    def view(self, number: int) -> tuple[memoryview, int]:
        """What a buffer view holds, and its stride, 0 where it says none. Raises InputError."""
        table = self.document.item("bufferViews", number)
        with table.in_messages():
            meshopt = table.extension(*compression.MESHOPT)
            if "buffer" in meshopt and not self._has_fallback(table):
                if number not in self._decompressed:
                    self._decompressed[number] = compression.decoded_view(meshopt, self.document)
                return self._decompressed[number], meshopt.whole("byteStride", 1, 256)
            content = self.document.content(table.whole("buffer", 0, 1 << 31))
            first, length = table.whole("byteOffset", 0, 1 << 53, 0), table.whole("byteLength", 0, 1 << 53)
            if first + length > len(content):
                raise InputError(
                    f"reaches to byte {first + length} of a buffer of {len(content)}; the file is damaged"
                )
            stride = table.whole("byteStride", 1, 252) if "byteStride" in table else 0
            return content[first : first + length], stride

    def _has_fallback(self, view: Table) -> bool:
        """Whether a compressed view is stored uncompressed too."""
        buffer = self.document.item("buffers", view.whole("buffer", 0, 1 << 31))
        placeholder = buffer.extension(*compression.MESHOPT)
        is_stored = "uri" in buffer or (buffer.place == "buffers[0]" and self.document.has_binary)
        return is_stored and not placeholder.flag("fallback")

    def floats(self, number: int, *widths: int) -> npt.NDArray[np.float32]:
        """(count, width) as numbers; whole ones that are normalised stand for 0 to 1, or -1 to 1. `widths`
        are those that are possible. Raises InputError."""
        table = self.document.item("accessors", number)
        raw = self.raw(number, *widths)
        return as_floats(raw, table.flag("normalized"))

    def doubles(self, number: int, *widths: int) -> npt.NDArray[np.float64]:
        """The same in double precision, for matrices and times."""
        # Numbers that are none may make numpy warn; whoever uses them looks for them.
        with np.errstate(invalid="ignore"):
            return self.floats(number, *widths).astype(np.float64)

    def raw(self, number: int, *widths: int) -> Array:
        """(count, width) as stored, with what a sparse accessor puts in other values' place. Raises
        InputError."""
        table = self.document.item("accessors", number)
        with table.in_messages():
            dtype, width = _type_of(table)
            if width not in widths:
                raise InputError(f"type: has {width} components; {' or '.join(map(str, widths))} are needed")
            count = table.whole("count", 1, _LARGEST_COUNT)
            if "bufferView" in table:
                values = self._stored(table, count, dtype, width)
            elif count * width > _UNSTORED_PER_BYTE * self.document.size() + _ALWAYS_UNSTORED:
                raise InputError(f"claims {count} values without storing them; the file is damaged")
            else:
                values = np.zeros((count, width), dtype)
            if "sparse" in table:
                values = self._with_sparse(table.table("sparse"), values)
            return values

    def _stored(self, table: Table, count: int, dtype: np.dtype[Any], width: int) -> Array:
        """(count, width) what a buffer view holds from `byteOffset` on, not copied."""
        content, stride = self.view(table.whole("bufferView", 0, 1 << 31))
        first, size = table.whole("byteOffset", 0, 1 << 53, 0), dtype.itemsize * width
        stride = stride or size
        end = first + (count - 1) * stride + size
        if stride < size or end > len(content):
            raise InputError(
                f"has {count} values to byte {end} of a view of {len(content)} bytes; the file is damaged"
            )
        return np.ndarray((count, width), dtype, content, first, (stride, dtype.itemsize))

    def _with_sparse(self, sparse: Table, values: Array) -> Array:
        count = sparse.whole("count", 1, len(values))
        where, new = sparse.table("indices"), sparse.table("values")
        dtype = _component(where)
        if dtype.kind != "u":
            raise InputError("sparse.indices: are no whole numbers from 0 on; the file is damaged")
        places = self._stored(where, count, dtype, 1)[:, 0].astype(np.int64)
        if places.max() >= len(values):
            raise InputError(f"sparse.indices: go to {places.max()} of {len(values)}; the file is damaged")
        result = values.copy()
        result[places] = self._stored(new, count, values.dtype, values.shape[1])
        return result


def as_floats(stored: Array, is_normalized: bool) -> npt.NDArray[np.float32]:
    """Stored values as numbers; whole ones that are normalised stand for 0 to 1, or -1 to 1."""
    if not is_normalized or stored.dtype.kind == "f":
        return stored.astype(np.float32)
    # float64 in between, so that the largest number is 1 to the bit.
    return np.maximum(stored / float(np.iinfo(stored.dtype).max), -1.0).astype(np.float32)


def _type_of(table: Table) -> tuple[np.dtype[Any], int]:
    name = table.text("type")
    if name not in _WIDTHS:
        raise InputError(f"type: {described(name)} is none of {', '.join(_WIDTHS)}")
    dtype = _component(table)
    if name == "MAT4" and dtype.kind != "f":
        raise InputError("componentType: matrices of whole numbers cannot be read; export them as floats")
    return dtype, _WIDTHS[name]


def _component(table: Table) -> np.dtype[Any]:
    code = table.whole("componentType", 0, 1 << 31)
    if code not in COMPONENTS:
        raise InputError(f"componentType: {code} is none of {', '.join(map(str, COMPONENTS))}")
    return COMPONENTS[code]
