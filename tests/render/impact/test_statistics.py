"""Statistics of pairs over cells and tiles."""

from __future__ import annotations

import numpy as np
import pytest
from render.impact import made_up, reference
from render.impact.made_up import Rig

from incpt.core.layout import CELL_SIZE, PATCH_HEIGHT, PATCH_WIDTH, Activity, CellPlane
from incpt.device.device import Device
from incpt.picture.tone_mapping import display_values
from incpt.render.impact.statistics import squared_slopes
from incpt.render.tiles import TileGrid

WIDTH, HEIGHT = 70, 45


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


def cells_of_pixels(rig: Rig, changed: np.ndarray) -> list[np.ndarray]:
    """(H, W) of each plane, from the cell and class of each pixel."""
    rows, columns = -(-HEIGHT // CELL_SIZE), -(-WIDTH // CELL_SIZE)
    cells = np.empty((2, len(CellPlane), rows, columns), np.float32)
    rig.film.device.read(rig.statistics.cells, cells)
    y, x = np.mgrid[:HEIGHT, :WIDTH] // CELL_SIZE
    return [np.where(changed, cells[1, plane, y, x], cells[0, plane, y, x]) for plane in CellPlane]


@pytest.mark.parametrize(("spp", "singles"), [(0, 0), (1, 0), (2, 0), (5, 0), (12, 0), (0, 3), (3, 4)])
def test_cells_equal_the_reference(rig: Rig, spp: int, singles: int) -> None:
    edit, state = sampled(spp, singles)
    update(rig, edit, state)
    about = reference.known(state, edit.guides.changed)
    found = cells_of_pixels(rig, edit.guides.changed)
    for plane in CellPlane:
        expected = getattr(about, plane.name.lower())
        np.testing.assert_allclose(found[plane], expected, rtol=1e-3, atol=1e-5, err_msg=plane.name)


def test_a_class_that_a_cell_lacks_says_nothing_there(rig: Rig) -> None:
    edit, state = sampled(4)
    edit.guides.changed[:] = False
    update(rig, edit, state)
    rows, columns = -(-HEIGHT // CELL_SIZE), -(-WIDTH // CELL_SIZE)
    cells = np.empty((2, len(CellPlane), rows, columns), np.float32)
    rig.film.device.read(rig.statistics.cells, cells)
    assert cells[0, CellPlane.FREEDOM_NEW].all() and not cells[1].any()


def test_few_samples_are_pooled_over_neighbours_of_their_class(rig: Rig) -> None:
    edit, state = sampled(2)
    update(rig, edit, state)
    freedom = cells_of_pixels(rig, edit.guides.changed)[CellPlane.FREEDOM_NEW]
    inner = freedom[16:24, 32:40]
    assert (inner > CELL_SIZE**2).all()  # one degree of freedom for each pixel of more than one cell
    changed = edit.guides.changed
    assert freedom[changed].max() <= changed.sum()
    edit, state = sampled(12)
    update(rig, edit, state)
    freedom = cells_of_pixels(rig, np.zeros_like(changed))[CellPlane.FREEDOM_NEW]
    assert freedom[:8, :8].max() == 11 * CELL_SIZE**2  # enough, so that no neighbour is asked


@pytest.mark.parametrize(("pairs", "singles"), [(2, 0), (3, 2), (2, 5)])
def test_variances_and_covariance_are_right_on_average(pairs: int, singles: int) -> None:
    """Also where samples without partners move the mean that pairs are taken from."""
    rng = np.random.default_rng(3)
    spreads = []
    for _ in range(60):
        state = reference.State.empty(np.full((32, 32, 3), 0.7), 64)
        for index in range(pairs + singles):
            common = rng.normal(size=(32, 32, 3))
            new = 1 + common + 0.5 * rng.normal(size=common.shape)
            state.add(index, new, 0.7 + common, np.ones((32, 32), bool), single=index >= pairs)
        spread = reference.spread_of(state)
        spreads.append(
            [
                spread.squares_new.sum() / spread.freedom_new.sum(),
                spread.squares_old.sum() / spread.freedom_pairs.sum(),
                spread.products.sum() / spread.freedom_pairs.sum(),
            ]
        )
    mean, error = np.mean(spreads, 0), np.std(spreads, 0) / np.sqrt(60)
    assert (np.abs(mean - [1.25, 1, 1]) < 4 * error).all(), (mean, error)


@pytest.mark.parametrize("tile_size", [1, 5, 8, 16, 33, 1024])
def test_tile_sums(rig: Rig, tile_size: int) -> None:
    edit, state = sampled(3, 2)
    update(rig, edit, state)
    grid = TileGrid(WIDTH, HEIGHT, tile_size)
    sums = rig.statistics.tile_sums(rig.film, rig.guides, grid)
    spread, about = reference.spread_of(state), reference.known(state, edit.guides.changed)
    weight = slope_weight(state.anchor.mean(-1))
    samples, pairs = state.samples.sum(0), state.pairs.sum(0)
    among_pairs = state.new_moment * pairs / np.maximum(samples, 1)
    expected = {
        "pixels": np.ones((HEIGHT, WIDTH)),
        "samples": samples,
        "pairs": pairs,
        "touched": state.touched,
        "kept": state.kept,
        "freedom_new": spread.freedom_new,
        "freedom_pairs": spread.freedom_pairs,
        "squares_new": weight * spread.squares_new,
        "squares_old": weight * spread.squares_old,
        "products": weight * spread.products,
        "differences": weight * np.maximum(among_pairs + state.old_moment - 2 * state.joint_moment, 0),
        "error": weight * reference.shown_variance(state, about),
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
    sums = rig.statistics.tile_sums(rig.film, rig.guides, TileGrid(WIDTH, HEIGHT, 16))
    weight = sums.differences[0] / (2.0 * 256)
    expected = (
        squared_slopes()[0 if radiance < 1e-3 else -1] if radiance != 0.5 else slope_weight(np.float64(0.5))
    )
    assert weight == pytest.approx(expected, rel=1e-3) and weight > 0


def test_patches_near_a_change_are_marked(rig: Rig, device: Device) -> None:
    edit, state = sampled(0)
    state.samples[:] = state.pairs[:] = 20  # enough that no neighbouring cells are asked
    state.touched[4, 66] = 1
    update(rig, edit, state)
    columns, rows = -(-WIDTH // PATCH_WIDTH), -(-HEIGHT // PATCH_HEIGHT)
    marks = device.read(rig.statistics.activities, np.empty((rows, columns), np.uint32))
    # The cell at (64, 0): up to two cells away the picture may change, and two more are smoothed.
    expected = np.zeros((rows, columns), np.uint32)
    expected[:5, 1:], expected[:3, 1:] = Activity.NEAR, Activity.CHANGED
    np.testing.assert_array_equal(marks, expected)
