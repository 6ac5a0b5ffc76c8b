"""What traces the paths of a step: blocks of paths where kernels are compiled by clang for a CPU, else a
wavefront of small kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import pyopencl as cl

from incpt.device.device import Device
from incpt.render.batch import Batch
from incpt.render.blocks import BlockTracer, traces_in_blocks
from incpt.render.wavefront import Wavefront


class Tracer(Protocol):
    """Traces paths on a device. Every tracer gives the same samples for the same slots, up to rounding."""

    device: Device

    def trace(self, batch: Batch) -> None:
        """Trace the paths of a batch into its path buffer."""

    def first_hits(self, batch: Batch, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        """What the camera rays of a batch meet: `surface` and `object_ids` as cl/film/first_hits.cl fills
        them. Of its path buffer the planes of radiance are needed, and hold nothing of use afterwards."""

    def idle_launches(self, batch: Batch) -> list[Callable[[], None]]:
        """A launch of every kernel that `trace` and `first_hits` may need for batches with these tables and
        auxiliary images, each with nothing to do; see `Device.built`. `batch` has one slot, which lanes
        without a path read; none of its paths is traced."""


def tracer_of(device: Device) -> Tracer:
    """The tracer that suits a device."""
    return BlockTracer(device) if traces_in_blocks(device) else Wavefront(device)
