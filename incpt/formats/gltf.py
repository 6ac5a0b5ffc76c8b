"""glTF: what must be refused before trimesh reads the file, and what trimesh leaves out: materials with their
textures, texture coordinates, colours, tangents."""

from __future__ import annotations

import importlib.util
import json
import urllib.parse
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, InputWarning, in_place, reason_of
from incpt.core.files import check_readable, read_bytes
from incpt.formats.gltf_data import GltfData
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.checks import LARGEST, checked_number
from incpt.scene.material import (
    LARGEST_CUTOFF,
    LARGEST_DISPERSION,
    LARGEST_SLOPE,
    THICKEST_FILM,
    Material,
)
from incpt.scene.texture import UV_SETS, Texture

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


def gltf_attributes(data: GltfData, geometries: list[str]) -> dict[str, VertexAttributes]:
    """Texture coordinates, colours and tangents by name of trimesh's geometry; see `gltf_materials`."""
    found = {}
    for name, primitive in _matched(data, geometries).items():
        accessors = primitive.get("attributes", {})

        def values(attribute: str, accessors: dict[str, int] = accessors) -> npt.NDArray[np.float64] | None:
            return data.values(accessors[attribute]) if attribute in accessors else None

        sets = [values(f"TEXCOORD_{number}") for number in range(UV_SETS)]
        # The second set without a first one stays the second.
        uvs = [one for one in sets if one is not None] if sets[0] is not None else []
        if sets[0] is None and sets[1] is not None:
            uvs = [np.zeros_like(sets[1]), sets[1]]
        colors = values("COLOR_0")
        if colors is not None and colors.shape[1] == 3:
            colors = np.column_stack([colors, np.ones(len(colors))])
        found[name] = VertexAttributes(tuple(uvs), colors, values("TANGENT"))
    return found


def gltf_materials(data: GltfData, geometries: list[str]) -> dict[str, tuple[str | None, Material | None]]:
    """Name and material by name of trimesh's geometry; empty where the two cannot be matched.

    trimesh makes a geometry of every primitive, in the file's order, which are `geometries` here.
    """
    result: dict[str, tuple[str | None, Material | None]] = {}
    made: dict[int, tuple[str, Material]] = {}
    for name, primitive in _matched(data, geometries).items():
        try:
            index = primitive["material"]
            if index not in made:
                table = data.header["materials"][index]
                label = str(table.get("name") or f"material {index}")
                with in_place(f"material {label!r}"):
                    made[index] = label, _gltf_material(table, data, label)
            result[name] = made[index]
        except InputError:
            raise
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration):
            continue  # The default material is used in place of one that is missing or out of range.
    return result


def embedded_image(path: Path, index: int) -> tuple[bytes, str]:
    """The content of an image of a glTF file, by number, and the suffix of such files. Raises InputError."""
    suffix = path.suffix[1:].lower()
    if suffix not in ("glb", "gltf"):
        raise InputError("has no images by number; leave `image` out")
    data = GltfData(path, gltf_header(path, suffix))
    count = len(data.header.get("images", []))
    if index >= count:
        raise InputError(f"image: {index} is not in the file, which has {count}")
    try:
        return data.image(index)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"image {index}: cannot be read ({reason_of(error)})") from None


def _matched(data: GltfData, geometries: list[str]) -> dict[str, dict[str, Any]]:
    """Primitives by the name of trimesh's geometry; empty where the two cannot be matched."""
    primitives = [
        primitive
        for mesh in data.header.get("meshes", [])
        for primitive in mesh["primitives"]
        if primitive.get("mode", 4) in _GLTF_LINES_POINTS_TRIANGLES_STRIPS
    ]
    return dict(zip(geometries, primitives, strict=True)) if len(primitives) == len(geometries) else {}


