"""The benchmark scenes: sizes that the issue of each comparison names, and the same pictures elsewhere."""

from __future__ import annotations

import importlib.util
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit import scenes
from incpt.benchmarks.kit.experiment import run
from incpt.benchmarks.kit.pictures import Gallery
from incpt.benchmarks.kit.store import Store
from incpt.benchmarks.peers import compare
from incpt.benchmarks.peers.mitsuba_peer import MOST_LANES, passes
from incpt.benchmarks.peers.peer import PEERS, FloatImage, Job, MissingPeer
from incpt.benchmarks.peers.worker import Worker
from incpt.core.affine import Vector
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session


@pytest.mark.parametrize("name", scenes.SCENES)
def test_scene_has_the_triangles_that_are_said(name: str) -> None:
    bench = scenes.SCENES[name]
    assert scenes.triangle_count(bench.scene) == bench.triangles
    assert bench.scene is bench.scene
    bench.scene.object(bench.moves)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["terrain-100k", "ball-1m"])  # the others are made the same way
def test_large_scene_has_the_triangles_that_are_said(name: str) -> None:
    bench = scenes.LARGE_SCENES[name]
    assert scenes.triangle_count(bench.scene) == bench.triangles
    assert bench.scene is bench.scene


def test_larger_scenes() -> None:
    assert len(scenes.terrain(20_000).faces) == 20_000
    crowd = scenes.crowd(30)
    assert len(crowd.objects) == 31 and len({id(o.mesh) for o in crowd.objects[1:]}) == 1


@pytest.mark.parametrize("count", [1, 3, 16])
def test_lanterns_emit_the_same_in_all(count: int, device: Device) -> None:
    def mean(number: int) -> float:
        session = Session(scenes.lanterns(number), (32, 32), RenderSettings(max_bounces=1), device)
        session.render(64)
        # Below the lamp, which is not seen the same.
        return float(session.image()[16:].mean())

    assert mean(count) == pytest.approx(mean(4), rel=0.05)


# ---------------------------------------------------------------------------------------------- peers


class FakePeer:
    """A renderer that shows incpt's converged picture times `factor`, with the noise of its samples."""

    def __init__(self, picture: FloatImage, factor: float = 1.0, paths_per_second: float = 1e6) -> None:
        self.picture, self.factor, self.rate = picture, factor, paths_per_second
        self.log: list[str] = []
        self.name = ""

    def load(self, job: Job) -> None:
        self.job = job

    def time(self, spp: int, seed: int) -> float:
        self.log.append("time")
        return spp * self.job.pixels / self.rate

    def image(self, spp: int, seed: int) -> FloatImage:
        noise = np.random.default_rng(seed).normal(1, 0.2 * spp**-0.5, self.picture.shape)
        return (self.picture * self.factor * noise).astype(np.float32)

    def move(self, name: str, position: Vector, seed: int) -> float:
        self.log.append(f"move {position[0]:.2f}")
        return 0.005

    def first_tiles(self, name: str, position: Vector, seed: int) -> float:
        assert self.name == "incpt", "only incpt keeps its picture"
        return 0.001

    def close(self) -> None:
        self.log.append("close")


def peers_found(
    monkeypatch: pytest.MonkeyPatch, device: Device, folder: Path, factors: dict[str, float | None]
) -> tuple[Store, dict[str, FakePeer]]:
    """A whole comparison on the Cornell box; a renderer without a factor is not installed."""
    plan = compare.Plan(["cornell"], list(factors), (32, 32), 0.05, 2, 64, 1)
    gallery = Gallery(folder / "references", device)
    job = plan.job("cornell")
    settings = RenderSettings(
        size=job.size, max_bounces=job.max_bounces, transmission_bounces=job.transmission_bounces,
        seed=compare.REFERENCE_SEED,
    )  # fmt: skip
    picture = gallery.converged(job.scene, settings, 64, lambda fraction: None)
    made: dict[str, FakePeer] = {}

    def worker(name: str, threads: int, device_name: str | None = None) -> FakePeer:
        factor = factors[name]
        if factor is None:
            raise MissingPeer("not installed; run pip install it")
        made[name] = FakePeer(picture, factor, 2e6 if name == "incpt" else 1e6)
        made[name].name = name
        return made[name]

    monkeypatch.setattr(compare, "Worker", worker)
    store = Store(folder, compare.NAME)
    pool = compare.Pool(1)
    found = run(store, compare.tasks(plan, store, pool, gallery), {"id": "e"})
    pool.close()
    assert len(found.records) == len(store.read().records)
    return store, made


