"""Materials: all parameters of one, and which object has which."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.scene.material import Material
from incpt.ui.widgets import mixed, widgets
from incpt.ui.widgets.refusals import Refusals


@dataclass(frozen=True)
class Outcome:
    """What the user asked for in a frame, besides parameters: assign, make, duplicate, rename or delete."""

    assign: str | None = None
    is_new: bool = False
    is_duplicate: bool = False
    is_rename: bool = False
    is_delete: bool = False


def draw_choice(names: tuple[str, ...], current: str, users: int) -> Outcome:
    """The material of the selected objects, and buttons for new ones. `users`: objects that have it."""
    options = [(name, name) for name in names]
    chosen = widgets.choice("Material", current, options, "Assigned to every selected object")
    with widgets.row(f"{users} {'object' if users == 1 else 'objects'}", "Objects that have this material"):
        is_new = widgets.button("New##material", "A new material for the selected objects")
        widgets.same_line()
        is_duplicate = widgets.button("Duplicate##material", "A copy of it for the selected objects")
    with widgets.row("", ""):
        is_rename = widgets.button("Rename…##material")
        widgets.same_line()
        is_delete = widgets.button(
            "Delete##material", "Where objects have it, another is asked for in its place"
        )
    is_assigned = chosen != current or "Material" in mixed.given()
    return Outcome(chosen if is_assigned else None, is_new, is_duplicate, is_rename, is_delete)


def draw(material: Material, refusals: Refusals) -> Material:
    """Fields for all parameters; returns the material after this frame."""
    color = widgets.color("Base colour", material.base_color, tip="Diffuse albedo; of metals the reflectance")
    material = refusals.changed(material, base_color=color)
    material = _draw_share(material, refusals, "metallic", "Metallic", "0: dielectric, 1: metal")
    material = _draw_share(material, refusals, "roughness", "Roughness", "GGX alpha is its square")
    material = _draw_share(
        material, refusals, "specular", "Specular", "Dielectric layer; 0 is exactly Lambertian"
    )
    tint = widgets.color("Specular tint", material.specular_color, tip="Colour of the dielectric layer")
    material = refusals.changed(material, specular_color=tint)
    ior = widgets.number("IOR", material.ior, low=1.0, high=4.0, speed=0.005, tip="Index of refraction")
    material = refusals.changed(material, ior=ior)
    for part in _PARTS:
        material = part(material, refusals)
    return material


def _draw_clearcoat(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Clearcoat", material.clearcoat > 0) as is_open:
        if not is_open:
            return material
        material = _draw_share(material, refusals, "clearcoat", "Clearcoat", "A colourless lacquer on all")
        return _draw_share(
            material, refusals, "clearcoat_roughness", "Coat roughness", "GGX alpha: its square"
        )


def _draw_sheen(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Sheen", any(material.sheen_color)) as is_open:
        if not is_open:
            return material
        color = widgets.color("Sheen", material.sheen_color, tip="Fuzz of cloth; black: none")
        material = refusals.changed(material, sheen_color=color)
        return _draw_share(material, refusals, "sheen_roughness", "Sheen rough", "Low: at the edges only")


def _draw_anisotropy(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Anisotropy", material.anisotropy > 0) as is_open:
        if not is_open:
            return material
        material = _draw_share(material, refusals, "anisotropy", "Anisotropy", "How far reflections stretch")
        turn = widgets.number(
            "Direction", material.anisotropy_rotation, speed=0.5, unit="°", tip="From the tangent, along u"
        )
        return refusals.changed(material, anisotropy_rotation=turn)


def _draw_iridescence(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Iridescence", material.iridescence > 0) as is_open:
        if not is_open:
            return material
        material = _draw_share(
            material, refusals, "iridescence", "Iridescence", "Share that a thin film covers"
        )
        ior = widgets.number(
            "Film IOR", material.iridescence_ior, low=1.0, high=4.0, speed=0.005, tip="Of the film"
        )
        material = refusals.changed(material, iridescence_ior=ior)
        for name, label in (
            ("iridescence_thickness", "Thickness"),
            ("iridescence_least_thickness", "Least thickness"),
        ):
            value = widgets.number(
                label,
                getattr(material, name),
                low=0.0,
                high=2000.0,
                speed=2.0,
                unit=" nm",
                tip=_FILM_TIPS[name],
            )
            material = refusals.changed(material, **{name: value})
        return material


def _draw_translucency(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Translucency", material.diffuse_transmission > 0) as is_open:
        if not is_open:
            return material
        material = _draw_share(
            material,
            refusals,
            "diffuse_transmission",
            "Translucency",
            "Diffuse light that goes through: leaves",
        )
        color = widgets.color(
            "Through colour",
            material.diffuse_transmission_color,
            tip="Colour of what goes through",
        )
        return refusals.changed(material, diffuse_transmission_color=color)


def _draw_alpha(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Cut-out", material.is_cutout) as is_open:
        if not is_open:
            return material
        mode = widgets.choice(
            "Alpha mode",
            material.alpha_mode,
            [("opaque", "Opaque"), ("mask", "Mask"), ("blend", "Blend")],
            "Mask: covers all from the cutoff on; blend: covers that share of what is behind",
        )
        material = refusals.changed(material, alpha_mode=mode)
        material = _draw_share(material, refusals, "alpha", "Alpha", "Times that of the base colour map")
        return _draw_share(material, refusals, "alpha_cutoff", "Cutoff", "From which alpha on a mask covers")


def _draw_transmission(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Transmission", material.transmission > 0) as is_open:
        if not is_open:
            return material
        material = _draw_share(material, refusals, "transmission", "Transmission", "1: glass")
        is_thin = widgets.checkbox(
            "Thin walled", material.thin_walled, "A wall without thickness, not a body"
        )
        material = refusals.changed(material, thin_walled=is_thin)
        dispersion = widgets.number(
            "Dispersion", material.dispersion, low=0.0, high=5.0, speed=0.01, tip="20 / Abbe's number"
        )
        material = refusals.changed(material, dispersion=dispersion)
        absorption = widgets.vector(
            "Absorption",
            material.absorption,
            speed=0.05,
            high=1e6,
            unit=" /m",
            names=("R", "G", "B"),
            tip="Per metre of the way inside",
        )
        material = refusals.changed(material, absorption=absorption)
        priority = widgets.whole_number(
            "Priority",
            material.priority,
            low=0,
            high=1000,
            tip="Where bodies overlap the higher wins; 0 is the highest of all",
        )
        return refusals.changed(material, priority=priority)


def _draw_emission(material: Material, refusals: Refusals) -> Material:
    with widgets.section("Emission", any(material.emission) or material.unlit) as is_open:
        if not is_open:
            return material
        emission = widgets.radiance("Emission", material.emission, tip="Radiance: colour times strength")
        material = refusals.changed(material, emission=emission)
        is_double = widgets.checkbox("Double sided", material.double_sided, "Emission from the back too")
        material = refusals.changed(material, double_sided=is_double)
        is_unlit = widgets.checkbox("Unlit", material.unlit, "Shines with its base colour, reflects nothing")
        return refusals.changed(material, unlit=is_unlit)


def _draw_share(material: Material, refusals: Refusals, name: str, label: str, tip: str) -> Material:
    """A parameter between 0 and 1."""
    value = widgets.number(label, getattr(material, name), low=0.0, high=1.0, speed=0.005, tip=tip)
    return refusals.changed(material, **{name: value})


_PARTS = (
    _draw_alpha, _draw_transmission, _draw_translucency, _draw_clearcoat, _draw_sheen, _draw_anisotropy,
    _draw_iridescence, _draw_emission,
)  # fmt: skip
"""The sections, from the top."""
_FILM_TIPS = {
    "iridescence_thickness": "Of the film; where its map is white",
    "iridescence_least_thickness": "Where the film's map is black",
}
