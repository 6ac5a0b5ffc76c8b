"""Materials as glTF has them: metal and roughness with the ratified extensions. What stands at its default is
left away, and so is an extension that says nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from incpt.formats.gltf_writer.container import Container
from incpt.formats.gltf_writer.images import Images
from incpt.formats.gltf_writer.losses import Losses
from incpt.scene.material import Material
from incpt.scene.texture import Texture

_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
_THICKNESS = 1.0
"""Metres: any number but 0 makes a body. It is for renderers that do not follow light through it."""
_SHORTEST = 1e-6
"""The least distance of attenuation that is read back, metres."""

Entry = tuple[str, str, Any]
"""A key, the parameter of the material that it holds, and its default in glTF."""
_EXTENSIONS: Mapping[str, tuple[Entry, ...]] = {
    "specular": (
        ("specularFactor", "specular", 1.0),
        ("specularTexture", "specular_texture", None),
        ("specularColorFactor", "specular_color", _WHITE),
        ("specularColorTexture", "specular_color_texture", None),
    ),
    "ior": (("ior", "ior", 1.5),),
    "transmission": (
        ("transmissionFactor", "transmission", 0.0),
        ("transmissionTexture", "transmission_texture", None),
    ),
    "dispersion": (("dispersion", "dispersion", 0.0),),
    "diffuse_transmission": (
        ("diffuseTransmissionFactor", "diffuse_transmission", 0.0),
        ("diffuseTransmissionTexture", "diffuse_transmission_texture", None),
        ("diffuseTransmissionColorFactor", "diffuse_transmission_color", _WHITE),
        ("diffuseTransmissionColorTexture", "diffuse_transmission_color_texture", None),
    ),
    "clearcoat": (
        ("clearcoatFactor", "clearcoat", 0.0),
        ("clearcoatTexture", "clearcoat_texture", None),
        ("clearcoatRoughnessFactor", "clearcoat_roughness", 0.0),
        ("clearcoatRoughnessTexture", "clearcoat_roughness_texture", None),
        ("clearcoatNormalTexture", "clearcoat_normal_texture", None),
    ),
    "sheen": (
        ("sheenColorFactor", "sheen_color", _BLACK),
        ("sheenColorTexture", "sheen_color_texture", None),
        ("sheenRoughnessFactor", "sheen_roughness", 0.0),
        ("sheenRoughnessTexture", "sheen_roughness_texture", None),
    ),
    "anisotropy": (
        ("anisotropyStrength", "anisotropy", 0.0),
        ("anisotropyTexture", "anisotropy_texture", None),
    ),
    "iridescence": (
        ("iridescenceFactor", "iridescence", 0.0),
        ("iridescenceTexture", "iridescence_texture", None),
        ("iridescenceIor", "iridescence_ior", 1.3),
        ("iridescenceThicknessMinimum", "iridescence_least_thickness", 100.0),
        ("iridescenceThicknessMaximum", "iridescence_thickness", 400.0),
        ("iridescenceThicknessTexture", "iridescence_thickness_texture", None),
    ),
}  # fmt: skip
_SURFACE: tuple[Entry, ...] = (
    ("metallicFactor", "metallic", 1.0),
    ("roughnessFactor", "roughness", 1.0),
    ("baseColorTexture", "base_color_texture", None),
    ("metallicRoughnessTexture", "metallic_roughness_texture", None),
)
_COLORS = (
    "base_color_texture", "emission_texture", "specular_color_texture", "sheen_color_texture",
    "diffuse_transmission_color_texture",
)  # fmt: skip
"""Textures whose bytes are colours in sRGB."""
_SCALES = {"normal_texture": "normal_scale", "clearcoat_normal_texture": "clearcoat_normal_scale"}


class MaterialWriter:
    """Writes each material once."""

    def __init__(self, container: Container, losses: Losses) -> None:
        self._container, self._losses, self._images = container, losses, Images(container)
        self._numbers: dict[tuple[str, Material], int] = {}

    def number(self, name: str, material: Material) -> int:
        """The number of a material in the file."""
        key = name, material
        if key not in self._numbers:
            self._numbers[key] = self._container.add("materials", self._table(name, material))
            self._losses.note("material", name, _lost(material))
        return self._numbers[key]

    def _table(self, name: str, material: Material) -> dict[str, Any]:
        surface = self._entries(material, _SURFACE)
        color = (*material.base_color, material.alpha)
        if color != (1.0,) * 4:
            surface = {"baseColorFactor": list(color), **surface}
        table: dict[str, Any] = {"name": name}
        if surface:
            table["pbrMetallicRoughness"] = surface
        table |= self._entries(material, (
            ("normalTexture", "normal_texture", None),
            ("emissiveTexture", "emission_texture", None),
            ("doubleSided", "double_sided", False),
        ))  # fmt: skip
        if material.alpha_mode != "opaque":
            table["alphaMode"] = material.alpha_mode.upper()
            if material.alpha_mode == "mask":
                table["alphaCutoff"] = material.alpha_cutoff
        extensions = self._extensions(material)
        strength = max(*material.emission, 1.0)
        if any(material.emission):
            table["emissiveFactor"] = [e / strength for e in material.emission]
        if strength > 1:
            extensions |= self._extension("emissive_strength", {"emissiveStrength": strength})
        return {**table, "extensions": extensions} if extensions else table

    def _extensions(self, material: Material) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, entries in _EXTENSIONS.items():
            table = self._entries(material, entries)
            if name == "anisotropy" and material.anisotropy_rotation:
                table["anisotropyRotation"] = math.radians(material.anisotropy_rotation)
            if table:
                found |= self._extension(name, table)
        if material.transmission > 0 and not material.thin_walled:
            found |= self._extension("volume", _volume(material))
        if material.unlit:
            found |= self._extension("unlit", {})
        return found

    def _extension(self, name: str, table: dict[str, Any]) -> dict[str, Any]:
        return self._container.extension(f"KHR_materials_{name}", table)

    def _entries(self, material: Material, entries: tuple[Entry, ...]) -> dict[str, Any]:
        """Those that are not at their defaults, as JSON has them."""
        found: dict[str, Any] = {}
        for key, name, default in entries:
            value = getattr(material, name)
            if isinstance(value, Texture):
                table = self._images.texture(value, name in _COLORS)
                scale = getattr(material, _SCALES[name]) if name in _SCALES else 1.0
                found[key] = table if scale == 1 else {**table, "scale": scale}
            elif value != default:
                found[key] = list(value) if isinstance(value, tuple) else value
        return found


def _volume(material: Material) -> dict[str, Any]:
    """A body. Its colour is what is left after the distance at which the channel that is absorbed most has
    fallen to 1/e."""
    most = max(material.absorption)
    table: dict[str, Any] = {"thicknessFactor": _THICKNESS}
    if most > 0:
        distance = max(1 / most, _SHORTEST)
        color = [math.exp(-one * distance) for one in material.absorption]
        table |= {"attenuationDistance": distance, "attenuationColor": color}
    return table


def _lost(material: Material) -> list[str]:
    """What glTF has no place for."""
    lost = ["priority among nested bodies"] if material.priority and material.is_body else []
    return lost if material.bump_texture is None else [*lost, "height map"]
