"""Handles of a light in the picture: the mouse drags its size, its cone, and where it shines to."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui

from incpt.scene import edits, placing
from incpt.scene.camera import Camera
from incpt.scene.light import DIRECTED, Light
from incpt.scene.model import Scene
from incpt.ui.display.outline import ACTIVE
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import captions, drag_geometry, light_marks
from incpt.ui.widgets import places

Array = npt.NDArray[np.float64]

REACH = 7.0
"""How near to a handle the mouse has to be to take it, in points."""
_RADIUS = 4.5
"""Of the dot that is drawn for one, in points."""
_LEAST_METRES = 1e-3
"""The least size that a drag gives."""
_WIDEST_CONE = 179.0
"""The widest cone that a drag gives, degrees."""


@dataclass(frozen=True)
class Handle:
    """A point of a light that the mouse can drag.

    name    what it changes; one light has each name once.
    place   (3,) where it is, world space.
    axis    (3,) along which it is dragged, one long; None: in the plane that faces the camera.
    moved   the light after it was dragged by so many metres along the axis, or by a vector (3,) without one.
    told    what is said of the light while it is dragged.
    """

    name: str
    place: Array
    axis: Array | None
    moved: Callable[[float | Array], Light]
    told: Callable[[Light], str]


@dataclass(frozen=True)
class _Drag:
    handle: Handle
    scene: Scene
    at: Point
    left: Scene
    """The scene as the last frame left it."""


class LightHandles:
    """Handles of the active light. `is_over` tells whether the mouse is on one, `drags` how many drags of
    them there were."""

    def __init__(self) -> None:
        self._drag: _Drag | None = None
        self._is_given_up = False
        self.is_over = False
        self.drags = 0

    @property
    def is_held(self) -> bool:
        """Whether one is being dragged, or was given up and is held still."""
        return self._drag is not None or self._is_given_up

    def update(self, scene: Scene, active: str | None, picture: Rect[float], is_free: bool) -> Scene:
        """Draw the handles over the picture, which lies at `picture` in points, and return the scene after
        this frame. `is_free` tells that the mouse belongs to nobody else. A scene that is not the one that it
        left ends a drag, because somebody else made that."""
        is_down = imgui.is_mouse_down(imgui.MouseButton_.left)
        self._is_given_up = self._is_given_up and is_down
        if self._drag is not None and (not is_down or scene is not self._drag.left):
            self._is_given_up, self._drag = is_down, None
        self.is_over = False
        if active is None or active not in scene.light_index or self._is_given_up:
            return scene
        mouse = imgui.get_mouse_pos()
        at = mouse.x, mouse.y
        if self._drag is not None:
            return self._dragged(self._drag, at, picture)
        light = scene.light(active)
        found = handles(light, scene.camera) if light.visible else []
        self._take(_seen(found, scene.camera, picture), scene, at, is_free)
        return scene

    def _take(self, shown: list[tuple[Handle, Point]], scene: Scene, at: Point, is_free: bool) -> None:
        """Draw handles, and take the one at the mouse where that is pressed."""
        nearest = min(shown, key=lambda one: math.dist(one[1], at), default=None)
        if nearest is not None and is_free and math.dist(nearest[1], at) <= REACH:
            self.is_over = True
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
            if imgui.is_mouse_clicked(imgui.MouseButton_.left):
                self._drag = _Drag(nearest[0], scene, at, scene)
                self.drags += 1
        for handle, place in shown:
            is_marked = self.is_over and nearest is not None and handle is nearest[0]
            _draw(handle, place, is_marked)

    def give_up(self) -> None:
        """Do nothing more until the button is let go."""
        self._is_given_up, self._drag = self._drag is not None, None

    def _dragged(self, drag: _Drag, at: Point, picture: Rect[float]) -> Scene:
        handle, camera = drag.handle, drag.scene.camera
        by = at[0] - drag.at[0], at[1] - drag.at[1]
        scene = drag.scene
        if by != (0.0, 0.0):
            if handle.axis is None:
                way: float | Array = drag_geometry.in_view_plane(camera, picture, handle.place, by)
            else:
                way = drag_geometry.along_axis(camera, picture, handle.place, handle.axis, by)
            light = handle.moved(way)
            scene = edits.with_all(drag.scene, {light.name: light})
            _tell(handle, light, camera, picture, at)
        self._drag = replace(drag, left=scene)
        return scene


def handles(light: Light, camera: Camera) -> list[Handle]:
    """The handles that a light of its kind has."""
    found = [_aim(light)] if light.kind in DIRECTED else []
    if light.kind == "rectangle":
        return [*found, *_sides(light)]
    if light.kind == "disk":
        return [*found, *(_rim(light, f"radius {i}", way, light.half_size[i % 2])
                          for i, way in enumerate((*light.axes[:2], *-light.axes[:2])))]  # fmt: skip
    if light.half_size[0] > 0:
        right = camera.image_plane(1.0)[0]
        found.append(_rim(light, "radius", right / np.linalg.norm(right), light.half_size[0]))
    return [*found, *_cone(light)] if light.kind == "spot" else found


def _aim(light: Light) -> Handle:
    end = np.asarray(light.position) - light_marks.shown_length(light) * light.axes[2]

    def moved(way: float | Array) -> Light:
        aimed = placing.aimed(light, end + way)
        assert isinstance(aimed, Light)
        return aimed

    return Handle("aim", end, None, moved, lambda _: "Direction")


def _sides(light: Light) -> list[Handle]:
    (a, b), (width, height) = light.half_size, light.size
    x, y = light.axes[:2]

    def wider(way: float | Array) -> Light:
        return replace(light, size=(width * _grown(a, way), height))

    def higher(way: float | Array) -> Light:
        return replace(light, size=(width, height * _grown(b, way)))

    center = np.asarray(light.position)
    found = []
    for name, axis, half, moved, told in (
        ("width", x, a, wider, lambda one: f"Width {2 * one.half_size[0]:.3f} m"),
        ("height", y, b, higher, lambda one: f"Height {2 * one.half_size[1]:.3f} m"),
    ):
        for sign, end in ((1, ""), (-1, " 2")):
            found.append(Handle(name + end, center + sign * half * axis, sign * axis, moved, told))
    return found


def _rim(light: Light, name: str, way: Array, half: float) -> Handle:
    return Handle(
        name,
        np.asarray(light.position) + half * way,
        way,
        lambda by: replace(light, radius=light.radius * _grown(half, by)),
        lambda one: f"Radius {one.radius:.3f} m",
    )


def _cone(light: Light) -> list[Handle]:
    """Of a spot: the edge of its cone, and where its light begins to fall off."""
    length, half = light_marks.shown_length(light), light_marks.shown_half_cone(light)
    end = np.asarray(light.position) - length * light.axes[2]
    outer = length * math.tan(half)
    inner = length * math.tan(half * (1 - light.spot_blend))

    def wider(way: float | Array) -> Light:
        angle = 2 * math.degrees(math.atan2(max(outer + float(way), 0.0), length))
        return replace(light, spot_angle=min(max(angle, 0.1), _WIDEST_CONE))

    def softer(way: float | Array) -> Light:
        share = math.atan2(max(inner + float(way), 0.0), length) / half
        return replace(light, spot_blend=min(max(1 - share, 0.0), 1.0))

    x, y = light.axes[:2]
    return [
        Handle("cone", end + outer * x, x, wider, lambda one: f"Cone {one.spot_angle:.1f}°"),
        Handle("blend", end + inner * y, y, softer, lambda one: f"Blend {one.spot_blend:.2f}"),
    ]


def _grown(half: float, way: float | Array) -> float:
    """The factor by which a half size grows."""
    return max(half + float(way), _LEAST_METRES / 2) / half


def _seen(found: list[Handle], camera: Camera, picture: Rect[float]) -> list[tuple[Handle, Point]]:
    """Those before the camera, and where they are on the screen."""
    shown = []
    for one in found:
        at = light_marks.on_screen(camera, one.place[None], picture)
        if at is not None:
            shown.append((one, (float(at[0, 0]), float(at[0, 1]))))
    return shown


def _draw(handle: Handle, at: Point, is_marked: bool) -> None:
    canvas, radius = imgui.get_background_draw_list(), _RADIUS * (1.35 if is_marked else 1.0)
    canvas.add_circle_filled(at, radius + 1.5, imgui.get_color_u32(imgui.ImVec4(0.06, 0.04, 0.02, 0.8)))
    tint = imgui.ImVec4(1.0, 1.0, 1.0, 1.0) if is_marked else imgui.ImVec4(*ACTIVE, 1.0)
    canvas.add_circle_filled(at, radius, imgui.get_color_u32(tint))
    places.note_rect(f"light handle {handle.name}", Rect(*at, 0.0, 0.0))


def _tell(handle: Handle, light: Light, camera: Camera, picture: Rect[float], at: Point) -> None:
    """Draw the handle where it is now, and say what it is at."""
    now = next((one for one in handles(light, camera) if one.name == handle.name), None)
    for one, place in _seen([now] if now is not None else [], camera, picture):
        _draw(one, place, True)
    offset = imgui.get_text_line_height()
    captions.write_label(
        imgui.get_background_draw_list(), (at[0] + offset, at[1] + offset), handle.told(light)
    )
