"""First sight: what an edit moved or recoloured is drawn as it is now, before any sample of it is there.

Until the first samples come in, the picture from before the edit shows an object where it was and not where
it is. The rays through pixel centres tell what is there now: object, normal, base colour (`first_hits`). What
they do not tell, the light, is taken from the picture from before, as *exposure*: radiance over base colour.

- A pixel that shows an object at its new place gets the exposure that surfaces of the same normal had at the
  old one: a table over normals as the camera sees them, as for lit spheres (Sloan et al. 2001).
- A pixel that shows the object where it was, in another base colour and otherwise the same material, keeps
  its exposure.
- A pixel that showed the object, and shows something else now, gets the exposure of the pixels to the left
  and to the right that showed the same thing all the time: shadows and reflections of the object lie below
  it more often than beside it.

Holes, in tables as in pictures, are filled from coarser and coarser means (pull-push; Gortler et al. 1996).

It is a guess for the eye. It is in nothing that is summed up, measured or folded, and a tile gives it up with
its first samples. Shadows and reflections wait for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from incpt.render.film import Film, Float32Array
from incpt.render.first_hits import Window
from incpt.render.impact.center_hits import CenterHits, Mask
from incpt.render.tiles import TileGrid
from incpt.scene.material import Material
from incpt.scene.model import Object

LARGEST_SHARE = 0.25
"""The largest part of the picture that is drawn so: where more is shown anew, nothing of it is old."""
_LEAST_REFLECTANCE = 0.01
"""Base colours below count as that much, so that lamps and mirrors have an exposure as well."""
_LITTLE_REFLECTANCE = 0.1
"""Up to about here a channel of a base colour tells less of the light than the others do."""
_MOST_PIXELS = 16384
"""Pixels of an object, evenly chosen, from which exposures are learnt."""
_TABLE_SIZE = 24
"""Entries of a table over normals, a side."""
_MARGIN_SHARE, _LEAST_MARGIN = 0.15, 8
"""How far beside what is uncovered exposures are looked for, as a share of its width, and in pixels, which
also go above and below."""
_SMOOTHED_ROWS = 9
"""Over so many rows exposures from beside are smoothed: each row has noise of its own."""
_RIM = 2
"""So many pixels around what was moved show some of it, since pixels are areas."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Pixels of a window (h, w) that are drawn, and their radiance and coverage (h, w, 4)."""

    window: Window
    is_drawn: Mask
    radiance: Float32Array


