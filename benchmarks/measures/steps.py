"""`incpt bench steps`: what a step costs beside its kernels, and what repeating a tile gains.

The host's share of a step is the part of its wall time in which no kernel runs; the device tells when each
began and ended. Repetition is measured on whole pictures that an object fills, on meshes of rising size too:
the same tiles, samples and paths once pass after pass (BASE and REFINE), once tile after tile with all
samples of a pixel together (INCREMENTAL). What order alone is worth is measured on the tiles that the
spiral reaches first; see `path_order`.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import pyopencl as cl
import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.scenes import LARGE_SCENES, SCENES
from incpt.benchmarks.kit.store import Results, Row, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, significant, summary
from incpt.benchmarks.measures.path_order import (
    ORDERS,
    PASSES,
    TOGETHER,
    OrderedSession,
    ordered_slots,
    pixel_count,
    spiral_tiles,
)
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.model import Scene

NAME = "steps"
OVERHEAD, REPETITION, ORDER = "overhead", "repetition", "order"
SIZE = (960, 540)
THESIS_SIZE = (1280, 720)
"""Size at which the thesis ran, with tiles of 16 and NoR 256: 60 steps a second (Falcor, RTX 2070 Super)."""
FILLS = 0.6
"""Share of the object's bounding sphere that the picture of `close_up` shows."""
FULL_NOR = 256
KNOWN = {**SCENES, **LARGE_SCENES}
"""All scenes by name."""


@dataclass(frozen=True)
class Plan:
    """What is measured: `steps` of each mode, `samples` of each pixel of a picture of `close_size`, and those
    of the tiles that `spiral_steps` steps after an edit finish; of large scenes the second alone."""

    scenes: Sequence[str]
    steps: int = 12
    close_size: tuple[int, int] = (320, 180)
    samples: int = FULL_NOR
    spiral_steps: int = 4
    repetitions: int = 5

    def subject(self, name: str, **more: Any) -> Row:
        """That of a measurement of a scene. All of the plan is in it, so that tables keep plans apart."""
        return {
            "scene": name, "content": digest(KNOWN[name].scene), "steps": self.steps,
            "close_size": list(self.close_size), "samples": self.samples, "spiral_steps": self.spiral_steps,
            **more,
        }  # fmt: skip


class ProfiledDevice(Device):
    """A device that notes when its kernels run."""

    def __init__(self, choice: str | int | None = None) -> None:
        super().__init__(choice)
        self.queue = cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)
        self._events: list[cl.Event] = []

    def launch(self, kernel: cl.Kernel, size: int, *args: Any, work_group: int | None = None) -> cl.Event:
        event = super().launch(kernel, size, *args, work_group=work_group)
        self._events.append(event)
        return event

    def take_busy_seconds(self) -> float:
        """How long any kernel ran since the last call."""
        self.finish()
        spans = [(event.profile.start * 1e-9, event.profile.end * 1e-9) for event in self._events]
        self._events.clear()
        return union_length(spans)


def union_length(spans: Sequence[tuple[float, float]]) -> float:
    """How much (begin, end) cover together."""
    total, reached = 0.0, -math.inf
    for begin, end in sorted(spans):
        total += max(0.0, end - max(begin, reached))
        reached = max(reached, end)
    return total


def close_up(scene: Scene, name: str) -> Scene:
    """The scene with the camera turned to an object, so near that it fills the picture."""
    bounds = scene.object(name).world_bounds
    center, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2
    distance = float(np.linalg.norm(np.subtract(scene.camera.position, center)))
    half = FILLS * math.asin(min(radius / math.sqrt(3) / distance, 0.9))
    return scene.with_camera(target=tuple(center.tolist()), fov_y=math.degrees(2 * half))


def tasks(device: ProfiledDevice, plan: Plan) -> list[Task]:
    """For each scene: steps of every mode, then both ways to take the samples of the same tiles, and the
    orders of paths, in turns."""
    made = []
    for name in plan.scenes:
        large = name in LARGE_SCENES
        for size in () if large else (SIZE, THESIS_SIZE):
            for turn in range(plan.repetitions):
                made.append(_overhead(device, plan, name, size, turn))
        for turn, mode in interleaved((Mode.BASE, Mode.INCREMENTAL), plan.repetitions):
            made.append(_repetition(device, plan, name, mode, turn))
        for turn, order in () if large else interleaved(ORDERS, plan.repetitions):
            made.append(_order(device, plan, name, order, turn))
    return made


