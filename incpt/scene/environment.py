"""Light from far away: a constant radiance, a lat-long image, or a sky."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

from incpt.core.affine import Vector
from incpt.core.checks import require
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, set_number, set_vector
from incpt.scene.image import Image
from incpt.scene.sky import Sky


@dataclass(frozen=True)
class Environment:
    """Light from far away: radiance `color` times `intensity`, times the image or the sky where there is one.

    `rotation_y` turns the image, or the sky with its sun, right-handed about +y, degrees.
    """

    color: Vector = (0.0, 0.0, 0.0)
    image: Image | None = None
    rotation_y: float = 0.0
    intensity: float = 1.0
    sky: Sky | None = None

    def __post_init__(self) -> None:
        set_vector(self, "color", low=0.0)
        require("image", self.image, (Image, NoneType), "an Image; load_image() reads one")
        require("sky", self.sky, (Sky, NoneType), "a Sky")
        if self.image is not None and self.sky is not None:
            raise InputError("sky: there is an image too; leave one of them out")
        set_number(self, "rotation_y", -LARGEST, LARGEST)
        set_number(self, "intensity", 0.0, LARGEST)

    @property
    def picture(self) -> Image | None:
        """The image, or that of the sky."""
        return self.image if self.sky is None else self.sky.image

    @property
    def has_sun(self) -> bool:
        """Whether the sun of a sky shines."""
        return self.sky is not None and self.sky.has_sun

    @property
    def radiance(self) -> Vector:
        """The factor of the picture, or the constant radiance: color times intensity."""
        r, g, b = (c * self.intensity for c in self.color)
        return r, g, b
