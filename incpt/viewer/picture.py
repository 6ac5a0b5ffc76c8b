"""Pictures of a session as they are read from the device, compared, and handed on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields

import numpy as np

from incpt.picture.metrics import normalized_rmse
from incpt.render.first_hits import FirstHits
from incpt.render.session import Session
from incpt.viewer.pace import Pace
from incpt.viewer.scheduler import Side, first_hit_rows, is_reading_due
from incpt.viewer.view import Float32Image, Picture, View

ERROR_SECONDS = 0.5
"""The time between two comparisons with the reference."""


class PictureReader:
    """Keeps the last picture of a session, and reads it anew where that is worth it. `clock` gives
    seconds."""

    def __init__(self, session: Session, clock: Callable[[], float]) -> None:
        self._session, self._clock = session, clock
        self._image: Float32Image | None = None
        self._version, self._read_at = 0, -math.inf
        self._error: float | None = None
        self._compared: Float32Image | None = None
        self._compared_at = -math.inf

    def image(self, side: Side, must_be_new: bool) -> Float32Image:
        """(h, w, 4) the picture; not older than the rules of `is_reading_due` ask for."""
        if self._image is None or is_reading_due(
            side, self._version, self._clock() - self._read_at, must_be_new
        ):
            self._image = self._session.image(alpha=True, first_sight=True)
            self._version, self._read_at = side.version, self._clock()
        return self._image

    def picture(
        self,
        side: Side,
        reference: Float32Image | None,
        must_be_new: bool,
        first_sight: Float32Image | None = None,
    ) -> Picture:
        """What there is to show of a side, compared with `reference` (h, w, 3); `first_sight` is shown in
        place of what the session has."""
        image = self.image(side, must_be_new) if first_sight is None else first_sight
        self._compare(image, reference, must_be_new)
        progress = side.progress
        return Picture(
            image=image,
            grid=progress.grid,
            mode=progress.mode,
            queue=progress.queue.tiles,
            queue_done=progress.cursor.tiles,
            tile_spp=progress.tile_spp,
            replaced=side.replaced,
            seconds=side.seconds,
            error=self._error,
            strategy=progress.settings.strategy,
            error_left=progress.error_left,
            findings=progress.findings,
            transparent=progress.settings.transparent,
        )

    def _compare(self, image: Float32Image, reference: Float32Image | None, must_be_new: bool) -> None:
        if reference is None or reference.shape[:2] != image.shape[:2]:
            self._error = None
            return
        now = self._clock()
        is_due = must_be_new or now - self._compared_at >= ERROR_SECONDS
        if self._error is None or (image is not self._compared and is_due):
            self._error = normalized_rmse(image[..., :3], reference)
            self._compared, self._compared_at = image, now


class FirstHitReader:
    """Keeps the first hits of a session's scene, and traces them anew some rows at a time. `pace` is how fast
    they come."""

    def __init__(self, session: Session, pace: Pace, clock: Callable[[], float]) -> None:
        self.first_hits: FirstHits | None = None
        self.pace = pace
        self._session, self._clock = session, clock
        self._shown: tuple[object, ...] | None = None
        self._wanted: tuple[object, ...] | None = None
        self._bands: list[FirstHits] = []

    def advance(self, view: View, main: Side) -> bool:
        """Trace some rows, where any are missing; returns whether all are there."""
        (width, height), rows = first_hit_rows(view, main, self.pace.speed, self._clock())
        scene = main.view.scene
        wanted = (scene.camera, scene.objects, scene.materials, width, height)
        if wanted == self._shown:
            return True
        if wanted != self._wanted:
            self._wanted, self._bands = wanted, []
        top = sum(len(band.depth) for band in self._bands)
        bottom = min(top + rows, height)
        start = self._clock()
        self._bands.append(self._session.first_hits((width, height), (top, bottom)))
        self._learn(width * (bottom - top), self._clock() - start)
        if bottom < height:
            return False
        self.first_hits, self._shown, self._bands = _joined(self._bands), wanted, []
        self._wanted = None
        return True

    def _learn(self, rays: int, seconds: float) -> None:
        self.pace = self.pace.after(rays, seconds)


def _joined(bands: list[FirstHits]) -> FirstHits:
    """First hits of rows that follow each other."""
    return FirstHits(*(np.concatenate([getattr(band, f.name) for band in bands]) for f in fields(FirstHits)))
