"""A session: one scene, rendered step by step, edited at any time.

`step` does one bounded piece of work and returns; the caller owns the loop. Editor, command line, tests
and benchmarks share it. What to do next follows from `Progress`, a value; the session carries it out on the
device.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import NoneType

import numpy as np
import numpy.typing as npt

from incpt.core.affine import Vector
from incpt.core.checks import pair, require, require_bool, require_call, whole
from incpt.core.errors import InputError
from incpt.core.layout import Counter
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render import first_hits, tiles
from incpt.render.batch import Batch
from incpt.render.film import RADIANCE, Film, tile_image
from incpt.render.first_hits import FirstHits
from incpt.render.impact.comparison import Comparison, Prepared, compared
from incpt.render.impact.target import Target
from incpt.render.impact.tile_sums import TileSums
from incpt.render.modes import Mode
from incpt.render.params import path_params
from incpt.render.path_buffer import PathBuffer, slots_of
from incpt.render.plan import Cursor, Queue
from incpt.render.progress import Progress
from incpt.render.strategies import passes_of, strategy_of
from incpt.render.strategy import Step
from incpt.render.tracer import tracer_of
from incpt.scene.change import Change, diff
from incpt.scene.model import Scene
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import SceneTables, tables_of

_PIXEL = "a pixel (x, y)"


@dataclass(frozen=True)
class StepReport:
    """What a step did: its mode, the tiles it finished, the place in the queue after it (in tiles), the
    paths it traced of the scene as it is now (those past the image's edge included) and of the scene that it
    is compared with (their partners), its duration in seconds, how many samples were not finite (they count
    as black), how many of `paths` ended because `transmission_bounces` was used up though they still carried
    something, which is lost, and whether the picture shows anything of it."""

    mode: Mode
    tiles: npt.NDArray[np.int32]
    queue_done: int
    queue_length: int
    paths: int
    partners: int
    seconds: float
    nonfinite: int
    cut_off: int
    is_shown: bool


@dataclass(frozen=True, eq=False)
class Measured:
    """What strategies may read of a film, and of the scene that it is compared with; see
    `strategy.Measurements`."""

    film: Film
    comparison: Comparison | None = None

    def sums(self) -> Mapping[str, npt.NDArray[np.float32]]:
        return self.film.sums()

    def tile_sums(self) -> TileSums | None:
        return None if self.comparison is None else self.comparison.tile_sums(self.film)


@dataclass(frozen=True, eq=False)
class SessionState:
    """All of a session that changes. An edit makes another one, which is put in
    its place once all that can fail is done."""

    progress: Progress
    film: Film
    path_buffer: PathBuffer
    tables: SceneTables
    comparison: Comparison | None = None
    prepared: Prepared | None = None
    """What the next comparison can use, where there is none."""

    @property
    def measured(self) -> Measured:
        """What strategies may read of it."""
        return Measured(self.film, self.comparison)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A picture on the host and where its session stood; see `Session.snapshot`. `sums` is what the film
    held, as `Film.sums` returns it; `target`: what the picture of an edited scene starts from, if it is not
    in them."""

    scene: Scene
    progress: Progress
    sums: Mapping[str, npt.NDArray[np.float32]]
    target: Target | None = None


class Session:
    """Renders `scene` at `size` (width, height; the settings' by default) with `settings` (the scene's own
    by default) on `device` (a Device, or what chooses one: see `Device`).

    Raises InputError for a device that is not there or a step that is too large, DeviceError where the
    device cannot do the work.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] | None = None,
        settings: RenderSettings | None = None,
        device: Device | str | int | None = None,
    ) -> None:
        require("scene", scene, Scene, "a Scene; load() reads one")
        require("settings", settings, (RenderSettings, NoneType), "RenderSettings")
        settings = scene.settings if settings is None else settings
        settings = settings if size is None else replace(settings, size=size)
        scene = _limited(scene, settings)
        self.device = device if isinstance(device, Device) else Device(device)
        self._tracer = tracer_of(self.device)
        tables = tables_of(GeometryPool.of(self.device), scene)
        film = _new_film(self.device, settings)
        path_buffer = PathBuffer.of_settings(self.device, settings, None)
        self._state = SessionState(Progress.start(settings, scene, Measured(film)), film, path_buffer, tables)
        self._ahead: tuple[tuple[str, ...], deque[Callable[[], None]]] | None = None
        """What `prepare_edit` has begun: the kernels, and what builds those that are left."""

    @property
    def scene(self) -> Scene:
        return self._state.tables.scene

    @property
    def progress(self) -> Progress:
        """Where the rendering stands."""
        return self._state.progress

    @property
    def settings(self) -> RenderSettings:
        return self.progress.settings

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image, pixels."""
        return self.settings.size

    @property
    def mode(self) -> Mode:
        return self.progress.mode

    @property
    def grid(self) -> tiles.TileGrid:
        return self.progress.grid

    @property
    def queue(self) -> Queue:
        """The tiles that the current mode goes through, in order."""
        return self.progress.queue

    @property
    def cursor(self) -> Cursor:
        """How far the queue is done."""
        return self.progress.cursor

    @property
    def tile_spp(self) -> npt.NDArray[np.int64]:
        """(count,) samples behind each tile; 0 where the old picture waits to be thrown away. It cannot be
        written to; a step puts another array in its place."""
        return self.progress.tile_spp

    def step(self, slots: int | None = None) -> StepReport:
        """Render one step, at most to the end of the queue: `slots` of tile_size^2 paths each (fewer where
        memory does not suffice), or as many as the settings say."""
        if slots is not None:
            slots = whole("slots", slots, 1)
        start = time.perf_counter()
        before, film, path_buffer = self.progress, self._state.film, self._state.path_buffer
        settings = before.settings
        if slots is not None:
            path_buffer = path_buffer.grown(self.device, slots, settings.tile_size)
            slots = max(1, min(slots, path_buffer.room(settings.tile_size)))
        plan = before.planned(slots_of(settings) if slots is None else slots)
        comparison = self._state.comparison
        path_buffer = path_buffer if comparison is None else path_buffer.with_pairs(self.device)
        batch = self._batch(plan.slots, path_buffer)
        step = Step(self._tracer, batch, plan, comparison, path_buffer.pairs)
        partners = strategy_of(settings).render(step, film)
        counted = film.take_counters()
        progress = before.after_step(plan, self.scene, self._state.measured)
        self._state = replace(self._state, progress=progress, path_buffer=path_buffer)
        seconds = time.perf_counter() - start
        done, length = plan.cursor.tiles, len(before.queue.tiles)
        return StepReport(
            mode=before.mode,
            tiles=plan.finished,
            queue_done=done,
            queue_length=length,
            paths=batch.path_count,
            partners=partners,
            seconds=seconds,
            nonfinite=counted[Counter.NONFINITE],
            cut_off=counted[Counter.CUT_OFF],
            is_shown=comparison is not None or len(plan.finished) > 0,
        )

    def edit(
        self,
        scene: Scene,
        pixel: tuple[float, float] | None = None,
        since: Scene | None = None,
        settings: RenderSettings | None = None,
    ) -> Change:
        """Go on with another scene; returns what differs. `pixel` is the point of change where the settings
        ask for it, as (x, y) from the top left. `settings` are those from now on, as for `configure`. On an
        error the old scene and the picture stay.

        `since` is the scene before a drag of which this edit is one step: the point of change then takes
        in where the object was before the drag. `end_drag` ends it.
        """
        require("scene", scene, Scene, "a Scene")
        require("since", since, (Scene, NoneType), "a Scene")
        pixel = _point(pixel)
        state = self._state if settings is None else self._configured(settings)
        scene = _limited(scene, state.progress.settings)
        change = diff(self.scene, scene)
        progress = state.progress.after_edit(self.scene, scene, change, state.measured, since, pixel)
        self._state = self._brought(state, progress, scene)
        return change

    def end_drag(self, since: Scene, pixel: tuple[float, float] | None = None) -> None:
        """End a drag that began with the scene `since`: what it changed is rendered anew, in the order and as
        often as the strategy and the settings say by now. Nothing happens where the picture started over.
        `pixel` is that of `edit`."""
        require("since", since, Scene, "a Scene")
        progress = self.progress.after_drag(since, self.scene, self._state.measured, _point(pixel))
        self._state = self._brought(self._state, progress, self.scene)

    def restart(self) -> None:
        """Throw away what was accumulated; the picture stands until it is rendered anew."""
        progress = self.progress.entering(Mode.BASE, self.scene, self._state.measured)
        self._state = self._brought(self._state, progress, self.scene)

    def configure(self, settings: RenderSettings) -> None:
        """Render with other settings from now on. The picture starts over only if samples change meaning.
        On an error the old settings and the picture stay."""
        self._state = self._configured(settings)

    def render(self, spp: int, on_step: Callable[[StepReport], None] | None = None) -> None:
        """Step until every pixel shows the scene as it is now with at least `spp` samples."""
        spp = whole("spp", spp, 0)
        require_call("on_step", on_step)
        while self.mode is not Mode.REFINE or self.tile_spp.min() < spp or self.progress.has_stale:
            report = self.step()
            if on_step is not None:
                on_step(report)

    def snapshot(self) -> Snapshot:
        """Scene, settings and picture as they are now, for `restore`."""
        film, comparison = self._state.film, self._state.comparison
        # Nothing is in them.
        film = film if self.progress.anchor is not None else film.with_planes(())
        target = None if comparison is None else comparison.target
        return Snapshot(self.scene, self.progress, film.sums(), target)

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from where a session stood. A tile that was under way then starts again. On an error
        everything stays as it was."""
        require("snapshot", snapshot, Snapshot, "a Snapshot; Session.snapshot makes one")
        settings, cursor = snapshot.progress.settings, Cursor(snapshot.progress.cursor.tiles)
        planes = strategy_of(settings).planes if snapshot.progress.anchor is not None else ()
        film = _new_film(self.device, settings).with_planes(planes)
        film.restore(snapshot.sums)
        path_buffer = PathBuffer.of_settings(self.device, settings, self._state.path_buffer)
        progress = replace(snapshot.progress, cursor=cursor)
        tables, comparison = self._tables_for(progress, snapshot.scene, None, snapshot.target)
        self._state = SessionState(progress, film, path_buffer, tables, comparison, self._prepared)

    def image(self, alpha: bool = False, first_sight: bool = False) -> npt.NDArray[np.float32]:
        """(H, W, 3) mean radiance, linear; row 0 is on top. What is not rendered anew yet shows the old
        picture, at first black. With `alpha` (H, W, 4): 0 where there was never a picture of this size, and
        under the setting `transparent` the share of each pixel that is covered, by which its radiance is
        multiplied already. With `first_sight` what an edit moved is drawn at its new place, where no sample
        of it is there yet and the strategy compares scenes: a guess for whoever looks, from first hits and
        the old picture's light."""
        require_bool("alpha", alpha)
        require_bool("first_sight", first_sight)
        film, comparison, progress = self._state.film, self._state.comparison, self.progress
        image = strategy_of(self.settings).image(film, comparison)
        if first_sight and comparison is not None and progress.mode is Mode.INCREMENTAL:
            image = comparison.first_sight.drawn_into(image, film, self.grid, progress.drawn == 0)
        return image if alpha else np.ascontiguousarray(image[..., :3])

    def first_sight(self) -> npt.NDArray[np.float32] | None:
        """(H, W, 4) what `image` with `first_sight` shows before the first step after an edit, at once: no
        statistics are made. None where nothing can be drawn so, and once a step was done."""
        state = self._state
        if state.comparison is None or not self.progress.is_untouched:
            return None
        return state.comparison.first_sight.alone(state.film)

    def pass_image(self, name: str) -> npt.NDArray[np.float32]:
        """(H, W, channels) the picture of a pass of the film: "radiance" is `image`. With the setting `aovs`,
        "albedo" and "normal" (H, W, 3) are the mean base colour and the mean shading normal (world space) of
        what the samples of the picture met first, 0 for those that met nothing; "alpha" (H, W, 1) is the
        share of those that met a surface or a light. Distance and object have no
        mean: see `first_hits`. Raises InputError for a pass that there is not."""
        require("name", name, str, "the name of a pass")
        passes = {one.name: one for one in self._state.film.passes}
        if name not in passes:
            hint = "" if self.settings.has_aovs else "; the setting aovs adds albedo, normal and alpha"
            raise InputError(f"pass {name!r}: is not in the film; choose one of {', '.join(passes)}{hint}")
        if name == RADIANCE.name:
            return self.image()
        return np.ascontiguousarray(self._state.film.image(name)[..., :-1])

    def spp(self) -> npt.NDArray[np.int64]:
        """(H, W) samples behind each pixel; 0 where the old picture waits to be thrown away."""
        return tile_image(self.grid, self.tile_spp)

    def error_left(self) -> float | None:
        """How much of an edit is still to be found: the share of the visible error of the change that is
        left, 1 at the edit and 0 once the picture is as good as before it; as of the last round of samples
        that ended. `progress.findings` has more of it, tile by tile. None where it is not measured: under
        strategies that compare no scenes, and while the picture starts over. See
        incpt/render/impact/findings.py for what it is made of."""
        return self.progress.error_left

    def first_hits(
        self, size: tuple[int, int] | None = None, rows: tuple[int, int] | None = None
    ) -> FirstHits:
        """What the rays through pixel centres meet first in the scene as it is now, in a picture of the
        session's size or another; see FirstHits. `rows`: from the first of them up to the second only. The
        setting `aovs` has nothing to do with them: it asks for means over the samples of the picture, see
        `pass_image`. Raises InputError for a size that no picture has and for rows that are not in it."""
        size = self.size if size is None else replace(self.settings, size=size).size
        if rows is not None:
            rows = _rows(rows, size[1])
        window = None if rows is None else (0, rows[0], size[0], rows[1])
        return first_hits.first_hits(self._tracer, self._tables, self.settings, size, window)

    def pick(self, pixel: tuple[int, int]) -> str | None:
        """The name of the object or light under a pixel (x, y) from the top left, or None. Raises InputError
        outside the image."""
        width, height = self.size
        x, y = pair("pixel", pixel, _PIXEL)
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(f"pixel ({x:g}, {y:g}): is outside the image of {width} x {height}")
        return self.pick_point(((int(x) + 0.5) / width, (int(y) + 0.5) / height))

    def pick_point(self, point: tuple[float, float]) -> str | None:
        """The name of the object or light at a point (x, y) from the top left, in units of the image, or
        None: where there is none, and outside the image."""
        x, y = pair("point", point, "a place (x, y) in the image")
        if not (0 <= x <= 1 and 0 <= y <= 1):
            return None
        return first_hits.object_at(self._tracer, self._tables, self.settings, (x, y))

    def place_at(self, point: tuple[float, float]) -> Vector | None:
        """The place in world space of the surface at a point (x, y) from the top left, in units of the image,
        or None: where there is none, and outside the image."""
        x, y = pair("point", point, "a place (x, y) in the image")
        if not (0 <= x <= 1 and 0 <= y <= 1):
            return None
        return first_hits.place_at(self._tracer, self._tables, self.settings, (x, y))

    def build(self, on_progress: Callable[[int, int], None] | None = None, for_edits: bool = True) -> None:
        """Build every kernel that the scene as it is now needs, so that no later call has to wait for one;
        without `for_edits` all but those that wait for a local edit: see `prepare_edit`. `on_progress` is
        called with how many of how many steps are done; not at all if nothing is to do. What it raises ends
        the building, which may go on later."""
        require_call("on_progress", on_progress)
        require_bool("for_edits", for_edits)
        built = self.device.built
        parts = [(self._of_pictures, self._picture_launches)]
        if for_edits or self._state.comparison is not None:
            parts.append((self._of_edits, self._edit_launches))
        todo = [(kernels, launches()) for kernels, launches in parts if kernels not in built]
        done, total = 0, sum(len(launches) for _, launches in todo)
        for kernels, launches in todo:
            for launch in launches:
                launch()
                self.device.finish()
                done += 1
                if on_progress is not None:
                    on_progress(done, total)
            built.add(kernels)

    def prepare_edit(self) -> bool:
        """Do a piece of what the next local edit would have to wait for, so that a picture can be there
        before all of it is: build a kernel, make memory, look at the scene. Returns whether more is left.
        Raises DeviceError where memory runs out."""
        state, strategy = self._state, strategy_of(self.settings)
        if self._build_ahead():
            return True
        if not strategy.keeps_anchor or state.comparison is not None:
            return False
        if not state.film.has_planes(strategy.planes):
            film, path_buffer = state.film.with_planes(strategy.planes), state.path_buffer
            self._state = replace(state, film=film, path_buffer=path_buffer.with_pairs(self.device))
            return True
        prepared = Prepared.of(self.device, self.size, state.prepared)
        if prepared is state.prepared and not prepared.has_hits(self.scene):
            prepared = prepared.with_hits(self._tracer, self._tables, self.settings)
        self._state = replace(state, prepared=prepared)
        return not prepared.has_hits(self.scene)

    def _build_ahead(self) -> bool:
        """Build one of the kernels that wait for a local edit, if there is one."""
        kernels = self._of_edits
        if kernels in self.device.built:
            return False
        if self._ahead is None or self._ahead[0] != kernels:
            self._ahead = kernels, deque(self._edit_launches())
        launches = self._ahead[1]
        if launches:
            launches.popleft()()
            self.device.finish()
            return True
        self.device.built.add(kernels)
        self._ahead = None
        return False

    @property
    def _of_pictures(self) -> tuple[str, ...]:
        """What tells the kernels that pictures need from those of other scenes and settings."""
        clamps = ("CLAMP_INDIRECT",) if self.settings.clamp_indirect > 0 else ()
        return (*self._tables.variant, *clamps, *map(str, passes_of(self.settings)))

    @property
    def _of_edits(self) -> tuple[str, ...]:
        """As `_of_pictures`, of what local edits need beside."""
        return (*self._of_pictures, self.settings.strategy)

    def _picture_launches(self) -> list[Callable[[], None]]:
        batch = self._batch(first_hits.one_slot(), self._state.path_buffer)
        return [
            *self._tracer.idle_launches(batch),
            *self._state.film.idle_launches(batch.params, batch.path_buffer),
        ]

    def _edit_launches(self) -> list[Callable[[], None]]:
        batch = self._batch(first_hits.one_slot(), self._state.path_buffer)
        return strategy_of(self.settings).idle_launches(self._tracer, batch, self._state.film)

    @property
    def _tables(self) -> SceneTables:
        return self._state.tables

    def _brought(self, state: SessionState, progress: Progress, scene: Scene) -> SessionState:
        """`state` after an edit that leads to `progress`. What can fail comes before the film changes."""
        before, strategy = state.progress, strategy_of(progress.settings)
        target = _target_after(state, progress, scene)
        tables, comparison = self._tables_for(progress, scene, state.comparison, target)
        # Memory for pairs is made with the first edit, since many pictures never see one.
        is_needed = progress.anchor is not None or state.film.has_planes(strategy.planes)
        film = state.film.with_planes(strategy.planes if is_needed else ())
        # Where the scene is that of the anchor again, the anchor's picture is better than the one found.
        anchor = before.anchor if progress.anchor is not before.anchor else None
        if anchor is not None and state.comparison is not None and anchor.affected(scene):
            strategy_of(before.settings).fold(state.film, state.comparison)
        if progress.anchor is not None and progress.first_sample != before.first_sample:
            strategy.begin(film)
        return replace(
            state,
            progress=progress,
            film=film,
            tables=tables,
            comparison=comparison,
            prepared=self._prepared if strategy.keeps_anchor else None,
        )

    def _tables_for(
        self, progress: Progress, scene: Scene, before: Comparison | None, target: Target | None = None
    ) -> tuple[SceneTables, Comparison | None]:
        """The tables of a scene, which share what they can with those of this one, and what compares it with
        its anchor; `before`: what compared the scene before it, `target`: what the picture starts from."""
        pool = self._tables.pool
        if progress.anchor is None:
            return tables_of(pool, scene, self._tables), None
        comparison = compared(
            self._tracer,
            progress.settings,
            progress.anchor,
            scene,
            self._tables,
            before,
            self._prepared,
            target,
        )
        return comparison.tables, comparison

    @property
    def _prepared(self) -> Prepared | None:
        """What the next comparison can use of what is there."""
        comparison = self._state.comparison
        return self._state.prepared if comparison is None else comparison.prepared

    def _configured(self, settings: RenderSettings) -> SessionState:
        """The state under other settings."""
        require("settings", settings, RenderSettings, "RenderSettings")
        state, old, scene = self._state, self.settings, _limited(self.scene, settings)
        # Memory that a step took beyond the settings goes back with settings that need less.
        keeps_memory = slots_of(settings) * settings.tile_size**2 >= slots_of(old) * old.tile_size**2
        path_buffer = PathBuffer.of_settings(
            self.device, settings, state.path_buffer if keeps_memory else None
        )
        passes = passes_of(settings)
        if (old.size, old.tile_size, state.film.passes) != (settings.size, settings.tile_size, passes):
            film = _new_film(self.device, settings)
            tables = tables_of(self._tables.pool, scene, self._tables)
            return SessionState(Progress.start(settings, scene, Measured(film)), film, path_buffer, tables)
        progress = state.progress.with_settings(settings, scene, state.measured)
        return replace(self._brought(state, progress, scene), path_buffer=path_buffer)

    def _batch(self, slots: npt.NDArray[np.void], path_buffer: PathBuffer) -> Batch:
        """All paths of these slots (layout.SLOT), in the scene as it is now."""
        settings = self.settings
        params = path_params(self._tables, settings)
        params["buffer_stride"] = path_buffer.stride
        paths, filled = len(slots) * settings.tile_size**2, self.device.upload(slots)
        floats, counters = path_buffer.floats, self._state.film.counters
        return Batch(self._tables, params, filled, paths, floats, counters, settings.has_aovs)


def _point(pixel: tuple[float, float] | None) -> tuple[float, float] | None:
    return None if pixel is None else pair("pixel", pixel, _PIXEL)


def _rows(rows: tuple[int, int], height: int) -> tuple[int, int]:
    top, bottom = pair("rows", rows, "a pair of rows, such as (0, 100)")
    if not 0 <= top < bottom <= height or top % 1 or bottom % 1:
        raise InputError(f"rows: {top:g} to {bottom:g} are no rows of {height}; name one at least")
    return int(top), int(bottom)


def _limited(scene: Scene, settings: RenderSettings) -> Scene:
    """The scene with the settings' limit of textures, which tables take from it."""
    if scene.settings.texture_limit == settings.texture_limit:
        return scene
    return replace(scene, settings=replace(scene.settings, texture_limit=settings.texture_limit))


def _new_film(device: Device, settings: RenderSettings) -> Film:
    return Film(device, *settings.size, passes_of(settings), is_transparent=settings.transparent)


def _target_after(state: SessionState, progress: Progress, scene: Scene) -> Target | None:
    """What the picture of `scene` starts from after `state`, if not from the kept one."""
    comparison, left = state.comparison, state.progress.error_left
    if comparison is None or progress.anchor is not state.progress.anchor:
        return None
    if left is None or state.progress.is_untouched or comparison.tables.scene is scene:
        return comparison.target
    return comparison.target_after(state.film, left)
