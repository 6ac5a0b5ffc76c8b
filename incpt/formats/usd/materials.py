"""Materials of UsdPreviewSurface, and those of meshes without one, by their display colours.

The specification is "UsdPreviewSurface Specification", version 2.6 (openusd.org/release).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade

from incpt.core.errors import InputError, in_place
from incpt.formats import import_report
from incpt.formats.appearance.colored import WHITE, Amount, Colored, as_reflectance, vector
from incpt.formats.appearance.looks import Look, metal_and_roughness, tinted, upright, with_alpha
from incpt.formats.names import Names
from incpt.formats.usd.meshes import Wanted
from incpt.formats.usd.primvars import primvar_values
from incpt.formats.usd.shading import Inputs, Source
from incpt.formats.usd.textures import TEXTURE, Bitmaps, UvImage, UvTextures, amount
from incpt.scene.checks import LARGEST
from incpt.scene.material import LARGEST_SLOPE, Material
from incpt.scene.texture import Bitmap, Texture

SURFACE = "UsdPreviewSurface"
_READERS = ("UsdPrimvarReader_float3", "UsdPrimvarReader_float4", "UsdPrimvarReader_float")
_PLAIN_ROUGHNESS = 0.6
"""Of meshes without a material, as in all mesh files."""
_CLEAR: Look = {
    "base_color": WHITE, "base_color_texture": None, "metallic": 0.0, "metallic_roughness_texture": None,
    "transmission": 1.0, "thin_walled": True,
}  # fmt: skip
"""What is wholly transparent, and reflects all the same."""


@dataclass(frozen=True)
class Surface:
    """A material under a name of its own, and what it reads of the mesh. Without one: None twice."""

    name: str | None
    material: Material | None
    wanted: Wanted = Wanted(("st",))


class Materials:
    """The materials of a stage, each made once."""

    def __init__(self, images: Bitmaps) -> None:
        self._images = images
        self._made: dict[str, Surface | None] = {}
        self._plain: dict[object, Surface] = {}
        self._double_sided: dict[str, Surface] = {}
        self._names = Names()

    def of(self, prim: Any, is_double_sided: bool) -> Surface:
        """What is bound to a prim; where that is nothing, its display colour."""
        bound = None
        for purpose in (UsdShade.Tokens.preview, UsdShade.Tokens.full):
            material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)[0]
            bound = self._of_material(material) if material and bound is None else bound
        if bound is None:
            return self._display(prim)
        # Which sides are seen says nothing here, but which of them shine.
        shines = bound.material is not None and bound.material.is_emissive
        return self._on_both_sides(bound) if shines and is_double_sided else bound

    def _on_both_sides(self, surface: Surface) -> Surface:
        assert surface.name is not None and surface.material is not None
        if surface.name not in self._double_sided:
            material = replace(surface.material, double_sided=True)
            name = self._names.new(f"{surface.name} (both sides)")
            self._double_sided[surface.name] = replace(surface, name=name, material=material)
        return self._double_sided[surface.name]

    def _of_material(self, material: Any) -> Surface | None:
        path = str(material.GetPath())
        if path not in self._made:
            self._made[path] = self._read(material)
        return self._made[path]

    def _read(self, material: Any) -> Surface | None:
        label = str(material.GetPrim().GetName())
        shader = material.ComputeSurfaceSource()[0]
        kind = str(shader.GetIdAttr().Get() or "another language") if shader else "none for all renderers"
        if kind != SURFACE:
            import_report.left_out(f"material {label!r}: its shader is {kind}, not {SURFACE}")
            return None
        reader = _Reader(Inputs(shader, self._images.moment), label, self._images)
        with in_place(f"material {label!r}"):
            made = Material(**reader.look())
        wanted = Wanted(tuple(reader.textures.uv_names), reader.color_name, reader.opacity_name)
        return Surface(self._names.new(label), made, wanted)

    def _display(self, prim: Any) -> Surface:
        """By displayColor and displayOpacity: one for each colour, or one for colours that differ over a
        mesh."""
        mesh = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
        found = UsdGeom.PrimvarsAPI(mesh)
        values = []
        for name, width in (("displayColor", 3), ("displayOpacity", 1)):
            primvar = found.FindPrimvarWithInheritance(name)
            has_value = primvar and primvar.HasValue()
            values.append(_constant(primvar, width, self._images.moment) if has_value else ())
        color, opacity = values
        if color == () and opacity == ():
            return Surface(None, None)
        wanted = Wanted(("st",))
        if color is None or opacity is None:
            wanted = Wanted(("st",), "displayColor", None if opacity == () else "displayOpacity")
        look = _plain_look(color, opacity)
        key = tuple(sorted(look.items()))
        if key not in self._plain:
            self._plain[key] = Surface(self._names.new("display color"), Material(**look))
        return replace(self._plain[key], wanted=wanted)


def _plain_look(color: tuple[float, ...] | None, opacity: tuple[float, ...] | None) -> Look:
    """Of one colour and one opacity, 1 without values; where one of them differs over a mesh, both stand at
    its corners."""
    differs = color is None or opacity is None
    return {
        "roughness": _PLAIN_ROUGHNESS,
        "base_color": WHITE if differs or not color else vector(color),
        "alpha": 1.0 if differs or not opacity else opacity[0],
        "alpha_mode": "blend" if opacity is None or (opacity and opacity[0] < 1) else "opaque",
    }


def _constant(primvar: Any, width: int, moment: Any) -> tuple[float, ...] | None:
    """The value of a primvar that is the same all over a mesh, from 0 to 1; None where it differs. Nothing,
    where it has no values."""
    try:
        values = primvar_values(primvar, width, moment)
    except InputError as error:
        import_report.left_out(f"the primvar {primvar.GetPrimvarName()!r}: {error}")
        return ()
    if len(values) > 1:
        return None
    return tuple(np.clip(np.nan_to_num(values[0]), 0, 1).tolist())


class _Reader:
    """Reads one UsdPreviewSurface."""

    def __init__(self, inputs: Inputs, label: str, images: Bitmaps) -> None:
        self._inputs, self._label, self._moment = inputs, label, images.moment
        self.textures = UvTextures(images, label)
        self.color_name: str | None = None
        self.opacity_name: str | None = None

    def look(self) -> Look:
        """The values of a Material."""
        look: Look = {
            **tinted(as_reflectance(self._color("diffuseColor", (0.18,) * 3), self._what("diffuseColor"))),
            **self._emission(),
            **self._reflection(),
            **self._clearcoat(),
            **self._bumps(),
        }
        look |= self._opacity(look.get("base_color_texture"))
        if self._inputs.source("displacement") or self._inputs.number("displacement", 0.0):
            import_report.left_out(f"{self._what('displacement')}: surfaces stay where they are")
        if self._inputs.source("occlusion"):
            import_report.changed(f"{self._what('occlusion')}: is computed, not read")
        return look

    def _what(self, name: str) -> str:
        return f"{name} of material {self._label!r}"

    def _emission(self) -> Look:
        color = self._color("emissiveColor", (0.0,) * 3)
        rgb = tuple(min(max(c, 0.0), LARGEST) for c in color.rgb)
        return {"emission": rgb, "emission_texture": color.texture}

    def _reflection(self) -> Look:
        """Metal and roughness, or the colour that dielectrics reflect."""
        ior = self._amount("ior", 1.5).mean
        rough = self._amount("roughness", 0.5)
        if self._inputs.number("useSpecularWorkflow", 0) != 1:
            packed = self._packed()
            look = packed or metal_and_roughness(self._label, self._amount("metallic", 0.0), rough)
            return {"ior": min(max(ior, 1.0), 100.0), **look}
        color = self._color("specularColor", (0.0,) * 3)
        # What an index of 1.5 reflects straight back is the measure of specular colours.
        whole = color.mapped(lambda values: np.clip(values, 0, 1) / 0.04)
        return {
            **metal_and_roughness(self._label, Amount(0.0), rough),
            "ior": 1.5, "specular_color": whole.rgb, "specular_color_texture": whole.texture,
        }  # fmt: skip

    def _packed(self) -> Look | None:
        """Metal and roughness where they are blue and green of one image, as files made from glTF have
        them."""
        metal, rough = (self._inputs.source(name) for name in ("metallic", "roughness"))
        if metal is None or rough is None or metal.kind != TEXTURE:
            return None
        if metal.shader.GetPath() != rough.shader.GetPath() or (metal.output, rough.output) != ("b", "g"):
            return None
        image = self._image(rough, "roughness")
        if image is None or not image.is_plain("g", "b"):
            return None
        return {"metallic": 1.0, "roughness": 1.0, "metallic_roughness_texture": image.texture}

    def _clearcoat(self) -> Look:
        found: Look = {}
        for name, ours, default in (
            ("clearcoat", "clearcoat", 0.0), ("clearcoatRoughness", "clearcoat_roughness", 0.01),
        ):  # fmt: skip
            value = self._amount(name, default)
            if value.image is None:
                found[ours] = min(max(value.value, 0.0), 1.0)
            else:
                pixels = np.clip(value.image.pixels, 0, 1)
                found |= {ours: 1.0, f"{ours}_texture": value.image.with_pixels(pixels)}
        return found

    def _bumps(self) -> Look:
        """Normal maps: of pixels from 0 to 1 `scale` and `bias` make -1 to 1."""
        source = self._inputs.source("normal")
        if source is None:
            return {}
        image = self._image(source, "normal")
        if image is None:
            return {}
        texture = replace(image.texture, bitmap=image.texture.bitmap)
        x, y = image.scale[:2]
        if image.is_srgb or not np.allclose(image.bias[:2], [-x / 2, -y / 2], atol=1e-3) or abs(x) != abs(y):
            import_report.changed(f"{self._what('normal')}: its image is read as a common normal map")
        if x > 0 > y:
            texture = upright(texture)
        strength = abs(x) / 2 if x != 1 or any(image.bias[:2]) else 1.0
        return {"normal_texture": texture, "normal_scale": min(strength, LARGEST_SLOPE)}

    def _opacity(self, base: Texture | None) -> Look:
        """Alpha, beside the texture of the base colour."""
        threshold = self._inputs.number("opacityThreshold", 0.0)
        mode = {"alpha_mode": "mask", "alpha_cutoff": threshold} if threshold > 0 else {"alpha_mode": "blend"}
        source = self._inputs.source("opacity")
        if source is not None and source.kind in _READERS:
            self.opacity_name = Inputs(source.shader, self._moment).text("varname", "displayOpacity")
            return {**mode, **_without_alpha(base)}
        opacity = self._amount("opacity", 1.0)
        alpha = min(max(opacity.value, 0.0), 1.0)
        if opacity.image is None and alpha == 1:
            return {}
        # With `presence` what is not covered is not there, and else it is transparent.
        is_clear = threshold <= 0 and self._inputs.text("opacityMode", "transparent") != "presence"
        if opacity.image is None and alpha == 0 and is_clear:
            import_report.changed(f"{self._what('opacity')}: 0 is a clear thin wall")
            return _CLEAR
        if is_clear:
            import_report.changed(f"{self._what('opacity')}: what it does not cover reflects nothing")
        if opacity.image is None:
            return {"alpha": alpha, **mode, **_without_alpha(base)}
        is_of_base = source is not None and source.output == "a" and base == opacity.image.texture
        return {
            **mode,
            "base_color_texture": base if is_of_base else with_alpha(self._label, base, opacity.image),
        }

    def _color(self, name: str, default: tuple[float, float, float]) -> Colored:
        """The colour of an input, with its image."""
        source = self._inputs.source(name)
        if source is None:
            return Colored(vector(self._inputs.numbers(name, default)))
        if source.kind in _READERS and name == "diffuseColor":
            inputs = Inputs(source.shader, self._moment)
            self.color_name = inputs.text("varname", "displayColor")
            return Colored(WHITE, is_of_vertices=True)
        image = self._image(source, name)
        if image is None:
            return Colored(vector(self._fallback(source, default)[:3]))
        return image.colored()

    def _amount(self, name: str, default: float) -> Amount:
        """The number of an input, or those of its image."""
        source = self._inputs.source(name)
        if source is None:
            return Amount(min(max(self._inputs.number(name, default), -LARGEST), LARGEST))
        image = self._image(source, name)
        if image is None:
            channel = "rgba".find(source.output) if source.kind == TEXTURE else 0
            return Amount(self._fallback(source, (default,) * 4)[max(channel, 0)])
        return amount(image, source.output)

    def _fallback(self, source: Source, default: tuple[float, ...]) -> tuple[float, ...]:
        """(4,) what a shader that cannot be read says to take in its place."""
        whole = (*default, 1.0)[:4]
        return Inputs(source.shader, self._moment).numbers("fallback", whole)

    def _image(self, source: Source, name: str) -> UvImage | None:
        """The image that an input reads; what is none, or cannot be read, is told."""
        if source.kind != TEXTURE:
            import_report.left_out(
                f"{self._what(name)}: reads {source.kind or 'a shader'}, which is not known"
            )
            return None
        try:
            return self.textures.image(source)
        except InputError as error:
            import_report.left_out(f"{self._what(name)}: {error}")
            return None


def _without_alpha(base: Texture | None) -> Look:
    """The texture of a base colour without an alpha that nobody reads."""
    if base is None or not base.bitmap.has_alpha:
        return {}
    return {"base_color_texture": replace(base, bitmap=Bitmap(base.bitmap.pixels[..., :-1]))}
