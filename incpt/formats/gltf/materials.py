"""Materials of glTF files: metal and roughness with the ratified extensions, and specular with glossiness."""

from __future__ import annotations

import math
import weakref
from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np

from incpt.core.checks import one_of
from incpt.core.errors import InputError, in_place
from incpt.formats import import_report
from incpt.formats.gltf.document import Document
from incpt.formats.gltf.table import Table
from incpt.formats.gltf.textures import Textures
from incpt.formats.names import Names
from incpt.scene.checks import LARGEST
from incpt.scene.material import (
    LARGEST_CUTOFF,
    LARGEST_DISPERSION,
    LARGEST_SLOPE,
    THICKEST_FILM,
    Material,
)
from incpt.scene.texture import Bitmap, Texture

_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")
_REFLECTANCE = 0.04
"""What a surface with an index of refraction of 1.5 reflects straight back."""


class Materials:
    """The materials of a file by their numbers, each made once, under names that differ."""

    def __init__(self, document: Document, textures: Textures) -> None:
        self._document, self._textures = document, textures
        self._made: dict[int, tuple[str, Material]] = {}
        self._names = Names()

    def named(self, number: int) -> tuple[str, Material]:
        """Name and material. Raises InputError."""
        if number not in self._made:
            table = self._document.item("materials", number)
            label = table.text("name") or f"material {number}"
            with in_place(f"material {label!r}"):
                material = _Reader(table, label, self._textures).material()
            self._made[number] = self._names.new(label), material
        return self._made[number]


class _Reader:
    """Reads one material."""

    def __init__(self, table: Table, label: str, textures: Textures) -> None:
        self._table, self._label, self._textures = table, label, textures

    def material(self) -> Material:
        """Raises InputError."""
        table = self._table
        mode = table.text("alphaMode", "OPAQUE")
        one_of("alphaMode", mode, _ALPHA_MODES)
        strength = self._extension("emissive_strength").number("emissiveStrength", 1.0, 0.0)
        factors = table.numbers("emissiveFactor", _BLACK, 0.0)
        if "occlusionTexture" in table:
            import_report.changed(f"the occlusion of material {self._label!r}: is computed, not read")
        common: dict[str, Any] = {
            "emission": tuple(min(e * strength, LARGEST) for e in factors),
            "emission_texture": self._texture(table, "emissiveTexture"),
            "double_sided": table.flag("doubleSided"),
            "alpha_mode": mode.lower(),
            "alpha_cutoff": table.number("alphaCutoff", 0.5, 0.0, LARGEST_CUTOFF),
            "normal_scale": _normal_scale(table, "normalTexture"),
            "normal_texture": self._texture(table, "normalTexture"),
            "unlit": "KHR_materials_unlit" in table.table("extensions"),
        }
        if _SPECULAR_GLOSSINESS in table.table("extensions"):
            return replace(self._specular_glossiness(table.extension(_SPECULAR_GLOSSINESS)), **common)
        return Material(**common, **self._surface(), **self._transmission(), **self._layers())

    def _extension(self, name: str) -> Table:
        return self._table.extension(f"KHR_materials_{name}")

    def _surface(self) -> dict[str, Any]:
        """Metal and roughness, and how much of light dielectrics reflect."""
        surface, specular = self._table.table("pbrMetallicRoughness"), self._extension("specular")
        color = surface.numbers("baseColorFactor", (1.0,) * 4, 0.0, 1.0)
        return {
            "base_color": color[:3],
            "alpha": color[3],
            "metallic": _share(surface, "metallicFactor", 1.0),
            "roughness": _share(surface, "roughnessFactor", 1.0),
            "base_color_texture": self._texture(surface, "baseColorTexture"),
            "metallic_roughness_texture": self._texture(surface, "metallicRoughnessTexture"),
            "ior": self._ior(),
            "specular": _share(specular, "specularFactor", 1.0),
            "specular_color": specular.numbers("specularColorFactor", _WHITE, 0.0),
            "specular_texture": self._texture(specular, "specularTexture"),
            "specular_color_texture": self._texture(specular, "specularColorTexture"),
        }

    def _ior(self) -> float:
        ior = self._extension("ior").number("ior", 1.5, 0.0, 100.0)
        if ior == 0:
            # By the extension this reflects all light, as for specular and glossiness.
            import_report.changed(f"the index of refraction 0 of material {self._label!r}: 100 is used")
            return 100.0
        return max(ior, 1.0)

    def _transmission(self) -> dict[str, Any]:
        transmission, volume = self._extension("transmission"), self._extension("volume")
        diffuse = self._extension("diffuse_transmission")
        factor = _share(transmission, "transmissionFactor", 0.0)
        thickness = volume.number("thicknessFactor", 0.0)
        if "thicknessTexture" in volume:
            import_report.changed(f"the thickness of material {self._label!r}: is that of the mesh, not read")
        distance = volume.number("attenuationDistance", math.inf, 1e-6)
        color = volume.numbers("attenuationColor", _WHITE, 0.0, 1.0)
        return {
            "transmission": factor,
            "transmission_texture": self._texture(transmission, "transmissionTexture"),
            "thin_walled": factor > 0 and thickness <= 0,
            "absorption": tuple((-np.log(np.maximum(color, 1e-6)) / distance + 0.0).tolist()),
            "dispersion": self._extension("dispersion").number("dispersion", 0.0, 0.0, LARGEST_DISPERSION),
            "diffuse_transmission": _share(diffuse, "diffuseTransmissionFactor", 0.0),
            "diffuse_transmission_color": _color(diffuse, "diffuseTransmissionColorFactor", _WHITE),
            "diffuse_transmission_texture": self._texture(diffuse, "diffuseTransmissionTexture"),
            "diffuse_transmission_color_texture": self._texture(diffuse, "diffuseTransmissionColorTexture"),
        }

    def _layers(self) -> dict[str, Any]:
        """What lies on the base: clearcoat, sheen, films, and grooves."""
        coat, sheen = self._extension("clearcoat"), self._extension("sheen")
        grooves, film = self._extension("anisotropy"), self._extension("iridescence")
        return {
            "clearcoat": _share(coat, "clearcoatFactor", 0.0),
            "clearcoat_roughness": _share(coat, "clearcoatRoughnessFactor", 0.0),
            "clearcoat_normal_scale": _normal_scale(coat, "clearcoatNormalTexture"),
            "clearcoat_texture": self._texture(coat, "clearcoatTexture"),
            "clearcoat_roughness_texture": self._texture(coat, "clearcoatRoughnessTexture"),
            "clearcoat_normal_texture": self._texture(coat, "clearcoatNormalTexture"),
            "sheen_color": _color(sheen, "sheenColorFactor", _BLACK),
            "sheen_roughness": _share(sheen, "sheenRoughnessFactor", 0.0),
            "sheen_color_texture": self._texture(sheen, "sheenColorTexture"),
            "sheen_roughness_texture": self._texture(sheen, "sheenRoughnessTexture"),
            "anisotropy": _share(grooves, "anisotropyStrength", 0.0),
            "anisotropy_rotation": math.degrees(grooves.number("anisotropyRotation", 0.0)) % 360,
            "anisotropy_texture": self._texture(grooves, "anisotropyTexture"),
            "iridescence": _share(film, "iridescenceFactor", 0.0),
            "iridescence_ior": film.number("iridescenceIor", 1.3, 1.0, 100.0),
            "iridescence_thickness": _film(film, "iridescenceThicknessMaximum", 400.0),
            "iridescence_least_thickness": _film(film, "iridescenceThicknessMinimum", 100.0),
            "iridescence_texture": self._texture(film, "iridescenceTexture"),
            "iridescence_thickness_texture": self._texture(film, "iridescenceThicknessTexture"),
        }

    def _specular_glossiness(self, table: Table) -> Material:
        """A dielectric with the same reflectance. glTF's own conversion to metal and roughness guesses what
        is metal; a specular colour says the same as the file does."""
        text = f"the specular and glossiness of material {self._label!r}"
        import_report.changed(f"{text}: became specular colour and roughness")
        diffuse = table.numbers("diffuseFactor", (1.0,) * 4, 0.0, 1.0)
        reflectance = table.numbers("specularFactor", _WHITE, 0.0, 1.0)
        glossiness = _share(table, "glossinessFactor", 1.0)
        both = self._texture(table, "specularGlossinessTexture")
        rough = None if both is None else replace(both, bitmap=_roughness_of(both.bitmap, glossiness))
        return Material(
            base_color=diffuse[:3],  # type: ignore[arg-type]
            alpha=diffuse[3],
            roughness=1 - glossiness if rough is None else 1.0,
            specular_color=tuple(r / _REFLECTANCE for r in reflectance),  # type: ignore[arg-type]
            base_color_texture=self._texture(table, "diffuseTexture"),
            specular_color_texture=both,
            metallic_roughness_texture=rough,
        )

    def _texture(self, owner: Table, key: str) -> Texture | None:
        """The texture under a key. One that cannot be read is left out, and told of."""
        if key not in owner:
            return None
        try:
            return self._textures.texture(owner.table(key))
        except InputError as error:
            import_report.left_out(f"{key} of material {self._label!r}: {error}")
            return None


