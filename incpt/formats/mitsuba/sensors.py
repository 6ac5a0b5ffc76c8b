"""Sensors as cameras, with the part of the film that they show."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.checks import one_of
from incpt.core.errors import InputError, in_place
from incpt.core.settings import MAX_IMAGE_PIXELS
from incpt.formats import import_report
from incpt.formats.mitsuba.node import Node
from incpt.formats.mitsuba.transforms import number
from incpt.scene.camera import Camera

Array = npt.NDArray[np.float64]
_METRES_PER_MM = 1e-3
_PROJECTIONS = {"perspective": "perspective", "thinlens": "perspective", "orthographic": "orthographic"}
_FOV_AXES = ("x", "y", "diagonal", "smaller", "larger")
_FULL_FRAME_MM = math.hypot(36, 24)
"""The diagonal of the film to which a focal length refers."""


@dataclass(frozen=True)
class Film:
    """The size of a film, and the place and size of the part that is rendered, pixels."""

    width: int
    height: int
    left: int
    top: int
    crop_width: int
    crop_height: int

    @property
    def size(self) -> tuple[int, int]:
        """Of the picture."""
        return self.crop_width, self.crop_height


def film_of(sensor: Node) -> Film:
    """The film of a sensor. Raises InputError."""
    node = next(sensor.objects_of("film"), None)
    if node is None:
        return Film(768, 576, 0, 0, 768, 576)
    with in_place(node.place):
        limit = MAX_IMAGE_PIXELS
        width, height = node.whole("width", 768, 1, limit), node.whole("height", 576, 1, limit)
        left, top = node.whole("crop_offset_x", 0, 0, limit), node.whole("crop_offset_y", 0, 0, limit)
        crop_width = node.whole("crop_width", width, 1, limit)
        crop_height = node.whole("crop_height", height, 1, limit)
        if left + crop_width > width or top + crop_height > height:
            raise InputError("crop_width: the part to render leads out of the film; make it smaller")
        for rfilter in node.objects_of("rfilter"):
            rfilter.ignore(*rfilter.values)
            if rfilter.kind != "box":
                import_report.changed(f"{rfilter}: pixels are the mean of their own samples, as with a box")
        # How it is stored is said by the name of the picture here.
        node.ignore(*node.values)
        return Film(width, height, left, top, crop_width, crop_height)


def camera_of(sensor: Node, film: Film, bounds: Array) -> Camera | None:
    """The camera of a sensor in world space; None, which is told, where it is of another kind. `bounds`
    (2, 3) of the scene tell how far away the point is that it looks at. Raises InputError."""
    for sampler in sensor.objects_of("sampler"):
        count = sampler.number("sample_count", 4)
        sampler.ignore(*sampler.values)
        import_report.changed(f"{sampler}: {count:g} samples a pixel are asked for by --spp {count:g}")
    sensor.ignore("shutter_open", "shutter_close")
    if sensor.kind not in _PROJECTIONS:
        sensor.ignore(*sensor.values)
        import_report.left_out(f"{sensor}: only perspective, thinlens and orthographic ones are read")
        return None
    matrix = sensor.matrix("to_world")
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not lengths.min() > 0:
        raise InputError("to_world: flattens space")
    left, up, forward = (matrix[:3, :3] / lengths).T
    if np.dot(np.cross(left, up), forward) < 0:
        import_report.changed(f"{sensor}: to_world mirrors the picture, which it is not here")
    position = matrix[:3, 3]
    aspect, crop_aspect = film.width / film.height, film.crop_width / film.crop_height
    values: dict[str, Any] = {"projection": _PROJECTIONS[sensor.kind], **_shift(sensor, film)}
    if sensor.kind == "orthographic":
        # The film shows from -1 to 1 along x.
        values["ortho_height"] = 2 * float(lengths[1]) / aspect * film.crop_height / film.height
        if abs(lengths[0] - lengths[1]) > 1e-4 * lengths[1]:
            import_report.changed(f"{sensor}: its pixels are square here")
    else:
        tangent = math.tan(math.radians(_fov_y(sensor, aspect)) / 2) * film.crop_height / film.height
        values["fov_y"] = math.degrees(2 * math.atan(tangent))
    values |= _planes(sensor, position, forward, bounds)
    distance = _distance(position, forward, bounds)
    where, target = tuple(position.tolist()), tuple((position + distance * forward).tolist())
    camera = Camera(where, target, tuple(up.tolist()), **values)
    return _with_lens(sensor, camera, crop_aspect)


def _fov_y(sensor: Node, aspect: float) -> float:
    """The full vertical angle, degrees."""
    if sensor.has("fov") and sensor.has("focal_length"):
        raise InputError("focal_length: stands beside fov; leave one of them out")
    if sensor.has("fov"):
        angle, axis = sensor.number("fov", 0.0, 1e-3, 179.999), sensor.text("fov_axis", "x").lower()
        one_of("fov_axis", axis, _FOV_AXES)
    else:
        with in_place("focal_length"):
            length = number(sensor.text("focal_length", "50mm").strip().removesuffix("mm"))
            if not length > 0:
                raise InputError(f"{length:g} is out of range; use more than 0")
        sensor.ignore("fov_axis")
        angle, axis = math.degrees(2 * math.atan(_FULL_FRAME_MM / (2 * length))), "diagonal"
    if axis in ("smaller", "larger"):
        axis = "y" if (aspect > 1) == (axis == "smaller") else "x"
    tangent = math.tan(math.radians(angle) / 2)
    if axis == "x":
        tangent /= aspect
    elif axis == "diagonal":
        tangent /= math.hypot(aspect, 1)
    return math.degrees(2 * math.atan(tangent))


def _shift(sensor: Node, film: Film) -> dict[str, float]:
    """How far the picture is moved in its plane: its part of the film, and the principal point."""
    across = sensor.number("principal_point_offset_x", 0.0)
    down = sensor.number("principal_point_offset_y", 0.0)
    # In halves of the part's width and height.
    x = (2 * film.left + film.crop_width - film.width + 2 * across * film.width) / film.crop_width
    y = (2 * film.top + film.crop_height - film.height + 2 * down * film.height) / film.crop_height
    larger = max(film.crop_width, film.crop_height)
    return {"shift_x": x * film.crop_width / (2 * larger), "shift_y": -y * film.crop_height / (2 * larger)}


def _planes(sensor: Node, position: Array, forward: Array, bounds: Array) -> dict[str, float]:
    """The near plane, where something might be before it; a far one is told."""
    near, far = sensor.number("near_clip", 1e-2, 0.0), sensor.number("far_clip", 1e4, 0.0, 1e300)
    depths = (affine.box_corners(bounds) - position) @ forward
    if depths.max() > far:
        import_report.left_out(f"far_clip of {sensor}: what is behind it is seen")
    return {"near": near} if depths.min() < near < depths.max() else {}


def _distance(position: Array, forward: Array, bounds: Array) -> float:
    """To the middle of what there is to see, so that a view turns about it."""
    size = float(np.linalg.norm(bounds[1] - bounds[0]))
    distance = float((bounds.mean(axis=0) - position) @ forward)
    return distance if distance > 1e-3 * size else max(size / 2, 1e-3)


def _with_lens(sensor: Node, camera: Camera, aspect: float) -> Camera:
    if sensor.kind != "thinlens":
        sensor.ignore("focus_distance")
        return camera
    radius = sensor.number("aperture_radius", 0.0, 0.0)
    focus = sensor.number("focus_distance", 1e4, 1e-6)
    if radius == 0:
        return camera
    f_stop = camera.focal_length_at(aspect) * _METRES_PER_MM / (2 * radius)
    return replace(camera, f_stop=f_stop, focus_distance=focus)
