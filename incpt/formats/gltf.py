"""glTF: what must be refused before trimesh reads the file, and materials, which trimesh leaves out."""

from __future__ import annotations

import importlib.util
import json
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np

from incpt.core.errors import InputError, reason_of
from incpt.core.files import check_readable, read_bytes
from incpt.scene.material import Material

MAX_UNSTORED_ITEMS = 100_000_000
"""The most values that an accessor without data may claim. trimesh allocates zeros for them, and the count of
a damaged file may be anything."""
_UNREADABLE_EXTENSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_DRACO = "KHR_draco_mesh_compression"
_GLTF_LINES_POINTS_TRIANGLES_STRIPS = (0, 1, 4, 5)


def gltf_header(path: Path, suffix: str) -> dict[str, Any]:
    """The JSON of a .glb or .gltf file (`suffix` without its dot), after a check for what trimesh reads
    wrongly. Raises InputError."""
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
    except Exception as error:  # JSON may have any shape: a list for a table, a text for a number …
        raise InputError(f"is no {suffix.upper()} mesh, or a damaged one ({reason_of(error)})") from None
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


def gltf_materials(
    header: dict[str, Any], geometries: list[str]
) -> dict[str, tuple[str | None, Material | None]]:
    """Name and material by name of trimesh's geometry; empty where the two cannot be matched.

    `header` is what `gltf_header` returns. trimesh makes a geometry of every primitive, in the file's order,
    which are `geometries` here.
    """
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
            continue  # The default material is used in place of one that is missing or out of range.
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
