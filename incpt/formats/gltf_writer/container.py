"""A .glb file in the making: tables of its JSON, and the bytes that they name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import write_atomically

_TYPES = {"float32": 5126, "uint16": 5123, "uint32": 5125}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_ARRAY, _ELEMENTS = 34962, 34963
"""What a view is for: values at vertices, or indices."""
_MOST_BYTES = (1 << 32) - 1
_BLANK, _ZERO = b" ", b"\0"


class Container:
    """Collects tables by the names of their lists, such as "meshes", and the content of one buffer."""

    def __init__(self) -> None:
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._extensions: dict[str, dict[str, list[dict[str, Any]]]] = {}
        self._used: dict[str, None] = {}
        self._pieces: list[bytes] = []
        self._size = 0

    def add(self, kind: str, table: dict[str, Any]) -> int:
        """The number of a new table in a list."""
        entries = self._lists.setdefault(kind, [])
        entries.append(table)
        return len(entries) - 1

    def add_to_extension(self, extension: str, kind: str, table: dict[str, Any]) -> int:
        """The number of a new table in a list of an extension of the whole file."""
        entries = self._extensions.setdefault(extension, {}).setdefault(kind, [])
        entries.append(table)
        return len(entries) - 1

    def extension(self, name: str, table: dict[str, Any]) -> dict[str, Any]:
        """What stands under `extensions` for one of them, which is noted as used."""
        self._used[name] = None
        return {name: table}

    def view(self, content: bytes, **more: Any) -> int:
        """The number of a new view of bytes, which begin at a multiple of four."""
        padding = _ZERO * (-self._size % 4)
        start = self._size + len(padding)
        self._pieces += [padding, content]
        self._size = start + len(content)
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(content), **more})

    def values(self, values: npt.NDArray[np.float32], with_bounds: bool = False) -> int:
        """The number of a new accessor for values (N, width) at vertices."""
        table: dict[str, Any] = {
            "bufferView": self.view(values.tobytes(), target=_ARRAY),
            "componentType": _TYPES[values.dtype.name],
            "count": len(values),
            "type": _SHAPES[values.shape[1]],
        }
        if with_bounds:
            table |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", table)

    def indices(self, indices: npt.NDArray[np.integer[Any]]) -> int:
        """The number of a new accessor for indices of vertices (N,)."""
        # The largest number of a type would end a strip.
        kind = np.uint16 if indices.max(initial=0) < np.iinfo(np.uint16).max else np.uint32
        stored = indices.astype(kind)
        return self.add("accessors", {
            "bufferView": self.view(stored.tobytes(), target=_ELEMENTS),
            "componentType": _TYPES[stored.dtype.name], "count": len(stored), "type": "SCALAR",
        })  # fmt: skip

    def write(self, path: Path) -> None:
        """Writes the file, atomically. Raises InputError: more than 4 GiB; OutputError."""
        document: dict[str, Any] = {"asset": {"version": "2.0", "generator": "incpt"}, **self._lists}
        if self._size:
            document["buffers"] = [{"byteLength": self._size}]
        if self._extensions:
            document["extensions"] = self._extensions
        if self._used:
            document["extensionsUsed"] = sorted(self._used)
        if "scenes" in document:
            document["scene"] = 0
        text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
        text += _BLANK * (-len(text) % 4)
        padding = _ZERO * (-self._size % 4)
        chunks = [(b"JSON", [text])]
        if self._size:
            chunks.append((b"BIN\0", [*self._pieces, padding]))
        sizes = [sum(map(len, pieces)) for _, pieces in chunks]
        size = 12 + sum(8 + one for one in sizes)
        if size > _MOST_BYTES:
            raise InputError(
                f"{path}: would have {size:,} bytes, more than a .glb file can; write fewer objects"
            )

        def write(temporary: Path) -> None:
            with temporary.open("wb") as stream:
                stream.write(b"glTF" + (2).to_bytes(4, "little") + size.to_bytes(4, "little"))
                for (kind, pieces), one in zip(chunks, sizes, strict=True):
                    stream.write(one.to_bytes(4, "little") + kind)
                    stream.writelines(pieces)

        write_atomically(path, write)
