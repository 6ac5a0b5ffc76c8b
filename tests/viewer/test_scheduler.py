"""What to do next, as a function of values: no device, no clock."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.core.settings import RenderSettings
from incpt.render.modes import Mode
from incpt.render.plan import Cursor, Queue
from incpt.render.progress import Progress
from incpt.render.session import StepReport
from incpt.render.tiles import TileGrid
from incpt.scene.change import diff
from incpt.scene.model import Scene
from incpt.viewer import scheduler
from incpt.viewer.pace import Pace, TileCosts
from incpt.viewer.scheduler import Follow, ReturnToFull, Side, Step, ViewerState
from incpt.viewer.view import View

FAST, SLOW = Pace(1e7), Pace(6e4)
"""With the slow one the picture, 44 x 28 pixels in 24 tiles, does not fit a step of 10 ms."""
NOW = 100.0


class NoFilm:
    """The strategies that there are plan without it."""

    def sums(self) -> NoReturn:
        raise AssertionError("the film is read")


def view_of(scene: Scene, **changes: object) -> View:
    return View(scene, **{"step_ms": 10.0, **changes})  # type: ignore[arg-type]


def moved(scene: Scene, x: float = 0.2) -> Scene:
    return scene.with_object("red cube", position=(x, 0.5, 0.4))


def turned(scene: Scene) -> Scene:
    return scene.with_camera(fov_y=50.0)


def side_of(
    view: View,
    pace: Pace = FAST,
    mode: Mode = Mode.REFINE,
    spp: int = 2,
    strategy: str | None = None,
    divisor: int = 1,
) -> Side:
    """A side that shows `view` in a mode, whose last change is answered long ago."""
    settings = scheduler.settings_of(view, strategy, pace, divisor)
    progress = Progress.start(settings, view.scene, NoFilm()).entering(mode, view.scene, NoFilm())
    progress = replace(progress, drawn=np.full(progress.grid.count, spp, np.int64))
    side = Side.opened(view, progress, pace, divisor, strategy)
    return replace(side, is_answered=True, changed_at=NOW - 10)


def state(view: View, *sides: Side, spent: tuple[float, ...] | None = None, now: float = NOW) -> ViewerState:
    return ViewerState(view, sides, spent or (0.0,) * len(sides), now)


def report_of(side: Side, tiles: list[int], done: int, paths: int = 64) -> StepReport:
    length = len(side.progress.queue.tiles)
    return StepReport(
        side.progress.mode,
        np.array(tiles, np.int32),
        done,
        length,
        paths,
        0,
        0.0,
        0,
        0,
        is_shown=len(tiles) > 0,
    )


# ------------------------------------------------------------------------------------------------- edits


def test_an_edit_is_taken_up_once_the_one_before_is_answered() -> None:
    scene = mixed_scene()
    side = side_of(view_of(moved(scene), before=scene))
    next_edit = view_of(moved(scene, 0.3), before=scene)
    work = scheduler.next_work(state(next_edit, side))
    assert isinstance(work, Follow) and work.view is next_edit and work.side == 0
    waiting = replace(side, is_answered=False)
    assert isinstance(scheduler.next_work(state(next_edit, waiting)), Step)
    # Nobody waits where the view is paused, nor for an edit that belongs to no drag and takes too long.
    paused = replace(next_edit, paused=True)
    assert isinstance(scheduler.next_work(state(paused, waiting)), Follow)
    alone = replace(side_of(view_of(scene)), is_answered=False, changed_at=NOW)
    edit = view_of(moved(scene))
    assert isinstance(scheduler.next_work(state(edit, alone, now=NOW + 0.4)), Step)
    assert isinstance(scheduler.next_work(state(edit, alone, now=NOW + 0.6)), Follow)


def test_an_equal_view_is_nothing_new() -> None:
    scene = mixed_scene()
    side = side_of(view_of(scene))
    same = view_of(replace(scene), target_spp=9, step_ms=20.0, drag_nor=3, first_hits=True)
    assert scheduler.shows(side, same)
    for other in (view_of(moved(scene)), view_of(scene, before=scene), view_of(scene, resolution_scale=0.5)):
        assert not scheduler.shows(side, other)


@pytest.mark.parametrize(
    ("change", "settings", "pace", "mode", "divisor"),
    [
        (moved, {}, SLOW, Mode.REFINE, 1),  # the spiral keeps the picture
        (moved, {}, SLOW, Mode.BASE, 2),  # there is none yet
        (moved, {"strategy": "restart"}, SLOW, Mode.REFINE, 2),
        (turned, {}, SLOW, Mode.REFINE, 2),
        (turned, {}, FAST, Mode.REFINE, 1),
        (turned, {}, Pace(1e3), Mode.REFINE, 16),
        (lambda s: replace(s, settings=replace(s.settings, max_bounces=0)), {}, SLOW, Mode.REFINE, 2),
        (lambda s: replace(s, settings=replace(s.settings, tile_size=16)), {}, SLOW, Mode.REFINE, 2),
        (lambda s: replace(s, settings=replace(s.settings, size=(88, 56))), {}, SLOW, Mode.REFINE, 4),
        (lambda s: replace(s, settings=replace(s.settings, nor=3)), {}, SLOW, Mode.REFINE, 1),
        (lambda s: s.with_material("unused", roughness=0.3), {}, SLOW, Mode.REFINE, 1),
    ],
)
def test_what_starts_over_and_does_not_fit_a_step_is_rendered_coarsely(
    change, settings: dict[str, object], pace: Pace, mode: Mode, divisor: int
) -> None:
    scene = mixed_scene(**settings)
    side = side_of(view_of(scene), pace, mode)
    view = view_of(change(scene))
    work = scheduler.next_work(state(view, side))
    assert isinstance(work, Follow) and work.divisor == divisor
    width, height = view.size
    assert work.settings.size == (-(-width // divisor), -(-height // divisor))
    paused = scheduler.next_work(state(replace(view, paused=True), side))
    assert isinstance(paused, Follow) and paused.divisor == 1


def test_beside_a_kept_picture_the_other_side_is_not_coarse() -> None:
    scene = mixed_scene()
    sides = side_of(view_of(scene), SLOW, strategy="restart"), side_of(view_of(scene), SLOW)
    work = scheduler.next_work(state(view_of(moved(scene), split=True), *sides))
    assert isinstance(work, Follow) and (work.side, work.divisor) == (0, 1)
    assert work.settings.strategy == "restart"
    coarse = replace(sides[1], divisor=2)
    work = scheduler.next_work(state(view_of(moved(scene), split=True), sides[0], coarse))
    assert isinstance(work, Follow) and (work.side, work.divisor) == (0, 2)


def test_a_drag_repeats_less_and_its_end_starts_anew() -> None:
    scene = mixed_scene(nor=32)
    dragged = view_of(moved(scene), before=scene, drag_nor=4, point=(0.5, 0.25))
    work = scheduler.next_work(state(dragged, side_of(view_of(scene))))
    assert isinstance(work, Follow) and work.settings.nor == 4 and not work.ends_drag
    assert work.since is scene and work.pixel == (22.0, 7.0)
    # Repetitions fit a step: 6e4 paths a second are 9 times a tile of 64 pixels in 10 ms.
    slow = scheduler.settings_of(replace(dragged, drag_nor=30), None, SLOW, 1)
    assert slow.nor == 9
    end = scheduler.next_work(state(view_of(moved(scene)), side_of(dragged)))
    assert isinstance(end, Follow) and end.settings.nor == 32 and end.ends_drag and end.since is scene
    # Repetitions that grow within a drag, because rendering became faster, do not end it.
    faster = replace(side_of(replace(dragged, drag_nor=30), SLOW), whole=FAST)
    more = scheduler.next_work(state(view_of(moved(scene, 0.3), before=scene, drag_nor=30), faster))
    assert isinstance(more, Follow) and more.settings.nor == 30 > faster.progress.settings.nor
    assert not more.ends_drag and more.since is scene
    # Where tiles had all repetitions already, nothing is to be made up for.
    whole = side_of(replace(dragged, drag_nor=32), Pace(1e9))
    end = scheduler.next_work(state(view_of(moved(scene)), whole))
    assert isinstance(end, Follow) and not end.ends_drag and end.since is None


def test_a_coarse_picture_has_no_spiral_to_measure() -> None:
    scene = mixed_scene()
    side = side_of(view_of(scene), SLOW, divisor=2)
    work = scheduler.next_work(state(view_of(moved(scene), before=scene), side))
    assert isinstance(work, Follow) and work.divisor == 2 and work.since is None
    assert (work.settings.base_nor, work.settings.sample_rate) == (1, 1)


def test_full_resolution_comes_back_once_the_view_rests() -> None:
    scene = mixed_scene()
    view = view_of(scene)
    coarse = replace(side_of(view, SLOW, divisor=2), changed_at=NOW)
    assert isinstance(scheduler.next_work(state(view, coarse, now=NOW + 0.1)), Step)
    work = scheduler.next_work(state(view, coarse, now=NOW + 0.2))
    assert isinstance(work, ReturnToFull) and work.settings.size == (44, 28)
    unanswered = replace(coarse, is_answered=False)
    assert isinstance(scheduler.next_work(state(view, unanswered, now=NOW + 0.2)), Step)
    assert scheduler.next_work(state(replace(view, paused=True), coarse, now=NOW + 0.2)) is None
    full = scheduler.returned_to_full(coarse, side_of(view).progress)
    assert full.divisor == 1 and full.full_view is view and full.urgent == full.version > coarse.version
    assert full.is_answered and full.replaced.shape == (24,)


def test_the_end_of_a_drag_does_not_wait_for_rest() -> None:
    scene = mixed_scene()
    side = side_of(view_of(turned(scene), before=scene), SLOW, divisor=2)
    work = scheduler.next_work(state(view_of(turned(scene)), side))
    assert isinstance(work, Follow)
    side = scheduler.followed(side, work, side.progress, NOW)
    assert side.changed_at == -math.inf and side.is_answered
    assert isinstance(scheduler.next_work(state(side.view, side)), ReturnToFull)


def test_paths_that_ended_in_glass_are_counted_since_the_last_change() -> None:
    side = side_of(view_of(mixed_scene()))
    assert scheduler.share_cut_off((side,)) == 0
    for cut_off in (6, 9):
        report = replace(report_of(side, [], 3), cut_off=cut_off, partners=50)
        side = scheduler.stepped(side, report, 0.1, side.progress)
    assert scheduler.share_cut_off((side,)) == 15 / 128
    assert scheduler.share_cut_off((side, side)) == scheduler.share_cut_off((side,))
    assert scheduler.share_cut_off((scheduler.restarted(side, side.progress),)) == 0


def test_a_change_is_begun_unless_it_changes_nothing() -> None:
    scene = mixed_scene()
    side = replace(side_of(view_of(scene)), seconds=3.0, nonfinite=2, pass_paths=5)
    work = scheduler.next_work(state(view_of(moved(scene)), side))
    assert isinstance(work, Follow)
    same = scheduler.followed(side, work, side.progress, NOW)
    assert same.view is work.view is same.full_view
    assert (same.seconds, same.is_answered, same.changed_at) == (3.0, True, NOW - 10)
    edited = side.progress.after_edit(scene, work.view.scene, diff(scene, work.view.scene), NoFilm())
    begun = scheduler.followed(side, work, edited, NOW)
    assert (begun.seconds, begun.nonfinite, begun.pass_paths, begun.is_answered) == (0.0, 0, 0, False)
    assert begun.changed_at == NOW and begun.urgent == begun.version > side.version
    # A pass of refinement that begins with other samples is no change.
    refined = side.progress.entering(Mode.REFINE, scene, NoFilm())
    assert scheduler.followed(side, work, refined, NOW).is_answered


# ------------------------------------------------------------------------------------------------- turns


def test_both_sides_get_the_same_time_and_an_answer_comes_first() -> None:
    scene = mixed_scene()
    view = view_of(scene, split=True)
    left, main = side_of(view, strategy="restart"), side_of(view)

    def turn(main: Side, spent: tuple[float, float], view: View = view) -> Step:
        work = scheduler.next_work(state(view, left, main, spent=spent))
        assert isinstance(work, Step)
        return work

    assert turn(main, (1.0, 2.0)).side == 0 and turn(main, (2.0, 1.0)).side == 1
    unanswered = replace(main, is_answered=False)
    assert turn(unanswered, (1.0, 1.01)).side == 1
    assert turn(unanswered, (1.0, 1.03)).side == 0
    # A side with nothing to do does not save up time.
    done = replace(main, progress=replace(main.progress, drawn=main.progress.drawn + 5))
    target = replace(view, target_spp=6)
    assert turn(done, (2.0, 1.0), target) == Step(0, turn(done, (2.0, 1.0), target).slots, (2.0, 2.0))
    assert turn(main, (2.0, 1.0)).spent == (2.0, 1.0)


def test_nothing_is_to_do_at_the_target() -> None:
    view = view_of(mixed_scene(), target_spp=2)
    assert scheduler.next_work(state(view, side_of(view))) is None
    assert scheduler.next_work(state(view, side_of(view, spp=1))) is not None
    assert scheduler.next_work(state(view, side_of(view, mode=Mode.INCREMENTAL))) is not None
    assert not scheduler.is_done(side_of(view, divisor=2), 2)
    assert scheduler.next_work(state(replace(view, target_spp=None, paused=True), side_of(view))) is None


# ------------------------------------------------------------------------------------------------- slots


def test_a_step_takes_its_time() -> None:
    scene = mixed_scene(nor=16)
    side = side_of(view_of(scene), Pace(64.1e3))  # a slot is 64 paths, so that it takes a millisecond
    assert scheduler.slots_of_step(side, 10.0) == 10
    assert scheduler.slots_of_step(side, 19.0) == 24  # a little more ends the queue
    edit = replace(side, progress=side.progress.entering(Mode.INCREMENTAL, scene, NoFilm()))
    assert scheduler.slots_of_step(edit, 10.0) == 10
    assert scheduler.slots_of_step(replace(edit, is_answered=False), 10.0) == 5
    few = replace(side, view=view_of(replace(scene, settings=replace(scene.settings, slots_per_step=3))))
    assert scheduler.slots_of_step(few, 10.0) == 3
    assert scheduler.slots_of_step(side, 1e-9) == 1
    coarse = side_of(view_of(scene), Pace(64.1e3), Mode.BASE, divisor=2)
    assert scheduler.slots_of_step(coarse, 1.0) == coarse.progress.grid.count


def test_slots_follow_from_what_the_same_tiles_took() -> None:
    grid = TileGrid(32, 8, 8)
    queue = Queue(np.arange(4, dtype=np.int32), np.array([2, 3, 1, 2]), True)
    costs = TileCosts.unknown(grid).after(np.array([0, 1, 2, 3], np.int32), 1, 0.001)
    costs = costs.after(np.array([2], np.int32), 1, 0.004)
    # Tiles take 2, 3, 4 and 2 ms where an area is one path; of the last, half fits 10 ms.
    assert [costs.slots(queue, Cursor(), 1, t / 1e3, 1e-9) for t in (1.5, 2.5, 6.0, 9.5, 10.5, 99)] == [
        1, 2, 5, 6, 7, 8,
    ]  # fmt: skip
    assert costs.slots(queue, Cursor(1, 2), 1, 0.0055, 1e-9) == 2
    # A stall is not believed at once.
    assert costs.after(np.array([0], np.int32), 1, 5.0).seconds[0] == pytest.approx(0.004)
    assert np.isfinite(costs.seconds).all() and costs.last == 0.004


def test_a_pace_is_the_median_of_the_last_three() -> None:
    pace = Pace(7.0)
    assert pace.speed == 7.0
    for seconds, speed in ((1.0, 100.0), (0.5, 150.0), (100.0, 100.0), (100.0, 1.0)):
        pace = pace.after(100, seconds)
        assert pace.speed == speed


# ------------------------------------------------------------------------------------------- after a step


def test_a_finished_tile_answers_an_edit_and_a_whole_pass_what_started_over() -> None:
    scene = mixed_scene()
    side = replace(side_of(view_of(scene), mode=Mode.INCREMENTAL), is_answered=False)
    nothing = scheduler.stepped(side, report_of(side, [], 0), 0.01, side.progress)
    assert not nothing.is_answered and nothing.version == side.version and nothing.seconds == 0.01
    tile = scheduler.stepped(nothing, report_of(side, [3], 1), 0.01, side.progress)
    assert tile.is_answered and tile.urgent == tile.version > side.version
    assert np.flatnonzero(tile.replaced).tolist() == [3] and not side.replaced.any()
    more = scheduler.stepped(tile, report_of(side, [4], 2), 0.01, side.progress)
    assert more.version > tile.version and more.urgent == tile.urgent

    base = replace(side_of(view_of(scene), mode=Mode.BASE), is_answered=False)
    part = scheduler.stepped(base, report_of(base, [0, 1], 2, 128), 0.01, base.progress)
    assert not part.is_answered and part.whole == base.whole
    whole = scheduler.stepped(part, report_of(base, [2], 24, 64), 0.02, base.progress)
    assert whole.is_answered and whole.whole.measured == (pytest.approx(192 / 0.03),)


def test_costs_are_learnt_at_full_resolution() -> None:
    view = view_of(mixed_scene())
    side = side_of(view)
    learnt = scheduler.stepped(side, report_of(side, [0, 1], 2, 128), 0.5, side.progress).costs
    assert np.flatnonzero(np.isfinite(learnt.seconds)).tolist() == [0, 1, 2]
    coarse = replace(side_of(view, divisor=2), costs=learnt)
    after = scheduler.stepped(coarse, report_of(coarse, [0], 1), 0.5, coarse.progress)
    assert after.costs is learnt
    # Another grid knows nothing of them.
    other = side_of(view_of(mixed_scene(tile_size=16)))
    after = scheduler.stepped(replace(other, costs=learnt), report_of(other, [0], 1), 0.5, other.progress)
    assert after.costs.grid == other.progress.grid and np.isfinite(after.costs.seconds).sum() == 2


# ------------------------------------------------------------------------------------------------- pictures


@pytest.mark.parametrize(
    ("mode", "spp", "divisor", "seconds"),
    [
        (Mode.INCREMENTAL, 2, 1, 0.0),
        (Mode.REFINE, 2, 1, 0.1),
        (Mode.REFINE, 64, 1, 0.3),
        (Mode.REFINE, 2, 2, 0.0),
    ],
)
def test_a_picture_is_read_as_often_as_it_is_worth_it(
    mode: Mode, spp: int, divisor: int, seconds: float
) -> None:
    side = replace(side_of(view_of(mixed_scene()), mode=mode, spp=spp, divisor=divisor), version=5, urgent=3)
    assert not scheduler.is_reading_due(side, 5, 99.0, must_be_new=True)
    assert scheduler.is_reading_due(side, 4, seconds + 1e-6, must_be_new=False)
    assert not scheduler.is_reading_due(side, 4, seconds - 0.01, must_be_new=False)
    assert scheduler.is_reading_due(side, 4, -1.0, must_be_new=True)
    assert scheduler.is_reading_due(side, 2, -1.0, must_be_new=False)


def test_first_hits_are_few_while_the_scene_changes() -> None:
    view = view_of(mixed_scene())
    side = side_of(view)
    # A fifth of 10 ms is 120 rays.
    assert scheduler.first_hit_rows(view, side, 6e4, NOW) == ((44, 28), 2)
    assert scheduler.first_hit_rows(view, side, 1.0, NOW) == ((44, 28), 1)
    moving = replace(side, changed_at=NOW)
    assert scheduler.first_hit_rows(view, moving, 6e4, NOW) == ((11, 7), 7)
    assert scheduler.first_hit_rows(view, moving, 1e9, NOW) == ((44, 28), 28)
    assert scheduler.first_hit_rows(replace(view, paused=True), moving, 6e4, NOW) == ((44, 28), 2)


def test_the_resolution_does_not_flicker() -> None:
    view = view_of(mixed_scene())  # 1,232 pixels
    fits = [
        scheduler.fitting_divisor(view, Pace(1232 / 0.010 / share), 1) for share in (1.3, 1.5, 6.0, 400.0)
    ]
    assert fits == [1, 2, 4, 16]
    # A picture that takes 1.2 steps with a divisor of 2 stays as it is, from either side.
    pace = Pace(1232 / 0.010 / 4.8)
    assert [scheduler.fitting_divisor(view, pace, now) for now in (1, 2, 4)] == [2, 2, 4]
    assert scheduler.fitting_divisor(view, Pace(1232 / 0.010 / 3.0), 4) == 2


def test_settings_of_a_view() -> None:
    scene = mixed_scene(base_nor=4, sample_rate=2, tile_size=64)
    view = view_of(scene, resolution_scale=0.5)
    settings = scheduler.settings_of(view, None, FAST, 1)
    assert settings == replace(scene.settings, size=(22, 14), slots_per_step=1)
    coarse = scheduler.settings_of(view, "restart", FAST, 4)
    assert (coarse.size, coarse.strategy, coarse.tile_size) == ((6, 4), "restart", RenderSettings.tile_size)
    assert (coarse.base_nor, coarse.sample_rate) == (1, 1)
