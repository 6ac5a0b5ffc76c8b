"""Where an edit is looked for: passes over every sixteenth pixel, and tiles in which objects are seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.small_scenes import mixed_scene

from incpt.core import affine
from incpt.core.layout import SlotFlag
from incpt.render.impact.exploration import PASSES, seen_tiles, squares, windows
from incpt.render.plan import Cursor, Queue, plan_step
from incpt.render.tiles import TileGrid, base_queue
from incpt.scene.camera import Camera

grids = st.builds(TileGrid, st.integers(1, 90), st.integers(1, 90), st.sampled_from([1, 3, 8, 16]))


def pixels_of(slots: np.ndarray, grid: TileGrid) -> np.ndarray:
    """(height, width) how often the slots take each pixel."""
    counts = np.zeros((grid.height, grid.width), int)
    place = np.arange(grid.tile_size)
    for slot in slots:
        x = int(slot["tile_x"]) + place * int(slot["pixel_step"])
        y = int(slot["tile_y"]) + place * int(slot["pixel_step"])
        counts[np.ix_(y[y < grid.height], x[x < grid.width])] += 1
    return counts


def sparse_queue(tiles: np.ndarray, subset: int) -> Queue:
    return Queue(tiles, np.ones(len(tiles), np.int64), False, np.full(len(tiles), subset, np.int8))


@pytest.mark.slow
@given(grids)
def test_all_passes_take_every_pixel_once(grid: TileGrid) -> None:
    everywhere = squares(grid, np.ones(grid.count, np.bool_))
    counts = np.zeros((grid.height, grid.width), int)
    for subset in PASSES:
        queue = sparse_queue(everywhere, subset)
        plan = plan_step(grid, queue, Cursor(), queue.slot_count, np.zeros(grid.count, int), 7)
        assert (plan.slots["first_sample"] == 6).all() and len(plan.finished) == 0
        taken = pixels_of(plan.slots, grid)
        y, x = np.nonzero(taken)
        assert ((y % 4) * 4 + x % 4 == subset).all()
        counts += taken
    assert (counts == 1).all()


def test_passes_lie_evenly() -> None:
    assert sorted(PASSES) == list(range(16))
    for first in range(0, 16, 4):  # Each four passes take one pixel of each quadrant of the square.
        quadrants = {(subset // 8, subset % 4 // 2) for subset in PASSES[first : first + 4]}
        assert len(quadrants) == 4


@given(grids, st.data())
def test_squares_hold_the_chosen_tiles_and_no_square_without_one(grid: TileGrid, data: st.DataObject) -> None:
    chosen = np.zeros(grid.count, np.bool_)
    chosen[data.draw(st.lists(st.integers(0, grid.count - 1), max_size=5))] = True
    found = squares(grid, chosen)
    row, column = base_queue(grid) // grid.columns, base_queue(grid) % grid.columns
    first = row // 4 * 4 * grid.columns + column // 4 * 4
    assert set(found.tolist()) == set(first[chosen].tolist()) and len(set(found)) == len(found)


def test_sparse_entries_stand_beside_tiles_without_partners() -> None:
    grid = TileGrid(40, 40, 8)
    queue = Queue(
        np.array([0, 3], np.int32),
        np.array([1, 2]),
        False,
        np.array([5, -1], np.int8),
        np.array([False, True]),
    )
    plan = plan_step(grid, queue, Cursor(), 3, np.arange(grid.count), 10)
    assert plan.slots["first_sample"].tolist() == [9, 13, 13]
    assert plan.slots["pixel_step"].tolist() == [4, 1, 1]
    assert plan.slots["tile_x"].tolist() == [1, 24, 24] and plan.slots["tile_y"].tolist() == [1, 0, 0]
    assert (plan.slots["flags"] & int(SlotFlag.SINGLE) > 0).tolist() == [False, True, True]
    assert plan.finished.tolist() == [3] and plan.finished_samples.tolist() == [2]


def test_objects_are_seen_in_the_tiles_of_their_vertices() -> None:
    scene = mixed_scene()
    grid = TileGrid(64, 48, 8)
    for obj in scene.objects:
        tiles = seen_tiles(grid, scene.camera, (obj,))
        vertices = affine.apply(obj.world_from_object, obj.mesh.vertices)
        places, in_front = scene.camera.project(vertices, 64 / 48)
        inside = in_front & ((places >= 0) & (places < 1)).all(axis=1)
        x, y = (places[inside] * (64, 48)).astype(int).T
        assert set(grid.tile_at(x, y).tolist()) <= set(tiles.tolist())


def test_what_is_behind_the_camera_is_not_seen() -> None:
    scene = mixed_scene()
    camera, cube = scene.camera, scene.object("red cube")
    behind = tuple(2 * np.array(camera.position) - camera.target)
    moved = scene.with_object("red cube", position=behind).object("red cube")
    grid = TileGrid(64, 48, 8)
    assert len(seen_tiles(grid, camera, (cube,))) > 0
    assert len(seen_tiles(grid, camera, (moved,))) == len(seen_tiles(grid, camera, ())) == 0


def test_a_sparse_entry_needs_an_index_before_the_first_sample() -> None:
    with pytest.raises(AssertionError, match="index before the first"):
        plan_step(TileGrid(8, 8, 8), sparse_queue(np.zeros(1, np.int32), 0), Cursor(), 1, np.zeros(1, int))


def test_an_object_that_reaches_behind_the_camera_is_seen_to_the_edge() -> None:
    """Of a floor under the camera corners are behind it, and it fills the picture up to the horizon."""
    scene = mixed_scene()
    grid = TileGrid(80, 40, 8)
    camera = Camera(position=(0, 1.0, 0), target=(0, 0.6, -1), fov_y=60)
    floor = replace(scene.object("floor"), scale=(20, 1, 20))
    (window,) = windows(grid, camera, (floor,))
    left, top, right, bottom = window
    assert (left, right, bottom) == (0, 80, 40) and 0 < top <= 12
    narrow = replace(floor, scale=(0.5, 1, 20))  # as wide as the picture at its near end
    assert windows(grid, camera, (narrow,))[0][::2] == (0, 80)
    assert windows(grid, replace(camera, target=(0, 3, -1)), (floor,)) == []
    assert windows(grid, camera, (replace(floor, position=(0, 0, 30)),)) == []
