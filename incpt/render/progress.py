"""How far a picture is: a value that each step and each edit replaces by another one.

All that a session decides stands here, without a device: the mode, the queue, and how many samples each tile
has. A session carries out what follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from incpt.core.settings import PICTURE_SETTINGS, RenderSettings
from incpt.render.modes import Event, Mode, next_mode
from incpt.render.plan import CountArray, Cursor, Plan, Queue, counts_after, is_done, plan_step
from incpt.render.strategies import FilmSums, Situation, strategy_of
from incpt.render.tiles import IntArray, TileGrid
from incpt.scene.change import Change, affected_objects, diff
from incpt.scene.model import Object, Scene


@dataclass(frozen=True, eq=False)
class Progress:
    """Where the rendering of a scene stands.

    grid      the tiles of the picture.
    mode      what is being done.
    queue     the tiles that the mode goes through, in order.
    cursor    how far the queue is done.
    tile_spp  (grid.count,) samples of the scene as it is now behind each tile; 0 where the film still shows
              an old picture, or none. Nobody can write to it any more. See `Film` for the count that it keeps
              itself.
    """

    settings: RenderSettings
    grid: TileGrid
    mode: Mode
    queue: Queue
    cursor: Cursor
    tile_spp: CountArray

    def __post_init__(self) -> None:
        self.tile_spp.flags.writeable = False

    @classmethod
    def start(cls, settings: RenderSettings, scene: Scene, film: FilmSums) -> Progress:
        """Nothing is rendered yet."""
        grid = TileGrid(*settings.size, settings.tile_size)
        tile_spp = np.zeros(grid.count, np.int64)
        situation = Situation(Mode.BASE, settings, grid, scene, tile_spp, film)
        queue = strategy_of(settings).queue(situation)
        return cls(settings, grid, Mode.BASE, queue, Cursor(), tile_spp)

    def planned(self, slot_count: int) -> Plan:
        """The next step, of so many slots at most."""
        return plan_step(self.grid, self.queue, self.cursor, slot_count, self.tile_spp)

    def after_step(self, plan: Plan, scene: Scene, film: FilmSums) -> Progress:
        """What follows once `plan` is in the film; at the end of the queue, with the next one."""
        stepped = replace(self, cursor=plan.cursor, tile_spp=counts_after(self.queue, plan, self.tile_spp))
        if not is_done(self.queue, plan.cursor):
            return stepped
        return stepped.entering(stepped._next_mode(Event.QUEUE_DONE), scene, film)

    def after_edit(
        self,
        old: Scene,
        scene: Scene,
        change: Change,
        film: FilmSums,
        since: Scene | None = None,
        pixel: tuple[float, float] | None = None,
    ) -> Progress:
        """What follows from an edit that made `scene` of `old`, which differ by `change`; see
        `Session.edit`."""
        if change.is_global:
            return self.entering(self._next_mode(Event.GLOBAL_CHANGE), scene, film)
        changed = affected_objects(old, scene, change)
        if not changed:
            return self
        affected = (_affected_locally(since, scene) if since is not None else ()) or tuple(changed)
        return self.entering(self._next_mode(Event.LOCAL_CHANGE), scene, film, affected, pixel)

    def after_drag(
        self, since: Scene, scene: Scene, film: FilmSums, pixel: tuple[float, float] | None = None
    ) -> Progress:
        """What follows from the end of a drag that made `scene` of `since`; see `Session.end_drag`."""
        affected = _affected_locally(since, scene)
        mode = self._next_mode(Event.LOCAL_CHANGE)
        if mode is not Mode.INCREMENTAL or not affected:
            return self
        return self.entering(mode, scene, film, affected, pixel)

    def with_settings(self, settings: RenderSettings, scene: Scene, film: FilmSums) -> Progress:
        """The same picture under other settings for the same grid. It starts over where samples change their
        meaning; a queue that has not begun gets the samples that the settings now ask for."""
        old, other = self.settings, replace(self, settings=settings)
        if any(getattr(old, name) != getattr(settings, name) for name in PICTURE_SETTINGS):
            return other.entering(Mode.BASE, scene, film)
        if self.cursor == Cursor():
            return other.entering(self.mode, scene, film, order=self.queue.tiles)
        return other

    def entering(
        self,
        mode: Mode,
        scene: Scene,
        film: FilmSums,
        affected: tuple[Object, ...] = (),
        pixel: tuple[float, float] | None = None,
        order: IntArray | None = None,
    ) -> Progress:
        """The beginning of a mode, with the queue that the strategy plans for it; `order` keeps an order that
        is there already."""
        tile_spp = np.zeros_like(self.tile_spp) if mode is Mode.BASE else self.tile_spp
        situation = Situation(
            mode, self.settings, self.grid, scene, tile_spp, film, affected, pixel, self.queue
        )
        queue = strategy_of(self.settings).queue(situation, order)
        return replace(self, mode=mode, queue=queue, cursor=Cursor(), tile_spp=tile_spp)

    def _next_mode(self, event: Event) -> Mode:
        return next_mode(self.mode, event, strategy_of(self.settings))


def _affected_locally(since: Scene, scene: Scene) -> tuple[Object, ...]:
    """What looks different since a scene; nothing where everything does."""
    change = diff(since, scene)
    return () if change.is_global else tuple(affected_objects(since, scene, change))
