"""Mesh files, read by trimesh and checked here.

trimesh is lenient where a renderer must not be: it makes up vertex normals, keeps faces that point at no
vertex, fills a Draco-compressed glTF with zeros, and raises whatever comes up on damaged files. Every way
out of this module is a usable Mesh or an InputError; what had to be left out is told by an InputWarning.

A mesh made in Python is stored as .npz (vertices, faces, normals): no interchange format keeps normals per
corner without splitting vertices.
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import json
import logging
import os
import re
import urllib.parse
import warnings
import weakref
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from incpt.errors import InputError, InputWarning, in_place, one_line
from incpt.files import check_readable, read_bytes, write_bytes
from incpt.scene import LARGEST, Material, Mesh, MeshSource

STORED_SUFFIX = "npz"
"""Of meshes that `store_mesh` writes."""
MAX_UNSTORED_ITEMS = 100_000_000
"""Of a glTF accessor without data, for which trimesh allocates zeros: a damaged count may be anything."""
DEGENERATE = 1e-12
"""Twice the area of a face over its longest edge squared: below it the face has no normal to speak of."""

_TRIMESH_SUFFIXES = ("glb", "gltf", "obj", "off", "ply", "stl", "3mf", "dae")
_UNREADABLE_EXTENSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_DRACO = "KHR_draco_mesh_compression"
_GLTF_LINES_POINTS_TRIANGLES_STRIPS = (0, 1, 4, 5)

FileKey = tuple[str, int, int]


@dataclass(frozen=True)
class MeshPart:
    """One placed geometry of a mesh file. `name` is None where the file holds only one; the material is
    that of the file (glTF), or None."""

    name: str | None
    mesh: Mesh
    material_name: str | None = None
    material: Material | None = None


_meshes: weakref.WeakValueDictionary[tuple[FileKey, str | None], Mesh] = weakref.WeakValueDictionary()
_parts: dict[FileKey, tuple[tuple[str | None, str | None, Material | None], ...]] = {}


def mesh_suffixes() -> tuple[str, ...]:
    """File name suffixes, without the dot, of the mesh files that can be read here."""
    available = trimesh.available_formats()
    return (*(suffix for suffix in _TRIMESH_SUFFIXES if suffix in available), STORED_SUFFIX)


def load_mesh(path: str | os.PathLike[str], part: str | None = None) -> Mesh:
    """The mesh of a file, or its part of that name. Raises InputError, also where the file holds several
    meshes and `part` is not given."""
    return choose_part(Path(path), load_parts(path), part).mesh


def choose_part(path: Path, parts: tuple[MeshPart, ...], name: str | None) -> MeshPart:
    """The part of that name, or the only one. Raises InputError with the names that there are."""
    if name is None and len(parts) == 1:
        return parts[0]
    for part in parts:
        if part.name == name and name is not None:
            return part
    names = [part.name for part in parts if part.name is not None]
    if not names:
        raise InputError(f"part: {path} holds one mesh without a name; leave `part` out")
    listed = ", ".join(json.dumps(n, ensure_ascii=False) for n in names[:8]) + (
        ", …" if len(names) > 8 else ""
    )
    if name is None:
        raise InputError(f"part: {path} holds {len(names)} meshes; choose one of {listed}")
    close = get_close_matches(name, names, 1)
    hint = f"did you mean {close[0]!r}?" if close else f"choose one of {listed}"
    raise InputError(f"part: {name!r} is not in {path}; {hint}")


def load_parts(path: str | os.PathLike[str]) -> tuple[MeshPart, ...]:
    """All meshes of a file, placed as the file's nodes say (baked into the vertices, winding turned where
    the placement mirrors), with shading normals only where the file brings them.

    The same file, unchanged, gives the same Mesh objects as long as they are in use. Faces with an index
    out of range, a vertex that is not finite, zero area, or that come twice are left out, with an
    InputWarning. Raises InputError: the file is missing, damaged, of an unknown type, or has no face left.
    """
    path = Path(path)
    suffix = path.suffix[1:].lower()
    status = check_readable(path)
    if suffix not in mesh_suffixes():
        raise InputError(f"{path}: is no mesh file; {readable_types()} can be read")
    key = (os.path.realpath(path), status.st_mtime_ns, status.st_size)
    known = _known_parts(key)
    if known is None:
        with in_place(str(path)):
            known = _read_stored(path) if suffix == STORED_SUFFIX else _read_with_trimesh(path, suffix)
        if suffix != "gltf":  # its vertices are in another file, whose age says nothing here
            _parts[key] = tuple((p.name, p.material_name, p.material) for p in known)
            _meshes.update({(key, p.name): p.mesh for p in known})
    return known


def readable_types() -> str:
    """The suffixes of mesh files as a list for a message."""
    return ", ".join(f".{suffix}" for suffix in mesh_suffixes())


def _known_parts(key: FileKey) -> tuple[MeshPart, ...] | None:
    result = []
    for name, material_name, material in _parts.get(key, ()):
        mesh = _meshes.get((key, name))
        if mesh is None:
            return None
        result.append(MeshPart(name, mesh, material_name, material))
    return tuple(result) or None


def store_mesh(path: Path, mesh: Mesh) -> None:
    """Writes a mesh exactly, as .npz, atomically. Raises OutputError."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **_arrays(mesh))
    write_bytes(path, content.getvalue())


