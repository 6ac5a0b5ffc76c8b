"""What traces the paths of a step: blocks of paths where kernels are compiled by clang for a CPU, else a
wavefront of small kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.device.device import Device
from incpt.render.blocks import BlockTracer, traces_in_blocks
from incpt.render.wavefront import Wavefront
from incpt.tables.scene_tables import SceneTables


class Tracer(Protocol):
    """Traces paths on a device. Every tracer gives the same samples for the same slots, up to rounding."""

    device: Device

    def trace(
        self,
        tables: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        path_buffer: cl.Buffer,
        aovs: bool = False,
    ) -> None:
        """Trace `path_count` paths, those of `slots` in order; `path_buffer` gets what each brings, as planes
        of params["buffer_stride"] floats: those of radiance in layout.SamplePlane, with `aovs` all of
        them."""

    def first_hits(
        self,
        tables: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        surface: cl.Buffer,
        object_ids: cl.Buffer,
        radiance: cl.Buffer,
    ) -> None:
        """What camera rays meet: `surface` and `object_ids` as cl/film/first_hits.cl fills them."""

    def idle_launches(
        self,
        tables: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_buffer: cl.Buffer,
        aovs: bool = False,
    ) -> list[Callable[[], None]]:
        """A launch of every kernel that `trace` and `first_hits` may need for these tables, each with nothing
        to do; see `Device.built`. `slots` holds one slot, which lanes without a path read."""


def tracer_of(device: Device) -> Tracer:
    """The tracer that suits a device."""
    return BlockTracer(device) if traces_in_blocks(device) else Wavefront(device)
