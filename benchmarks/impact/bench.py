"""A session after an edit, at equal paths and at equal seconds, compared with a converged picture."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from incpt.benchmarks.impact.edits import DRAG_STEPS, FIRST_STEPS, STAGES, drag_step
from incpt.benchmarks.kit.denoise import GUIDES, Denoiser
from incpt.benchmarks.kit.pictures import FloatImage, Gallery
from incpt.benchmarks.measures.edits import EditBench, Note
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.render.tiles import TileGrid
from incpt.scene.model import Scene

PICTURE_SECONDS = 0.033
"""The least time from the beginning of one picture to that of the next: more often nobody sees them."""
_WARM_STEPS = 3
_DENOISINGS = 3
_RESTED = "rest +"


@dataclass(frozen=True)
class Variant:
    """A way to bring the picture up to date: a strategy, with its NoR where it has one; `adapts`: the NoR
    does; `denoised`: what is shown has gone through a denoiser. In a drag `rest_nor` takes the place of the
    NoR once the drag is over.

    A variant of a strategy by another setting gets a field here, and a line in `variants`.
    """

    label: str
    strategy: str
    nor: int | None = None
    adapts: bool = False
    denoised: bool = False
    rest_nor: int | None = None

    def settings(self, settings: RenderSettings) -> RenderSettings:
        """Those of a session that works this way."""
        nor = settings.nor if self.nor is None else self.nor
        return replace(settings, strategy=self.strategy, nor=nor, nor_adapts=self.adapts, aovs=self.denoised)

    @property
    def slug(self) -> str:
        """For file names."""
        return self.label.replace(" + ", "-").replace(" ", "")


RESTART, DENOISED, IMPACT = "restart", "restart + OIDN", "impact"
DRAG_VARIANTS = (
    Variant(RESTART, "restart"),
    Variant(DENOISED, "restart", denoised=True),
    Variant("spiral 16, then 64", "spiral", 16, rest_nor=64),
    Variant(IMPACT, "impact"),
)


def variants(nors: Iterable[int]) -> list[Variant]:
    """All that are compared after an edit."""
    spirals = [Variant(f"spiral {nor}", "spiral", nor) for nor in nors]
    return [
        Variant(RESTART, "restart"),
        Variant(DENOISED, "restart", denoised=True),
        *spirals,
        Variant("spiral adapting", "spiral", adapts=True),
        Variant(IMPACT, "impact"),
    ]


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture that stood on the screen at a mark: `steps` is all paths since the edit, partners included,
    over those of one for each pixel; `seconds` is when it came, since the edit began."""

    mark: str
    image: FloatImage
    steps: float
    seconds: float | None = None


@dataclass(eq=False)
class Purse:
    """Takes steps of a session and counts their paths, partners and those past the picture's edges
    included."""

    session: Session
    paths: int = 0
    _share: float = field(default=1.0)

    @property
    def steps(self) -> float:
        """What was spent, in paths of a step of the whole picture."""
        return self.paths / _step_paths(self.session.grid)

    def step(self, slots: int | None = None) -> None:
        """One step."""
        report = self.session.step(slots)
        self.paths += report.paths + report.partners
        self._share = report.partners / report.paths

    def spend(self, steps: float) -> None:
        """Go on until so many steps are spent, to half a tile's paths."""
        grid = self.session.grid
        while True:
            # As many paths of this step will have partners as of the one before, or the next is a short one.
            cost = grid.tile_size**2 * (1 + self._share)
            left = (steps * _step_paths(grid) - self.paths) / cost
            if left < 0.5:
                return
            self.step(min(max(1, int(left)), grid.count))


def _step_paths(grid: TileGrid) -> int:
    return grid.count * grid.tile_size**2


