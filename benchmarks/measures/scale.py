"""`incpt bench scale`: what a picture costs against resolution, triangles, objects, bounces and lights."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.fit import PowerLaw, fitted
from incpt.benchmarks.kit.scenes import SCENES, crowd, lanterns, matte, plane, terrain
from incpt.benchmarks.kit.store import Results, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, summary
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.model import Object, Scene

NAME = "scale"


@dataclass(frozen=True)
class Axis:
    """One thing that grows while everything else stays: its values, and the scene and settings of each."""

    name: str
    what: str
    values: Sequence[int]
    quick: Sequence[int]
    case: Callable[[int, RenderSettings], tuple[Scene, RenderSettings]]


def _pixels(count: int, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    width = math.isqrt(count)
    return SCENES["cornell"].scene, replace(settings, size=(width, width))


def _triangles(count: int, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    ground = Object("ground", terrain(count), "ground")
    floor = plane("floor", "ground", (0, -0.3, 0), (0, 0, 0), (8, 1, 8))
    sky = Environment(color=(0.8, 0.9, 1.0))
    camera = Camera((0, 1.2, 2.4), (0, 0, 0), fov_y=45)
    return Scene(camera, sky, {"ground": matte(0.5, 0.5, 0.45)}, (ground, floor)), settings


def _objects(count: int, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    return crowd(count), settings


def _bounces(count: int, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    # Without roulette, so that every path is as long as it may be.
    return SCENES["cornell"].scene, replace(settings, max_bounces=count, roulette_depth=255)


def _lights(count: int, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    return lanterns(count), settings


_SIDES = (64, 128, 256, 512, 1024, 2048)

AXES = (
    Axis("resolution", "pixels", tuple(n * n for n in _SIDES), (32 * 32, 64 * 64, 128 * 128), _pixels),
    Axis("triangles", "triangles", (100, 1_000, 10_000, 100_000, 1_000_000), (100, 10_000), _triangles),
    Axis("objects", "objects", (1, 10, 100, 1_000, 10_000, 100_000), (1, 10, 100), _objects),
    Axis("bounces", "scattering events after the first hit", (1, 2, 4, 8, 16), (1, 2, 4), _bounces),
    Axis("lights", "lamps of the same power in all", (1, 4, 16, 64, 256, 1024), (1, 4, 16), _lights),
)


@dataclass(frozen=True)
class Plan:
    """What is varied, at which resolution where that is not it."""

    axes: Sequence[str] = tuple(axis.name for axis in AXES)
    size: tuple[int, int] = (512, 512)
    max_bounces: int = 2
    least_s: float = 1.0
    repetitions: int = 5
    quick: bool = False

    @property
    def settings(self) -> RenderSettings:
        """Those of every case, but for what is varied."""
        return RenderSettings(size=self.size, max_bounces=self.max_bounces, strategy="restart")


def tasks(device: Device, plan: Plan) -> list[Task]:
    """For each axis its values in turns."""
    sessions = _Sessions(device)
    made = []
    for axis in AXES:
        if axis.name in plan.axes:
            values = axis.quick if plan.quick else axis.values
            for turn, value in interleaved(values, plan.repetitions):
                made.append(_task(sessions, axis, value, turn, plan))
    return made


def _task(sessions: _Sessions, axis: Axis, value: int, turn: int, plan: Plan) -> Task:
    subject = {
        "axis": axis.name, "value": value, "size": list(plan.size), "max_bounces": plan.max_bounces,
        "least_s": plan.least_s, "repetition": turn,
    }  # fmt: skip

    def measure(work: Work) -> Outcome:
        session = sessions.at(axis, value, plan.settings)
        work.timing_starts()
        seconds, steps = 0.0, 0
        while seconds < plan.least_s:
            seconds += sessions.step(session)
            steps += 1
            work.check()
        pixels = session.size[0] * session.size[1]
        values = {
            "step_ms": 1e3 * seconds / steps,
            "paths_per_second": steps * pixels / seconds,
            "steps": steps,
            "content": digest(session.scene),
        }
        return Outcome(values)

    return Task(f"{axis.name}: {value:,}", subject, measure)


class _Sessions:
    """Sessions that have rendered a picture already; only the latest one is kept."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._place: tuple[str, int] | None = None
        self._session: Session | None = None

    def at(self, axis: Axis, value: int, settings: RenderSettings) -> Session:
        """The session of a case, warm."""
        if self._place != (axis.name, value) or self._session is None:
            scene, chosen = axis.case(value, settings)
            self._session = None  # before the next one takes its memory
            self._session = Session(scene, settings=chosen, device=self._device)
            self._place = axis.name, value
            self._session.render(2)
        return self._session

    def step(self, session: Session) -> float:
        """Seconds of a step over the whole picture."""
        began = time.perf_counter()
        session.step()
        session.device.finish()
        return time.perf_counter() - began


def growth(results: Results, axis: str) -> tuple[list[tuple[float, float]], PowerLaw | None]:
    """(value, median milliseconds of a step) of an axis, by value, and the power law through them."""
    chosen = Results(results.environments, tuple(results.where(axis=axis)))
    times = grouped(chosen, lambda r: r.values["step_ms"], "value")
    points = sorted((float(value), summary(times[value,]).median) for (value,) in times)
    return points, fitted([p[0] for p in points], [p[1] for p in points])


def table(results: Results) -> Table:
    """A row for each axis: what a step takes at its values, and how that grows."""
    shown = Table(title="milliseconds of a step (one path per pixel)", box=None, pad_edge=False)
    for column in ("", "values", "ms", "grows as"):
        shown.add_column(column)
    for axis in AXES:
        points, law = growth(results, axis.name)
        if points:
            values = " / ".join(f"{value:,.0f}" for value, _ in points)
            times = " / ".join(f"{ms:.3g}" for _, ms in points)
            what = axis.name if axis.name == axis.what else f"{axis.name} ({axis.what})"
            shown.add_row(what, values, times, law.text() if law else "")
    return shown


def scale(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    axis: Annotated[
        list[str] | None, typer.Option(help="What grows; may be repeated [default: all].")
    ] = None,
    size: options.SizeOption = None,
    max_bounces: Annotated[int, typer.Option("--max-bounces", help="Where they do not grow.", min=0)] = 2,
    repetitions: options.RepetitionsOption = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """Cost against resolution, triangles, objects, bounces and lights, with the fitted exponent."""
    plan = Plan(
        options.chosen("--axis", axis, [a.name for a in AXES]),
        options.parse_size(size, (128, 128) if quick else Plan.size),
        max_bounces,
        0.05 if quick else Plan.least_s,
        repetitions or (2 if quick else Plan.repetitions),
        quick,
    )
    opened = Device(device)
    store = Store(output, NAME)
    found = experiment.run(store, tasks(opened, plan), environment.describe(opened))
    print_table(table(found), found, store)
