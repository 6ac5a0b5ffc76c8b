"""What a viewer sees while the scene is edited, and how rendering stays responsive.

A viewer hands in what it wants to see, a `View`, and calls `advance` over and over; each call does one
bounded piece of work and returns the `Frame` to show. There is no thread in here and nothing waits.

- A step takes about the time that the view asks for: its slots follow from what the same tiles took before.
- Between two steps only the latest view counts. An edit is taken up once the one before it has been answered
  by a finished tile (or, where everything starts over, by a whole picture), because otherwise a drag that is
  faster than a tile would never show anything.
- During a drag tiles are repeated less often, so that the region of the object follows soon. When it ends,
  the spiral starts anew with the NoR of the settings.
- Where a change makes the picture start over, and a whole picture does not fit a step, it is first rendered
  with a half, a quarter ... of the pixels a side, until the view rests.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from statistics import median

import numpy as np
import numpy.typing as npt

from incpt import tiles
from incpt.device import Device
from incpt.errors import DeviceError, InputError
from incpt.export import write_picture
from incpt.metrics import normalized_rmse
from incpt.modes import Event, Mode, next_mode
from incpt.scene import Scene, diff
from incpt.session import PICTURE_SETTINGS, Aovs, Session, StepReport, affected_objects, check_settings
from incpt.settings import RenderSettings

Float32Image = npt.NDArray[np.float32]

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
MOST_AHEAD = 2
"""Steps that the answer to an edit may cost the other side of a split view in advance."""
AOV_SHARE = 0.2
"""Of the time of a step, for first-hit images."""
MOST_BELIEVED = 4.0
"""How many times slower or faster a tile may become from one step to the next."""
FIRST_SHARE = 0.5
"""Of the time of a step, for those up to the first tile after an edit."""
COARSEST = 16
"""The largest divisor of the resolution while everything starts over."""


class RenderingStoppedError(DeviceError):
    """A step failed, as opposed to an edit: the device can do no more."""


@dataclass(frozen=True)
class View:
    """What a viewer wants to see; handing in an equal one again does nothing.

    scene             its settings say how to render.
    before            the scene before the drag of which `scene` is one step; None: no drag is under way.
    point             clicked last, (x, y) from the top left in units of the image.
    resolution_scale  the picture has the settings' size times this.
    target_spp        samples per pixel at which refining stops.
    step_ms           what a step aims at.
    drag_nor          the most repetitions of a tile while a drag is under way.
    split             also render under "restart", fed with the same edits.
    aovs              first-hit images are wanted.
    """

    scene: Scene
    before: Scene | None = None
    point: tuple[float, float] | None = None
    resolution_scale: float = 1.0
    paused: bool = False
    target_spp: int | None = None
    step_ms: float = 33.0
    drag_nor: int = 16
    split: bool = False
    aovs: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Width and height to render, pixels."""
        width, height = (max(1, round(side * self.resolution_scale)) for side in self.scene.settings.size)
        return width, height


@dataclass(frozen=True, eq=False)
class Picture:
    """One side.

    image       (h, w, 4) float32 mean radiance, linear, row 0 on top; alpha 0 where there is no sample of
                this size yet. The same array again in the next Frame where nothing new was read.
    queue       (n,) int32 tiles in order; `queue_done` of them are finished.
    tile_spp    (count,) int64 samples behind each tile.
    replaced    (count,) bool: tiles finished since the last change of the scene.
    seconds     rendering time since the last change of the scene.
    error       normalized RMSE against the pinned reference, or None.
    """

    image: Float32Image
    grid: tiles.TileGrid
    mode: Mode
    queue: npt.NDArray[np.int32]
    queue_done: int
    tile_spp: npt.NDArray[np.int64]
    replaced: npt.NDArray[np.bool_]
    seconds: float
    error: float | None
    strategy: str


