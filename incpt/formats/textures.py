"""Textures in scene files and edit scripts: from the values of a table, and back.

A texture is the name of an image file, or a table with `file` and how the image is read:

    base_color_texture = "wood.jpg"
    normal_texture = { file = "wood_normal.jpg", scale = [4, 4], wrap = "mirror" }
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError, in_place
from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps, placeholders
from incpt.formats.toml_kit import check_keys, text_of
from incpt.scene.material import texture_name
from incpt.scene.texture import Bitmap, BitmapSource, Texture

NAMES = tuple(texture_name(slot) for slot in TextureSlot)
"""Parameters of materials that are textures."""
_OPTIONS = tuple(field.name for field in fields(Texture) if field.name != "bitmap")
_KEYS = ("file", "image", *_OPTIONS)


def with_textures(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The values of a material's table, with textures in place of what names their files, relative to
    `folder`. `""` or `false` takes a texture away. Raises InputError."""
    found = dict(values)
    for slot in TextureSlot:
        name = texture_name(slot)
        if name in found:
            with in_place(name):
                found[name] = _texture(found[name], folder, slot)
    return found


def _texture(value: Any, folder: Path, slot: TextureSlot) -> Texture | None:
    if value == "" or value is False:
        return None
    table = {"file": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        raise InputError(f"{value!r} is no texture; write the name of an image, or a table with `file`")
    check_keys(table, _KEYS)
    file = text_of(table, "file", "name an image file")
    index = table.get("image")
    if index is not None and (isinstance(index, bool) or not isinstance(index, int) or index < 0):
        raise InputError(f"image: {index!r} is not the number of an image of the file; count from 0")
    source = BitmapSource(os.path.abspath(folder / file), index)
    bitmap = placeholders.read_or(
        lambda: bitmaps.load_bitmap(folder / file, index),
        lambda: placeholders.bitmap(source, slot),
        "one colour",
    )
    return Texture(bitmap, **{name: table[name] for name in _OPTIONS if name in table})


def texture_value(texture: Texture, name_of: Callable[[Bitmap], dict[str, Any]]) -> Any:
    """What a scene file holds of a texture. `name_of` gives the keys `file` and `image` of a bitmap."""
    defaults = Texture(texture.bitmap)
    options = {name: getattr(texture, name) for name in _OPTIONS}
    changed = {name: value for name, value in options.items() if value != getattr(defaults, name)}
    source = name_of(texture.bitmap)
    return source["file"] if not changed and len(source) == 1 else {**source, **changed}
