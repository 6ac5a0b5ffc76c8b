"""The camera, and the film that it shows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, in_place
from incpt.core.settings import MAX_IMAGE_PIXELS
from incpt.formats import import_report
from incpt.formats.camera_placement import viewing_distance
from incpt.formats.pbrt.document import Document, Placed
from incpt.formats.pbrt.parameters import Statement
from incpt.scene.camera import Camera

Array = npt.NDArray[np.float64]
_METRES_PER_MM = 1e-3


def film_size(document: Document) -> tuple[tuple[int, int], tuple[float, float, float, float]]:
    """The size of a whole film, and the part of it that is rendered: from x to x and from y to y, as shares
    of it from its top left. Raises InputError."""
    film = document.options.get("Film", Statement("Film", "rgb", "line 1"))
    with in_place(film.place):
        width, height = (
            film.whole(name, default, 1, MAX_IMAGE_PIXELS)
            for name, default in (("xresolution", 1280), ("yresolution", 720))
        )
        window = film.numbers("cropwindow", 4, ("float",))
        bounds = film.numbers("pixelbounds", 4, ("integer",))
        if bounds is not None:
            window = bounds / [width, width, height, height]
        ratio = film.number("exposuretime", 1.0, 0.0) * film.number("iso", 100.0, 0.0) / 100
        if film.text("sensor", "cie1931") != "cie1931" or ratio != 1:
            film.ignore("whitebalance")
            import_report.left_out(f"sensor of {film}: radiance is shown as it is; use an exposure")
        film.ignore("filename", "diagonal", "savefp16", "maxcomponentvalue")
        left, right, top, bottom = (0.0, 1.0, 0.0, 1.0) if window is None else np.clip(window, 0, 1).tolist()
        if not (left < right and top < bottom):
            raise InputError("cropwindow: nothing is left of the picture; write x from, x to, y from, y to")
        return (width, height), (left, right, top, bottom)


def camera_of(document: Document, world: Array, bounds: Array) -> tuple[Camera, tuple[int, int]]:
    """The camera under a matrix (4, 4) of the whole world, and the size of its picture. `bounds` (2, 3) of
    the scene tell how far away the point is that it looks at. Raises InputError."""
    size, (left, right, top, bottom) = film_size(document)
    placed = document.camera
    assert placed is not None
    statement = placed.statement
    with in_place(statement.place):
        kind = statement.kind
        if kind not in ("perspective", "orthographic"):
            statement.ignore(*statement.parameters)
            import_report.changed(f"{statement}: is a perspective one here")
            kind = "perspective"
        statement.ignore("shutteropen", "shutterclose")
        axes = world @ np.linalg.inv(placed.state.matrix)
        position, up, forward = (axes[:3, column] for column in (3, 1, 2))
        low_x, high_x, low_y, high_y = _screen(statement, size)
        # The part of the screen that is shown; y goes up on it, and down on the film.
        x = [low_x + one * (high_x - low_x) for one in (left, right)]
        y = [high_y - one * (high_y - low_y) for one in (bottom, top)]
        picture = max(round((right - left) * size[0]), 1), max(round((bottom - top) * size[1]), 1)
        width, height = x[1] - x[0], y[1] - y[0]
        larger = max(width, height)
        values: dict[str, Any] = {
            "projection": kind, "shift_x": sum(x) / 2 / larger, "shift_y": sum(y) / 2 / larger,
        }  # fmt: skip
        if kind == "perspective":
            tangent = math.tan(math.radians(statement.number("fov", 90.0, 1e-3, 179.0)) / 2)
            values["fov_y"] = math.degrees(2 * math.atan(tangent * height / 2))
        else:
            values["ortho_height"] = height * float(np.linalg.norm(up))
        distance = viewing_distance(position, forward / np.linalg.norm(forward), bounds)
        where = tuple(position.tolist())
        target = tuple((position + distance * forward / np.linalg.norm(forward)).tolist())
        camera = Camera(where, target, tuple(up.tolist()), **values)
        return _with_lens(placed, camera, picture[0] / picture[1]), picture


def _screen(statement: Statement, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """The window that the film shows, in the plane where the field of view reaches from -1 to 1."""
    aspect = statement.number("frameaspectratio", size[0] / size[1], 1e-3, 1e3)
    window = statement.numbers("screenwindow", 4, ("float",))
    if window is not None:
        low_x, high_x, low_y, high_y = window.tolist()
        if not (low_x < high_x and low_y < high_y):
            raise InputError("screenwindow: has no area; write x from, x to, y from, y to")
        return low_x, high_x, low_y, high_y
    return (-aspect, aspect, -1.0, 1.0) if aspect > 1 else (-1.0, 1.0, -1 / aspect, 1 / aspect)


def _with_lens(placed: Placed, camera: Camera, aspect: float) -> Camera:
    radius = placed.statement.number("lensradius", 0.0, 0.0)
    focus = placed.statement.number("focaldistance", 1e6, 1e-6)
    if radius == 0 or camera.is_orthographic:
        return camera
    # A scaled camera scales its lens.
    scale = 1 / float(np.linalg.norm(placed.state.matrix[:3, 2]))
    f_stop = camera.focal_length_at(aspect) * _METRES_PER_MM / (2 * radius * scale)
    return replace(camera, f_stop=f_stop, focus_distance=focus * scale)
