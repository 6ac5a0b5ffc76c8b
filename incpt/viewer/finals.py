"""Final renders beside a viewer: pictures into files, of scenes as they were when they were asked for.

They share the device with the viewer, a bounded piece of work at a time, and what they have in common with
its scene is on the device once.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from incpt.core.errors import DeviceError, InputError, OutputError
from incpt.device.device import Device
from incpt.render.final import FinalRender
from incpt.render.session import Session
from incpt.viewer.pace import Pace
from incpt.viewer.renderer import Exported, FinalProgress, Finals, Message, Problem, RenderFinal

_TELLING_SECONDS = 0.25
"""The time between two words about how far it is, since a window redraws for each."""
_FORETOLD_FROM = 2.0
"""The seconds after which it is told how long a final render will take."""
_REFUSALS = (InputError, DeviceError, OutputError, MemoryError)


class FinalQueue:
    """Final renders on `device`, one after the other. `post` is called with what there is to tell, `on_build`
    with (done, total) while kernels are built; `explain` puts an error into a line."""

    def __init__(
        self,
        device: Device,
        post: Callable[[Message], None],
        on_build: Callable[[int, int], None],
        explain: Callable[[Exception], str],
    ) -> None:
        self._device, self._post, self._on_build, self._explain = device, post, on_build, explain
        self._waiting: deque[RenderFinal] = deque()
        self._current: FinalRender | None = None
        self._pace = Pace(5e5 if device.is_cpu else 5e7)
        self._told_at = self._began_at = 0.0

    @property
    def is_idle(self) -> bool:
        """Whether there is nothing to render."""
        return self._current is None and not self._waiting

    def add(self, request: RenderFinal) -> None:
        """Render this after all that was asked for before."""
        self._waiting.append(request)
        self._tell()

    def end(self, is_kept: bool) -> None:
        """End the one under way: written as it is, or given up."""
        current, self._current = self._current, None
        if current is None and self._waiting:
            self._waiting.popleft()
        elif current is not None and is_kept:
            self._write(current)
        self._tell()

    def advance(self, seconds: float) -> None:
        """Render for about that long."""
        try:
            if self._current is None:
                self._current = self._opened(self._waiting.popleft())
                self._began_at = time.perf_counter()
                self._tell()
                return
            self._step(self._current, seconds)
        except _REFUSALS as error:
            self._current = None
            self._post(Problem(self._explain(error)))
            self._tell()

    def _opened(self, request: RenderFinal) -> FinalRender:
        # Steps choose their slots themselves, as those of the viewer.
        settings = replace(request.wanted.of_session(request.scene.settings), slots_per_step=1)
        session = Session(request.scene, settings=settings, device=self._device)
        session.build(self._on_build, for_edits=False)
        return FinalRender(session, request.wanted)

    def _step(self, current: FinalRender, seconds: float) -> None:
        paths_of_slot = current.session.settings.tile_size**2
        report = current.step(max(1, int(self._pace.speed * seconds / paths_of_slot)))
        self._pace = self._pace.after(report.paths, report.seconds)
        if current.is_done:
            self._current = None
            self._write(current)
            self._tell()
        elif time.perf_counter() - self._told_at >= _TELLING_SECONDS:
            self._tell()

    def _write(self, current: FinalRender) -> None:
        try:
            current.write()
        except _REFUSALS as error:
            self._post(Problem(self._explain(error)))
        else:
            self._post(Exported(current.wanted.path, current.session.size))

    def _tell(self) -> None:
        current, self._told_at, waiting = self._current, time.perf_counter(), len(self._waiting)
        if current is not None:
            path, share = current.wanted.path, current.share
            progress = FinalProgress(
                path, share, current.spp, current.seconds, self._seconds_left(share), waiting
            )
            self._post(Finals(progress))
        elif self._waiting:
            self._post(Finals(FinalProgress(self._waiting[0].wanted.path, waiting=waiting - 1)))
        else:
            self._post(Finals(None))

    def _seconds_left(self, share: float) -> float | None:
        past = time.perf_counter() - self._began_at
        return past * (1 - share) / share if share > 0 and past >= _FORETOLD_FROM else None
