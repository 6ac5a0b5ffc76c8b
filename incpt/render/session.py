"""A session: one scene, rendered step by step, edited at any time.

`step` does one bounded piece of work and returns; the caller owns the loop. Editor, command line, tests
and benchmarks share it. What to do next follows from the mode alone (see `modes`): the queue of tiles, how
often each is repeated, and whether a finished tile replaces or refines what the film has of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from incpt.core import layout, transform
from incpt.core.errors import DeviceError, InputError
from incpt.core.settings import PICTURE_SETTINGS, RenderSettings
from incpt.device.device import Device
from incpt.render import tiles
from incpt.render.film import Film, tile_image
from incpt.render.first_hits import Aovs
from incpt.render.modes import Event, Mode, next_mode
from incpt.render.plan import Cursor, Queue, counts_after, is_done, plan_step
from incpt.render.strategies import Situation, Strategy, strategy_of
from incpt.render.wavefront import Wavefront
from incpt.scene.change import Change, affected_objects, diff
from incpt.scene.model import Object, Scene
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import tables_of

# Kernels index the three planes of the path buffer with 32 bits.
_MOST_PATH_FLOATS = 1 << 32


@dataclass(frozen=True)
class StepReport:
    """What a step did: its mode, the tiles it finished, the place in the queue after it (in tiles), the
    paths it traced (those past the image's edge included), its duration in seconds, and how many samples were
    not finite (they count as black)."""

    mode: Mode
    tiles: npt.NDArray[np.int32]
    queue_done: int
    queue_length: int
    paths: int
    seconds: float
    nonfinite: int


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A picture on the host and where its session stood; see `Session.snapshot`. `sums` is what the film
    held, as `Film.sums` returns it."""

    scene: Scene
    settings: RenderSettings
    sums: Mapping[str, npt.NDArray[np.float32]]
    tile_spp: npt.NDArray[np.int64]
    mode: Mode
    queue: Queue
    cursor: Cursor


class Session:
    """Renders `scene` at `size` (width, height; the settings' by default) with `settings` (the scene's own
    by default) on `device` (a Device, or what chooses one: see `Device`).

    Raises InputError for a device that is not there or a step that is too large, DeviceError where the
    device cannot do the work.
    """

    _mode: Mode
    _queue: Queue
    _tile_spp: npt.NDArray[np.int64]

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] | None = None,
        settings: RenderSettings | None = None,
        device: Device | str | int | None = None,
    ) -> None:
        settings = scene.settings if settings is None else settings
        self.settings = settings if size is None else replace(settings, size=size)
        self.device = device if isinstance(device, Device) else Device(device)
        self._wavefront = Wavefront(self.device)
        self._tables = tables_of(GeometryPool.of(self.device), scene)
        self._cursor = Cursor()
        self._buffer_stride = 0
        self._start_film()

    @property
    def scene(self) -> Scene:
        return self._tables.scene

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image, pixels."""
        return self.settings.size

    @property
    def mode(self) -> Mode:
        return self._mode

    @property
    def grid(self) -> tiles.TileGrid:
        return self._grid

    @property
    def queue(self) -> Queue:
        """The tiles that the current mode goes through, in order."""
        return self._queue

    @property
    def cursor(self) -> Cursor:
        """How far the queue is done."""
        return self._cursor

    @property
    def _strategy(self) -> Strategy:
        return strategy_of(self.settings)

    @property
    def tile_spp(self) -> npt.NDArray[np.int64]:
        """(count,) samples behind each tile; 0 where the old picture waits to be thrown away."""
        return self._tile_spp

    def step(self, slots: int | None = None) -> StepReport:
        """Render one step, at most to the end of the queue: `slots` of tile_size^2 paths each (fewer where
        memory does not suffice), or as many as the settings say."""
        start = time.perf_counter()
        mode, queue = self._mode, self._queue
        slot_count = self._slot_count() if slots is None else self._reserve_slots(slots)
        plan = plan_step(self._grid, queue, self._cursor, slot_count, self._tile_spp)
        params = self._params()
        filled = self.device.upload(plan.slots)
        paths = len(plan.slots) * self.settings.tile_size**2
        self._wavefront.trace(self._tables, params, filled, paths, self._radiance)
        self._film.reduce(params, plan, filled, self._radiance)
        nonfinite = self._film.take_nonfinite()
        self._tile_spp = counts_after(queue, plan, self._tile_spp)
        self._cursor = plan.cursor
        if is_done(queue, plan.cursor):
            self._enter(next_mode(mode, Event.QUEUE_DONE, self._strategy))
        return StepReport(
            mode,
            plan.finished,
            plan.cursor.tiles,
            len(queue.tiles),
            paths,
            time.perf_counter() - start,
            nonfinite,
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
        in where the object was before the drag. At the end of the drag, the same scene handed in again with
        `since` starts the spiral anew, with the NoR that the settings have then.
        """
        old = self.scene
        with self._unchanged_on_error():
            if settings is not None:
                self.configure(settings)
            change = diff(old, scene)
            self._tables = tables_of(self._tables.pool, scene, self._tables)
        changed = affected_objects(old, scene, change)
        affected = changed
        if since is not None and not (drag := diff(since, scene)).is_global:
            affected = affected_objects(since, scene, drag) or changed
        mode = next_mode(self._mode, Event.LOCAL_CHANGE, self._strategy)
        if change.is_global:
            self._enter(next_mode(self._mode, Event.GLOBAL_CHANGE, self._strategy))
        elif changed or (affected and mode is Mode.INCREMENTAL):
            self._enter(mode, tuple(affected), pixel)
        return change

    def restart(self) -> None:
        """Throw away what was accumulated; the picture stands until it is rendered anew."""
        self._enter(Mode.BASE)

    def configure(self, settings: RenderSettings) -> None:
        """Render with other settings from now on. The picture starts over only if samples change meaning.
        On an error the old settings and the picture stay."""
        with self._unchanged_on_error():
            old, old_stride = self.settings, self._stride_of_settings()
            self.settings = settings
            if (old.size, old.tile_size) != (settings.size, settings.tile_size):
                self._start_film()
            elif any(getattr(old, name) != getattr(settings, name) for name in PICTURE_SETTINGS):
                self._enter(Mode.BASE)
            elif self._cursor == Cursor():
                self._enter(self._mode, order=self._queue.tiles)
            stride = self._stride_of_settings()
            if stride > self._buffer_stride or stride < old_stride:
                self._resize_path_buffer(stride)

    def render(self, spp: int, on_step: Callable[[StepReport], None] | None = None) -> None:
        """Step until every pixel shows the scene as it is now with at least `spp` samples."""
        while self._mode is not Mode.REFINE or self._tile_spp.min() < spp:
            report = self.step()
            if on_step is not None:
                on_step(report)

    def snapshot(self) -> Snapshot:
        """Scene, settings and picture as they are now, for `restore`."""
        return Snapshot(
            self.scene,
            self.settings,
            self._film.sums(),
            self._tile_spp.copy(),
            self._mode,
            self._queue,
            self._cursor,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from where a session stood. A tile that was under way then starts again. On an error
        everything stays as it was."""
        with self._unchanged_on_error():
            self.settings = snapshot.settings
            self._start_film()
            self._film.restore(snapshot.sums)
            self._tile_spp = snapshot.tile_spp.copy()
            self._mode, self._queue = snapshot.mode, snapshot.queue
            self._cursor = Cursor(snapshot.cursor.tiles)
            self._tables = tables_of(self._tables.pool, snapshot.scene, self._tables)

    def image(self, alpha: bool = False) -> npt.NDArray[np.float32]:
        """(H, W, 3) mean radiance, linear; row 0 is on top. What is not rendered anew yet shows the old
        picture, at first black. With `alpha` (H, W, 4): 0 where there was never a picture of this size."""
        image = self._film.image()
        return image if alpha else np.ascontiguousarray(image[..., :3])

    def spp(self) -> npt.NDArray[np.int64]:
        """(H, W) samples behind each pixel; 0 where the old picture waits to be thrown away."""
        return tile_image(self._grid, self._tile_spp)

    def aovs(self, size: tuple[int, int] | None = None, rows: tuple[int, int] | None = None) -> Aovs:
        """Auxiliary images of the scene as it is now, of the session's size or another; see Aovs. `rows`:
        from the first of them up to the second only."""
        width, whole_height = self.size if size is None else size
        params = self._params((width, whole_height))
        top, bottom = (0, whole_height) if rows is None else rows
        height = bottom - top
        # The rows are an image of their own, of a camera that looks a little up or down.
        camera = params["camera"]
        camera["forward"] += (1 - (top + bottom) / whole_height) * camera["up"]
        camera["up"] *= height / whole_height
        params["height"] = height
        # Tiles of any size serve; these keep neighbouring rays together.
        params["tile_size"] = RenderSettings.tile_size
        grid = tiles.TileGrid(width, height, RenderSettings.tile_size)
        queue = Queue.even(tiles.base_queue(grid), 1, True)
        plan = plan_step(grid, queue, Cursor(), grid.count, np.zeros(grid.count, np.int64))
        surface, object_ids = self._first_hits(plan.slots, params)
        surface = surface.reshape(7, height, width)
        return Aovs(
            object_ids.reshape(height, width),
            np.ascontiguousarray(np.moveaxis(surface[:3], 0, 2)),
            surface[3],
            np.ascontiguousarray(np.moveaxis(surface[4:], 0, 2)),
        )

    def pick(self, pixel: tuple[int, int]) -> str | None:
        """The name of the object under a pixel (x, y) from the top left, or None. Raises InputError outside
        the image."""
        x, y = int(pixel[0]), int(pixel[1])
        width, height = self.size
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(f"pixel ({x}, {y}): is outside the image of {width} x {height}")
        return self.pick_point(((x + 0.5) / width, (y + 0.5) / height))

    def pick_point(self, point: tuple[float, float]) -> str | None:
        """The name of the object at a point (x, y) from the top left, in units of the image, or None."""
        params = self._params()
        camera = params["camera"]
        # An image of one pixel, whose centre is the point.
        camera["forward"] += (2 * point[0] - 1) * camera["right"] + (1 - 2 * point[1]) * camera["up"]
        params["width"] = params["height"] = params["tile_size"] = 1
        _, object_ids = self._first_hits(_one_slot(), params)
        index = int(object_ids[0])
        return self.scene.objects[index].name if index >= 0 else None

    def build(self, on_progress: Callable[[int, int], None] | None = None) -> None:
        """Build every kernel that the scene as it is now needs, so that no later call has to wait for one.
        `on_progress` is called with how many of how many steps are done; not at all if nothing is to do.
        What it raises ends the building, which may go on later."""
        kernels = self._tables.variant
        if kernels in self.device.built:
            return
        params, slots = self._params(), self.device.upload(_one_slot())
        steps = [
            *self._wavefront.idle_launches(self._tables, params, slots, self._radiance),
            *self._film.idle_launches(params, self._radiance),
        ]
        for done, step in enumerate(steps, 1):
            step()
            self.device.finish()
            if on_progress is not None:
                on_progress(done, len(steps))
        self.device.built.add(kernels)

    def _first_hits(
        self, slots: npt.NDArray[np.void], params: npt.NDArray[np.void]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        pixels = int(params["width"]) * int(params["height"])
        paths = len(slots) * int(params["tile_size"]) ** 2
        params["pixel_center"] = 1
        params["buffer_stride"] = paths + layout.WORK_GROUP_SIZE
        surface, object_ids = self.device.empty(28 * pixels), self.device.empty(4 * pixels)
        radiance = self.device.empty(12 * (paths + layout.WORK_GROUP_SIZE))
        self._wavefront.first_hits(
            self._tables, params, self.device.upload(slots), paths, surface, object_ids, radiance
        )
        return (
            self.device.read(surface, np.empty(7 * pixels, np.float32)),
            self.device.read(object_ids, np.empty(pixels, np.int32)),
        )

    @contextmanager
    def _unchanged_on_error(self) -> Iterator[None]:
        # A path buffer that is smaller than the settings say would be written past its end.
        before = self.__dict__.copy()
        try:
            yield
        except BaseException:
            self.__dict__ = before
            raise

    def _start_film(self) -> None:
        width, height = self.size
        self._grid = tiles.TileGrid(width, height, self.settings.tile_size)
        self._film = Film(self.device, width, height)
        self._tile_spp = np.zeros(self._grid.count, np.int64)
        stride = self._stride_of_settings()
        if stride > self._buffer_stride:
            self._resize_path_buffer(stride)
        self._enter(Mode.BASE)

    def _slot_count(self) -> int:
        return _slot_count(self.settings)

    def _stride_of_settings(self) -> int:
        check_settings(self.settings)
        return _path_buffer_stride(self._slot_count(), self.settings.tile_size)

    def _resize_path_buffer(self, stride: int) -> None:
        if stride != self._buffer_stride:
            self._radiance = self.device.empty(12 * stride)
            self._buffer_stride = stride

    def _reserve_slots(self, slots: int) -> int:
        """Make room for so many slots; returns for how many there is, one at least."""
        area = self.settings.tile_size**2
        slots = max(1, min(slots, (_MOST_PATH_FLOATS // 3 - layout.WORK_GROUP_SIZE) // area))
        stride = _path_buffer_stride(slots, self.settings.tile_size)
        if stride > self._buffer_stride:
            # Room to spare, since callers come back for a little more each time.
            with suppress(DeviceError):
                self._resize_path_buffer(min(2 * stride, _MOST_PATH_FLOATS // 3))
        return min(slots, (self._buffer_stride - layout.WORK_GROUP_SIZE) // area)

    def _enter(
        self,
        mode: Mode,
        affected: tuple[Object, ...] = (),
        pixel: tuple[float, float] | None = None,
        order: npt.NDArray[np.int32] | None = None,
    ) -> None:
        self._mode = mode
        self._cursor = Cursor()
        if mode is Mode.BASE:
            self._tile_spp = np.zeros_like(self._tile_spp)
        situation = Situation(mode, self.settings, self._grid, self.scene, self._tile_spp, affected, pixel)
        self._queue = self._strategy.queue(situation, order)

    def _params(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.void]:
        width, height = self.size if size is None else size
        scene, settings = self.scene, self.settings
        camera = scene.camera
        params = np.zeros((), layout.PARAMS)
        right, up, forward = transform.camera_frame(
            camera.position, camera.target, camera.up, camera.fov_y, width / height
        )
        params["camera"] = (camera.position, right, up, forward)
        params["width"], params["height"] = width, height
        params["tile_size"] = settings.tile_size
        params["in_squares"] = self._tables.has_trees
        params["buffer_stride"] = self._buffer_stride
        for name in ("seed", "max_bounces", "transmission_bounces", "roulette_depth"):
            params[name] = getattr(settings, name)
        params["light_count"] = self._tables.light_count
        params["environment_probability"] = self._tables.environment_probability
        params["environment_color"] = self._tables.environment_radiance
        if scene.environment.image is not None:
            shape = scene.environment.image.pixels.shape
            params["environment_height"], params["environment_width"] = shape[:2]
        params["environment_rotation"] = scene.environment.rotation_y / 360 % 1
        return params


def _one_slot() -> npt.NDArray[np.void]:
    """A single path per pixel of the tile at the top left."""
    slot = np.zeros(1, layout.SLOT)
    slot["group_count"] = 1
    return slot


def check_settings(settings: RenderSettings) -> None:
    """Raises InputError where a step of the settings is larger than kernels can address."""
    slots = _slot_count(settings)
    if 3 * _path_buffer_stride(slots, settings.tile_size) > _MOST_PATH_FLOATS:
        most = (_MOST_PATH_FLOATS // 3 - layout.WORK_GROUP_SIZE) // settings.tile_size**2
        raise InputError(
            f"sample_rate: a step of {slots:,} slots is more than the {most:,} that can be "
            f"addressed; choose a smaller sample_rate or slots_per_step"
        )


def _path_buffer_stride(slots: int, tile_size: int) -> int:
    return slots * tile_size**2 + layout.WORK_GROUP_SIZE


def _slot_count(settings: RenderSettings) -> int:
    slots = settings.slots_per_step or tiles.TileGrid(*settings.size, settings.tile_size).count
    return slots * settings.sample_rate
