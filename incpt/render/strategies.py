"""The strategies that there are, found by name; nobody else compares names."""

from __future__ import annotations

import numpy as np

from incpt.core import affine
from incpt.core.settings import RenderSettings
from incpt.render import tiles
from incpt.render.film import AOVS, RADIANCE, FilmPass
from incpt.render.impact.strategy import Impact
from incpt.render.modes import Mode
from incpt.render.strategy import Situation, Strategy
from incpt.render.tiles import IntArray
from incpt.scene.camera import Camera
from incpt.scene.model import Object


class Restart(Strategy):
    """Every change starts the picture over: what other renderers do."""

    name = "restart"
    uses_nor = False
    keeps_picture = False

    def order(self, situation: Situation) -> IntArray:
        """Row by row from the top left."""
        return tiles.base_queue(situation.grid)


class Spiral(Strategy):
    """The method of the thesis: after a local change all tiles are replaced, along a spiral around the point
    of change, each by NoR samples at once."""

    name = "spiral"
    uses_nor = True
    keeps_picture = True

    def order(self, situation: Situation) -> IntArray:
        """Along the spiral after a local change, else row by row."""
        if situation.mode is not Mode.INCREMENTAL:
            return tiles.base_queue(situation.grid)
        point_px = situation.pixel if situation.settings.point_of_change == "pixel" else None
        if point_px is None:
            point_px = point_of_change(
                situation.scene.camera, situation.affected, situation.grid.width, situation.grid.height
            )
        return tiles.spiral_queue(situation.grid, point_px)


RESTART = Restart()
"""What other strategies are compared with."""

STRATEGIES_BY_NAME: dict[str, Strategy] = {
    strategy.name: strategy for strategy in (RESTART, Spiral(), Impact())
}
"""All strategies that there are; a test holds `settings.STRATEGIES` to these names."""


def strategy_of(settings: RenderSettings) -> Strategy:
    """The strategy that settings choose."""
    return STRATEGIES_BY_NAME[settings.strategy]


def passes_of(settings: RenderSettings) -> tuple[FilmPass, ...]:
    """What the film of a session with these settings holds, in the order of the planes of the path buffer:
    radiance, auxiliary images where they are asked for, and what the strategy needs."""
    return (RADIANCE, *(AOVS if settings.aovs else ()), *strategy_of(settings).passes)


def point_of_change(
    camera: Camera, objects: tuple[Object, ...], width: int, height: int
) -> tuple[float, float]:
    """The centre of the 2D bounding box of objects, of its visible part where there is one, in pixels of a
    picture of that size; the centre of the picture where there are none in front of the camera."""
    if not objects:
        return width / 2, height / 2
    corners = np.concatenate([affine.box_corners(obj.world_bounds) for obj in objects])
    pixels, in_front = camera.project(corners, width / height)
    pixels = pixels * (width, height)
    if not in_front.any():
        return width / 2, height / 2
    low, high = pixels[in_front].min(axis=0), pixels[in_front].max(axis=0)
    inner_low, inner_high = np.maximum(low, 0), np.minimum(high, [width, height])
    if (inner_low < inner_high).all():
        low, high = inner_low, inner_high
    x, y = (low + high) / 2
    return float(x), float(y)
