"""Sums of pairs: what paths and their partners brought, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyopencl as cl
import pytest
from render.impact import reference

from incpt.core import layout
from incpt.core.layout import Counter, PairPlane, SlotFlag
from incpt.device.device import Device
from incpt.render.batch import Batch
from incpt.render.film import RADIANCE, Film
from incpt.render.impact.sums import PAIR_SUMS, idle_launches, reduce_pairs

WIDTH, HEIGHT, TILE = 37, 26, 8
KEPT = 16.0


@dataclass
class Values:
    partner_place: cl.Buffer
    partner_radiance: cl.Buffer
    stride: int


class MadeUpPaths:
    """A film, the reference beside it, and paths with whatever radiance."""

    def __init__(self, device: Device, in_squares: bool = False) -> None:
        self.device, self.in_squares = device, in_squares
        self.rng = np.random.default_rng(5)
        self.anchor = self.rng.random((HEIGHT, WIDTH, 3)).astype(np.float32).astype(np.float64)
        self.film = Film(device, WIDTH, HEIGHT, (RADIANCE,), (PAIR_SUMS,))
        self.state = reference.State.empty(self.anchor, KEPT)
        self.film.restore({RADIANCE.name: self.state.anchor_sums()})

    def step(self, slots: npt.NDArray[np.void], broken: float = 0.0) -> int:
        """Reduce a step with these slots; returns how many floats were made infinite or undefined."""
        total = len(slots) * TILE**2
        new = self.rng.random((total, 3))
        touched = self.rng.random(total) < 0.4
        old = np.where(touched[:, None], self.rng.random((total, 3)), new)
        single = np.repeat((slots["flags"] & int(SlotFlag.SINGLE)) != 0, TILE**2)
        bad = self.rng.random((2, total)) < broken
        new[bad[0], 1], old[bad[0] & ~touched, 1] = np.nan, np.nan
        old[bad[1] & touched, 2] = np.inf

        listed = np.flatnonzero(touched & ~single)
        place = np.full(total, layout.NO_INDEX, np.uint32)
        place[touched & single] = layout.NO_PARTNER
        place[listed] = self.rng.permutation(len(listed))
        stride = len(listed) + 3
        partners = np.full((3, stride), np.nan, np.float32)
        partners[:, place[listed]] = old[listed].T
        upload = self.device.upload
        values = Values(upload(place), upload(partners), stride)

        params = np.zeros((), layout.PARAMS)
        params["width"], params["height"], params["tile_size"] = WIDTH, HEIGHT, TILE
        params["in_squares"], params["buffer_stride"] = self.in_squares, total
        samples = upload(np.ascontiguousarray(new.T.astype(np.float32)))
        batch = Batch(None, params, upload(slots), total, samples, self.film.counters)  # type: ignore[arg-type]
        reduce_pairs(self.film, batch, slots, values)
        return self._add(slots, new.astype(np.float32), old.astype(np.float32), touched, bad, single)

    def _add(self, slots: npt.NDArray[np.void], new, old, touched, bad, single) -> int:
        """The same for the reference, slot by slot; returns how many samples count as broken."""
        counted = 0
        for index, slot in enumerate(slots):
            copy = index - int(slot["group_first"])
            values, met = np.full((2, HEIGHT, WIDTH, 3), np.nan), np.zeros((HEIGHT, WIDTH), bool)
            for place in range(TILE**2):
                path = int(slot["group_first"]) * TILE**2 + place * int(slot["group_count"]) + copy
                at = self._pixel(place)
                x, y = (slot[f"tile_{axis}"] + at[i] * slot["pixel_step"] for i, axis in enumerate("xy"))
                if x < WIDTH and y < HEIGHT:
                    counted += int(bad[0][path]) + int(bad[1][path] and touched[path] and not single[path])
                    values[:, y, x], met[y, x] = (
                        reference.finite(np.stack([new[path], old[path]])),
                        touched[path],
                    )
            self.state.add(int(slot["first_sample"]) + copy, *values, met, single[index * TILE**2])
        return counted

    def _pixel(self, place: int) -> tuple[int, int]:
        """The pixel of a tile that is taken at a place, see cl/path/tile.cl."""
        if not self.in_squares:
            return place % TILE, place // TILE
        square, inside = divmod(place, 16)
        row, column = divmod(square, TILE // 4)
        return 4 * column + inside % 4, 4 * row + inside // 4

    def planes(self) -> npt.NDArray[np.float32]:
        return self.film.sums()[PAIR_SUMS.name]


def slots(*groups: tuple[int, int, int, int, int, int]) -> npt.NDArray[np.void]:
    """Slots of groups (tile_x, tile_y, pixel_step, first_sample, count, flags)."""
    rows = np.zeros(len(groups), layout.SLOT)
    for row, (x, y, step, sample, count, flags) in zip(rows, groups, strict=True):
        row["tile_x"], row["tile_y"], row["pixel_step"] = x, y, step
        row["first_sample"], row["group_count"], row["flags"] = sample, count, flags
    rows["group_first"] = np.cumsum(rows["group_count"]) - rows["group_count"]
    return np.repeat(rows, rows["group_count"])


SINGLE = int(SlotFlag.SINGLE)
# Whole tiles at the corners and over the edges, slots with gaps over them, tiles without partners.
STEP = slots(
    (0, 0, 1, 7, 3, 0), (32, 24, 1, 4, 2, 0), (8, 16, 1, 4, 1, SINGLE), (32, 0, 1, 9, 5, SINGLE),
    (1, 2, 4, 3, 1, 0), (34, 2, 4, 3, 1, SINGLE),
)  # fmt: skip


@pytest.mark.parametrize("in_squares", [False, True])
def test_sums_equal_the_reference(device: Device, in_squares: bool) -> None:
    paths = MadeUpPaths(device, in_squares)
    for _ in range(2):
        paths.step(STEP)
    np.testing.assert_allclose(paths.planes(), paths.state.planes(), rtol=1e-5, atol=1e-5)
    assert paths.film.take_counters()[Counter.NONFINITE] == 0
    counts = paths.planes()[PairPlane.SAMPLES_0 : PairPlane.PAIRS_1 + 1].sum((1, 2))
    assert (counts[:2] > counts[2:]).all()  # some had no partner


def test_what_is_not_finite_counts_as_black_in_each_scene(device: Device) -> None:
    paths = MadeUpPaths(device)
    broken = paths.step(STEP, broken=0.2)
    assert broken > 20 and paths.film.take_counters()[Counter.NONFINITE] == broken
    assert np.isfinite(paths.planes()).all()
    np.testing.assert_allclose(paths.planes(), paths.state.planes(), rtol=1e-5, atol=1e-5)


def test_paths_that_meet_no_change_are_the_same_in_both_scenes_to_the_bit(device: Device) -> None:
    paths = MadeUpPaths(device)
    paths.rng = np.random.default_rng(1)
    paths.step(slots((0, 0, 1, 7, 3, 0), (2, 1, 4, 3, 1, 0)))
    planes = paths.planes()
    untouched = planes[PairPlane.TOUCHED] == 0
    assert untouched.any() and not untouched.all()
    new, old = planes[PairPlane.NEW_R_0 : PairPlane.OLD_R_0], planes[PairPlane.OLD_R_0 : PairPlane.SAMPLES_0]
    np.testing.assert_array_equal(new[:, untouched], old[:, untouched])
    np.testing.assert_array_equal(
        planes[PairPlane.NEW_MOMENT][untouched], planes[PairPlane.JOINT_MOMENT][untouched]
    )
    assert (new[:, ~untouched] != old[:, ~untouched]).any()


def test_a_slot_without_partners_has_no_pairs(device: Device) -> None:
    """Not even those that met no change: their old values are known, but they are not like the others."""
    paths = MadeUpPaths(device)
    paths.step(slots((0, 0, 1, 0, 4, SINGLE)))
    planes = paths.planes()
    for plane in (*range(PairPlane.OLD_R_0, PairPlane.OLD_B_1 + 1), PairPlane.PAIRS_0, PairPlane.PAIRS_1):
        assert not planes[plane].any()
    assert not planes[PairPlane.OLD_MOMENT].any() and not planes[PairPlane.JOINT_MOMENT].any()
    assert planes[PairPlane.TOUCHED].any() and planes[PairPlane.NEW_MOMENT].any()


def test_halves_alternate_between_neighbours_and_samples(device: Device) -> None:
    """So that after one sample each neighbourhood has both, of all pixels and of every fourth."""
    paths = MadeUpPaths(device)
    paths.step(slots((0, 0, 1, 6, 1, 0)))
    halves = paths.planes()[PairPlane.SAMPLES_0 : PairPlane.PAIRS_0]
    assert (halves[:, :TILE, :TILE].sum(0) == 1).all()
    first = halves[0, :TILE, :TILE]
    for square in (first[:3, :3], first[2:5, 2:5], first[3:6, 1:4], first[5:, 5:], first[::4, ::4]):
        assert 0.3 < square.mean() < 0.7
    paths.step(slots((0, 0, 1, 7, 1, 0)))
    halves = paths.planes()[PairPlane.SAMPLES_0 : PairPlane.PAIRS_0]
    assert (halves[:, :TILE, :TILE] == 1).all()
    paths.step(slots((1, 2, 4, 0, 1, 0)))
    sparse = paths.planes()[PairPlane.SAMPLES_0, 10:26:4, 9:33:4]
    np.testing.assert_array_equal(sparse, np.indices(sparse.shape).sum(0) % 2 == 1 - sparse[0, 0])


def test_without_a_kept_picture_sums_are_radiance(device: Device) -> None:
    paths = MadeUpPaths(device)
    paths.state = reference.State.empty(np.zeros((HEIGHT, WIDTH, 3)), 0)
    paths.film.restore({RADIANCE.name: np.zeros((4, HEIGHT, WIDTH), np.float32)})
    paths.step(STEP)
    np.testing.assert_allclose(paths.planes(), paths.state.planes(), rtol=1e-5, atol=1e-5)


def test_sums_come_back(device: Device) -> None:
    paths, other = MadeUpPaths(device), MadeUpPaths(device)
    paths.step(STEP)
    other.film.restore(paths.film.sums())
    np.testing.assert_array_equal(other.planes(), paths.planes())
    other.film.clear(PAIR_SUMS)
    assert not other.planes().any() and paths.planes().any()


def test_digits_last_for_a_million_samples(device: Device) -> None:
    """Differences from the kept picture stay small where nothing changed, and so does rounding."""
    paths = MadeUpPaths(device)
    planes = paths.planes()
    million = np.float32(1 << 19)
    planes[PairPlane.SAMPLES_0 : PairPlane.PAIRS_1 + 1] = million
    paths.film.restore({PAIR_SUMS.name: planes})
    for _ in range(50):
        paths.step(slots((0, 0, 1, 0, 8, 0)))
    counts = paths.planes()[PairPlane.SAMPLES_0, :TILE, :TILE]
    assert (counts == million + 200).all()
    expected = paths.state.planes()[PairPlane.NEW_R_0, :TILE, :TILE]
    np.testing.assert_allclose(paths.planes()[PairPlane.NEW_R_0, :TILE, :TILE], expected, atol=1e-4)


def test_idle_launches_leave_the_sums_alone(device: Device) -> None:
    paths = MadeUpPaths(device)
    paths.step(STEP)
    before = paths.planes()
    params = np.zeros((), layout.PARAMS)
    params["tile_size"] = TILE
    nothing = device.empty(4)
    batch = Batch(None, params, nothing, 0, nothing, nothing)  # type: ignore[arg-type]
    for launch in idle_launches(paths.film, batch, Values(nothing, nothing, 0)):
        launch()
    np.testing.assert_array_equal(paths.planes(), before)
