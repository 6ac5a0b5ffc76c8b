"""Lights that are objects of their own: what they are, where they stand, and how much they emit.

A light shines along -z of its own frame, as glTF's and Blender's do. What it emits is told by one of three
numbers, times `color`: `power`, `radiance`, or for a sun `irradiance`. The other quantities follow from its
shape (`Light.emitted`), so that a lamp that grows keeps its watts, or its brightness, as it was asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.checks import described, one_of, require, require_bool
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, checked_number, is_list, set_number, set_vector
from incpt.scene.transform import IDENTITY, Transform

KINDS = ("point", "spot", "sun", "rectangle", "disk", "sphere")
"""Every kind of light."""
DIRECTED = ("spot", "sun", "rectangle", "disk")
"""Those that shine along -z; the others shine into all directions."""
STRENGTHS = ("power", "radiance", "irradiance")
"""The quantities of which one says how much a light emits."""
SMALLEST_SIZE = 1e-7
"""Metres below which a light has no size: a point, from which no ray comes but towards a known place."""
SMALLEST_ANGLE = 1e-4
"""Degrees below which a sun has no size."""
LARGEST_STRENGTH = 1e12
"""Bound on watts, radiance and irradiance."""

_PLACEMENT = ("position", "rotation", "scale", "matrix")
_SIZES = {"point": ("radius",), "spot": ("radius",), "sphere": ("radius",), "disk": ("radius",),
          "rectangle": ("size",), "sun": ("angle",)}  # fmt: skip
"""The keys that say how large each kind is."""
_OWN = {"spot": ("spot_angle", "spot_blend"), "rectangle": ("double_sided",), "disk": ("double_sided",)}
"""Further keys that only some kinds have."""
_COMMON = ("color", *STRENGTHS, "visible", "camera_visible", "casts_shadows")
_DEFAULT_STRENGTH = {"sun": ("irradiance", 3.0)}


def keys_of(kind: str) -> tuple[str, ...]:
    """The names of what can be told of a light of that kind, beside name, kind and placement."""
    return (*_SIZES[kind], *_OWN.get(kind, ()), *_COMMON)


@dataclass(frozen=True)
class Light:
    """A light: `kind` is one of KINDS.

    kind            point: into all directions; with a radius a ball. sphere: the same, which has a radius.
                    spot: a point within a cone around -z. sun: from far away along -z. rectangle and disk: in
                    the plane of x and y, along -z.
    transform       where it stands and how it is turned and scaled, given as `Object` takes it. Sizes are
                    multiplied by its scale: a ball's radius by the mean of the three, the others along their
                    axes. Lights have no shear: of a matrix the nearest placement without counts.
    color           linear, a factor of the strength.
    power           radiant power in all directions together, watt
    radiance        of its surface, W / (m² sr)
    irradiance      of a sun, on a surface that faces it, W / m². One of these three is given, and the others
                    are None. Without any a sun has an irradiance of 3, other lights a power of 100.
    radius          metres; 0 is a point
    size            (width, height) of a rectangle, metres
    angle           diameter of a sun as it is seen, degrees; 0 is a point
    spot_angle      of a spot: the full angle of its cone, degrees
    spot_blend      of a spot: the outer part of the cone, 0 to 1, over which its light falls off to nothing
    double_sided    whether a rectangle or disk shines along +z as well
    visible         whether it is there
    camera_visible  whether camera rays meet it. Others do, so that mirrors show it.
    casts_shadows   whether surfaces are in the way of its light

    Raises InputError.
    """

    name: str
    kind: str
    transform: Transform
    color: Vector
    power: float | None
    radiance: float | None
    irradiance: float | None
    radius: float
    size: tuple[float, float]
    angle: float
    spot_angle: float
    spot_blend: float
    double_sided: bool
    visible: bool
    camera_visible: bool
    casts_shadows: bool

    def __init__(
        self,
        name: str,
        kind: str,
        position: Vector | None = None,
        rotation: Vector | None = None,
        scale: Vector | None = None,
        color: Vector = (1.0, 1.0, 1.0),
        power: float | None = None,
        radiance: float | None = None,
        irradiance: float | None = None,
        radius: float = 0.1,
        size: tuple[float, float] = (1.0, 1.0),
        angle: float = 0.53,
        spot_angle: float = 60.0,
        spot_blend: float = 0.15,
        double_sided: bool = False,
        visible: bool = True,
        camera_visible: bool = True,
        casts_shadows: bool = True,
        *,
        matrix: npt.ArrayLike | None = None,
        transform: Transform = IDENTITY,
    ) -> None:
        if not isinstance(name, str) or not name:
            raise InputError(f"name: {described(name)} is not a name; give the light a text")
        one_of("kind", kind, KINDS)
        require("transform", transform, Transform, "a Transform")
        values: dict[str, Any] = {
            "name": name, "kind": kind, "transform": transform.with_parts(position, rotation, scale, matrix),
            "color": color, "power": power, "radiance": radiance, "irradiance": irradiance,
            "radius": radius, "size": size, "angle": angle, "spot_angle": spot_angle,
            "spot_blend": spot_blend, "double_sided": double_sided, "visible": visible,
            "camera_visible": camera_visible, "casts_shadows": casts_shadows,
        }  # fmt: skip
        for key, value in values.items():
            object.__setattr__(self, key, value)
        self._check()

    def _check(self) -> None:
        set_vector(self, "color", low=0.0)
        set_number(self, "radius", 0.0, LARGEST)
        set_number(self, "angle", 0.0, 180.0)
        set_number(self, "spot_angle", 1e-3, 180.0)
        set_number(self, "spot_blend", 0.0, 1.0)
        if not is_list(self.size) or len(self.size) != 2:
            raise InputError(f"size: {described(self.size)} is not a list of two numbers, width and height")
        size = tuple(checked_number("size", v, SMALLEST_SIZE, LARGEST) for v in self.size)
        object.__setattr__(self, "size", size)
        for name in ("double_sided", "visible", "camera_visible", "casts_shadows"):
            require_bool(name, getattr(self, name))
        if self.kind in ("sphere", "disk") and self.radius < SMALLEST_SIZE:
            raise InputError(f"radius: {self.radius:g} is nothing; a {self.kind} has one, a point may have 0")
        self._check_strength()

    def _check_strength(self) -> None:
        given = [name for name in STRENGTHS if getattr(self, name) is not None]
        if not given:
            name, value = _DEFAULT_STRENGTH.get(self.kind, ("power", 100.0))
            object.__setattr__(self, name, value)
            return
        if len(given) > 1:
            raise InputError(f"{given[1]}: stands beside {given[0]}; give one of them")
        name = given[0]
        set_number(self, name, 0.0, LARGEST_STRENGTH)
        other = "irradiance" if self.is_far else "power"
        if name == ("power" if self.is_far else "irradiance"):
            raise InputError(f"{name}: a {self.kind} has none; give its {other}")
        if name == "radiance" and not self.has_size:
            raise InputError(f"radiance: the light has no size; give its {other}")

    @property
    def strength(self) -> tuple[str, float]:
        """Which of STRENGTHS is given, and how much it is."""
        name = next(name for name in STRENGTHS if getattr(self, name) is not None)
        return name, getattr(self, name)

    @property
    def position(self) -> Vector:
        """In world space, metres. That of a sun says nothing."""
        return self.transform.position

    @property
    def rotation(self) -> Vector:
        """Degrees about x, then y, then z."""
        return self.transform.rotation

    @property
    def scale(self) -> Vector:
        """Factors along the rotated axes."""
        return self.transform.scale

    @property
    def is_far(self) -> bool:
        """Whether its light comes from far away, so that it has a direction and no place."""
        return self.kind == "sun"

    @property
    def has_size(self) -> bool:
        """Whether rays can meet it."""
        if self.is_far:
            return self.angle >= SMALLEST_ANGLE
        return self.kind in ("rectangle", "disk") or self.radius >= SMALLEST_SIZE

    @cached_property
    def axes(self) -> npt.NDArray[np.float64]:
        """(3, 3) its axes x, y and z as rows, in world space, of unit length and at right angles."""
        return affine.rotation_matrix(self.transform.rotation).T

    @cached_property
    def half_size(self) -> tuple[float, float]:
        """Half of its extent along x and y, metres: for a ball its radius; 0 without a size."""
        if self.is_far or not self.has_size:
            return 0.0, 0.0
        x, y, z = (abs(s) for s in self.transform.scale)
        if self.kind == "rectangle":
            half = 0.5 * x * self.size[0], 0.5 * y * self.size[1]
        elif self.kind == "disk":
            half = x * self.radius, y * self.radius
        else:
            half = 2 * ((x * y * z) ** (1 / 3) * self.radius,)
        return max(half[0], SMALLEST_SIZE), max(half[1], SMALLEST_SIZE)

    @property
    def area(self) -> float:
        """Of its surface, one side of a flat one, square metres."""
        a, b = self.half_size
        return 4 * a * b if self.kind == "rectangle" else math.pi * a * b * (1 if self.kind == "disk" else 4)

    @property
    def cone(self) -> tuple[float, float]:
        """Cosines of the angles from the axis of a spot at which its light begins to fall off, and at which
        there is nothing left. Between them it falls like 3 t² - 2 t³ of the cosine."""
        half = math.radians(self.spot_angle) / 2
        return math.cos(half * (1 - self.spot_blend)), math.cos(half)

    @property
    def solid_angle(self) -> float:
        """Over which it shines: its power over its greatest intensity. For a sun that which it is seen
        under."""
        if self.kind == "sun":
            return 2 * math.pi * self.cap
        if self.kind == "spot":
            inner, outer = self.cone
            return 2 * math.pi * (1 - (inner + outer) / 2)
        if self.kind in ("rectangle", "disk"):
            return math.pi * (2 if self.double_sided else 1)
        return 4 * math.pi

    @property
    def cap(self) -> float:
        """Of a sun: how high the cap of the unit sphere is that it fills, 1 - cos of half its angle."""
        return 2 * math.sin(math.radians(self.angle) / 4) ** 2

    @property
    def face(self) -> float:
        """How large it is as seen from where it is brightest, square metres: intensity over radiance. Of a
        sun irradiance over radiance."""
        if self.kind == "sun":
            return math.pi * math.sin(math.radians(self.angle) / 2) ** 2
        return self.area if self.kind in ("rectangle", "disk") else self.area / 4

    @cached_property
    def emitted(self) -> Vector:
        """Radiance where rays can meet it; else the intensity of a point, W / sr, or the irradiance of a sun.
        Of a spot on its axis."""
        name, value = self.strength
        if name == "power":
            value /= self.solid_angle * (self.face if self.has_size else 1)
        elif name == "irradiance" and self.has_size:
            value /= self.face
        r, g, b = (value * c for c in self.color)
        return r, g, b

    @cached_property
    def watts(self) -> Vector:
        """Its radiant power for each channel of its colour; that of a sun on a square metre that faces it."""
        factor = (self.face if self.has_size else 1) * (1 if self.is_far else self.solid_angle)
        r, g, b = (factor * e for e in self.emitted)
        return r, g, b

    @cached_property
    def is_emissive(self) -> bool:
        """Whether it is there and emits anything."""
        return self.visible and any(self.emitted)

    @cached_property
    def world_bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) bounds of its surface in world space; of a light without a size, its place. A sun, which has
        none, says its position."""
        place = np.asarray(self.position)
        if self.kind in ("rectangle", "disk"):
            reach = np.abs(self.axes[:2] * np.array(self.half_size)[:, None])
            extent = reach.sum(axis=0) if self.kind == "rectangle" else np.sqrt((reach**2).sum(axis=0))
        else:
            extent = np.full(3, self.half_size[0])
        return np.stack([place - extent, place + extent])


