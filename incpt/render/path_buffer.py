"""The path buffer: what the paths of a step bring, and how many slots it has room for."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import pyopencl as cl

from incpt.core import layout
from incpt.core.errors import DeviceError, InputError
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.film import plane_count
from incpt.render.impact.pairs import PairBuffers
from incpt.render.strategies import passes_of
from incpt.render.tiles import TileGrid

_MOST_FLOATS = 1 << 32
"""Kernels index the planes of the path buffer with 32 bits."""


@dataclass(frozen=True, eq=False)
class PathBuffer:
    """Memory for the paths of a step: `planes` planes of `stride` floats each. A plane has a place for each
    path, slot by slot, and at its end room where idle lanes may write. `pairs` has room for the partners of
    all paths, once a strategy has asked for it."""

    floats: cl.Buffer
    planes: int
    stride: int
    pairs: PairBuffers | None = None

    @classmethod
    def of_settings(cls, device: Device, settings: RenderSettings, old: PathBuffer | None) -> PathBuffer:
        """One with room for a step of the settings: `old` where it serves. Raises as `check_settings` does,
        and DeviceError where memory runs out."""
        check_settings(settings)
        planes, stride = _planes(settings), _stride(slots_of(settings), settings.tile_size)
        if old is not None and old.planes == planes and old.stride >= stride:
            return old
        return cls._made(device, planes, stride)

    def grown(self, device: Device, slots: int, tile_size: int) -> PathBuffer:
        """One with room for so many slots, or, where memory does not suffice, this one."""
        most = _MOST_FLOATS // self.planes
        stride = _stride(max(1, slots), tile_size)
        if stride > self.stride and self.stride < most:
            # Twice the room is made, because callers come back for a little more each time.
            with suppress(DeviceError):
                return self._made(device, self.planes, min(2 * stride, most))
        return self

    def with_pairs(self, device: Device) -> PathBuffer:
        """The same with room for pairs. Raises DeviceError where memory runs out."""
        pairs = PairBuffers.of(device, self.stride, self.pairs)
        return self if pairs is self.pairs else replace(self, pairs=pairs)

    def room(self, tile_size: int) -> int:
        """The slots that it has room for."""
        return (self.stride - layout.WORK_GROUP_SIZE) // tile_size**2

    @classmethod
    def _made(cls, device: Device, planes: int, stride: int) -> PathBuffer:
        return cls(device.empty(4 * planes * stride), planes, stride)


def slots_of(settings: RenderSettings) -> int:
    """The slots that a step fills under the settings."""
    slots = settings.slots_per_step or TileGrid(*settings.size, settings.tile_size).count
    return slots * settings.sample_rate


def check_settings(settings: RenderSettings) -> None:
    """Raises InputError where a step of the settings is larger than kernels can address."""
    slots, planes = slots_of(settings), _planes(settings)
    if planes * _stride(slots, settings.tile_size) > _MOST_FLOATS:
        most = (_MOST_FLOATS // planes - layout.WORK_GROUP_SIZE) // settings.tile_size**2
        raise InputError(
            f"sample_rate: a step of {slots:,} slots is more than the {most:,} that can be "
            f"addressed; choose a smaller sample_rate or slots_per_step"
        )


def _planes(settings: RenderSettings) -> int:
    return plane_count(passes_of(settings))


def _stride(slots: int, tile_size: int) -> int:
    return slots * tile_size**2 + layout.WORK_GROUP_SIZE
