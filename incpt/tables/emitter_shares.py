"""Which faces of an emitter shine how much, where a texture makes them differ.

Light sampling chooses triangles by their power. A texture of emission, a sign or a window at night, is black
over most of a mesh, so that each face has a share: the mean over the face of what its texture lets through,
by luminance. Means over pixels at points of the face are near enough, because a share only says how often a
face is chosen; what it emits is read from the texture itself.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.texture import Bitmap, Texture
from incpt.tables.texels import linear_colors

Array = npt.NDArray[np.float64]

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_LEAST_POINTS, _MOST_POINTS = 16, 4096
"""At which a face is looked at: about one for each pixel of the texture that it covers."""
_POINTS_AT_ONCE = 1 << 20

_shares: WeakKeyDictionary[Mesh, dict[tuple[Texture, tuple[float, ...]], Array]] = WeakKeyDictionary()
_MOST_KNOWN = 4
"""Shares that are remembered of a mesh: while an edit is compared, those of two scenes take turns."""
_ROWS_AT_ONCE = 256


def face_shares(mesh: Mesh, material: Material) -> Array:
    """(F,) the share of its material's radiance, by luminance, that each face emits: 1 without a texture."""
    texture = material.emission_texture
    if texture is None or not material.is_emissive:
        return np.ones(len(mesh.faces))
    known = _shares.setdefault(mesh, {})
    key = texture, material.emission
    if key not in known:
        if len(known) >= _MOST_KNOWN:
            known.clear()
        known[key] = _face_shares(mesh, texture, np.asarray(material.emission) * _LUMINANCE)
    return known[key]


def corner_places(mesh: Mesh, texture: Texture | None) -> Array:
    """(F, 3, 2) the texture coordinates of a texture at the corners of faces; 0 where there are none."""
    if texture is None or texture.uv_set >= len(mesh.uvs):
        return np.zeros((len(mesh.faces), 3, 2))
    return mesh.uvs[texture.uv_set].astype(np.float64)


def _face_shares(mesh: Mesh, texture: Texture, weights: Array) -> Array:
    values = _luminance(texture.bitmap, (weights / weights.sum()).astype(np.float32))
    height, width = values.shape
    corners = corner_places(mesh, texture) @ texture.matrix[:, :2].T + texture.matrix[:, 2]
    edges = (corners[:, 1:] - corners[:, :1]) * [width, height]
    covered = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    points = np.clip(2.0 ** np.ceil(np.log2(np.maximum(covered, 1.0))), _LEAST_POINTS, _MOST_POINTS)
    shares = np.zeros(len(corners))
    for count in np.unique(points).astype(int):
        weight = _points_of_triangle(count)
        chosen = np.flatnonzero(points == count)
        for some in np.array_split(chosen, max(len(chosen) * count // _POINTS_AT_ONCE, 1)):
            places = np.einsum("pc,fcd->fpd", weight, corners[some])
            shares[some] = _looked_up(values, places, texture.wrap).mean(axis=1)
    return shares


def _points_of_triangle(count: int) -> Array:
    """(count, 3) weights of corners at points that are spread evenly over a triangle."""
    index = np.arange(count)
    root, v = np.sqrt((index + 0.5) / count), index * ((5**0.5 - 1) / 2) % 1
    return np.stack([1 - root, root * (1 - v), root * v], axis=1)


def _looked_up(values: npt.NDArray[np.float32], places: Array, wrap: tuple[str, str]) -> Array:
    """The pixels nearest to places (..., 2) in the image."""
    indices = []
    for axis, (size, how) in enumerate(zip(values.shape[::-1], wrap, strict=True)):
        x = places[..., axis]
        if how == "repeat":
            x = x - np.floor(x)
        elif how == "mirror":
            x = 1 - np.abs(x - 2 * np.floor(x / 2) - 1)
        indices.append(np.clip((x * size).astype(np.int64), 0, size - 1))
    return np.asarray(values[indices[1], indices[0]], np.float64)


def _luminance(bitmap: Bitmap, weights: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(H, W) the weighted sum of its linear colours, some rows at a time: a bitmap may be large."""
    values = np.empty((bitmap.height, bitmap.width), np.float32)
    for first in range(0, bitmap.height, _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        values[rows] = np.maximum(linear_colors(Bitmap(bitmap.pixels[rows])), 0) @ weights
    return values
