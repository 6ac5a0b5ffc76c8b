"""An edit of one object, light or material, done to others as well."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from incpt.core.errors import InputError
from incpt.scene.light import Light, changed
from incpt.scene.material import Material
from incpt.scene.model import Placed

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

D = TypeVar("D", bound="DataclassInstance")


def transformed_alike(
    old: Placed,
    new: Placed,
    other: Placed,
    *,
    is_relative: bool = False,
    given: Collection[tuple[str, int]] = (),
) -> Placed:
    """`other` with what differs in position, rotation and scale between `old` and `new`, component by
    component: the same number, or where it `is_relative` as much more, and of a scale as many times as much.
    Components in `given`, such as ("position", 0), are set even where they do not differ. A value that it
    cannot have leaves it as it is."""
    parts: dict[str, Any] = {}
    for name in ("position", "rotation", "scale"):
        before, after, own = getattr(old, name), getattr(new, name), getattr(other, name)
        axes = [axis for axis in range(3) if before[axis] != after[axis] or (name, axis) in given]
        values = list(own)
        for axis in axes:
            b, a = before[axis], after[axis]
            if not is_relative:
                values[axis] = a
            elif name != "scale":
                values[axis] += a - b
            elif b:
                values[axis] *= a / b
        if axes:
            parts[name] = tuple(values)
    try:
        return replace(other, transform=other.transform.with_parts(**parts)) if parts else other
    except InputError:
        return other


def light_alike(old: Light, new: Light, other: Light) -> Light:
    """`other` with what differs between `old` and `new`, but for name and place; see `edited_alike`."""
    if old.kind != new.kind:
        changes: dict[str, Any] = {"kind": new.kind}
    elif old.strength[0] != new.strength[0]:
        return other  # In another unit each stays as bright as it is, which is another number for each.
    else:
        changes = _changes(old, new, other, ("name", "transform"))
    try:
        return changed(other, changes) if changes else other
    except InputError:
        return other


def material_alike(old: Material, new: Material, other: Material) -> Material:
    """`other` with the parameters that differ between `old` and `new`, of colours the components."""
    changes = _changes(old, new, other, ())
    try:
        return replace(other, **changes) if changes else other
    except InputError:
        return other


def _changes(old: D, new: D, other: D, left_out: tuple[str, ...]) -> dict[str, Any]:
    changes: dict[str, Any] = {}
    for name in (field.name for field in fields(old) if field.name not in left_out):
        before, after, own = getattr(old, name), getattr(new, name), getattr(other, name)
        if before == after:
            continue
        if isinstance(after, tuple):
            after = tuple(a if a != b else o for b, a, o in zip(before, after, own, strict=True))
        changes[name] = after
    return changes
