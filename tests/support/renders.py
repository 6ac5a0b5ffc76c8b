"""Small renders for the tests of physics, and comparisons that know their noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session, StepReport
from incpt.render.wavefront import Wavefront
from incpt.scene.model import Scene
from support.kernels import device

Array = npt.NDArray[np.floating]


def render(
    scene: Scene, spp: int, size: tuple[int, int] = (32, 32), on: Device | None = None, **settings: Any
) -> npt.NDArray[np.float64]:
    """(H, W, 3) with exactly `spp` samples (a power of two) a pixel, none of them undefined."""
    rate = min(spp, 1 << max(0, (65536 // (size[0] * size[1])).bit_length() - 1))
    session = Session(scene, size, RenderSettings(sample_rate=rate, **settings), on or device())

    def check(report: StepReport) -> None:
        assert report.nonfinite == 0

    session.render(spp, check)
    assert (session.spp() == spp).all()
    return session.image().astype(np.float64)


def pixels(scene: Scene, spp: int = 8, in_blocks: bool = True, **settings: Any) -> npt.NDArray[np.float32]:
    """(H, W, 3) with `spp` samples a pixel at least, by blocks where the device traces in them, or by a
    wavefront; of the scene's own settings, with `settings` in their place."""
    session = Session(scene, device=device(), settings=replace(scene.settings, **settings))
    if not in_blocks:
        session._tracer = Wavefront(session.device)
    session.render(spp)
    return session.image()


def repeat(scene: Scene, spp: int, count: int = 8, **arguments: Any) -> npt.NDArray[np.float64]:
    """(count, H, W, 3) independent renders."""
    return np.stack([render(scene, spp, seed=seed, **arguments) for seed in range(100, 100 + count)])


def blocks(images: Array, edge: int) -> npt.NDArray[np.float64]:
    """(..., H / edge, W / edge, 3) means over squares of pixels."""
    *outer, height, width, channels = images.shape
    shaped = images.reshape(*outer, height // edge, edge, width // edge, edge, channels)
    return np.asarray(shaped.mean(axis=(-4, -2)))


def assert_same_mean(a: Array, b: Array, edge: int = 8, relative: float = 0.01) -> None:
    """Two sets of independent renders (N, H, W, 3), at least 8 of each, have one expectation: in no block of
    pixels does the difference stand out of the noise, and the whole images' means lie within `relative`.

    With 14 degrees of freedom Student's t leaves 6.5 once in 70,000 blocks.
    """
    mean_a, mean_b = blocks(a, edge), blocks(b, edge)
    error2 = mean_a.var(axis=0, ddof=1) / len(a) + mean_b.var(axis=0, ddof=1) / len(b)
    difference = mean_a.mean(axis=0) - mean_b.mean(axis=0)
    floor = 1e-4 * max(a.mean(), b.mean())
    z = difference / np.sqrt(error2 + floor**2)
    assert np.abs(z).max() < 6.5, np.abs(z).max()
    assert np.sqrt((z**2).mean()) < 1.6
    np.testing.assert_allclose(a.mean(axis=(0, 1, 2)), b.mean(axis=(0, 1, 2)), rtol=relative)
