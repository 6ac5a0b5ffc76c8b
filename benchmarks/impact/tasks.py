"""The measurements of the strategy impact beside others, as tasks of an experiment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from incpt.benchmarks.impact.bench import DRAG_VARIANTS, ImpactBench, Shown, Variant, variants
from incpt.benchmarks.impact.edits import DRAG, DRAG_STAGE, DRAG_STEPS, EDITS, STAGES, drag_step
from incpt.benchmarks.impact.tables import DRAGS, MEASURES, SECONDS, STEPS
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.pictures import FloatImage, errors
from incpt.benchmarks.kit.store import Row
from incpt.benchmarks.kit.timing import interleaved
from incpt.benchmarks.measures.edits import EditBench, Note
from incpt.core.settings import RenderSettings
from incpt.scene.model import Scene

DRAG_EDITS = (1, 5, 10, 20)
DRAG_RESTS = (5, 10, 30)
_PREPARATION = 0.3
"""The share of a task in which the picture to compare with may have to be rendered."""


@dataclass(frozen=True)
class Plan:
    """What is measured, and how.

    edits          names in EDITS, and DRAG.
    steps          when errors are compared, in paths for each pixel, and `seconds`, when in seconds.
    bases          samples per pixel of the kept pictures.
    reference_spp  of the pictures to compare with.
    size_scale     by what the sizes of the stages are multiplied.
    """

    edits: Sequence[str] = (*EDITS, DRAG)
    measures: Sequence[str] = MEASURES
    nors: Sequence[int] = (16, 64, 128, 256)
    steps: Sequence[int] = (1, 2, 5, 10, 30)
    seconds: Sequence[float] = (0.05, 0.2, 1.0, 5.0, 20.0)
    bases: Sequence[int] = (4096, 64)
    reference_spp: int = 4096
    tile_size: int = 8
    size_scale: float = 1.0
    seed: int = 0
    repetitions: int = 1

    def settings(self, stage: str) -> RenderSettings:
        """Of the pictures of a stage."""
        place = STAGES[stage]
        size = place.scaled_size(self.size_scale)
        return replace(place.scene.settings, size=size, tile_size=self.tile_size, seed=self.seed)

    def check(self) -> None:
        """Raises InputError where settings cannot be."""
        for stage in STAGES:
            for variant in (*variants(self.nors), *DRAG_VARIANTS):
                variant.settings(self.settings(stage))


@dataclass(frozen=True, eq=False)
class _Case:
    """An edit, or the drag, that makes `after` of what `start` has, under a variant."""

    edit: str
    words: str
    stage: str
    start: EditBench
    after: Scene
    base: int
    variant: Variant
    between: Scene | None = None

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.words}: picture of {self.base} samples, {self.variant.label}"

    def subject(self, plan: Plan, measure: str, marks: Sequence[float]) -> Row:
        """What a measurement depends on; `base` and `reference` are what was asked for, which a stage may
        limit."""
        settings = self.variant.settings(plan.settings(self.stage))
        every = {name: getattr(settings, name) for name in RenderSettings.names()}
        return {
            "measure": measure,
            "scene": digest(self.start.scene),
            "edit": self.edit,
            "between": None if self.between is None else digest(self.between),
            "edited": digest(self.after),
            "variant": self.variant.label,
            **every,
            "size": list(settings.size),
            "nor": self.variant.nor,
            "base": self.base,
            "base_spp": self.start.base_spp,
            "reference": plan.reference_spp,
            "reference_spp": self.start.reference_spp,
            "size_scale": plan.size_scale,
            "marks": list(marks),
        }


def tasks(bench: ImpactBench, plan: Plan) -> list[Task]:
    """First everything at equal paths, which is soon done, then everything at equal seconds."""
    places = [(name, base) for base in plan.bases for name in plan.edits if name != DRAG]
    groups = [[_case(bench, *place, variant) for variant in variants(plan.nors)] for place in places]
    found: list[Task] = []
    if STEPS in plan.measures:
        found += [_at_steps(bench, plan, case) for group in groups for case in group]
    if DRAGS in plan.measures and DRAG in plan.edits:
        found += [_drag(bench, plan, base, variant) for base in plan.bases for variant in DRAG_VARIANTS]
    if SECONDS in plan.measures:
        for group in groups:
            turns = interleaved(group, plan.repetitions)
            found += [_at_seconds(bench, plan, case, turn) for turn, case in turns]
    return found


def _case(bench: ImpactBench, name: str, base: int, variant: Variant) -> _Case:
    edit = EDITS[name]
    start = bench.start(edit.before, edit.stage, base)
    return _Case(name, edit.words, edit.stage, start, edit.after, base, variant, edit.between)


def _at_steps(bench: ImpactBench, plan: Plan, case: _Case) -> Task:
    marks, settings = sorted(plan.steps), plan.settings(case.stage)

    def measure(work: Work) -> Outcome:
        if reason := bench.missing(case.variant):
            return Outcome(skipped=reason)
        reference = case.start.reference(case.after, settings, _preparing(work))
        found = bench.after_steps(
            case.start, case.after, case.variant, settings, marks, _measuring(work), case.between
        )
        # Errors at equal paths do not depend on what else the machine does.
        return Outcome(rows=_rows(found, reference), load={})

    return Task(case.label, case.subject(plan, STEPS, marks), measure, 2 + 0.05 * marks[-1])


def _drag(bench: ImpactBench, plan: Plan, base: int, variant: Variant) -> Task:
    scene, settings = STAGES[DRAG_STAGE].scene, plan.settings(DRAG_STAGE)
    start, last = bench.start(scene, DRAG_STAGE, base), drag_step(scene, DRAG_STEPS)
    case = _Case(DRAG, DRAG, DRAG_STAGE, start, last, base, variant)

    def measure(work: Work) -> Outcome:
        if reason := bench.missing(variant):
            return Outcome(skipped=reason)
        rows = []
        for now, shown in bench.drag(start, variant, settings, DRAG_EDITS, DRAG_RESTS, _measuring(work)):
            rows += _rows([shown], start.reference(now, settings, lambda fraction: work.check()))
        return Outcome(rows=rows, load={})

    return Task(case.label, case.subject(plan, DRAGS, [*DRAG_EDITS, *DRAG_RESTS]), measure, 4)


def _at_seconds(bench: ImpactBench, plan: Plan, case: _Case, turn: int) -> Task:
    marks, settings = sorted(plan.seconds), plan.settings(case.stage)

    def measure(work: Work) -> Outcome:
        if reason := bench.missing(case.variant):
            return Outcome(skipped=reason)
        reference = case.start.reference(case.after, settings, _preparing(work))
        found, values = bench.after_seconds(
            case.start,
            case.after,
            case.variant,
            settings,
            marks,
            _measuring(work),
            work.timing_starts,
            case.between,
        )
        load = work.load()
        return Outcome(values, _rows(found, reference), load=load)

    subject = {**case.subject(plan, SECONDS, marks), "repetition": turn}
    return Task(f"{case.label}, seconds", subject, measure, 2 + marks[-1])


def _preparing(work: Work) -> Note:
    return lambda fraction: work.check(_PREPARATION * fraction)


def _measuring(work: Work) -> Note:
    return lambda fraction: work.check(_PREPARATION + (1 - _PREPARATION) * fraction)


def _rows(found: Iterable[Shown], reference: FloatImage) -> list[Row]:
    return [
        {"mark": one.mark, "steps": one.steps, "seconds": one.seconds, **errors(one.image, reference)}
        for one in found
    ]
