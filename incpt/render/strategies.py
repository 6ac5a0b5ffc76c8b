"""Strategies: what is rendered after a change, how often, and what becomes of it.

A strategy has three jobs, and a session asks it for nothing else:

1. the *order* of the tiles after a change and at the end of each queue,
2. the *samples* of each tile in that queue,
3. how what a step traced is *merged* into the film, and which picture the film then shows.

What each of them may use stands at its method. A queue may be shorter than a step, which ends with it: so a
strategy that allocates by what it has measured plans short queues, and is asked again at the end of each.

Strategies are found by name in `STRATEGIES_BY_NAME`; nobody else compares names. They keep no state of their
own, because a session that meets an error goes back to the values that it had before: what a strategy has to
remember belongs into the film (a pass of its own) or into the queue (a subclass of `Queue`), which comes back
to it as `Situation.queue`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from incpt.core import affine
from incpt.core.settings import RenderSettings
from incpt.render import tiles
from incpt.render.batch import Batch
from incpt.render.film import AOVS, RADIANCE, Film, FilmPass, Float32Array
from incpt.render.modes import Mode
from incpt.render.plan import CountArray, Plan, Queue
from incpt.render.tiles import IntArray, TileGrid
from incpt.render.tracer import Tracer
from incpt.scene.camera import Camera
from incpt.scene.model import Object, Scene


class FilmSums(Protocol):
    """What a strategy may read of a film."""

    def sums(self) -> Mapping[str, Float32Array]:
        """(channels + 1, height, width) of each pass: the sums of its channels, and the number of samples."""
        ...


@dataclass(frozen=True, eq=False)
class Situation:
    """What a strategy may look at when it plans a queue.

    mode      the mode that begins.
    settings  those of the session.
    grid      the tiles of its picture.
    scene     the scene as it is now.
    tile_spp  (grid.count,) samples of that scene behind each tile.
    film      what is in the film. To read its sums waits for the device, once for each queue.
    affected  the objects that a local change affects, as they were and as they are; in a drag, as they were
              before the drag. Empty where no object changed.
    pixel     the point of change that came with the edit, (x, y) from the top left, or None.
    queue     the queue before this one; None at first.
    """

    mode: Mode
    settings: RenderSettings
    grid: TileGrid
    scene: Scene
    tile_spp: CountArray
    film: FilmSums
    affected: tuple[Object, ...] = ()
    pixel: tuple[float, float] | None = None
    queue: Queue | None = None


@dataclass(frozen=True, eq=False)
class TracedStep:
    """A step whose paths are traced.

    tracer  what traced them, and could trace others.
    batch   the paths, in the scene that they were traced in. Its path buffer has a plane for each channel of
            each pass of the film, of which the tracer has filled those of radiance and of auxiliary images.
    plan    which tile and sample is in which of its slots.
    """

    tracer: Tracer
    batch: Batch
    plan: Plan


class Strategy(ABC):
    """What happens to the picture after a change; see the module for the three jobs.

    name           by which settings choose it.
    passes         what the film has to hold for it, beside radiance and auxiliary images.
    uses_nor       whether the setting `nor` makes a difference.
    keeps_picture  whether a local change keeps what the film has; see `modes.next_mode`.
    """

    name: ClassVar[str]
    passes: ClassVar[tuple[FilmPass, ...]] = ()
    uses_nor: ClassVar[bool]
    keeps_picture: ClassVar[bool]

    @abstractmethod
    def order(self, situation: Situation) -> IntArray:
        """Job 1: (N,) the tiles to render next, in order, each at most once. It may use all of the situation,
        and may leave tiles out where the mode is not BASE, which has to cover the picture."""

    def samples(self, situation: Situation, order: IntArray) -> CountArray:
        """Job 2: (N,) the samples per pixel of each tile of `order`, one at least. It may use all of the
        situation. By default each tile gets NoR times the sample rate."""
        settings = situation.settings
        repetitions = settings.nor if situation.mode is Mode.INCREMENTAL else settings.base_nor
        return np.full(len(order), repetitions * settings.sample_rate, np.int64)

    def replaces(self, situation: Situation) -> bool:
        """Job 3: whether a finished tile replaces what the film has of it, or is added to it. By default only
        refinement adds."""
        return situation.mode is not Mode.REFINE

    def merge(self, step: TracedStep, film: Film) -> None:
        """Job 3: put what a step traced into the film. It may launch kernels of its own over all that the
        step and the film hold, or trace the paths of `step.batch` again in the tables of an older scene, and
        put the results into passes of its own; `Film.first_plane` tells where their planes begin. By default
        each pass gets its planes of the path buffer."""
        batch = step.batch
        film.reduce(batch.params, step.plan, batch.slots, batch.path_buffer)

    def image(self, film: Film) -> Float32Array:
        """Job 3: (height, width, 4) the picture that the film shows: mean radiance, linear, and 1 where there
        ever was a sample, else 0. It may launch kernels of its own, once for each picture that is shown."""
        return film.image()

    def queue(self, situation: Situation, order: IntArray | None = None) -> Queue:
        """The queue that the three jobs make together; `order` keeps an order that is there already."""
        order = self.order(situation) if order is None else order
        return Queue(order, self.samples(situation, order), self.replaces(situation))


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

STRATEGIES_BY_NAME: dict[str, Strategy] = {strategy.name: strategy for strategy in (RESTART, Spiral())}
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