def test_peers_are_checked_then_timed(
    monkeypatch: pytest.MonkeyPatch, device: Device, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    factors = {"incpt": 1.0, "cycles": 1.0, "mitsuba scalar_rgb": 1.05, "mitsuba llvm_ad_rgb": None}
    store, made = peers_found(monkeypatch, device, tmp_path, factors)
    errors = capsys.readouterr().err
    assert errors.count("skipped: mitsuba llvm_ad_rgb") == 1
    assert "skipped: mitsuba llvm_ad_rgb: not installed; run pip install it" in errors
    assert "mitsuba scalar_rgb on cornell: not timed, its mean radiance is off by " in errors
    results = store.read()
    assert [r.values["agrees"] for r in results.where(measure="check")] == [True, True, False]
    rates = compare.medians(results, "rate", "paths_per_second")
    assert set(rates) == {("incpt", "cornell"), ("cycles", "cornell")}
    assert rates["incpt", "cornell"] == pytest.approx([2e6, 2e6])
    assert compare.advantage(rates, "cornell", more_is_better=True) == pytest.approx(2)
    errors_seconds = compare.medians(results, "rate", "error_seconds")
    assert compare.advantage(errors_seconds, "cornell", more_is_better=False) == pytest.approx(2, rel=0.3)
    # An object is put away before its way back is timed, and nobody who differs is timed at all.
    x = scenes.SCENES["cornell"].scene.object("tall").position[0]
    assert made["cycles"].log[-5:] == [f"move {x + 0.1:.2f}", f"move {x:.2f}"] * 2 + ["close"]
    assert made["mitsuba scalar_rgb"].log == ["close"]
    titles = [str(table.title) for table in compare.tables(results)]
    assert titles == ["million camera paths per second", "relMSE x seconds", "edit to first picture, ms"]
    latency = compare.tables(results)[2]
    rows = list(zip(*(list(column.cells) for column in latency.columns), strict=True))
    assert rows[-2:] == [
        ("incpt, kept picture with the first tiles anew", "1.00 ±0 %"),
        ("that to the best other", "5.00 x"),
    ]


def test_what_a_peer_lacks_for_one_scene_is_no_matter_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    class Untextured:
        def __init__(self, *_: object) -> None:
            self.scenes: list[str] = []

        def load(self, job: Job) -> None:
            if "ball" in job.scene.object_index:
                raise MissingPeer("ValueError: has no counterpart")

    monkeypatch.setattr(compare, "Worker", Untextured)
    pool, plan = compare.Pool(1), compare.Plan(["textured", "cornell"], ["mitsuba"])
    for _ in range(2):
        with pytest.raises(MissingPeer, match=r"^mitsuba on textured: ValueError: has no counterpart$"):
            pool.worker("mitsuba", "textured", plan.job("textured"))
        pool.worker("mitsuba", "cornell", plan.job("cornell"))
    assert pool.problem("mitsuba", "cornell") is None


def test_finished_comparison_starts_nobody(
    monkeypatch: pytest.MonkeyPatch, device: Device, tmp_path: Path
) -> None:
    factors: dict[str, float | None] = {"incpt": 1.0, "cycles": 1.0}
    peers_found(monkeypatch, device, tmp_path, factors)
    _, made = peers_found(monkeypatch, device, tmp_path, factors)
    assert made == {}


@pytest.mark.parametrize(("wanted", "count"), [(0.2, 4), (5, 4), (7, 8), (17, 16), (100, 96), (1e9, 4096)])
def test_sample_counts(wanted: float, count: int) -> None:
    assert compare.sample_count(wanted) == count


def test_wavefronts_fit_the_memory() -> None:
    assert passes(16, 512 * 512) == [16]
    assert sum(passes(1000, 512 * 512)) == 1000
    assert max(passes(1000, 512 * 512)) * 512 * 512 <= MOST_LANES
    assert passes(2, 2 * MOST_LANES) == [1, 1]


def test_bounces_of_renderers_that_count_all_alike() -> None:
    glass, box = scenes.SCENES["glass"], scenes.SCENES["cornell"]
    assert Job(box.scene, (8, 8), 2, 12, 1).all_bounces == 2
    assert Job(glass.scene, (8, 8), 16, 24, 1).all_bounces == 24
    assert PEERS[0] == "incpt"


@pytest.mark.slow
def test_incpt_as_a_worker() -> None:
    bench = scenes.SCENES["cornell"]
    worker = Worker("incpt", 1)
    try:
        worker.load(Job(bench.scene, (32, 24), 2, 12, 1))
        image = worker.image(6, seed=3)
        assert image.shape == (24, 32, 3) and image.mean() > 0.05
        assert worker.time(2, seed=4) > 0
        x, y, z = bench.scene.object("tall").position
        assert 0 < worker.move("tall", (x + 0.1, y, z), seed=5) < 30
        assert 0 < worker.first_tiles("tall", (x, y, z), seed=5) < 30
        with pytest.raises(MissingPeer, match="no such thing"):
            worker.move("no such thing", (0, 0, 0), seed=5)
        # Neither a mistake nor Ctrl-C, which reaches the whole group, ends it.
        os.kill(worker._process.pid or 0, signal.SIGINT)
        assert worker.time(1, seed=6) > 0
    finally:
        worker.close()
    with pytest.raises(MissingPeer, match="ended"):
        worker.time(1, seed=7)


def check_move(worker: Worker, own: Worker, job: Job) -> None:
    """An object that was moved in one renderer stands where the other has it."""

    def coarse(image: FloatImage) -> FloatImage:
        return image.reshape(6, 8, 6, 8, 3).mean(axis=(1, 3))

    place = (0.2, 0.6, 0.3)
    before = coarse(worker.image(64, seed=3))
    worker.move("tall", place, seed=4)
    after = coarse(worker.image(64, seed=5))
    own.load(replace(job, scene=job.scene.with_object("tall", position=place)))
    expected = coarse(own.image(64, seed=6))
    assert np.abs(after - expected).mean() < 0.2 * np.abs(before - expected).mean()


@pytest.mark.parametrize("name", PEERS[1:])
def test_other_renderers_show_the_same(name: str) -> None:
    # Not imported here: that is what the worker is for.
    module = "mitsuba" if name.startswith("mitsuba") else "bpy"
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    try:
        worker = Worker(name, 2)
    except MissingPeer as missing:
        pytest.skip(str(missing))
    own = Worker("incpt", 2)
    try:
        for scene in ("cornell", "glass", "plates"):
            bench = scenes.SCENES[scene]
            job = Job(bench.scene, (48, 48), bench.max_bounces, bench.transmission_bounces, 2)
            worker.load(job)
            own.load(job)
            expected, found = own.image(256, seed=1), worker.image(128, seed=2)
            noise = compare.noise_of_mean(found.astype(np.float64), expected)
            off = compare.difference(*([float(m) for m in i.mean(axis=(0, 1))] for i in (found, expected)))
            assert off < 0.01 + 4 * noise
            # The same picture, not only the same mean: blocks of 8 x 8 pixels.
            a, b = (i.reshape(6, 8, 6, 8, 3).mean(axis=(1, 3)) for i in (found, expected))
            assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.98
            if scene == "cornell":
                check_move(worker, own, job)
    finally:
        worker.close()
        own.close()


def test_material_without_counterpart_is_refused() -> None:
    pytest.importorskip("mitsuba")
    from incpt.benchmarks.peers.mitsuba_scene import bsdf

    with pytest.raises(ValueError, match="no counterpart"):
        bsdf(mixed_scene().material("grey"))
