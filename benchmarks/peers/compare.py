"""`incpt bench peers`: incpt beside Mitsuba 3 and Cycles on the same work, in the same run.

First every renderer makes a picture of each scene, and its mean radiance is compared with that of a
converged one: whoever does not do the same work is not timed. Then, taking turns, each traces for about the
same time (paths per second, and the error of that picture times the seconds it took), and moves an object
(time from the edit to a picture with one sample per pixel).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer
from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.content import digest
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.pictures import Gallery, mean_radiance
from incpt.benchmarks.kit.scenes import SCENES
from incpt.benchmarks.kit.store import Results, Store, grouped
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import interleaved, significant, summary
from incpt.benchmarks.peers.peer import PEERS, FloatImage, Job, MissingPeer
from incpt.benchmarks.peers.worker import Worker
from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.picture.metrics import relative_mse

NAME = "peers"
MEAN_TOLERANCE = 0.01
"""Largest difference of mean radiance beyond its noise, as a fraction, at which two renderers do the same
work."""
CHECK_SPP = 16
MOST_CHECKS = 16
WARM_UP_SPP = 4
MOST_SPP = 4096
LEAST_SECONDS, MOST_SECONDS = 0.01, 3600.0
REFERENCE_SEED = 1 << 31
CHECK, RATE, MOVE = "check", "rate", "move"


@dataclass(frozen=True)
class Plan:
    """What is compared, and how long."""

    scenes: Sequence[str]
    peers: Sequence[str]
    size: tuple[int, int] = (512, 512)
    seconds: float = 3.0
    repetitions: int = 5
    reference_spp: int = 2048
    threads: int = 1
    max_bounces: int | None = None

    def job(self, scene: str) -> Job:
        """The work of a scene."""
        bench = SCENES[scene]
        bounces = bench.max_bounces if self.max_bounces is None else self.max_bounces
        return Job(bench.scene, self.size, bounces, bench.transmission_bounces, self.threads)


class Pool:
    """The workers, started when they are first needed, with the scene that each has loaded."""

    def __init__(self, threads: int, device: str | None = None) -> None:
        self._threads, self._device = threads, device
        self._workers: dict[str, Worker] = {}
        self._loaded: dict[str, str] = {}
        self.missing: dict[str, str] = {}
        self.samples: dict[tuple[str, str], int] = {}

    def worker(self, peer: str, scene: str, job: Job) -> Worker:
        """With the scene loaded. Raises MissingPeer, also where it has no counterpart of what is in the
        scene; that says nothing of other scenes."""
        problem = self.problem(peer, scene)
        if problem is not None:
            raise MissingPeer(problem)
        key = peer
        try:
            if peer not in self._workers:
                self._workers[peer] = Worker(peer, self._threads, self._device)
            key = f"{peer} on {scene}"
            if self._loaded.get(peer) != scene:
                self._workers[peer].load(job)
                self._loaded[peer] = scene
        except MissingPeer as missing:
            self.missing[key] = f"{key}: {missing}"
            raise MissingPeer(self.missing[key]) from None
        return self._workers[peer]

    def problem(self, peer: str, scene: str) -> str | None:
        """Why there is no worker with that scene, as far as is known."""
        return self.missing.get(peer) or self.missing.get(f"{peer} on {scene}")

    def close(self) -> None:
        """End all of them."""
        for worker in self._workers.values():
            worker.close()


def tasks(plan: Plan, store: Store, pool: Pool, gallery: Gallery) -> list[Task]:
    """Checks first, then what is timed; renderers take turns."""
    made = []
    for scene in plan.scenes:
        bench = _SceneBench(plan, scene, store, pool, gallery)
        made += [bench.check(peer) for peer in plan.peers]
        made += [bench.rate(peer, turn) for turn, peer in interleaved(plan.peers, plan.repetitions)]
        made += [bench.move(peer, turn) for turn, peer in interleaved(plan.peers, plan.repetitions)]
    return made


class _SceneBench:
    """The tasks of one scene."""

    def __init__(self, plan: Plan, scene: str, store: Store, pool: Pool, gallery: Gallery) -> None:
        self._plan, self._scene, self._store = plan, scene, store
        self._pool, self._gallery = pool, gallery
        self._job = plan.job(scene)

    def check(self, peer: str) -> Task:
        def measure(work: Work) -> Outcome:
            reference = self._reference(work)
            worker = self._worker(peer)
            total = np.zeros(reference.shape)
            for renders in range(1, MOST_CHECKS + 1):
                total += worker.image(CHECK_SPP, seed=renders)
                noise = noise_of_mean(total / renders, reference)
                if 3 * noise < MEAN_TOLERANCE / 2:
                    break
                work.check()
            found, expected = mean_radiance(total / renders), mean_radiance(reference)
            off = difference(found, expected)
            return Outcome(
                {
                    "mean": found,
                    "expected": expected,
                    "off": off,
                    "noise": noise,
                    "spp": renders * CHECK_SPP,
                    "agrees": off <= MEAN_TOLERANCE + 3 * noise,
                }
            )

        return self._task(CHECK, peer, {}, measure, 1.0)

    def rate(self, peer: str, turn: int) -> Task:
        def measure(work: Work) -> Outcome:
            if problem := self._disagreement(peer):
                return Outcome(skipped=problem)
            reference = self._reference(work)
            worker = self._worker(peer)
            spp = self._samples(worker)
            work.check(0.3)
            work.timing_starts()
            seconds = worker.time(spp, seed=2 * turn + 10)
            load = work.load()
            image = worker.image(spp, seed=2 * turn + 11)
            error = relative_mse(image, reference)
            values = {
                "spp": spp,
                "seconds": seconds,
                "paths_per_second": spp * self._job.pixels / seconds,
                "relative_mse": error,
                "error_seconds": error * seconds,
            }
            return Outcome(values, load=load)

        settings = {"seconds": self._plan.seconds, "repetition": turn}
        return self._task(RATE, peer, settings, measure, 2 * self._plan.seconds)

    def move(self, peer: str, turn: int) -> Task:
        def measure(work: Work) -> Outcome:
            if problem := self._disagreement(peer):
                return Outcome(skipped=problem)
            worker = self._worker(peer)
            name = SCENES[self._scene].moves
            x, y, z = self._job.scene.object(name).position
            worker.move(name, (x + 0.1, y, z), seed=turn)  # the first one compiles
            work.timing_starts()
            values = {"ms": 1e3 * worker.move(name, (x, y, z), seed=turn)}
            if peer == "incpt":
                worker.first_tiles(name, (x + 0.1, y, z), seed=turn)
                values["first_tiles_ms"] = 1e3 * worker.first_tiles(name, (x, y, z), seed=turn)
            return Outcome(values)

        return self._task(MOVE, peer, {"repetition": turn}, measure, 0.5)

    def _task(self, measure: str, peer: str, settings: dict[str, Any], run: Any, weight: float) -> Task:
        def guarded(work: Work) -> Outcome:
            try:
                outcome: Outcome = run(work)
                return outcome
            except MissingPeer as missing:
                return Outcome(skipped=str(missing))

        job = self._job
        subject = {
            "measure": measure, "scene": self._scene, "peer": peer, "content": digest(job.scene),
            "size": list(job.size), "max_bounces": job.max_bounces,
            "transmission_bounces": job.transmission_bounces, "threads": job.threads,
            "reference_spp": self._plan.reference_spp, **settings,
        }  # fmt: skip
        return Task(f"{self._scene}: {peer}: {measure}", subject, guarded, weight)

    def _worker(self, peer: str) -> Worker:
        return self._pool.worker(peer, self._scene, self._job)

    def _reference(self, work: Work) -> FloatImage:
        job = self._job
        settings = RenderSettings(
            size=job.size, max_bounces=job.max_bounces, transmission_bounces=job.transmission_bounces,
            seed=REFERENCE_SEED,
        )  # fmt: skip
        return self._gallery.converged(
            job.scene, settings, self._plan.reference_spp, lambda fraction: work.check(0.3 * fraction)
        )

    def _samples(self, worker: Worker) -> int:
        """Samples per pixel that take about the planned time."""
        key = worker.name, self._scene
        if key not in self._pool.samples:
            worker.time(WARM_UP_SPP, seed=3)  # compiles
            seconds = max(worker.time(WARM_UP_SPP, seed=4), 1e-3)
            self._pool.samples[key] = sample_count(self._plan.seconds * WARM_UP_SPP / seconds)
            worker.time(self._pool.samples[key], seed=5)  # Mitsuba may compile again for another number
        return self._pool.samples[key]

    def _disagreement(self, peer: str) -> str | None:
        problem = self._pool.problem(peer, self._scene)
        if problem is not None:
            return problem
        wanted = self.check(peer).subject
        for record in reversed(self._store.read().where(**wanted)):
            if record.values["agrees"]:
                return None
            off = 100 * float(record.values["off"])
            return f"{peer} on {self._scene}: not timed, its mean radiance is off by {off:.1f} %"
        return f"{peer} on {self._scene}: not timed, since its picture was not checked"


def difference(found: Sequence[float], expected: Sequence[float]) -> float:
    """Largest difference of a channel as a fraction of the mean of all."""
    level = max(sum(expected) / len(expected), 1e-12)
    return max(abs(a - b) for a, b in zip(found, expected, strict=True)) / level


def noise_of_mean(image: npt.NDArray[np.float64], reference: FloatImage) -> float:
    """Standard error of a picture's mean radiance, as a fraction of it, from how its pixels scatter around
    those of a converged one."""
    residual = (image - reference).mean(axis=2)
    return float(residual.std() / np.sqrt(residual.size) / max(float(reference.mean()), 1e-12))


def sample_count(wanted: float) -> int:
    """A number of samples near `wanted` that renderers like: a multiple of 4, above 16 of 16."""
    multiple = 16 if wanted > 16 else 4
    return int(min(max(multiple * round(wanted / multiple), multiple), MOST_SPP))


# ------------------------------------------------------------------------------------------ the tables


def tables(results: Results) -> list[Table]:
    """Renderers beside scenes, as in the project's targets: rate, error times time, latency of an edit."""
    latency = _table(results, MOVE, "ms", "edit to first picture, ms", 1.0, False)
    _add_first_tiles(latency, results)
    return [
        _table(results, RATE, "paths_per_second", "million camera paths per second", 1e-6, True),
        _table(results, RATE, "error_seconds", "relMSE x seconds", 1.0, False),
        latency,
    ]


