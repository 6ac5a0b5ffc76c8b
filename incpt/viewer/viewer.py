"""What a viewer sees while the scene is edited, and how rendering stays responsive.

A viewer hands in what it wants to see, a `View`, and calls `advance` over and over; each call does one
bounded piece of work and returns the `Frame` to show. There is no thread in here and nothing waits. What to
do follows from `scheduler.next_work`, a pure function; this module does it.

Between two steps only the latest view counts. During a drag tiles are repeated less often, so that the region
of the object follows soon; when it ends, the strategy starts anew with the NoR of the settings.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from incpt.core.errors import DeviceError, InputError
from incpt.device.device import Device
from incpt.picture.tone_mapping import tone_map_covered
from incpt.render.export import shown_image, write_picture
from incpt.render.modes import Mode
from incpt.render.path_buffer import check_settings
from incpt.render.session import Session, StepReport
from incpt.render.strategies import RESTART
from incpt.scene.model import Scene
from incpt.viewer import scheduler
from incpt.viewer.pace import Pace
from incpt.viewer.picture import FirstHitReader, PictureReader
from incpt.viewer.scheduler import Follow, ReturnToFull, Side, Step, ViewerState
from incpt.viewer.view import Float32Image, Frame, View


class RenderingStoppedError(DeviceError):
    """A step failed, as opposed to an edit: the device can do no more."""


@dataclass(frozen=True, eq=False)
class _Seat:
    """The session of a side, and what reads its picture."""

    session: Session
    reader: PictureReader


class Viewer:
    """Renders what somebody wants to see on `device` (a Device, or what chooses one).

    `on_build` is called with (done, total) while kernels are built, here and after an edit that needs others;
    what it raises comes through. `clock` gives seconds. Raises InputError and DeviceError as Session does.
    """

    def __init__(
        self,
        view: View,
        device: Device | str | int | None = None,
        on_build: Callable[[int, int], None] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.device = device if isinstance(device, Device) else Device(device)
        self._on_build, self._clock = on_build, clock
        self._refused: View | None = None
        self._reference: Float32Image | None = None
        self._reference_scene: Scene | None = None
        self._is_stale = False
        self._is_pinning = False
        self._rest_is_shown = False
        self._cannot_prepare = False
        self._sighted: Scene | None = None
        self._step_seconds, self._speed = 0.0, 0.0
        side, seat = self._opened(view, None)
        self._state = ViewerState(view, (side,), (0.0,), clock())
        self._seats: tuple[_Seat, ...] = (seat,)
        pace = Pace(5e6 if self.device.is_cpu else 5e8)
        self._hits = FirstHitReader(seat.session, pace, clock)
        seat.session.build(on_build, for_edits=False)

    @property
    def session(self) -> Session:
        """That of the chosen strategy; to look at."""
        return self._seats[-1].session

    def advance(self, view: View, has_edit_after: Callable[[], bool] = lambda: False) -> Frame | None:
        """Do one bounded piece of work towards `view` and return what there is to show; None: nothing to do,
        and nothing new. `has_edit_after` tells whether another scene waits: then one more picture of this
        one, which has been answered, is not worth the time to read it, nor is the first sight of it.

        What an edit or a setting raises (InputError, DeviceError, MemoryError) comes through once for a view;
        the last good one is rendered on. RenderingStoppedError: a step failed, nothing can go on.
        """
        step = self._follow(view)
        try:
            had_answer = self._main.is_answered
            if step is not None:
                sight = None if has_edit_after() else self._first_sight()
                if sight is not None:
                    return self._frame(resting=False, first_sight=sight)
                if had_answer and self.session.mode is Mode.REFINE:
                    self.prepare()
                self._render(step)
                if had_answer and has_edit_after():
                    return None
            elif self._rest_is_shown:
                return None
            self._rest_is_shown = self._has_first_hits(step is None) and step is None
            return self._frame(resting=self._rest_is_shown)
        except (DeviceError, MemoryError) as error:
            raise RenderingStoppedError(_explain(error)) from error

    def prepare(self) -> bool:
        """Do a bounded piece of what the next edit would wait for; returns whether more is left. `advance`
        does one with each step; where it has nothing to do, there is time for all."""
        if self._cannot_prepare or self._main.divisor > 1:
            return False
        try:
            return self.session.prepare_edit()
        except (DeviceError, MemoryError):
            # Perhaps no edit comes; one that needs the memory will say what is missing.
            self._cannot_prepare = True
            return False

    def pick(self, point: tuple[float, float]) -> str | None:
        """The name of the object at a point (x, y) from the top left in units of the image, or None."""
        x, y = point
        return self.session.pick_point((x, y)) if 0 <= x < 1 and 0 <= y < 1 else None

    def pick_box(self, low: tuple[float, float], high: tuple[float, float]) -> tuple[str, ...]:
        """The names of the objects that are seen in a box, in the order of the scene; its corners (x, y) are
        from the top left in units of the image."""
        width, height = self.session.size
        left, top = max(math.floor(low[0] * width), 0), max(math.floor(low[1] * height), 0)
        right, bottom = min(math.ceil(high[0] * width), width), min(math.ceil(high[1] * height), height)
        if left >= right or top >= bottom:
            return ()
        seen = self.session.first_hits(rows=(top, bottom)).object_id[:, left:right]
        return tuple(self.session.scene.objects[i].name for i in np.unique(seen) if i >= 0)

    def restart(self) -> None:
        """Throw away what was accumulated; the picture stands until it is rendered anew."""
        for place, seat in enumerate(self._seats):
            seat.session.restart()
            self._note(place, scheduler.restarted(self._state.sides[place], seat.session.progress))
        self._rest_is_shown = False

    def pin_reference(self, on: bool) -> None:
        """Compare with the picture as it is now (with the next whole one of full resolution, where it is
        none), or no longer. The reference goes when the size changes."""
        self._reference, self._is_pinning = None, on
        self._reference_scene, self._is_stale = None, False
        self._rest_is_shown = False

    def export(
        self,
        path: str | Path,
        aovs: bool = False,
        exposure: float = 0.0,
        curve: str = "agx",
        denoised: Callable[[Session], Float32Image] | None = None,
    ) -> None:
        """Write the picture of the chosen strategy at full resolution; see `write_picture`. Pixels without a
        sample get one first. `denoised` makes the denoised picture of a session, if it is wanted."""
        self._fill()
        clean = None if denoised is None else denoised(self.session)
        write_picture(Path(path), self.session, aovs, exposure, curve, clean)

    def displayed(
        self,
        exposure: float = 0.0,
        curve: str = "agx",
        denoised: Callable[[Session], Float32Image] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """(H, W, 3) or (H, W, 4) the picture in sRGB as `export` writes it to a .png."""
        self._fill()
        clean = None if denoised is None else denoised(self.session)
        return tone_map_covered(shown_image(self.session, clean), exposure, curve)

    def is_whole(self, view: View) -> bool:
        """Whether the picture is at full resolution, and one of the scene of `view` alone."""
        return scheduler.is_whole(self._main, view)

    @property
    def has_answered(self) -> bool:
        """Whether nobody waits for the answer to an edit: there is a picture of the scene as it is wanted, or
        rendering is paused, and nothing is dragged."""
        view = self._state.view
        is_shown = scheduler.shows(self._main, view) and self._main.is_answered
        return view.before is None and (is_shown or view.paused)

    def _fill(self) -> None:
        """Bring the picture to full resolution, with a sample in each pixel."""
        place, main = len(self._seats) - 1, self._main
        if main.divisor > 1:
            settings = scheduler.settings_of(main.view, main.strategy, main.whole, 1)
            self._return_to_full(ReturnToFull(place, settings))
        while self.session.mode is Mode.BASE:
            slots = scheduler.slots_of_step(self._main, self._state.view.step_ms)
            self._step(Step(place, slots, self._state.spent))

    # ------------------------------------------------------------------------------------ following the view

    @property
    def _main(self) -> Side:
        return self._state.main

    def _follow(self, view: View) -> Step | None:
        """Do all that leads to the view but the rendering; returns the step that is to be rendered then."""
        known = self._state.view
        if view is known or view is self._refused or view == self._refused:
            view = known
        elif view != known:
            self._rest_is_shown = False
        good: View | None = self._main.view
        try:
            self._split(view)
            while True:
                state = replace(self._state, view=view, now=self._clock())
                work = scheduler.next_work(state)
                if isinstance(work, Follow):
                    self._bring(work)
                elif isinstance(work, ReturnToFull):
                    good = self._main.full_view
                    self._return_to_full(work)
                else:
                    self._state = replace(self._state, view=view)
                    return work
        except (InputError, DeviceError, MemoryError) as error:
            if good is None:
                raise RenderingStoppedError(_explain(error)) from error
            self._refused = view
            shown = replace(
                view,
                scene=good.scene,
                before=good.before,
                resolution_scale=good.resolution_scale,
                region=good.region,
                split=len(self._seats) > 1,
            )
            self._state = replace(self._state, view=shown)
            raise

    def _split(self, view: View) -> None:
        state, seats = self._state, self._seats
        if not view.split:
            self._seats = seats[-1:]
            self._state = replace(state, sides=state.sides[-1:], spent=state.spent[-1:])
        elif len(seats) == 1:
            side, seat = self._opened(view, RESTART.name)
            self._seats = (seat, *seats)
            sides, spent = (side, *state.sides), state.spent * 2
            self._state = replace(state, sides=sides, spent=spent)

    def _opened(self, view: View, strategy: str | None) -> tuple[Side, _Seat]:
        whole = Pace(1e6 if self.device.is_cpu else 5e7)
        divisor = scheduler.fitting_divisor(view, whole, 1)
        settings = scheduler.settings_of(view, strategy, whole, divisor)
        session = Session(view.scene, settings=settings, device=self.device)
        side = Side.opened(view, session.progress, whole, divisor, strategy)
        return side, _Seat(session, PictureReader(session, self._clock))

    def _bring(self, work: Follow) -> None:
        """On an error everything stays as it was."""
        session = self._seats[work.side].session
        if work.divisor > 1:
            side = self._state.sides[work.side]
            check_settings(scheduler.settings_of(work.view, side.strategy, side.whole, 1))
        order = session.queue.tiles
        session.edit(work.view.scene, work.pixel, work.since, work.settings)
        # A drag often ends without another edit; where there is one, it has begun a new order already.
        if work.ends_drag and work.since is not None and session.queue.tiles is order:
            session.end_drag(work.since, work.pixel)
        if work.divisor > 1 and session.mode is Mode.INCREMENTAL:
            session.restart()
        side = self._state.sides[work.side]
        self._note(work.side, scheduler.followed(side, work, session.progress, self._clock()))
        session.build(self._on_build, for_edits=False)
        self._is_stale = self._reference_scene is not None and not _is_same_picture(
            self._reference_scene, session.scene
        )
        height_width = work.view.size[::-1]
        if self._reference is not None and self._reference.shape[:2] != height_width:
            self._reference, self._reference_scene, self._is_stale = None, None, False

    def _return_to_full(self, work: ReturnToFull) -> None:
        session = self._seats[work.side].session
        session.configure(work.settings)
        side = self._state.sides[work.side]
        self._note(work.side, scheduler.returned_to_full(side, session.progress))

    def _note(self, place: int, side: Side) -> None:
        sides = self._state.sides
        self._state = replace(self._state, sides=(*sides[:place], side, *sides[place + 1 :]))

    # ------------------------------------------------------------------------------------ work

    def _render(self, step: Step) -> None:
        report, seconds = self._step(step)
        if step.side == len(self._seats) - 1:
            self._step_seconds = seconds
            speed = report.paths / seconds
            self._speed = speed if self._speed == 0 else 0.8 * self._speed + 0.2 * speed

    def _step(self, step: Step) -> tuple[StepReport, float]:
        session = self._seats[step.side].session
        start = self._clock()
        report = session.step(step.slots)
        seconds = max(self._clock() - start, 1e-6)
        side = self._state.sides[step.side]
        self._note(step.side, scheduler.stepped(side, report, seconds, session.progress))
        spent = tuple(t + seconds * (place == step.side) for place, t in enumerate(step.spent))
        self._state = replace(self._state, spent=spent)
        return report, seconds

    def _has_first_hits(self, is_idle: bool) -> bool:
        """Whether all first hits are there that are wanted; some rows more of them, unless an edit waits for
        its answer."""
        view, main = self._state.view, self._main
        if not view.needs_first_hits:
            return True
        return (main.is_answered or is_idle) and self._hits.advance(view, main)

    def _first_sight(self) -> Float32Image | None:
        """What an edit moved, at its new place, before the first step of it; once for each scene."""
        session = self.session
        if len(self._seats) > 1 or session.scene is self._sighted:
            return None
        self._sighted = session.scene
        return session.first_sight()

    def _frame(self, resting: bool, first_sight: Float32Image | None = None) -> Frame:
        main, view = self._main, self._state.view
        if self._is_pinning and main.divisor == 1:
            image = self._seats[-1].reader.image(main, must_be_new=True)
            if image[..., 3].min() > 0:
                self._reference, self._is_pinning = image[..., :3], False
                self._reference_scene = self.session.scene
        pictures = tuple(
            seat.reader.picture(side, self._reference, resting, first_sight)
            for seat, side in zip(self._seats, self._state.sides, strict=True)
        )
        if not scheduler.shows(main, view):
            shown = main.view
            view = replace(
                view,
                scene=shown.scene,
                before=shown.before,
                resolution_scale=shown.resolution_scale,
                region=shown.region,
            )
        return Frame(
            view=view,
            pictures=pictures,
            is_preview=main.divisor > 1,
            step_seconds=self._step_seconds,
            paths_per_second=self._speed,
            device=self.device.name,
            first_hits=self._hits.first_hits if view.needs_first_hits else None,
            nonfinite=sum(side.nonfinite for side in self._state.sides),
            cut_off=scheduler.share_cut_off(self._state.sides),
            resting=resting,
            is_pinned=self._reference is not None or self._is_pinning,
            is_stale=self._is_stale,
        )


def _is_same_picture(first: Scene, second: Scene) -> bool:
    """Whether two scenes have the same picture, whatever they propose about how to render it."""
    return first is second or replace(first, settings=second.settings) == second


def _explain(error: Exception) -> str:
    return str(error) or "memory ran out; use a smaller image or scene"