@dataclass(frozen=True, eq=False)
class Frame:
    """What there is to show.

    view         what it shows.
    pictures     the one under the chosen strategy; with a split view that under "restart" before it.
    is_preview   rendered at a reduced resolution, because everything started over and the view does not rest.
    aovs         first-hit images of the view's size, or smaller while changes stream in.
    nonfinite    samples since the last change of the scene that were not finite and count as black.
    resting      paused, or the target is reached: nothing is under way.
    """

    view: View
    pictures: tuple[Picture, ...]
    is_preview: bool
    step_seconds: float
    paths_per_second: float
    device: str
    aovs: Aovs | None
    nonfinite: int
    resting: bool


class _Pace:
    """How fast something is, in paths per second: the median of the last three times, so that a single slow
    one changes nothing."""

    def __init__(self, guess: float) -> None:
        self._guess = guess
        self._speeds: deque[float] = deque(maxlen=3)

    @property
    def speed(self) -> float:
        return median(self._speeds) if self._speeds else self._guess

    def add(self, paths: int, seconds: float) -> None:
        self._speeds.append(paths / max(seconds, 1e-6))


class _Costs:
    """What a path of each tile takes, seconds. Speed differs tenfold between sky and glass, so that the last
    step says little about the next tiles, but the last pass much."""

    def __init__(self, count: int) -> None:
        self._seconds = np.full(count, np.nan)
        self._last = 0.0

    def add(self, touched: npt.NDArray[np.int32], paths: int, seconds: float) -> None:
        """Learn from a step. A stall of the machine is not believed at once, nor is one that is over."""
        old = self._seconds[touched]
        new = np.full(len(touched), seconds / paths)
        known = np.isfinite(old)
        new[known] = np.clip(new[known], old[known] / MOST_BELIEVED, old[known] * MOST_BELIEVED)
        self._seconds[touched] = new
        self._last = float(np.median(new))

    def slots(self, queue: tiles.Queue, cursor: tiles.Cursor, area: int, seconds: float, guess: float) -> int:
        """How many slots of `area` paths, from `cursor` on, take so long. `guess`: seconds of a path where
        there is no better knowledge."""
        guess = max(guess, self._last)
        longest = 4 + int(8 * seconds / (guess * area * queue.samples))
        ahead = self._seconds[queue.tiles[cursor.tiles : cursor.tiles + longest]]
        per_slot = np.where(np.isfinite(ahead), ahead, guess) * area
        ends = np.cumsum(per_slot * queue.samples) - per_slot[0] * cursor.samples
        whole = int(np.searchsorted(ends, seconds, side="right"))
        if whole == len(ahead):
            return whole * queue.samples - cursor.samples
        begin = ends[whole] - per_slot[whole] * queue.samples
        return whole * queue.samples - cursor.samples + int((seconds - begin) / per_slot[whole])


class _Side:
    """One session, brought to a view and stepped by Live. `strategy` overrides the settings' one."""

    def __init__(self, view: View, device: Device, strategy: str | None, clock: Callable[[], float]) -> None:
        self.view, self.strategy, self._clock = view, strategy, clock
        self._whole_pictures = _Pace(1e6 if device.is_cpu else 5e7)
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
        self._costs_grid, self._costs = self.session.grid, _Costs(self.session.grid.count)
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
        session.edit(view.scene, pixel, since if divisor == 1 else None, settings)
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
        strategy = self.strategy or settings.strategy
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
        left = len(queue.tiles) * queue.samples - cursor.tiles * queue.samples - cursor.samples
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

    def _known_costs(self) -> _Costs:
        grid = self.session.grid
        if self.divisor > 1:
            return _Costs(grid.count)
        if grid != self._costs_grid:
            self._costs_grid, self._costs = grid, _Costs(grid.count)
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


