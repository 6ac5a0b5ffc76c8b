"""A transform under way: the mouse and keys move, turn or scale what is selected until they are told to stop.

It is a value without a window: `begun` makes one, `after` takes a frame's input and returns the next one,
and `scene`, `header` and `lines` say what comes of it. Everything follows from the scene as it was at the
start, so that rounding does not add up, and giving up is that scene itself. Keys and signs are Blender's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.scene import edits, placing
from incpt.scene.model import Placed, Scene
from incpt.ui.preferences import SnapSettings
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import axis_constraint, drag_geometry, pivot, snapping, typed_number
from incpt.ui.viewport.axis_constraint import AXES, AxisConstraint
from incpt.ui.viewport.typed_number import TypedNumber

Array = npt.NDArray[np.float64]

OPERATIONS: Mapping[str, str] = MappingProxyType({"g": "move", "r": "rotate", "s": "scale"})
"""Operations, by the keys that change to them; while it rotates, R changes to the trackball."""
_DEGREES_PER_POINT = math.degrees(0.01)
"""How far a trackball turns for the mouse's way, as in Blender."""
FINE = 0.1
"""What a move of the mouse counts for while Shift is held, and a step of snapping too."""
_NEAREST_POINTS = 8.0
"""How far from the pivot the mouse counts as at the least when a scaling begins, so that a start at the pivot
does not collapse what is selected."""


@dataclass(frozen=True)
class Input:
    """What the hand did in a frame.

    mouse        where it is, points.
    keys         letters of axes and operations, "shift+x" for planes, "backspace" and "tab", as they came.
    text         characters of numbers that were typed.
    is_fine      whether Shift is held, `is_snapping` whether the mouse goes in steps.
    """

    mouse: Point
    keys: tuple[str, ...] = ()
    text: str = ""
    is_fine: bool = False
    is_snapping: bool = False


@dataclass(frozen=True)
class Start:
    """What everything is counted from: the scene, the names of what is transformed, the active one last, the
    steps of snapping, the picture's place on the screen, points, and about what it is turned, see
    `Tool.pivot`."""

    scene: Scene
    names: tuple[str, ...]
    snap: SnapSettings
    picture: Rect[float]
    about: str = "median"

    @cached_property
    def pivot(self) -> Array:
        """(3,) the point that all share, world space."""
        return pivot.shared_point(self.scene, self.names, self.about)

    def pivot_of(self, name: str) -> Array:
        """(3,) the point about which one of them is turned and scaled, world space."""
        return np.asarray(self.scene.placed(name).position) if self.is_each else self.pivot

    @property
    def is_each(self) -> bool:
        """Whether each is turned and scaled about its own position."""
        return self.about == "individual"

    @cached_property
    def held(self) -> Array:
        """(3,) the point that the mouse holds, world space."""
        return drag_geometry.held_point(self.scene.camera, self.pivot)

    @cached_property
    def center(self) -> Point:
        """Where that is on the screen, points."""
        return drag_geometry.place(self.scene.camera, self.picture, self.held)

    def axes_of(self, name: str, is_local: bool) -> Array:
        """(3, 3) the axes of an object or of the world, as columns."""
        return affine.rotation_matrix(self.scene.placed(name).rotation) if is_local else np.eye(3)


