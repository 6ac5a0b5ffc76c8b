"""What a step costs beside its kernels, and what repetition gains: the parts, and one small run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.benchmarks.catalogue import EXPERIMENTS
from incpt.benchmarks.kit.experiment import run
from incpt.benchmarks.kit.scenes import SCENES
from incpt.benchmarks.kit.store import Record, Results, Store
from incpt.benchmarks.measures import steps
from incpt.benchmarks.measures.path_order import (
    ORDERS,
    PASSES,
    ROWS,
    TOGETHER,
    OrderedSession,
    ordered_slots,
    pixel_count,
    spiral_tiles,
)
from incpt.core.settings import RenderSettings
from incpt.render.session import Session
from incpt.render.tiles import TileGrid

SPANS = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)).map(lambda pair: tuple(sorted(pair))))


@given(SPANS)
def test_union_of_spans_counts_every_moment_once(spans: list[tuple[int, int]]) -> None:
    covered = {moment for begin, end in spans for moment in range(begin, end)}
    assert steps.union_length(spans) == len(covered)


def test_overhead_is_what_kernels_leave() -> None:
    assert steps.overhead({"ms": 20.0, "kernels_ms": 19.0}) == pytest.approx(0.05)


@pytest.mark.slow
def test_kernels_of_a_step_fit_into_it() -> None:
    device = steps.ProfiledDevice()
    session = Session(SCENES["cornell"].scene, settings=RenderSettings(size=(128, 96)), device=device)
    session.build()
    device.take_busy_seconds()
    shares = []
    for _ in range(20):  # another program may have the processor in the middle of a step
        report = session.step()
        shares.append(device.take_busy_seconds() / report.seconds)
    assert max(shares) > 0.2 and all(0 < share <= 1 for share in shares)
    assert device.take_busy_seconds() == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SCENES, "terrain-100k"])
def test_close_up_shows_the_object_alone(name: str) -> None:
    bench = steps.KNOWN[name]
    scene = steps.close_up(bench.scene, bench.moves)
    session = Session(scene, settings=RenderSettings(size=(48, 27)))
    index = [obj.name for obj in scene.objects].index(bench.moves)
    share = (session.first_hits().object_id == index).mean()
    # Plates are flat, and lie behind one another.
    assert share > (0.2 if name == "plates" else 0.6)


# --------------------------------------------------------------------------------------- orders of paths


def _places(slots: npt.NDArray[np.void], width_px: int) -> list[tuple[int, int, int]]:
    """(x, y, sample) of every place of the path buffer, as cl/path/generate.cl reads the slots."""
    places = []
    for place in range(len(slots) * width_px**2):
        slot = slots[place // width_px**2]
        pixel, repetition = divmod(place - int(slot["group_first"]) * width_px**2, int(slot["group_count"]))
        x, y = int(slot["tile_x"]) + pixel % width_px, int(slot["tile_y"]) + pixel // width_px
        places.append((x, y, int(slot["first_sample"]) + repetition))
    return places


def test_orders_have_the_same_paths() -> None:
    grid, tiles = TileGrid(8, 4, 2), np.array([5, 1, 2], np.int32)
    found = {order: _places(*ordered_slots(order, grid, tiles, 3)) for order in ORDERS}
    assert len(found[ROWS]) == 3 * 4 * 3
    assert sorted(found[ROWS]) == sorted(found[PASSES]) == sorted(found[TOGETHER])
    rows = sorted({(y, x) for x, y, _ in found[ROWS]})
    assert found[ROWS] == [(x, y, sample) for sample in range(3) for y, x in rows]
    assert found[PASSES][:5] == [(2, 2, 0), (3, 2, 0), (2, 3, 0), (3, 3, 0), (2, 0, 0)]
    assert found[PASSES][12:] == [(x, y, sample + 1) for x, y, sample in found[PASSES][:24]]
    assert found[TOGETHER][:4] == [(2, 2, 0), (2, 2, 1), (2, 2, 2), (3, 2, 0)]


def test_pixels_of_tiles_that_are_cut() -> None:
    assert pixel_count(TileGrid(7, 3, 2), np.array([0, 3, 7], np.int32)) == 4 + 2 + 1


def test_orders_bring_the_same_radiance() -> None:
    bench = SCENES["cornell"]
    session = OrderedSession(
        bench.scene,
        settings=RenderSettings(size=(96, 64), strategy="spiral", nor=8, nor_adapts=False, max_bounces=2),
    )
    session.render(1)
    session.edit(bench.scene.with_object(bench.moves, rotation=(0, 1, 0)))
    tiles = spiral_tiles(session, 1)
    assert tiles.tolist() == session.step().tiles.tolist() and len(tiles) == 3
    sums = {}
    for order in ORDERS:
        slots, width_px = ordered_slots(order, session.grid, tiles, 8)
        assert session.trace_seconds(slots, width_px) > 0
        buffer = session._state.path_buffer
        planes = np.empty((buffer.planes, buffer.stride), np.float32)
        session.device.read(buffer.floats, planes)
        radiance = planes[:, : len(slots) * width_px**2]
        sums[order] = np.zeros((3, 64, 96))
        x, y, _ = np.array(_places(slots, width_px)).T
        for total, values in zip(sums[order], radiance, strict=True):
            np.add.at(total, (y, x), values)
    assert sums[TOGETHER].max() > 0
    # The last bits differ with the lanes and the neighbours of a path.
    for order in (ROWS, PASSES):
        assert np.isclose(sums[order], sums[TOGETHER], rtol=1e-4, atol=1e-5).mean() > 0.999


# ------------------------------------------------------------------------------------ tables and the whole


def _record(values: dict[str, Any], rows: Any = (), **subject: Any) -> Record:
    return Record("key", {"scene": "s", **subject}, "e", "now", {}, values, tuple(rows))


def _cells(results: Results) -> list[list[list[str]]]:
    """The rows of each of the tables."""
    made = steps.tables(results)
    return [[list(map(str, row)) for row in zip(*(c.cells for c in t.columns), strict=True)] for t in made]


def test_tables_of_what_was_found() -> None:
    overheads = [
        {"mode": "BASE", "ms": ms, "kernels_ms": kernels} for ms, kernels in ((10, 9), (20, 19), (40, 30))
    ]
    found = [_record({}, overheads, measure=steps.OVERHEAD, size=[64, 32])]
    for mode, rates in (("BASE", (1e6, 3e6)), ("INCREMENTAL", (5e6,))):
        found += [_record({"paths_per_second": r}, measure=steps.REPETITION, mode=mode) for r in rates]
    for order, rate in ((PASSES, 4e6), (TOGETHER, 6e6)):
        found.append(_record({"paths_per_second": rate}, measure=steps.ORDER, order=order))
    overhead, repetition, order_table = _cells(Results({}, tuple(found)))
    assert overhead == [["s", "64 x 32", "BASE", "20.0 ±75 %", "19.0", "10", "50.0"]]
    assert repetition == [["s", "2.00 ±50 %", "5.00", "2.50 x"]]
    assert order_table == [["s", "", "4.00", "6.00", "1.50 x"]]


def test_plans_stay_apart() -> None:
    quick, full = steps.Plan(["cornell"], steps=5), steps.Plan(["cornell"])
    records = [
        Record("key", plan.subject("cornell", measure=steps.ORDER), "e", "now", {}, {})
        for plan in (quick, full)
    ]
    parts = Results({}, tuple(records)).parts(*EXPERIMENTS[steps.NAME].setup)
    assert len(list(parts)) == 2


def test_of_large_scenes_repetition_alone_is_measured() -> None:
    plan = steps.Plan(["cornell", "terrain-100k"], repetitions=1)
    measures = {(t.subject["scene"], t.subject["measure"]) for t in steps.tasks(steps.ProfiledDevice(), plan)}
    every = {("cornell", measure) for measure in (steps.OVERHEAD, steps.REPETITION, steps.ORDER)}
    assert measures == every | {("terrain-100k", steps.REPETITION)}


@pytest.mark.slow
def test_steps_of_a_small_scene(tmp_path: Path) -> None:
    plan = steps.Plan(["cornell"], steps=2, close_size=(32, 18), samples=8, spiral_steps=1, repetitions=1)
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
    orders = {record.subject["order"]: record.values for record in found.where(measure=steps.ORDER)}
    assert set(orders) == set(ORDERS)
    assert {values["paths"] for values in orders.values()} == {255 * 16 * 16 * 8}
    assert [table.row_count for table in steps.tables(found)] == [3, 1, 1]
