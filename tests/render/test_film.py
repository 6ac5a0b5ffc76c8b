"""The film and its passes, with what paths would bring made up."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.core import layout
from incpt.core.layout import Counter
from incpt.device.device import Device
from incpt.render.film import RADIANCE, Accumulation, Film, FilmPass, Resolution, plane_count
from incpt.render.plan import Cursor, Queue, is_done, plan_step
from incpt.render.tiles import TileGrid, base_queue

WIDTH, HEIGHT, TILE = 13, 7, 4
GRID = TileGrid(WIDTH, HEIGHT, TILE)
ALBEDO = FilmPass("albedo", 3)
DEPTH = FilmPass("depth", 1)
MOMENT = FilmPass("moment", 2, Accumulation.SQUARES)
TOTAL = FilmPass("total", 1, Accumulation.SUM, Resolution.SUM)
PASSES = (RADIANCE, ALBEDO, DEPTH, MOMENT, TOTAL)


class MadeUpPaths:
    """A film, and a stand-in for the tracer: sample `index` of a pixel brings `value(x, y, index)`."""

    def __init__(self, device: Device, passes: tuple[FilmPass, ...]) -> None:
        self.device, self.film = device, Film(device, WIDTH, HEIGHT, passes)
        self.planes = plane_count(passes)

        self.counts = np.zeros(GRID.count, np.int64)

    def value(self, x: int, y: int, index: int) -> np.ndarray:
        """Made of whole numbers, so that their sums are exact."""
        return np.arange(1, self.planes + 1) * (1 + (3 * x + 5 * y + 7 * index) % 11)

    def render(self, queue: Queue, slots_per_step: int) -> None:
        cursor = Cursor()
        while not is_done(queue, cursor):
            plan = plan_step(GRID, queue, cursor, slots_per_step, self.counts)
            paths = len(plan.slots) * TILE**2
            stride = paths + layout.WORK_GROUP_SIZE
            samples = np.zeros((self.planes, stride), np.float32)
            for place, slot in enumerate(plan.slots):
                first, count = int(slot["group_first"]), int(slot["group_count"])
                repetition = place - first
                for pixel in range(TILE**2):
                    x, y = int(slot["tile_x"]) + pixel % TILE, int(slot["tile_y"]) + pixel // TILE
                    value = self.value(x, y, int(slot["first_sample"]) + repetition)
                    samples[:, first * TILE**2 + pixel * count + repetition] = value
            params = np.zeros((), layout.PARAMS)
            params["width"], params["height"], params["tile_size"] = WIDTH, HEIGHT, TILE
            params["buffer_stride"] = stride
            upload = self.device.upload
            self.film.reduce(params, plan, upload(plan.slots), upload(samples))
            cursor = plan.cursor

    def expected(self, counts: np.ndarray) -> np.ndarray:
        """(planes, samples, height, width) the values of samples 0 to counts - 1, else 0."""
        found = np.zeros((self.planes, counts.max(), HEIGHT, WIDTH))
        tile_of = GRID.tile_of_pixels()
        for y in range(HEIGHT):
            for x in range(WIDTH):
                for index in range(counts[tile_of[y, x]]):
                    found[:, index, y, x] = self.value(x, y, index)
        return found


@pytest.mark.parametrize("slots", [1, 7, 1000])
def test_every_pass_gets_its_own_planes(device: Device, slots: int) -> None:
    paths = MadeUpPaths(device, PASSES)
    samples = 1 + np.arange(GRID.count, dtype=np.int64) % 3
    paths.render(Queue(base_queue(GRID), samples, replaces=True), slots)
    values, count = paths.expected(samples), samples[GRID.tile_of_pixels()]
    sums = paths.film.sums()
    assert list(sums) == ["radiance", "albedo", "depth", "moment", "total"]
    mean = values.sum(axis=1) / count
    square = (values**2).sum(axis=1) / count
    for name, wanted in {
        "radiance": mean[0:3],
        "albedo": mean[3:6],
        "depth": mean[6:7],
        "moment": square[7:9],
        "total": values.sum(axis=1)[9:10],
    }.items():
        image = paths.film.image(name)
        assert image.shape == (HEIGHT, WIDTH, len(wanted) + 1) and (image[..., -1] == 1).all()
        np.testing.assert_allclose(np.moveaxis(image[..., :-1], 2, 0), wanted, rtol=1e-6)
        np.testing.assert_array_equal(sums[name][-1], count)
    np.testing.assert_array_equal(sums["total"][0], values.sum(axis=1)[9])


def test_refinement_adds_and_an_edit_replaces_in_every_pass(device: Device) -> None:
    paths = MadeUpPaths(device, PASSES)
    paths.render(Queue.even(base_queue(GRID), 2, replaces=True), 50)
    paths.counts += 2
    paths.render(Queue.even(base_queue(GRID), 3, replaces=False), 50)
    five = paths.expected(np.full(GRID.count, 5))
    np.testing.assert_array_equal(paths.film.sums()["albedo"][:3], five.sum(axis=1)[3:6])
    np.testing.assert_array_equal(paths.film.sums()["moment"][:2], (five**2).sum(axis=1)[7:9])
    paths.counts[:] = 0
    paths.render(Queue.even(base_queue(GRID)[:3], 4, replaces=True), 50)
    four = paths.expected(np.where(np.arange(GRID.count) < 3, 4, 5))
    for name, planes in (("radiance", slice(0, 3)), ("depth", slice(6, 7))):
        np.testing.assert_array_equal(paths.film.sums()[name][:-1], four.sum(axis=1)[planes])


def test_what_is_not_finite_counts_as_zero_in_its_own_pass(device: Device) -> None:
    class Broken(MadeUpPaths):
        def value(self, x: int, y: int, index: int) -> np.ndarray:
            value = super().value(x, y, index).astype(np.float32)
            if (x, y, index) == (3, 2, 0):
                value[4] = np.nan  # of the albedo
            if (x, y, index) == (5, 5, 1):
                value[6] = np.inf  # the depth
            return value

    paths = Broken(device, PASSES)
    paths.render(Queue.even(base_queue(GRID), 2, replaces=True), 50)
    assert paths.film.take_counters() == {Counter.NONFINITE: 2, Counter.CUT_OFF: 0}
    assert not any(paths.film.take_counters().values())
    whole = MadeUpPaths(device, PASSES)
    whole.render(Queue.even(base_queue(GRID), 2, replaces=True), 50)
    sums, expected = paths.film.sums(), whole.film.sums()
    np.testing.assert_array_equal(sums["radiance"], expected["radiance"])
    assert (sums["albedo"][:3, 2, 3] == whole.value(3, 2, 1)[3:6]).all() and sums["albedo"][3, 2, 3] == 2
    assert sums["depth"][0, 5, 5] == whole.value(5, 5, 0)[6]
    sums["albedo"][:, 2, 3] = expected["albedo"][:, 2, 3]
    np.testing.assert_array_equal(sums["albedo"], expected["albedo"])


def test_sums_come_back(device: Device) -> None:
    paths = MadeUpPaths(device, (RADIANCE, DEPTH))
    paths.render(Queue.even(base_queue(GRID), 2, replaces=True), 50)
    film = Film(device, WIDTH, HEIGHT, (RADIANCE, DEPTH))
    assert not film.image("depth").any() and not film.image().any()
    film.restore(paths.film.sums())
    for name in ("radiance", "depth"):
        np.testing.assert_array_equal(film.image(name), paths.film.image(name))
    alone = Film(device, WIDTH, HEIGHT)
    alone.restore(paths.film.sums())
    np.testing.assert_array_equal(alone.image(), paths.film.image())


def test_passes_have_different_names(device: Device) -> None:
    with pytest.raises(AssertionError, match="different names"):
        Film(device, WIDTH, HEIGHT, (RADIANCE, FilmPass("radiance", 1)))
