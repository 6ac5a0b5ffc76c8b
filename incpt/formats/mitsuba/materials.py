"""BSDFs as materials. What has no counterpart here becomes the nearest that there is, which is told.

Mitsuba's microfacets scatter once, and its conductors and dielectrics follow Fresnel's formula; ours agree
with them where Schlick's approximation does.
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
from incpt.formats.appearance.colored import Amount, Colored
from incpt.formats.appearance.looks import (
    MATTE,
    Look,
    between,
    blended,
    hue,
    metal_and_roughness,
    product,
    roughened,
    stretched,
    tinted,
    upright,
    with_alpha,
)
from incpt.formats.mitsuba.document import Document
from incpt.formats.mitsuba.indices import AIR, index, inner_reflectance
from incpt.formats.mitsuba.node import Node
from incpt.formats.mitsuba.textures import Textures
from incpt.scene.material import HIGHEST_BUMP, Material
from incpt.scene.texture import Bitmap, Texture

_SAME_INDEX = 5e-3
"""Indices of refraction that differ by less are those of one substance."""
_AIR_LIKE = 1.001
_MOST_BODIES = 1000
"""Pairs of indices of refraction, inside and outside, among which those are sought that hold others."""


@dataclass
class Surface:
    """What a BSDF becomes: the values of a material; whether the colours of vertices tint it; whether it is
    nothing at all, and rays go straight on."""

    look: Look
    has_vertex_colors: bool = False
    is_nothing: bool = False


@dataclass
class Materials:
    """Makes surfaces of BSDFs, each once."""

    document: Document
    textures: Textures
    _made: dict[int, Surface] = field(default_factory=dict)
    _bodies: dict[tuple[float, float], None] = field(default_factory=dict)
    _one_sided: set[int] = field(default_factory=set)
    _microfacets: set[tuple[str, bool]] = field(default_factory=set)

    def __post_init__(self) -> None:
        for node in self.document.nodes:
            if node.tag == "bsdf" and node.kind in ("dielectric", "roughdielectric"):
                with in_place(node.place):
                    body = index(node, "int_ior", "bk7"), index(node, "ext_ior", "air")
                if len(self._bodies) < _MOST_BODIES:
                    self._bodies[body] = None

    def of_shape(self, node: Node | None) -> Surface:
        """What a shape with that BSDF looks like. Raises InputError."""
        if node is None:
            return Surface(dict(MATTE))
        if _is_one_sided(node):
            self._one_sided.add(id(node))
        return self.surface(node)

    def surface(self, node: Node) -> Surface:
        """What a BSDF becomes. Raises InputError."""
        if id(node) not in self._made:
            with in_place(node.place):
                self._made[id(node)] = self._read(node)
                Material(**self._made[id(node)].look)
        return self._made[id(node)]

    @property
    def loses_no_light(self) -> bool:
        """Whether microfacets that let no light get lost are nearer to those of the scene: Beckmann's lose
        little within glass, where GGX's with the same alpha lose several percent."""
        others = {("roughdielectric", True), ("roughconductor", True), ("roughconductor", False)}
        return ("roughdielectric", False) in self._microfacets and not others & self._microfacets

    def tell_of_back_sides(self) -> None:
        """Of opaque BSDFs that have only one in Mitsuba."""
        if self._one_sided:
            what = import_report.counted(len(self._one_sided), "BSDF")
            import_report.changed(
                f"{what} without 'twosided': their backs, black there, look like their fronts"
            )

    def _read(self, node: Node) -> Surface:
        read = _KINDS.get(node.kind)
        if read is None:
            node.ignore(*node.values, *node.objects)
            import_report.left_out(f"{node}: nothing here is like it; grey stands for it")
            return Surface(dict(MATTE))
        return read(self, node)

    def _nested(self, node: Node) -> list[Surface]:
        """Those of the BSDFs within one. Raises InputError."""
        found = [self.surface(one) for one in node.objects_of("bsdf")]
        if not found:
            raise InputError(f"a {node.kind} needs a <bsdf> within it")
        return found

    def twosided(self, node: Node) -> Surface:
        node.ignore("allow_transmission")
        found = self._nested(node)
        if len(found) > 1:
            import_report.changed(f"{node}: its back looks like its front")
        return found[0]

    def diffuse(self, node: Node) -> Surface:
        color = self.textures.reflectance(node, "reflectance", 0.5)
        return Surface({**tinted(color), "specular": 0.0}, color.is_of_vertices)

    def conductor(self, node: Node) -> Surface:
        """Smooth or rough metal."""
        color = self.textures.reflectance(node, "specular_reflectance", 1.0)
        f0 = self._metal_color(node)
        metal = replace(color, rgb=product(color.rgb, f0))
        look = {**tinted(metal), "metallic": 1.0, "roughness": 0.0}
        if node.kind == "roughconductor":
            look |= self._rough_metal(node)
        return Surface(look, color.is_of_vertices)

    def _metal_color(self, node: Node) -> Vector:
        name = node.text("material", "none")
        if node.has("eta") or node.has("k") or name == "none":
            eta, k = self.textures.spectral(node, "eta", 0.0), self.textures.spectral(node, "k", 1.0)
            return metals.reflectance(eta, k)
        with in_place("material"):
            return metals.named_reflectance(name)

    def _rough_metal(self, node: Node) -> Look:
        """Roughness, stretched along u or v where they differ."""
        self._tell_of_distribution(node)
        if not (node.has("alpha_u") or node.has("alpha_v")):
            return roughened(self.textures.amount(node, "alpha", 0.1))
        along, across = (self.textures.amount(node, name, 0.1) for name in ("alpha_u", "alpha_v"))
        if along.image is not None or across.image is not None:
            import_report.changed(f"{node}: the roughness of an image is the same along u and v")
            return roughened(along if along.image is not None else across)
        low, high = sorted((min(along.value, 1.0), min(across.value, 1.0)))
        stretch = math.sqrt((high - low) / (1 - low)) if high > low else 0.0
        turn = 0.0 if along.value >= across.value else 90.0
        return {"roughness": math.sqrt(low), "anisotropy": stretch, "anisotropy_rotation": turn}

    def _tell_of_distribution(self, node: Node) -> None:
        node.ignore("sample_visible")
        is_ggx = node.text("distribution", "beckmann").lower() == "ggx"
        self._microfacets.add((node.kind, is_ggx))
        if not is_ggx:
            import_report.changed(f"{node}: the microfacets are GGX's with the same alpha, not Beckmann's")

    def plastic(self, node: Node) -> Surface:
        """A diffuse base under a dielectric, smooth or rough."""
        ior = max(index(node, "int_ior", "polypropylene") / index(node, "ext_ior", "air"), 1.0)
        color = self.textures.reflectance(node, "diffuse_reflectance", 0.5)
        if node.flag("nonlinear", False):
            # What comes from the base and is reflected back to it is tinted each time. Here it is not.
            inner = inner_reflectance(ior)
            color = color.mapped(lambda c: c * (1 - inner) / (1 - c * inner))
        look = {**tinted(color), "ior": ior, "roughness": 0.0}
        if node.kind != "plastic":
            self._tell_of_distribution(node)
            look |= roughened(self.textures.amount(node, "alpha", 0.1))
        return Surface(look | self._reflection(node), color.is_of_vertices)

    def _reflection(self, node: Node) -> Look:
        """Of a dielectric whose reflection is not that of Fresnel's formula alone."""
        color = self.textures.reflectance(node, "specular_reflectance", 1.0)
        if color.is_constant and color.rgb == (1.0, 1.0, 1.0):
            return {}
        found: Look = {"specular_color": color.rgb}
        return found if color.texture is None else {**found, "specular_color_texture": color.texture}

    def dielectric(self, node: Node) -> Surface:
        """A clear body, smooth or rough."""
        inside, outside = index(node, "int_ior", "bk7"), index(node, "ext_ior", "air")
        look: Look = {"transmission": 1.0, "roughness": 0.0, **self._body(node, inside, outside)}
        color = self.textures.reflectance(node, "specular_transmittance", 1.0)
        if node.kind == "roughdielectric":
            self._tell_of_distribution(node)
            if node.has("alpha_u") or node.has("alpha_v"):
                import_report.changed(f"{node}: the roughness is the same along u and v")
                pair = [self.textures.share(node, name, 0.1) for name in ("alpha_u", "alpha_v")]
                look |= roughened(Amount(math.sqrt(pair[0] * pair[1])))
            else:
                look |= roughened(self.textures.amount(node, "alpha", 0.1))
        reflection = self._reflection(node)
        if reflection:
            import_report.changed(f"specular_reflectance of {node}: what is not reflected goes through")
        return Surface({**look, **tinted(color), **reflection}, color.is_of_vertices)

    def _body(self, node: Node, inside: float, outside: float) -> Look:
        """The index of refraction of a body. Here bodies within others know what is around them: of two that
        overlap the one that stands deeper counts."""
        depth = self._depth(outside)
        holds_others = any(_is_same(inside, around) for _, around in self._bodies if around > _AIR_LIKE)
        # The highest priority, 0, is that of bodies which hold no others.
        priority = {"priority": depth} if holds_others else {}
        if depth > 1:
            import_report.changed(f"ext_ior of {node}: follows from the body around it")
            return {"ior": max(inside / AIR, 1.0), **priority}
        if inside < outside:
            import_report.changed(
                f"{node}: a body that is thinner than what is around it is taken for the denser"
            )
            return {"ior": outside / inside, **priority}
        return {"ior": inside / outside, **priority}

    def _depth(self, outside: float, deepest: int = 8) -> int:
        """How many bodies one stands in, itself included, by what is around each."""
        if outside <= _AIR_LIKE or deepest == 0:
            return 1
        around = next((other for inner, other in self._bodies if _is_same(inner, outside)), None)
        return 1 if around is None else 1 + self._depth(around, deepest - 1)

    def thindielectric(self, node: Node) -> Surface:
        ior = max(index(node, "int_ior", "bk7") / index(node, "ext_ior", "air"), 1.0)
        color = self.textures.reflectance(node, "specular_transmittance", 1.0)
        look: Look = {"transmission": 1.0, "thin_walled": True, "roughness": 0.0, "ior": ior}
        return Surface({**look, **tinted(color), **self._reflection(node)}, color.is_of_vertices)

    def principled(self, node: Node) -> Surface:
        """Disney's, with or without a thickness."""
        textures, is_thin = self.textures, node.kind == "principledthin"
        node.ignore(*(name for name in node.values if name.endswith("_sampling_rate")))
        color = textures.reflectance(node, "base_color", 0.5)
        passing = textures.share(node, "spec_trans", 0.0)
        if passing == 1 and not is_thin:
            # Light passes two boundaries, and gets the colour at both.
            color = color.mapped(np.sqrt)
        look = {**tinted(color), "transmission": passing, **self._layers(node, color, is_thin)}
        if textures.share(node, "flatness", 0.0) > 0:
            import_report.left_out(f"flatness of {node}: there is no such lobe")
        import_report.changed(
            f"{node}: its lobes are those of glTF, which are like Disney's but not the same"
        )
        if is_thin:
            # From 0, all is reflected, to 2, all goes through.
            half = min(textures.amount(node, "diff_trans", 0.0).mean / 2, 1.0)
            tint = color.rgb if color.texture is None else (1.0, 1.0, 1.0)
            look |= {
                "thin_walled": passing > 0,
                "diffuse_transmission": half,
                "diffuse_transmission_color": tint,
            }
        return Surface(look, color.is_of_vertices)

    def _layers(self, node: Node, color: Colored, is_thin: bool) -> Look:
        """Metal, reflection, and what lies on it."""
        textures = self.textures
        rough = textures.amount(node, "roughness", 0.5)
        metal = textures.amount(node, "metallic", 0.0)
        anisotropy = textures.share(node, "anisotropic", 0.0)
        if anisotropy > 0:
            look = stretched(metal, rough, anisotropy)
        else:
            look = metal_and_roughness(str(node), metal, rough)
        if node.has("eta") or is_thin:
            ior = max(textures.amount(node, "eta", 1.5).mean, 1.0)
        else:
            specular = textures.share(node, "specular", 0.5)
            ior = 2 / (1 - math.sqrt(0.08 * specular)) - 1
        gloss = textures.share(node, "clearcoat_gloss", 0.0)
        sheen, tint = textures.share(node, "sheen", 0.0), textures.share(node, "sheen_tint", 0.0)
        own = hue(color)
        return {
            **look,
            "ior": ior,
            "specular_color": between((1.0, 1.0, 1.0), own, textures.share(node, "spec_tint", 0.0)),
            # Its reflectance at normal incidence is a quarter of that of a lacquer with an index of 1.5.
            "clearcoat": textures.share(node, "clearcoat", 0.0) / 4,
            "clearcoat_roughness": math.sqrt(0.1 + gloss * (0.001 - 0.1)),
            "sheen_color": product((min(sheen, 1.0),) * 3, between((1.0, 1.0, 1.0), own, tint)),
            "sheen_roughness": 0.5 if sheen > 0 else 0.0,
        }

    def mask(self, node: Node) -> Surface:
        found = self._nested(node)[0]
        opacity = self.textures.amount(node, "opacity", 0.5)
        look = dict(found.look)
        base: Texture | None = look.get("base_color_texture")
        if base is not None and base.bitmap.has_alpha:
            base = replace(base, bitmap=Bitmap(base.bitmap.pixels[..., :-1]))
        if opacity.image is not None:
            base = with_alpha(str(node), base, opacity.image)
        alpha = min(opacity.value, 1.0)
        look |= {"alpha": alpha, "alpha_mode": "blend", "base_color_texture": base}
        return replace(found, look=look)

    def null(self, node: Node) -> Surface:
        return Surface({**MATTE, "alpha": 0.0, "alpha_mode": "mask"}, is_nothing=True)

    def bumpmap(self, node: Node) -> Surface:
        found = self._nested(node)[0]
        scale = node.number("scale", 1.0)
        node.ignore("flip_invalid_normals", "use_shadowing_function")
        image = next(((name, one) for name, one in node.objects.items() if one.tag == "texture"), None)
        if image is None:
            raise InputError("a bumpmap needs a <texture> within it")
        height = self.textures.amount(node, image[0], 0.0)
        if height.image is None:
            return found
        texture = height.image.with_pixels(height.image.pixels)
        scale = min(max(scale, -HIGHEST_BUMP), HIGHEST_BUMP)
        return replace(found, look={**found.look, "bump_texture": texture, "bump_scale": scale})

    def normalmap(self, node: Node) -> Surface:
        found = self._nested(node)[0]
        node.ignore("flip_invalid_normals", "use_shadowing_function")
        color = self.textures.reflectance(node, "normalmap", 0.5)
        if color.texture is None:
            return found
        return replace(found, look={**found.look, "normal_texture": upright(color.texture)})

    def blendbsdf(self, node: Node) -> Surface:
        found = self._nested(node)
        if len(found) != 2:
            raise InputError(f"a blendbsdf blends two BSDFs, not {len(found)}")
        weight = self.textures.amount(node, "weight", 0.5)
        heavier = found[int(weight.mean >= 0.5)]
        mixed = blended(found[0].look, found[1].look, weight)
        if mixed is None or any(one.has_vertex_colors for one in found):
            import_report.changed(f"{node}: is the heavier of the two that it blends")
            return heavier
        if any(set(one.look) != set(MATTE) for one in found):
            import_report.changed(f"{node}: the numbers of its two BSDFs are mixed, not what they reflect")
        return Surface(mixed)


