"""One session, kept at the view that somebody wants to see: edits, resolution, and the length of steps.

`live` has one of these, and a second one beside it in a split view.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from incpt.core.settings import PICTURE_SETTINGS, RenderSettings
from incpt.device.device import Device
from incpt.picture.metrics import normalized_rmse
from incpt.render.modes import Event, Mode, next_mode
from incpt.render.path_buffer import check_settings
from incpt.render.session import Session, StepReport
from incpt.render.strategies import STRATEGIES_BY_NAME
from incpt.scene.change import affected_objects, diff
from incpt.viewer.pace import Pace, TileCosts
from incpt.viewer.view import Float32Image, Picture, View

REST_SECONDS = 0.15
"""Without a change for so long the view rests."""
LONGEST_WAIT = 0.5
"""How long an edit waits for an answer to the one before it, where neither belongs to a drag; seconds."""
ERROR_SECONDS = 0.5
"""Between two comparisons with the reference."""
REFINE_IMAGE_SECONDS = 0.1
"""Between two pictures while nothing but noise changes."""
SETTLED_SPP = 64
"""Samples per pixel from which on pictures come less often still: noise hardly changes."""
FIRST_SHARE = 0.5
"""Of the time of a step, for those up to the first tile after an edit."""
COARSEST = 16
"""The largest divisor of the resolution while everything starts over."""


class Side:
    """One session, brought to a view and stepped by Live. `strategy` overrides the settings' one."""

    def __init__(self, view: View, device: Device, strategy: str | None, clock: Callable[[], float]) -> None:
        self.view, self.strategy, self._clock = view, strategy, clock
        self._whole_pictures = Pace(1e6 if device.is_cpu else 5e7)
        self._pass_paths, self._pass_seconds = 0, 0.0
        self.divisor = 1
        self.divisor = self._fitting_divisor(view)
        self.session = Session(view.scene, settings=self._settings(view, self.divisor), device=device)
        self.changed_at = -math.inf
        """When the scene changed last; -inf: nobody waits for it to rest, at first and after a drag."""
        self.full_view = view if self.divisor == 1 else None
        """The last one that was rendered at full resolution."""
        self.spent = 0.0
        """Rendering time in all, to share the device fairly."""
        self._image: Float32Image | None = None
        self._read_at = -math.inf
        self._error: float | None = None
        self._compared_at = -math.inf
        self._compared: Float32Image | None = None
        self._costs_grid, self._costs = self.session.grid, TileCosts(self.session.grid.count)
        self._begin()

    def _begin(self) -> None:
        self.seconds, self.nonfinite, self.answered = 0.0, 0, False
        self._pass_paths, self._pass_seconds = 0, 0.0
        self._forget_tiles()

    def _forget_tiles(self) -> None:
        self._replaced = np.zeros(self.session.grid.count, np.bool_)
        self._must_read, self._is_stale = True, True

    # ------------------------------------------------------------------------------------ changes

    def shows(self, view: View) -> bool:
        """Whether nothing is to do to get to that view."""
        mine = self.view
        return mine is view or (
            (mine.scene is view.scene or mine.scene == view.scene)
            and (mine.before is view.before or mine.before == view.before)
            and mine.size == view.size
        )

    def may_change(self, view: View) -> bool:
        """Whether the last change has been answered, or is not worth to wait for."""
        is_dragged = self.view.before is not None or view.before is not None
        return self.answered or not is_dragged and self._clock() - self.changed_at > LONGEST_WAIT

    def change(self, view: View, with_preview: bool) -> None:
        """Go on with another view. On an error everything stays as it was."""
        old, session = self.view, self.session
        starts_over = self._starts_over(view)
        divisor = self._fitting_divisor(view) if starts_over and with_preview else self.divisor
        settings = self._settings(view, divisor)
        if divisor > 1:
            check_settings(self._settings(view, 1))
        since = view.before
        if since is None and settings.nor > session.settings.nor:
            since = old.before
        pixel = None
        if view.point is not None:
            pixel = (view.point[0] * settings.size[0], view.point[1] * settings.size[1])
        grid, queue = session.grid, session.queue
        since = since if divisor == 1 else None
        session.edit(view.scene, pixel, since, settings)
        if since is not None and view.before is None and session.queue.tiles is queue.tiles:
            session.end_drag(since, pixel)
        if divisor > 1 and session.mode is Mode.INCREMENTAL:
            session.restart()
        self.view, self.divisor = view, divisor
        if divisor == 1:
            self.full_view = view
        if session.grid != grid or (session.queue is not queue and session.mode is not Mode.REFINE):
            self.changed_at = self._clock()
            self._begin()
        if view.before is None and old.before is not None:
            self.changed_at = -math.inf

    @property
    def rests(self) -> bool:
        """Whether nothing has changed for a while, or the drag has ended."""
        return self._clock() - self.changed_at >= REST_SECONDS

    def restart(self) -> None:
        """Throw away what was accumulated."""
        self.session.restart()
        self._begin()

    def return_to_full(self) -> None:
        """Render at the full resolution from now on."""
        self.session.configure(self._settings(self.view, 1))
        self.divisor = 1
        self.full_view = self.view
        self._pass_paths, self._pass_seconds = 0, 0.0
        self._forget_tiles()

    def _starts_over(self, view: View) -> bool:
        """Whether nothing of the picture can be kept."""
        session, settings = self.session, view.scene.settings
        if self.divisor > 1 or self.view.size != view.size:
            return True
        if any(
            getattr(session.settings, n) != getattr(settings, n) for n in (*PICTURE_SETTINGS, "tile_size")
        ):
            return True
        change = diff(session.scene, view.scene)
        if change.is_global:
            return True
        is_local = bool(affected_objects(session.scene, view.scene, change))
        strategy = STRATEGIES_BY_NAME[self.strategy or settings.strategy]
        return is_local and next_mode(session.mode, Event.LOCAL_CHANGE, strategy) is Mode.BASE

    def _settings(self, view: View, divisor: int) -> RenderSettings:
        """The view's settings with the resolution divided by `divisor`; `step` chooses the slots."""
        settings, (width, height) = view.scene.settings, view.size
        nor = settings.nor
        if view.before is not None:
            # A tile is to fit a step, also where tiles are large.
            per_tile = settings.tile_size**2 * settings.sample_rate
            fitting = int(self._whole_pictures.speed * view.step_ms / 1e3 / per_tile)
            nor = min(nor, view.drag_nor, max(fitting, 1))
        size = -(-width // divisor), -(-height // divisor)
        strategy = self.strategy or settings.strategy
        settings = replace(settings, size=size, nor=nor, strategy=strategy, slots_per_step=1)
        if divisor == 1:
            return settings
        tile_size = min(settings.tile_size, RenderSettings.tile_size)
        return replace(settings, tile_size=tile_size, base_nor=1, sample_rate=1)

    def _fitting_divisor(self, view: View) -> int:
        """The least power of two with which a whole picture fits a step; it stays as it is within bounds, so
        that the resolution does not flicker."""
        width, height = view.size
        settings = view.scene.settings
        paths = width * height * settings.base_nor * settings.sample_rate
        share = paths / self._whole_pictures.speed / (view.step_ms / 1e3)
        if share <= 1.4:
            return 1
        # From here on one path per pixel.
        share = width * height / self._whole_pictures.speed / (view.step_ms / 1e3)
        divisor = max(self.divisor, 2)
        while divisor < COARSEST and share / divisor**2 > 1.4:
            divisor *= 2
        while divisor > 2 and share / (divisor // 2) ** 2 < 0.8:
            divisor //= 2
        return divisor

    # ------------------------------------------------------------------------------------ steps

    def is_done(self, target_spp: int | None) -> bool:
        """Whether every pixel has so many samples of the scene as it is now."""
        return (
            target_spp is not None
            and self.divisor == 1
            and self.session.mode is Mode.REFINE
            and int(self.session.tile_spp.min()) >= target_spp
        )

    def step(self, step_ms: float) -> StepReport:
        """One step of about that length; a shorter one where an edit waits for its first tile."""
        session = self.session
        if not self.answered and session.mode is Mode.INCREMENTAL:
            step_ms *= FIRST_SHARE
        slots, queue, first = self._slots(step_ms / 1e3), session.queue, session.cursor.tiles
        start = self._clock()
        report = session.step(slots)
        seconds = max(self._clock() - start, 1e-6)
        if self.divisor == 1:
            touched = queue.tiles[first : report.queue_done + 1]
            self._costs.add(touched, report.paths, seconds)
        self.seconds += seconds
        self.spent += seconds
        self.nonfinite += report.nonfinite
        self._replaced[report.tiles] = True
        if len(report.tiles):
            self._is_stale = True
        if report.mode is Mode.BASE:
            self._pass_paths += report.paths
            self._pass_seconds += seconds
        is_whole = report.queue_done == report.queue_length
        if report.mode is Mode.BASE and is_whole:
            self._whole_pictures.add(self._pass_paths, self._pass_seconds)
        if not self.answered and len(report.tiles) and (is_whole or report.mode is not Mode.BASE):
            self.answered = self._must_read = True
        return replace(report, seconds=seconds)

    def _slots(self, seconds: float) -> int:
        """Slots of a step of that length. A little more ends the queue where only a little is left of it."""
        session = self.session
        cursor, queue, settings = session.cursor, session.queue, session.settings
        left = queue.slot_count - queue.slots_before(cursor)
        if self.divisor > 1 and session.mode is Mode.BASE:
            slots = left
        else:
            slots = self._known_costs().slots(
                queue, cursor, settings.tile_size**2, seconds, 1 / self._whole_pictures.speed
            )
        if left <= 1.3 * slots:
            slots = left
        most = self.view.scene.settings.slots_per_step
        return max(1, slots if most is None else min(slots, most * settings.sample_rate))

    def _known_costs(self) -> TileCosts:
        grid = self.session.grid
        if self.divisor > 1:
            return TileCosts(grid.count)
        if grid != self._costs_grid:
            self._costs_grid, self._costs = grid, TileCosts(grid.count)
        return self._costs

    # ------------------------------------------------------------------------------------ pictures

    def image(self, must_be_new: bool) -> Float32Image:
        """(h, w, 4) the picture, read anew where that is worth it."""
        if self._image is None or (
            self._is_stale
            and (must_be_new or self._must_read or self._clock() - self._read_at >= self._image_seconds())
        ):
            self._image = self.session.image(alpha=True)
            self._read_at, self._must_read, self._is_stale = self._clock(), False, False
        return self._image

    def picture(self, reference: Float32Image | None, resting: bool) -> Picture:
        """What there is to show."""
        session, image = self.session, self.image(resting)
        self._compare(image, reference, resting)
        return Picture(
            image=image,
            grid=session.grid,
            mode=session.mode,
            queue=session.queue.tiles,
            queue_done=session.cursor.tiles,
            tile_spp=session.tile_spp.copy(),
            replaced=self._replaced.copy(),
            seconds=self.seconds,
            error=self._error,
            strategy=session.settings.strategy,
        )

    def _image_seconds(self) -> float:
        """Between two pictures: where only noise changes, few are enough."""
        if self.session.mode is not Mode.REFINE or self.divisor > 1:
            return 0.0
        is_settled = int(self.session.tile_spp.min()) >= SETTLED_SPP
        return REFINE_IMAGE_SECONDS * (3 if is_settled else 1)

    def _compare(self, image: Float32Image, reference: Float32Image | None, resting: bool) -> None:
        if reference is None or reference.shape[:2] != image.shape[:2]:
            self._error = None
            return
        now = self._clock()
        is_due = resting or now - self._compared_at >= ERROR_SECONDS
        if self._error is None or (image is not self._compared and is_due):
            self._error = normalized_rmse(image[..., :3], reference)
            self._compared, self._compared_at = image, now
