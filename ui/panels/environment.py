"""The environment: what surrounds the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from incpt.scene.environment import Environment
from incpt.ui.widgets import widgets
from incpt.ui.widgets.refusals import Refusals


@dataclass(frozen=True)
class ImageRequest:
    """What the user asked for about the environment's image."""

    is_choose: bool = False
    is_remove: bool = False


def draw(environment: Environment, refusals: Refusals) -> tuple[Environment, ImageRequest]:
    """Fields of the environment; returns it after this frame, and what is asked for about its image."""
    color = widgets.color(
        "Colour",
        environment.color,
        is_radiance=True,
        tip="Radiance; a factor of the image where there is one",
    )
    environment = refusals.changed(environment, color=color)
    intensity = widgets.number(
        "Intensity", environment.intensity, high=1000.0, speed=0.01, tip="Times colour and image"
    )
    environment = refusals.changed(environment, intensity=intensity)
    angle = widgets.number(
        "Turn",
        environment.rotation_y,
        speed=0.5,
        unit="°",
        decimals=1,
        tip="Of the image, right-handed about +y",
    )
    environment = refusals.changed(environment, rotation_y=angle)
    image = environment.image
    name = "none" if image is None else Path(image.source or "made in Python").name
    widgets.value_row("Image", name, "Lat-long OpenEXR")
    with widgets.row(""):
        is_choose = widgets.button("Choose…##image")
        widgets.same_line()
        is_remove = widgets.button("Remove##image", enabled=image is not None)
    return environment, ImageRequest(is_choose, is_remove)
