"""What to do next for somebody who looks: a pure function of the view, of where each picture stands, and of
what was measured.

`next_work` answers with one piece of work, which `Viewer` does; `followed`, `returned_to_full`, `stepped` and
`restarted` say what is known after it. Nothing in here renders, reads a clock or changes a value, so that the
rules can be tested without a device:

- An edit is taken up once the one before it has been answered by a finished tile (or, where everything starts
  over, by a whole picture), because otherwise a drag that is faster than a tile would never show anything.
- Where a change makes the picture start over, and a whole picture does not fit a step, it is first rendered
  with a half, a quarter ... of the pixels a side, until the view rests.
- A step takes about the time that the view asks for: its slots follow from what the same tiles took before.
- In a split view both sides get the same time, and the answer to an edit comes first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from incpt.core.settings import PICTURE_SETTINGS, RenderSettings
from incpt.render.modes import Event, Mode, next_mode
from incpt.render.progress import Progress
from incpt.render.session import StepReport
from incpt.render.strategies import STRATEGIES_BY_NAME
from incpt.scene.change import affected_objects, diff
from incpt.scene.model import Scene
from incpt.viewer.pace import Pace, TileCosts
from incpt.viewer.view import View

REST_SECONDS = 0.15
"""A view rests once nothing has changed for so long."""
LONGEST_WAIT = 0.5
"""How long an edit waits for an answer to the one before it, where neither belongs to a drag; seconds."""
REFINE_IMAGE_SECONDS = 0.1
"""The time between two pictures while nothing but noise changes."""
SETTLED_SPP = 64
"""Samples per pixel from which on pictures come less often still, because noise hardly changes."""
FIRST_SHARE = 0.5
"""The share of a step's time that the steps up to the first tile after an edit get."""
MOST_AHEAD = 2
"""Steps that the answer to an edit may cost the other side of a split view in advance."""
COARSEST = 16
"""The largest divisor of the resolution while everything starts over."""
FIRST_HIT_SHARE = 0.2
"""The share of a step's time that first hits get."""


# ------------------------------------------------------------------------------------------ what is known


@dataclass(frozen=True, eq=False)
class Side:
    """What is known of one picture; a split view has two. Each piece of work puts another value in its place.

    view         the view that it renders.
    progress     where its session stands.
    strategy     the one that it renders with whatever the settings say; None: as they say.
    divisor      what the resolution is divided by.
    full_view    the last view that it rendered at full resolution; None: there was none.
    changed_at   when the scene changed last; -inf where nobody waits for it to rest: at first, and after a
                 drag.
    is_answered  whether a finished tile has answered the last change, or, where the picture started over, a
                 whole one.
    seconds      rendering time since the last change.
    nonfinite    samples since the last change that were not finite.
    paths        paths since the last change, of which `cut_off` ended because they had no passages through
                 glass left.
    replaced     (grid.count,) the tiles that are finished since the last change.
    version      goes up whenever the picture shows something new.
    urgent       the last version that is to be shown at once.
    whole        how fast whole pictures were rendered.
    pass_paths   paths of the first pass since the last change, and `pass_seconds` what they took.
    costs        what each tile took at full resolution.
    """

    view: View
    progress: Progress
    whole: Pace
    costs: TileCosts
    replaced: npt.NDArray[np.bool_]
    strategy: str | None = None
    divisor: int = 1
    full_view: View | None = None
    changed_at: float = -math.inf
    is_answered: bool = False
    seconds: float = 0.0
    nonfinite: int = 0
    paths: int = 0
    cut_off: int = 0
    version: int = 1
    urgent: int = 1
    pass_paths: int = 0
    pass_seconds: float = 0.0

    @classmethod
    def opened(
        cls, view: View, progress: Progress, whole: Pace, divisor: int, strategy: str | None = None
    ) -> Side:
        """A picture of which nothing is rendered yet."""
        grid = progress.grid
        return cls(
            view=view,
            progress=progress,
            whole=whole,
            costs=TileCosts.unknown(grid),
            replaced=np.zeros(grid.count, np.bool_),
            strategy=strategy,
            divisor=divisor,
            full_view=view if divisor == 1 else None,
        )


@dataclass(frozen=True, eq=False)
class ViewerState:
    """All that `next_work` looks at.

    view   what is wanted.
    sides  the pictures; that of the chosen strategy is the last one.
    spent  the rendering time of each side in all, by which the device is shared.
    now    the time, in seconds.
    """

    view: View
    sides: tuple[Side, ...]
    spent: tuple[float, ...]
    now: float

    @property
    def main(self) -> Side:
        """The picture of the chosen strategy."""
        return self.sides[-1]