@dataclass(frozen=True)
class ModalTransform:
    """A transform under way.

    operation    move, rotate, trackball or scale.
    constraint   along what; None: the view decides.
    typed        numbers by component, of which `component` is typed now; none while the mouse counts.
    began        where the mouse was when the operation began; `mouse` where it is.
    way          how far it went since then, with Shift for a tenth of it: points.
    turned       the angle that it went around the pivot, clockwise, with the same tenth: degrees.
    """

    start: Start
    operation: str
    began: Point
    mouse: Point
    constraint: AxisConstraint | None = None
    typed: tuple[TypedNumber, ...] = ()
    component: int = 0
    way: Point = (0.0, 0.0)
    turned: float = 0.0
    is_fine: bool = False
    is_snapping: bool = False

    # ---------------------------------------------------------------------------------------- the hand

    def after(self, given: Input) -> ModalTransform:
        """After one frame's input: first the mouse, then keys, then characters."""
        state = self._after_mouse(given)
        for key in given.keys:
            state = state._after_key(key)
        for character in given.text:
            if character in typed_number.CHARACTERS:
                state = state._with_number(state._number.after(character))
        # The same value has its scene already, and the same scene is nothing new to the renderer.
        return self if state == self else state

    def _after_mouse(self, given: Input) -> ModalTransform:
        weight = FINE if given.is_fine else 1.0
        (x, y), (last_x, last_y) = given.mouse, self.mouse
        return replace(
            self,
            mouse=given.mouse,
            way=(self.way[0] + weight * (x - last_x), self.way[1] + weight * (y - last_y)),
            turned=self.turned + weight * _angle(self.start.center, self.mouse, given.mouse),
            is_fine=given.is_fine,
            is_snapping=given.is_snapping,
        )

    def _after_key(self, key: str) -> ModalTransform:
        if key in OPERATIONS:
            return self._after_operation(OPERATIONS[key])
        if key == "backspace":
            return self._with_number(self._number.erased())
        if key == "tab":
            return replace(self, component=(self.component + 1) % len(self.components))
        if self.operation == "trackball":
            return self._after_operation("rotate")._after_key(key)
        axis = AXES.index(key[-1].upper())
        constraint = axis_constraint.after_key(self.constraint, axis, key.startswith("shift+"))
        # Of several numbers, which belonged to other axes, the one that was typed last is kept.
        return replace(self, constraint=constraint, typed=(self._number,), component=0)

    def _after_operation(self, wanted: str) -> ModalTransform:
        """With another operation, which begins from the start where the mouse is now."""
        if wanted == "rotate" == self.operation:
            return ModalTransform(self.start, "trackball", self.mouse, self.mouse)
        if wanted == self.operation:
            return self
        return ModalTransform(self.start, wanted, self.mouse, self.mouse, self.constraint)

    @property
    def _number(self) -> TypedNumber:
        return self.typed[self.component] if self.component < len(self.typed) else TypedNumber()

    def _with_number(self, number: TypedNumber) -> ModalTransform:
        numbers = [*self.typed, *[TypedNumber()] * (self.component + 1 - len(self.typed))]
        numbers[self.component] = number
        return replace(self, typed=tuple(numbers))

    # --------------------------------------------------------------------------------------- the amount

    @property
    def is_typed(self) -> bool:
        """Whether numbers count and the mouse does not."""
        return any(number.is_there for number in self.typed)

    @property
    def components(self) -> tuple[int, ...]:
        """The axes of which numbers are typed one after the other; of a turn and a scaling there is one
        number for all, of a trackball one about the camera's right and one about its up."""
        if self.operation == "trackball":
            return (0, 1)
        if self.operation != "move":
            return (0,)
        return self.constraint.free if self.constraint is not None else (0, 1, 2)

    @property
    def _is_local(self) -> bool:
        return self.constraint is not None and self.constraint.is_local

    @cached_property
    def offset(self) -> Array:
        """(3,) of a move, metres along the axes of the constraint, by default of the world."""
        offset = np.zeros(3)
        if self.is_typed:
            for number, axis in zip(self.typed, self.components, strict=False):
                offset[axis] = number.value
            return offset
        scene, picture, held = self.start.scene, self.start.picture, self.start.held
        axes = self.start.axes_of(self.start.names[-1], self._is_local)
        if self._snaps_to_something:
            snapped = self._snapped(axes)
            if snapped is not None:
                return snapped
        if self.constraint is None:
            offset = drag_geometry.in_view_plane(scene.camera, picture, held, self.way)
        elif self.constraint.is_plane:
            normal = axes[:, self.constraint.axis]
            offset = axes.T @ drag_geometry.in_plane(scene.camera, picture, held, normal, self.way)
            offset[self.constraint.axis] = 0.0
        else:
            axis = self.constraint.axis
            offset[axis] = drag_geometry.along_axis(scene.camera, picture, held, axes[:, axis], self.way)
        if self._snaps_to_something:
            return offset
        return np.array([self._in_steps(metres, self.start.snap.move_m) for metres in offset])

    @property
    def _snaps_to_something(self) -> bool:
        return self.is_snapping and self.start.snap.target != "steps"

    def _snapped(self, axes: Array) -> Array | None:
        """(3,) the offset that brings it to what the mouse points at, as far as the constraint lets it; None
        where it points at nothing."""
        start, kind = self.start, self.start.snap.target
        target = snapping.target(start.scene, start.names, start.picture, self.mouse, kind)
        if target is None:
            return None
        base = snapping.base(start.scene, start.names, start.picture, self.began, kind, start.pivot)
        offset: Array = axes.T @ (target - base)
        free = (0, 1, 2) if self.constraint is None else self.constraint.free
        offset[[axis for axis in range(3) if axis not in free]] = 0.0
        return offset

    @cached_property
    def angle(self) -> float:
        """Of a turn, degrees: clockwise as it is seen, or where it is typed about an axis, right-handed."""
        if self.is_typed:
            return self._number.value
        return self._in_steps(self.turned, self.start.snap.rotate_deg)

    @cached_property
    def ball_angles(self) -> tuple[float, float]:
        """Of a trackball, degrees: about the camera's right and about its up, so that what is in front goes
        with the mouse."""
        if self.is_typed:
            first, second = (*self.typed, TypedNumber(), TypedNumber())[:2]
            return first.value, second.value
        dx, dy = self.way
        step = self.start.snap.rotate_deg
        return self._in_steps(_DEGREES_PER_POINT * dy, step), self._in_steps(_DEGREES_PER_POINT * dx, step)

    @cached_property
    def factor(self) -> float:
        """Of a scaling: how much farther from the pivot the mouse is, negative on the other side of it."""
        if self.is_typed:
            return self._number.value
        before = np.subtract(self.began, self.start.center)
        now = before + self.way
        room = max(_NEAREST_POINTS - float(np.linalg.norm(before)), 0.0)
        factor = (float(np.linalg.norm(now)) + room) / (float(np.linalg.norm(before)) + room)
        is_beyond = room == 0 and before @ now < 0
        return self._in_steps(-factor if is_beyond else factor, self.start.snap.scale)

    def _in_steps(self, value: float, step: float) -> float:
        if not self.is_snapping:
            return value
        step *= FINE if self.is_fine else 1.0
        # The second rounding takes away what the product of a step such as 0.1 adds.
        return round(round(value / step) * step, 12)

    # --------------------------------------------------------------------------------------- the outcome

    @cached_property
    def scene(self) -> Scene:
        """The scene now: that of the start itself where everything is as it was."""
        act = {
            "move": self._moved, "rotate": self._turned, "trackball": self._rolled, "scale": self._scaled,
        }[self.operation]  # fmt: skip
        old = {name: self.start.scene.placed(name) for name in self.start.names}
        new = {name: act(name, one) for name, one in old.items()}
        changed = {name: one for name, one in new.items() if one.transform != old[name].transform}
        return edits.with_all(self.start.scene, changed) if changed else self.start.scene

    def _moved(self, name: str, one: Placed) -> Placed:
        return placing.moved(one, self.start.axes_of(name, self._is_local) @ self.offset)

    def _turned(self, name: str, one: Placed) -> Placed:
        camera, point = self.start.scene.camera, self.start.pivot_of(name)
        forward = camera.image_plane(1.0)[2]
        if self.constraint is None:
            return placing.turned(one, forward, self.angle, point)
        axis = self.start.axes_of(name, self._is_local)[:, self.constraint.axis]
        eye = forward if camera.is_orthographic else self.start.held - camera.position
        follows_mouse = self.is_typed or axis @ eye > 0
        return placing.turned(one, axis, self.angle if follows_mouse else -self.angle, point)

    def _rolled(self, name: str, one: Placed) -> Placed:
        right, up, _ = self.start.scene.camera.image_plane(1.0)
        turn = placing.turn_matrix(up / np.linalg.norm(up), self.ball_angles[1])
        turn = placing.turn_matrix(right / np.linalg.norm(right), self.ball_angles[0]) @ turn
        return placing.turned_by(one, turn, self.start.pivot_of(name))

    def _scaled(self, name: str, one: Placed) -> Placed:
        factors = np.full(3, self.factor)
        if self.constraint is not None:
            factors[[axis for axis in range(3) if axis not in self.constraint.free]] = 1.0
        axes = self.start.axes_of(name, self._is_local)
        return placing.scaled(one, axes, tuple(factors), self.start.pivot_of(name))

    @property
    def header(self) -> str:
        """What happens, in one line: "D: [1.5+2] = 3.500 m along global X"."""
        if self.operation == "move":
            amounts = "  ".join(self._component_text(i) for i in range(len(self.components)))
            if self.constraint is None:
                amounts += f"  ({np.linalg.norm(self.offset):.3f} m)"
        elif self.operation == "trackball":
            first, second = (self._amount_text(i, angle, ".2f") for i, angle in enumerate(self.ball_angles))
            amounts = f"Trackball: {first}°  {second}°"
        elif self.operation == "rotate":
            amounts = f"Rotation: {self._amount_text(0, self.angle, '.2f')}°"
        else:
            amounts = f"Scale: {self._amount_text(0, self.factor, '.3f')}"
        return amounts if self.constraint is None else f"{amounts}  {self.constraint.text}"

    def _component_text(self, place: int) -> str:
        axis = self.components[place]
        name = "D" if len(self.components) == 1 else f"D{AXES[axis].lower()}"
        return f"{name}: {self._amount_text(place, float(self.offset[axis]), '.3f')} m"

    def _amount_text(self, place: int, value: float, form: str) -> str:
        if not self.is_typed or (place != self.component and place >= len(self.typed)):
            return f"{value:{form}}"
        shown = self.typed[place].shown if place < len(self.typed) else ""
        caret = "|" if place == self.component else ""
        return f"[{shown}{caret}] = {value:{form}}"

    @property
    def lines(self) -> list[tuple[Array, Array, int]]:
        """(point, direction, axis) of the lines through what is transformed along which it is held, in world
        space."""
        if self.constraint is None:
            return []
        is_each = self.constraint.is_local or self.start.is_each
        names = self.start.names if is_each else self.start.names[-1:]
        found = []
        for name in names:
            axes = self.start.axes_of(name, self.constraint.is_local)
            point = self.start.scene.placed(name).position if is_each else self.start.pivot
            found += [(np.asarray(point), axes[:, axis], axis) for axis in self.constraint.free]
        return found


def begun(
    scene: Scene,
    names: tuple[str, ...],
    operation: str,
    mouse: Point,
    snap: SnapSettings,
    picture: Rect[float],
    about: str = "median",
) -> ModalTransform | None:
    """A transform of the named objects and lights, of those that are shown; None where none is. `about`: see
    `Tool.pivot`."""
    shown = tuple(name for name in names if scene.placed(name).visible)
    if not shown:
        return None
    return ModalTransform(Start(scene, shown, snap, picture, about), operation, mouse, mouse)


def _angle(center: Point, start: Point, end: Point) -> float:
    """Clockwise on the screen from one point to another about a third, degrees, -180 to 180."""
    (x0, y0), (x1, y1) = np.subtract(start, center), np.subtract(end, center)
    return math.degrees(math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1))