def _settings(name: str, size: tuple[int, int], nor: int = FULL_NOR) -> RenderSettings:
    bench = KNOWN[name]
    return RenderSettings(
        size=size,
        max_bounces=bench.max_bounces,
        transmission_bounces=bench.transmission_bounces,
        strategy="spiral",
        nor=nor,
        nor_adapts=False,
    )


def _overhead(device: ProfiledDevice, plan: Plan, name: str, size: tuple[int, int], turn: int) -> Task:
    def measure(work: Work) -> Outcome:
        session = Session(SCENES[name].scene, settings=_settings(name, size), device=device)
        session.build()
        session.step()
        work.timing_starts()
        rows: list[Row] = []
        for mode, enter in _ways_into(session, SCENES[name].moves):
            enter()
            for _ in range(plan.steps):
                if session.mode is not mode:
                    enter()
                rows.append(_step(session, device))
                work.check(len(rows) / (3 * plan.steps))
        return Outcome(rows=rows)

    subject = plan.subject(name, measure=OVERHEAD, size=list(size), repetition=turn)
    return Task(f"{name}: steps at {size[0]} x {size[1]}", subject, measure, 2.0)


def _ways_into(session: Session, moves: str) -> list[tuple[Mode, Callable[[], None]]]:
    """Each mode with what brings the session there. REFINE follows the one step that is BASE."""
    scene = session.scene
    turned = _turned(scene, moves)

    def refine() -> None:
        while session.mode is not Mode.REFINE:
            session.step()

    def edit() -> None:
        refine()
        session.edit(turned if session.scene == scene else scene)

    return [(Mode.BASE, session.restart), (Mode.REFINE, refine), (Mode.INCREMENTAL, edit)]


def _turned(scene: Scene, name: str) -> Scene:
    return scene.with_object(name, rotation=(0.0, 1.0, 0.0))


def _step(session: Session, device: ProfiledDevice) -> Row:
    mode = session.mode
    device.take_busy_seconds()
    began = time.perf_counter()
    session.step()
    seconds = time.perf_counter() - began
    return {"mode": mode.name, "ms": 1e3 * seconds, "kernels_ms": 1e3 * device.take_busy_seconds()}


def _repetition(device: Device, plan: Plan, name: str, mode: Mode, turn: int) -> Task:
    def measure(work: Work) -> Outcome:
        bench = KNOWN[name]
        scene = close_up(bench.scene, bench.moves)
        settings = _settings(name, plan.close_size, plan.samples)
        session = Session(scene, settings=settings, device=device)
        session.build()
        session.render(2)
        if mode is Mode.BASE:
            session.restart()
        else:
            session.edit(_turned(scene, bench.moves))
        work.timing_starts()
        seconds, paths = _all_samples(session, plan.samples, work)
        return Outcome({"paths": paths, "seconds": seconds, "paths_per_second": paths / seconds})

    subject = plan.subject(name, measure=REPETITION, mode=mode.name, repetition=turn)
    return Task(f"{name}: {plan.samples} samples in {mode.name}", subject, measure, 2.0)


def _all_samples(session: Session, samples: int, work: Work) -> tuple[float, int]:
    """Seconds and paths until every pixel has its samples and the queue is done."""
    seconds, paths = 0.0, 0
    while session.mode is not Mode.REFINE or session.tile_spp.min() < samples:
        report = session.step()
        seconds, paths = seconds + report.seconds, paths + report.paths
        work.check(float(session.tile_spp.mean()) / samples)
    return seconds, paths


def _order(device: Device, plan: Plan, name: str, order: str, turn: int) -> Task:
    def measure(work: Work) -> Outcome:
        bench = SCENES[name]
        session = OrderedSession(bench.scene, settings=_settings(name, SIZE, plan.samples), device=device)
        session.build()
        session.render(1)
        session.edit(_turned(bench.scene, bench.moves))
        tiles = spiral_tiles(session, plan.spiral_steps)
        slots, slot_width_px = ordered_slots(order, session.grid, tiles, plan.samples)
        session.trace_seconds(slots[: session.grid.count], slot_width_px)  # the kernel's first launch
        work.check()
        work.timing_starts()
        seconds = session.trace_seconds(slots, slot_width_px)
        # Those in the picture, which are the same for all orders.
        paths = pixel_count(session.grid, tiles) * plan.samples
        values = {"tiles": len(tiles), "paths": paths, "seconds": seconds}
        return Outcome({**values, "paths_per_second": paths / seconds})

    subject = plan.subject(name, measure=ORDER, size=list(SIZE), order=order, repetition=turn)
    return Task(f"{name}: paths {order}", subject, measure)


# ------------------------------------------------------------------------------------------ the tables


