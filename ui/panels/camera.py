"""The camera."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.scene.camera import Camera
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals


@dataclass(frozen=True)
class CameraRequest:
    """What the user asked for about the camera, besides its fields."""

    is_frame: bool = False
    is_reset: bool = False


def draw(camera: Camera, refusals: Refusals) -> tuple[Camera, CameraRequest]:
    """Fields of the camera; returns it after this frame, and what is asked for."""
    position = widgets.vector(
        "Camera", camera.position, speed=0.02, unit=" m", tip="Position of the camera, world space"
    )
    camera = refusals.changed(camera, position=position)
    target = widgets.vector("Target", camera.target, speed=0.02, unit=" m", tip="The point it looks at")
    camera = refusals.changed(camera, target=target)
    angle = widgets.number(
        "Field of view",
        camera.fov_y,
        low=1.0,
        high=150.0,
        speed=0.2,
        unit="°",
        decimals=1,
        tip="Full vertical angle",
    )
    camera = refusals.changed(camera, fov_y=angle)
    is_frame = widgets.button("Frame selected##camera")
    widgets.same_line()
    return camera, CameraRequest(is_frame, widgets.button("Reset##camera"))
