"""What a step costs beside its kernels, and what repetition gains: the parts, and one small run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.benchmarks import steps
from incpt.benchmarks.experiment import run
from incpt.benchmarks.scenes import SCENES
from incpt.benchmarks.store import Store
from incpt.session import Session
from incpt.settings import RenderSettings

SPANS = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)).map(lambda pair: tuple(sorted(pair))))


@given(SPANS)
def test_union_of_spans_counts_every_moment_once(spans: list[tuple[int, int]]) -> None:
    covered = {moment for begin, end in spans for moment in range(begin, end)}
    assert steps.union_length(spans) == len(covered)


def test_overhead_is_what_kernels_leave() -> None:
    assert steps.overhead({"ms": 20.0, "kernels_ms": 19.0}) == pytest.approx(0.05)


def test_kernels_of_a_step_fit_into_it() -> None:
    device = steps.ProfiledDevice()
    session = Session(SCENES["cornell"].scene, settings=RenderSettings(size=(128, 96)), device=device)
    session.build()
    device.take_busy_seconds()
    report = session.step()
    busy = device.take_busy_seconds()
    assert 0.2 * report.seconds < busy <= report.seconds
    assert device.take_busy_seconds() == 0


@pytest.mark.parametrize("name", SCENES)
def test_close_up_shows_the_object_alone(name: str) -> None:
    bench = SCENES[name]
    scene = steps.close_up(bench.scene, bench.moves)
    session = Session(scene, settings=RenderSettings(size=(48, 27)))
    index = [obj.name for obj in scene.objects].index(bench.moves)
    share = (session.aovs().object_id == index).mean()
    # Plates are flat, and lie behind one another.
    assert share > (0.2 if name == "plates" else 0.6)


def test_steps_of_a_small_scene(tmp_path: Path) -> None:
    plan = steps.Plan(["cornell"], steps=2, close_size=(32, 18), samples=8, repetitions=1)
    device = steps.ProfiledDevice()
    made = [task for task in steps.tasks(device, plan) if task.subject.get("size") != [1280, 720]]
    found = run(Store(tmp_path, steps.NAME), made, {"id": "e"})
    rows = [row for record in found.where(measure=steps.OVERHEAD) for row in record.rows]
    assert [row["mode"] for row in rows] == ["BASE"] * 2 + ["REFINE"] * 2 + ["INCREMENTAL"] * 2
    assert all(0 < row["kernels_ms"] <= row["ms"] for row in rows)
    repeated = {record.subject["mode"]: record.values for record in found.where(measure=steps.REPETITION)}
    assert set(repeated) == {"BASE", "INCREMENTAL"}
    # Tiles are cut at the edge of the picture; both ways trace at least the samples of its pixels.
    assert all(values["paths"] >= 8 * 32 * 18 for values in repeated.values())
    assert np.isclose(repeated["BASE"]["paths"], repeated["INCREMENTAL"]["paths"])
    overheads, gains = steps.tables(found)
    assert overheads.row_count == 3 and gains.row_count == 1
