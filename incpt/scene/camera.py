"""The camera of a scene: where its rays start and go, and where it sees points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.arrays import numbers
from incpt.core.checks import one_of, whole
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, checked_number, set_number, set_vector

Array = npt.NDArray[np.float64]

PROJECTIONS = ("perspective", "orthographic")
SENSOR_FITS = ("auto", "horizontal", "vertical")
MOST_BLADES = 64
_NEAREST = 1e-6
"""The depth in metres from which on a point is before the camera."""
_METRES_PER_MM = 1e-3
_ORTHOGRAPHIC_LENS_MM = 1000.0
"""The focal length to which the f-stop of an orthographic camera refers, as in Cycles."""


@dataclass(frozen=True)
class Camera:
    """A camera. Names and conventions of the lens are those of Blender. Positions are in world space, metres.

    position, target  where it stands, and the point in its middle (where it is not shifted).
    up                the direction that is up in the picture, of any length.
    fov_y             full vertical angle, degrees; has no effect where there is a focal length.
    projection        "perspective", or "orthographic": all rays are parallel, and start on the plane through
                      the position that faces the target.
    ortho_height      what an orthographic picture shows from its top to its bottom, metres.
    focal_length      mm; with the sensor it tells the field of view. 0: `fov_y` does.
    sensor_fit        what the focal length refers to: "horizontal", `sensor_width` is the picture's width;
                      "vertical", `sensor_height` is its height; "auto", `sensor_width` is its larger
                      side.
    sensor_width      mm.
    sensor_height     mm.
    shift_x, shift_y  how far the picture is moved right and up in its plane, as a fraction of its larger
                      side: vertical lines stay vertical where `shift_y` looks up instead of the target.
    f_stop            focal length by the diameter of the aperture. 0: a pinhole, for which all is sharp.
                      Without a focal length, that with which the sensor has the same field of view counts;
                      of an orthographic camera 1 m does.
    focus_distance    from the camera to the plane that is sharp, along the view, metres. 0: to the target.
    blades            corners of the aperture, 3 or more, on the circle of the f-stop. 0: it is round.
    blade_rotation    of the aperture in the camera, degrees, counterclockwise as the camera looks.
    near              nothing nearer to the camera along its view is seen, metres.
    """

    position: Vector = (0.0, 1.2, 5.0)
    target: Vector = (0.0, 1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: float = 40.0
    projection: str = "perspective"
    ortho_height: float = 2.0
    focal_length: float = 0.0
    sensor_fit: str = "auto"
    sensor_width: float = 36.0
    sensor_height: float = 24.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    f_stop: float = 0.0
    focus_distance: float = 0.0
    blades: int = 0
    blade_rotation: float = 0.0
    near: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            set_vector(self, name)
        set_number(self, "fov_y", 0.01, 179.0)
        one_of("projection", self.projection, PROJECTIONS)
        one_of("sensor_fit", self.sensor_fit, SENSOR_FITS)
        for name, (low, high) in _RANGES.items():
            set_number(self, name, low, high)
        object.__setattr__(self, "blades", whole("blades", self.blades, 0, MOST_BLADES))
        if self.blades in (1, 2):
            raise InputError(f"blades: {self.blades} make no aperture; use 3 or more, or 0 for a round one")
        if math.dist(self.position, self.target) < 1e-9:
            raise InputError("target: is the same point as position; move one of them")
        if math.hypot(*self.up) < 1e-9:
            raise InputError("up: has no length; use [0, 1, 0]")

    @property
    def is_orthographic(self) -> bool:
        return self.projection == "orthographic"

    @property
    def has_lens(self) -> bool:
        """Whether rays of a pixel start at different points, so that only one distance is sharp."""
        return self.f_stop > 0

    @property
    def sharp_distance(self) -> float:
        """From the camera to the plane that is sharp, metres."""
        return self.focus_distance or math.dist(self.position, self.target)

    @property
    def start(self) -> Vector:
        """Where the ray through the middle of an unshifted picture starts, world space."""
        if self.near == 0:
            return self.position
        x, y, z = (float(v) for v in np.add(self.position, self.near * self.image_plane(1.0)[2]))
        return x, y, z

    def fov_y_at(self, aspect: float) -> float:
        """The full vertical angle of a perspective picture of that aspect (width by height), degrees."""
        aspect = _checked_aspect(aspect)
        if not self.focal_length:
            return self.fov_y
        return math.degrees(2 * math.atan(self._sensor_height_at(aspect) / (2 * self.focal_length)))

    def focal_length_at(self, aspect: float) -> float:
        """The focal length of a perspective picture of that aspect, mm; that of the field of view, where none
        is given."""
        aspect = _checked_aspect(aspect)
        if self.focal_length:
            return self.focal_length
        return self._sensor_height_at(aspect) / (2 * math.tan(math.radians(self.fov_y) / 2))

    def lens_radius(self, aspect: float) -> float:
        """Of the circle around the aperture, metres, for a picture of that aspect; 0: a pinhole."""
        aspect = _checked_aspect(aspect)
        if not self.has_lens:
            return 0.0
        length = _ORTHOGRAPHIC_LENS_MM if self.is_orthographic else self.focal_length_at(aspect)
        return length * _METRES_PER_MM / (2 * self.f_stop)

    def image_plane(self, aspect: float) -> tuple[Array, Array, Array]:
        """(right, up, forward), each (3,), world space: the image plane of a camera that is not shifted lies
        one forward from the position, and reaches one right and one up from its middle; that of an
        orthographic one reaches as far in metres. `aspect` is the picture's width by its height."""
        aspect = _checked_aspect(aspect)
        forward = _unit(np.subtract(self.target, self.position))
        right = np.cross(forward, _unit(np.asarray(self.up, np.float64)))
        if np.linalg.norm(right) < 1e-9:  # The view is along `up`, and any other axis gives a frame.
            right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
        right = _unit(right)
        if self.is_orthographic:
            half_height = self.ortho_height / 2
        else:
            half_height = math.tan(math.radians(self.fov_y_at(aspect)) / 2)
        return right * half_height * aspect, np.cross(right, forward) * half_height, forward

    def shift_at(self, aspect: float) -> tuple[float, float]:
        """How far the middle of a picture of that aspect is moved right and up, in halves of its width and
        height."""
        aspect = _checked_aspect(aspect)
        larger = max(aspect, 1.0)
        return 2 * self.shift_x * larger / aspect, 2 * self.shift_y * larger

    def rays(self, places: npt.NDArray[np.floating], aspect: float) -> tuple[Array, Array]:
        """Where the rays through places (N, 2) of a picture of that aspect, fractions of its width and height
        from its top left, pass the camera's plane, and their directions, 1 long along the view; (N, 3) each,
        world space. They go through the middle of the lens."""
        places = _checked_points("places", places, 2)
        right, up, forward = self.image_plane(aspect)
        shift_x, shift_y = self.shift_at(aspect)
        x, y = 2 * places[:, :1] - 1 + shift_x, 1 - 2 * places[:, 1:] + shift_y
        across = x * right + y * up
        position = np.asarray(self.position, np.float64)
        if self.is_orthographic:
            return position + across, np.broadcast_to(forward, across.shape)
        return np.broadcast_to(position, across.shape), forward + across

    def project(self, points: npt.NDArray[np.floating], aspect: float) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Where (N, 3) world points are in a picture of that aspect, and which lie in front of the camera.

        Places (N, 2) are fractions of the picture's width and height from its top left, as seen through the
        middle of the lens. Those of points behind the camera mean nothing.
        """
        x, y, depth = self._seen(points, aspect)
        in_front = depth > _NEAREST
        if not self.is_orthographic:
            depth = np.where(in_front, depth, 1.0)
            x, y = x / depth, y / depth
        shift_x, shift_y = self.shift_at(aspect)
        return np.column_stack([(x - shift_x + 1) / 2, (1 - y + shift_y) / 2]), in_front

    def blur(self, points: npt.NDArray[np.floating], aspect: float) -> Array:
        """(N, 2) how far from its place each of (N, 3) world points before the camera is seen through the rim
        of the aperture, as fractions of the width and the height of a picture of that aspect."""
        depth = np.maximum(self._seen(points, aspect)[2], _NEAREST)
        right, up, _ = self.image_plane(aspect)
        # Rays from all over the lens to a point pass the sharp plane in a circle (Potmesil and Chakravarty
        # 1981); this is its radius in metres on the image plane.
        off = 1 - depth / self.sharp_distance if self.is_orthographic else 1 / self.sharp_distance - 1 / depth
        radius = self.lens_radius(aspect) * np.abs(off)
        return np.column_stack([radius / (2 * np.linalg.norm(right)), radius / (2 * np.linalg.norm(up))])

    def _seen(self, points: npt.NDArray[np.floating], aspect: float) -> tuple[Array, Array, Array]:
        """Right, up and depth of points (N, 3), in lengths of `image_plane`."""
        points = _checked_points("points", points, 3)
        right, up, forward = self.image_plane(aspect)
        offset = points - np.asarray(self.position, np.float64)
        return offset @ right / (right @ right), offset @ up / (up @ up), offset @ forward

    def _sensor_height_at(self, aspect: float) -> float:
        """What of the sensor a picture of that aspect covers from its top to its bottom, mm."""
        if self.sensor_fit == "vertical":
            return self.sensor_height
        return self.sensor_width / (max(aspect, 1.0) if self.sensor_fit == "auto" else aspect)


_RANGES: dict[str, tuple[float, float]] = {
    "ortho_height": (1e-6, LARGEST),
    "focal_length": (0.0, 1e6),
    "sensor_width": (1e-3, 1e6),
    "sensor_height": (1e-3, 1e6),
    "shift_x": (-100.0, 100.0),
    "shift_y": (-100.0, 100.0),
    "f_stop": (0.0, 1e6),
    "focus_distance": (0.0, LARGEST),
    "blade_rotation": (-LARGEST, LARGEST),
    "near": (0.0, LARGEST),
}


def _checked_aspect(aspect: Any) -> float:
    return checked_number("aspect", aspect, 1 / LARGEST, LARGEST)


def _checked_points(name: str, points: Any, size: int) -> Array:
    found = numbers(name, points, np.float64)
    if found.ndim != 2 or found.shape[1] != size:
        raise InputError(f"{name}: have shape {found.shape}; use (N, {size})")
    return found


def _unit(vector: Array) -> Array:
    result: Array = vector / np.linalg.norm(vector)
    return result
