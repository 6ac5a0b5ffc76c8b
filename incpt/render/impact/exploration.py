"""Where an edit is looked for first: everywhere a little, and where its objects are seen."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.render.plan import SPARSE_STEP
from incpt.render.tiles import IntArray, TileGrid
from incpt.scene.camera import Camera
from incpt.scene.model import Object

PASSES = (0, 10, 2, 8, 5, 15, 7, 13, 1, 11, 3, 9, 4, 14, 6, 12)
"""The pixel of each square of 4 x 4 that each pass takes: an ordered dither (Bayer 1973), so that those of
any number of passes lie evenly."""


def squares(grid: TileGrid, chosen: npt.NDArray[np.bool_]) -> IntArray:
    """The first tile of each square of 4 x 4 tiles in which one of the chosen tiles (grid.count,) lies."""
    rows, columns = -(-grid.rows // SPARSE_STEP), -(-grid.columns // SPARSE_STEP)
    padded = np.zeros((rows * SPARSE_STEP, columns * SPARSE_STEP), np.bool_)
    padded[: grid.rows, : grid.columns] = chosen.reshape(grid.rows, grid.columns)
    found = padded.reshape(rows, SPARSE_STEP, columns, SPARSE_STEP).any(axis=(1, 3))
    row, column = np.nonzero(found)
    return (SPARSE_STEP * (row * grid.columns + column)).astype(np.int32)


def seen_tiles(grid: TileGrid, camera: Camera, objects: tuple[Object, ...]) -> IntArray:
    """The tiles in the rectangles around what is seen of the bounds of objects, one by one, in order. Corners
    behind the camera do not count."""
    chosen = np.zeros((grid.rows, grid.columns), np.bool_)
    for obj in objects:
        places, in_front = camera.project(affine.box_corners(obj.world_bounds), grid.width / grid.height)
        if not in_front.any():
            continue
        pixels = places[in_front] * (grid.width, grid.height)
        low = np.clip(np.floor(pixels.min(axis=0)), 0, [grid.width, grid.height]).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)), 0, [grid.width, grid.height]).astype(int)
        if (low < high).all():
            (left, top), (right, bottom) = low // grid.tile_size, -(-high // grid.tile_size)
            chosen[top:bottom, left:right] = True
    return np.flatnonzero(chosen).astype(np.int32)