def nearest_seen(
    lights: tuple[Light, ...], origin: Vector, direction: npt.NDArray[np.float64], limit: float
) -> Light | None:
    """The light that a camera ray from `origin` along `direction` (3,), of unit length, meets before all
    others and before `limit` metres, as the kernels do it; suns only where `limit` is infinite."""
    found: Light | None = None
    for light in lights:
        if light.is_emissive and light.camera_visible and light.has_size:
            distance = _distance_to(light, np.asarray(origin, np.float64), direction)
            if distance < limit or (light.is_far and distance == limit and found is None):
                found, limit = light, distance
    return found


def _distance_to(light: Light, origin: npt.NDArray[np.float64], direction: npt.NDArray[np.float64]) -> float:
    """Along a ray to the shining side of a light, metres, infinity to a sun; NaN where it does not meet
    it."""
    z = light.axes[2]
    if light.is_far:
        return math.inf if 1 - direction @ z <= light.cap else math.nan
    to_center = np.asarray(light.position) - origin
    if light.kind not in ("rectangle", "disk"):
        middle = float(to_center @ direction)
        chord2 = light.half_size[0] ** 2 - float(((to_center - middle * direction) ** 2).sum())
        distance = middle - math.sqrt(max(chord2, 0.0))
        if light.kind == "spot" and direction @ z <= light.cone[1]:
            return math.nan
        return distance if chord2 >= 0 and distance > 0 else math.nan
    facing = float(direction @ z)
    if facing == 0 or (facing < 0 and not light.double_sided):
        return math.nan
    distance = float(to_center @ z) / facing
    across = (distance * direction - to_center) @ light.axes[:2].T / light.half_size
    inside = np.abs(across).max() <= 1 if light.kind == "rectangle" else (across**2).sum() <= 1
    return distance if inside and distance > 0 else math.nan


def changed(light: Light, changes: dict[str, Any]) -> Light:
    """A light with other values; one of STRENGTHS takes the place of the one that it has, and another kind
    may need another one. Raises InputError."""
    known = (*light.__dataclass_fields__, *_PLACEMENT)
    for key in changes:
        if key not in known:
            raise InputError(f"{key}: is no property of light; it has {', '.join(known)}")
    values = dict(changes)
    given = [name for name in STRENGTHS if values.get(name) is not None]
    if given:
        values = dict.fromkeys(STRENGTHS) | values
    kind = values.get("kind", light.kind)
    if not given and kind in KINDS and (kind == "sun") != light.is_far:
        values |= dict.fromkeys(STRENGTHS)
    return replace(light, **values)