# ------------------------------------------------------------------------------------------ what to do


@dataclass(frozen=True, eq=False)
class Follow:
    """Bring a side to another view.

    divisor    what the resolution is divided by from now on. Above 1 nothing of the picture is kept.
    settings   of the session from now on.
    pixel      the point that was clicked last, in its pixels.
    since      the scene before the drag that the edit belongs to.
    ends_drag  the drag ends with it.
    """

    side: int
    view: View
    divisor: int
    settings: RenderSettings
    pixel: tuple[float, float] | None = None
    since: Scene | None = None
    ends_drag: bool = False


@dataclass(frozen=True, eq=False)
class ReturnToFull:
    """Render a side at full resolution from now on, with `settings`."""

    side: int
    settings: RenderSettings


@dataclass(frozen=True)
class Step:
    """Render a step of so many slots on a side. `spent` is the rendering time of each side before it: that of
    a side with nothing to do goes on as if it had rendered, so that it cannot claim that time later."""

    side: int
    slots: int
    spent: tuple[float, ...]


Work = Follow | ReturnToFull | Step


def next_work(state: ViewerState) -> Work | None:
    """What to do next; None: nothing. Edits come first, then the return to full resolution, then a step."""
    view, now = state.view, state.now
    for place, side in enumerate(state.sides):
        if not shows(side, view) and (view.paused or may_change(side, view, now)):
            return _follow(state, place)
    if view.paused:
        return None
    for place, side in enumerate(state.sides):
        if side.divisor > 1 and side.is_answered and rests(side, now):
            return ReturnToFull(place, settings_of(side.view, side.strategy, side.whole, 1))
    return _step(state)


def shows(side: Side, view: View) -> bool:
    """Whether nothing is to do to get to that view."""
    mine = side.view
    return mine is view or (
        (mine.scene is view.scene or mine.scene == view.scene)
        and (mine.before is view.before or mine.before == view.before)
        and mine.size == view.size
    )


def is_whole(side: Side, view: View) -> bool:
    """Whether the picture is one of the view's scene alone: no preview, and nothing is left of an edit, or as
    little as the view asks for."""
    is_still = view.before is None and shows(side, view)
    is_found = side.progress.mode is Mode.REFINE and not side.progress.error_left
    return is_still and side.divisor == 1 and (is_found or is_done(side, view.target_spp))


def may_change(side: Side, view: View, now: float) -> bool:
    """Whether the last change has been answered, or is not worth to wait for."""
    is_dragged = side.view.before is not None or view.before is not None
    return side.is_answered or (not is_dragged and now - side.changed_at > LONGEST_WAIT)


def rests(side: Side, now: float) -> bool:
    """Whether nothing has changed for a while, or the drag has ended."""
    return now - side.changed_at >= REST_SECONDS


def share_cut_off(sides: Sequence[Side]) -> float:
    """Which part of the paths since the last change had no passages through glass left."""
    return sum(side.cut_off for side in sides) / max(sum(side.paths for side in sides), 1)


def is_done(side: Side, target_spp: int | None) -> bool:
    """Whether every pixel has so many samples of the scene as it is now."""
    return (
        target_spp is not None
        and side.divisor == 1
        and side.progress.mode is Mode.REFINE
        and int(side.progress.tile_spp.min()) >= target_spp
    )


def _follow(state: ViewerState, place: int) -> Follow:
    view, side = state.view, state.sides[place]
    # A picture that starts over beside one that is kept is shown as it is, so that they can be compared.
    with_preview = not view.paused and (side is state.main or state.main.divisor > 1)
    divisor = side.divisor
    if with_preview and _starts_over(side, view):
        divisor = fitting_divisor(view, side.whole, side.divisor)
    settings = settings_of(view, side.strategy, side.whole, divisor)
    pixel = None
    if view.point is not None:
        pixel = (view.point[0] * settings.size[0], view.point[1] * settings.size[1])
    # In a drag tiles get fewer samples than the settings say, which its end makes up for.
    ends_drag = view.before is None and settings.nor > side.progress.settings.nor
    since = side.view.before if ends_drag else view.before
    return Follow(place, view, divisor, settings, pixel, since if divisor == 1 else None, ends_drag)


