"""A headless edit session: the same edits under several strategies, measured against converged pictures.

This is the experiment of the thesis's chapter 5. It starts from a picture with many samples per pixel; at
their steps the edits are made, and so many steps after each of them the picture is captured and compared with
a converged picture of the edited scene. That one has another seed: were it made of the samples of the picture
before the edit, what a strategy keeps would be compared with itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.formats.edit_script import Edit, EditScript
from incpt.picture.metrics import normalized_rmse, relative_mse
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport
from incpt.render.strategies import RESTART, STRATEGIES_BY_NAME
from incpt.scene.model import Scene

FloatImage = npt.NDArray[np.float32]
OnStep = Callable[[str, StepReport], None]


@dataclass(frozen=True)
class Variant:
    """A strategy with its NoR, which some strategies do not use."""

    strategy: str
    nor: int

    @property
    def uses_nor(self) -> bool:
        """Whether the NoR makes a difference."""
        return STRATEGIES_BY_NAME[self.strategy].uses_nor

    def settings(self, settings: RenderSettings) -> RenderSettings:
        """Those of a session that works this way: with the NoR as it is, as in the thesis."""
        return replace(settings, strategy=self.strategy, nor=self.nor, nor_adapts=False)

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.strategy}, NoR {self.nor}" if self.uses_nor else self.strategy

    @property
    def slug(self) -> str:
        """For file names."""
        return f"{self.strategy}{self.nor}" if self.uses_nor else self.strategy


def variants(strategies: Sequence[str], nors: Sequence[int]) -> list[Variant]:
    """Every strategy with every NoR that makes a difference to it, in the given order, each once."""
    every = [
        Variant(name, nor)
        for name in strategies
        for nor in (nors if STRATEGIES_BY_NAME[name].uses_nor else nors[:1])
    ]
    return list(dict.fromkeys(every))


@dataclass(frozen=True, eq=False)
class Converged:
    """The picture to compare with, (H, W, 3) linear radiance: after edit number `edit`, or before all edits,
    which is None."""

    edit: int | None
    image: FloatImage


@dataclass(frozen=True, eq=False)
class Capture:
    """The picture, (H, W, 3) linear radiance, `step` steps after edit number `edit`, and its errors.

    `paths` and `seconds` are what the steps since the edit took.
    """

    edit: int
    variant: Variant
    step: int
    mode: Mode
    image: FloatImage
    normalized_rmse: float
    relative_mse: float
    paths: int
    seconds: float


@dataclass(frozen=True)
class TimedEdit:
    """Edit number `index` of the script, the scene after it, and the captures that come before the next."""

    index: int
    edit: Edit
    scene: Scene
    captures: tuple[int, ...]


@dataclass(frozen=True)
class Replay:
    """What to replay: `base_spp` samples per pixel are behind the picture before the first edit,
    `reference_spp` behind those to compare with. `settings` are those of every session but for strategy and
    NoR. Raises InputError where there is nothing to capture."""

    scene: Scene
    script: EditScript
    variants: Sequence[Variant]
    settings: RenderSettings
    base_spp: int = 256
    reference_spp: int = 1024

    def __post_init__(self) -> None:
        if not any(timed.captures for run in self.runs for timed in run):
            raise InputError("capture: every one comes after the next edit; give the edits later steps")

    @cached_property
    def runs(self) -> list[list[TimedEdit]]:
        """Edits that follow each other from the base picture: all of them, or one run for each."""
        edits, scenes = self.script.edits, self.script.scenes(self.scene)
        if not self.script.cumulative:
            return [[TimedEdit(i, e, scenes[i], e.capture)] for i, e in enumerate(edits)]
        ends = [later.step - edit.step for edit, later in pairwise(edits)]
        return [
            [
                TimedEdit(i, edit, scenes[i], tuple(c for c in edit.capture if i == len(ends) or c < ends[i]))
                for i, edit in enumerate(edits)
            ]
        ]

    @property
    def left_out(self) -> int:
        """Captures that would come after the next edit."""
        return sum(len(t.edit.capture) - len(t.captures) for run in self.runs for t in run)

    @property
    def paths_per_pixel(self) -> int:
        """About what it all takes; for a progress bar."""
        captured = sum(bool(timed.captures) for run in self.runs for timed in run)
        steps = sum(run[-1].edit.step + max(run[-1].captures, default=0) for run in self.runs)
        per_step = self.settings.sample_rate
        return self.base_spp + captured * self.reference_spp + len(self.variants) * steps * per_step

    def pictures(self, device: Device, on_step: OnStep) -> Iterator[Converged | Capture]:
        """The pictures, each as soon as it is there: converged ones before those compared with them.

        `on_step` is called after every step with what is being done; what it raises ends the replay.
        """
        session = Session(self.scene, settings=self.settings, device=device)
        session.render(self.base_spp, lambda report: on_step("base picture", report))
        yield Converged(None, session.image())
        start = session.snapshot()
        other_seed = (self.settings.seed + 1) % (1 << 32)
        settings = replace(self.settings, seed=other_seed, strategy=RESTART.name)
        converging = Session(self.scene, settings=settings, device=device)
        for run in self.runs:
            references: dict[int, FloatImage] = {}
            for timed in run:
                if timed.captures:
                    what = f"{timed.edit.label}: converged picture"
                    references[timed.index] = self._converge(converging, timed.scene, what, on_step)
                    yield Converged(timed.index, references[timed.index])
            for variant in self.variants:
                session.restore(start)
                session.configure(variant.settings(self.settings))
                yield from _edit_session(session, run, variant, references, on_step)

    def _converge(self, session: Session, scene: Scene, what: str, on_step: OnStep) -> FloatImage:
        session.edit(scene)
        session.render(self.reference_spp, lambda report: on_step(what, report))
        return session.image()


def _edit_session(
    session: Session,
    run: Sequence[TimedEdit],
    variant: Variant,
    references: dict[int, FloatImage],
    on_step: OnStep,
) -> Iterator[Capture]:
    now = 0
    for timed, later in zip(run, [*run[1:], None], strict=True):
        while now < timed.edit.step:  # before the first edit only: later ones are stepped to below
            on_step(f"before {timed.edit.label}", session.step())
            now += 1
        session.edit(timed.scene, pixel=timed.edit.pixel)
        steps = max(timed.captures, default=0) if later is None else later.edit.step - timed.edit.step
        paths, seconds = 0, 0.0
        for step in range(steps + 1):
            if step:
                began = time.perf_counter()
                report = session.step()
                seconds += time.perf_counter() - began
                paths += report.paths + report.partners
                on_step(f"{timed.edit.label}: {variant.label}", report)
            if step in timed.captures:
                image = session.image()
                reference = references[timed.index]
                yield Capture(
                    timed.index,
                    variant,
                    step,
                    session.mode,
                    image,
                    normalized_rmse(image, reference),
                    relative_mse(image, reference),
                    paths,
                    seconds,
                )
        now += steps
