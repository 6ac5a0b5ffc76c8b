"""What each strategy plans, without a device, and that a session takes a strategy that it does not know."""

from __future__ import annotations

from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.core.settings import STRATEGIES, RenderSettings
from incpt.device.device import Device
from incpt.render.film import Film, FilmPass, Resolution
from incpt.render.impact.exploration import seen_tiles
from incpt.render.modes import Mode
from incpt.render.plan import CountArray, Cursor
from incpt.render.session import Session
from incpt.render.strategies import (
    RESTART,
    STRATEGIES_BY_NAME,
    SpiralQueue,
    point_of_change,
    strategy_of,
)
from incpt.render.strategy import Situation, Step, Strategy
from incpt.render.tiles import IntArray, TileGrid, base_queue, spiral_queue

SETTINGS = RenderSettings(
    size=(44, 28), tile_size=8, strategy="spiral", nor=5, nor_adapts=False, base_nor=2, sample_rate=3
)
GRID = TileGrid(44, 28, 8)
SPIRAL = STRATEGIES_BY_NAME["spiral"]


class NoFilm:
    """No strategy that stands here reads the film."""

    def sums(self) -> NoReturn:
        raise AssertionError("the film is read")

    def tile_sums(self) -> NoReturn:
        raise AssertionError("the film is read")


def situation(mode: Mode, **changes: object) -> Situation:
    made = Situation(mode, SETTINGS, GRID, mixed_scene(), np.zeros(GRID.count, np.int64), NoFilm())
    return replace(made, **changes)  # type: ignore[arg-type]


def test_settings_know_the_strategies_that_there_are() -> None:
    assert tuple(STRATEGIES_BY_NAME) == STRATEGIES
    for name, strategy in STRATEGIES_BY_NAME.items():
        assert strategy.name == name and strategy_of(replace(SETTINGS, strategy=name)) is strategy


@pytest.mark.parametrize("strategy", [RESTART, SPIRAL, STRATEGIES_BY_NAME["impact"]])
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


def adapting(nor: int, spp: int, **changes: object) -> Situation:
    """An edit of the red cube, which goes to the left, where every tile had so many samples."""
    cube = mixed_scene().object("red cube")
    return situation(
        Mode.INCREMENTAL,
        settings=replace(SETTINGS, nor=nor, nor_adapts=True, sample_rate=1),
        tile_spp=np.full(GRID.count, spp, np.int64),
        affected=(cube, replace(cube, position=(-1.2, 0.5, 0.5))),
        **changes,
    )


def test_repetitions_of_a_spiral_grow_where_the_object_is_seen() -> None:
    edit = adapting(nor=64, spp=20)
    queue = SPIRAL.queue(edit)
    assert isinstance(queue, SpiralQueue) and queue.replaces
    # The new place comes before the old one.
    new = seen_tiles(GRID, edit.scene.camera, edit.affected[1:])
    near = queue.near
    assert near[: len(new)].tolist() == new.tolist() and len(near) > len(new)
    assert queue.samples.tolist() == [1] * len(near) + [4] * len(near) + [16] * len(near) + [20] * GRID.count
    for start in (0, len(near), 2 * len(near), 3 * len(near)):
        np.testing.assert_array_equal(queue.tiles[start : start + len(near)], near)
    last = queue.tiles[3 * len(near) :]
    assert sorted(last.tolist()) == list(range(GRID.count))
    spiral = SPIRAL.order(edit)
    np.testing.assert_array_equal(last[len(near) :], spiral[~np.isin(spiral, near)])
    assert SPIRAL.queue(adapting(nor=3, spp=20)).samples[-1] == 3
    assert (SPIRAL.queue(adapting(nor=3, spp=0)).samples == 1).all()


def test_what_an_edit_left_unfinished_comes_with_the_next() -> None:
    first = SPIRAL.queue(adapting(nor=64, spp=20))
    assert isinstance(first, SpiralQueue)
    near, passes = first.near, 3 * len(first.near)
    drum = (mixed_scene().object("grey drum"),)
    alone = seen_tiles(GRID, mixed_scene().camera, drum)
    for done, left in ((0, near), (passes, near), (passes + 2, near[2:]), (len(first.tiles), near[:0])):
        again = replace(adapting(64, 20), affected=drum, queue=first, cursor=Cursor(done))
        second = SPIRAL.queue(again)
        assert isinstance(second, SpiralQueue)
        assert second.near.tolist() == [*alone, *(tile for tile in left if tile not in alone)]


