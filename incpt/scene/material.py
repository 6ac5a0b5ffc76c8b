"""What surfaces and bodies are made of."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

from incpt.core.affine import Vector
from incpt.core.checks import one_of, require, require_bool, whole
from incpt.core.layout import MIN_ALPHA, TextureSlot
from incpt.scene.checks import LARGEST, set_number, set_vector
from incpt.scene.texture import Texture

ALPHA_MODES = ("opaque", "mask", "blend")
"""What alpha says, as in glTF."""
LARGEST_CUTOFF = 1000.0
"""Of `alpha_cutoff`. Above 1 nothing is covered."""
LARGEST_SLOPE = 100.0
"""Of `normal_scale`; below 0 bumps are dents."""
THICKEST_FILM = 100_000.0
"""Of `iridescence_thickness`, nm; from a few thousand on a film has no colours any more."""
LARGEST_DISPERSION = 100.0
"""Of `dispersion`; diamond has 0.36, and from 20 on it is far beyond what there is."""
HIGHEST_BUMP = 1000.0
"""Of `bump_scale`, metres; below 0 bumps are dents."""
_SHARES = (
    "metallic", "roughness", "specular", "transmission", "alpha", "clearcoat", "clearcoat_roughness",
    "sheen_roughness", "anisotropy", "iridescence", "diffuse_transmission",
)  # fmt: skip
"""Parameters from 0 to 1."""


@dataclass(frozen=True)
class Material:
    """Terms and ranges follow glTF 2.0 and its ratified extensions (KHR_materials_*); the equations stand in
    `cl/shading/material.cl` and `layers.cl`.

    GGX alpha is `roughness` squared. `absorption` is per metre inside a transmissive body, `priority`
    orders nested dielectrics (the higher wins, 0 is the highest of all), `emission` is radiance, from
    the front side only unless `double_sided`. `specular` scales the dielectric layer: 0 is Lambertian.

    `alpha`, times that of `base_color_texture` and of colours at corners, is the share of what is behind a
    surface that it covers where `alpha_mode` is "blend"; "mask" covers all where it is at least
    `alpha_cutoff` and nothing elsewhere; "opaque" takes no notice of it. What covers in part is no light for
    light sampling. A ray goes through 256 such surfaces at most (`layout.MOST_LAYERS`); the next covers all.

    From the bottom up: metal or a diffuse base, which lets `diffuse_transmission` of its light through to the
    other side, in `diffuse_transmission_color`; on it the reflection of `ior`, `specular` and
    `specular_color`, of metal that of `base_color`, stretched by `anisotropy` along the direction of u, or
    where a mesh has no texture coordinates around the object's y axis (turned by `anisotropy_rotation`
    degrees, counter-clockwise), and in the colours of a film of `iridescence_ior` and
    `iridescence_thickness` nm as far as `iridescence` says; then `sheen_color`, the fuzz of cloth; then
    `clearcoat`, a colourless lacquer with an index of refraction of 1.5. Each lets through what it does not
    reflect. Sheen, clearcoat and anisotropy belong to what is not transmissive; a film lies on glass too.

    Where a material is transmissive it is a body, which absorbs and refracts, or with `thin_walled` a wall
    without a thickness, which does neither: light goes straight on behind it. `dispersion` is 20 over Abbe's
    number: from red to blue the index of refraction grows by (ior - 1) dispersion / 20. `unlit` surfaces
    shine with their base colour as radiance, on both sides, and reflect nothing; they light others, but light
    sampling does not look for them.

    Numbers are multiplied with what their textures say at a point: those of colours by colours in sRGB (where
    their bitmaps are bytes or 16-bit numbers), `metallic_roughness_texture` by blue and green,
    `transmission`, `clearcoat` and `iridescence` by red, `clearcoat_roughness` by green, `specular`,
    `sheen_roughness` and `diffuse_transmission` by alpha, `anisotropy` by blue, where red and green are the
    direction. Green of `iridescence_thickness_texture` leads from `iridescence_least_thickness` to
    `iridescence_thickness`.
    `normal_texture` bends the shading normal: red and green, from 0 to 1, are its deflections along the
    tangent and upwards in the image, from -1 to 1 and times `normal_scale`; `clearcoat_normal_texture` that
    of the clearcoat, which is smooth without it. `bump_texture` bends it too, beside a normal map: red, times
    `bump_scale`, is a height over the surface in metres of the world. Bytes are coarse steps for that.
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
    specular_color: Vector = (1.0, 1.0, 1.0)
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    clearcoat_normal_scale: float = 1.0
    sheen_color: Vector = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    iridescence: float = 0.0
    iridescence_ior: float = 1.3
    iridescence_thickness: float = 400.0
    iridescence_least_thickness: float = 100.0
    diffuse_transmission: float = 0.0
    diffuse_transmission_color: Vector = (1.0, 1.0, 1.0)
    thin_walled: bool = False
    dispersion: float = 0.0
    bump_scale: float = 0.01
    unlit: bool = False
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    emission_texture: Texture | None = None
    transmission_texture: Texture | None = None
    specular_texture: Texture | None = None
    specular_color_texture: Texture | None = None
    clearcoat_texture: Texture | None = None
    clearcoat_roughness_texture: Texture | None = None
    clearcoat_normal_texture: Texture | None = None
    sheen_color_texture: Texture | None = None
    sheen_roughness_texture: Texture | None = None
    anisotropy_texture: Texture | None = None
    iridescence_texture: Texture | None = None
    iridescence_thickness_texture: Texture | None = None
    diffuse_transmission_texture: Texture | None = None
    diffuse_transmission_color_texture: Texture | None = None
    bump_texture: Texture | None = None

    def __post_init__(self) -> None:
        set_vector(self, "base_color", low=0.0, high=1.0)
        for name in _SHARES:
            set_number(self, name, 0.0, 1.0)
        set_number(self, "ior", 1.0, 100.0)
        set_vector(self, "absorption", low=0.0)
        set_vector(self, "emission", low=0.0)
        object.__setattr__(self, "priority", whole("priority", self.priority, 0, 1000))
        for name in ("double_sided", "thin_walled", "unlit"):
            require_bool(name, getattr(self, name))
        set_number(self, "alpha_cutoff", 0.0, LARGEST_CUTOFF)
        one_of("alpha_mode", self.alpha_mode, ALPHA_MODES)
        for name in ("normal_scale", "clearcoat_normal_scale"):
            set_number(self, name, -LARGEST_SLOPE, LARGEST_SLOPE)
        set_vector(self, "specular_color", low=0.0)
        set_vector(self, "sheen_color", low=0.0, high=1.0)
        set_vector(self, "diffuse_transmission_color", low=0.0, high=1.0)
        set_number(self, "anisotropy_rotation", -LARGEST, LARGEST)
        set_number(self, "iridescence_ior", 1.0, 100.0)
        for name in ("iridescence_thickness", "iridescence_least_thickness"):
            set_number(self, name, 0.0, THICKEST_FILM)
        set_number(self, "dispersion", 0.0, LARGEST_DISPERSION)
        set_number(self, "bump_scale", -HIGHEST_BUMP, HIGHEST_BUMP)
        for slot in TextureSlot:
            name = texture_name(slot)
            require(name, getattr(self, name), (Texture, NoneType), "a Texture")

    @property
    def is_cutout(self) -> bool:
        """Whether rays may go through it by its alpha."""
        return self.alpha_mode != "opaque"

    @property
    def is_clear_wall(self) -> bool:
        """Whether it is a thin wall that rays may go straight through, unchanged: smooth, white, the same
        everywhere. Light samples find what is behind such a wall, as behind a cut-out."""
        bare = all(texture_of(self, slot) is None for slot in _SEEN_BY_WALLS)
        return (
            self.is_transmissive
            and self.thin_walled
            and bare
            and self.roughness**2 <= MIN_ALPHA
            and self.base_color == self.specular_color == (1.0, 1.0, 1.0)
            and self.iridescence == 0
            and not any(self.emission)
            and not self.is_cutout
        )

    @property
    def passes_rays(self) -> bool:
        """Whether rays may go through it before any shading."""
        return self.is_cutout or self.is_clear_wall

    @property
    def is_emissive(self) -> bool:
        """Whether light sampling may find it."""
        return any(c > 0 for c in self.emission) and not self.unlit

    @property
    def is_transmissive(self) -> bool:
        """Whether it lets light through without scattering it."""
        return self.transmission > 0 and not self.unlit

    @property
    def is_body(self) -> bool:
        """Whether what it encloses is a medium, with an index of refraction and absorption."""
        return self.is_transmissive and not self.thin_walled


_SEEN_BY_WALLS = (
    TextureSlot.BASE_COLOR, TextureSlot.METALLIC_ROUGHNESS, TextureSlot.NORMAL, TextureSlot.TRANSMISSION,
    TextureSlot.SPECULAR, TextureSlot.SPECULAR_COLOR, TextureSlot.BUMP,
)  # fmt: skip
"""Slots that make what a smooth wall lets through differ from point to point."""
_TEXTURE_NAMES = {slot: f"{slot.name.lower()}_texture" for slot in TextureSlot}


def texture_name(slot: TextureSlot) -> str:
    """The parameter of a material that holds the texture of a slot."""
    return _TEXTURE_NAMES[slot]


def texture_of(material: Material, slot: TextureSlot) -> Texture | None:
    """What a material reads for a slot, if anything."""
    texture: Texture | None = getattr(material, texture_name(slot))
    return texture