def _add_first_tiles(table: Table, results: Results) -> None:
    """Rows for what only incpt has: a picture that is kept, and the tiles that an edit touches first."""
    first = medians(results, MOVE, "first_tiles_ms")
    if not first:
        return
    whole = medians(results, MOVE, "ms")
    scenes = list(dict.fromkeys(scene for _, scene in whole))
    table.add_row(
        "incpt, kept picture with the first tiles anew",
        *(summary(t).text() if (t := first.get(("incpt", scene))) else "" for scene in scenes),
    )
    joined = {**whole, **first}
    ratios = [advantage(joined, scene, more_is_better=False) for scene in scenes]
    table.add_row("that to the best other", *("" if r is None else f"{significant(r)} x" for r in ratios))


def medians(results: Results, measure: str, value: str) -> dict[tuple[str, str], list[float]]:
    """Values of the repetitions by (peer, scene)."""
    chosen = Results(results.environments, tuple(results.where(measure=measure)))
    found = grouped(chosen, lambda record: record.values.get(value), "peer", "scene")
    return {(str(peer), str(scene)): values for (peer, scene), values in found.items()}


def _table(
    results: Results, measure: str, value: str, title: str, scale: float, more_is_better: bool
) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    found = medians(results, measure, value)
    scenes = list(dict.fromkeys(scene for _, scene in found))
    for scene in scenes:
        table.add_column(scene, justify="right", no_wrap=True)
    peers = list(dict.fromkeys(peer for peer, _ in found))
    for peer in peers:
        timed = [found.get((peer, scene)) for scene in scenes]
        table.add_row(peer, *(summary([scale * v for v in t]).text() if t else "" for t in timed))
    ratios = [advantage(found, scene, more_is_better) for scene in scenes]
    if any(ratio is not None for ratio in ratios):
        table.add_row(
            "incpt to the best other", *("" if r is None else f"{significant(r)} x" for r in ratios)
        )
    return table


