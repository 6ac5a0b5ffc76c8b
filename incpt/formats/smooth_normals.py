"""Normals at vertices, of the faces around them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def smooth_normals(corners: npt.NDArray[np.floating[Any]], place: npt.NDArray[np.int64], count: int) -> Array:
    """(count, 3) of any length: at each place the sum over the faces there, weighted by their angles
    (Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets", JGT 1998). `corners` (F, 3, 3)
    of triangles stand at the places (F, 3); faces without area count nothing."""
    with np.errstate(all="ignore"):
        along = np.roll(corners, -1, axis=1) - corners
        along /= np.linalg.norm(along, axis=2, keepdims=True)
        flat = np.cross(along[:, 0], along[:, 1])
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        cosines = -(along * np.roll(along, 1, axis=1)).sum(axis=2)
        weighted = np.nan_to_num(np.arccos(np.clip(cosines, -1, 1))[..., None] * flat[:, None, :])
    sums = np.zeros((count, 3))
    for axis in range(3):
        sums[:, axis] = np.bincount(place.ravel(), weighted[..., axis].ravel(), count)
    return sums
