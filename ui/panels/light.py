"""A light: its kind, how much it emits, how large it is, and who sees it."""

from __future__ import annotations

from incpt.scene.edits import LIGHT_NAMES
from incpt.scene.light import KINDS, STRENGTHS, Light, changed, keys_of
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

_UNITS = {
    "power": ("Power", " W", "Radiant power in all directions together"),
    "radiance": ("Radiance", " W/(m² sr)", "Of its surface"),
    "irradiance": ("Irradiance", " W/m²", "On a surface that faces it"),
}
"""How the field for each of STRENGTHS is called, its unit and its tip."""


def draw(light: Light, refusals: Refusals) -> Light:
    """Fields for all that the light's kind has; returns the light after this frame."""
    kinds = [(kind, LIGHT_NAMES[kind].removesuffix(" light").capitalize()) for kind in KINDS]
    kind = widgets.choice("Kind", light.kind, kinds, "It shines along -z of its own axes")
    if kind != light.kind:
        return refusals.accepted(light, lambda: changed(light, {"kind": kind}))
    light = _draw_strength(light, refusals)
    light = _draw_size(light, refusals)
    light = _draw_switch(light, refusals, "camera_visible", "Seen by camera", "Mirrors show it all the same")
    return _draw_switch(light, refusals, "casts_shadows", "Casts shadows", "Off: nothing is in its way")


def _draw_strength(light: Light, refusals: Refusals) -> Light:
    color = widgets.color("Light colour", light.color, is_radiance=True, tip="Times the strength")
    light = refusals.changed(light, color=color)
    unit, value = light.strength
    offered = ["irradiance" if light.is_far else "power", *(["radiance"] if light.has_size else [])]
    options = [(name, _UNITS[name][0]) for name in STRENGTHS if name in offered]
    chosen = widgets.choice("Unit", unit, options, "What stays as it is when the light gets another size")
    if chosen != unit:
        # The light stays as bright as it is.
        factor = light.face * (1.0 if light.is_far else light.solid_angle)
        as_bright = value / factor if chosen == "radiance" else value * factor
        return refusals.accepted(light, lambda: changed(light, {chosen: as_bright}))
    label, suffix, tip = _UNITS[unit]
    new = widgets.number(label, value, high=1e9, speed=max(value, 0.1) * 0.01, unit=suffix, tip=tip)
    return refusals.changed(light, **{unit: new})


def _draw_size(light: Light, refusals: Refusals) -> Light:
    keys = keys_of(light.kind)
    if "radius" in keys:
        tip = "0: a point, with sharp shadows" if light.kind in ("point", "spot") else ""
        radius = widgets.number("Radius", light.radius, high=1e6, speed=0.005, unit=" m", tip=tip)
        light = refusals.changed(light, radius=radius)
    if "size" in keys:
        width, height = light.size
        width = widgets.number("Width of light", width, high=1e6, speed=0.01, unit=" m")
        height = widgets.number("Height of light", height, high=1e6, speed=0.01, unit=" m")
        light = refusals.changed(light, size=(width, height))
    if "angle" in keys:
        angle = widgets.number("Diameter", light.angle, high=180.0, speed=0.01, unit="°", tip="As it is seen")
        light = refusals.changed(light, angle=angle)
    if "spot_angle" in keys:
        angle = widgets.number("Cone", light.spot_angle, low=0.001, high=180.0, speed=0.2, unit="°")
        light = refusals.changed(light, spot_angle=angle)
        tip = "The outer part of the cone, over which light falls off"
        blend = widgets.number("Blend", light.spot_blend, high=1.0, speed=0.005, tip=tip)
        light = refusals.changed(light, spot_blend=blend)
    if "double_sided" in keys:
        light = _draw_switch(light, refusals, "double_sided", "Both sides", "It shines along +z as well")
    return light


def _draw_switch(light: Light, refusals: Refusals, name: str, label: str, tip: str) -> Light:
    return refusals.changed(light, **{name: widgets.checkbox(label, getattr(light, name), tip)})