def _starts_over(side: Side, view: View) -> bool:
    """Whether nothing of the picture can be kept."""
    old, new = side.progress.settings, view.scene.settings
    if side.divisor > 1 or side.view.size != view.size:
        return True
    if any(getattr(old, name) != getattr(new, name) for name in (*PICTURE_SETTINGS, "tile_size")):
        return True
    change = diff(side.view.scene, view.scene)
    strategy = STRATEGIES_BY_NAME[side.strategy or new.strategy]
    if strategy.starts_over(change):
        return True
    differs = change.is_global or bool(affected_objects(side.view.scene, view.scene, change))
    return differs and next_mode(side.progress.mode, Event.LOCAL_CHANGE, strategy) is Mode.BASE


def _step(state: ViewerState) -> Step | None:
    """Whose turn it is: equal time for both, and the answer to an edit first."""
    view, sides, spent = state.view, state.sides, state.spent
    waiting = [place for place, side in enumerate(sides) if not is_done(side, view.target_spp)]
    if not waiting:
        return None
    behind, main = min(waiting, key=lambda place: spent[place]), len(sides) - 1
    is_urgent = main in waiting and not sides[main].is_answered
    may_go_first = spent[main] - spent[behind] < MOST_AHEAD * view.step_ms / 1e3
    turn = main if is_urgent and may_go_first else behind
    levelled = tuple(
        seconds if place in waiting else max(seconds, spent[turn]) for place, seconds in enumerate(spent)
    )
    return Step(turn, slots_of_step(sides[turn], view.step_ms), levelled)


def slots_of_step(side: Side, step_ms: float) -> int:
    """Slots of a step of about that length; of a shorter one where an edit waits for its first tile. A little
    more ends the queue where only a little is left of it."""
    progress = side.progress
    cursor, queue, settings = progress.cursor, progress.queue, progress.settings
    seconds = step_ms / 1e3
    if not side.is_answered and progress.mode is Mode.INCREMENTAL:
        seconds *= FIRST_SHARE
    left = queue.slot_count - queue.slots_before(cursor)
    if side.divisor > 1 and progress.mode is Mode.BASE:
        slots = left
    else:
        area, guess = settings.tile_size**2, 1 / side.whole.speed
        slots = _known_costs(side).slots(queue, cursor, area, seconds, guess)
    if left <= 1.3 * slots:
        slots = left
    most = side.view.scene.settings.slots_per_step
    return max(1, slots if most is None else min(slots, most * settings.sample_rate))


