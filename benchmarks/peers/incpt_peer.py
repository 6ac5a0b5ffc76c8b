"""incpt itself, as one of the compared renderers."""

from __future__ import annotations

import time
from dataclasses import replace

from incpt.benchmarks.peers.peer import FloatImage, Job
from incpt.core.affine import Vector
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session

_MOST_SAMPLES_PER_STEP = 16
_DRAG_NOR = 16
"""Repetitions of a tile in a drag, as the editor has it by default."""
_FIRST_TILES = 4


class IncptPeer:
    """Renders as `Session` does. Like the others it is told how many samples are wanted: a step takes as
    many of a pixel as divide that number, 16 at most."""

    def __init__(self) -> None:
        self._device = Device()
        self._session: Session | None = None

    def load(self, job: Job) -> None:
        settings = RenderSettings(
            size=job.size, max_bounces=job.max_bounces, transmission_bounces=job.transmission_bounces,
            strategy="restart", multiple_scattering=False,
        )  # fmt: skip
        self._session = Session(job.scene, settings=settings, device=self._device)

    def time(self, spp: int, seed: int) -> float:
        session = self._prepared(spp, seed)
        began = time.perf_counter()
        session.render(spp)
        session.image()
        return time.perf_counter() - began

    def image(self, spp: int, seed: int) -> FloatImage:
        session = self._prepared(spp, seed)
        session.render(spp)
        return session.image()

    def move(self, name: str, position: Vector, seed: int) -> float:
        session = self._prepared(1, seed)
        session.step()
        scene = session.scene.with_object(name, position=position)
        began = time.perf_counter()
        session.edit(scene)
        session.step()
        session.image()
        return time.perf_counter() - began

    def first_tiles(self, name: str, position: Vector, seed: int) -> float:
        """Put an object elsewhere, as a step of a drag; seconds until the kept picture shows the tiles
        nearest to it as they are now, with as many samples as they get in a drag."""
        session = self._prepared(_DRAG_NOR, seed)
        spiral = {"strategy": "spiral", "nor": _DRAG_NOR, "nor_adapts": False}
        session.configure(replace(session.settings, sample_rate=1, **spiral))  # type: ignore[arg-type]
        session.render(_DRAG_NOR)
        scene = session.scene.with_object(name, position=position)
        began = time.perf_counter()
        session.edit(scene)
        finished = 0
        while finished == 0:
            finished = len(session.step(_FIRST_TILES * _DRAG_NOR).tiles)
        session.image()
        seconds = time.perf_counter() - began
        session.configure(replace(session.settings, strategy="restart"))
        return seconds

    def _prepared(self, spp: int, seed: int) -> Session:
        assert self._session is not None
        rate = max(r for r in range(1, _MOST_SAMPLES_PER_STEP + 1) if spp % r == 0)
        # Another seed starts the picture over; the same one would go on with it.
        settings = replace(self._session.settings, seed=seed, sample_rate=rate)
        other = replace(settings, seed=(seed + 1) % (1 << 32))
        self._session.configure(other)
        self._session.configure(settings)
        return self._session
