"""A strategy: what is rendered after a change, how often, and what becomes of it.

A strategy has three jobs, and a session asks it for nothing else:

1. the *order* of the tiles after a change and at the end of each queue,
2. the *samples* of each tile in that queue,
3. how what a step traced is *merged* into the film, and which picture the film then shows.

What each of them may use stands at its method. A queue may be shorter than a step, which ends with it: so a
strategy that allocates by what it has measured plans short queues, and is asked again at the end of each.

They keep no state of their own, because a session that meets an error goes back to the values that it had
before: what a strategy has to remember belongs into the film (passes or planes of its own) or into the queue,
which comes back to it as `Situation.queue`. Those that there are stand in `strategies`.

A strategy may compare the scene with the one that the picture is of, its *anchor*, which then stays on the
device beside it: `Strategy.keeps_anchor`, `Comparison`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from incpt.core.settings import RenderSettings
from incpt.render.batch import Batch
from incpt.render.film import Film, FilmPass, FilmPlanes, Float32Array
from incpt.render.impact.comparison import Comparison
from incpt.render.impact.pairs import PairBuffers
from incpt.render.impact.tile_sums import TileSums
from incpt.render.modes import Mode
from incpt.render.plan import CountArray, Cursor, Plan, Queue
from incpt.render.tiles import BoolArray, IntArray, TileGrid
from incpt.render.tracer import Tracer
from incpt.scene.change import Change
from incpt.scene.model import Placed, Scene


class Measurements(Protocol):
    """What a strategy may read of what was rendered. Each call waits for the device."""

    def sums(self) -> Mapping[str, Float32Array]:
        """(channels + 1, height, width) of each pass: the sums of its channels, and the number of samples."""
        ...

    def tile_sums(self) -> TileSums | None:
        """What pairs of paths say of each tile; None where the scene is not compared with another."""
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
              before the drag, and where the scene is compared with an anchor, as they were there. Empty where
              no object changed.
    pixel     the point of change that came with the edit, (x, y) from the top left, or None.
    queue     the queue before this one; None at first. `cursor` is how far it got.
    drawn     (grid.count,) samples drawn of each tile since the scene is compared with an anchor, which it
              may be where `has_anchor`.
    stale     (grid.count,) tiles of which auxiliary images still show the scene before an edit; None: none.
    """

    mode: Mode
    settings: RenderSettings
    grid: TileGrid
    scene: Scene
    tile_spp: CountArray
    film: Measurements
    affected: tuple[Placed, ...] = ()
    pixel: tuple[float, float] | None = None
    queue: Queue | None = None
    drawn: CountArray | None = None
    has_anchor: bool = False
    stale: BoolArray | None = None
    cursor: Cursor = Cursor()


@dataclass(frozen=True, eq=False)
class Step:
    """A step to do.

    tracer      what traces its paths.
    batch       the paths, in the scene as it is now. The path buffer has a plane for each channel of each
                pass of the film, of which the tracer fills those of radiance and of auxiliary images.
    plan        which tile and sample is in which of its slots.
    comparison  the scene that it is compared with; None: there is none.
    pairs       room for partners of all paths, where there is one.
    """

    tracer: Tracer
    batch: Batch
    plan: Plan
    comparison: Comparison | None = None
    pairs: PairBuffers | None = None


class Strategy(ABC):
    """What happens to the picture after a change; see the module for the three jobs.

    name           by which settings choose it.
    passes         what the film has to hold for it, beside radiance and auxiliary images.
    planes         what it keeps of each pixel in the film that is not made of what paths bring alone.
    uses_nor       whether the setting `nor` makes a difference.
    keeps_picture  whether a local change keeps what the film has; see `modes.next_mode`.
    keeps_anchor   whether the scene is compared, after a local change, with the one that the film's radiance
                   is of.
    """

    name: ClassVar[str]
    passes: ClassVar[tuple[FilmPass, ...]] = ()
    planes: ClassVar[tuple[FilmPlanes, ...]] = ()
    uses_nor: ClassVar[bool]
    keeps_picture: ClassVar[bool]
    keeps_anchor: ClassVar[bool] = False

    def starts_over(self, change: Change) -> bool:
        """Whether nothing of the picture is of use after a change: by default where it affects the whole
        image alike."""
        return change.is_global

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

    def render(self, step: Step, film: Film) -> int:
        """Job 3: trace a step, and put what it brings into the film; returns how many paths it traced in the
        scene that this one is compared with. It may launch kernels of its own over all that the step and the
        film hold, or trace paths of `step.batch` again in the tables of that other scene; `Film.first_plane`
        tells where the planes of its own passes begin. By default each pass gets its planes of the path
        buffer."""
        step.tracer.trace(step.batch)
        film.reduce(step.batch.params, step.plan, step.batch.slots, step.batch.path_buffer)
        return 0

    def image(self, film: Film, comparison: Comparison | None) -> Float32Array:
        """Job 3: (height, width, 4) the picture that the film shows: mean radiance, linear, and 1 where there
        ever was a sample, else 0. It may launch kernels of its own, once for each picture that is shown."""
        return film.image()

    def begin(self, film: Film) -> None:
        """Forget what was found of the scene before an edit; the anchor stays."""
        assert not self.keeps_anchor, "a strategy that keeps an anchor has to say how"

    def fold(self, film: Film, comparison: Comparison) -> None:
        """Make the picture that the film shows its radiance, so that the scene that it shows can be the next
        anchor."""
        assert not self.keeps_anchor, "a strategy that keeps an anchor has to say how"

    def idle_launches(self, tracer: Tracer, batch: Batch, film: Film) -> list[Callable[[], None]]:
        """Launches of the kernels that it needs beside those of the tracer and the film, each with nothing to
        do; see `Device.built`. `batch` is one for `Tracer.idle_launches`."""
        return []

    def queue(self, situation: Situation, order: IntArray | None = None) -> Queue:
        """The queue that the three jobs make together; `order` keeps an order that is there already."""
        order = self.order(situation) if order is None else order
        return Queue(order, self.samples(situation, order), self.replaces(situation))
