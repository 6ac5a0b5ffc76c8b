"""Placements as Mitsuba writes them: a list of steps, each applied after those before it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.mitsuba.xml_file import Element

Array = npt.NDArray[np.float64]
_UNIT = 1e-3
"""How far from 1 the length of an axis may be. Mitsuba 3 takes it as it is, where another one distorts."""


def words(text: str) -> list[str]:
    """A list of values, which commas and blanks part."""
    return text.replace(",", " ").split()


def number(text: str) -> float:
    """Raises InputError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in text:
        raise InputError(f"{text[:40]!r} is not a finite number")
    return value


def numbers(text: str, *counts: int) -> list[float]:
    """So many numbers. Raises InputError."""
    found = [number(word) for word in words(text)]
    if len(found) not in counts:
        wanted = " or ".join(map(str, counts))
        raise InputError(f"{text[:40]!r} holds {len(found)} numbers; write {wanted}")
    return found


def vector(attributes: Mapping[str, str], default: float) -> Array:
    """(3,) of `value`, or of `x`, `y` and `z`. Raises InputError."""
    if "value" in attributes:
        found = numbers(attributes["value"], 1, 3)
        return np.array(found * 3 if len(found) == 1 else found)
    return np.array([number(attributes[axis]) if axis in attributes else default for axis in "xyz"])


def step_matrix(step: Element, attributes: Mapping[str, str]) -> Array:
    """(4, 4) one step of a transform. Raises InputError."""
    tag = "lookat" if step.tag == "lookAt" else step.tag
    if tag not in _STEPS:
        raise InputError(f"<{step.tag}> is no step of a transform; use one of {', '.join(_STEPS)}")
    return _STEPS[tag](attributes)


def _translate(attributes: Mapping[str, str]) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = vector(attributes, 0.0)
    return matrix


def _scale(attributes: Mapping[str, str]) -> Array:
    return np.diag([*vector(attributes, 1.0), 1.0])


def _rotate(attributes: Mapping[str, str]) -> Array:
    axis = vector({key: text for key, text in attributes.items() if key != "angle"}, 0.0)
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise InputError("the axis of <rotate> has no length; give it one of x, y and z")
    if abs(length - 1) > _UNIT:
        import_report.changed(f"a <rotate> about an axis of length {length:.4g}: turns, and does not stretch")
    angle = math.radians(number(attributes.get("angle", "")))
    x, y, z = axis / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    # Rodrigues' formula.
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return matrix


def _matrix(attributes: Mapping[str, str]) -> Array:
    found = numbers(attributes.get("value", ""), 9, 16)
    side = 4 if len(found) == 16 else 3
    matrix = np.eye(4)
    matrix[:side, :side] = np.reshape(found, (side, side))
    return matrix


def _look_at(attributes: Mapping[str, str]) -> Array:
    origin, target = (np.array(numbers(attributes.get(key, ""), 3)) for key in ("origin", "target"))
    up = np.array(numbers(attributes.get("up", "0 0 0"), 3))
    view = target - origin
    length = float(np.linalg.norm(view))
    if length == 0:
        raise InputError("origin and target of <lookat> are the same point; move one of them")
    view /= length
    left = np.cross(up, view)
    if not np.linalg.norm(left) > 1e-9 * max(float(np.linalg.norm(up)), 1e-300):
        # Without a direction that is up, or along it, any other does.
        left = np.cross([0.0, 0.0, 1.0] if abs(view[2]) < 0.9 else [1.0, 0.0, 0.0], view)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([left, np.cross(view, left), view, origin])
    return matrix


_STEPS = {
    "translate": _translate,
    "rotate": _rotate,
    "scale": _scale,
    "matrix": _matrix,
    "lookat": _look_at,
}
