"""The method's law: after any edits the converged picture is that of a fresh render."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene.model import Scene

_MOST_STEPS, _ENOUGH = 800, 64
LARGE_STEPS = 384
"""Slots of a step where only the picture at the end counts: to begin one costs as much as many paths."""


def assert_within_noise(device: Device, session: Session, scene: Scene, spp: int) -> None:
    """The picture is that of fresh renders with other random numbers, within the noise of `spp` samples."""
    pictures = []
    for seed in range(4):
        settings = replace(
            scene.settings, seed=10 + seed, base_nor=64, strategy="restart", slots_per_step=LARGE_STEPS
        )
        fresh = Session(replace(scene), size=session.size, settings=settings, device=device)
        fresh.render(spp)
        pictures.append(fresh.image())
    mean, deviation = np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)
    # Five pictures of equal noise; the deviation of four is pooled over the image.
    noise = np.sqrt((deviation**2).mean() * (1 + 1 / 4)) + 1e-5
    difference = session.image() - mean
    assert np.sqrt((difference**2).mean()) < 1.3 * noise
    assert abs(difference.mean()) < 5 * noise / np.sqrt(difference.size)


def assert_edits_converge(
    device: Device, scene: Scene, edits: Iterable[Callable[[Scene], Scene]], strategy: str
) -> None:
    """A session that goes on after each edit, with a step in between, ends within the noise of fresh renders;
    and starting over brings the samples of a fresh session, so that its tables are as from a fresh start."""
    # Repetitions make steps fewer.
    settings = replace(scene.settings, strategy=strategy, base_nor=16)
    session = Session(scene, device=device, settings=settings)
    session.render(16)
    for edit in edits:
        scene = edit(scene)
        session.edit(scene)
        session.step()
    # Not until all tiles have so many: what hardly any path finds keeps `impact` busy elsewhere.
    for _ in range(_MOST_STEPS):
        if session.spp().min() >= _ENOUGH:
            break
        session.step()
    assert_within_noise(device, session, scene, int(min(session.spp().min(), _ENOUGH)))
    session.restart()
    session.render(16)
    settings = replace(scene.settings, strategy="restart")
    fresh = Session(replace(scene), device=device, settings=settings)
    fresh.render(16)
    np.testing.assert_allclose(session.image(), fresh.image(), rtol=1e-4, atol=1e-5)
