"""What makes a picture of pairs: guides, statistics and shrinkage, with the memory that they work in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from weakref import ref

import numpy as np
import numpy.typing as npt

from incpt.device.device import Device
from incpt.render.film import Film, Float32Array
from incpt.render.impact.guides import Guides
from incpt.render.impact.shrinkage import Shrinkage
from incpt.render.impact.statistics import Statistics
from incpt.render.impact.tile_sums import TileSums
from incpt.render.tiles import TileGrid


@dataclass(frozen=True, eq=False)
class SeenPair:
    """What the pixel centres show of two scenes: the arguments of `Guides.set`, all (H, W) or (H, W, 3).
    `target` (H, W, 4): the picture to start from at the pixels `in_target`."""

    labels: npt.NDArray[np.uint32]
    normals: npt.NDArray[np.float32]
    changed: npt.NDArray[np.bool_]
    in_target: npt.NDArray[np.bool_] | None = None
    target: Float32Array | None = None


class Estimator:
    """Makes pictures of `width` x `height` pixels of the pairs in a film. There is one for all comparisons of
    a session, since its planes take longer to make than a small edit to answer; whoever uses it says what
    the pixels show."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.size = (width, height)
        self.guides = Guides(device, width, height)
        self.statistics = Statistics(device, width, height)
        self.shrinkage = Shrinkage(device, width, height)
        self._seen: SeenPair | None = None
        self._source: tuple[ref[Film], int, ref[SeenPair]] | None = None
        """What the picture was made of."""

    def update(self, film: Film, seen: SeenPair) -> None:
        """Make the picture of what the film has of pairs, unless it is there: it is looked at when a round is
        planned and when it is shown."""
        source = ref(film), film.revision, ref(seen)
        if self._source == source:
            return
        if seen is not self._seen:
            self.guides.set(seen.labels, seen.normals, seen.changed, seen.in_target)
            if seen.target is not None:
                self.shrinkage.set_target(seen.target)
            self._seen = seen
        self.statistics.update(film, self.guides)
        self.shrinkage.update(film, self.guides, self.statistics)
        self._source = source

    def image(self, film: Film, seen: SeenPair) -> Float32Array:
        """(H, W, 4) the picture, as `Film.image` has it. It waits for the device."""
        self.update(film, seen)
        return self.shrinkage.image()

    def fold(self, film: Film, seen: SeenPair) -> None:
        """Make the picture the kept one of the film, and forget the pairs."""
        self.update(film, seen)
        self.shrinkage.fold(film, self.guides, self.statistics)

    def tile_sums(self, film: Film, seen: SeenPair, grid: TileGrid) -> TileSums:
        """What the film has of pairs, tile by tile. It waits for the device."""
        self.update(film, seen)
        return self.statistics.tile_sums(film, self.guides, grid, self.shrinkage.shown)

    def idle_launches(self, film: Film) -> list[Callable[[], None]]:
        """The launches of all kernels, with nothing to do; see `Device.built`."""
        return [
            *self.guides.idle_launches(),
            *self.statistics.idle_launches(film, self.guides),
            *self.shrinkage.idle_launches(film, self.guides, self.statistics),
        ]
