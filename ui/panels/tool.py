"""The gizmo's settings: what it does, along which axes, in which steps."""

from __future__ import annotations

from dataclasses import replace

from incpt.ui.editor.state import Tool
from incpt.ui.preferences import RANGES, SnapSettings
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals

OPERATIONS = (("move", "Move"), ("rotate", "Rotate"), ("scale", "Scale"))
"""What the gizmo does, and how the panel names it."""
SPACES = (("world", "World axes"), ("local", "The object's axes"))
"""Along which axes, and how the panel names them."""
SNAP_TARGETS = (("steps", "Steps"), ("surface", "Surfaces"), ("vertex", "Vertices"))
"""What a move snaps to, and how the panel names it."""
PIVOTS = (("median", "Median point"), ("active", "Active one"), ("individual", "Own origins"))
"""About which point, and how panel and menu name it."""


def draw(tool: Tool, snap: SnapSettings, refusals: Refusals) -> tuple[Tool, SnapSettings]:
    """Fields of the gizmo; returns both after this frame."""
    operation = widgets.choice("Gizmo", tool.operation, OPERATIONS, "What the handles in the picture do")
    space = widgets.choice("Axes", tool.space, SPACES)
    pivot = widgets.choice(
        "Pivot", tool.pivot, PIVOTS, "The point about which several are turned and scaled, also by keys"
    )
    snap = replace(
        snap, enabled=widgets.checkbox("Snap", snap.enabled, "In steps, or a move to what is under the mouse")
    )
    if snap.enabled:
        target = widgets.choice("Snap to", snap.target, SNAP_TARGETS, "G moves it there; turns go in steps")
        snap = replace(snap, target=target)
        move_m = _step("Step of moves", "move_m", snap.move_m, 0.01, " m")
        rotate_deg = _step("Step of turns", "rotate_deg", snap.rotate_deg, 0.5, "°")
        scale = _step("Step of scale", "scale", snap.scale, 0.01, "")
        snap = refusals.changed(snap, move_m=move_m, rotate_deg=rotate_deg, scale=scale)
    return replace(tool, operation=operation, space=space, pivot=pivot), snap


def _step(label: str, name: str, value: float, speed: float, unit: str) -> float:
    low, high = RANGES[name]
    return widgets.number(label, value, low=low, high=high, speed=speed, unit=unit)