def tables(results: Results) -> list[Table]:
    """The host's share of steps, what repetition gains, and what the order of paths is worth."""
    made = [_overhead_table(results), _repetition_table(results), _order_table(results)]
    return [table for table in made if table.row_count] or made[:1]


def overhead(row: Row) -> float:
    """Share of a step in which no kernel ran."""
    return 1 - float(row["kernels_ms"]) / float(row["ms"])


def _overhead_table(results: Results) -> Table:
    shown = Table(
        title="steps and what they take beside kernels", title_justify="left", box=None, pad_edge=False
    )
    for column in ("scene", "size", "mode"):
        shown.add_column(column)
    for column in ("ms", "of kernels", "beside them, %", "steps a second"):
        shown.add_column(column, justify="right")
    rows: dict[tuple[str, str, str], list[Row]] = {}
    for record in results.where(measure=OVERHEAD):
        width, height = record.subject["size"]
        for row in record.rows:
            key = record.subject["scene"], f"{width} x {height}", row["mode"]
            rows.setdefault(key, []).append(row)
    for key, found in rows.items():
        milliseconds = summary([row["ms"] for row in found])
        shown.add_row(
            *key,
            milliseconds.text(),
            significant(statistics.median(row["kernels_ms"] for row in found)),
            significant(100 * statistics.median(map(overhead, found)), 2),
            significant(1e3 / milliseconds.median),
        )
    return shown


def repetition_rates(results: Results) -> dict[tuple[str, str], list[float]]:
    """Million paths per second of the repetitions by (scene, mode)."""
    return _rates(results, REPETITION, "mode")


def order_rates(results: Results) -> dict[tuple[str, str], list[float]]:
    """Million paths per second of the repetitions by (scene, order)."""
    return _rates(results, ORDER, "order")


def _rates(results: Results, measure: str, way: str) -> dict[tuple[str, str], list[float]]:
    chosen = Results(results.environments, tuple(results.where(measure=measure)))
    found = grouped(chosen, lambda record: record.values["paths_per_second"] / 1e6, "scene", way)
    return {(str(scene), str(name)): rates for (scene, name), rates in found.items()}


def _repetition_table(results: Results) -> Table:
    columns = {
        Mode.BASE.name: "BASE, pass after pass",
        Mode.INCREMENTAL.name: "INCREMENTAL, tile after tile",
    }
    title = "million paths per second over the same tiles of a picture that the object fills"
    return _rate_table(title, repetition_rates(results), columns, Mode.INCREMENTAL.name, Mode.BASE.name)


def _order_table(results: Results) -> Table:
    title = "million paths per second of the tiles that the spiral reaches first, by the order of paths"
    return _rate_table(title, order_rates(results), {order: order for order in ORDERS}, TOGETHER, PASSES)


def _rate_table(
    title: str, rates: dict[tuple[str, str], list[float]], columns: dict[str, str], way: str, base: str
) -> Table:
    """A row for each scene: the rate of each of the ways in `columns`, and what `way` gains over `base`."""
    shown = Table(title=title, title_justify="left", box=None, pad_edge=False)
    shown.add_column("scene")
    for column in (*columns.values(), "gain"):
        shown.add_column(column, justify="right")
    for scene in dict.fromkeys(scene for scene, _ in rates):
        found = [rates.get((scene, name)) for name in columns]
        faster, slower = rates.get((scene, way)), rates.get((scene, base))
        gain = statistics.median(faster) / statistics.median(slower) if faster and slower else None
        texts = [summary(rate).text() if rate else "" for rate in found]
        shown.add_row(scene, *texts, "" if gain is None else f"{significant(gain)} x")
    return shown


def steps(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    scene: options.SceneOption = None,
    samples: Annotated[int | None, typer.Option(help="Of each pixel, to compare repetition.", min=1)] = None,
    repetitions: options.RepetitionsOption = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """A step's cost beside its kernels, steps per second, what repeating a tile gains, and order alone."""
    plan = Plan(options.chosen("--scene", scene, list(KNOWN)))
    if quick:
        plan = replace(plan, steps=5, close_size=(160, 90), spiral_steps=2, repetitions=2)
        # Millions of triangles take long to make.
        plan = replace(plan, scenes=plan.scenes if scene else [*SCENES, "terrain-1m"])
    plan = replace(plan, samples=samples or plan.samples, repetitions=repetitions or plan.repetitions)
    opened = ProfiledDevice(device)
    store = Store(output, NAME)
    found = experiment.run(store, tasks(opened, plan), environment.describe(opened))
    print_table(tables(found), found, store)
