"""The camera."""

from __future__ import annotations

from incpt.scene.camera import Camera
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals


def draw(camera: Camera, refusals: Refusals) -> Camera:
    """Fields of the camera; returns it after this frame."""
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
    return refusals.changed(camera, fov_y=angle)
