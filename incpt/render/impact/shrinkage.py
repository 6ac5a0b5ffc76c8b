"""The shown picture: what stands out of the noise of a change, on top of the refined old picture.

See cl/impact/shrinkage.cl for what its kernels do. The sums of pairs are never smoothed, so that the picture
converges to the truth however wrong a guess was on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from incpt.core import layout
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.film import Film, Float32Array
from incpt.render.impact.guides import Guides
from incpt.render.impact.patches import Patches
from incpt.render.impact.statistics import Statistics
from incpt.render.impact.sums import PAIR_SUMS

_FILE = "shrinkage"
_FIELDS = {
    "halves": len(layout.HalfPlane),
    "smooth_halves": len(layout.HalfPlane),
    "details": len(layout.DetailPlane),
    "evidence": len(layout.EvidencePlane),
    "pooled": len(layout.EvidencePlane),
    "shown": 3,
}
"""The planes with a margin that the kernels work in."""
_POOLING_PASSES = 2


class Shrinkage:
    """Makes pictures of `width` x `height` pixels from sums of pairs; holds the planes to work in."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.patches = Patches(device, width, height)
        self.image_buffer = device.empty(16 * width * height)
        """The picture as of the last `update`: red, green, blue and 1, or 0 where there is no sample."""
        size = 4 * self.patches.field_size
        self._fields = {name: device.empty(planes * size) for name, planes in _FIELDS.items()}
        for name, planes in _FIELDS.items():
            device.fill(self._fields[name], 0, planes * size)

    def update(self, film: Film, guides: Guides, statistics: Statistics) -> None:
        """Make the picture that the film has, by statistics that are up to date."""
        self._run(self.patches, self._values(film, guides, statistics))

    def image(self) -> Float32Array:
        """(H, W, 4) the picture of the last `update`, as `Film.image` has it."""
        shape = (self.patches.height, self.patches.width, 4)
        return self.patches.device.read(self.image_buffer, np.empty(shape, np.float32))

    def fold(self, film: Film, guides: Guides, statistics: Statistics) -> None:
        """Make the picture of the last `update` the kept one of the film, with as many samples as each pixel
        is worth, and forget the pairs."""
        values = self._values(film, guides, statistics)
        self.patches.launch("fold_change", "fold_change", values)
        film.clear(PAIR_SUMS)

    def idle_launches(self, film: Film, guides: Guides, statistics: Statistics) -> list[Callable[[], None]]:
        """The launches of all kernels, with nothing to do; see `Device.built`."""
        values, nothing = self._values(film, guides, statistics), self.patches.nothing
        launches: list[Callable[[], None]] = []
        for size in BUILD_SIZES:
            launches += [
                partial(self._run, nothing, values, size),
                partial(nothing.launch, "fold_change", "fold_change", values, size),
            ]
        return launches

    def _values(self, film: Film, guides: Guides, statistics: Statistics) -> dict[str, Any]:
        return {
            **self._fields,
            "anchor_sums": film.radiance_sums(),
            "pairs": film.planes(PAIR_SUMS),
            "labels": guides.labels,
            "guides": guides.weights,
            "cells": statistics.cells,
            "cell_sums": statistics.cells,
            "activities": statistics.activities,
            "shown_image": self.image_buffer,
        }

    def _run(self, patches: Patches, values: Mapping[str, Any], least: int = 1) -> None:
        def launch(name: str, **own: Any) -> None:
            patches.launch(name, _FILE, {**values, **own}, least)

        launch("split_change")
        fine, coarse = values["halves"], values["smooth_halves"]
        for scale in range(layout.SMOOTHING_SCALES + 1):
            if scale < layout.SMOOTHING_SCALES:
                launch("smooth_change", scale_index=scale, halves=fine, smooth_halves=coarse)
            else:
                launch("rest_of_change", halves=fine)
            fine, coarse = coarse, fine
            last = layout.SMOOTHING_STEPS - 1
            launch("pool_evidence", scale_index=scale)
            launch("shrink_detail", scale_index=min(scale + 1, last))
        launch("store_picture")