def settings_of(view: View, strategy: str | None, whole: Pace, divisor: int) -> RenderSettings:
    """The view's settings with the resolution divided by `divisor`; steps choose their slots themselves."""
    settings, (width, height) = view.scene.settings, view.size
    nor = settings.nor
    if view.before is not None:
        # The repetitions of one tile have to fit a step, also where tiles are large.
        per_tile = settings.tile_size**2 * settings.sample_rate
        fitting = int(whole.speed * view.step_ms / 1e3 / per_tile)
        nor = min(nor, view.drag_nor, max(fitting, 1))
    size = -(-width // divisor), -(-height // divisor)
    strategy = strategy or settings.strategy
    settings = replace(settings, size=size, nor=nor, strategy=strategy, slots_per_step=1)
    if divisor == 1:
        return settings
    tile_size = min(settings.tile_size, RenderSettings.tile_size)
    return replace(settings, tile_size=tile_size, base_nor=1, sample_rate=1)


def fitting_divisor(view: View, whole: Pace, now: int) -> int:
    """The least power of two with which a whole picture fits a step. It stays as it is `now` within bounds,
    so that the resolution does not flicker."""
    width, height = view.size
    settings = view.scene.settings
    paths = width * height * settings.base_nor * settings.sample_rate
    share = paths / whole.speed / (view.step_ms / 1e3)
    if share <= 1.4:
        return 1
    # A coarse picture has one path for each pixel, whatever the settings say.
    share = width * height / whole.speed / (view.step_ms / 1e3)
    divisor = max(now, 2)
    while divisor < COARSEST and share / divisor**2 > 1.4:
        divisor *= 2
    while divisor > 2 and share / (divisor // 2) ** 2 < 0.8:
        divisor //= 2
    return divisor


def is_reading_due(side: Side, read_version: int, seconds_since: float, must_be_new: bool) -> bool:
    """Whether to read the picture, of which `read_version` was read so long ago."""
    if side.version == read_version:
        return False
    return must_be_new or side.urgent > read_version or seconds_since >= _image_seconds(side)


def first_hit_rows(view: View, main: Side, speed: float, now: float) -> tuple[tuple[int, int], int]:
    """The size (width, height) at which first hits are traced, `speed` of them in a second, and how many rows
    of it at once. While the scene changes there are fewer of them than pixels, so that they come at once and
    cost little."""
    width, height = main.view.size
    rays = speed * view.step_ms / 1e3 * FIRST_HIT_SHARE
    if rests(main, now) or view.paused:
        return (width, height), max(1, int(rays / width))
    divisor = 1
    while divisor < COARSEST and width * height / divisor**2 > rays:
        divisor *= 2
    size = -(-width // divisor), -(-height // divisor)
    return size, size[1]


def _image_seconds(side: Side) -> float:
    """The time between two pictures: where only noise changes, few are enough."""
    if side.progress.mode is not Mode.REFINE or side.divisor > 1:
        return 0.0
    is_settled = int(side.progress.tile_spp.min()) >= SETTLED_SPP
    return REFINE_IMAGE_SECONDS * (3 if is_settled else 1)


def _known_costs(side: Side) -> TileCosts:
    grid = side.progress.grid
    is_known = side.divisor == 1 and side.costs.grid == grid
    return side.costs if is_known else TileCosts.unknown(grid)


# ------------------------------------------------------------------------------------------ what follows


def followed(side: Side, work: Follow, progress: Progress, now: float) -> Side:
    """The side after `work`, which brought its session to `progress`."""
    before, was_dragged = side.progress, side.view.before is not None
    full_view = work.view if work.divisor == 1 else side.full_view
    side = replace(side, view=work.view, divisor=work.divisor, full_view=full_view, progress=progress)
    begins = progress.queue is not before.queue and progress.mode is not Mode.REFINE
    # Where an edit is taken back, the picture of the scene before it is there at once.
    returns = progress.anchor is not before.anchor and progress.mode is Mode.REFINE
    if begins or returns or progress.grid != before.grid:
        side = replace(restarted(side, progress), changed_at=now, is_answered=returns)
    if work.view.before is None and was_dragged:
        side = replace(side, changed_at=-math.inf)
    return side


def returned_to_full(side: Side, progress: Progress) -> Side:
    """The side after its session went to full resolution."""
    side = replace(side, divisor=1, full_view=side.view, pass_paths=0, pass_seconds=0.0)
    return _forgot_tiles(side, progress)


def restarted(side: Side, progress: Progress) -> Side:
    """The side after its session began something new."""
    side = replace(side, seconds=0.0, nonfinite=0, paths=0, cut_off=0)
    side = replace(side, is_answered=False, pass_paths=0, pass_seconds=0.0)
    return _forgot_tiles(side, progress)


def stepped(side: Side, report: StepReport, seconds: float, progress: Progress) -> Side:
    """The side after a step that took so long and brought its session to `progress`."""
    before, version, urgent = side.progress, side.version, side.urgent
    costs, whole, is_answered = side.costs, side.whole, side.is_answered
    pass_paths, pass_seconds = side.pass_paths, side.pass_seconds
    if side.divisor == 1:
        touched = before.queue.tiles[before.cursor.tiles : report.queue_done + 1]
        costs = _known_costs(side).after(touched, report.paths, seconds)
    replaced = side.replaced.copy()
    replaced[report.tiles] = True
    is_first_pass, is_whole = report.mode is Mode.BASE, report.queue_done == report.queue_length
    if is_first_pass:
        pass_paths, pass_seconds = pass_paths + report.paths, pass_seconds + seconds
        whole = whole.after(pass_paths, pass_seconds) if is_whole else whole
    if report.is_shown:
        version += 1
        if not is_answered and (is_whole or not is_first_pass):
            is_answered, urgent = True, version
    return replace(
        side,
        progress=progress,
        whole=whole,
        costs=costs,
        replaced=replaced,
        is_answered=is_answered,
        seconds=side.seconds + seconds,
        nonfinite=side.nonfinite + report.nonfinite,
        paths=side.paths + report.paths,
        cut_off=side.cut_off + report.cut_off,
        version=version,
        urgent=urgent,
        pass_paths=pass_paths,
        pass_seconds=pass_seconds,
    )


def _forgot_tiles(side: Side, progress: Progress) -> Side:
    version, replaced = side.version + 1, np.zeros(progress.grid.count, np.bool_)
    return replace(side, progress=progress, replaced=replaced, version=version, urgent=version)
