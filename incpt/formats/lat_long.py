"""Lat-long images of what is far away, made of images that show it otherwise. OpenEXR's convention: the
middle looks to +z, three quarters to the right is -x, the top row is +y."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.scene.environment import Environment
from incpt.scene.image import Image

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.float32]
_PLACES = (0.25, 0.75)
"""Within a pixel, along its rows and columns."""


def drawn(height: int, width: int, seen: Callable[[Array], Pixels]) -> Pixels:
    """(height, width, 3) of each pixel the mean over four places. `seen` gives (N, 3) what there is along
    unit directions (3, N)."""
    made = np.zeros((height, width, 3), np.float32)
    for row in range(height):
        for down in _PLACES:
            latitude = math.pi * (0.5 - (row + down) / height)
            for right in _PLACES:
                longitude = 2 * np.pi * ((np.arange(width) + right) / width - 0.5)
                flat, up = math.cos(latitude), np.full(width, math.sin(latitude))
                ways = np.stack([-flat * np.sin(longitude), up, flat * np.cos(longitude)])
                made[row] += seen(ways) / 4
    return made


def turned(pixels: Pixels, turn: Array) -> Pixels:
    """(H, W, 3) a lat-long image that shows along turn @ d what another one shows along d."""
    back = np.linalg.inv(turn)
    height, width = pixels.shape[:2]
    return drawn(height, width, lambda ways: seen_along(pixels, back @ ways))


def seen_along(pixels: Pixels, ways: Array) -> Pixels:
    """(N, 3) what a lat-long image shows along directions (3, N) of any length, between pixels."""
    height, width = pixels.shape[:2]
    x, y, z = ways / np.linalg.norm(ways, axis=0)
    column = (np.arctan2(-x, z) / (2 * np.pi) + 0.5) * width - 0.5
    row = np.clip((0.5 - np.arcsin(np.clip(y, -1, 1)) / np.pi) * height - 0.5, 0, height - 1)
    left, top = np.floor(column), np.floor(row)
    right_share, down_share = (column - left)[:, None], (row - top)[:, None]
    i, j = left.astype(int) % width, top.astype(int)
    k, m = (i + 1) % width, np.minimum(j + 1, height - 1)
    above = (1 - right_share) * pixels[j, i] + right_share * pixels[j, k]
    below = (1 - right_share) * pixels[m, i] + right_share * pixels[m, k]
    seen: Pixels = ((1 - down_share) * above + down_share * below).astype(np.float32)
    return seen


def turned_environment(what: str, environment: Environment, turn: Array) -> Environment:
    """An environment whose image or sky is turned by a matrix (3, 3), whose columns may have any length:
    about y as it is, otherwise with a new image, which is told of `what`. Raises InputError."""
    if not abs(np.linalg.det(turn)) > 0:
        raise InputError("its placement flattens space")
    turn = turn / np.linalg.norm(turn, axis=0)
    angle = math.degrees(math.atan2(turn[0, 2], turn[2, 2]))
    if np.allclose(turn, affine.rotation_matrix((0.0, angle, 0.0)), atol=1e-5):
        return replace(environment, rotation_y=angle)
    picture = environment.picture
    assert picture is not None
    import_report.changed(f"{what}: is turned off the y axis, for which its image is made anew")
    return replace(environment, image=Image(turned(picture.pixels, turn)), sky=None)