class Live:
    """Renders what a viewer wants to see on `device` (a Device, or what chooses one).

    `on_build` is called with (done, total) while kernels are built, here and after an edit that needs others;
    what it raises comes through. `clock` gives seconds. Raises InputError and DeviceError as Session does.
    """

    def __init__(
        self,
        view: View,
        device: Device | str | int | None = None,
        on_build: Callable[[int, int], None] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device = device if isinstance(device, Device) else Device(device)
        self._on_build, self._clock = on_build, clock
        self._view = view
        self._refused: View | None = None
        self._main = _Side(view, self.device, None, clock)
        self._restarting: _Side | None = None
        self._reference: Float32Image | None = None
        self._is_pinning = False
        self._aovs: Aovs | None = None
        self._aovs_of: tuple[object, ...] | None = None
        self._aovs_wanted: tuple[object, ...] | None = None
        self._bands: list[Aovs] = []
        self._aov_pace = _Pace(5e6 if self.device.is_cpu else 5e8)
        self._rest_is_shown = False
        self._step_seconds, self._speed = 0.0, 0.0
        self._main.session.build(on_build)

    @property
    def session(self) -> Session:
        """That of the chosen strategy; to look at."""
        return self._main.session

    def advance(self, view: View) -> Frame | None:
        """Do one bounded piece of work towards `view` and return what there is to show; None: nothing to do,
        and nothing new.

        What an edit or a setting raises (InputError, DeviceError, MemoryError) comes through once for a view;
        the last good one is rendered on. RenderingStoppedError: a step failed, nothing can go on.
        """
        self._follow(view)
        try:
            side = self._next_side()
            if side is not None:
                self._step(side)
            elif self._rest_is_shown:
                return None
            has_aovs = not self._view.aovs or ((self._main.answered or side is None) and self._update_aovs())
            self._rest_is_shown = side is None and has_aovs
            return self._frame(resting=self._rest_is_shown)
        except (DeviceError, MemoryError) as error:
            raise RenderingStoppedError(_explain(error)) from error

    def pick(self, point: tuple[float, float]) -> str | None:
        """The name of the object at a point (x, y) from the top left in units of the image, or None."""
        x, y = point
        return self.session.pick_point((x, y)) if 0 <= x < 1 and 0 <= y < 1 else None

    def restart(self) -> None:
        """Throw away what was accumulated; the picture stands until it is rendered anew."""
        for side in self._sides:
            side.restart()
        self._rest_is_shown = False

    def pin_reference(self, on: bool) -> None:
        """Compare with the picture as it is now (with the next whole one of full resolution, where it is
        none), or no longer. The reference goes when the size changes."""
        self._reference, self._is_pinning = None, on
        self._rest_is_shown = False

    def export(self, path: str | Path, aovs: bool = False, exposure: float = 0.0, curve: str = "agx") -> None:
        """Write the picture of the chosen strategy at full resolution; see `write_picture`. Where it is not
        whole yet, that is done first."""
        if self._main.divisor > 1:
            self._main.return_to_full()
        while self.session.mode is Mode.BASE:
            self._main.step(self._view.step_ms)
        write_picture(Path(path), self.session, aovs, exposure, curve)

    # ------------------------------------------------------------------------------------ following the view

    @property
    def _sides(self) -> tuple[_Side, ...]:
        return (self._main,) if self._restarting is None else (self._restarting, self._main)

    def _follow(self, view: View) -> None:
        if view is self._view or view is self._refused or view == self._refused:
            view = self._view
        elif view != self._view:
            self._rest_is_shown = False
        good: View | None = self._main.view
        try:
            self._split(view)
            for side in self._sides:
                if not side.shows(view) and (view.paused or side.may_change(view)):
                    self._change(side, view)
            good = self._main.full_view
            for side in self._sides:
                if side.divisor > 1 and side.answered and side.rests and not view.paused:
                    side.return_to_full()
        except (InputError, DeviceError, MemoryError) as error:
            if good is None:
                raise RenderingStoppedError(_explain(error)) from error
            self._refused = view
            self._view = replace(
                view,
                scene=good.scene,
                before=good.before,
                resolution_scale=good.resolution_scale,
                split=self._restarting is not None,
            )
            raise
        self._view = view

    def _split(self, view: View) -> None:
        if not view.split:
            self._restarting = None
        elif self._restarting is None:
            side = _Side(view, self.device, "restart", self._clock)
            side.spent = self._main.spent
            self._restarting = side

    def _change(self, side: _Side, view: View) -> None:
        # Beside a picture that is kept, one that starts over is to be seen as it is.
        is_main = side is self._main
        side.change(view, not view.paused and (is_main or self._main.divisor > 1))
        side.session.build(self._on_build)
        height_width = view.size[::-1]
        if self._reference is not None and self._reference.shape[:2] != height_width:
            self._reference = None

    # ------------------------------------------------------------------------------------ work

    def _next_side(self) -> _Side | None:
        """Whose turn it is: equal time for both, and the answer to an edit first."""
        view = self._view
        if view.paused:
            return None
        waiting = [side for side in self._sides if not side.is_done(view.target_spp)]
        if not waiting:
            return None
        behind = min(waiting, key=lambda side: side.spent)
        ahead = self._main.spent - behind.spent
        is_urgent = self._main in waiting and not self._main.answered
        side = self._main if is_urgent and ahead < MOST_AHEAD * view.step_ms / 1e3 else behind
        for other in self._sides:
            if other not in waiting:
                other.spent = max(other.spent, side.spent)
        return side

    def _step(self, side: _Side) -> None:
        report = side.step(self._view.step_ms)
        if side is self._main:
            self._step_seconds = report.seconds
            speed = report.paths / report.seconds
            self._speed = speed if self._speed == 0 else 0.8 * self._speed + 0.2 * speed

    def _update_aovs(self) -> bool:
        """Some rows of the first hits of the scene that is shown; returns whether they are all there. While
        it changes there are fewer of them than pixels, so that they come at once and cost little."""
        main = self._main
        scene, (width, height) = main.view.scene, main.view.size
        rays = self._aov_pace.speed * self._view.step_ms / 1e3 * AOV_SHARE
        divisor = 1
        is_moving = not main.rests and not self._view.paused
        while is_moving and divisor < COARSEST and width * height / divisor**2 > rays:
            divisor *= 2
        width, height = -(-width // divisor), -(-height // divisor)
        wanted = (scene.camera, scene.objects, scene.materials, width, height)
        if wanted == self._aovs_of:
            return True
        if wanted != self._aovs_wanted:
            self._aovs_wanted, self._bands = wanted, []
        top = sum(len(band.depth) for band in self._bands)
        bottom = height if is_moving else min(top + max(1, int(rays / width)), height)
        start = self._clock()
        self._bands.append(self.session.aovs((width, height), (top, bottom)))
        self._aov_pace.add(width * (bottom - top), self._clock() - start)
        if bottom < height:
            return False
        self._aovs, self._aovs_of, self._bands = _joined(self._bands), wanted, []
        self._aovs_wanted = None
        return True

    def _frame(self, resting: bool) -> Frame:
        main, view = self._main, self._view
        if self._is_pinning and main.divisor == 1:
            image = main.image(must_be_new=True)
            if image[..., 3].min() > 0:
                self._reference, self._is_pinning = image[..., :3], False
        pictures = tuple(side.picture(self._reference, resting) for side in self._sides)
        if not main.shows(view):
            shown = main.view
            view = replace(
                view, scene=shown.scene, before=shown.before, resolution_scale=shown.resolution_scale
            )
        return Frame(
            view=view,
            pictures=pictures,
            is_preview=main.divisor > 1,
            step_seconds=self._step_seconds,
            paths_per_second=self._speed,
            device=self.device.name,
            aovs=self._aovs if self._view.aovs else None,
            nonfinite=sum(side.nonfinite for side in self._sides),
            resting=resting,
        )


def _joined(bands: list[Aovs]) -> Aovs:
    """First hits of rows that follow each other."""
    return Aovs(*(np.concatenate([getattr(band, f.name) for band in bands]) for f in fields(Aovs)))


def _explain(error: Exception) -> str:
    return str(error) or "memory ran out; use a smaller image or scene"
