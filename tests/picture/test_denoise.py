"""How much of a denoised picture is shown, and how noise is measured."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.core.errors import InputError
from incpt.picture import denoise
from incpt.picture.denoise import CELL, MIDDLE_GREY, NoiseGauge, as_shown, cell_means, mixed

SIZE = (70, 90)


def radiance(shown: np.ndarray) -> np.ndarray:
    """Of display values below 1."""
    return np.asarray(MIDDLE_GREY * shown / (1 - shown), np.float32)


def truth() -> np.ndarray:
    """(H, W, 3) display values that vary slowly."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / 90
    return np.stack([0.3 + 0.2 * x, 0.4 + 0.1 * y, 0.35 + 0.1 * x * y], axis=-1)


def noisy(spp: int, seed: int = 0) -> np.ndarray:
    """Display values with a standard deviation of 0.2 / sqrt(spp), the samples those of `noisy` of fewer."""
    random = np.random.default_rng(seed)
    samples = sum(random.normal(0, 0.2, (*SIZE, 3)) for _ in range(spp))
    return np.clip(truth() + np.asarray(samples) / spp, 0, 0.95)


def counts(spp: int) -> np.ndarray:
    return np.full(SIZE, spp)


def error(image: np.ndarray) -> float:
    return float(np.mean((as_shown(image) - truth()) ** 2))


def test_cells_are_cut_by_the_edges_of_the_picture() -> None:
    values = np.arange(SIZE[0] * SIZE[1], dtype=float).reshape(SIZE)
    cells = cell_means(values)
    assert cells.shape == (5, 6)
    assert cells[0, 0] == values[:CELL, :CELL].mean()
    assert cells[4, 5] == pytest.approx(values[4 * CELL :, 5 * CELL :].mean())


def test_the_gauge_finds_the_variance() -> None:
    gauge = NoiseGauge()
    gauge.look(radiance(noisy(16)), counts(16))
    assert np.isnan(gauge.variance()).all()
    gauge.look(radiance(noisy(48)), counts(48))
    # A cell has some hundred pixels, those at the edge fewer.
    np.testing.assert_allclose(gauge.variance()[:4, :5], 0.04 / 48, rtol=0.35)
    assert gauge.variance().mean() == pytest.approx(0.04 / 48, rel=0.05)
    # The same picture once more changes nothing, nor do tiles that start over.
    before = gauge.variance()
    gauge.look(radiance(noisy(48)), counts(48))
    np.testing.assert_array_equal(gauge.variance(), before)
    fewer = counts(48)
    fewer[:CELL, :CELL] = 12
    gauge.look(radiance(noisy(12)), fewer)
    assert gauge.variance()[0, 0] == pytest.approx(4 * before[0, 0])


def test_few_samples_are_all_noise() -> None:
    gauge = NoiseGauge()
    gauge.look(radiance(noisy(2)), counts(2))
    assert np.isinf(gauge.variance()).all()


def test_another_scene_is_no_noise() -> None:
    gauge = NoiseGauge()
    gauge.look(radiance(noisy(16)), counts(16))
    gauge.look(radiance(noisy(32)), counts(32))
    known = gauge.variance()
    gauge.begin()
    gauge.look(radiance(1 - noisy(32)), counts(64))
    np.testing.assert_allclose(gauge.variance(), known / 2)
    assert gauge.knows((*SIZE, 3)) and not gauge.knows((200, 200))
    gauge.look(radiance(np.full((8, 8, 3), 0.5)), np.full((8, 8), 9))
    assert gauge.variance().shape == (1, 1) and np.isnan(gauge.variance()).all()


@pytest.mark.parametrize("bias", [0.002, 0.02, 0.1])
@pytest.mark.parametrize("spp", [8, 64, 512])
def test_a_mixture_is_no_worse_than_either(bias: float, spp: int) -> None:
    image, clean = radiance(noisy(spp)), radiance(truth() + bias)
    shown = mixed(image, clean, np.full((5, 6), 0.04 / spp))
    assert error(shown) <= min(error(image), error(clean)) + 0.01 * error(image)


def test_what_has_converged_is_not_touched() -> None:
    image, clean = radiance(noisy(64)), radiance(truth() + 0.05)
    variance = np.full((5, 6), 1e-7)
    np.testing.assert_array_equal(mixed(image, clean, variance), image)
    variance[2, 3] = np.inf
    shown = mixed(image, clean, variance)
    inside = shown[2 * CELL + 7 : 2 * CELL + 9, 3 * CELL + 7 : 3 * CELL + 9]
    np.testing.assert_allclose(inside, clean[39:41, 55:57], rtol=0.1)
    np.testing.assert_array_equal(shown[:CELL], image[:CELL])


def test_where_nothing_is_known_nothing_is_taken() -> None:
    image, clean = radiance(noisy(64)), radiance(truth())
    np.testing.assert_array_equal(mixed(image, clean, np.full((5, 6), np.nan)), image)


def test_cells_that_gain_nothing_are_as_noisy_as_the_others() -> None:
    gauge, few = NoiseGauge(), counts(32)
    few[:CELL] = 16
    gauge.look(radiance(noisy(16)), counts(16))
    gauge.look(radiance(noisy(32)), few)
    np.testing.assert_allclose(gauge.variance()[0], 0.04 / 16, rtol=0.1)


def test_bright_pixels_go_down_as_they_are_seen() -> None:
    """A share of a firefly is not shown as a firefly."""
    image, clean = radiance(truth()), radiance(truth())
    image[20, 20] = 1e4
    shown = mixed(image, clean, np.full((5, 6), 1.0))
    assert shown[20, 20].max() < 1


def test_without_the_library_a_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denoise, "is_available", lambda: False)
    with pytest.raises(InputError, match=r'^denoise: .*pip install "incpt\[denoise\]"$'):
        denoise.denoise(np.zeros((4, 4, 3)))


def test_the_library_takes_noise_away() -> None:
    pytest.importorskip("pyoidn")
    image = radiance(noisy(4))
    image[3, 3] = (np.nan, np.inf, -1)
    guide, normal = np.full((*SIZE, 3), 0.5), np.full((*SIZE, 3), 0.577)
    for clean in (denoise.denoise(image), denoise.denoise(image, guide, normal)):
        assert clean.shape == image.shape and np.isfinite(clean).all()
        assert error(clean) < 0.2 * error(radiance(noisy(4)))


@pytest.mark.parametrize(
    "arguments", [(np.zeros((4, 4)),), (np.zeros((4, 4, 3)), np.zeros((4, 5, 3))), (np.zeros((0, 4, 3)),)]
)
def test_other_shapes_are_refused(arguments: tuple[np.ndarray, ...]) -> None:
    with pytest.raises(InputError, match="shape"):
        denoise.denoise(*arguments)
