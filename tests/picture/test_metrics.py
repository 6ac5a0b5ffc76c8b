"""Error measures, worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.picture.metrics import RELATIVE_EPSILON, normalized_rmse, relative_mse
from incpt.picture.tone_mapping import tone_map


def test_equal_pictures_have_no_error() -> None:
    image = np.random.default_rng(1).random((5, 7, 3), np.float32)
    assert normalized_rmse(image, image) == 0
    assert relative_mse(image, image) == 0


def test_normalized_rmse_is_that_of_the_display() -> None:
    dark, bright = np.zeros((2, 2, 3)), np.full((2, 2, 3), 1e6)
    assert normalized_rmse(dark, bright) == pytest.approx(1.0)
    half = dark.copy()
    half[0] = 1e6  # every second pixel is wrong by the whole range
    assert normalized_rmse(half, dark) == pytest.approx(np.sqrt(0.5))
    grey, other = np.full((1, 1, 3), 0.18), np.full((1, 1, 3), 0.36)
    steps = float(tone_map(other)[0, 0, 0]) - float(tone_map(grey)[0, 0, 0])
    assert normalized_rmse(other, grey) == pytest.approx(steps / 255, rel=0.02)


def test_relative_mse_worked_by_hand() -> None:
    reference = np.array([[[1.0, 2.0, 0.0]]], np.float32)
    image = np.array([[[2.0, 2.0, 0.1]]], np.float32)
    expected = (1 / (1 + RELATIVE_EPSILON) + 0 + 0.01 / RELATIVE_EPSILON) / 3
    assert relative_mse(image, reference) == pytest.approx(expected, rel=1e-6)
