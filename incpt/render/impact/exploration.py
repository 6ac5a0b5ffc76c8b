"""Where an edit is looked for first: everywhere a little, and where its objects are seen."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.render.first_hits import Window
from incpt.render.plan import SPARSE_STEP
from incpt.render.tiles import IntArray, TileGrid
from incpt.scene.camera import Camera
from incpt.scene.model import Placed

PASSES = (0, 10, 2, 8, 5, 15, 7, 13, 1, 11, 3, 9, 4, 14, 6, 12)
"""The pixel of each square of 4 x 4 that each pass takes: an ordered dither (Bayer 1973), so that those of
any number of passes lie evenly."""

_CLOSE = 1e-3
"""How near to the camera boxes are cut off, as a share of the distance of their farthest corner."""
_EDGES = np.array([(i, i | 1 << axis) for i in range(8) for axis in range(3) if not i >> axis & 1]).T
"""(2, 12) the corners at both ends of each edge of a box, in the order of `affine.box_corners`."""


def squares(grid: TileGrid, chosen: npt.NDArray[np.bool_]) -> IntArray:
    """The first tile of each square of 4 x 4 tiles in which one of the chosen tiles (grid.count,) lies."""
    rows, columns = -(-grid.rows // SPARSE_STEP), -(-grid.columns // SPARSE_STEP)
    padded = np.zeros((rows * SPARSE_STEP, columns * SPARSE_STEP), np.bool_)
    padded[: grid.rows, : grid.columns] = chosen.reshape(grid.rows, grid.columns)
    found = padded.reshape(rows, SPARSE_STEP, columns, SPARSE_STEP).any(axis=(1, 3))
    row, column = np.nonzero(found)
    return (SPARSE_STEP * (row * grid.columns + column)).astype(np.int32)


def windows(grid: TileGrid, camera: Camera, objects: tuple[Placed, ...]) -> list[Window]:
    """The rectangles around what is seen of the bounds of each object, from anywhere on the lens."""
    found = []
    aspect, size = grid.width / grid.height, np.array([grid.width, grid.height])
    for obj in objects:
        corners = _cut_off(camera, affine.box_corners(obj.world_bounds))
        places, in_front = camera.project(corners, aspect)
        if not in_front.any():
            continue
        # From each point of the lens a box is seen within its corners as they are seen from there.
        blur = camera.blur(corners[in_front], aspect) * size if camera.has_lens else 0.0
        pixels = places[in_front] * size
        # Corners may be anywhere, also beyond what whole numbers hold.
        low = np.clip(np.floor((pixels - blur).min(axis=0)), 0, size).astype(int)
        high = np.clip(np.ceil((pixels + blur).max(axis=0)), 0, size).astype(int)
        if (low < high).all():
            found.append((int(low[0]), int(low[1]), int(high[0]), int(high[1])))
    return found


def most_blur(grid: TileGrid, camera: Camera, objects: tuple[Placed, ...]) -> int:
    """How many pixels beside its place something of these objects may be seen through a lens, at most an
    eighth of the picture's height."""
    size = np.array([grid.width, grid.height])
    most = 0.0
    for obj in objects:
        blur = camera.blur(_cut_off(camera, affine.box_corners(obj.world_bounds)), grid.width / grid.height)
        most = max(most, float((blur * size).max()))
    return math.ceil(min(most, grid.height / 8))


def _cut_off(camera: Camera, corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The corners of a box (8, 3), and where its edges pass through a plane close before the camera, if it
    lies on both sides of that: what is seen of it may reach as far as these points."""
    forward = camera.image_plane(1.0)[2]
    depth = (corners - np.asarray(camera.position)) @ forward
    plane = max(_CLOSE * float(np.abs(depth).max()), camera.near)
    first, last = _EDGES
    cut = (depth[first] > plane) != (depth[last] > plane)
    first, last = first[cut], last[cut]
    share = (plane - depth[first]) / (depth[last] - depth[first])
    return np.concatenate([corners, corners[first] + share[:, None] * (corners[last] - corners[first])])


def seen_tiles(grid: TileGrid, camera: Camera, objects: tuple[Placed, ...]) -> IntArray:
    """The tiles in the windows of the objects, row by row for each object, each tile once."""
    chosen = [
        (np.arange(top // size, -(-bottom // size))[:, None] * grid.columns
         + np.arange(left // size, -(-right // size))[None, :]).ravel()
        for size in (grid.tile_size,)
        for left, top, right, bottom in windows(grid, camera, objects)
    ]  # fmt: skip
    if not chosen:
        return np.zeros(0, np.int32)
    tiles, first = np.unique(np.concatenate(chosen), return_index=True)
    return tiles[np.argsort(first)].astype(np.int32)
