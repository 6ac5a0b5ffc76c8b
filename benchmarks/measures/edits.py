"""One edit of a scene under one strategy, timed step by step and compared with a converged picture.

The picture before the edit and the one to compare with come from the gallery. Reading a picture back and
measuring its error do not count as time: the clock runs in `edit` and `step` only.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.pictures import FloatImage, Gallery, errors
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats.edit_script import Edit
from incpt.render import tiles
from incpt.render.film import RADIANCE
from incpt.render.modes import Mode
from incpt.render.plan import Cursor, Queue
from incpt.render.progress import Progress
from incpt.render.session import Session, Snapshot
from incpt.render.strategies import strategy_of
from incpt.scene.model import Scene

Note = Callable[[float], None]


@dataclass(frozen=True)
class Marks:
    """When pictures are compared: so many steps, and so many seconds, after an edit; `done`: also when the
    whole queue is. Without `flip` that measure is left out: it takes longer than a step."""

    steps: tuple[int, ...] = ()
    seconds: tuple[float, ...] = ()
    done: bool = False
    flip: bool = True


@dataclass(frozen=True, eq=False)
class Capture:
    """A picture after an edit: `mark` says why it was taken, `seconds` is when its last step was over."""

    mark: str
    steps: int
    seconds: float
    paths: int
    image: FloatImage
    errors: dict[str, Any]

    def as_row(self) -> dict[str, Any]:
        """Columns of a result."""
        place = {"mark": self.mark, "steps": self.steps, "seconds": self.seconds, "paths": self.paths}
        return {**place, **self.errors}


@dataclass
class Timeline:
    """What happened after an edit: seconds that `edit` took and each step, tiles finished in each, paths
    traced in each, and the pictures."""

    edit_s: float
    step_s: list[float] = field(default_factory=list)
    tiles: list[int] = field(default_factory=list)
    paths: list[int] = field(default_factory=list)
    captures: list[Capture] = field(default_factory=list)
    done_step: int | None = None

    @property
    def elapsed_s(self) -> float:
        """Since the edit, without the time for measuring."""
        return self.edit_s + sum(self.step_s)

    def until_step(self, count: int) -> float:
        """Seconds from the edit to the end of that step."""
        return self.edit_s + sum(self.step_s[:count])

    def values(self) -> dict[str, Any]:
        """Columns of a result. `first_tile_ms` is from the edit to the first updated tile, `queue_s` to the
        end of the queue, None where that was not waited for."""
        first = next((i + 1 for i, count in enumerate(self.tiles) if count), None)
        whole = self.step_s if self.done_step is None else self.step_s[: self.done_step]
        counted = self.tiles[: len(whole)]
        return {
            "edit_ms": 1e3 * self.edit_s,
            "step_ms": 1e3 * statistics.median(whole),
            "tiles_per_step": sum(counted) / len(counted),
            "paths_per_second": sum(self.paths[: len(whole)]) / sum(whole),
            "first_tile_ms": None if first is None else 1e3 * self.until_step(first),
            "queue_s": None if self.done_step is None else self.until_step(self.done_step),
        }


class EditBench:
    """Makes edits of `scene` again and again from the same picture of `base_spp` samples per pixel."""

    def __init__(
        self, device: Device, gallery: Gallery, scene: Scene, base_spp: int, reference_spp: int
    ) -> None:
        self.device, self.gallery, self.scene = device, gallery, scene
        self.base_spp, self.reference_spp = base_spp, reference_spp
        self._session: Session | None = None
        self._warm: set[tuple[Any, ...]] = set()

    def kept(self, settings: RenderSettings, note: Note) -> FloatImage:
        """The picture before the edit."""
        return self.gallery.converged(self.scene, settings, self.base_spp, note)

    def start(self, settings: RenderSettings, note: Note) -> Snapshot:
        """A session's state after refining the scene before the edit."""
        image = self.kept(settings, note)
        grid = tiles.TileGrid(*settings.size, settings.tile_size)
        sums = np.empty((4, *image.shape[:2]), np.float32)
        sums[:3] = np.moveaxis(image, 2, 0) * np.float32(self.base_spp)
        sums[3] = self.base_spp
        queue = Queue.even(tiles.base_queue(grid), settings.base_nor * settings.sample_rate, False)
        drawn = np.full(grid.count, self.base_spp, np.int64)
        progress = Progress(settings, grid, Mode.REFINE, queue, Cursor(), drawn, 0, np.zeros_like(drawn))
        return Snapshot(self.scene, progress, {RADIANCE.name: sums})

    def reference(self, scene: Scene, settings: RenderSettings, note: Note) -> FloatImage:
        """The converged picture of an edited scene. Of another seed than the sessions': else what they keep
        would be compared with itself."""
        other_seed = replace(settings, seed=(settings.seed + 1) % (1 << 32))
        return self.gallery.converged(scene, other_seed, self.reference_spp, note)

    def run(
        self, edit: Edit, settings: RenderSettings, marks: Marks, note: Note, ready: Callable[[], None]
    ) -> Timeline:
        """Make the edit and go on until the last mark. `note` hears of the preparation (0 to 1/2) and of the
        steps; `ready` is called in between."""
        after = edit.apply(self.scene)
        start = self.start(settings, lambda f: note(0.2 * f))
        reference = self.reference(after, settings, lambda f: note(0.2 + 0.3 * f))
        session = self.at(start)
        variant = (settings, edit.label)
        if variant not in self._warm:
            # Kernels are specialised for sizes, and trees of new meshes built, at their first use.
            session.edit(after, pixel=edit.pixel)
            session.step()
            self._warm.add(variant)
            session = self.at(start)
        ready()
        return _timed(session, edit, after, reference, marks, note)

    def at(self, start: Snapshot) -> Session:
        """The session, which is the same for all edits, as it was at that state."""
        if self._session is None:
            self._session = Session(start.scene, settings=start.progress.settings, device=self.device)
        self._session.restore(start)
        return self._session


