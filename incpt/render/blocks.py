"""The path tracer as one kernel over blocks of paths (cl/cpu/trace_blocks.cl), for CPUs under clang."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import pyopencl as cl

from incpt.core import arena, bindings
from incpt.device.device import Device
from incpt.render.batch import Batch
from incpt.render.params import launch_params
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

    def trace(self, batch: Batch) -> None:
        """See `tracer.Tracer`. No path at all builds the kernel."""
        tables = batch.tables
        params = launch_params(batch.params, tables)
        params["path_count"] = batch.path_count
        params["listed"] = batch.places is not None
        if batch.touch_test is not None:
            self.device.fill(batch.touch_test.touched, 0, 4 * batch.path_count)
        kernel = self.device.kernel("trace_blocks", features=batch.features)
        values = {**batch.values, "params": params, "path_buffer": batch.path_buffer}
        launch(self.device, kernel, bindings.KERNELS["trace_blocks"], batch.path_count, values, tables)

    def first_hits(self, batch: Batch, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        """See `tracer.Tracer`."""
        self._wavefront.first_hits(batch, surface, object_ids)

    def idle_launches(self, batch: Batch) -> list[Callable[[], None]]:
        """See `tracer.Tracer`. A work-item is a block of paths, so that grids are small always."""
        first_hits = self._wavefront.idle_first_hits(batch)
        return [*first_hits, partial(self.trace, replace(batch, path_count=0))]


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
