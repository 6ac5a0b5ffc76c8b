"""Pairs of paths: each path in the new scene, and its partner in the old one, with the same random numbers.

A path that meets nothing that changed brings the same in both scenes, so that it stands for its own partner.
So a step is traced in the new scene whole, and it is asked of each path whether it met something that changed
(cl/path/changes.cl); those that did are listed (cl/impact/partners.cl), and traced in the old scene too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings, layout
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.batch import Batch, TouchTest
from incpt.render.tracer import Tracer
from incpt.tables.change_tables import ChangeTables, change_tables
from incpt.tables.scene_tables import SceneTables


@dataclass(frozen=True, eq=False)
class PairBuffers:
    """What pairs are made of on a device, with room for `stride` paths, as in the planes of a path buffer.

    partner_place     uint of each path of the path buffer: the number of its partner; layout.NO_PARTNER where
                      it met something that changed but its slot is SINGLE, so that nobody knows what it would
                      have brought before; layout.NO_INDEX where it met nothing of it, and brings the same.
    partners          uint of each partner: the place of its path in the path buffer.
    partner_counts    uint of each layout.COMPACT_BLOCK paths: partners before them.
    partner_radiance  what each partner brought: red, green and blue, planes of `stride` floats.
    counters          what is counted while partners are traced, apart: it says nothing of the new scene.
    """

    partner_place: cl.Buffer
    partners: cl.Buffer
    partner_counts: cl.Buffer
    partner_radiance: cl.Buffer
    counters: cl.Buffer
    stride: int

    @classmethod
    def of(cls, device: Device, stride: int, old: PairBuffers | None = None) -> PairBuffers:
        """Those for a path buffer with planes of `stride` floats: `old` where they serve. Raises
        DeviceError."""
        if old is not None and old.stride >= stride:
            return old
        blocks = -(-stride // layout.COMPACT_BLOCK)
        place, partners, counts, radiance, counters = (
            device.empty(4 * count) for count in (stride, stride, blocks, 3 * stride, len(layout.Counter))
        )
        device.fill(counters, 0, counters.size)
        return cls(place, partners, counts, radiance, counters, stride)


@dataclass(frozen=True, eq=False)
class PairTracer:
    """Traces pairs by means of a tracer."""

    tracer: Tracer

    def trace(self, batch: Batch, old: SceneTables, changes: ChangeTables, buffers: PairBuffers) -> int:
        """Trace the paths of `batch` as `Tracer.trace` does, and their partners in the scene of the tables
        `old`; `changes` is the difference from that scene to the batch's, whose tables are of `paired_tables`
        with `old`. Returns how many partners there are. It waits for the device once, where anything
        differs."""
        assert buffers.stride >= batch.path_count, "pairs need room for each path of the path buffer"
        assert old.light_count == batch.tables.light_count, "both scenes choose among the same triangles"
        assert old.lights.shaped.count == batch.tables.lights.shaped.count, "and the same lights"
        if changes.is_empty:
            self.tracer.trace(batch)
            self._device.fill(buffers.partner_place, layout.NO_INDEX, 4 * batch.path_count)
            return 0
        self.tracer.trace(replace(batch, touch_test=TouchTest(changes, buffers.partner_place)))
        count = self._list(batch, buffers)
        if count:
            self.tracer.trace(_partners(batch, old, buffers, count))
        return count

    def idle_launches(self, batch: Batch, buffers: PairBuffers) -> list[Callable[[], None]]:
        """A launch of every kernel that `trace` may need where both scenes have the variant of the batch's,
        each with nothing to do; see `Tracer.idle_launches`. The old scene may have had another variant: that
        was built for it then."""
        test = TouchTest(
            change_tables(self._device, batch.tables.scene, batch.tables.scene), buffers.partners
        )
        launches = [
            *self.tracer.idle_launches(replace(batch, touch_test=test)),
            *self.tracer.idle_launches(replace(batch, aovs=False)),
        ]
        idle = replace(batch, path_count=0)
        for name in ("count_partners", "list_partners"):
            launches += [partial(self._launch, name, size, idle, buffers) for size in BUILD_SIZES]
        return launches

    @property
    def _device(self) -> Device:
        return self.tracer.device

    def _list(self, batch: Batch, buffers: PairBuffers) -> int:
        """List the partners of paths that met something that changed; returns how many there are."""
        blocks = -(-batch.path_count // layout.COMPACT_BLOCK)
        self._launch("count_partners", blocks, batch, buffers)
        counts = self._device.read(buffers.partner_counts, np.empty(blocks, np.uint32))
        ends = np.cumsum(counts, dtype=np.uint32)
        self._device.write(buffers.partner_counts, ends - counts)
        self._launch("list_partners", blocks, batch, buffers)
        return int(ends[-1])

    def _launch(self, name: str, size: int, batch: Batch, buffers: PairBuffers) -> None:
        params = batch.params.copy()
        params["path_count"] = batch.path_count
        values = {**vars(buffers), "params": params, "slots": batch.slots}
        arguments = bindings.arguments(bindings.KERNELS[name], values)
        self._device.launch(self._device.kernel(name, bindings.FILES[name]), size, *arguments)


def _partners(batch: Batch, old: SceneTables, buffers: PairBuffers, count: int) -> Batch:
    """The first `count` of the listed paths of a batch in the old scene."""
    return replace(
        batch,
        tables=old,
        params=_with_stride(batch.params, buffers.stride),
        path_count=count,
        path_buffer=buffers.partner_radiance,
        counters=buffers.counters,
        aovs=False,
        places=buffers.partners,
    )


def _with_stride(params: npt.NDArray[np.void], stride: int) -> npt.NDArray[np.void]:
    params = params.copy()
    params["buffer_stride"] = stride
    return params