def _share(table: Table, key: str, default: float) -> float:
    return table.number(key, default, 0.0, 1.0)


def _color(table: Table, key: str, default: Collection[float]) -> tuple[float, ...]:
    return table.numbers(key, default, 0.0, 1.0)


def _film(table: Table, key: str, default: float) -> float:
    return table.number(key, default, 0.0, THICKEST_FILM)


def _normal_scale(owner: Table, key: str) -> float:
    return owner.table(key).number("scale", 1.0, -LARGEST_SLOPE, LARGEST_SLOPE)


_rough: weakref.WeakKeyDictionary[Bitmap, dict[float, weakref.ref[Bitmap]]] = weakref.WeakKeyDictionary()
"""What was made of bitmaps, by the glossiness, as long as it is in use."""


def _roughness_of(bitmap: Bitmap, glossiness: float) -> Bitmap:
    """The green channel of a metallic-roughness image from the alpha of a specular-glossiness image; the same
    bitmap as long as that is in use."""
    known = _rough.setdefault(bitmap, {})
    made = known[glossiness]() if glossiness in known else None
    if made is None:
        made = _with_roughness(bitmap, glossiness)
        known[glossiness] = weakref.ref(made)
    return made


def _with_roughness(bitmap: Bitmap, glossiness: float) -> Bitmap:
    pixels = bitmap.pixels
    largest = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    gloss = glossiness * (pixels[:, :, -1] / largest if bitmap.has_alpha else np.ones(pixels.shape[:2]))
    made = np.zeros((*pixels.shape[:2], 3), np.uint8)
    made[:, :, 1] = np.rint(255 * (1 - gloss))
    return Bitmap(made)
