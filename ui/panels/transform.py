"""Position, rotation and scale of an object."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from incpt.core.transform import Vector
from incpt.scene.model import Object
from incpt.ui.widgets import widgets
from incpt.ui.widgets.widgets import Refusals


def draw(obj: Object, is_uniform: bool, refusals: Refusals) -> tuple[Object, bool]:
    """Fields for the transform; returns the object after this frame, and whether scale keeps its
    proportions."""
    position = widgets.vector("Position", obj.position, speed=0.01, unit=" m", tip="World space, metres")
    obj = _changed(obj, "position", position, refusals)
    rotation = widgets.vector(
        "Rotation", obj.rotation, speed=0.5, unit="°", decimals=2, tip="Degrees about x, then y, then z"
    )
    obj = _changed(obj, "rotation", rotation, refusals)
    scale = widgets.vector("Scale", obj.scale, speed=0.01, tip="Factor along the object's own axes")
    scale = proportional(obj.scale, scale) if is_uniform else scale
    obj = _changed(obj, "scale", scale, refusals)
    is_uniform = widgets.checkbox("Uniform scale", is_uniform, "One field of the scale changes all three")
    return _reset_buttons(obj), is_uniform


def proportional(old: Vector, new: Vector) -> Vector:
    """`new`, in which one component differs from `old`, with the others scaled alike."""
    for before, after in zip(old, new, strict=True):
        if before != after and before != 0.0:
            x, y, z = (component * after / before for component in old)
            return x, y, z
    return new


def _changed(obj: Object, name: str, value: Vector, refusals: Refusals) -> Object:
    if value == getattr(obj, name):
        return obj
    changes: dict[str, Any] = {name: value}
    return refusals.accepted(obj, lambda: replace(obj, **changes))


def _reset_buttons(obj: Object) -> Object:
    with widgets.row("Reset"):
        for i, name in enumerate(("position", "rotation", "scale")):
            if i > 0:
                widgets.same_line()
            default = getattr(Object, name)
            if widgets.button(name.capitalize(), enabled=getattr(obj, name) != default):
                obj = replace(obj, **{name: default})
    return obj