_KINDS: dict[str, Callable[[Materials, Node], Surface]] = {
    "diffuse": Materials.diffuse,
    "twosided": Materials.twosided,
    "conductor": Materials.conductor,
    "roughconductor": Materials.conductor,
    "plastic": Materials.plastic,
    "roughplastic": Materials.plastic,
    "pplastic": Materials.plastic,
    "dielectric": Materials.dielectric,
    "roughdielectric": Materials.dielectric,
    "thindielectric": Materials.thindielectric,
    "principled": Materials.principled,
    "principledthin": Materials.principled,
    "mask": Materials.mask,
    "null": Materials.null,
    "bumpmap": Materials.bumpmap,
    "normalmap": Materials.normalmap,
    "blendbsdf": Materials.blendbsdf,
}
"""What reads each type of BSDF."""


def _is_same(first: float, second: float) -> bool:
    """Whether two indices of refraction are those of one substance."""
    return abs(first - second) < _SAME_INDEX


_WRAPPERS = ("mask", "bumpmap", "normalmap", "blendbsdf")
_ONE_SIDED = ("diffuse", "conductor", "roughconductor", "plastic", "roughplastic", "pplastic", "principled")


def _is_one_sided(node: Node) -> bool:
    """Whether the back of a surface is black in Mitsuba."""
    if node.kind in _WRAPPERS:
        return any(_is_one_sided(one) for one in node.objects.values() if one.tag == "bsdf")
    return node.kind in _ONE_SIDED and not node.has("spec_trans")
