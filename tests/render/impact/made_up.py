"""Made-up pairs of samples for tests, and a film that holds them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from render.impact import reference

from incpt.device.device import Device
from incpt.render.film import RADIANCE, Film
from incpt.render.impact.guides import Guides
from incpt.render.impact.shrinkage import Shrinkage
from incpt.render.impact.statistics import Statistics
from incpt.render.impact.sums import PAIR_SUMS
from incpt.render.impact.tile_sums import TileSums
from incpt.render.tiles import TileGrid

Array = npt.NDArray[np.float64]
KEPT = 64.0


@dataclass
class Edit:
    """A change of a picture: (H, W, 3) true radiance before and after, the noise of a sample relative to it,
    (H, W) the share of paths that meet the change, and what each pixel shows."""

    old: Array
    new: Array
    noise: float
    touched: Array
    guides: reference.Guides

    def samples(self, rng: np.random.Generator) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
        """A pair of samples for every pixel, and whether its path met the change. Those that did not bring
        the same in both scenes."""
        met = rng.random(self.touched.shape) < self.touched
        share = np.maximum(self.touched, 1e-9)[..., None]
        common = self.old * (1 + self.noise * rng.normal(size=self.old.shape))
        changed = common + (self.new - self.old) / share * (1 + self.noise * rng.normal(size=self.old.shape))
        return np.where(met[..., None], changed, common), common, met

    def state(self, rng: np.random.Generator, kept: npt.ArrayLike = KEPT) -> reference.State:
        """Nothing sampled yet, with a kept picture of so many samples."""
        kept = np.broadcast_to(np.asarray(kept, np.float64), self.old.shape[:2])
        error = rng.normal(size=self.old.shape) / np.sqrt(np.maximum(kept, 1))[..., None]
        anchor = np.where(kept[..., None] > 0, self.old * (1 + self.noise * error), 0)
        return reference.State.empty(anchor, kept)


def edit(width: int, height: int, rng: np.random.Generator, noise: float = 0.4) -> Edit:
    """A disc that moved over a wall, with a shadow around its new place."""
    y, x = np.mgrid[:height, :width]
    before = np.hypot(x - 0.3 * width, y - 0.5 * height) < 0.2 * height
    after = np.hypot(x - 0.55 * width, y - 0.5 * height) < 0.2 * height
    wall = np.repeat(0.3 + 0.4 * x[..., None] / width, 3, axis=2)
    shadow = np.exp(-(((x - 0.6 * width) ** 2 + (y - 0.6 * height) ** 2) / (0.15 * width) ** 2))
    red = np.array([0.9, 0.15, 0.1])
    old = np.where(before[..., None], red, wall)
    new = np.where(after[..., None], red * 0.9, wall * (1 - 0.4 * shadow[..., None]))
    touched = np.where(before | after, 1.0, np.where(shadow > 0.02, np.maximum(shadow, 0.1), 0.0))
    normals = np.zeros((height, width, 3))
    normals[..., 2] = 1
    bent = 0.5 * (x - 0.55 * width) / (0.2 * height)
    normals[after] = np.stack([np.sin(bent), 0 * bent, np.cos(bent)], axis=-1)[after]
    normals[:2] = 0
    guides = reference.Guides(before.astype(np.int64) + 2 * after, normals, before | after)
    return Edit(old, new, noise, touched, guides)


class Rig:
    """A film of the device with all that makes its pictures, filled from a state of the reference."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.film = Film(device, width, height, (RADIANCE,), (PAIR_SUMS,))
        self.guides = Guides(device, width, height)
        self.statistics, self.shrinkage = Statistics(device, width, height), Shrinkage(device, width, height)

    def load(self, state: reference.State, guides: reference.Guides) -> None:
        self.film.restore({RADIANCE.name: state.anchor_sums(), PAIR_SUMS.name: state.planes()})
        self.guides.set(guides.labels, guides.normals, guides.changed, guides.in_target)
        if guides.target is not None:
            target = np.concatenate([guides.target, np.ones((*guides.labels.shape, 1))], axis=-1)
            self.shrinkage.set_target(target.astype(np.float32))

    def picture(self) -> Array:
        """(H, W, 3)"""
        self.statistics.update(self.film, self.guides)
        self.shrinkage.update(self.film, self.guides, self.statistics)
        return self.shrinkage.image()[..., :3].astype(np.float64)

    def tile_sums(self, grid: TileGrid) -> TileSums:
        """Of the film, with the picture that it makes."""
        self.picture()
        return self.statistics.tile_sums(self.film, self.guides, grid, self.shrinkage.shown)

    def fold(self) -> None:
        self.shrinkage.fold(self.film, self.guides, self.statistics)