def digest(mesh: Mesh) -> str:
    """A short text that differs for meshes of different content."""
    result = hashlib.sha256()
    for name, array in _arrays(mesh).items():
        result.update(f"{name}{array.shape}".encode() + array.tobytes())
    return result.hexdigest()[:12]


def _arrays(mesh: Mesh) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {"vertices": mesh.vertices, "faces": mesh.faces}
    return arrays if mesh.normals is None else {**arrays, "normals": mesh.normals}


def _read_stored(path: Path) -> tuple[MeshPart, ...]:
    try:
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in ("vertices", "faces", "normals") if name in archive}
        vertices, faces, normals = arrays["vertices"], arrays["faces"], arrays.get("normals")
        return (MeshPart(None, Mesh(vertices, faces, normals, MeshSource(file=os.path.abspath(path)))),)
    except InputError:
        raise
    except Exception:  # zipfile, zlib and numpy raise whatever comes up
        raise InputError("is no mesh archive with `vertices` and `faces`, or a damaged one") from None


def _read_with_trimesh(path: Path, suffix: str) -> tuple[MeshPart, ...]:
    header: dict[str, Any] = {}
    if suffix in ("glb", "gltf"):
        header = _gltf_header(path, suffix)
    loaded, dropped = _load_obj(path) if suffix == "obj" else (_load(path, suffix), 0)
    counts = {"in all": dropped, "with an index out of range": dropped}
    instances = _instances(loaded)
    materials = _gltf_materials(header, list(loaded.geometry))
    parts = []
    for name, geometry_name, matrix in instances:
        geometry = loaded.geometry[geometry_name]
        mesh = _placed_mesh(geometry, matrix, counts, with_normals=suffix != "stl")
        if mesh is not None:
            parts.append(MeshPart(name, mesh, *materials.get(geometry_name, (None, None))))
    left_out = ", ".join(
        f"{count} {reason}" for reason, count in counts.items() if count and reason != "in all"
    )
    if not parts:
        raise InputError(f"has no usable face ({left_out or 'no faces in the file'})")
    if left_out:
        total = counts["in all"]
        lost = sum(counts.values()) - total
        warnings.warn(f"{path}: left out {lost} of {total} faces: {left_out}", InputWarning, stacklevel=4)
    single = len(instances) == 1
    source = MeshSource(file=os.path.abspath(path))
    return tuple(
        replace(
            p,
            name=None if single else p.name,
            mesh=replace(p.mesh, source=source if single else replace(source, part=p.name)),
        )
        for p in parts
    )


@contextmanager
def _quiet() -> Iterator[list[str]]:
    """Collects what trimesh logs and drops what it and numpy warn about: the error names the problem."""
    messages: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages.append(record.getMessage())

    log = logging.getLogger("trimesh")
    handler, propagate = Collect(logging.WARNING), log.propagate
    log.addHandler(handler)
    log.propagate = False
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield messages
    finally:
        log.propagate = propagate
        log.removeHandler(handler)


def _load(path: Path, suffix: str, content: bytes | None = None) -> trimesh.Scene:
    options: dict[str, Any] = {"process": False}
    if suffix in ("obj", "ply", "glb", "gltf"):
        options["skip_materials"] = True  # textures are not used: no file but this one is opened
    if suffix == "obj":
        options |= {"split_objects": True, "group_material": False}
    try:
        with _quiet() as messages:
            stream: Any = str(path) if content is None else io.BytesIO(content)
            loaded = trimesh.load_scene(stream, file_type=suffix, **options)
    except Exception as error:  # any type at all on a damaged file; see the module's docstring
        raise InputError(f"is no {suffix.upper()} mesh, or a damaged one ({_hint(error)})") from None
    if any("placeholder zeros" in message for message in messages):
        raise InputError("is compressed in a way that cannot be decoded; export it uncompressed")
    return loaded


