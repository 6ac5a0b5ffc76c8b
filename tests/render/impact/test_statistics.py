"""Statistics of pairs over cells and tiles."""

from __future__ import annotations

import numpy as np
import pytest
from render.impact import made_up, reference
from render.impact.made_up import Rig

from incpt.core.layout import CELL_SIZE, CLASSES, PATCH_WIDTH, CellPlane, RulePlane
from incpt.device.device import Device
from incpt.picture.tone_mapping import display_values
from incpt.render.impact import allocation
from incpt.render.impact.statistics import squared_slopes
from incpt.render.tiles import TileGrid

WIDTH, HEIGHT = 70, 45
ROWS, COLUMNS = -(-HEIGHT // CELL_SIZE), -(-WIDTH // CELL_SIZE)


@pytest.fixture(scope="module")
def rig(device: Device) -> Rig:
    return Rig(device, WIDTH, HEIGHT)


def sampled(spp: int, singles: int = 0, seed: int = 0) -> tuple[made_up.Edit, reference.State]:
    rng = np.random.default_rng(seed)
    edit = made_up.edit(WIDTH, HEIGHT, rng)
    state = edit.state(rng)
    for index in range(spp + singles):
        state.add(index, *edit.samples(rng), single=index >= spp)
    return edit, state


def update(rig: Rig, edit: made_up.Edit, state: reference.State) -> None:
    rig.load(state, edit.guides)
    rig.statistics.update(rig.film, rig.guides)


def cells(rig: Rig) -> np.ndarray:
    """(classes, planes, rows, columns)"""
    found = np.empty((CLASSES, len(CellPlane), ROWS, COLUMNS), np.float32)
    return rig.film.device.read(rig.statistics.cells, found)


@pytest.mark.parametrize(("spp", "singles"), [(0, 0), (1, 0), (2, 0), (5, 0), (12, 0), (0, 3), (3, 4)])
def test_cells_equal_the_reference(rig: Rig, spp: int, singles: int) -> None:
    edit, state = sampled(spp, singles)
    update(rig, edit, state)
    found = cells(rig)
    for i, about in enumerate(reference.known(state, edit.guides.changed)):
        for plane in CellPlane:
            expected = getattr(about, plane.name.lower())
            np.testing.assert_allclose(found[i, plane], expected, rtol=1e-3, atol=1e-5, err_msg=plane.name)


@pytest.mark.parametrize(
    ("spp", "singles", "brighter"), [(0, 0, 1), (1, 0, 1), (5, 0, 1), (3, 4, 1), (4, 0, 3)]
)
def test_rules_equal_the_reference(rig: Rig, spp: int, singles: int, brighter: float) -> None:
    edit, state = sampled(spp, singles)
    state.new *= brighter
    state.new_moment *= brighter**2
    state.joint_moment *= brighter
    update(rig, edit, state)
    columns = np.empty((len(RulePlane), CLASSES, ROWS, WIDTH), np.float32)
    rig.film.device.read(rig.statistics.column_rules, columns)
    x, centres = np.arange(WIDTH) + 0.5, (np.arange(COLUMNS) + 0.5) * CELL_SIZE
    for i, expected in enumerate(reference.rules(reference.known(state, edit.guides.changed))):
        for plane in RulePlane:
            rows = getattr(expected, plane.name.lower())
            interpolated = [np.interp(x, centres, row) for row in rows]
            np.testing.assert_allclose(
                columns[plane, i], interpolated, rtol=2e-3, atol=1e-5, err_msg=plane.name
            )


def test_a_class_that_is_not_there_says_nothing(rig: Rig) -> None:
    edit, state = sampled(4)
    edit.guides.changed[:] = False
    update(rig, edit, state)
    found = cells(rig)
    assert found[0, CellPlane.FREEDOM_NEW].all() and not found[1].any()


def test_few_samples_are_pooled_over_neighbours_of_their_class(rig: Rig) -> None:
    edit, state = sampled(2)
    changed = edit.guides.changed
    update(rig, edit, state)
    few = cells(rig)[:, CellPlane.FREEDOM_NEW]
    assert few[0, 2, 4] > CELL_SIZE**2  # one degree of freedom for each pixel, of more than one cell
    edit, state = sampled(12)
    update(rig, edit, state)
    many = cells(rig)[:, CellPlane.FREEDOM_NEW]
    assert many[0, 0, 0] == 11 * CELL_SIZE**2  # enough, so that no neighbour is asked
    # Changed objects take in all around always, and nothing of the other class.
    np.testing.assert_array_equal(many[1], 11 * few[1])
    assert many[1].max() <= 11 * changed.sum()


@pytest.mark.slow
@pytest.mark.parametrize("kept", [1, 4, 256])
@pytest.mark.parametrize(("pairs", "singles"), [(1, 0), (2, 0), (3, 2), (2, 5)])
def test_variances_and_covariance_are_right_on_average(pairs: int, singles: int, kept: int) -> None:
    """Also after one pair, where the kept picture is noisy itself, and where samples without partners move
    the mean of the new ones."""
    rng, spreads, count = np.random.default_rng(3), [], 80
    for _ in range(count):
        noise = rng.normal(size=(32, 32, 3)) / np.sqrt(kept)
        state = reference.State.empty(0.7 + noise, kept)
        for index in range(pairs + singles):
            common = rng.normal(size=(32, 32, 3))
            new = 1 + 0.8 * common + 0.5 * rng.normal(size=common.shape)
            state.add(index, new, 0.7 + common, np.ones((32, 32), bool), single=index >= pairs)
        spread = reference.spread_of(state)
        new_variance = spread.squares_new.sum() / max(spread.freedom_new.sum(), 1)
        spreads.append([new_variance, spread.squares_old.sum() / spread.pairs.sum()])
        spreads[-1].append(spread.products.sum() / spread.pairs.sum())
    mean, error = np.mean(spreads, 0), np.std(spreads, 0) / np.sqrt(count)
    expected = [0.89 if pairs + singles > 1 else 0, 1, 0.8]
    assert (np.abs(mean - expected) <= 4 * error).all(), (mean, error)


@pytest.mark.parametrize(("pairs", "singles"), [(2, 0), (3, 2), (2, 5)])
def test_spreads_of_pairs_are_right_on_average(pairs: int, singles: int) -> None:
    rng, spreads, count = np.random.default_rng(4), [], 40
    for _ in range(count):
        state = reference.State.empty(np.full((32, 32, 3), 0.4), 1)
        for index in range(pairs + singles):
            common = rng.normal(size=(32, 32, 3))
            new = 1 + 0.8 * common + 0.5 * rng.normal(size=common.shape)
            state.add(index, new, 0.7 + common, np.ones((32, 32), bool), single=index >= pairs)
        spread = reference.pair_spread_of(state)
        spreads.append([spread.squares_old.sum(), spread.products.sum()] / spread.freedom.sum())
    mean, error = np.mean(spreads, 0), np.std(spreads, 0) / np.sqrt(count)
    assert (np.abs(mean - [1, 0.8]) <= 4 * error).all(), (mean, error)


def test_tiles_know_that_pairs_bring_the_same_from_two_samples_on(rig: Rig) -> None:
    """However few they are, and however far the old picture is from what they say."""
    rng = np.random.default_rng(5)
    edit = made_up.edit(WIDTH, HEIGHT, rng)
    state = edit.state(rng)
    for index in range(2):
        new, _, touched = edit.samples(rng)
        state.add(index, new, new, touched)
    update(rig, edit, state)
    grid = TileGrid(WIDTH, HEIGHT, 8)
    sums = rig.tile_sums(grid)
    np.testing.assert_allclose(sums.squares_old, sums.squares_new, rtol=1e-4)
    np.testing.assert_allclose(sums.products, sums.squares_new, rtol=1e-4)
    found = allocation.variances(sums, grid.columns)
    assert found.uncorrelated.max() < 1e-3 * found.correlated.mean()


@pytest.mark.parametrize("tile_size", [1, 5, 8, 16, 33, 1024])
def test_tile_sums(rig: Rig, tile_size: int) -> None:
    edit, state = sampled(3, 2)
    update(rig, edit, state)
    grid = TileGrid(WIDTH, HEIGHT, tile_size)
    sums = rig.tile_sums(grid)
    spread, about = reference.spread_of(state), reference.known(state, edit.guides.changed)
    pair_spread = reference.pair_spread_of(state)
    shown, shares = reference.picture_and_shares(state, edit.guides)
    weight = slope_weight(shown.mean(-1))
    change = reference.change_variance(state, about, edit.guides.changed)
    samples, pairs = state.samples.sum(0), state.pairs.sum(0)
    among_pairs = state.new_moment * pairs / np.maximum(samples, 1)
    expected = {
        "pixels": np.ones((HEIGHT, WIDTH)),
        "samples": samples,
        "pairs": pairs,
        "touched": state.touched,
        "kept": state.kept,
        "freedom_new": spread.freedom_new,
        "freedom_pairs": pair_spread.freedom,
        "squares_new": weight * spread.squares_new,
        "squares_old": weight * pair_spread.squares_old,
        "products": weight * pair_spread.products,
        "squares_kept": weight * spread.squares_old,
        "differences": weight * np.maximum(among_pairs + state.old_moment - 2 * state.joint_moment, 0),
        "error": weight * reference.shown_variance(state, about, edit.guides.changed),
        "noise": weight * change,
        "shown_noise": weight * change * shares,
    }
    tiles = grid.tile_of_pixels().ravel()
    for name, values in expected.items():
        per_tile = np.bincount(tiles, values.ravel(), grid.count)
        np.testing.assert_allclose(getattr(sums, name), per_tile, rtol=2e-3, atol=1e-3, err_msg=name)


def slope_weight(radiance: np.ndarray) -> np.ndarray:
    """Squared slope of the display curve, from its table: entries begin at eighths of powers of two."""
    octave = np.floor(np.log2(radiance))
    part = np.floor((radiance / 2**octave - 1) * 8)
    return squared_slopes()[((octave + 15) * 8 + part).astype(int)]


def test_slopes_are_those_of_the_display_curve() -> None:
    for radiance in (0.002, 0.05, 0.18, 1.0, 9.0):
        step = 1e-4 * radiance
        grey = np.array([[radiance - step] * 3, [radiance + step] * 3])
        low, high = display_values(grey)[:, 0]
        assert slope_weight(np.float64(radiance)) == pytest.approx(((high - low) / (2 * step)) ** 2, rel=0.2)
    assert (squared_slopes() > 0).all()  # also where the display shows black or white


@pytest.mark.parametrize("radiance", [0.0, 1e-9, 0.5, 20.0, 1e4, 1e30])
def test_weights_of_black_and_of_glaring_pixels(rig: Rig, radiance: float) -> None:
    edit, state = sampled(0)
    state.anchor[:], state.touched[:] = radiance, 1
    state.samples[:], state.pairs[:], state.new_moment[:] = 0.5, 0.5, 2.0
    update(rig, edit, state)
    sums = rig.tile_sums(TileGrid(WIDTH, HEIGHT, 16))
    weight = sums.differences[0] / (2.0 * 256)
    expected = (
        squared_slopes()[0 if radiance < 1e-3 else -1] if radiance != 0.5 else slope_weight(np.float64(0.5))
    )
    assert weight == pytest.approx(expected, rel=1e-3) and weight > 0


def test_spans_reach_from_the_first_to_the_last_change_nearby(device: Device) -> None:
    width, height = 2 * PATCH_WIDTH + 30, 90
    rig = Rig(device, width, height)
    state = reference.State.empty(np.ones((height, width, 3)), 64)
    state.samples[:] = state.pairs[:] = 20  # enough that no neighbouring cells are asked
    state.touched[2, 300], state.touched[89, 45], state.touched[89, 91] = 1, 1, 1
    rig.load(
        state,
        reference.Guides(
            np.zeros((height, width), int), np.zeros((height, width, 3)), np.zeros((height, width), bool)
        ),
    )
    rig.statistics.update(rig.film, rig.guides)
    rows = -(-height // CELL_SIZE)
    spans = device.read(rig.statistics.spans, np.empty((rows, 3, 4), np.uint32)).astype(int)
    ends = np.array([PATCH_WIDTH, 2 * PATCH_WIDTH, width])
    expected = np.repeat(ends[None, :, None], rows, 0).repeat(2, 2)
    # Four cells to each side of the one with a change; what lies in the next patch is another's.
    expected[:5, 1] = (37 - 4) * CELL_SIZE, (37 + 5) * CELL_SIZE
    expected[rows - 5 :, 0] = (5 - 4) * CELL_SIZE, (11 + 5) * CELL_SIZE
    np.testing.assert_array_equal(spans[..., :2], expected)
    np.testing.assert_array_equal(spans[..., 2:], 0)  # there was no picture before
    rig.statistics.update(rig.film, rig.guides)
    spans = device.read(rig.statistics.spans, np.empty((rows, 3, 4), np.uint32)).astype(int)
    np.testing.assert_array_equal(spans[..., 2:], expected)
