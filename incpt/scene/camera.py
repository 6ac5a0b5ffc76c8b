"""The camera of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass

from incpt.core.errors import InputError
from incpt.core.transform import Vector
from incpt.scene.checks import set_number, set_vector


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. Positions in world space, metres; `fov_y` is the full vertical angle, degrees."""

    position: Vector = (0.0, 1.2, 5.0)
    target: Vector = (0.0, 1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: float = 40.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            set_vector(self, name)
        set_number(self, "fov_y", 0.01, 179.0)
        if math.dist(self.position, self.target) < 1e-9:
            raise InputError("target: is the same point as position; move one of them")
        if math.hypot(*self.up) < 1e-9:
            raise InputError("up: has no length; use [0, 1, 0]")
