"""The textures of a material: which image each parameter is read from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from incpt.core.layout import TextureSlot
from incpt.scene.material import Material, texture_name, texture_of
from incpt.scene.texture import Texture
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

_LABELS = {
    TextureSlot.BASE_COLOR: ("Base colour map", "Times the base colour"),
    TextureSlot.METALLIC_ROUGHNESS: ("Metal, rough map", "Blue times metallic, green times roughness"),
    TextureSlot.NORMAL: ("Normal map", "Bends the shading normal; OpenGL's convention, green is up"),
    TextureSlot.EMISSION: ("Emission map", "Times the emission, which is black at first"),
    TextureSlot.TRANSMISSION: ("Transmission map", "Red times transmission"),
    TextureSlot.SPECULAR: ("Specular map", "Alpha times specular"),
}


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
            with widgets.row(label, tip):
                if widgets.button(f"Choose…##{name}", "An image file"):
                    request = TextureRequest(slot)
                widgets.same_line()
                if widgets.button(f"Remove##{name}", enabled=texture is not None):
                    material = refusals.changed(material, **{name: None})
            if texture is not None:
                widgets.value_row("   File", _described(texture), tip)
            if slot is TextureSlot.NORMAL:
                material = _draw_strength(material, refusals)
        return material, request


def _draw_strength(material: Material, refusals: Refusals) -> Material:
    strength = widgets.number(
        "Normal strength", material.normal_scale, high=4.0, tip="Times the slopes of the normal map"
    )
    return refusals.changed(material, normal_scale=strength)


def _described(texture: Texture) -> str:
    bitmap = texture.bitmap
    source = bitmap.source
    name = "made in Python" if source.file is None else Path(source.file).name
    part = "" if source.index is None else f" {source.index}"
    return f"{name}{part}, {bitmap.width} × {bitmap.height}"
