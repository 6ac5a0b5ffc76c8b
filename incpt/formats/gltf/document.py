"""A glTF file as its JSON and its buffers: containers, versions, extensions, and the files that it names."""

from __future__ import annotations

import base64
import binascii
import json
import re
import urllib.parse
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from incpt.core.checks import described
from incpt.core.errors import InputError, one_line, reason_of
from incpt.core.files import check_readable, read_bytes
from incpt.formats import import_report
from incpt.formats.gltf.table import Table
from incpt.formats.outside import check_inside

MATERIAL_EXTENSIONS = tuple(
    f"KHR_materials_{name}"
    for name in (
        "anisotropy", "clearcoat", "diffuse_transmission", "dispersion", "emissive_strength", "ior",
        "iridescence", "pbrSpecularGlossiness", "sheen", "specular", "transmission", "unlit", "volume",
    )
)  # fmt: skip
EXTENSIONS = (
    *MATERIAL_EXTENSIONS,
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_variants",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
)
"""All that are read, or told of where they come up."""
_GLB_HEADER = 12
_CHUNK_HEADER = 8


class Document:
    """A file, its JSON and its buffers. What is read of buffers stays in memory as long as this does; `files`
    are those beside it that were read."""

    def __init__(self, path: Path) -> None:
        """Raises InputError: no glTF 2.0, a damaged file, or one that requires an unknown extension."""
        self.path = path
        self.files: list[Path] = []
        content = memoryview(read_bytes(path))
        self._binary: memoryview | None = None
        if path.suffix.lower() == ".glb":
            content, self._binary = _chunks(content)
        self._json = _parsed(content, path)
        self.root = Table(self._json, "")
        _check_version(self.root.table("asset"))
        self._buffers: dict[int, memoryview] = {}
        self._size: int | None = None

    def size(self) -> int:
        """Bytes of the file and of the buffers beside it. Raises InputError."""
        if self._size is None:
            uris = [table.text("uri", "data:") for table in self.root.tables("buffers")]
            beside = [self.file(uri) for uri in uris if not uri.startswith("data:")]
            self._size = sum(check_readable(file).st_size for file in (self.path, *beside))
        return self._size

    @property
    def has_binary(self) -> bool:
        """Whether the file holds a buffer itself, as .glb files do."""
        return self._binary is not None

    def check_extensions(self) -> None:
        """Tells of the extensions that are unknown. Raises InputError where one of them is required."""
        for name in self.root.entries("extensionsRequired"):
            if name not in EXTENSIONS:
                raise InputError(
                    f"requires the extension {described(name)}, which cannot be read; export it without"
                )
        listed = [name for name in self.root.entries("extensionsUsed") if isinstance(name, str)]
        for name in sorted({*listed, *_used(self.root)} - {*EXTENSIONS}):
            import_report.left_out(f"the extension {name}: is unknown here")

    def put(self, pointer: str, value: object) -> None:
        """Puts a value into the JSON, where a JSON pointer (RFC 6901) says; objects on the way that are not
        there are made. Raises InputError."""
        *steps, last = [step.replace("~1", "/").replace("~0", "~") for step in pointer.split("/")[1:]]
        owner: Any = self._json
        for step in steps:
            if isinstance(owner, dict):
                owner = owner.setdefault(step, {})
            else:
                owner = owner[_place_in(owner, step, pointer)]
        if isinstance(owner, dict):
            owner[last] = value
        else:
            owner[_place_in(owner, last, pointer)] = value

    def content(self, number: int) -> memoryview:
        """A buffer, at least as long as it says. Raises InputError."""
        if number not in self._buffers:
            table = self.root.item("buffers", number)
            with table.in_messages():
                self._buffers[number] = self._read(table, number)
        return self._buffers[number]

    def _read(self, table: Table, number: int) -> memoryview:
        length = table.whole("byteLength", 0, 1 << 53)
        if "uri" not in table:
            if number or self._binary is None:
                raise InputError("names no file; the file is damaged")
            content = self._binary
        else:
            content = memoryview(self.uri(table.text("uri"))[0])
        if len(content) < length:
            raise InputError(f"says that it has {length} bytes, but has {len(content)}; the file is damaged")
        return content[:length]

    def uri(self, uri: str) -> tuple[bytes, str]:
        """The content of a URI, and the type that a data URI says it is of. Raises InputError."""
        if uri.startswith("data:"):
            return _data_uri(uri)
        return read_bytes(self.file(uri)), ""

    def file(self, uri: str) -> Path:
        """The file that a URI names, which stays in the folder of this one unless the options let it. Raises
        InputError."""
        path = _local_path(uri)
        check_inside(self.path.parent, path)
        found = self.path.parent / path
        self.files.append(found)
        return found

    def item(self, kind: str, number: int) -> Table:
        """An entry of one of the lists of the file, such as "meshes". Raises InputError."""
        return self.root.item(kind, number)


