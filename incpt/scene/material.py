"""What surfaces and bodies are made of."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

from incpt.core.affine import Vector
from incpt.core.checks import one_of, require, require_bool, whole
from incpt.core.layout import TextureSlot
from incpt.scene.checks import set_number, set_vector
from incpt.scene.texture import Texture

ALPHA_MODES = ("opaque", "mask", "blend")
"""What alpha says, as in glTF."""
LARGEST_CUTOFF = 1000.0
"""Of `alpha_cutoff`. Above 1 nothing is covered."""
LARGEST_SLOPE = 100.0
"""Of `normal_scale`; below 0 bumps are dents."""


@dataclass(frozen=True)
class Material:
    """Terms and ranges follow glTF 2.0; the equations stand in `cl/shading/material.cl`.

    GGX alpha is `roughness` squared. `absorption` is per metre inside a transmissive body, `priority`
    orders nested dielectrics (the higher wins, 0 is the highest of all), `emission` is radiance, from
    the front side only unless `double_sided`. `specular` scales the dielectric layer: 0 is Lambertian.

    `alpha`, times that of `base_color_texture` and of colours at corners, is the share of what is behind a
    surface that it covers where `alpha_mode` is "blend"; "mask" covers all where it is at least
    `alpha_cutoff` and nothing elsewhere; "opaque" takes no notice of it. What covers in part is no light for
    light sampling. A ray goes through 256 such surfaces at most (`layout.MOST_LAYERS`); the next covers all.

    Numbers are multiplied with what their textures say at a point: `base_color_texture` and
    `emission_texture` by colours in sRGB (where their bitmaps are bytes or 16-bit numbers),
    `metallic_roughness_texture` by blue and green, `transmission_texture` by red, `specular_texture` by
    alpha. `normal_texture` bends the shading normal: red and green, from 0 to 1, are its deflections along
    the tangent and upwards in the image, from -1 to 1 and times `normal_scale`.
    """

    base_color: Vector = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 1.0
    ior: float = 1.5
    transmission: float = 0.0
    absorption: Vector = (0.0, 0.0, 0.0)
    priority: int = 0
    emission: Vector = (0.0, 0.0, 0.0)
    double_sided: bool = False
    alpha: float = 1.0
    alpha_mode: str = "opaque"
    alpha_cutoff: float = 0.5
    normal_scale: float = 1.0
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    emission_texture: Texture | None = None
    transmission_texture: Texture | None = None
    specular_texture: Texture | None = None

    def __post_init__(self) -> None:
        set_vector(self, "base_color", low=0.0, high=1.0)
        for name in ("metallic", "roughness", "specular", "transmission"):
            set_number(self, name, 0.0, 1.0)
        set_number(self, "ior", 1.0, 100.0)
        set_vector(self, "absorption", low=0.0)
        set_vector(self, "emission", low=0.0)
        object.__setattr__(self, "priority", whole("priority", self.priority, 0, 1000))
        require_bool("double_sided", self.double_sided)
        set_number(self, "alpha", 0.0, 1.0)
        set_number(self, "alpha_cutoff", 0.0, LARGEST_CUTOFF)
        one_of("alpha_mode", self.alpha_mode, ALPHA_MODES)
        set_number(self, "normal_scale", -LARGEST_SLOPE, LARGEST_SLOPE)
        for slot in TextureSlot:
            name = texture_name(slot)
            require(name, getattr(self, name), (Texture, NoneType), "a Texture")

    @property
    def is_cutout(self) -> bool:
        """Whether rays may go through it by its alpha."""
        return self.alpha_mode != "opaque"

    @property
    def is_emissive(self) -> bool:
        return any(c > 0 for c in self.emission)


_TEXTURE_NAMES = {slot: f"{slot.name.lower()}_texture" for slot in TextureSlot}


def texture_name(slot: TextureSlot) -> str:
    """The parameter of a material that holds the texture of a slot."""
    return _TEXTURE_NAMES[slot]


def texture_of(material: Material, slot: TextureSlot) -> Texture | None:
    """What a material reads for a slot, if anything."""
    texture: Texture | None = getattr(material, texture_name(slot))
    return texture
