"""Converged pictures, computed once and kept by their content, and how far other pictures are from them."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.benchmarks.kit.content import digest, kernel_digest
from incpt.benchmarks.kit.store import make_folder
from incpt.core import files
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.picture.metrics import normalized_rmse, relative_mse
from incpt.picture.tone_mapping import tone_map
from incpt.render.session import Session
from incpt.scene.model import Scene

FloatImage = npt.NDArray[np.float32]

# What decides what a pixel converges to; tiles and strategies do not.
_PICTURE_SETTINGS = ("size", "max_bounces", "transmission_bounces", "roulette_depth", "seed")
_MOST_SAMPLES_PER_STEP = 16


class Gallery:
    """Converged pictures in `folder`, by the digest of scene, settings, samples and kernels.

    `note` of `converged` is called while one is rendered, with the fraction that is done; what it raises ends
    the rendering.
    """

    def __init__(self, folder: Path, device: Device) -> None:
        self.folder, self.device = folder, device

    def path(self, scene: Scene, settings: RenderSettings, spp: int) -> Path:
        """Where the picture is kept."""
        chosen = [getattr(settings, name) for name in _PICTURE_SETTINGS]
        return self.folder / f"{digest(scene, chosen, spp, kernel_digest())}.npz"

    def converged(
        self, scene: Scene, settings: RenderSettings, spp: int, note: Callable[[float], None]
    ) -> FloatImage:
        """(H, W, 3) mean radiance of `spp` samples per pixel, from the folder or rendered now."""
        path = self.path(scene, settings, spp)
        stored = _read(path)
        if stored is not None:
            note(1.0)
            return stored
        image = self._render(scene, settings, spp, note)
        make_folder(self.folder)
        content = io.BytesIO()
        np.savez_compressed(content, image=image, spp=spp)
        files.write_bytes(path, content.getvalue())
        return image

    def _render(
        self, scene: Scene, settings: RenderSettings, spp: int, note: Callable[[float], None]
    ) -> FloatImage:
        # Several samples a step cost less host time; a power of two divides the usual counts.
        rate = max(r for r in (1, 2, 4, 8, _MOST_SAMPLES_PER_STEP) if spp % r == 0)
        plain = replace(settings, sample_rate=rate, strategy="restart", slots_per_step=None, base_nor=1)
        session = Session(scene, settings=plain, device=self.device)
        session.render(spp, lambda report: note(float(session.spp().mean()) / spp))
        return session.image()


def _read(path: Path) -> FloatImage | None:
    try:
        with np.load(path) as stored:
            return np.asarray(stored["image"], np.float32)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def flip(image: npt.ArrayLike, reference: npt.ArrayLike) -> float | None:
    """Mean FLIP error (Andersson et al. 2020) of what is displayed: tone-mapped sRGB at 67 pixels a degree.
    None where flip-evaluator is not installed."""
    try:
        import flip_evaluator
    except ImportError:
        return None
    shown, expected = (tone_map(np.asarray(i)).astype(np.float32) / 255 for i in (image, reference))
    _, mean, _ = flip_evaluator.evaluate(expected, shown, "LDR", applyMagma=False)
    return float(mean)


def errors(image: FloatImage, reference: FloatImage, with_flip: bool = True) -> dict[str, Any]:
    """Columns of a result: normalized RMSE as in the thesis, relMSE of linear radiance, FLIP (else None)."""
    return {
        "normalized_rmse": normalized_rmse(image, reference),
        "relative_mse": relative_mse(image, reference),
        "flip": flip(image, reference) if with_flip else None,
    }


def mean_radiance(image: npt.ArrayLike) -> Sequence[float]:
    """By channel, over the whole picture."""
    means: list[float] = np.asarray(image, np.float64).mean(axis=(0, 1)).tolist()
    return means