def _place_in(values: Any, step: str, pointer: str) -> int:
    """The place in a list to which a step of a pointer leads. Raises InputError."""
    if isinstance(values, list) and re.fullmatch(r"\d{1,9}", step) and int(step) < len(values):
        return int(step)
    raise InputError(f"pointer {described(pointer)}: leads to nothing; the file is damaged")


def _parsed(content: memoryview, path: Path) -> Any:
    try:
        return json.loads(bytes(content).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        kind = path.suffix[1:].upper()
        raise InputError(f"is no {kind} mesh, or a damaged one ({reason_of(error)})") from None


def _chunks(content: memoryview) -> tuple[memoryview, memoryview | None]:
    """The JSON of a .glb file, and its binary chunk, if there is one. Raises InputError."""
    damaged = "is no GLB mesh, or a damaged one"
    if len(content) < _GLB_HEADER + _CHUNK_HEADER or bytes(content[:4]) != b"glTF":
        raise InputError(f"{damaged} (its header does not say glTF)")
    version = int.from_bytes(content[4:8], "little")
    if version != 2:
        raise InputError(f"{damaged} (its header says version {version}); convert it to glTF 2.0")
    found: dict[bytes, memoryview] = {}
    start = _GLB_HEADER
    while start + _CHUNK_HEADER <= len(content):
        length, kind = int.from_bytes(content[start : start + 4], "little"), bytes(content[start + 4 :][:4])
        start += _CHUNK_HEADER
        if length > len(content) - start:
            raise InputError(f"{damaged} (a part of {length} bytes reaches beyond its end)")
        found.setdefault(kind, content[start : start + length])
        start += length
    if b"JSON" not in found:
        raise InputError(f"{damaged} (it has no JSON)")
    return found[b"JSON"], found.get(b"BIN\0")


def _check_version(asset: Table) -> None:
    # Older files have a number there.
    version = str(asset.any("version") or "")
    if not re.match(r"2\.\d", version):
        said = f"glTF {one_line(version)[:20]}" if version else "no version of glTF"
        raise InputError(f"asset.version: says {said}; convert the file to glTF 2.0")
    least = asset.text("minVersion", "2.0")
    if least != "2.0":
        raise InputError(f"asset.minVersion: asks for glTF {least}; export the file as glTF 2.0")


def _used(root: Table) -> set[str]:
    """The names of all extensions that anything in the JSON has."""
    found: set[str] = set()
    left: list[Any] = [root.any(key) for key in root] + [{"extensions": root.any("extensions")}]
    while left:
        value = left.pop()
        if isinstance(value, dict):
            extensions = value.get("extensions")
            if isinstance(extensions, dict):
                found |= extensions.keys()
            left += value.values()
        elif isinstance(value, list):
            # Most lists are of numbers, and all entries are of one type.
            left += value if value and isinstance(value[0], (dict, list)) else []
    return found


def _local_path(uri: str) -> str:
    """The path, of this system, of a URI that names a file. Raises InputError."""
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", uri)
    if scheme and scheme[1].lower() != "file":
        raise InputError(f"{described(uri)} is not a file; get it, and name it relative to this one")
    path = urllib.parse.unquote(urllib.parse.urlsplit(uri).path if scheme else uri).replace("\\", "/")
    if "\0" in path or not path:
        raise InputError(f"{described(uri)} names no file; the file is damaged")
    # file:///C:/textures/a.png has a slash in front of the drive.
    return path[1:] if PureWindowsPath(path[1:]).drive and PurePosixPath(path).is_absolute() else path


def _data_uri(uri: str) -> tuple[bytes, str]:
    head, _, text = uri.partition(",")
    try:
        if head.endswith(";base64"):
            return base64.b64decode(text), head[5:-7]
        return urllib.parse.unquote_to_bytes(text), head[5:]
    except (binascii.Error, ValueError):
        raise InputError("has a data URI that is no base64; the file is damaged") from None