def advantage(found: dict[tuple[str, str], list[float]], scene: str, more_is_better: bool) -> float | None:
    """How many times better than the best other renderer incpt is; None without one."""
    own = found.get(("incpt", scene))
    others = [float(np.median(v)) for (peer, s), v in found.items() if s == scene and peer != "incpt"]
    if not own or not others:
        return None
    mine = float(np.median(own))
    ratio = mine / max(others) if more_is_better else min(others) / mine
    return ratio if math.isfinite(ratio) else None


def peers(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    scene: options.SceneOption = None,
    peer: Annotated[
        list[str] | None, typer.Option(help="A renderer; may be repeated [default: all].")
    ] = None,
    size: options.SizeOption = None,
    seconds: Annotated[float | None, typer.Option(help="About how long each traces.")] = None,
    repetitions: options.RepetitionsOption = None,
    max_bounces: Annotated[int | None, typer.Option("--max-bounces", help="For all scenes.", min=0)] = None,
    threads: Annotated[int | None, typer.Option(help="Of each renderer [default: all cores].", min=1)] = None,
    reference_spp: Annotated[int | None, typer.Option(help="Samples to compare with.", min=1)] = None,
    quick: options.QuickOption = False,
    device: options.DeviceOption = None,
) -> None:
    """Paths per second, error x time and latency beside Mitsuba 3 and Cycles, where they are installed."""
    if seconds is not None and not LEAST_SECONDS <= seconds <= MOST_SECONDS:
        raise InputError(f"--seconds: {seconds:g} is out of range; use {LEAST_SECONDS:g} to {MOST_SECONDS:g}")
    plan = Plan(
        options.chosen("--scene", scene, list(SCENES)),
        options.chosen("--peer", peer, PEERS),
        options.parse_size(size, (128, 128) if quick else (512, 512)),
        seconds or (0.5 if quick else 3.0),
        repetitions or (2 if quick else 5),
        reference_spp or (512 if quick else 2048),
        threads or environment.usable_cores(),
        max_bounces,
    )
    opened = Device(device)
    store = Store(output, NAME)
    pool = Pool(plan.threads, device)
    try:
        every = tasks(plan, store, pool, Gallery(output / "references", opened))
        found = experiment.run(store, every, environment.describe(opened))
    finally:
        pool.close()
    print_table(tables(found), found, store)
