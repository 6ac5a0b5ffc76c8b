"""The shown picture: what stands out of the noise of a change, on top of the refined old picture.

See cl/impact/shrinkage.cl for what its kernels do. The sums of pairs are never smoothed, so that the picture
converges to the truth however wrong a guess was on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pyopencl as cl

from incpt.core import layout
from incpt.device.device import Device
from incpt.render.film import Film, Float32Array
from incpt.render.impact.guides import Guides
from incpt.render.impact.patches import Patches
from incpt.render.impact.statistics import Statistics, spread_cells
from incpt.render.impact.sums import PAIR_SUMS

_FILE = "shrinkage"
_DETAILS = layout.SMOOTHING_SCALES + 1
_CELL_EVIDENCE = layout.CLASSES * len(layout.Evidence) * _DETAILS


class Shrinkage:
    """Makes pictures of `width` x `height` pixels from sums of pairs; holds the planes to work in."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.patches = patches = Patches(device, width, height)
        pixels = width * height
        self.image_buffer = self._touched(16 * pixels)
        """The picture as of the last `update`: red, green, blue and 1, or 0 where there is no sample."""
        self.shown = {"shown_image": self.image_buffer, "shown_shares": device.empty(4 * pixels)}
        """Kernel arguments: that picture, and how much of the noise of its change each pixel near one shows
        there."""
        self._target_buffer = self._touched(16 * pixels)
        self._target: Float32Array | None = None
        self._halves = tuple(self._field(len(layout.HalfPlane)) for _ in range(2))
        self._planes = {
            "details": self._touched(4 * 3 * _DETAILS * pixels),
            "base_light": self._touched(4 * 3 * pixels),
            "evidence": self._field(layout.LOCAL_SCALES * len(layout.Evidence)),
            "cell_evidence": device.empty(4 * _CELL_EVIDENCE * patches.cells),
            "pooled_evidence": device.empty(4 * _CELL_EVIDENCE * patches.cells),
            "column_evidence": self._touched(4 * _CELL_EVIDENCE * width * patches.cell_rows),
        }

    def set_target(self, image: Float32Array) -> None:
        """The picture to start from where labels say so: (H, W, 4), as `Film.image` has it."""
        if image is not self._target:
            self.patches.device.write(self._target_buffer, image)
            self._target = image

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
        self.patches.launch("fold_change", "fold_change", self._values(film, guides, statistics))
        film.note_change()
        film.clear(PAIR_SUMS)

    def idle_launches(self, film: Film, guides: Guides, statistics: Statistics) -> list[Callable[[], None]]:
        """The launches of all kernels, with nothing to do; see `Device.built`."""
        values, nothing = self._values(film, guides, statistics), self.patches.nothing
        return [
            partial(self._run, nothing, values),
            partial(nothing.launch, "fold_change", "fold_change", values),
        ]

    def _field(self, planes: int) -> cl.Buffer:
        """So many planes with margins, which are read and never written."""
        return self._touched(4 * planes * self.patches.field_size)

    def _touched(self, nbytes: int) -> cl.Buffer:
        """Memory of zeros: what a system gives out at the first write would cost the first picture several
        times the time of others."""
        buffer = self.patches.device.empty(nbytes)
        self.patches.device.fill(buffer, 0, nbytes)
        return buffer

    def _values(self, film: Film, guides: Guides, statistics: Statistics) -> dict[str, Any]:
        return {
            **self._planes,
            "anchor_sums": film.radiance_sums(),
            "pairs": film.planes(PAIR_SUMS),
            "labels": guides.labels,
            "guides": guides.weights,
            "cells": statistics.cells,
            "column_rules": statistics.column_rules,
            "spans": statistics.spans,
            "target_image": self._target_buffer,
            **self.shown,
        }

    def _run(self, patches: Patches, values: Mapping[str, Any]) -> None:
        fine, coarse = self._halves
        patches.launch("split_change", _FILE, {**values, "halves": fine, "smooth_halves": coarse})
        for scale in range(layout.SMOOTHING_SCALES):
            own = {**values, "scale_index": scale, "halves": fine, "smooth_halves": coarse}
            features = ("LAST_SCALE",) if scale == layout.SMOOTHING_SCALES - 1 else ()
            patches.launch("smooth_change", _FILE, own, features=features)
            fine, coarse = coarse, fine
        patches.launch_cells("pool_evidence", _FILE, values, _CELL_EVIDENCE)
        pooled, columns = values["pooled_evidence"], values["column_evidence"]
        spread_cells(patches, _CELL_EVIDENCE, pooled, columns)
        patches.launch("show_change", _FILE, values)
