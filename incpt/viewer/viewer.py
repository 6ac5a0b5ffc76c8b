"""What a viewer sees while the scene is edited, and how rendering stays responsive.

A viewer hands in what it wants to see, a `View`, and calls `advance` over and over; each call does one
bounded piece of work and returns the `Frame` to show. There is no thread in here and nothing waits.

- A step takes about the time that the view asks for: its slots follow from what the same tiles took before.
- Between two steps only the latest view counts. An edit is taken up once the one before it has been answered
  by a finished tile (or, where everything starts over, by a whole picture), because otherwise a drag that is
  faster than a tile would never show anything.
- During a drag tiles are repeated less often, so that the region of the object follows soon. When it ends,
  the spiral starts anew with the NoR of the settings.
- Where a change makes the picture start over, and a whole picture does not fit a step, it is first rendered
  with a half, a quarter ... of the pixels a side, until the view rests.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from incpt.core.errors import DeviceError, InputError
from incpt.device.device import Device
from incpt.render.export import write_picture
from incpt.render.first_hits import Aovs
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.render.strategies import RESTART
from incpt.viewer.pace import Pace
from incpt.viewer.side import COARSEST, Side
from incpt.viewer.view import Float32Image, Frame, Picture, View

__all__ = ["Frame", "Live", "Picture", "RenderingStoppedError", "View"]

MOST_AHEAD = 2
"""Steps that the answer to an edit may cost the other side of a split view in advance."""
AOV_SHARE = 0.2
"""Of the time of a step, for first-hit images."""


class RenderingStoppedError(DeviceError):
    """A step failed, as opposed to an edit: the device can do no more."""


class Live:
    """Renders what a viewer wants to see on `device` (a Device, or what chooses one).

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
        self._view = view
        self._refused: View | None = None
        self._main = Side(view, self.device, None, clock)
        self._restarting: Side | None = None
        self._reference: Float32Image | None = None
        self._is_pinning = False
        self._aovs: Aovs | None = None
        self._aovs_of: tuple[object, ...] | None = None
        self._aovs_wanted: tuple[object, ...] | None = None
        self._bands: list[Aovs] = []
        self._aov_pace = Pace(5e6 if self.device.is_cpu else 5e8)
        self._rest_is_shown = False
        self._step_seconds, self._speed = 0.0, 0.0
        self._main.session.build(on_build)

    @property
    def session(self) -> Session:
        """That of the chosen strategy; to look at."""
        return self._main.session

    def advance(self, view: View, has_edit_after: Callable[[], bool] = lambda: False) -> Frame | None:
        """Do one bounded piece of work towards `view` and return what there is to show; None: nothing to do,
        and nothing new. `has_edit_after` tells whether another scene waits: then one more picture of this
        one, which has been answered, is not worth the time to read it.

        What an edit or a setting raises (InputError, DeviceError, MemoryError) comes through once for a view;
        the last good one is rendered on. RenderingStoppedError: a step failed, nothing can go on.
        """
        self._follow(view)
        try:
            side, had_answer = self._next_side(), self._main.answered
            if side is not None:
                self._step(side)
                if had_answer and has_edit_after():
                    return None
            elif self._rest_is_shown:
                return None
            has_aovs = not self._view.aovs or ((self._main.answered or side is None) and self._update_aovs())
            self._rest_is_shown = side is None and has_aovs
            return self._frame(resting=self._rest_is_shown)
        except (DeviceError, MemoryError) as error:
            raise RenderingStoppedError(_explain(error)) from error

    def pick(self, point: tuple[float, float]) -> str | None:
        """The name of the object at a point (x, y) from the top left in units of the image, or None."""
        x, y = point
        return self.session.pick_point((x, y)) if 0 <= x < 1 and 0 <= y < 1 else None

    def restart(self) -> None:
        """Throw away what was accumulated; the picture stands until it is rendered anew."""
        for side in self._sides:
            side.restart()
        self._rest_is_shown = False

    def pin_reference(self, on: bool) -> None:
        """Compare with the picture as it is now (with the next whole one of full resolution, where it is
        none), or no longer. The reference goes when the size changes."""
        self._reference, self._is_pinning = None, on
        self._rest_is_shown = False

    def export(self, path: str | Path, aovs: bool = False, exposure: float = 0.0, curve: str = "agx") -> None:
        """Write the picture of the chosen strategy at full resolution; see `write_picture`. Where it is not
        whole yet, that is done first."""
        if self._main.divisor > 1:
            self._main.return_to_full()
        while self.session.mode is Mode.BASE:
            self._main.step(self._view.step_ms)
        write_picture(Path(path), self.session, aovs, exposure, curve)

    # ------------------------------------------------------------------------------------ following the view

    @property
    def _sides(self) -> tuple[Side, ...]:
        return (self._main,) if self._restarting is None else (self._restarting, self._main)

    def _follow(self, view: View) -> None:
        if view is self._view or view is self._refused or view == self._refused:
            view = self._view
        elif view != self._view:
            self._rest_is_shown = False
        good: View | None = self._main.view
        try:
            self._split(view)
            for side in self._sides:
                if not side.shows(view) and (view.paused or side.may_change(view)):
                    self._change(side, view)
            good = self._main.full_view
            for side in self._sides:
                if side.divisor > 1 and side.answered and side.rests and not view.paused:
                    side.return_to_full()
        except (InputError, DeviceError, MemoryError) as error:
            if good is None:
                raise RenderingStoppedError(_explain(error)) from error
            self._refused = view
            self._view = replace(
                view,
                scene=good.scene,
                before=good.before,
                resolution_scale=good.resolution_scale,
                split=self._restarting is not None,
            )
            raise
        self._view = view

    def _split(self, view: View) -> None:
        if not view.split:
            self._restarting = None
        elif self._restarting is None:
            side = Side(view, self.device, RESTART.name, self._clock)
            side.spent = self._main.spent
            self._restarting = side

    def _change(self, side: Side, view: View) -> None:
        # Beside a picture that is kept, one that starts over is to be seen as it is.
        is_main = side is self._main
        side.change(view, not view.paused and (is_main or self._main.divisor > 1))
        side.session.build(self._on_build)
        height_width = view.size[::-1]
        if self._reference is not None and self._reference.shape[:2] != height_width:
            self._reference = None

    # ------------------------------------------------------------------------------------ work

    def _next_side(self) -> Side | None:
        """Whose turn it is: equal time for both, and the answer to an edit first."""
        view = self._view
        if view.paused:
            return None
        waiting = [side for side in self._sides if not side.is_done(view.target_spp)]
        if not waiting:
            return None
        behind = min(waiting, key=lambda side: side.spent)
        ahead = self._main.spent - behind.spent
        is_urgent = self._main in waiting and not self._main.answered
        side = self._main if is_urgent and ahead < MOST_AHEAD * view.step_ms / 1e3 else behind
        for other in self._sides:
            if other not in waiting:
                other.spent = max(other.spent, side.spent)
        return side

    def _step(self, side: Side) -> None:
        report = side.step(self._view.step_ms)
        if side is self._main:
            self._step_seconds = report.seconds
            speed = report.paths / report.seconds
            self._speed = speed if self._speed == 0 else 0.8 * self._speed + 0.2 * speed

    def _update_aovs(self) -> bool:
        """Some rows of the first hits of the scene that is shown; returns whether they are all there. While
        it changes there are fewer of them than pixels, so that they come at once and cost little."""
        main = self._main
        scene, (width, height) = main.view.scene, main.view.size
        rays = self._aov_pace.speed * self._view.step_ms / 1e3 * AOV_SHARE
        divisor = 1
        is_moving = not main.rests and not self._view.paused
        while is_moving and divisor < COARSEST and width * height / divisor**2 > rays:
            divisor *= 2
        width, height = -(-width // divisor), -(-height // divisor)
        wanted = (scene.camera, scene.objects, scene.materials, width, height)
        if wanted == self._aovs_of:
            return True
        if wanted != self._aovs_wanted:
            self._aovs_wanted, self._bands = wanted, []
        top = sum(len(band.depth) for band in self._bands)
        bottom = height if is_moving else min(top + max(1, int(rays / width)), height)
        start = self._clock()
        self._bands.append(self.session.aovs((width, height), (top, bottom)))
        self._aov_pace.add(width * (bottom - top), self._clock() - start)
        if bottom < height:
            return False
        self._aovs, self._aovs_of, self._bands = _joined(self._bands), wanted, []
        self._aovs_wanted = None
        return True

    def _frame(self, resting: bool) -> Frame:
        main, view = self._main, self._view
        if self._is_pinning and main.divisor == 1:
            image = main.image(must_be_new=True)
            if image[..., 3].min() > 0:
                self._reference, self._is_pinning = image[..., :3], False
        pictures = tuple(side.picture(self._reference, resting) for side in self._sides)
        if not main.shows(view):
            shown = main.view
            view = replace(
                view, scene=shown.scene, before=shown.before, resolution_scale=shown.resolution_scale
            )
        return Frame(
            view=view,
            pictures=pictures,
            is_preview=main.divisor > 1,
            step_seconds=self._step_seconds,
            paths_per_second=self._speed,
            device=self.device.name,
            aovs=self._aovs if self._view.aovs else None,
            nonfinite=sum(side.nonfinite for side in self._sides),
            resting=resting,
            is_pinned=self._reference is not None or self._is_pinning,
        )


def _joined(bands: list[Aovs]) -> Aovs:
    """First hits of rows that follow each other."""
    return Aovs(*(np.concatenate([getattr(band, f.name) for band in bands]) for f in fields(Aovs)))


def _explain(error: Exception) -> str:
    return str(error) or "memory ran out; use a smaller image or scene"