class ImpactBench:
    """Makes edits of the stages on a device, from kept pictures of the gallery. Pictures to compare with have
    `reference_spp` samples for each pixel, or as many as the stage has. `clock` gives seconds."""

    def __init__(
        self,
        device: Device,
        gallery: Gallery,
        reference_spp: int,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device, self.gallery, self.reference_spp = device, gallery, reference_spp
        self._clock = clock
        self._benches: dict[tuple[int, int], EditBench] = {}
        self._scenes: dict[int, Scene] = {}
        self._denoiser: Denoiser | None = None

    def start(self, scene: Scene, stage: str, base_spp: int) -> EditBench:
        """What edits of a scene start from; `base_spp` samples for each pixel, or as many as the stage
        has."""
        self._scenes[id(scene)] = scene  # so that no other one gets its number
        key = (id(scene), base_spp)
        if key not in self._benches:
            most = STAGES[stage].most_spp
            spp = min(base_spp, most), min(self.reference_spp, most)
            self._benches[key] = EditBench(self.device, self.gallery, scene, *spp)
        return self._benches[key]

    def missing(self, variant: Variant) -> str | None:
        """What a variant needs that is not installed; None: nothing."""
        try:
            if variant.denoised and self._denoiser is None:
                self._denoiser = Denoiser()
        except InputError as error:
            return str(error)
        return None

    def after_steps(
        self,
        start: EditBench,
        after: Scene,
        variant: Variant,
        settings: RenderSettings,
        marks: Sequence[int],
        note: Note,
        between: Scene | None = None,
    ) -> Iterator[Shown]:
        """The pictures after an edit that makes `after`, after so many steps: marks rise. An edit before it
        made the scene `between`, if there is one."""
        chosen = variant.settings(settings)
        session = _edited(start.at(start.start(chosen, lambda f: note(0.3 * f))), between)
        session.edit(after)
        purse = Purse(session)
        for done, mark in enumerate(marks):
            purse.spend(mark)
            note(0.3 + 0.7 * done / len(marks))
            yield Shown(f"{mark} steps", self._finished(_read(session)), purse.steps)

    def after_seconds(
        self,
        start: EditBench,
        after: Scene,
        variant: Variant,
        settings: RenderSettings,
        marks: Sequence[float],
        note: Note,
        ready: Callable[[], None],
        between: Scene | None = None,
    ) -> tuple[list[Shown], dict[str, Any]]:
        """The pictures on the screen so many seconds after an edit, and how long its parts took: marks rise.
        The clock runs while the edit is made, steps are taken and pictures are read, of which a viewer takes
        one each PICTURE_SECONDS.

        One that denoised them all would do little else. So each mark gets the last picture that leaves the
        denoiser the time, and no other is denoised: more than a viewer could do.
        """
        chosen = variant.settings(settings)
        kept = start.start(chosen, lambda f: note(0.2 * f))
        delay = self._warmed(start.at(kept), after, variant)
        session = _edited(start.at(kept), between)
        clock = _Clock(self._clock, session, marks, delay)
        ready()
        clock.edit(after)
        while clock.elapsed < marks[-1]:
            clock.step()
            note(0.2 + 0.8 * min(clock.elapsed / marks[-1], 1))
        shown = [
            Shown(f"{mark:g} s", self._finished(taken.read), taken.steps, taken.seconds)
            for mark, taken in clock.on_screen.items()
        ]
        return shown, {**clock.values(), "denoising_ms": 1e3 * delay if variant.denoised else None}

    def drag(
        self,
        start: EditBench,
        variant: Variant,
        settings: RenderSettings,
        edits: Sequence[int],
        rests: Sequence[int],
        note: Note,
    ) -> Iterator[tuple[Scene, Shown]]:
        """The pictures of a drag with one step after each of its edits: after the edits with these numbers,
        and after so many steps of rest. Each comes with the scene that it is of."""
        before, chosen = start.scene, variant.settings(settings)
        session = start.at(start.start(chosen, lambda f: note(0.3 * f)))
        scene = before
        for number in range(1, DRAG_STEPS + 1):
            scene = drag_step(before, number)
            session.edit(scene, since=before)
            Purse(session).spend(1)
            note(0.3 + 0.5 * number / DRAG_STEPS)
            if number in edits:
                yield scene, Shown(f"edit {number}", self._finished(_read(session)), number)
        if variant.rest_nor is not None:
            session.configure(replace(session.settings, nor=variant.rest_nor))
        session.end_drag(before)
        purse = Purse(session)
        for rest in rests:
            purse.spend(rest)
            note(1.0)
            yield scene, Shown(f"{_RESTED}{rest}", self._finished(_read(session)), DRAG_STEPS + rest)

    def _finished(self, read: _Read) -> FloatImage:
        image, *guides = read
        if not guides:
            return image
        assert self._denoiser is not None, "`missing` tells whether there is one"
        return self._denoiser.denoised(image, guides)

    def _warmed(self, session: Session, after: Scene, variant: Variant) -> float:
        """Do once all that will be timed, since kernels are built and trees made at their first use; returns
        the seconds that the denoiser takes."""
        session.edit(after)
        for _ in range(_WARM_STEPS):
            session.step()
            read = _read(session)
        if not variant.denoised:
            return 0.0
        times = []
        for _ in range(_DENOISINGS):
            began = self._clock()
            self._finished(read)
            times.append(self._clock() - began)
        return statistics.median(times)


def _edited(session: Session, scene: Scene | None) -> Session:
    """The session after a first edit that makes a scene, if there is one."""
    if scene is not None:
        session.edit(scene)
        Purse(session).spend(FIRST_STEPS)
    return session


def _median_ms(seconds: Sequence[float]) -> float:
    """NaN where there was none, because the edit alone took all the time."""
    return 1e3 * statistics.median(seconds) if seconds else math.nan


_Read = tuple[FloatImage, ...]
"""A picture as it is read from a session; with the setting `aovs` the guides of a denoiser too."""


def _read(session: Session) -> _Read:
    guides = GUIDES if session.settings.aovs else ()
    return (session.image(), *(session.pass_image(name) for name in guides))


@dataclass(frozen=True, eq=False)
class _Taken:
    """What was read, and when it came on the screen."""

    read: _Read
    steps: float
    seconds: float


class _Clock:
    """Runs while a session works, and keeps what is on the screen at each of the marks, seconds; a picture
    comes there `delay` seconds after it was read."""

    def __init__(
        self, now: Callable[[], float], session: Session, marks: Sequence[float], delay: float
    ) -> None:
        self._now = now
        self.elapsed = 0.0
        # Nobody denoises the old picture.
        old = _Taken((session.image(),), 0.0, 0.0)
        self.on_screen: dict[float, _Taken] = dict.fromkeys(marks, old)
        self._session, self._purse, self._delay = session, Purse(session), delay
        self._edit_s, self._step_s, self._picture_s = 0.0, list[float](), list[float]()
        self._next_picture = 0.0

    def edit(self, after: Scene) -> None:
        """Make the edit."""
        began = self._now()
        self._session.edit(after)
        self._session.device.finish()
        self._edit_s = self._now() - began
        self.elapsed = self._edit_s

    def step(self) -> None:
        """Take a step, and a picture where one is due."""
        began = self._now()
        self._purse.step()
        stepped = self._now()
        self._step_s.append(stepped - began)
        self.elapsed += self._step_s[-1]
        if self.elapsed < self._next_picture:
            return
        self._next_picture = self.elapsed + PICTURE_SECONDS
        read = _read(self._session)
        self._picture_s.append(self._now() - stepped)
        self.elapsed += self._picture_s[-1]
        taken = _Taken(read, self._purse.steps, self.elapsed + self._delay)
        self.on_screen |= {mark: taken for mark in self.on_screen if taken.seconds <= mark}

    def values(self) -> dict[str, Any]:
        """Columns of a result."""
        return {
            "edit_ms": 1e3 * self._edit_s,
            "step_ms": _median_ms(self._step_s),
            "picture_ms": _median_ms(self._picture_s),
            "pictures": len(self._picture_s),
            "paths_per_second": self._purse.paths / self.elapsed,
        }
