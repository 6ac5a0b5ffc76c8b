"""Camera and environment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.ui.widgets import widgets
from incpt.ui.widgets.widgets import Refusals

_Owner = TypeVar("_Owner", Camera, Environment)


def draw_camera(camera: Camera, refusals: Refusals) -> Camera:
    """Fields of the camera; returns it after this frame."""
    camera = _set(
        camera,
        refusals,
        "position",
        widgets.vector(
            "Camera", camera.position, speed=0.02, unit=" m", tip="Position of the camera, world space"
        ),
    )
    camera = _set(
        camera,
        refusals,
        "target",
        widgets.vector("Target", camera.target, speed=0.02, unit=" m", tip="The point it looks at"),
    )
    return _set(camera, refusals, "fov_y", widgets.number(
        "Field of view", camera.fov_y, low=1.0, high=150.0, speed=0.2, unit="°", decimals=1,
        tip="Full vertical angle"))  # fmt: skip


@dataclass(frozen=True)
class ImageRequest:
    """What the user asked for about the environment's image."""

    is_choose: bool = False
    is_remove: bool = False


def draw_environment(environment: Environment, refusals: Refusals) -> tuple[Environment, ImageRequest]:
    """Fields of the environment; returns it after this frame, and what is asked for about its image."""
    environment = _set(
        environment,
        refusals,
        "color",
        widgets.color(
            "Colour",
            environment.color,
            is_radiance=True,
            tip="Radiance; a factor of the image where there is one",
        ),
    )
    environment = _set(
        environment,
        refusals,
        "intensity",
        widgets.number(
            "Intensity", environment.intensity, high=1000.0, speed=0.01, tip="Times colour and image"
        ),
    )
    environment = _set(environment, refusals, "rotation_y", widgets.number(
        "Turn", environment.rotation_y, speed=0.5, unit="°", decimals=1,
        tip="Of the image, right-handed about +y"))  # fmt: skip
    image = environment.image
    name = "none" if image is None else Path(image.source or "made in Python").name
    widgets.value_row("Image", name, "Lat-long OpenEXR")
    with widgets.row(""):
        is_choose = widgets.button("Choose…##image")
        widgets.same_line()
        is_remove = widgets.button("Remove##image", enabled=image is not None)
    return environment, ImageRequest(is_choose, is_remove)


def _set(owner: _Owner, refusals: Refusals, name: str, value: Any) -> _Owner:
    if value == getattr(owner, name):
        return owner
    return refusals.accepted(owner, lambda: replace(owner, **{name: value}))
