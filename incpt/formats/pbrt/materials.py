"""Materials. What has no counterpart here becomes the nearest that there is, which is told.

pbrt's microfacets are GGX's and scatter once, and its conductors and dielectrics follow Fresnel's formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from incpt.core.affine import Vector
from incpt.core.errors import InputError, in_place
from incpt.formats import import_report
from incpt.formats.appearance import metals
from incpt.formats.appearance.colored import Amount, Colored, NumberImage, linear_pixels
from incpt.formats.appearance.looks import MATTE, Look, blended, roughened, tinted, with_alpha
from incpt.formats.pbrt.document import Document
from incpt.formats.pbrt.parameters import Statement
from incpt.formats.pbrt.textures import Textures
from incpt.picture.spectra import Spectrum
from incpt.scene.texture import Bitmap, Texture

_GLASSES = {
    "glass-BK7": (1.5168, 64.17), "glass-BAF10": (1.67, 47.11), "glass-FK51A": (1.48656, 84.47),
    "glass-LASF9": (1.85025, 32.17), "glass-F5": (1.6727, 32.21), "glass-F10": (1.72825, 28.41),
    "glass-F11": (1.78472, 25.68),
}  # fmt: skip
"""Index of refraction at 587.6 nm and Abbe's number, as their makers give them; F5, F10 and F11 are SF5, SF10
and SF11 there."""
_ABBE_OF_ONE = 20.0
"""Abbe's number of a dispersion of 1, see Material."""
_METALS = {"CuZn": (0.9097, 0.7781, 0.423)}
"""What brass reflects of daylight, of pbrt's spectra: others are those of `appearance.metals`."""
_NOTHING = ("", "none", "interface")
_LEAST = 1e-6
"""Of a share that colours are divided by."""
_DEEPEST = 16
"""Materials that are mixed of each other."""