def test_an_order_is_kept_when_the_nor_changes() -> None:
    edit = adapting(nor=64, spp=20)
    first = SPIRAL.queue(edit)
    assert isinstance(first, SpiralQueue)
    for nor, adapts in ((2, True), (64, False)):
        settings = replace(edit.settings, nor=nor, nor_adapts=adapts)
        queue = SPIRAL.queue(replace(edit, settings=settings, queue=first), first.tiles)
        np.testing.assert_array_equal(queue.tiles[-GRID.count :], first.tiles[-GRID.count :])
        assert len(queue.tiles) == GRID.count + adapts * len(first.near) and queue.samples[-1] == nor


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


TRACES = FilmPass("traces", 1, resolution=Resolution.SUM)


class Probe(Strategy):
    """It needs all that the protocol has: a pass of its own, written by itself, an order that leaves tiles
    out, and samples for each tile that follow from what the film holds."""

    name = "probe"
    uses_nor = True
    keeps_picture = True
    passes = (TRACES,)

    def order(self, situation: Situation) -> IntArray:
        order = base_queue(situation.grid)
        return order[::2] if situation.mode is Mode.INCREMENTAL else order[::-1].copy()

    def samples(self, situation: Situation, order: IntArray) -> CountArray:
        if situation.mode is not Mode.INCREMENTAL:
            return super().samples(situation, order)
        assert situation.queue is not None and situation.affected
        count = situation.film.sums()["traces"][1]
        return 1 + order % 3 + int(count.max())

    def render(self, step: Step, film: Film) -> int:
        stride = int(step.batch.params["buffer_stride"])
        place = 4 * film.first_plane("traces") * stride
        film.device.write(step.batch.path_buffer, np.full(stride, 2.0, np.float32), offset=place)
        return super().render(step, film)


@pytest.mark.parametrize("aovs", [False, True])
def test_session_takes_a_strategy_with_needs_of_its_own(
    device: Device, monkeypatch: pytest.MonkeyPatch, aovs: bool
) -> None:
    monkeypatch.setitem(STRATEGIES_BY_NAME, "probe", Probe())
    monkeypatch.setattr("incpt.core.settings.STRATEGIES", (*STRATEGIES, "probe"))
    scene = mixed_scene(strategy="probe", slots_per_step=7, aovs=aovs)
    session = Session(scene, device=device)
    session.render(2)
    order = base_queue(session.grid)
    assert session.queue.tiles[0] == order[-1]
    edited = scene.with_object("red cube", position=(0.2, 0.5, 0.4))
    session.edit(edited)
    np.testing.assert_array_equal(session.queue.samples, 1 + order[::2] % 3 + 2)
    while session.mode is Mode.INCREMENTAL:
        session.step()
    np.testing.assert_array_equal(session.tile_spp[::2], 3 + order[::2] % 3)
    assert (session.tile_spp[1::2] == 2).all()
    # Its own pass was accumulated as radiance was, and comes back with a snapshot.
    sums = session._state.film.sums()
    np.testing.assert_array_equal(sums["traces"][1], session.spp())
    np.testing.assert_array_equal(sums["traces"][0], 2 * session.spp())
    snapshot = session.snapshot()
    session.restart()
    session.step()
    session.restore(snapshot)
    np.testing.assert_array_equal(session._state.film.sums()["traces"], sums["traces"])
    # What is kept of each finished tile is what a fresh render has.
    for count in (3, 4, 5):
        fresh = Session(edited, settings=replace(scene.settings, strategy="restart"), device=device)
        fresh.render(count)
        here = (session.spp() == count) & np.isin(session.grid.tile_of_pixels(), order[::2])
        assert here.any()
        np.testing.assert_allclose(session.image()[here], fresh.image()[here], rtol=1e-3, atol=1e-4)
    # A strategy without that pass starts a film without it.
    session.configure(replace(session.settings, strategy="restart", aovs=False))
    assert session.mode is Mode.BASE and list(session._state.film.sums()) == ["radiance"]
    assert session._state.path_buffer.planes == 3
