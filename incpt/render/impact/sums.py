"""Sums of what pairs of paths brought, pixel by pixel: the state of the strategy.

A film keeps them beside its passes (layout.PairPlane). All radiances are differences from the kept picture of
the old scene, so that they stay small where nothing changed and no digits are lost.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings, layout
from incpt.device.device import BUILD_SIZES
from incpt.render.batch import Batch
from incpt.render.film import Film, FilmPlanes

PAIR_SUMS = FilmPlanes("pairs", len(layout.PairPlane))
"""What a film has to hold for the strategy."""
_RUN = 64
"""Pixels of a row that a work-item does on CPUs under clang; see cl/impact/reduce_pairs.cl."""


class OldValues(Protocol):
    """What is known of the paths of a batch in the old scene.

    partner_place     uint of each path: the place of its partner; layout.NO_INDEX where it met nothing that
                      changed, so that it brings the same in both scenes; layout.NO_PARTNER where it did, but
                      was not traced in the old one.
    partner_radiance  what partners brought: red, green and blue, planes of `stride` floats.
    """

    @property
    def partner_place(self) -> cl.Buffer: ...

    @property
    def partner_radiance(self) -> cl.Buffer: ...

    @property
    def stride(self) -> int: ...


def reduce_pairs(film: Film, batch: Batch, slots: npt.NDArray[np.void], old: OldValues) -> None:
    """Add the paths of `batch` to the sums of pairs; `slots` (N,) layout.SLOT are those of the batch.

    A tile is added at once, also where more of its samples follow in other steps. Samples that are not finite
    count as black, and are counted by the film. Slots with gaps may lie over others, but no two with the same
    distance of pixels, one of which has a path for a pixel, may hold it twice.
    """
    tile_size = int(batch.params["tile_size"])
    film.note_change()
    # Slots of one distance never share a pixel, so that work-items of one launch don't write to one place.
    for step in np.unique(slots["pixel_step"]):
        groups = np.unique(slots["group_first"][slots["pixel_step"] == step]).astype(np.uint32)
        run = _RUN if film.device.is_clang_cpu else 1
        items = len(groups) * tile_size * -(-tile_size // run)
        _launch(film, batch, old, film.device.upload(groups), len(groups), items)


def idle_launches(film: Film, batch: Batch, old: OldValues) -> list[Callable[[], None]]:
    """The launches of the kernel, with nothing to do; see `Device.built`."""
    return [partial(_launch, film, batch, old, film.counters, 0, size) for size in BUILD_SIZES]


def _launch(film: Film, batch: Batch, old: OldValues, groups: cl.Buffer, count: int, size: int) -> None:
    values = {
        "params": batch.params,
        "slots": batch.slots,
        "group_total": count,
        "groups": groups,
        "samples": batch.path_buffer,
        "counters": film.counters,
        "anchor_sums": film.radiance_sums(),
        "pairs": film.planes(PAIR_SUMS),
        "partner_of_path": old.partner_place,
        "partner_radiance": old.partner_radiance,
        "partner_stride": old.stride,
    }
    kernel = film.device.kernel("reduce_pairs")
    film.device.launch(kernel, size, *bindings.arguments(bindings.KERNELS["reduce_pairs"], values))