class FirstSight:
    """That of a scene, seen as `now` says, which starts from the picture of another one, seen as `then` says:
    `picture` (H, W, 4) as `Film.image` has it, or else the kept one of the film. `windows`: where they look
    different. It is made when it is asked for first; `before` is another one, whose picture serves where it
    starts from the same scene."""

    def __init__(
        self,
        then: CenterHits,
        now: CenterHits,
        windows: Sequence[Window],
        picture: Float32Array | None = None,
        before: FirstSight | None = None,
    ) -> None:
        self._then, self._now, self._windows = then, now, _joined(windows)
        self._pictures: list[Float32Array] = [] if picture is None else [picture]
        if picture is None and before is not None and before._then.scene is then.scene:
            self._pictures = before._pictures
        self._patches: list[Patch] | None = None

    def alone(self, film: Film) -> Float32Array | None:
        """(H, W, 4) the picture from before with all that is drawn; None where nothing is. It waits for no
        kernel once that picture was read."""
        if not self._patches_on(film):
            return None
        image = self._pictures[0].copy()
        for patch in self._patches_on(film):
            image[rows_columns(patch.window)][patch.is_drawn] = patch.radiance[patch.is_drawn]
        return image

    def drawn_into(self, image: Float32Array, film: Film, grid: TileGrid, is_waiting: Mask) -> Float32Array:
        """`image` (H, W, 4) with what is drawn of the tiles (grid.count,) that wait for their first sample.
        `film`: the session's."""
        for patch in self._patches_on(film):
            inside = rows_columns(patch.window)
            left, top, right, bottom = patch.window
            x, y = np.arange(left, right, dtype=np.int32), np.arange(top, bottom, dtype=np.int32)
            tile = grid.tile_at(x[None, :], y[:, None])
            chosen = patch.is_drawn & is_waiting[tile]
            image[inside][chosen] = patch.radiance[chosen]
        return image

    def _patches_on(self, film: Film) -> list[Patch]:
        if self._patches is None:
            self._patches = self._made(film)
        return self._patches

    def _made(self, film: Film) -> list[Patch]:
        height, width = self._then.objects.shape
        area = sum((right - left) * (bottom - top) for left, top, right, bottom in self._windows)
        if area > LARGEST_SHARE * width * height:
            return []
        if not film.is_whole:  # There is no picture to take all light from.
            return []
        if not self._pictures:
            self._pictures.append(film.image())
        picture = self._pictures[0]
        patches = [self._patch(window, picture, film.is_transparent) for window in self._windows]
        return [patch for patch in patches if patch.is_drawn.any()]

    @cached_property
    def _moved(self) -> tuple[Mask, Mask]:
        """Which objects of the scene before, and which of the scene now, are moved in the other one."""
        old, new = self._then.scene.objects, self._now.scene.objects
        return moved(old, new), moved(new, old)

    @cached_property
    def _restyled(self) -> tuple[Mask, Mask]:
        """Which objects of the scene now wear another material where they were, and which of them one that
        differs in nothing but its base colour. The last place is that of no object."""
        old, new = self._then.scene, self._now.scene
        was_there = {obj.name: old.materials[obj.material] for obj in old.objects}
        materials = [new.materials[obj.material] for obj in new.objects]
        pairs = [(was_there.get(obj.name, now), now) for obj, now in zip(new.objects, materials, strict=True)]
        stays = ~self._moved[1]
        restyled = np.array([old != now for old, now in pairs] + [False])
        recoloured = np.array([_is_recoloured(old, now) for old, now in pairs] + [False])
        return restyled & stays, restyled & stays & recoloured

    def _patch(self, window: Window, picture: Float32Array, is_transparent: bool) -> Patch:
        inside = rows_columns(window)
        was_moved, is_moved = self._moved
        objects = self._now.objects[inside]
        shows_moved = is_moved[objects]
        # Pixels around it, which show a bit of it, go with those that showed it.
        uncovered = widened(was_moved[self._then.objects[inside]], 1) & ~shows_moved
        light = np.zeros((*objects.shape, 3), np.float32)
        for number in np.unique(objects[shows_moved]):
            chosen = shows_moved & (objects == number)
            light[chosen] = self._exposures_of(
                int(number), self._now.normals[inside][chosen], picture, window
            )
        for number in np.unique(objects[uncovered]):
            chosen = uncovered & (objects == number)
            light[chosen] = self._exposures_beside(int(number), chosen, window, picture)
        reflectance = _reflectance(objects, self._now.colors[inside])
        is_restyled, is_recoloured = self._restyled
        shows_restyled = is_restyled[objects] & ~uncovered
        chosen = is_recoloured[objects] & shows_restyled
        light[shows_restyled] = (picture[inside][..., :3] / reflectance)[shows_restyled]
        light[chosen] = self._evened_exposures(inside, picture)[chosen]
        radiance = light * reflectance
        covered = (objects >= 0) | np.bool_(not is_transparent)
        shown = np.concatenate([radiance, covered[..., None]], axis=-1, dtype=np.float32)
        return Patch(window, shows_moved | uncovered | shows_restyled, shown)

    def _exposures_of(
        self, number: int, normals: Float32Array, picture: Float32Array, window: Window
    ) -> Float32Array:
        """(n, 3) exposures of an object of the scene where it has these normals (n, 3)."""
        then = self._then
        place = then.scene.object_index.get(self._now.scene.objects[number].name)
        seen = np.flatnonzero(then.objects.ravel() == place) if place is not None else np.zeros(0, np.intp)
        if len(seen) == 0:  # It was not there, or out of sight.
            around = self._exposures(rows_columns(window), picture).reshape(-1, 3)
            return np.broadcast_to(np.median(around, axis=0), normals.shape)
        seen = seen[:: -(-len(seen) // _MOST_PIXELS)]
        places = self._places(then.normals.reshape(-1, 3)[seen])
        colors = then.colors.reshape(-1, 3)[seen]
        light = picture.reshape(-1, 4)[seen, :3]
        exposures = np.divide(light, np.maximum(colors, _LEAST_REFLECTANCE), dtype=np.float32)
        return _looked_up(_table_of(exposures, places), self._places(normals))

    def _places(self, normals: Float32Array) -> npt.NDArray[np.float64]:
        """(n, 2) where normals (n, 3) stand in a table, column and row: as the camera sees them."""
        right, up, _ = self._now.scene.camera.image_plane(1.0)
        axes = np.stack([right / np.linalg.norm(right), up / np.linalg.norm(up)], axis=1)
        return np.asarray((0.5 * (normals @ axes) + 0.5) * (_TABLE_SIZE - 1))

    def _exposures_beside(
        self, number: int, is_asked: Mask, window: Window, picture: Float32Array
    ) -> Float32Array:
        """(n, 3) exposures of an object of the scene that stayed where it is, for the pixels of a window
        (h, w) that are asked for, row by row."""
        height, width = self._then.objects.shape
        rows, columns = (np.flatnonzero(is_asked.any(axis=axis)) for axis in (1, 0))
        left, right = window[0] + columns[0], window[0] + columns[-1] + 1
        top, bottom = window[1] + rows[0], window[1] + rows[-1] + 1
        beside = _LEAST_MARGIN + int(_MARGIN_SHARE * (right - left))
        wide_left, wide_top = max(left - beside, 0), max(top - _LEAST_MARGIN, 0)
        wide = rows_columns(
            (wide_left, wide_top, min(right + beside, width), min(bottom + _LEAST_MARGIN, height))
        )
        objects = self._then.objects[wide]
        place = self._then.scene.object_index[self._now.scene.objects[number].name] if number >= 0 else -1
        is_free = ~widened(self._moved[0][objects], _RIM)
        is_known = is_free & (objects == place)
        is_known = is_known if is_known.any() else is_free
        filled = _smoothed_down(
            _filled(self._exposures(wide, picture), is_known.astype(np.float32)), _SMOOTHED_ROWS
        )
        row, column = np.nonzero(is_asked)
        asked: Float32Array = filled[row + window[1] - wide_top, column + window[0] - wide_left]
        return asked

    def _evened_exposures(self, inside: tuple[slice, slice], picture: Float32Array) -> Float32Array:
        """(h, w, 3) as `_exposures`, but a channel of which the colour reflects little takes those of all
        for its own: most of what it shows is a sheen that has no colour."""
        then, radiance = self._then, picture[inside][..., :3]
        reflectance = _reflectance(then.objects[inside], then.colors[inside])
        grey = radiance.sum(axis=-1, keepdims=True) / reflectance.sum(axis=-1, keepdims=True)
        evened: Float32Array = (radiance + _LITTLE_REFLECTANCE * grey) / (reflectance + _LITTLE_REFLECTANCE)
        return evened

    def _exposures(self, inside: tuple[slice, slice], picture: Float32Array) -> Float32Array:
        """(h, w, 3) of the picture from before."""
        then = self._then
        exposures: Float32Array = picture[inside][..., :3] / _reflectance(
            then.objects[inside], then.colors[inside]
        )
        return exposures


def rows_columns(window: Window) -> tuple[slice, slice]:
    """The window as slices of an image."""
    left, top, right, bottom = window
    return slice(top, bottom), slice(left, right)


def _joined(windows: Sequence[Window]) -> tuple[Window, ...]:
    """Windows around those that overlap, of which no two do."""
    found: list[Window] = []
    for window in windows:
        left, top, right, bottom = window
        while near := [w for w in found if w[0] < right and left < w[2] and w[1] < bottom and top < w[3]]:
            found = [w for w in found if w not in near]
            left, top = min(left, *(w[0] for w in near)), min(top, *(w[1] for w in near))
            right, bottom = max(right, *(w[2] for w in near)), max(bottom, *(w[3] for w in near))
        found.append((left, top, right, bottom))
    return tuple(found)


def moved(objects: Sequence[Object], others: Sequence[Object]) -> Mask:
    """Which objects stand elsewhere, or have another shape, than their namesakes among the others, or have
    none there. The last place, that of no object, is never among them."""
    shapes = {other.name: _shape(other) for other in others}
    return np.array([_shape(one) != shapes.get(one.name) for one in objects] + [False])


def _shape(one: Object) -> tuple[object, ...]:
    # Meshes are compared by identity, see Mesh.
    return id(one.mesh), one.transform, one.visible


def _is_recoloured(old: Material, new: Material) -> bool:
    as_before = replace(new, base_color=old.base_color, base_color_texture=old.base_color_texture)
    return not any(old.emission) and as_before == old


def _reflectance(objects: npt.NDArray[np.int32], colors: Float32Array) -> Float32Array:
    # Where nothing is hit, light comes from far away as it is.
    return np.where(objects[..., None] < 0, np.float32(1), np.maximum(colors, np.float32(_LEAST_REFLECTANCE)))


def widened(mask: Mask, pixels: int) -> Mask:
    """What is within so many pixels of the mask, across and down."""
    for axis in (0, 1):
        ends = np.pad(mask, [(pixels + 1, pixels) if one == axis else (0, 0) for one in (0, 1)])
        counts, places = np.cumsum(ends, axis=axis, dtype=np.int32), np.arange(mask.shape[axis])
        mask = np.take(counts, places + 2 * pixels + 1, axis) > np.take(counts, places, axis)
    return mask


def _filled(values: Float32Array, weights: Float32Array) -> Float32Array:
    """(h, w, 3) values, and where their weight (h, w) is 0, means of those around that have one: along rows,
    and where a row has none, of the rows around."""
    axis = 1 if weights.shape[1] > 1 else 0
    if weights.shape[axis] == 1:
        return values
    sums, counts = _halved(values * weights[..., None], axis), _halved(weights, axis)
    means = np.divide(sums, np.maximum(counts, 1e-20)[..., None], dtype=np.float32)
    coarse = _filled(means, np.minimum(counts, np.float32(1)))
    around = _doubled(coarse, weights.shape[axis], axis)
    return np.where(weights[..., None] > 0, values, around)


def _corners(places: npt.NDArray[np.float64]) -> list[tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]]:
    """The four entries of a table around places (n, 2), column and row, and what each counts for there."""
    first = np.clip(places.astype(np.intp), 0, _TABLE_SIZE - 2)
    (x, y), (right, down) = first.T, np.clip(places - first, 0, 1).T
    entry = y * _TABLE_SIZE + x
    return [
        (entry, (1 - right) * (1 - down)),
        (entry + 1, right * (1 - down)),
        (entry + _TABLE_SIZE, (1 - right) * down),
        (entry + _TABLE_SIZE + 1, right * down),
    ]


def _table_of(values: Float32Array, places: npt.NDArray[np.float64]) -> Float32Array:
    """(_TABLE_SIZE, _TABLE_SIZE, 3) the mean of the values (n, 3) at places (n, 2) near each entry. Each
    place gives its value to four entries, so that it finds it there again."""
    size, shape = _TABLE_SIZE**2, (_TABLE_SIZE, _TABLE_SIZE)
    counts, sums = np.zeros(size), np.zeros((size, 3))
    for entry, share in _corners(places):
        counts += np.bincount(entry, share, size)
        for channel in range(3):
            sums[:, channel] += np.bincount(entry, share * values[:, channel], size)
    means: Float32Array = (sums / np.maximum(counts, 1e-12)[:, None]).astype(np.float32)
    is_known = (counts > 0).reshape(shape).astype(np.float32)
    return _filled(means.reshape(*shape, 3), is_known)


def _looked_up(table: Float32Array, places: npt.NDArray[np.float64]) -> Float32Array:
    """(n, 3) values of a table at places (n, 2), between its entries."""
    flat = table.reshape(-1, 3)
    parts = [flat[entry] * share[:, None].astype(np.float32) for entry, share in _corners(places)]
    return (parts[0] + parts[1]) + (parts[2] + parts[3])


def _smoothed_down(image: Float32Array, rows: int) -> Float32Array:
    """Means over so many rows, an odd number, around each."""
    ends = np.pad(image, [(rows // 2, rows // 2), (0, 0), (0, 0)], mode="edge")
    sums: Float32Array = np.sum([ends[i : i + len(image)] for i in range(rows)], axis=0)
    return sums / np.float32(rows)


def _halved(image: Float32Array, axis: int) -> Float32Array:
    """Sums over two neighbours along an axis."""
    odd = image.shape[axis] % 2
    padded = (
        np.pad(image, [(0, odd) if one == axis else (0, 0) for one in range(image.ndim)]) if odd else image
    )
    even = np.arange(0, padded.shape[axis], 2)
    return np.take(padded, even, axis) + np.take(padded, even + 1, axis)


def _doubled(image: Float32Array, size: int, axis: int) -> Float32Array:
    """`size` values along an axis in place of half as many: three quarters of the nearest one and a quarter
    of the next."""
    fine = np.arange(size)
    near = fine // 2
    far = np.clip(near + np.where(fine % 2, 1, -1), 0, image.shape[axis] - 1)
    return np.float32(0.75) * np.take(image, near, axis) + np.float32(0.25) * np.take(image, far, axis)
