"""The environment: what surrounds the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.sky import Sky
from incpt.ui.widgets import places, widgets
from incpt.ui.widgets.refusals import Refusals
from incpt.ui.widgets.thumbnails import Thumbnails

_SKY_INTENSITY = 0.1
"""That of a new sky: by day it is many times brighter than what lamps are made for."""


@dataclass(frozen=True)
class ImageRequest:
    """What the user asked for about the environment's image."""

    is_choose: bool = False
    is_remove: bool = False


def draw(
    environment: Environment, thumbnails: Thumbnails, refusals: Refusals
) -> tuple[Environment, ImageRequest]:
    """Fields of the environment; returns it after this frame, and what is asked for about its image."""
    color = widgets.color(
        "Colour",
        environment.color,
        is_radiance=True,
        tip="Radiance; a factor of the image or the sky where there is one",
    )
    environment = refusals.changed(environment, color=color)
    intensity = widgets.number(
        "Intensity", environment.intensity, high=1000.0, speed=0.01, tip="Times colour, image and sky"
    )
    environment = refusals.changed(environment, intensity=intensity)
    angle = widgets.number(
        "Turn",
        environment.rotation_y,
        speed=0.5,
        unit="°",
        decimals=1,
        tip="Of the image, or of the sky with its sun, right-handed about +y",
    )
    environment = refusals.changed(environment, rotation_y=angle)
    image = environment.image
    _draw_image(image, thumbnails)
    with widgets.row(""):
        is_choose = widgets.button("Choose…##image")
        widgets.same_line()
        is_remove = widgets.button("Remove##image", enabled=image is not None)
    is_sky = widgets.checkbox(
        "Sky", environment.sky is not None, "A clear sky with its sun, in place of an image"
    )
    if is_sky != (environment.sky is not None):
        environment = _switched(environment, is_sky, refusals)
    if environment.sky is not None:
        environment = refusals.changed(environment, sky=_draw_sky(environment.sky, refusals))
    return environment, ImageRequest(is_choose, is_remove)


def _draw_image(image: Image | None, thumbnails: Thumbnails) -> None:
    name = "none" if image is None else Path(image.source or "made in Python").name
    if image is not None and image.is_placeholder:
        name += ", missing"
    widgets.value_row("Image", name, (image.source if image is not None else None) or "Lat-long OpenEXR")
    if image is not None:
        with widgets.row(""):
            width = imgui.get_content_region_avail().x
            thumbnails.draw_wide(image, image.pixels, width)
            places.note("thumbnail environment")


def _switched(environment: Environment, is_sky: bool, refusals: Refusals) -> Environment:
    if not is_sky:
        return refusals.changed(environment, sky=None)
    white = (1.0, 1.0, 1.0)
    return refusals.changed(environment, color=white, image=None, intensity=_SKY_INTENSITY, sky=Sky())


def _draw_sky(sky: Sky, refusals: Refusals) -> Sky:
    elevation = widgets.number(
        "Sun elevation", sky.sun_elevation, low=-20.0, high=90.0, speed=0.1, unit="°", decimals=1,
        tip="Above the horizon; the sun stands over +z, turned by Turn",
    )  # fmt: skip
    sky = refusals.changed(sky, sun_elevation=elevation)
    is_disc = widgets.checkbox("Sun disc", sky.sun_disc, "Whether the sun itself shines, and casts shadows")
    sky = refusals.changed(sky, sun_disc=is_disc)
    size = widgets.number(
        "Sun size",
        sky.sun_size,
        low=0.1,
        high=45.0,
        speed=0.02,
        unit="°",
        tip="Across; a larger sun is dimmer",
    )
    sky = refusals.changed(sky, sun_size=size)
    strength = widgets.number(
        "Sun strength", sky.sun_intensity, high=1000.0, speed=0.01, tip="Times the light of the sun itself"
    )
    sky = refusals.changed(sky, sun_intensity=strength)
    altitude = widgets.number(
        "Altitude", sky.altitude, high=5e4, speed=10.0, unit=" m", decimals=0, tip="Above the sea"
    )
    sky = refusals.changed(sky, altitude=altitude)
    for name, tip in (
        ("air", "Molecules, which make the sky blue; 1: a clear day"),
        ("dust", "Dust and droplets, which make a haze about the sun; 1: a clear day"),
        ("ozone", "Makes the sky bluer, most at twilight; 1: as usual"),
    ):
        density = widgets.number(
            name.capitalize(), getattr(sky, name), high=10.0, speed=0.01, tip=f"{tip}. 0: none"
        )
        sky = refusals.changed(sky, **{name: density})
    ground = widgets.number(
        "Ground", sky.ground, high=1.0, speed=0.005, tip="Reflectance of what lies below the horizon"
    )
    return refusals.changed(sky, ground=ground)
