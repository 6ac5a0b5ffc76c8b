"""The textures of a material: which image each parameter is read from, and from where that is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from incpt.core.layout import TextureSlot
from incpt.scene.material import Material, texture_name, texture_of
from incpt.scene.texture import Texture
from incpt.ui.widgets import places, widgets
from incpt.ui.widgets.refusals import Refusals
from incpt.ui.widgets.thumbnails import Thumbnails

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


_COLORS = (
    TextureSlot.BASE_COLOR,
    TextureSlot.EMISSION,
    TextureSlot.SPECULAR_COLOR,
    TextureSlot.SHEEN_COLOR,
    TextureSlot.DIFFUSE_TRANSMISSION_COLOR,
)
"""The slots whose images are colours; others are plain numbers."""
_PREVIEW_LINES = 14.0
"""Edge of the larger picture that hovering shows, in heights of a line."""


@dataclass(frozen=True)
class TextureRequest:
    """The slot that the user wants another image for, if any."""

    choose: TextureSlot | None = None


def draw(
    material: Material, name: str, thumbnails: Thumbnails, refusals: Refusals
) -> tuple[Material, TextureRequest]:
    """A row for each slot of the material of that name; returns the material after this frame, and what is
    asked for."""
    request = TextureRequest()
    is_used = any(texture_of(material, slot) is not None for slot in TextureSlot)
    with widgets.section("Textures", is_used) as is_open:
        if not is_open:
            return material, request
        for slot in _LABELS:
            texture = texture_of(material, slot)
            if texture is None and not _is_shown(material, slot):
                continue
            asked = _draw_slot(slot, texture, thumbnails)
            places.note(f"slot {texture_name(slot)} of {name}")
            if asked == "choose":
                request = TextureRequest(slot)
            if asked == "remove":
                material = refusals.changed(material, **{texture_name(slot): None})
            if slot is TextureSlot.NORMAL:
                material = _draw_strength(material, refusals, "normal_scale", "Normal strength")
            if slot is TextureSlot.BUMP:
                material = _draw_bump_height(material, refusals)
            if slot is TextureSlot.CLEARCOAT_NORMAL and texture is not None:
                material = _draw_strength(material, refusals, "clearcoat_normal_scale", "Coat strength")
        return material, request


def slot_at(x: float, y: float) -> tuple[str, TextureSlot] | None:
    """The name of a material and its slot whose row was drawn at this place of the window, in points; None:
    there is none."""
    slots = {texture_name(slot): slot for slot in TextureSlot}
    for place in places.names():
        row = places.find(place)
        if place.startswith("slot ") and row is not None and row.contains((x, y)):
            slot, _, material = place.removeprefix("slot ").partition(" of ")
            return material, slots[slot]
    return None


def _draw_slot(slot: TextureSlot, texture: Texture | None, thumbnails: Thumbnails) -> str:
    """The row of a slot; returns "choose" or "remove" where one of its buttons was pressed, else nothing."""
    (label, tip), asked = _LABELS[slot], ""
    imgui.begin_group()
    with widgets.row(label, tip):
        if texture is not None:
            _draw_thumbnail(slot, texture, thumbnails)
            widgets.same_line()
        imgui.begin_group()
        if texture is not None:
            widgets.clipped_text(_described(texture), imgui.get_content_region_avail().x)
        if widgets.button(f"Choose…##{texture_name(slot)}", "An image file; or drop one here"):
            asked = "choose"
        widgets.same_line()
        if widgets.button(f"Remove##{texture_name(slot)}", enabled=texture is not None):
            asked = "remove"
        imgui.end_group()
    imgui.end_group()
    return asked


def _draw_thumbnail(slot: TextureSlot, texture: Texture, thumbnails: Thumbnails) -> None:
    bitmap = texture.bitmap
    side = imgui.get_text_line_height() + imgui.get_style().item_spacing.y + imgui.get_frame_height()
    thumbnails.draw(bitmap, bitmap.pixels, side)
    places.note(f"thumbnail {texture_name(slot)}")
    if not imgui.begin_item_tooltip():
        return
    thumbnails.draw(bitmap, bitmap.pixels, imgui.get_text_line_height() * _PREVIEW_LINES)
    imgui.text_unformatted(bitmap.source.file or "Made in Python")
    if bitmap.source.index is not None:
        imgui.text_unformatted(f"Its image {bitmap.source.index}")
    widgets.note(kind_text(slot, texture))
    imgui.end_tooltip()


def kind_text(slot: TextureSlot, texture: Texture) -> str:
    """What the pixels of an image are, and how they are read."""
    bitmap = texture.bitmap
    channels = {1: "grey", 2: "grey and alpha", 3: "RGB", 4: "RGB and alpha"}[bitmap.channels]
    bits = bitmap.pixels.dtype.itemsize * 8
    depth = f"{bits}-bit float" if bitmap.pixels.dtype.kind == "f" else f"{bits}-bit"
    is_linear = bitmap.pixels.dtype.kind == "f"
    meaning = "plain numbers"
    if slot in _COLORS:
        meaning = "linear colours" if is_linear else "colours in sRGB"
    size = "missing" if bitmap.is_placeholder else f"{bitmap.width} × {bitmap.height}"
    return f"{size}, {depth} {channels}, {meaning}, UV set {texture.uv_set}"


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
