"""`incpt bench rays`: traversal alone, beside Embree on the same rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.scenes import SCENES
from incpt.benchmarks.kit.store import Results, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, significant, summary
from incpt.benchmarks.measures.traversal import (
    EmbreeTracer,
    PlacedRays,
    Rays,
    Tracer,
    bytes_read,
    camera_rays,
    scattered_rays,
    shadow_rays,
)
from incpt.device.device import Device

NAME = "rays"
KINDS = ("coherent", "incoherent", "shadow")
TRACERS = ("incpt", "embree")
LEAST_S = 0.3
"""A measurement repeats the rays until it has lasted that long."""


@dataclass(frozen=True)
class Plan:
    """What is traced."""

    scenes: Sequence[str]
    size: tuple[int, int] = (1024, 1024)
    repetitions: int = 7
    threads: int = 1


class _SceneRays:
    """The rays of a scene and who traces them, made when they are first needed."""

    def __init__(self, device: Device, name: str, plan: Plan) -> None:
        self._device, self._scene, self._plan = device, SCENES[name].scene, plan
        self._tracer: Tracer | None = None
        self._embree: EmbreeTracer | None = None
        self._placed: dict[str, PlacedRays] = {}

    @property
    def tracer(self) -> Tracer:
        """incpt's."""
        if self._tracer is None:
            self._tracer = Tracer(self._device, self._scene)
        return self._tracer

    @property
    def embree(self) -> EmbreeTracer:
        """Embree's. Raises ImportError."""
        if self._embree is None:
            self._embree = EmbreeTracer(self._scene, self._plan.threads)
        return self._embree

    def placed(self, kind: str) -> PlacedRays:
        """The rays of a kind, on the device; their arrays are in them."""
        if not self._placed:
            first = camera_rays(self._scene.camera, self._plan.size, self.tracer.in_squares)
            coherent = self.tracer.place(first)
            distances = coherent.result()
            self._placed = {
                "coherent": coherent,
                "incoherent": self.tracer.place(scattered_rays(first, distances, len(first), 1)),
                "shadow": self.tracer.place(shadow_rays(self._scene, first, distances, 2)),
            }
        return self._placed[kind]


def tasks(device: Device, plan: Plan) -> list[Task]:
    """For each scene and kind of rays: a count of visits, then both tracers in turns."""
    made = []
    for name in plan.scenes:
        scene_rays = _SceneRays(device, name, plan)
        for kind in KINDS:
            made.append(_count(scene_rays, name, kind, plan))
            turns = interleaved(TRACERS, plan.repetitions)
            made += [_timed(scene_rays, name, kind, tracer, turn, plan) for turn, tracer in turns]
    return made


def _subject(name: str, kind: str, plan: Plan, **more: Any) -> dict[str, Any]:
    content = digest(SCENES[name].scene)
    return {"scene": name, "content": content, "rays": kind, "size": list(plan.size), **more}


def _count(scene_rays: _SceneRays, name: str, kind: str, plan: Plan) -> Task:
    def measure(work: Work) -> Outcome:
        rays = scene_rays.placed(kind).rays
        nodes, packs = scene_rays.tracer.visits(rays)
        values = {"nodes_per_ray": nodes, "packs_per_ray": packs, "bytes_per_ray": bytes_read(nodes, packs)}
        return Outcome({"count": len(rays), **values})

    return Task(f"{name}: {kind} rays: visits", _subject(name, kind, plan, measure="visits"), measure)


def _timed(scene_rays: _SceneRays, name: str, kind: str, tracer: str, turn: int, plan: Plan) -> Task:
    def measure(work: Work) -> Outcome:
        placed = scene_rays.placed(kind)
        values: dict[str, Any] = {"count": len(placed.rays)}
        if tracer == "incpt":
            seconds, rounds = _repeat(placed.seconds, work)
        else:
            try:
                embree = scene_rays.embree
            except ImportError:
                return Outcome(skipped='embree: not installed; run pip install "incpt[peers]"')
            if turn == 0:
                values["differ"] = disagreement(placed.result(), embree.result(placed.rays), placed.rays)
            seconds, rounds = _repeat(lambda: embree.seconds(placed.rays), work)
        return Outcome({**values, "rounds": rounds, "rays_per_second": rounds * len(placed.rays) / seconds})

    more = {"measure": "rate", "tracer": tracer, "threads": plan.threads, "repetition": turn}
    return Task(f"{name}: {kind} rays: {tracer}", _subject(name, kind, plan, **more), measure)


def _repeat(once: Any, work: Work) -> tuple[float, int]:
    once()  # warms up
    work.check(0.3)
    work.timing_starts()
    seconds, rounds = 0.0, 0
    while seconds < LEAST_S:
        seconds += once()
        rounds += 1
    return seconds, rounds


def disagreement(ours: Any, theirs: Any, rays: Rays) -> float:
    """The share of rays for which two tracers found different things: one nothing, or a distance that
    differs by a thousandth. Rays along edges may."""
    if rays.any_hit:
        return float(np.mean(ours != theirs))
    same = np.isclose(ours, theirs, rtol=1e-3, atol=1e-4) | (np.isinf(ours) & np.isinf(theirs))
    return float(1 - same.mean())


def table(results: Results) -> Table:
    """Million rays per second, and what a ray is tested against."""
    shown = Table(title="million rays per second", title_justify="left", box=None, pad_edge=False)
    for column in ("scene", "rays"):
        shown.add_column(column)
    for column in ("incpt", "Embree", "incpt to Embree", "nodes/ray", "packs/ray", "bytes/ray", "differ"):
        shown.add_column(column, justify="right")
    rates = grouped(results, lambda r: r.values.get("rays_per_second"), "scene", "rays", "tracer")
    visits = {(r.subject["scene"], r.subject["rays"]): r.values for r in results.where(measure="visits")}
    differ = grouped(results, lambda r: r.values.get("differ"), "scene", "rays")
    for scene, kind in dict.fromkeys((scene, kind) for scene, kind, _ in rates):
        own, other = (rates.get((scene, kind, tracer)) for tracer in TRACERS)
        both = [summary([v / 1e6 for v in values]) if values else None for values in (own, other)]
        ratio = f"{both[0].median / both[1].median:.2f} x" if both[0] and both[1] else ""
        found = visits.get((scene, kind), {})
        numbers = [
            significant(found[n]) if n in found else ""
            for n in ("nodes_per_ray", "packs_per_ray", "bytes_per_ray")
        ]
        off = differ.get((scene, kind))
        shown.add_row(
            str(scene), str(kind), *(s.text() if s else "" for s in both), ratio, *numbers,
            f"{off[0]:.1e}" if off else "",
        )  # fmt: skip
    return shown


def rays(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    scene: options.SceneOption = None,
    size: options.SizeOption = None,
    repetitions: options.RepetitionsOption = None,
    threads: Annotated[int | None, typer.Option(help="Of Embree [default: all cores].", min=1)] = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """Coherent, incoherent and shadow rays beside Embree, with node visits and triangle tests per ray."""
    plan = Plan(
        options.chosen("--scene", scene, list(SCENES)),
        options.parse_size(size, (512, 512) if quick else (1024, 1024)),
        repetitions or (3 if quick else 7),
        threads or environment.usable_cores(),
    )
    opened = Device(device)
    store = Store(output, NAME)
    found = experiment.run(store, tasks(opened, plan), environment.describe(opened))
    print_table(table(found), found, store)
