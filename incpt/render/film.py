"""The film: sums of radiance with the number of samples behind each pixel.

Division happens in `resolve`, so tiles may have different counts. A finished tile either replaces what
the film has of it or is added; one that is under way waits in `pending`, so that nobody sees half of it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import layout
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.plan import Plan
from incpt.render.tiles import TileGrid

_PLANES = 4  # red, green, blue, samples


class Film:
    """Accumulation over an image of `width` x `height` pixels, on the device; black at first."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self.device, self.width, self.height = device, width, height
        nbytes = 4 * _PLANES * width * height
        self._sums, self._pending = device.empty(nbytes), device.empty(nbytes)
        self._image = device.empty(nbytes)
        self._nonfinite = device.empty(4)
        device.fill(self._sums, 0, nbytes)
        device.fill(self._nonfinite, 0, 4)

    def reduce(self, params: npt.NDArray[np.void], plan: Plan, slots: cl.Buffer, radiance: cl.Buffer) -> None:
        """Put the paths of a step, `radiance` in the order of its `slots`, into the film."""
        groups = np.unique(plan.slots["group_first"]).astype(np.uint32)
        size = len(groups) * int(params["tile_size"]) ** 2
        self._launch(
            "reduce", size, params, np.uint32(len(groups)), self.device.upload(groups), slots, radiance,
            self._pending, self._sums, self._nonfinite,
        )  # fmt: skip

    def take_nonfinite(self) -> int:
        """Samples that were not finite since the last call; they count as black."""
        count = int(self.device.read(self._nonfinite, np.empty(1, np.uint32))[0])
        if count:
            self.device.fill(self._nonfinite, 0, 4)
        return count

    def _launch(self, name: str, size: int, *args: Any) -> None:
        self.device.launch(self.device.kernel(name), size, *args)

    def idle_launches(self, params: npt.NDArray[np.void], radiance: cl.Buffer) -> list[Callable[[], None]]:
        """The launches of the film's kernels, each with nothing to do; see `Device.built`."""
        nothing, none = np.uint32(0), self._nonfinite
        arguments = {
            "reduce": (params, nothing, none, none, radiance, self._pending, self._sums, none),
            "resolve": (nothing, self._sums, self._image),
        }
        return [
            partial(self._launch, name, size, *arguments[name]) for name in arguments for size in BUILD_SIZES
        ]

    def image(self) -> npt.NDArray[np.float32]:
        """(height, width, 4) mean radiance, linear; alpha is 0 where there is no sample yet."""
        pixels = self.width * self.height
        self._launch("resolve", pixels, np.uint32(pixels), self._sums, self._image)
        return self.device.read(self._image, np.empty((self.height, self.width, _PLANES), np.float32))

    def sums(self) -> npt.NDArray[np.float32]:
        """(4, height, width) the sums of red, green and blue, and the number of samples."""
        return self.device.read(self._sums, np.empty((_PLANES, self.height, self.width), np.float32))

    def restore(self, sums: npt.NDArray[np.float32]) -> None:
        """Make the film hold what `sums` returned of one of the same size."""
        self.device.write(self._sums, sums)


def tile_image(grid: TileGrid, per_tile: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """(height, width) a value per tile, spread over the pixels."""
    return np.asarray(per_tile[grid.tile_of_pixels()], np.int64)


def path_buffer_stride(slot_count: int, tile_size: int) -> int:
    """Floats per plane of a path buffer for `slot_count` slots, and room where idle lanes may write."""
    return slot_count * tile_size**2 + layout.WORK_GROUP_SIZE
