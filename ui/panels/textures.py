"""The textures of a material: which image each parameter is read from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from incpt.core.layout import TextureSlot
from incpt.scene.material import Material, texture_name, texture_of
from incpt.scene.texture import Texture
from incpt.ui.rect import Rect
from incpt.ui.widgets import places, widgets
from incpt.ui.widgets.refusals import Refusals

_LABELS = {
    TextureSlot.BASE_COLOR: ("Base colour map", "Times the base colour"),
    TextureSlot.METALLIC_ROUGHNESS: ("Metal, rough map", "Blue times metallic, green times roughness"),
    TextureSlot.NORMAL: ("Normal map", "Bends the shading normal; OpenGL's convention, green is up"),
    TextureSlot.BUMP: ("Height map", "Red is the height of bumps, which bend the shading normal"),
    TextureSlot.EMISSION: ("Emission map", "Times the emission, which is black at first"),
    TextureSlot.TRANSMISSION: ("Transmission map", "Red times transmission"),
    TextureSlot.SPECULAR: ("Specular map", "Alpha times specular"),
    TextureSlot.SPECULAR_COLOR: ("Specular tint map", "Times the specular tint"),
    TextureSlot.CLEARCOAT: ("Clearcoat map", "Red times clearcoat"),
    TextureSlot.CLEARCOAT_ROUGHNESS: ("Coat rough map", "Green times the clearcoat's roughness"),
    TextureSlot.CLEARCOAT_NORMAL: ("Coat normal map", "Bends the clearcoat's normal; smooth without it"),
    TextureSlot.SHEEN_COLOR: ("Sheen map", "Times the sheen colour"),
    TextureSlot.SHEEN_ROUGHNESS: ("Sheen rough map", "Alpha times the sheen's roughness"),
    TextureSlot.ANISOTROPY: ("Anisotropy map", "Blue times anisotropy; red and green are its direction"),
    TextureSlot.IRIDESCENCE: ("Iridescence map", "Red times iridescence"),
    TextureSlot.IRIDESCENCE_THICKNESS: ("Film map", "Green: from the least thickness to the thickness"),
    TextureSlot.DIFFUSE_TRANSMISSION: ("Translucency map", "Alpha times the translucency"),
    TextureSlot.DIFFUSE_TRANSMISSION_COLOR: ("Transl. colour map", "Times the translucency's colour"),
}
_OF_PART = {
    TextureSlot.CLEARCOAT: "clearcoat",
    TextureSlot.CLEARCOAT_ROUGHNESS: "clearcoat",
    TextureSlot.CLEARCOAT_NORMAL: "clearcoat",
    TextureSlot.SHEEN_COLOR: "sheen_color",
    TextureSlot.SHEEN_ROUGHNESS: "sheen_color",
    TextureSlot.ANISOTROPY: "anisotropy",
    TextureSlot.IRIDESCENCE: "iridescence",
    TextureSlot.IRIDESCENCE_THICKNESS: "iridescence",
    TextureSlot.DIFFUSE_TRANSMISSION: "diffuse_transmission",
    TextureSlot.DIFFUSE_TRANSMISSION_COLOR: "diffuse_transmission",
}
"""The parameter without which a slot has nothing to act on, and no row."""


@dataclass(frozen=True)
class TextureRequest:
    """The slot that the user wants another image for, if any."""

    choose: TextureSlot | None = None


def draw(material: Material, refusals: Refusals) -> tuple[Material, TextureRequest]:
    """A row for each slot; returns the material after this frame, and what is asked for."""
    request = TextureRequest()
    is_used = any(texture_of(material, slot) is not None for slot in TextureSlot)
    with widgets.section("Textures", is_used) as is_open:
        if not is_open:
            return material, request
        for slot, (label, tip) in _LABELS.items():
            texture, name = texture_of(material, slot), texture_name(slot)
            if texture is None and not _is_shown(material, slot):
                continue
            with widgets.row(label, tip):
                if widgets.button(f"Choose…##{name}", "An image file; or drop one here"):
                    request = TextureRequest(slot)
                places.note_rect(f"slot {name}", _row_rect())
                widgets.same_line()
                if widgets.button(f"Remove##{name}", enabled=texture is not None):
                    material = refusals.changed(material, **{name: None})
            if texture is not None:
                widgets.value_row("   File", _described(texture), tip)
            if slot is TextureSlot.NORMAL:
                material = _draw_strength(material, refusals, "normal_scale", "Normal strength")
            if slot is TextureSlot.BUMP:
                material = _draw_bump_height(material, refusals)
            if slot is TextureSlot.CLEARCOAT_NORMAL and texture is not None:
                material = _draw_strength(material, refusals, "clearcoat_normal_scale", "Coat strength")
        return material, request


def slot_at(x: float, y: float) -> TextureSlot | None:
    """The slot whose row was drawn at this place of the window, in points; None: there is none."""
    for slot in TextureSlot:
        name = texture_name(slot)
        row, button = places.find(f"slot {name}"), places.find(f"Choose…##{name}")
        # A row that its panel has scrolled out of sight has no button.
        if row is not None and button is not None and row.contains((x, y)):
            return slot
    return None


def _row_rect() -> Rect[float]:
    """The whole row of the widget drawn last, across the panel."""
    left, width = imgui.get_window_pos().x, imgui.get_window_width()
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    return Rect(left, low.y, width, high.y - low.y)


def _is_shown(material: Material, slot: TextureSlot) -> bool:
    value = getattr(material, _OF_PART[slot]) if slot in _OF_PART else True
    return any(value) if isinstance(value, tuple) else bool(value)


def _draw_strength(material: Material, refusals: Refusals, name: str, label: str) -> Material:
    strength = widgets.number(label, getattr(material, name), high=4.0, tip="Times the slopes of the map")
    return refusals.changed(material, **{name: strength})


def _described(texture: Texture) -> str:
    bitmap = texture.bitmap
    source = bitmap.source
    name = "made in Python" if source.file is None else Path(source.file).name
    part = "" if source.index is None else f" {source.index}"
    size = "missing" if bitmap.is_placeholder else f"{bitmap.width} × {bitmap.height}"
    return f"{name}{part}, {size}"


def _draw_bump_height(material: Material, refusals: Refusals) -> Material:
    tip = "How much higher white is than black; below 0 bumps are dents"
    metres = widgets.number("Bump height", material.bump_scale, speed=0.001, unit=" m", decimals=4, tip=tip)
    return refusals.changed(material, bump_scale=metres)
