"""Samples go where the variance falls fastest per path, partners where they pay."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from incpt.render.impact.allocation import LEAST_SHARE, LEAST_SHOWN, TileVariances, allocate, variances, worth
from incpt.render.impact.tile_sums import TileSums

PIXELS = 64.0


def measured(
    v: float, rho: float, spp: float, kept: float = 100.0, touched: float = 0.5, shown: float = 1.0
) -> dict[str, float]:
    """The sums of one tile whose paths have the variance v in both scenes and correlation rho; of the noise
    of the change the share `shown` shows."""
    freedom = PIXELS * max(spp - 1, 0)
    return {
        "pixels": PIXELS,
        "samples": PIXELS * spp,
        "pairs": PIXELS * spp,
        "touched": PIXELS * spp * touched,
        "kept": PIXELS * kept,
        "freedom_new": freedom,
        "freedom_pairs": freedom,
        "squares_new": v * freedom,
        "squares_old": v * freedom,
        "products": rho * v * freedom,
        "squares_kept": v * PIXELS * spp,
        "differences": 2 * v * (1 - rho) * PIXELS * spp,
        "error": 0.0,
        "noise": v * (1 - rho**2) * PIXELS,
        "shown_noise": v * (1 - rho**2) * PIXELS * shown,
    }


def sums_of(*tiles: dict[str, float]) -> TileSums:
    return TileSums(**{f.name: np.array([tile[f.name] for tile in tiles]) for f in fields(TileSums)})


def apart(*tiles: dict[str, float]) -> TileVariances:
    """What is believed of tiles that do not stand beside each other."""
    each = [variances(sums_of(tile), 1) for tile in tiles]
    return TileVariances(
        **{f.name: np.concatenate([getattr(one, f.name) for one in each]) for f in fields(TileVariances)}
    )


def test_tiles_that_get_samples_end_level_and_the_budget_is_spent() -> None:
    tiles = apart(*(measured(v, rho, 4) for v, rho in [(1.0, 0.9), (4.0, 0.9), (1.0, 0.99), (0.1, 0.2)]))
    found = allocate(tiles, np.full(4, PIXELS), 1e6, np.random.default_rng(1))
    spent = float((found.samples * tiles.cost * PIXELS).sum())
    assert spent == pytest.approx(1e6, rel=0.01)
    gains = tiles.gain(tiles.samples + found.samples)
    np.testing.assert_allclose(gains, gains.mean(), rtol=0.02)


def test_tiles_end_level_whatever_their_variances() -> None:
    random = np.random.default_rng(1)
    count = 4000
    uncorrelated, correlated = 10 ** random.uniform(-6, 2, (2, count))
    correlated[: count // 5] = 0
    tiles = TileVariances(
        uncorrelated,
        correlated,
        singles=np.zeros(count, np.bool_),
        cost=random.uniform(1, 2, count),
        samples=np.ones(count),
        kept=10 ** random.uniform(0, 4, count),
    )
    pixels = np.full(count, PIXELS)
    budget = 1e5 * float(pixels.sum())
    granted = allocate(tiles, pixels, budget, random).samples.astype(float)
    many = granted > 1000  # so that it does not matter how they are rounded
    assert many.sum() > 1000
    gains = tiles.gain(tiles.samples + granted)[many]
    assert np.sqrt(gains / np.median(gains)) == pytest.approx(1, abs=0.01)
    assert (granted * tiles.cost * pixels).sum() == pytest.approx(budget, rel=0.01)


def test_what_is_correlated_is_refined_only_beside_what_the_old_picture_knows() -> None:
    # The same noise: one tile starts over, in the other the old picture has a thousand samples.
    tiles = apart(measured(1.0, 0.0, 4), measured(1.0, 0.999, 4, kept=1000.0))
    few = allocate(tiles, np.full(2, PIXELS), 100 * PIXELS, np.random.default_rng(1)).samples
    assert few[0] > 20 * few[1]
    many = allocate(tiles, np.full(2, PIXELS), 1e5 * PIXELS, np.random.default_rng(1)).samples
    assert many[1] > 0.3 * many[0]


def test_one_pair_in_each_pixel_tells_what_is_worth_refining() -> None:
    once, often, changed = apart(
        measured(1.0, 1.0, 1), measured(1.0, 1.0, 9), measured(1.0, 0.0, 1)
    ).correlated
    assert once == pytest.approx(often, rel=0.5) and changed < 0.1 * once


def test_partners_only_where_they_pay() -> None:
    # At rho = 0.3 a pair is worth 1.1 samples, and here costs two.
    pays = variances(sums_of(measured(1.0, 0.9, 4)), 1)
    too_dear = variances(sums_of(measured(1.0, 0.3, 4, touched=1.0)), 1)
    too_early = variances(sums_of(measured(1.0, 0.3, 1.5, touched=1.0)), 1)
    assert [bool(t.singles[0]) for t in (pays, too_dear, too_early)] == [False, True, False]
    assert too_dear.cost[0] == 1 and too_dear.correlated[0] == 0
    assert pays.cost[0] == pytest.approx(1.5)


def test_noise_that_is_not_shown_is_not_sampled_away() -> None:
    tiles = apart(*(measured(1.0, 0.5, 4, shown=shown) for shown in (1.0, 0.6, 0.1, 0.0)))
    whole = tiles.uncorrelated[0]
    np.testing.assert_allclose(tiles.uncorrelated / whole, [1, 1, 0.2, LEAST_SHOWN], rtol=1e-2)
    # What nobody knows of counts in full.
    unknown = measured(1.0, 0.5, 4) | {"noise": 0.0, "shown_noise": 0.0}
    assert apart(unknown).uncorrelated == pytest.approx(whole)


def test_one_sample_in_each_pixel_tells_by_the_differences_of_pairs() -> None:
    tiles = apart(measured(1.0, 0.5, 1), measured(1.0, 1.0, 1))
    assert tiles.uncorrelated[0] > 100 * tiles.uncorrelated[1]


def test_a_tile_without_samples_takes_after_those_around_it() -> None:
    none = measured(1.0, 0.5, 0)
    beside = variances(sums_of(measured(1.0, 0.5, 4), none, measured(1.0, 0.5, 4)), 3)
    alone = variances(sums_of(none, none, none), 3)
    assert beside.uncorrelated[1] > 0.3 * beside.uncorrelated[0]
    assert np.isfinite(alone.uncorrelated).all() and (alone.uncorrelated > 0).all()


def test_no_tile_starves() -> None:
    black = measured(0.0, 1.0, 4, touched=0.0)
    tiles = variances(sums_of(measured(1.0, 0.5, 4), *[black] * 20), 21)
    assert tiles.uncorrelated.min() >= 0.9 * LEAST_SHARE * tiles.uncorrelated.mean()
    found = allocate(tiles, np.full(21, PIXELS), 1e6 * PIXELS, np.random.default_rng(3))
    assert (found.samples > 0).all()


def test_worth_is_the_law_of_variance() -> None:
    sums = sums_of(
        measured(2.0, 0.8, 10), measured(2.0, 1.0, 10), measured(2.0, 0.0, 10), measured(2.0, 0.8, 0)
    )
    np.testing.assert_allclose(worth(sums), [1 / (0.36 / 10 + 0.64 / 110), 110.0, 10.0, 0.0], rtol=1e-9)
    untouched = replace(sums, touched=np.zeros(4))
    np.testing.assert_allclose(worth(untouched), [110, 110, 110, 0], rtol=1e-9)


amounts = st.one_of(st.just(0.0), st.floats(1e-9, 1e9))


@pytest.mark.slow
@given(arrays(np.float64, (len(fields(TileSums)), 6), elements=amounts))
def test_any_sums_give_some_samples(drawn: np.ndarray) -> None:
    sums = TileSums(*drawn)
    found = allocate(variances(sums, 3), np.maximum(sums.pixels, 1), 1e4, np.random.default_rng(0))
    assert found.samples.sum() >= 1 and (found.samples >= 0).all()
    assert np.isfinite(worth(sums)).all()