def _gltf_material(table: dict[str, Any], data: GltfData, label: str) -> Material:
    """A glTF 2.0 material with what its KHR extensions say: anisotropy, clearcoat, diffuse_transmission,
    dispersion, emissive_strength, ior, iridescence, sheen, specular, transmission, unlit and volume. Textures
    whose references are damaged are left out, with an InputWarning."""
    surface = table.get("pbrMetallicRoughness", {})
    extensions = table.get("extensions", {})

    def factor(extension: str, key: str, default: Any) -> Any:
        return extensions.get(f"KHR_materials_{extension}", {}).get(key, default)

    def number(extension: str, key: str, default: float) -> float:
        return checked_number(key, factor(extension, key, default), -LARGEST, LARGEST)

    def texture(of: dict[str, Any] | None) -> Texture | None:
        try:
            return None if of is None else data.texture(of)
        except InputError:
            raise
        except Exception as error:  # A reference may be missing, out of range, or of any type.
            text = f"{data.path}: material {label!r}: left out a texture that cannot be found"
            warnings.warn(f"{text} ({reason_of(error)})", InputWarning, stacklevel=2)
            return None

    def normal_scale(of: dict[str, Any] | None) -> float:
        return float(np.clip((of or {}).get("scale", 1.0), -LARGEST_SLOPE, LARGEST_SLOPE))

    transmission = number("transmission", "transmissionFactor", 0.0)
    strength = factor("emissive_strength", "emissiveStrength", 1.0)
    distance = factor("volume", "attenuationDistance", np.inf)
    attenuation = np.clip(factor("volume", "attenuationColor", [1.0, 1.0, 1.0]), 1e-6, 1.0)
    return Material(
        base_color=tuple(surface.get("baseColorFactor", [1.0, 1.0, 1.0])[:3]),
        metallic=surface.get("metallicFactor", 1.0),
        roughness=surface.get("roughnessFactor", 1.0),
        specular=factor("specular", "specularFactor", 1.0),
        ior=factor("ior", "ior", 1.5),
        transmission=transmission,
        thin_walled=transmission > 0 and not number("volume", "thicknessFactor", 0.0) > 0,
        dispersion=min(number("dispersion", "dispersion", 0.0), LARGEST_DISPERSION),
        specular_color=factor("specular", "specularColorFactor", (1.0, 1.0, 1.0)),
        clearcoat=factor("clearcoat", "clearcoatFactor", 0.0),
        clearcoat_roughness=factor("clearcoat", "clearcoatRoughnessFactor", 0.0),
        clearcoat_normal_scale=normal_scale(factor("clearcoat", "clearcoatNormalTexture", None)),
        sheen_color=factor("sheen", "sheenColorFactor", (0.0, 0.0, 0.0)),
        sheen_roughness=factor("sheen", "sheenRoughnessFactor", 0.0),
        anisotropy=factor("anisotropy", "anisotropyStrength", 0.0),
        anisotropy_rotation=float(np.degrees(number("anisotropy", "anisotropyRotation", 0.0)) % 360),
        iridescence=factor("iridescence", "iridescenceFactor", 0.0),
        iridescence_ior=factor("iridescence", "iridescenceIor", 1.3),
        iridescence_thickness=min(number("iridescence", "iridescenceThicknessMaximum", 400.0), THICKEST_FILM),
        iridescence_least_thickness=min(
            number("iridescence", "iridescenceThicknessMinimum", 100.0), THICKEST_FILM
        ),
        diffuse_transmission=factor("diffuse_transmission", "diffuseTransmissionFactor", 0.0),
        diffuse_transmission_color=factor(
            "diffuse_transmission", "diffuseTransmissionColorFactor", (1.0, 1.0, 1.0)
        ),
        unlit="KHR_materials_unlit" in extensions,
        absorption=tuple((-np.log(attenuation) / distance).tolist()),
        emission=tuple(float(e) * strength for e in table.get("emissiveFactor", [0.0, 0.0, 0.0])),
        double_sided=table.get("doubleSided", False),
        alpha=surface.get("baseColorFactor", [1.0, 1.0, 1.0, 1.0])[3],
        alpha_mode=str(table.get("alphaMode", "OPAQUE")).lower(),
        alpha_cutoff=min(table.get("alphaCutoff", 0.5), LARGEST_CUTOFF),
        normal_scale=normal_scale(table.get("normalTexture")),
        base_color_texture=texture(surface.get("baseColorTexture")),
        metallic_roughness_texture=texture(surface.get("metallicRoughnessTexture")),
        normal_texture=texture(table.get("normalTexture")),
        emission_texture=texture(table.get("emissiveTexture")),
        transmission_texture=texture(factor("transmission", "transmissionTexture", None)),
        specular_texture=texture(factor("specular", "specularTexture", None)),
        specular_color_texture=texture(factor("specular", "specularColorTexture", None)),
        clearcoat_texture=texture(factor("clearcoat", "clearcoatTexture", None)),
        clearcoat_roughness_texture=texture(factor("clearcoat", "clearcoatRoughnessTexture", None)),
        clearcoat_normal_texture=texture(factor("clearcoat", "clearcoatNormalTexture", None)),
        sheen_color_texture=texture(factor("sheen", "sheenColorTexture", None)),
        sheen_roughness_texture=texture(factor("sheen", "sheenRoughnessTexture", None)),
        anisotropy_texture=texture(factor("anisotropy", "anisotropyTexture", None)),
        iridescence_texture=texture(factor("iridescence", "iridescenceTexture", None)),
        iridescence_thickness_texture=texture(factor("iridescence", "iridescenceThicknessTexture", None)),
        diffuse_transmission_texture=texture(
            factor("diffuse_transmission", "diffuseTransmissionTexture", None)
        ),
        diffuse_transmission_color_texture=texture(
            factor("diffuse_transmission", "diffuseTransmissionColorTexture", None)
        ),
    )
