"""Light from far away: a constant radiance, or a lat-long image."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

from incpt.core.affine import Vector
from incpt.core.checks import require
from incpt.scene.checks import LARGEST, set_number, set_vector
from incpt.scene.image import Image


@dataclass(frozen=True)
class Environment:
    """Light from far away: radiance `color` times `intensity`, times the image where there is one.

    `rotation_y` turns the image right-handed about +y, degrees.
    """

    color: Vector = (0.0, 0.0, 0.0)
    image: Image | None = None
    rotation_y: float = 0.0
    intensity: float = 1.0

    def __post_init__(self) -> None:
        set_vector(self, "color", low=0.0)
        require("image", self.image, (Image, NoneType), "an Image; load_image() reads one")
        set_number(self, "rotation_y", -LARGEST, LARGEST)
        set_number(self, "intensity", 0.0, LARGEST)

    @property
    def radiance(self) -> Vector:
        """The factor of the image, or the constant radiance: color times intensity."""
        r, g, b = (c * self.intensity for c in self.color)
        return r, g, b
