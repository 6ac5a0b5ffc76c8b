"""Position, rotation and scale of an object or a light."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from incpt.core.affine import Vector
from incpt.scene.model import Placed
from incpt.scene.transform import Transform
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

T = TypeVar("T", bound=Placed)

COMPONENTS = {
    f"{part.capitalize()} {axis}": (part, i)
    for part in ("position", "rotation", "scale")
    for i, axis in enumerate("XYZ")
}
"""(part, axis) of each field, by its label."""


def draw(obj: T, is_uniform: bool, refusals: Refusals) -> tuple[T, bool]:
    """Fields for the transform; returns the object or light after this frame, and whether scale keeps its
    proportions."""
    position = widgets.vector("Position", obj.position, speed=0.01, unit=" m", tip="World space, metres")
    obj = refusals.changed(obj, position=position)
    rotation = widgets.vector(
        "Rotation", obj.rotation, speed=0.5, unit="°", decimals=2, tip="Degrees about x, then y, then z"
    )
    obj = refusals.changed(obj, rotation=rotation)
    scale = widgets.vector("Scale", obj.scale, speed=0.01, tip="Factor along the object's own axes")
    scale = proportional(obj.scale, scale) if is_uniform else scale
    obj = refusals.changed(obj, scale=scale)
    is_uniform = widgets.checkbox(
        "Uniform scale", is_uniform, "One field or handle of the scale changes all three"
    )
    return _reset_buttons(obj), is_uniform


def proportional(old: Vector, new: Vector) -> Vector:
    """`new`, in which one component differs from `old`, with the others scaled alike."""
    for before, after in zip(old, new, strict=True):
        if before != after and before != 0.0:
            x, y, z = (component * after / before for component in old)
            return x, y, z
    return new


def _reset_buttons(obj: T) -> T:
    with widgets.row("Reset"):
        for i, name in enumerate(("position", "rotation", "scale")):
            if i > 0:
                widgets.same_line()
            default = getattr(Transform, name)
            if widgets.button(name.capitalize(), enabled=getattr(obj, name) != default):
                obj = replace(obj, **{name: default})
    return obj
