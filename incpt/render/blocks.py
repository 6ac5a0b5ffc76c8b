"""The path tracer as one kernel over blocks of paths (cl/cpu/trace_blocks.cl), for CPUs under clang."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import arena, bindings
from incpt.device.device import Device
from incpt.render.schedule import scheduled
from incpt.render.wavefront import Wavefront
from incpt.tables.scene_tables import SceneTables


def traces_in_blocks(device: Device) -> bool:
    """Whether paths are traced in blocks, by one kernel that is made for compilers and caches of CPUs."""
    return device.block_paths is not None


class BlockTracer:
    """Traces the paths of a step block by block. First hits, which are few and seldom asked for, come from a
    wavefront."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._wavefront = Wavefront(device)

    def trace(
        self,
        tables: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        path_buffer: cl.Buffer,
        aovs: bool = False,
    ) -> None:
        """See `tracer.Tracer`. No path at all builds the kernel."""
        whole = scheduled(params, tables)
        whole["path_count"] = path_count
        kernel = self.device.kernel("trace_blocks", features=(*tables.variant, *(("AOVS",) if aovs else ())))
        values = {"params": whole, "slots": slots, "path_buffer": path_buffer}
        launch(self.device, kernel, bindings.KERNELS["trace_blocks"], path_count, values, tables)

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
        """See `tracer.Tracer`."""
        self._wavefront.first_hits(tables, params, slots, path_count, surface, object_ids, radiance)

    def idle_launches(
        self,
        tables: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_buffer: cl.Buffer,
        aovs: bool = False,
    ) -> list[Callable[[], None]]:
        """See `tracer.Tracer`. A work-item is a block of paths, so that grids are small always."""
        first_hits = self._wavefront.idle_first_hits(tables, params, slots, path_buffer)
        return [*first_hits, partial(self.trace, tables, params, slots, 0, path_buffer, aovs)]


def launch(
    device: Device,
    kernel: cl.Kernel,
    groups: tuple[bindings.Group, ...],
    path_count: int,
    values: Mapping[str, Any],
    tables: SceneTables,
) -> None:
    """Launch a kernel over the blocks of so many paths, one at least; `groups` are what it takes, among them
    bindings.BLOCK. Rays go through the trees of what is not tested by brute force."""
    paths = device.block_paths
    assert paths is not None, f"{device.name} traces no blocks"
    own = {
        "top_nodes": tables.buffer("block_nodes"),
        "memory": cl.LocalMemory(arena.byte_count(paths)),
    }
    arguments = bindings.arguments(groups, {**own, **values}, tables)
    device.launch(kernel, max(-(-path_count // paths), 1), *arguments, work_group=1)
