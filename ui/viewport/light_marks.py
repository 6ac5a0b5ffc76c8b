"""Lights in the picture: lines of their shapes and an icon where each stands, which the mouse can pick."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui

from incpt.scene.camera import Camera
from incpt.scene.light import Light
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.display.outline import ACTIVE, SELECTED
from incpt.ui.rect import Point, Rect
from incpt.ui.widgets import places

REACH = 9.0
"""How near to an icon the mouse has to be to pick it, in points; also the icon's own reach."""
_PLAIN = (0.98, 0.9, 0.62)
"""Colour of the lines of lights that are not selected: sRGB, 0 to 1."""
_WIDEST_SHOWN = 170.0
"""The widest cone that is drawn, degrees."""
_SEGMENTS = 32
_RAYS = 8

Array = npt.NDArray[np.float64]


def draw(scene: Scene, selection: Selection, picture: Rect[float]) -> None:
    """Draw the marks of all lights that are there over the picture, which lies at `picture` in points."""
    canvas = imgui.get_background_draw_list()
    canvas.push_clip_rect((picture.left, picture.top), (picture.right, picture.bottom), True)
    for light in scene.lights:
        if not light.visible:
            continue
        is_selected = light.name in selection
        color = ACTIVE if light.name == selection.active else SELECTED if is_selected else _PLAIN
        for line in shape_lines(light) if is_selected else ():
            _stroke(canvas, on_screen(scene.camera, line, picture), color)
        at = place(scene.camera, light, picture)
        if at is not None:
            _draw_icon(canvas, at, color)
            places.note_rect(f"light {light.name}", Rect(at[0], at[1], 0.0, 0.0))
    canvas.pop_clip_rect()


def light_at(scene: Scene, point: Point, picture: Rect[float]) -> str | None:
    """The name of the light whose icon is at a point of the screen, the nearest of several, or None."""
    found, nearest = None, REACH
    for light in scene.lights:
        at = place(scene.camera, light, picture) if light.visible else None
        if at is not None:
            away = max(abs(at[0] - point[0]), abs(at[1] - point[1]))
            if away <= nearest:
                found, nearest = light.name, away
    return found


def lights_in(scene: Scene, box: Rect[float], picture: Rect[float]) -> tuple[str, ...]:
    """The names of the lights whose icons are in a box of the screen, in points."""
    found = []
    for light in scene.lights:
        at = place(scene.camera, light, picture) if light.visible else None
        if at is not None and box.left <= at[0] <= box.right and box.top <= at[1] <= box.bottom:
            found.append(light.name)
    return tuple(found)


def place(camera: Camera, light: Light, picture: Rect[float]) -> Point | None:
    """Where a light's icon is on the screen, in points; None behind the camera."""
    points = on_screen(camera, np.array([light.position]), picture)
    return None if points is None else (float(points[0, 0]), float(points[0, 1]))


def on_screen(camera: Camera, line: Array, picture: Rect[float]) -> Array | None:
    """(N, 2) points of the screen for (N, 3) of the world; None where not all are before the camera."""
    places_in_picture, in_front = camera.project(line, picture.width / picture.height)
    if not in_front.all():
        return None
    return np.asarray((picture.left, picture.top) + places_in_picture * picture.size)


def shape_lines(light: Light) -> list[Array]:
    """Lines (N, 3) in world space that show the shape of a light and where it shines to."""
    x, y, z = light.axes
    center, (a, b), length = np.array(light.position), light.half_size, shown_length(light)
    turn = np.linspace(0, 2 * np.pi, _SEGMENTS + 1)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)

    def around(u: Array, v: Array, middle: Array) -> Array:
        return middle + circle[:, :1] * u + circle[:, 1:] * v

    if light.kind == "rectangle":
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
        return [center + corners[:, :1] * a * x + corners[:, 1:] * b * y, _way(center, z, length)]
    if light.kind == "disk":
        return [around(a * x, b * y, center), _way(center, z, length)]
    if light.kind == "sun":
        return [_way(center, z, length)]
    ball = [around(a * u, a * v, center) for u, v in ((x, y), (y, z), (z, x))] if a > 0 else []
    if light.kind == "spot":
        wide = length * math.tan(shown_half_cone(light))
        end = center - length * z
        edges = [np.array([center, end + wide * side]) for side in (x, y, -x, -y)]
        return [*ball, around(wide * x, wide * y, end), *edges]
    return ball


def shown_length(light: Light) -> float:
    """Of the line along which a light shines, as it is drawn, metres."""
    if light.kind == "spot":
        return max(4 * light.half_size[0], 1.0)
    far = 0.1 * max(abs(component) for component in (*light.position, 1.0)) if light.is_far else 0.0
    return (4 if light.is_far else 2) * max(*light.half_size, far, 0.05)


def shown_half_cone(light: Light) -> float:
    """Half of the angle of a spot's cone, as it is drawn, radians."""
    return math.radians(min(light.spot_angle, _WIDEST_SHOWN)) / 2


def _way(center: Array, z: Array, length: float) -> Array:
    return np.array([center, center - length * z])


def _stroke(canvas: imgui.ImDrawList, points: Array | None, color: tuple[float, float, float]) -> None:
    if points is None:
        return
    line: list[imgui.ImVec2Like] = [imgui.ImVec2(*point) for point in points.tolist()]
    for thickness, tint in ((3.5, (0.06, 0.04, 0.02, 0.6)), (1.5, (*color, 1.0))):
        canvas.add_polyline(line, imgui.get_color_u32(imgui.ImVec4(*tint)), thickness, 0)


def _draw_icon(canvas: imgui.ImDrawList, at: Point, color: tuple[float, float, float]) -> None:
    for reach, thickness, tint in ((1.5, 3.0, (0.06, 0.04, 0.02, 0.6)), (0.0, 1.5, (*color, 1.0))):
        packed = imgui.get_color_u32(imgui.ImVec4(*tint))
        canvas.add_circle(at, 0.45 * REACH, packed, 16, thickness)
        for i in range(_RAYS):
            way = np.array([np.cos(2 * np.pi * i / _RAYS), np.sin(2 * np.pi * i / _RAYS)])
            start, end = np.add(at, 0.7 * REACH * way), np.add(at, (REACH + 0.5 * reach) * way)
            canvas.add_line(tuple(start.tolist()), tuple(end.tolist()), packed, thickness)
