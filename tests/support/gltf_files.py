"""Small glTF files, made in tests."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

TYPES = {"float32": 5126, "uint16": 5123, "uint8": 5121, "int8": 5120, "int16": 5122, "uint32": 5125}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

QUAD = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)


class GltfBuilder:
    """Collects what stands in a file: all content in one buffer, which is a data URI in a .gltf file."""

    def __init__(self) -> None:
        self.content = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, content: bytes, **more: Any) -> int:
        """The number of a new buffer view."""
        self.content += bytes(-len(self.content) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.content), "byteLength": len(content), **more})
        self.content += content
        return len(self.views) - 1

    def accessor(self, values: npt.NDArray[Any], **more: Any) -> int:
        """The number of a new accessor with a view of its own, unless `more` says another."""
        values = values.reshape(len(values), -1)
        kind = {"componentType": TYPES[values.dtype.name], "type": _SHAPES[values.shape[1]]}
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        stored = {} if "bufferView" in more else {"bufferView": self.view(values.tobytes())}
        self.accessors.append({"count": len(values), **stored, **kind, **bounds, **more})
        return len(self.accessors) - 1

    def quad(self, **more: Any) -> dict[str, Any]:
        """A primitive: a square from -1 to 1 in the plane of x and y, facing z."""
        return {
            "attributes": {"POSITION": self.accessor(QUAD)}, "indices": self.accessor(QUAD_FACES), **more,
        }  # fmt: skip

    def document(self, primitives: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
        """The JSON of a file with one mesh, shown by one node unless `more` says otherwise."""
        document = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": primitives}], "accessors": self.accessors, "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.content)}], **more,
        }  # fmt: skip
        return {key: value for key, value in document.items() if value != []}

    def write(self, path: Path, primitives: list[dict[str, Any]], **more: Any) -> Path:
        """A .gltf or .glb file by the suffix."""
        return write_document(path, self.document(primitives, **more), self.content)


def embedded(document: dict[str, Any], content: bytes) -> dict[str, Any]:
    """The JSON with the content of its first buffer as a data URI."""
    first, *others = document["buffers"]
    uri = "data:application/octet-stream;base64," + base64.b64encode(content).decode()
    return {**document, "buffers": [{**first, "uri": uri}, *others]}


def write_document(path: Path, document: dict[str, Any], content: bytes) -> Path:
    """A file of that JSON, whose first buffer has that content, if any."""
    if path.suffix == ".gltf":
        path.write_text(json.dumps(embedded(document, content) if content else document))
        return path
    text = json.dumps(document).encode()
    chunks = [(text + b" " * (-len(text) % 4), b"JSON"), (content + bytes(-len(content) % 4), b"BIN\0")]
    joined = b"".join(len(chunk).to_bytes(4, "little") + kind + chunk for chunk, kind in chunks)
    path.write_bytes(b"glTF" + (2).to_bytes(4, "little") + (12 + len(joined)).to_bytes(4, "little") + joined)
    return path
