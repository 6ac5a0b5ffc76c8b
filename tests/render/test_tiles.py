"""Grid, queues and plan, which need no device, and the order of the pixels of a tile."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.kernels import call

from incpt.core.layout import PARAMS, SlotFlag
from incpt.render.plan import Cursor, Queue, counts_after, is_done, plan_step
from incpt.render.tiles import TileGrid, base_queue, spiral_queue

grids = st.builds(TileGrid, st.integers(1, 120), st.integers(1, 120), st.integers(1, 40))
near_points = st.tuples(st.floats(-100, 300), st.floats(-100, 300))
any_points = st.tuples(st.floats(), st.floats())


def naive_spiral(grid: TileGrid, x: int, y: int) -> list[int]:
    """Source code 4.1 of the thesis, line by line, with the first tile checked too."""
    queue = []

    def push() -> None:
        if 0 <= x < grid.columns and 0 <= y < grid.rows:
            queue.append(y * grid.columns + x)

    push()
    steps, direction = 1, 0
    while len(queue) < grid.count:
        for _ in range(steps):
            x += (1, 0, -1, 0)[direction]
            y += (0, 1, 0, -1)[direction]
            push()
        direction = (direction + 1) % 4
        if direction % 2 == 0:
            steps += 1
    return queue


# ------------------------------------------------------------------------------------------- the grid


def test_grid_worked_by_hand() -> None:
    grid = TileGrid(50, 33, 16)
    assert (grid.columns, grid.rows, grid.count) == (4, 3, 12)
    assert (grid.origin(0), grid.size(0)) == ((0, 0), (16, 16))
    assert (grid.origin(3), grid.size(3)) == ((48, 0), (2, 16))
    assert (grid.origin(8), grid.size(8)) == ((0, 32), (16, 1))
    assert (grid.origin(11), grid.size(11)) == ((48, 32), (2, 1))
    assert grid.tile_at(49, 32) == 11


@pytest.mark.slow
@given(grids)
def test_tiles_cover_every_pixel_once(grid: TileGrid) -> None:
    covered = np.zeros((grid.height, grid.width), int)
    tile_of_pixels = grid.tile_of_pixels()
    for tile in range(grid.count):
        (x, y), (width, height) = grid.origin(tile), grid.size(tile)
        assert 1 <= width <= grid.tile_size and 1 <= height <= grid.tile_size
        covered[y : y + height, x : x + width] += 1
        assert (tile_of_pixels[y : y + height, x : x + width] == tile).all()
    assert (covered == 1).all()


# ----------------------------------------------------------------------------------------- the queues


@given(grids)
def test_base_queue_goes_row_by_row(grid: TileGrid) -> None:
    places = [grid.origin(int(tile))[::-1] for tile in base_queue(grid)]
    assert places == sorted(places) and len(set(places)) == grid.count


def test_spiral_worked_by_hand() -> None:
    # 4 x 3 tiles around (1, 1): 5, right 6, down 10, left 9 8, up 4 0, right 1 2 3, down 7 11.
    assert spiral_queue(TileGrid(40, 30, 10), (15, 15)).tolist() == [5, 6, 10, 9, 8, 4, 0, 1, 2, 3, 7, 11]


@given(grids, near_points)
def test_spiral_is_the_walk_of_the_thesis(grid: TileGrid, point: tuple[float, float]) -> None:
    x, y = (math.floor(p / grid.tile_size) for p in point)
    assert spiral_queue(grid, point).tolist() == naive_spiral(grid, x, y)


@given(grids, any_points)
def test_spiral_has_every_tile_once_and_rings_in_order(grid: TileGrid, point: tuple[float, float]) -> None:
    queue = spiral_queue(grid, point)
    assert queue.dtype == np.int32 and sorted(queue.tolist()) == list(range(grid.count))
    if all(map(math.isfinite, point)) and max(map(abs, point)) < 1e9:
        x, y = (math.floor(p / grid.tile_size) for p in point)
        rings = np.maximum(np.abs(queue % grid.columns - x), np.abs(queue // grid.columns - y))
        assert (np.diff(rings) >= 0).all()


@pytest.mark.parametrize("point", [(1e30, 5.0), (-1e300, 1e300), (0.0, -1e9)])
def test_points_far_away_start_at_the_nearest_edge(point: tuple[float, float]) -> None:
    grid = TileGrid(64, 48, 16)
    first = int(spiral_queue(grid, point)[0])
    column, row = first % grid.columns, first // grid.columns
    assert column == (grid.columns - 1 if point[0] > 1e3 else column)
    assert row == (0 if point[1] < -1e3 else row)
    nearest = max(abs(point[0]), abs(point[1])) == abs(point[0])
    assert not (point[0] < -1e3 and nearest) or column == 0


@pytest.mark.parametrize("point", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan)])
def test_points_that_are_not_finite_mean_the_centre(point: tuple[float, float]) -> None:
    grid = TileGrid(50, 50, 10)
    assert spiral_queue(grid, point)[0] == 12


# ------------------------------------------------------------------------------------------- the plan


def run_queue(grid: TileGrid, queue: Queue, slot_count: int, counts: np.ndarray) -> list[np.ndarray]:
    """Slots of all steps, with what holds for every step checked."""
    steps, cursor, finished, slots_before = [], Cursor(), [], 0
    now = counts
    while not is_done(queue, cursor):
        step = plan_step(grid, queue, cursor, slot_count, counts)
        check_groups(step.slots)
        assert 1 <= len(step.slots) <= slot_count
        assert queue.slots_before(cursor) == slots_before
        slots_before += len(step.slots)
        now = counts_after(queue, step, now)
        assert len(step.slots) == slot_count or is_done(queue, step.cursor)
        finished += step.finished.tolist()
        last = step.slots["flags"] & SlotFlag.LAST > 0
        tiles_of_last = dict.fromkeys(tile_numbers(grid, step.slots[last]))
        assert step.finished.tolist() == list(tiles_of_last)
        steps.append(step.slots)
        cursor = step.cursor
    assert finished == queue.tiles.tolist() and slots_before == queue.slot_count
    np.testing.assert_array_equal(
        now[queue.tiles], queue.samples + (0 if queue.replaces else counts[queue.tiles])
    )
    return steps


def tile_numbers(grid: TileGrid, slots: np.ndarray) -> list[int]:
    return [grid.tile_at(int(x), int(y)) for x, y in zip(slots["tile_x"], slots["tile_y"], strict=True)]


def check_groups(slots: np.ndarray) -> None:
    begin = 0
    while begin < len(slots):
        end = begin + int(slots["group_count"][begin])
        assert slots["group_first"][begin] == begin and end <= len(slots)
        assert (slots[begin:end] == slots[begin]).all()
        begin = end


@pytest.mark.slow
@given(
    grids.filter(lambda grid: grid.count <= 60),
    near_points,
    st.lists(st.integers(1, 30), min_size=1, max_size=4),
    st.integers(1, 50),
    st.booleans(),
    st.integers(0, 1000),
)
def test_every_tile_gets_its_samples_in_order(
    grid: TileGrid, point: tuple[float, float], samples: list[int], slots: int, replaces: bool, seed: int
) -> None:
    counts = np.random.default_rng(seed).integers(0, 500, grid.count)
    wanted = np.resize(samples, grid.count)
    queue = Queue(spiral_queue(grid, point), wanted[spiral_queue(grid, point)], replaces)
    given: dict[int, list[int]] = {tile: [] for tile in range(grid.count)}
    for step in run_queue(grid, queue, slots, counts):
        for tile, slot, place in zip(tile_numbers(grid, step), step, range(len(step)), strict=True):
            start = 0 if replaces else int(counts[tile])
            group_end = int(slot["first_sample"] + slot["group_count"])
            flags = SlotFlag(int(slot["flags"]))
            assert (SlotFlag.FIRST in flags) == (slot["first_sample"] == start)
            assert (SlotFlag.LAST in flags) == (group_end == start + wanted[tile])
            assert (SlotFlag.REPLACE in flags) == replaces
            given[tile].append(int(slot["first_sample"]) + place - int(slot["group_first"]))
    for tile, indices in given.items():
        start = 0 if replaces else int(counts[tile])
        assert indices == list(range(start, start + wanted[tile]))


def test_tiles_per_step_is_the_formula_of_the_thesis() -> None:
    grid = TileGrid(400, 400, 10)
    step = plan_step(
        grid, Queue.even(base_queue(grid), 4, True), Cursor(), grid.count, np.zeros(grid.count, int)
    )
    assert len(step.finished) == 400 * 400 // (10 * 10 * 4) == 400
    assert step.cursor == Cursor(400, 0)


def test_plan_worked_by_hand() -> None:
    # 3 tiles of 5 samples in steps of 7 slots: 5 + 2, then 3 + 4, then the last one.
    grid = TileGrid(30, 10, 10)
    queue, counts = Queue.even(np.array([1, 0, 2], np.int32), 5, True), np.zeros(3, int)
    first = plan_step(grid, queue, Cursor(), 7, counts)
    assert first.slots["tile_x"].tolist() == [10] * 5 + [0] * 2
    assert first.slots["first_sample"].tolist() == [0] * 7
    assert first.slots["group_first"].tolist() == [0] * 5 + [5] * 2
    assert first.slots["group_count"].tolist() == [5] * 5 + [2] * 2
    assert first.slots["flags"].tolist() == [7] * 5 + [5] * 2  # FIRST 1, LAST 2, REPLACE 4
    assert (first.finished.tolist(), first.cursor) == ([1], Cursor(1, 2))
    second = plan_step(grid, queue, first.cursor, 7, counts)
    assert second.slots["first_sample"].tolist() == [2] * 3 + [0] * 4
    assert second.slots["flags"].tolist() == [6] * 3 + [5] * 4
    assert (second.finished.tolist(), second.cursor) == ([0], Cursor(2, 4))
    third = plan_step(grid, queue, second.cursor, 7, counts)
    assert third.slots.tolist() == [(20, 0, 1, 4, 0, 1, 6)]
    assert (third.finished.tolist(), is_done(queue, third.cursor)) == ([2], True)


def test_one_tile_over_many_steps() -> None:
    grid = TileGrid(10, 10, 10)
    queue = Queue.even(base_queue(grid), 256, True)
    steps = run_queue(grid, queue, 100, np.zeros(1, int))
    assert [len(step) for step in steps] == [100, 100, 56]
    assert [int(step["flags"][0]) for step in steps] == [5, 4, 6]


def test_refining_counts_on_from_each_tile() -> None:
    grid = TileGrid(30, 10, 10)
    counts = np.array([256, 7, 0])
    step = plan_step(grid, Queue.even(base_queue(grid), 2, False), Cursor(), 6, counts)
    assert step.slots["first_sample"].tolist() == [256, 256, 7, 7, 0, 0]
    assert step.slots["flags"].tolist() == [3] * 6


@pytest.mark.parametrize("tile_size", [1, 4, 6, 7, 16, 20])
@pytest.mark.parametrize("in_squares", [False, True])
def test_pixels_of_a_tile_come_in_squares_or_rows(tile_size: int, in_squares: bool) -> None:
    count = tile_size**2
    params = np.zeros(1, PARAMS)
    params["tile_size"], params["in_squares"] = tile_size, in_squares
    body = """
    Params own = params[0];
    TilePixel at = tile_pixel(&own, i);
    x[i] = at.x, y[i] = at.y, place[i] = tile_place(&own, at);
    """
    x, y, place = call("tile", body, count, ("x", "y", "place"), params=params)
    rows, columns = np.divmod(np.arange(count), tile_size)
    edge = 4 if in_squares and tile_size % 4 == 0 else 1
    order = np.lexsort((columns % edge, rows % edge, columns // edge, rows // edge))
    assert (x == columns[order]).all() and (y == rows[order]).all()
    assert (place == np.arange(count)).all()


def test_planning_a_4k_image_is_quick() -> None:
    grid = TileGrid(3840, 2160, 16)
    counts = np.zeros(grid.count, int)
    queue = Queue.even(spiral_queue(grid, (1e6, -1e6)), 1, True)

    def best(work: Callable[[], object]) -> float:
        seconds = []
        for _ in range(5):
            start = time.perf_counter()
            work()
            seconds.append(time.perf_counter() - start)
        return min(seconds)

    # Measured 1 and 3 ms; the bound leaves room for a loaded machine and still rules out a Python loop.
    assert best(lambda: plan_step(grid, queue, Cursor(), grid.count, counts)) < 0.02
    assert best(lambda: spiral_queue(grid, (1e6, -1e6))) < 0.05


def test_a_step_ends_before_a_tile_comes_again() -> None:
    """Two slots of one launch must not replace the same pixels."""
    grid = TileGrid(32, 8, 8)
    queue = Queue(np.array([2, 3, 2, 3, 0, 1], np.int32), np.array([1, 1, 4, 4, 4, 4]), True)
    cursor, steps = Cursor(), []
    while cursor.tiles < len(queue.tiles):
        step = plan_step(grid, queue, cursor, 6, np.zeros(4, int))
        assert len(set(step.finished.tolist())) == len(step.finished)
        steps.append((step.finished.tolist(), len(step.slots)))
        cursor = step.cursor
    assert steps == [([2, 3], 2), ([2], 6), ([3, 0], 6), ([1], 4)]