_NAMED = ("size", "tile_size", "strategy", "nor")


def edit_subject(
    bench: EditBench, edit: Edit, settings: RenderSettings, marks: Marks, repetition: int
) -> dict[str, Any]:
    """What a measured edit depends on."""
    others = {n: getattr(settings, n) for n in RenderSettings.names() if n not in _NAMED}
    return {
        "scene": digest(bench.scene),
        "edit": edit.label,
        "edited": digest(edit.apply(bench.scene), edit.pixel),
        "size": list(settings.size),
        "tile_size": settings.tile_size,
        "strategy": settings.strategy,
        "nor": settings.nor if strategy_of(settings).uses_nor else None,
        **others,
        "base_spp": bench.base_spp,
        "reference_spp": bench.reference_spp,
        "marks": [*marks.steps, *(f"{s:g} s" for s in marks.seconds), *(["done"] if marks.done else [])],
        "repetition": repetition,
    }


def _timed(
    session: Session, edit: Edit, after: Scene, reference: FloatImage, marks: Marks, note: Note
) -> Timeline:
    began = time.perf_counter()
    session.edit(after, pixel=edit.pixel)
    session.device.finish()
    line = Timeline(time.perf_counter() - began)
    mode = session.mode
    watch = _Watch(line, marks, reference)
    watch.look(session)
    while not watch.satisfied:
        report = session.step()
        line.step_s.append(report.seconds)
        line.tiles.append(len(report.tiles))
        line.paths.append(report.paths + report.partners)
        if line.done_step is None and report.queue_done == report.queue_length and report.mode is mode:
            line.done_step = len(line.step_s)
        watch.look(session)
        note(0.5 + 0.5 * watch.fraction)
    return line


class _Watch:
    """Takes pictures when marks are passed."""

    def __init__(self, line: Timeline, marks: Marks, reference: FloatImage) -> None:
        self._line, self._reference = line, reference
        self._steps = sorted(set(marks.steps))
        self._seconds = sorted(set(marks.seconds))
        self._wants_done = marks.done
        self._flip = marks.flip
        self._last: tuple[int, float, FloatImage] | None = None
        self._count = max(len(self._steps) + len(self._seconds) + marks.done, 1)

    @property
    def satisfied(self) -> bool:
        """Whether every mark is passed."""
        return not (self._steps or self._seconds or self._wants_done)

    @property
    def fraction(self) -> float:
        """Of the marks that are passed."""
        left = len(self._steps) + len(self._seconds) + self._wants_done
        return 1 - left / self._count

    def look(self, session: Session) -> None:
        """After the edit and after each step."""
        line, steps = self._line, len(self._line.step_s)
        # At a given second the picture of the last step that was over by then is on the screen.
        while self._seconds and line.elapsed_s > self._seconds[0]:
            mark = f"{self._seconds.pop(0):g} s"
            self._take(mark, *(self._last or (steps, line.elapsed_s, session.image())))
        wanted = self._seconds or steps in self._steps or (self._wants_done and line.done_step is not None)
        if not wanted:
            return
        image = session.image()
        self._last = steps, line.elapsed_s, image
        if steps in self._steps:
            self._steps.remove(steps)
            self._take(f"{steps} steps", steps, line.elapsed_s, image)
        if self._wants_done and line.done_step is not None:
            self._wants_done = False
            self._take("done", steps, line.elapsed_s, image)

    def _take(self, mark: str, steps: int, seconds: float, image: FloatImage) -> None:
        paths = sum(self._line.paths[:steps])
        found = errors(image, self._reference, self._flip)
        self._line.captures.append(Capture(mark, steps, seconds, paths, image, found))
