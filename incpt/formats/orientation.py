"""Which way is up in a mesh file, and how long its unit is, where the format does not say it.

Programs of engineers and printers count in millimetres and call the third axis up; in a scene that is the
second, and its unit is the metre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from incpt.core.checks import described
from incpt.core.errors import InputError
from incpt.formats.import_options import SMALLEST_UNIT, current_options
from incpt.scene.checks import LARGEST
from incpt.scene.mesh_part import MeshPart
from incpt.scene.transform import IDENTITY, Transform

ROTATIONS = {"y": (0.0, 0.0, 0.0), "z": (-90.0, 0.0, 0.0)}
"""What turns files to y up, by the axis that is up in them."""
UNITS: Mapping[str, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "in": 0.0254, "ft": 0.3048}
"""Metres of a unit."""


def unit_of(text: str) -> float:
    """The metres of a unit by its name, or by their number. Raises InputError."""
    word = text.strip().lower()
    if word in UNITS:
        return UNITS[word]
    try:
        metres = float(word)
    except ValueError:
        metres = 0.0
    if not SMALLEST_UNIT <= metres <= LARGEST:
        raise InputError(f"unit: {described(text)} is none; use {', '.join(UNITS)}, or a number of metres")
    return metres


def upright(parts: tuple[MeshPart, ...], says_units: bool) -> tuple[MeshPart, ...]:
    """Parts of a file as the options say that they are meant. `says_units`: the format says it itself. Raises
    InputError where both do."""
    options = current_options()
    if (options.up, options.unit) == (None, None):
        return parts
    if says_units:
        raise InputError("the file says itself where up is and what its unit is; leave `up` and `unit` out")
    rotation, unit = ROTATIONS[options.up or "y"], options.unit or 1.0
    turn = Transform(rotation=rotation, scale=(unit, unit, unit))
    return tuple(replace(part, transform=_after(turn, part.transform)) for part in parts)


def _after(turn: Transform, placed: Transform) -> Transform:
    if placed == IDENTITY:
        return turn
    outer, inner = (np.vstack([one.world_from_object, [0, 0, 0, 1]]) for one in (turn, placed))
    return Transform.from_matrix((outer @ inner)[:3].tolist())
