"""Values of material parameters that differ from the defaults, so that a test cannot miss a new one."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from incpt.core.errors import InputError
from incpt.core.layout import TextureSlot
from incpt.scene.material import Material, texture_name
from incpt.scene.texture import Bitmap, Texture

NAMES = tuple(field.name for field in fields(Material))
TEXTURES = tuple(texture_name(slot) for slot in TextureSlot)
"""Parameters that are textures."""
A_TEXTURE = Texture(Bitmap(np.full((1, 1, 3), 128, np.uint8)))
"""The same grey everywhere."""


def unlike_default(name: str) -> Any:
    """A valid value of a parameter, in every component unlike that of its default."""
    default = getattr(Material(), name)
    if name in TEXTURES:
        return A_TEXTURE
    if isinstance(default, bool):
        return not default
    if name == "alpha_mode":
        return "blend"
    if isinstance(default, int):
        return default + 7
    if isinstance(default, tuple):
        return tuple(0.125 + 0.25 * i for i in range(len(default)))
    for value in (default + 0.25, default - 0.25):
        try:
            Material(**{name: value})
        except InputError:
            continue
        return value
    raise AssertionError(f"{name}: {default} has no valid neighbour; name one here")