def _hint(error: Exception) -> str:
    text = one_line(error)[:120].rstrip(".")
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


_ODD_OBJ_FACE = re.compile(rb"^[ \t]*f[^\n\\]*[\s/](?:-|0+(?:[\s/]|$))", re.MULTILINE)
"""A face line with an index that is negative or zero."""
_OBJ_ROWS = {b"v": 0, b"vt": 1, b"vn": 2}


def _load_obj(path: Path) -> tuple[trimesh.Scene, int]:
    """An OBJ file, and how many faces were left out for a vertex index that is out of range.

    trimesh counts relative indices from the end of the file and fails altogether on one out of range:
    such files are rewritten for it.
    """
    content = _utf8(read_bytes(path))
    if not _ODD_OBJ_FACE.search(content):
        try:
            return _load(path, "obj", content), 0
        except InputError:
            pass
    try:
        content, left_out = _absolute_obj(content)
    except ValueError as error:
        raise InputError(f"is no OBJ mesh, or a damaged one ({_hint(error)})") from None
    return _load(path, "obj", content), left_out


def _utf8(content: bytes) -> bytes:
    """Text of older programs is Latin-1, for which trimesh would need another library."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()
    return content


def _absolute_obj(content: bytes) -> tuple[bytes, int]:
    """The same file with triangles only, indices counted from 1, without faces that use a vertex that is
    not there; and how many those were. Raises ValueError for an index that is no number."""
    lines = [
        (line, line.split(b"#")[0].split())
        for line in content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    ]
    totals = [sum(words[:1] == [key] for _, words in lines) for key in _OBJ_ROWS]
    counts = [0, 0, 0]
    written: list[bytes] = []
    left_out = 0
    for line, words in lines:
        if words[:1] == [b"f"]:
            corners = [_obj_corner(word, counts, totals) for word in words[1:]]
            if len(corners) < 3 or b"" in corners:
                left_out += 1
                continue
            written += [
                b" ".join((b"f", corners[0], *corners[i : i + 2])) for i in range(1, len(corners) - 1)
            ]
            continue
        if words and words[0] in _OBJ_ROWS:
            counts[_OBJ_ROWS[words[0]]] += 1
        written.append(line)
    return b"\n".join(written), left_out


def _obj_corner(word: bytes, counts: list[int], totals: list[int]) -> bytes:
    """`vertex` or `vertex//normal`, counted from 1; nothing where the vertex is not there."""
    fields = word.split(b"/")
    absolute = []
    for row in (0, 2):
        index = int(fields[row]) if len(fields) > row and fields[row] else 0
        index += counts[row] + 1 if index < 0 else 0
        absolute.append(index if 1 <= index <= totals[row] else None)
    vertex, normal = absolute
    if vertex is None:
        return b""
    return b"%d" % vertex if normal is None else b"%d//%d" % (vertex, normal)


def _instances(loaded: trimesh.Scene) -> list[tuple[str, str, npt.NDArray[np.float64]]]:
    """(name, name of the geometry, (4, 4) placement) of every placed triangle mesh.

    Ordered by geometry, then by name. A glTF node with several primitives gets random frame names from
    trimesh: its parts are numbered instead, so that they are the same the next time.
    """
    order = {name: index for index, name in enumerate(loaded.geometry)}
    parents = {child: parent for parent, child, _ in loaded.graph.to_edgelist()}  # type: ignore[no-untyped-call]
    found = []
    for node in loaded.graph.nodes_geometry:
        matrix, geometry_name = loaded.graph.get(node)
        mesh = loaded.geometry.get(geometry_name)
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            numbered = mesh.metadata.get("from_gltf_primitive") is True
            name = str(parents[node] if numbered else node)
            found.append((order[geometry_name], name, str(geometry_name), matrix))
    uses = Counter(name for _, name, _, _ in found)
    used: set[str] = set()
    result: list[tuple[str, str, npt.NDArray[np.float64]]] = []
    for _, name, geometry, matrix in sorted(found, key=lambda item: item[:2]):
        unique, number = (f"{name}.1", 1) if uses[name] > 1 else (name or "part", 1)
        while unique in used:
            number += 1
            unique = f"{name or 'part'}.{number}"
        used.add(unique)
        result.append((unique, geometry, np.asarray(matrix, np.float64)))
    return result


def _placed_mesh(
    geometry: trimesh.Trimesh, matrix: npt.NDArray[np.float64], counts: dict[str, int], with_normals: bool
) -> Mesh | None:
    """The geometry in the space of the file, without its unusable faces, which are added to `counts`."""
    vertices = np.asarray(geometry.vertices, np.float64)
    faces = np.asarray(geometry.faces, np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError("has vertices without three coordinates; the file is damaged")
    normals: npt.NDArray[np.float64] | None = None
    # Normals stand in the cache only where the loader put them; the property makes them up.
    if with_normals and "vertex_normals" in geometry._cache:
        normals = np.asarray(geometry.vertex_normals, np.float64)
        normals = normals if normals.shape == vertices.shape else None
    if not np.array_equal(matrix, np.eye(4)):
        with np.errstate(all="ignore"):
            linear = matrix[:3, :3]
            vertices = vertices @ linear.T + matrix[:3, 3]
            if normals is not None:
                # The cofactor matrix is det · inverse transpose, and exists for flat placements too.
                x, y, z = linear.T
                cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
                normals = normals @ cofactors.T * np.sign(np.linalg.det(linear))
            if np.linalg.det(linear) < 0:
                faces = faces[:, ::-1]
    with np.errstate(all="ignore"):
        stored = vertices.astype(np.float32)
    usable = _usable_faces(stored, faces, counts)
    if not usable.any():
        return None
    finite = np.all(np.abs(stored) <= LARGEST, axis=1)
    stored = np.where(finite[:, None], stored, np.float32(0))  # no face uses those any more
    faces = faces[usable]
    corner_normals = None if normals is None else _corner_normals(stored, faces, normals)
    return Mesh(stored, faces.astype(np.int32), corner_normals)


def _usable_faces(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64], counts: dict[str, int]
) -> npt.NDArray[np.bool_]:
    """(F,) which faces to keep; the reasons against the others are counted."""
    usable: npt.NDArray[np.bool_] = np.all((faces >= 0) & (faces < len(vertices)), axis=1)
    in_range = np.where(usable[:, None], faces, 0)
    _count(counts, "in all", len(faces))
    _count(counts, "with an index out of range", int((~usable).sum()))
    if not len(vertices):
        return usable
    finite = np.all(np.abs(vertices) <= LARGEST, axis=1)  # False for NaN too
    bad = usable & ~finite[in_range].all(axis=1)
    _count(counts, "with a vertex that is not finite or too far away", int(bad.sum()))
    usable &= ~bad
    with np.errstate(all="ignore"):
        a, b, c = (vertices[in_range[:, corner]].astype(np.float64) for corner in range(3))
        ab, ac, bc = b - a, c - a, c - b
        longest = np.maximum(np.maximum((ab**2).sum(axis=1), (ac**2).sum(axis=1)), (bc**2).sum(axis=1))
        area = np.linalg.norm(np.cross(ab, ac), axis=1)
        bad = usable & ~(area > DEGENERATE * longest)
    _count(counts, "with zero area", int(bad.sum()))
    usable &= ~bad
    bad = usable & _repeated(vertices, in_range, usable)
    _count(counts, "that come twice", int(bad.sum()))
    return usable & ~bad


def _count(counts: dict[str, int], reason: str, number: int) -> None:
    counts[reason] = counts.get(reason, 0) + number


def _repeated(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64], usable: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """(F,) which usable faces have the corner positions and the winding of an earlier one.

    By position, not by index: formats without shared vertices repeat them too. Rotating the corners so
    that the least comes first makes equal faces equal rows.
    """
    rows = np.ascontiguousarray(vertices + np.float32(0)).view(np.dtype((np.void, 12))).ravel()
    _, place = np.unique(rows, return_inverse=True)
    corners = place[faces[usable]]
    turn = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, turn, axis=1)
    order = np.lexsort(corners.T)  # stable: the first of equal faces comes first
    again = np.zeros(len(corners), bool)
    again[order[1:]] = np.all(corners[order[1:]] == corners[order[:-1]], axis=1)
    result: npt.NDArray[np.bool_] = np.zeros(len(faces), bool)
    result[usable] = again
    return result


def _corner_normals(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int64], normals: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
    """(F, 3, 3) unit normals; the face's own where the file's have no direction."""
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = normals / lengths
    usable = (np.isfinite(unit).all(axis=1) & (lengths[:, 0] > 1e-12))[faces]
    corners = unit[faces]
    if not usable.all():
        a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
        flat = np.cross(b - a, c - a)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        corners = np.where(usable[..., None], corners, flat[:, None, :])
    result: npt.NDArray[np.float32] = corners.astype(np.float32)
    return result


def _gltf_header(path: Path, suffix: str) -> dict[str, Any]:
    """The JSON of a glTF file, after a check for what trimesh reads wrongly. Raises InputError."""
    content = read_bytes(path)
    try:
        if suffix == "glb":
            if content[:4] != b"glTF" or content[16:20] != b"JSON":
                raise InputError("is no GLB mesh, or a damaged one (its header does not say glTF 2.0)")
            length = int.from_bytes(content[12:16], "little")
            content = content[20 : 20 + length]
        header = json.loads(content)
        _check_gltf(header, path)
    except InputError:
        raise
    except Exception as error:  # JSON of any shape: a list for a table, a text for a number …
        raise InputError(f"is no {suffix.upper()} mesh, or a damaged one ({_hint(error)})") from None
    result: dict[str, Any] = header
    return result


def _check_gltf(header: dict[str, Any], path: Path) -> None:
    required = {*header.get("extensionsRequired", []), *header.get("extensionsUsed", [])}
    for extension in _UNREADABLE_EXTENSIONS:
        if extension in required:
            raise InputError(f"uses {extension}, which cannot be decoded; export it uncompressed")
    for buffer in header.get("buffers", []):
        uri = buffer.get("uri", "data:")
        if not uri.startswith("data:"):
            check_readable(path.parent / urllib.parse.unquote(uri))
    accessors = header.get("accessors", [])
    for accessor in accessors:
        if "bufferView" not in accessor and int(accessor["count"]) > MAX_UNSTORED_ITEMS:
            raise InputError(f"claims {accessor['count']} values without storing them; the file is damaged")
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            _check_primitive(primitive, accessors)


def _check_primitive(primitive: dict[str, Any], accessors: list[dict[str, Any]]) -> None:
    if _DRACO in primitive.get("extensions", {}):
        if importlib.util.find_spec("DracoPy") is None:
            raise InputError("is Draco-compressed; install DracoPy, or export it uncompressed")
        return
    attributes = primitive["attributes"]
    used = [attributes[name] for name in ("POSITION", "NORMAL") if name in attributes]
    used += [primitive["indices"]] if "indices" in primitive else []
    for accessor in (accessors[index] for index in used):
        if "bufferView" not in accessor or "sparse" in accessor:
            raise InputError(
                "has vertices or faces that are stored sparsely, which cannot be read; export it plain"
            )
    if accessors[attributes["POSITION"]].get("normalized"):
        raise InputError("has quantised positions, which cannot be read; export them as floats")


def _gltf_materials(
    header: dict[str, Any], geometries: list[str]
) -> dict[str, tuple[str | None, Material | None]]:
    """Material by name of trimesh's geometry, which is one for every primitive, in the file's order."""
    primitives = [
        primitive
        for mesh in header.get("meshes", [])
        for primitive in mesh["primitives"]
        if primitive.get("mode", 4) in _GLTF_LINES_POINTS_TRIANGLES_STRIPS
    ]
    if len(primitives) != len(geometries):
        return {}
    result: dict[str, tuple[str | None, Material | None]] = {}
    for name, primitive in zip(geometries, primitives, strict=True):
        try:
            index = primitive["material"]
            table = header["materials"][index]
            result[name] = (str(table.get("name") or f"material {index}"), _gltf_material(table))
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            continue  # a material that is not there or out of range: the default one is used
    return result


def _gltf_material(table: dict[str, Any]) -> Material:
    """Factors of a glTF 2.0 material and of its KHR extensions ior, specular, transmission, volume and
    emissive_strength; textures are left out."""
    surface = table.get("pbrMetallicRoughness", {})
    extensions = table.get("extensions", {})

    def factor(extension: str, key: str, default: Any) -> Any:
        return extensions.get(f"KHR_materials_{extension}", {}).get(key, default)

    strength = factor("emissive_strength", "emissiveStrength", 1.0)
    distance = factor("volume", "attenuationDistance", np.inf)
    attenuation = np.clip(factor("volume", "attenuationColor", [1.0, 1.0, 1.0]), 1e-6, 1.0)
    return Material(
        base_color=tuple(surface.get("baseColorFactor", [1.0, 1.0, 1.0])[:3]),
        metallic=surface.get("metallicFactor", 1.0),
        roughness=surface.get("roughnessFactor", 1.0),
        specular=factor("specular", "specularFactor", 1.0),
        ior=factor("ior", "ior", 1.5),
        transmission=factor("transmission", "transmissionFactor", 0.0),
        absorption=tuple((-np.log(attenuation) / distance).tolist()),
        emission=tuple(float(e) * strength for e in table.get("emissiveFactor", [0.0, 0.0, 0.0])),
        double_sided=table.get("doubleSided", False),
    )
