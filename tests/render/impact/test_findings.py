"""How far a change has been found, by the law of the variance that is left of it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.render.impact.findings import findings
from incpt.render.impact.tile_sums import TileSums
from incpt.render.modes import Mode
from incpt.render.session import Session

PIXELS = 64.0


def sums(samples: list[float], **changes: Any) -> TileSums:
    """Of tiles with so many samples a pixel, where all paths but those of the last tile met the change."""
    drawn = PIXELS * np.array(samples)
    is_touched = np.arange(len(samples)) < len(samples) - 1
    values: dict[str, Any] = dict.fromkeys((f.name for f in fields(TileSums)), np.zeros(len(samples)))
    values |= {"pixels": np.full(len(samples), PIXELS), "samples": drawn, "pairs": drawn}
    values |= {"touched": drawn * is_touched, "kept": np.full(len(samples), 16 * PIXELS)}
    return TileSums(**{**values, **changes})


def left(samples: list[float], variances: list[float]) -> float:
    return findings(sums(samples), np.array(variances)).error_left


def test_the_error_falls_with_the_root_of_the_samples_down_to_what_it_was() -> None:
    assert left([1, 1], [3.0, 9.0]) == pytest.approx(np.sqrt(1 - 1 / 16))
    assert left([4, 1], [3.0, 9.0]) == pytest.approx(np.sqrt(1 / 4 - 1 / 16))
    assert left([16, 1], [3.0, 9.0]) == 0 and left([40, 1], [3.0, 9.0]) == 0


def test_tiles_without_a_change_and_without_noise_do_not_count() -> None:
    assert left([4, 4, 1], [2.0, 0.0, 5.0]) == left([4, 1], [2.0, 1.0])
    assert left([4, 0.1], [0.0, 5.0]) == 0


def test_the_noisier_of_two_tiles_counts_for_more() -> None:
    noisy_done, noisy_not = left([16, 1, 1], [9.0, 1.0, 0.0]), left([1, 16, 1], [9.0, 1.0, 0.0])
    assert noisy_not / noisy_done == pytest.approx(3)


def test_less_than_a_sample_a_pixel_is_no_more_than_all_of_the_error() -> None:
    assert left([0.06, 1], [3.0, 9.0]) == left([1, 1], [3.0, 9.0]) < 1


def test_what_tiles_tell_is_told_as_shares() -> None:
    drawn = np.array([4.0, 2.0, 1.0]) * PIXELS
    found = findings(
        sums(
            [4, 2, 1],
            touched=drawn * (0.5, 0.25, 0.0),
            pairs=drawn * (1.0, 0.875, 1.0),
            squares_old=np.array([8.0, 8.0, 8.0]),
            products=np.array([6.0, 16.0, 8.0]),
        ),
        np.array([0.04, 0.01, 1.0]),
    )
    np.testing.assert_allclose(found.touched, (0.5, 0.25, 0))
    np.testing.assert_allclose(found.singles, (0, 0.5, 0))
    np.testing.assert_allclose(found.weight, (0.75, 1, 0))
    np.testing.assert_allclose(found.error, np.sqrt([0.04 * (1 / 4 - 1 / 16), 0.01 * (1 / 2 - 1 / 16), 0]))
    with pytest.raises(ValueError, match="read-only"):
        found.error[0] = 1


@pytest.mark.slow
def test_a_session_tells_how_much_of_an_edit_is_left(device: Device) -> None:
    session = Session(mixed_scene(strategy="impact", base_nor=16), size=(40, 28), device=device)
    assert session.error_left() is None, "the first picture is no edit"
    session.render(32)
    scene = session.scene
    assert session.error_left() == 0 and session.progress.findings is None
    session.edit(scene.with_object("red cube", position=(0.9, 0.5, 0.9)))
    assert session.error_left() == 1
    told = []
    while session.error_left():
        session.step()
        told.append(session.error_left())
        assert len(told) < 2000
    falling = [now for now, before in zip(told[1:], told, strict=False) if now != before]
    assert 0.5 < falling[0] <= 1 and len(falling) > 5
    assert np.mean(np.diff(falling) < 0) > 0.8
    found = session.progress.findings
    assert found is not None and found.touched.max() > 0.5 and not found.error.any()
    session.edit(scene)
    assert session.error_left() == 0 and session.mode is Mode.REFINE
    session.edit(scene.with_camera(fov_y=50))
    assert session.error_left() is None


@pytest.mark.slow
def test_other_strategies_measure_nothing(device: Device) -> None:
    session = Session(mixed_scene(strategy="spiral"), size=(40, 28), device=device)
    session.render(1)
    session.edit(session.scene.with_object("red cube", position=(0.9, 0.5, 0.9)))
    assert session.error_left() is None and session.progress.findings is None
