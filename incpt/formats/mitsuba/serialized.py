"""Mitsuba's own meshes: versions 3 and 4 of the .serialized format, several to a file, each compressed."""

from __future__ import annotations

import zlib
from enum import IntFlag
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.files import read_bytes
from incpt.formats.clean import tell_of_faces, usable_mesh
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.mesh import Mesh

_MAGIC = 0x041C
_MOST_VERTICES = 1 << 31


class _Has(IntFlag):
    """Flags of a mesh."""

    NORMALS = 0x1
    UVS = 0x2
    COLORS = 0x8
    DOUBLES = 0x2000


def read_serialized(path: Path, number: int) -> Mesh:
    """The mesh with that number, from 0 on. Raises InputError."""
    content = read_bytes(path)
    magic, version = (int(n) for n in np.frombuffer(content[:4].ljust(4, b"\0"), "<u2"))
    if magic != _MAGIC:
        raise InputError("is no .serialized file, or a damaged one")
    if version not in (3, 4):
        raise InputError(f"version {version} of .serialized files is not read; save the mesh as PLY")
    start = _start(content, version, number)
    return _mesh(_Stream(content[start + 4 :]), version)


def _start(content: bytes, version: int, number: int) -> int:
    """Where the mesh of a number begins: a list at the end of the file says it."""
    if number == 0:
        return 0
    if len(content) < 8:
        raise InputError("is damaged: it ends too soon")
    (count,) = np.frombuffer(content[-4:], "<u4").tolist()
    size = 8 if version == 4 else 4
    if not (0 <= number < count and size * count + 8 <= len(content)):
        raise InputError(f"shape_index: {number} is not in the file, which has {count}")
    table = np.frombuffer(content[-4 - size * count : -4], f"<u{size}")
    start = int(table[number])
    if start + 4 > len(content):
        raise InputError("is damaged: a mesh begins behind its end")
    return start


class _Stream:
    """What is compressed, unpacked as far as it is asked for."""

    def __init__(self, content: bytes) -> None:
        self._rest, self._inflate, self._ready = content, zlib.decompressobj(), b""

    def read(self, size: int) -> bytes:
        """Raises InputError where there is less."""
        pieces, missing = [self._ready], size - len(self._ready)
        try:
            while missing > 0 and not self._inflate.eof and (self._rest or self._inflate.unconsumed_tail):
                piece = self._inflate.decompress(self._inflate.unconsumed_tail or self._rest, missing)
                self._rest = b""
                pieces.append(piece)
                missing -= len(piece)
                if not piece and not self._inflate.unconsumed_tail:
                    break
        except zlib.error:
            raise InputError("is damaged: what is compressed cannot be unpacked") from None
        found = b"".join(pieces)
        if len(found) < size:
            raise InputError("is damaged: it ends too soon")
        self._ready = found[size:]
        return found[:size]

    def numbers(self, kind: str, count: int, columns: int) -> npt.NDArray[np.float64]:
        """(count, columns)"""
        dtype = np.dtype(kind)
        found = np.frombuffer(self.read(dtype.itemsize * count * columns), dtype)
        return found.reshape(count, columns)


def _mesh(stream: _Stream, version: int) -> Mesh:
    flags = _Has(int.from_bytes(stream.read(4), "little") & 0x200B)
    if version == 4:
        while stream.read(1) != b"\0":  # the name
            pass
    vertex_count, face_count = (int.from_bytes(stream.read(8), "little") for _ in range(2))
    if max(vertex_count, face_count) > _MOST_VERTICES:
        raise InputError("is damaged: it tells of more than it holds")
    kind = "<f8" if _Has.DOUBLES in flags else "<f4"
    vertices = stream.numbers(kind, vertex_count, 3)
    normals = stream.numbers(kind, vertex_count, 3) if _Has.NORMALS in flags else None
    attributes = VertexAttributes()
    if _Has.UVS in flags:
        attributes = VertexAttributes((stream.numbers(kind, vertex_count, 2),))
    if _Has.COLORS in flags:  # which Mitsuba does not use either
        stream.numbers(kind, vertex_count, 3)
    faces = stream.numbers("<u4", face_count, 3).astype(np.int64)
    counts: dict[str, int] = {}
    mesh = usable_mesh(vertices.astype(np.float64), faces, normals, counts, attributes)
    tell_of_faces(counts)
    if mesh is None:
        raise InputError("has no usable face")
    return mesh
