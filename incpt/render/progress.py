"""How far a picture is: a value that each step and each edit replaces by another one.

All that a session decides stands here, without a device: the mode, the queue, and how many samples each tile
has. A session carries out what follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incpt.core.settings import PICTURE_SETTINGS, RenderSettings
from incpt.render.impact.anchor import Anchor
from incpt.render.impact.exploration import seen_tiles
from incpt.render.impact.findings import Findings
from incpt.render.modes import Event, Mode, next_mode
from incpt.render.plan import CountArray, Cursor, Plan, Queue, counts_after, is_done, plan_step
from incpt.render.strategies import strategy_of
from incpt.render.strategy import Measurements, Situation
from incpt.render.tiles import BoolArray, IntArray, TileGrid
from incpt.scene.change import Change, affected_objects, diff
from incpt.scene.model import Placed, Scene


@dataclass(frozen=True, eq=False)
class Progress:
    """Where the rendering of a scene stands.

    grid          the tiles of the picture.
    mode          what is being done.
    queue         the tiles that the mode goes through, in order.
    cursor        how far the queue is done.
    drawn         (grid.count,) samples drawn of each tile, from the one with the index `first_sample` on.
    first_sample  that index. It goes up where the samples before stay in the picture and must not come twice.
    kept          (grid.count,) samples behind each tile beside those drawn.
    anchor        the scene that this one is compared with, whose picture the film's radiance is; None: it is
                  that of this scene.
    stale         (grid.count,) whether auxiliary images still show the scene before an edit there, though
                  radiance does not; None where there are none of these images.
    """

    settings: RenderSettings
    grid: TileGrid
    mode: Mode
    queue: Queue
    cursor: Cursor
    drawn: CountArray
    first_sample: int
    kept: CountArray
    anchor: Anchor | None = None
    stale: BoolArray | None = None

    @cached_property
    def tile_spp(self) -> CountArray:
        """(grid.count,) samples of the scene as it is now that each tile is worth; 0 where the film still
        shows an old picture, or none. Nobody can write to it. See `Film` for the count that it keeps
        itself."""
        if self.queue.worth is not None:
            return self.queue.worth
        counts = self.drawn + self.kept
        counts.flags.writeable = False
        return counts

    @property
    def findings(self) -> Findings | None:
        """What is known of the change since the anchor, as of the last round that ended; None before the
        first one, and where the scene is compared with no other."""
        return None if self.anchor is None else self.queue.findings

    @property
    def error_left(self) -> float | None:
        """See `Session.error_left`."""
        if self.mode is Mode.BASE or not strategy_of(self.settings).keeps_anchor:
            return None
        if self.anchor is None:
            return 0.0
        return 1.0 if self.findings is None else self.findings.error_left

    @classmethod
    def start(cls, settings: RenderSettings, scene: Scene, film: Measurements) -> Progress:
        """Nothing is rendered yet."""
        grid = TileGrid(*settings.size, settings.tile_size)
        none = np.zeros(grid.count, np.int64)
        situation = Situation(Mode.BASE, settings, grid, scene, none, film)
        queue = strategy_of(settings).queue(situation)
        return cls(settings, grid, Mode.BASE, queue, Cursor(), drawn=none, first_sample=0, kept=none)

    def planned(self, slot_count: int) -> Plan:
        """The next step, of so many slots at most."""
        return plan_step(
            self.grid, self.queue, self.cursor, slot_count, self.drawn, self.first_sample, self.stale
        )

    def after_step(self, plan: Plan, scene: Scene, film: Measurements) -> Progress:
        """What follows once `plan` is in the film; at the end of the queue, with the next one."""
        drawn, kept = counts_after(self.queue, plan, self.drawn), self.kept
        if self.queue.replaces and kept.any():
            kept = kept.copy()
            kept[plan.finished] = 0
        stale = self.stale
        if stale is not None:
            stale = stale.copy()
            stale[plan.finished] = False
        stepped = replace(self, cursor=plan.cursor, drawn=drawn, kept=kept, stale=stale)
        if not is_done(self.queue, plan.cursor):
            return stepped
        return stepped.entering(stepped._next_mode(Event.QUEUE_DONE), scene, film)

    def after_edit(
        self,
        old: Scene,
        scene: Scene,
        change: Change,
        film: Measurements,
        since: Scene | None = None,
        pixel: tuple[float, float] | None = None,
    ) -> Progress:
        """What follows from an edit that made `scene` of `old`, which differ by `change`; see
        `Session.edit`."""
        strategy = strategy_of(self.settings)
        if strategy.starts_over(change):
            return self.entering(self._next_mode(Event.GLOBAL_CHANGE), scene, film)
        changed = affected_objects(old, scene, change)
        if not changed and not change.is_global:
            return self
        mode = self._next_mode(Event.LOCAL_CHANGE)
        if mode is Mode.INCREMENTAL and strategy.keeps_anchor:
            return self._compared(old, scene, tuple(changed), film, pixel)
        affected = (_affected_locally(since, scene) if since is not None else ()) or tuple(changed)
        return self.entering(mode, scene, film, affected, pixel)

    def _compared(
        self,
        old: Scene,
        scene: Scene,
        changed: tuple[Placed, ...],
        film: Measurements,
        pixel: tuple[float, float] | None,
    ) -> Progress:
        """What follows from a local edit of `old`, which affects the objects `changed`, where `scene` is
        compared with an anchor."""
        anchor = self.anchor
        if anchor is None or not (self.is_untouched or anchor.serves(old, scene)):
            anchor = Anchor(old, self.tile_spp)
        affected = anchor.affected(scene)
        none = np.zeros_like(self.drawn)
        # Index first_sample - 1 is that of an exploration.
        other = replace(
            self,
            first_sample=self.first_sample + int(self.drawn.max()) + 1,
            drawn=none,
            kept=none,
            stale=self._stale_after(scene, changed),
        )
        if anchor.looks_like(scene):  # The scene is that of the anchor again, and its picture is there.
            other = replace(other, kept=anchor.worth, anchor=None)
            return other.entering(Mode.REFINE, scene, film)
        return replace(other, anchor=anchor).entering(Mode.INCREMENTAL, scene, film, affected, pixel)

    def _stale_after(self, scene: Scene, changed: tuple[Placed, ...]) -> BoolArray | None:
        """`stale` after an edit that affects the objects `changed`: auxiliary images show something else
        where these are seen, and nowhere else."""
        if not self.settings.has_aovs:
            return None
        stale = np.zeros(self.grid.count, np.bool_) if self.stale is None else self.stale.copy()
        stale[seen_tiles(self.grid, scene.camera, changed)] = True
        return stale

    @property
    def has_stale(self) -> bool:
        """Whether auxiliary images still show something of another scene."""
        return self.stale is not None and bool(self.stale.any())

    @property
    def is_untouched(self) -> bool:
        """Whether nothing was rendered of the queue after an edit."""
        return self.mode is Mode.INCREMENTAL and self.cursor == Cursor()

    def after_drag(
        self, since: Scene, scene: Scene, film: Measurements, pixel: tuple[float, float] | None = None
    ) -> Progress:
        """What follows from the end of a drag that made `scene` of `since`; see `Session.end_drag`."""
        if self.anchor is not None:  # Steps of the drag are worth as much as those after it.
            return self
        affected = _affected_locally(since, scene)
        mode = self._next_mode(Event.LOCAL_CHANGE)
        if mode is not Mode.INCREMENTAL or not affected:
            return self
        return self.entering(mode, scene, film, affected, pixel)

    def with_settings(self, settings: RenderSettings, scene: Scene, film: Measurements) -> Progress:
        """The same picture under other settings for the same grid. It starts over where samples change their
        meaning; a queue that has not begun gets the samples that the settings now ask for."""
        old, other = self.settings, replace(self, settings=settings)
        if self.anchor is not None and not strategy_of(settings).keeps_anchor:
            none = np.zeros_like(self.drawn)
            first = self.first_sample + int(self.drawn.max())
            other = replace(other, anchor=None, kept=self.tile_spp, drawn=none, first_sample=first)
            other = other.entering(Mode.REFINE, scene, film)
        if any(getattr(old, name) != getattr(settings, name) for name in PICTURE_SETTINGS):
            return other.entering(Mode.BASE, scene, film)
        if self.cursor == Cursor() and other.anchor is None:
            return other.entering(self.mode, scene, film, order=self.queue.tiles)
        return other

    def entering(
        self,
        mode: Mode,
        scene: Scene,
        film: Measurements,
        affected: tuple[Placed, ...] = (),
        pixel: tuple[float, float] | None = None,
        order: IntArray | None = None,
    ) -> Progress:
        """The beginning of a mode, with the queue that the strategy plans for it; `order` keeps an order that
        is there already."""
        begun = self
        if mode is Mode.BASE:
            none = np.zeros_like(self.drawn)
            begun = replace(self, drawn=none, first_sample=0, kept=none, anchor=None, stale=None)
        situation = Situation(
            mode,
            self.settings,
            self.grid,
            scene,
            begun.drawn + begun.kept,
            film,
            affected,
            pixel,
            self.queue,
            begun.drawn,
            begun.anchor is not None,
            begun.stale,
            self.cursor,
        )
        queue = strategy_of(self.settings).queue(situation, order)
        return replace(begun, mode=mode, queue=queue, cursor=Cursor())

    def _next_mode(self, event: Event) -> Mode:
        return next_mode(self.mode, event, strategy_of(self.settings))


def _affected_locally(since: Scene, scene: Scene) -> tuple[Placed, ...]:
    """What looks different since a scene; nothing where everything does."""
    change = diff(since, scene)
    return () if change.is_global else tuple(affected_objects(since, scene, change))
