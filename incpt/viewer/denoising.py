"""Denoised pictures for whoever looks, made in a thread of their own.

Nothing waits for them: what was rendered is shown until a denoised picture of the same scene is there, and
that one until the next. They are for the eye alone. What is summed up, measured or compared is as it was
rendered.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from incpt.core.errors import InputError, one_line
from incpt.picture import denoise
from incpt.picture.denoise import NoiseGauge
from incpt.render.film import tile_image
from incpt.render.first_hits import FirstHits
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.model import Scene
from incpt.viewer.view import Float32Image, Frame, Picture

_NICER = 10
_MORE = 1.15
"""A picture is denoised again once it has so many times the samples of the last one, since an hour's render
would else be denoised without an end."""
_REST_SHARE = 1.0
"""How long the thread rests after each picture, as a share of the time that it took: else a slow processor
would do nothing but denoise."""


@dataclass(frozen=True, eq=False)
class _Denoised:
    """A denoised picture (h, w, 4), or None where there is so little noise that none is shown; of which scene
    and which samples it is."""

    scene: Scene
    samples: float
    image: Float32Image | None


class DenoisingThread:
    """Denoises the latest picture that it was offered. `on_done` is called in the thread with the frame that
    is to be shown then, `on_problem` with one line where nothing more can be denoised."""

    def __init__(self, on_done: Callable[[Frame], None], on_problem: Callable[[str], None]) -> None:
        self._on_done, self._on_problem = on_done, on_problem
        self._condition = threading.Condition()
        self._waiting: Frame | None = None
        self._latest: Frame | None = None
        self._known: _Denoised | None = None
        self._closing = False
        self._gauge_lock = threading.Lock()
        self._gauge = NoiseGauge()
        self._measured: Scene | None = None
        self._thread: threading.Thread | None = None

    def close(self) -> None:
        """End the thread, once the picture under way is done."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def shown(self, frame: Frame) -> Frame:
        """The frame as it is to be shown now: with the denoised picture that there is of its scene, if its
        view asks for one. Where it is worth it, the frame's own picture is denoised next."""
        with self._condition:
            self._latest = frame
            if not frame.view.denoise or self._closing:
                self._waiting = None
                return frame
            if is_worth_denoising(frame, self._known_samples(frame)):
                self._waiting = frame
                self._start()
                self._condition.notify()
            return self._with_known(frame)

    def denoised(self, session: Session) -> Float32Image:
        """(H, W, 3) the picture of a session at this moment as it would be shown. Raises InputError where
        Open Image Denoise is not installed."""
        image, scene = session.image(), session.scene
        hits = None if scene.camera.has_lens else session.first_hits()
        clean = denoise.denoise(image, *_guiding(hits, image.shape))
        with self._gauge_lock:
            if self._measured is not scene:
                self._gauge.begin()
            self._gauge.look(image, session.spp())
            self._measured = scene
            variance = self._gauge.variance()
        return denoise.mixed(image, clean, variance)

    def _known_samples(self, frame: Frame) -> float | None:
        known = self._known
        return known.samples if known is not None and _is_of(known, frame) else None

    def _with_known(self, frame: Frame) -> Frame:
        known, picture = self._known, frame.pictures[-1]
        if known is None or known.image is None or not _is_of(known, frame):
            return frame
        alpha = picture.image[..., 3:]
        image = np.concatenate([known.image[..., :3], alpha], axis=-1) if alpha.min() < 1 else known.image
        return replace(frame, pictures=(*frame.pictures[:-1], replace(picture, denoised=image)))

    def _start(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="denoiser", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        _give_way()
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._closing or self._waiting is not None)
                frame, self._waiting = self._waiting, None
                if self._closing or frame is None:
                    return
            start = time.perf_counter()
            try:
                image = self._denoise(frame)
            except (InputError, RuntimeError, MemoryError) as error:
                self._closing = True
                self._on_problem(f"denoising has stopped: {one_line(error)}")
                return
            self._take(frame, image)
            with self._condition:
                rest = _REST_SHARE * (time.perf_counter() - start)
                self._condition.wait_for(lambda: self._closing, rest)

    def _take(self, frame: Frame, image: Float32Image | None) -> None:
        with self._condition:
            before, latest = self._known, self._latest
            self._known = known = _Denoised(frame.view.scene, _samples(frame.pictures[-1]), image)
            is_new = image is not None or (before is not None and before.image is not None)
            if latest is None or not latest.view.denoise or not _is_of(known, latest) or not is_new:
                return
            shown = self._with_known(latest)
        self._on_done(shown)

    def _denoise(self, frame: Frame) -> Float32Image | None:
        picture = frame.pictures[-1]
        image = np.ascontiguousarray(picture.image[..., :3])
        variance = self._variance(frame, image)
        if not np.nan_to_num(variance, nan=0.0, posinf=1.0).any():
            return None
        clean = denoise.denoise(image, *_guiding(frame.first_hits, image.shape))
        mixed = denoise.mixed(image, clean, variance)
        if np.array_equal(mixed, image):
            return None
        return np.concatenate([mixed, picture.image[..., 3:]], axis=-1)

    def _variance(self, frame: Frame, image: Float32Image) -> npt.NDArray[np.float64]:
        """(rows, columns) of the cells of a picture."""
        picture, scene = frame.pictures[-1], frame.view.scene
        with self._gauge_lock:
            is_found = picture.mode is Mode.INCREMENTAL and picture.findings is not None
            if self._measured is not scene:
                self._gauge.begin()
            if not is_found or not self._gauge.knows(image.shape):
                self._gauge.look(image, tile_image(picture.grid, picture.tile_spp))
                self._measured = scene
            variance = self._gauge.variance()
        if is_found and picture.findings is not None:
            # What is found of a change gains by more than the number of its samples.
            left = picture.findings.error[picture.grid.tile_of_pixels()] ** 2
            return np.nan_to_num(variance, nan=0.0) + denoise.cell_means(left)
        return variance


def is_worth_denoising(frame: Frame, samples: float | None) -> bool:
    """Whether to denoise the picture of a frame, where one of the same scene with that many samples per pixel
    was denoised before (None: none was). In a drag each picture is of another scene, so that the thread would
    always be late."""
    picture, hits = frame.pictures[-1], frame.first_hits
    if not frame.view.denoise or frame.view.before is not None or frame.is_preview:
        return False
    height, width = picture.image.shape[:2]
    has_guides = hits is not None and hits.depth.shape == (height, width)
    if not has_guides and not frame.view.scene.camera.has_lens:
        return False
    if picture.tile_spp.min() == 0 and picture.mode is Mode.BASE:
        return False
    return samples is None or _samples(picture) > samples * (1.0 if frame.resting else _MORE)


def _is_of(known: _Denoised, frame: Frame) -> bool:
    image = frame.pictures[-1].image
    same_size = known.image is None or known.image.shape == image.shape
    return known.scene is frame.view.scene and not frame.is_preview and same_size


def _samples(picture: Picture) -> float:
    return float(picture.tile_spp.mean())


def _guiding(hits: FirstHits | None, shape: tuple[int, ...]) -> tuple[Float32Image, ...]:
    """Base colours and normals, where they fit a picture. Behind a lens they would show edges that the
    picture has not, so that there are none."""
    return () if hits is None or hits.albedo.shape != shape else (hits.albedo, hits.normal)


def _give_way() -> None:
    """Let window and renderer go first."""
    if sys.platform == "linux":
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + _NICER)
