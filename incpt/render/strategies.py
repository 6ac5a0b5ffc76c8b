"""The strategies that there are, found by name; nobody else compares names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incpt.core import affine
from incpt.core.settings import RenderSettings
from incpt.render import tiles
from incpt.render.film import AOVS, RADIANCE, FilmPass
from incpt.render.impact import exploration
from incpt.render.impact.strategy import Impact
from incpt.render.modes import Mode
from incpt.render.plan import Cursor, Queue
from incpt.render.strategy import Situation, Strategy
from incpt.render.tiles import NO_TILES, IntArray
from incpt.scene.camera import Camera
from incpt.scene.model import Placed


class Restart(Strategy):
    """Every change starts the picture over: what other renderers do."""

    name = "restart"
    uses_nor = False
    keeps_picture = False

    def order(self, situation: Situation) -> IntArray:
        """Row by row from the top left."""
        return tiles.base_queue(situation.grid)


NOR_GROWTH = 4
"""How many times as often a tile is repeated as it was before, while the NoR adapts."""


@dataclass(frozen=True, eq=False)
class SpiralQueue(Queue):
    """A queue after an edit. It begins with the `near_count` tiles in which edited objects are seen, which
    come once for each number of repetitions, all of them before they come again."""

    near_count: int = 0

    @property
    def near(self) -> IntArray:
        """These tiles, in order."""
        return self.tiles[: self.near_count]


class Spiral(Strategy):
    """The method of the thesis: after a local change all tiles are replaced, along a spiral around the point
    of change, each by NoR samples at once.

    Where the NoR adapts, it is at most what the rest of the picture has: more would take time from tiles that
    still show the old scene. Tiles in which the object is seen come first, at its new and then at its old
    place, and with them those that the edit before had not got to: once with a sample, again with four, and
    so on. So the object is there within a step, and no edit leaves a ghost for long.
    """

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

    def queue(self, situation: Situation, order: IntArray | None = None) -> Queue:
        """The order and the repetitions of the class."""
        grid, before = situation.grid, situation.queue
        if order is not None and len(order) > grid.count:  # In the last pass every tile comes.
            order = order[-grid.count :]
        if situation.mode is not Mode.INCREMENTAL or not situation.settings.nor_adapts:
            return super().queue(situation, order)
        if order is not None:
            near = before.near if isinstance(before, SpiralQueue) else NO_TILES
        else:
            near = exploration.seen_tiles(grid, situation.scene.camera, situation.affected[::-1])
            if isinstance(before, SpiralQueue):
                near = _joined(near, _unfinished(before, situation.cursor, grid.count))
            order = _joined(near, self.order(situation))
        nor = _repetitions_of_rest(situation)
        passes = [repetitions for repetitions in NOR_GROWTH ** np.arange(16) if repetitions < nor]
        samples = np.repeat([*passes, nor], [*(len(near) for _ in passes), len(order)])
        return SpiralQueue(
            np.concatenate([*(near for _ in passes), order]).astype(np.int32),
            samples * situation.settings.sample_rate,
            replaces=True,
            near_count=len(near),
        )


def _joined(first: IntArray, rest: IntArray) -> IntArray:
    """Some tiles, and those of the rest that are not among them, in order."""
    return np.concatenate([first, rest[~np.isin(rest, first)]])


def _repetitions_of_rest(situation: Situation) -> int:
    """The NoR, or what most of the picture has in its place."""
    settings = situation.settings
    rest = float(np.median(situation.tile_spp)) / settings.sample_rate
    return max(1, min(settings.nor, round(rest)))


def _unfinished(queue: SpiralQueue, cursor: Cursor, count: int) -> IntArray:
    """The tiles of `queue.near` that have not come for the last time."""
    last_pass = len(queue.tiles) - count
    return queue.near[max(cursor.tiles - last_pass, 0) :]


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
    return (RADIANCE, *(AOVS if settings.has_aovs else ()), *strategy_of(settings).passes)


def point_of_change(
    camera: Camera, objects: tuple[Placed, ...], width: int, height: int
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