@dataclass
class Materials:
    """Makes looks of materials, each once; None for one that lets all light through unchanged."""

    document: Document
    textures: Textures
    _made: dict[int, Look | None] = field(default_factory=dict)
    _depth: int = 0

    def look(self, statement: Statement | None) -> Look | None:
        """Values of a material. Raises InputError."""
        if statement is None:
            return dict(MATTE)
        if id(statement) not in self._made:
            self._depth += 1
            with in_place(statement.place):
                if self._depth > _DEEPEST:
                    raise InputError("materials are mixed of each other in a circle, or too deep")
                look = self._read(statement)
                self._made[id(statement)] = look if look is None else self._with_bumps(statement, look)
            self._depth -= 1
        return self._made[id(statement)]

    def _read(self, statement: Statement) -> Look | None:
        if statement.kind in _NOTHING:
            return None
        read = _KINDS.get(statement.kind)
        if read is None:
            statement.ignore(*statement.parameters)
            import_report.left_out(f"{statement}: nothing here is like it; grey stands for it")
            return dict(MATTE)
        return read(self, statement)

    def _with_bumps(self, statement: Statement, look: Look) -> Look:
        name = statement.text("normalmap")
        bitmap = self.textures.image(name, str(statement)) if name else None
        if bitmap is not None:
            # (0, 0) is at the bottom left of an image there, and green goes up, as here.
            look = {**look, "normal_texture": Texture(bitmap)}
        height = self.textures.amount(statement, "displacement", 0.0)
        if height.image is not None:
            texture = height.image.with_pixels(height.image.pixels)
            look = {**look, "bump_texture": texture, "bump_scale": 1.0}
        return look

    def diffuse(self, statement: Statement) -> Look:
        return {**tinted(self.textures.reflectance(statement, "reflectance", 0.5)), "specular": 0.0}

    def coateddiffuse(self, statement: Statement) -> Look:
        color = self.textures.reflectance(statement, "reflectance", 0.5)
        statement.ignore("thickness", "maxdepth", "nsamples", "g", "albedo")
        import_report.changed(
            f"{statement}: nothing is scattered within the coat, and its base is not darker"
        )
        ior = self._ior(statement, "eta")[0]
        return {**tinted(color), "ior": ior, **self._roughness(statement)}

    def conductor(self, statement: Statement) -> Look:
        if statement.has("reflectance"):
            color = tinted(self.textures.reflectance(statement, "reflectance", 1.0))
        else:
            color = {"base_color": self._metal(statement, "eta", "k")}
        return {**color, "metallic": 1.0, **self._roughness(statement)}

    def coatedconductor(self, statement: Statement) -> Look:
        """Metal under a lacquer."""
        statement.ignore("thickness", "maxdepth", "nsamples", "g", "albedo", "interface.eta")
        import_report.changed(f"{statement}: its coat is a lacquer with an index of refraction of 1.5")
        if statement.has("reflectance"):
            color = tinted(self.textures.reflectance(statement, "reflectance", 1.0))
        else:
            color = {"base_color": self._metal(statement, "conductor.eta", "conductor.k")}
        coat = self._roughness(statement, "interface.")
        if "metallic_roughness_texture" in coat:
            import_report.changed(f"{statement}: the roughness of its coat is 0")
            coat = {"roughness": 0.0}
        lacquer = {"clearcoat": 1.0, "clearcoat_roughness": coat["roughness"]}
        return {**color, "metallic": 1.0, **self._roughness(statement, "conductor."), **lacquer}

    def dielectric(self, statement: Statement) -> Look:
        ior, dispersion = self._ior(statement, "eta")
        look: Look = {
            "base_color": (1.0, 1.0, 1.0),
            "transmission": 1.0,
            "ior": ior,
            "dispersion": dispersion,
        }
        rough = self._roughness(statement)
        if "anisotropy" in rough:
            import_report.changed(f"{statement}: the roughness is the same along u and v")
            rough = {"roughness": rough["roughness"]}
        return {**look, **rough}

    def thindielectric(self, statement: Statement) -> Look:
        ior = self._ior(statement, "eta")[0]
        look: Look = {"base_color": (1.0, 1.0, 1.0), "transmission": 1.0, "thin_walled": True}
        return {**look, "ior": ior, "roughness": 0.0}

    def diffusetransmission(self, statement: Statement) -> Look:
        """What is reflected and what goes through are shares of one surface here."""
        scale = statement.number("scale", 1.0, 0.0)
        reflected, passed = (
            self.textures.reflectance(statement, name, 0.25).mapped(lambda c: np.clip(scale * c, 0, 1))
            for name in ("reflectance", "transmittance")
        )
        ends = _brightest(reflected), _brightest(passed)
        if sum(ends) == 0:
            return {"base_color": (0.0, 0.0, 0.0), "specular": 0.0}
        share = ends[1] / sum(ends)
        # Each has the colour that its share of the surface makes what it reflects, or lets through, of.
        base = reflected.mapped(lambda c: np.clip(c / max(1 - share, _LEAST), 0, 1))
        through = passed.mapped(lambda c: np.clip(c / max(share, _LEAST), 0, 1))
        look: Look = {**tinted(base), "specular": 0.0, "diffuse_transmission": share}
        look["diffuse_transmission_color"] = through.rgb
        if through.texture is not None:
            look["diffuse_transmission_color_texture"] = through.texture
        return look

    def mix(self, statement: Statement) -> Look | None:
        found = statement.parameter("materials")
        names = () if found is None else found.texts
        if len(names) != 2 or any(name not in self.document.materials for name in names):
            raise InputError("materials: does not name two materials that are made before")
        first, second = (self.look(self.document.materials[name]) for name in names)
        weight = self.textures.amount(statement, "amount", 0.5)
        mixed = None if first is None or second is None else blended(first, second, weight)
        if mixed is None:
            import_report.changed(f"{statement}: is the heavier of the two that it mixes")
            return second if weight.mean >= 0.5 else first
        if any(set(look or {}) != set(MATTE) for look in (first, second)):
            import_report.changed(
                f"{statement}: the numbers of its materials are mixed, not what they reflect"
            )
        return mixed

    def _metal(self, statement: Statement, eta: str, k: str) -> Vector:
        """What a metal reflects, by its name or its index of refraction."""
        names = [
            found.texts[0]
            for one in (eta, k)
            if (found := statement.parameters.get(one)) is not None and len(found.texts) == 1
        ]
        named = [name for name in names if name.startswith("metal-")]
        if named or not (statement.has(eta) or statement.has(k)):
            statement.ignore(eta, k)
            symbol = named[0].split("-")[1] if named else "Cu"
            with in_place(eta):
                return _METALS.get(symbol) or metals.named_reflectance(symbol)
        parts = [self.textures.spectral(statement, one) for one in (eta, k)]
        return metals.reflectance(*(_at_all_wavelengths(part) for part in parts))

    def _ior(self, statement: Statement, name: str) -> tuple[float, float]:
        """Index of refraction and dispersion."""
        found = statement.parameters.get(name)
        if found is not None and len(found.texts) == 1 and found.texts[0] in _GLASSES:
            statement.ignore(name)
            ior, abbe = _GLASSES[found.texts[0]]
            return ior, _ABBE_OF_ONE / abbe
        if found is not None and found.type == "spectrum":
            value = self.textures.spectral(statement, name)
            spectrum = value if isinstance(value, Spectrum) else Spectrum((587.6,), (1.5,))
            return max(float(np.interp(587.6, spectrum.wavelengths, spectrum.values)), 1.0), 0.0
        return max(self.textures.amount(statement, name, 1.5).mean, 1.0), 0.0

    def _roughness(self, statement: Statement, prefix: str = "") -> Look:
        """Roughness, stretched where it differs along u and v. Unless a scene says another thing, alpha is
        the root of pbrt's roughness."""
        remaps = statement.flag("remaproughness", True)

        def alpha(name: str) -> Amount:
            default = self.textures.amount(statement, f"{prefix}roughness", 0.0)
            found = (
                self.textures.amount(statement, prefix + name, 0.0)
                if statement.has(prefix + name)
                else default
            )
            return _rooted(found) if remaps else found

        along, across = alpha("uroughness"), alpha("vroughness")
        if along.image is not None or across.image is not None:
            return roughened(along if along.image is not None else across)
        low, high = sorted((min(along.value, 1.0), min(across.value, 1.0)))
        if low == high:
            return roughened(Amount(low))
        stretch = math.sqrt((high - low) / (1 - low))
        turn = 0.0 if along.value >= across.value else 90.0
        return {"roughness": math.sqrt(low), "anisotropy": stretch, "anisotropy_rotation": turn}

    def masked(self, shape: Statement, look: Look) -> Look:
        """A look with the alpha of a shape. Raises InputError."""
        alpha = self.textures.amount(shape, "alpha", 1.0)
        if alpha.image is None:
            return look if alpha.value >= 1 else {**look, "alpha": alpha.value, "alpha_mode": "blend"}
        base: Texture | None = look.get("base_color_texture")
        if base is not None and base.bitmap.has_alpha:
            base = replace(base, bitmap=Bitmap(base.bitmap.pixels[..., :-1]))
        texture = with_alpha(str(shape), base, alpha.image)
        return {**look, "alpha_mode": "blend", "base_color_texture": texture}


_KINDS: dict[str, Callable[[Materials, Statement], Look | None]] = {
    "diffuse": Materials.diffuse,
    "coateddiffuse": Materials.coateddiffuse,
    "conductor": Materials.conductor,
    "coatedconductor": Materials.coatedconductor,
    "dielectric": Materials.dielectric,
    "thindielectric": Materials.thindielectric,
    "diffusetransmission": Materials.diffusetransmission,
    "mix": Materials.mix,
}
"""What reads each type of material."""


def _brightest(color: Colored) -> float:
    """The largest of its three numbers, of an image that of the mean."""
    if color.texture is None:
        return max(color.rgb)
    mean = linear_pixels(color.texture.bitmap)[..., :3].mean(axis=(0, 1))
    return float((mean * np.array(color.rgb)).max())


def _rooted(amount: Amount) -> Amount:
    if amount.image is None:
        return Amount(math.sqrt(amount.value))
    return Amount(1.0, NumberImage(np.sqrt(amount.image.pixels), amount.image.texture))


def _at_all_wavelengths(value: Spectrum | Vector | None) -> Spectrum | Vector:
    return (1.0, 1.0, 1.0) if value is None else value
