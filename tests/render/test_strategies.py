"""What each strategy plans, without a device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.core.settings import STRATEGIES, RenderSettings
from incpt.render.modes import Mode
from incpt.render.strategies import (
    RESTART,
    STRATEGIES_BY_NAME,
    Situation,
    point_of_change,
    strategy_of,
)
from incpt.render.tiles import TileGrid, base_queue, spiral_queue

SETTINGS = RenderSettings(size=(44, 28), tile_size=8, nor=5, base_nor=2, sample_rate=3)
GRID = TileGrid(44, 28, 8)
SPIRAL = STRATEGIES_BY_NAME["spiral"]


def situation(mode: Mode, **changes: object) -> Situation:
    counts = np.zeros(GRID.count, np.int64)
    made = Situation(mode, SETTINGS, GRID, mixed_scene(), counts)
    return replace(made, **changes)  # type: ignore[arg-type]


def test_settings_know_the_strategies_that_there_are() -> None:
    assert tuple(STRATEGIES_BY_NAME) == STRATEGIES
    for name, strategy in STRATEGIES_BY_NAME.items():
        assert strategy.name == name and strategy_of(replace(SETTINGS, strategy=name)) is strategy


@pytest.mark.parametrize("strategy", [RESTART, SPIRAL])
@pytest.mark.parametrize("mode", [Mode.BASE, Mode.REFINE])
def test_base_and_refinement_go_row_by_row(strategy, mode: Mode) -> None:
    queue = strategy.queue(situation(mode))
    np.testing.assert_array_equal(queue.tiles, base_queue(GRID))
    assert (queue.samples == 2 * 3).all()
    assert queue.replaces == (mode is Mode.BASE)


def test_spiral_starts_at_what_the_edit_affects() -> None:
    scene = mixed_scene()
    affected = (scene.object("red cube"), scene.object("grey drum"))
    queue = SPIRAL.queue(situation(Mode.INCREMENTAL, affected=affected))
    point_px = point_of_change(scene.camera, affected, 44, 28)
    np.testing.assert_array_equal(queue.tiles, spiral_queue(GRID, point_px))
    assert (queue.samples == 5 * 3).all() and queue.replaces


def test_spiral_starts_at_the_pixel_only_where_settings_say_so() -> None:
    affected = (mixed_scene().object("red cube"),)
    edit = situation(Mode.INCREMENTAL, affected=affected, pixel=(43.0, 27.0))
    by_pixel = replace(edit, settings=replace(SETTINGS, point_of_change="pixel"))
    assert SPIRAL.order(by_pixel)[0] == GRID.count - 1
    assert SPIRAL.order(edit)[0] == SPIRAL.order(replace(edit, pixel=None))[0] != GRID.count - 1
    without_pixel = replace(by_pixel, pixel=None)
    np.testing.assert_array_equal(SPIRAL.order(without_pixel), SPIRAL.order(edit))


def test_an_order_that_is_there_is_kept() -> None:
    order = base_queue(GRID)[::-1].copy()
    queue = SPIRAL.queue(situation(Mode.INCREMENTAL), order)
    assert queue.tiles is order and (queue.samples == 15).all()
