"""Scenes for tests: small, quick, and with something of everything."""

from __future__ import annotations

import numpy as np

from incpt.core.settings import RenderSettings
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape


def small_settings(**changes: object) -> RenderSettings:
    """A picture of 44 x 28 pixels: tiles of 8 that are cut at the right and at the bottom edge."""
    values: dict[str, object] = {"size": (44, 28), "tile_size": 8, "nor": 16, "max_bounces": 2}
    return RenderSettings(**{**values, **changes})  # type: ignore[arg-type]


def sky() -> Image:
    """A gradient with a bright spot, 16 x 8."""
    pixels = np.linspace(0.6, 0.1, 8)[:, None, None] * np.ones((8, 16, 3))
    pixels[2, 5] = (9.0, 8.0, 6.0)
    return Image(pixels)


def mixed_scene(**settings: object) -> Scene:
    """A glossy floor, a red cube, a glass sphere, a metal cylinder, a lamp and a sky."""
    materials = {
        "floor": Material(base_color=(0.5, 0.5, 0.5), metallic=1.0, roughness=0.4),
        "red": Material(base_color=(0.8, 0.1, 0.1)),
        "grey": Material(base_color=(0.5, 0.5, 0.5), roughness=0.5),
        "glass": Material(
            base_color=(1, 1, 1),
            transmission=1.0,
            roughness=0.0,
            ior=1.5,
            priority=1,
            absorption=(0.5, 0.1, 0.2),
        ),
        "lamp": Material(base_color=(0, 0, 0), emission=(12, 11, 10)),
    }
    objects = [
        Object("floor", shape("plane"), "floor", scale=(8, 1, 8)),
        Object("red cube", shape("cube"), "red", position=(0, 0.5, 0), rotation=(0, 30, 0)),
        Object("glass ball", shape("sphere"), "glass", position=(1.1, 0.5, 0.3)),
        Object("grey drum", shape("cylinder"), "grey", position=(-1.1, 0.4, 0), scale=(0.7, 0.8, 0.7)),
        Object("lamp", shape("plane"), "lamp", position=(0, 2.5, 0.5), rotation=(180, 0, 0)),
    ]
    return Scene(
        Camera(position=(0, 1.4, 4.2), target=(0, 0.5, 0), fov_y=42),
        Environment(color=(1, 1, 1), image=sky(), intensity=0.5),
        materials,
        objects,
        small_settings(**settings),
    )
