"""The path tracer as a wavefront of small kernels (Laine, Karras and Aila 2013).

Instead of one kernel with the path loop, each stage of all paths runs as a kernel of its own, over lists
of the paths that need it: a terminated path costs nothing more, and on PoCL the straight-line stages run
in SIMD lanes. Paths are traced in chunks whose state fits the caches of a CPU.

    generate -> [ intersect -> shade_miss, sample_lights, shade_medium, shade -> trace_shadow ] once a ray

Where auxiliary images are asked for, `write_aovs` follows the first `intersect`.

The lengths of the lists stay on the device. The host launches each stage over a bound of its list, and learns
how many paths are left of a ray while the device is at work on a later one; work-items beyond the list have
nothing to do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings, layout
from incpt.core.layout import PathClass, PathList
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.batch import Batch
from incpt.render.params import launch_params
from incpt.tables.scene_tables import SceneTables

_RAYS_AHEAD = 2
"""Rays whose stages are enqueued before the host needs to know how many paths the first of them has left."""

_PLANES = {
    "rays": layout.RayPlane,
    "paths": layout.PathPlane,
    "surfaces": layout.SurfacePlane,
    "shadows": layout.ShadowPlane,
}
_CLASSES = {
    PathList.LIVE: PathClass.LIVE,
    PathList.SURFACE: PathClass.SURFACE,
    PathList.MISS: PathClass.MISS,
    PathList.MEDIUM: PathClass.MEDIUM,
    PathList.SHADOW: PathClass.SHADOW,
}
"""Which paths are in which list."""
_NEW_LISTS = 3
"""Lists that `compact` appends to at a time."""


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Paths of a batch whose state is on the device at the same time; `params` are their launches'."""

    batch: Batch
    params: npt.NDArray[np.void]

    @property
    def tables(self) -> SceneTables:
        return self.batch.tables

    @property
    def size(self) -> int:
        return int(self.params["path_count"])


class Wavefront:
    """Traces the paths of a step on a device; holds the state of one chunk of paths."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.chunk_paths = device.tuning.chunk_paths
        # The last place is a scratch path, which idle lanes of a group read and write.
        self.stride = self.chunk_paths + layout.WORK_GROUP_SIZE
        self._planes = {name: device.empty(4 * len(planes) * self.stride) for name, planes in _PLANES.items()}
        for buffer in self._planes.values():
            device.fill(buffer, 0, buffer.size)
        # The live paths of the next ray are listed while those of this one are still needed.
        self._live = tuple(device.empty(4 * self.stride) for _ in range(2))
        self._lists = {
            path_list: device.empty(4 * self.stride) for path_list in PathList if path_list != PathList.LIVE
        }
        self._lengths = device.empty(4 * len(PathList) * (layout.MOST_RAYS + 1))
        self._least_size = 1

    def trace(self, batch: Batch) -> None:
        """See `tracer.Tracer`."""
        for chunk in self._chunks(batch):
            self._trace_chunk(chunk)

    def first_hits(self, batch: Batch, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        """See `tracer.Tracer`."""
        for chunk in self._chunks(batch):
            self._generate(chunk)
            self._intersect(chunk, 0, chunk.size)
            self._first_hits(chunk, surface, object_ids)

    def idle_launches(self, batch: Batch) -> list[Callable[[], None]]:
        """See `tracer.Tracer`."""
        chunk = self._chunk(batch, 0, 0)
        stages: list[Callable[[], object]] = [
            partial(self._sample_lights, chunk, 0, 0, PathList.SURFACE),
            partial(self._shade, chunk, 0, 0),
            partial(self._trace_shadows, chunk, 0, 0),
            partial(self._shade_misses, chunk, 0, 0),
        ]
        if chunk.tables.has_media:
            stages.append(partial(self._shade_media, chunk, 0, 0))
        else:
            stages.append(partial(self._shade, chunk, 0, 0, last=True))
        if batch.aovs:
            stages.append(partial(self._write_aovs, chunk, 0))
        return [*self.idle_first_hits(batch), *self._idle(stages)]

    def idle_first_hits(self, batch: Batch) -> list[Callable[[], None]]:
        """As `idle_launches`, of the kernels that `first_hits` needs alone."""
        chunk, nothing = self._chunk(batch, 0, 0), self._lengths
        return self._idle(
            [
                partial(self._generate, chunk),
                partial(self._intersect, chunk, 0, 0),
                partial(self._first_hits, chunk, nothing, nothing),
            ]
        )

    def _idle(self, stages: list[Callable[[], object]]) -> list[Callable[[], None]]:
        return [partial(self._launch_idle, stage, size) for stage in stages for size in BUILD_SIZES]

    def _launch_idle(self, stage: Callable[[], object], size: int) -> None:
        self._least_size = size
        self.device.fill(self._lengths, 0, self._lengths.size)
        try:
            stage()
        finally:
            self._least_size = 1

    def _chunks(self, batch: Batch) -> list[_Chunk]:
        return [
            self._chunk(batch, first, min(self.chunk_paths, batch.path_count - first))
            for first in range(0, batch.path_count, self.chunk_paths)
        ]

    def _chunk(self, batch: Batch, first: int, size: int) -> _Chunk:
        params = launch_params(batch.params, batch.tables)
        params["first_path"], params["path_count"], params["path_stride"] = first, size, self.stride
        return _Chunk(batch, params)

    def _trace_chunk(self, chunk: _Chunk) -> None:
        self._generate(chunk)
        bound = chunk.size
        left: deque[tuple[cl.Event, npt.NDArray[np.uint32]]] = deque()
        for ray in range(int(chunk.params["last_ray"]) + 1):
            if len(left) == _RAYS_AHEAD:
                done, length = left.popleft()
                done.wait()
                bound = int(length[0])
                if bound == 0:
                    break
            self._trace_ray(chunk, ray, bound)
            length = np.empty(1, np.uint32)
            offset = 4 * _length_place(PathList.LIVE, ray + 1)
            left.append((self.device.read_later(self._lengths, length, offset), length))

    def _trace_ray(self, chunk: _Chunk, ray: int, bound: int) -> None:
        """Ray number `ray` of every live path, which are `bound` at most."""
        last = ray == int(chunk.params["last_ray"])
        self._intersect(chunk, ray, bound)
        if chunk.batch.aovs and ray == 0:
            self._write_aovs(chunk, bound)
        listed = [(path_list, ray) for path_list in (PathList.SURFACE, PathList.MISS, PathList.MEDIUM)]
        self._compact(chunk, ray, bound, PathList.LIVE, *listed)
        if chunk.params["sees_sky"]:
            self._shade_misses(chunk, ray, bound)
        if not last:
            self._sample_lights(chunk, ray, bound, PathList.SURFACE)
        if chunk.tables.has_media:
            self._sample_lights(chunk, ray, bound, PathList.MEDIUM)
            self._shade_media(chunk, ray, bound)
        self._shade(chunk, ray, bound, last)
        if not last:
            self._compact(chunk, ray, bound, PathList.LIVE, (PathList.SHADOW, ray), (PathList.LIVE, ray + 1))
            self._trace_shadows(chunk, ray, bound)

    def _generate(self, chunk: _Chunk) -> None:
        """Start the paths of a chunk, and list those that lie in the image."""
        self._launch("generate", chunk, chunk.size, slots=chunk.batch.slots)
        self.device.fill(self._lengths, 0, self._lengths.size)
        self._compact(chunk, 0, chunk.size, None, (PathList.LIVE, 0))

    def _intersect(self, chunk: _Chunk, ray: int, bound: int) -> None:
        self._launch_listed("intersect", chunk, ray, bound, PathList.LIVE)

    def _write_aovs(self, chunk: _Chunk, bound: int) -> None:
        self._launch_listed("write_aovs", chunk, 0, bound, PathList.LIVE)

    def _shade_misses(self, chunk: _Chunk, ray: int, bound: int) -> None:
        features = (*chunk.tables.features, *(("MEDIA",) if chunk.tables.has_media else ()))
        self._launch_listed("shade_miss", chunk, ray, bound, PathList.MISS, features)

    def _shade(self, chunk: _Chunk, ray: int, bound: int, last: bool = False) -> None:
        features = ("EMISSION_ONLY",) if last else chunk.tables.features
        self._launch_listed("shade", chunk, ray, bound, PathList.SURFACE, features)

    def _trace_shadows(self, chunk: _Chunk, ray: int, bound: int) -> None:
        if chunk.tables.features:
            self._launch_listed("trace_shadow", chunk, ray, bound, PathList.SHADOW)

    def _sample_lights(self, chunk: _Chunk, ray: int, bound: int, paths: PathList) -> None:
        if chunk.tables.features:
            self._launch_listed("sample_lights", chunk, ray, bound, paths, chunk.tables.features)

    def _shade_media(self, chunk: _Chunk, ray: int, bound: int) -> None:
        """Shade the paths at or in transparent bodies. Those that stand on an opaque surface in there join
        the others."""
        self._launch_listed("shade_medium", chunk, ray, bound, PathList.MEDIUM, chunk.tables.features)
        self._compact(chunk, ray, bound, PathList.MEDIUM, (PathList.SURFACE, ray))

    def _first_hits(self, chunk: _Chunk, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        pixels = int(chunk.params["width"]) * int(chunk.params["height"])
        self._launch(
            "first_hits", chunk, chunk.size, pixels=pixels, first_surface=surface, object_ids=object_ids
        )

    def _compact(
        self, chunk: _Chunk, ray: int, bound: int, source: PathList | None, *targets: tuple[PathList, int]
    ) -> None:
        """Append the paths of `source` (None: all) to up to three lists, each of a ray, by their classes."""
        unused = targets[0]
        values: dict[str, Any] = {"takes_all": source is None}
        for i in range(_NEW_LISTS):
            path_list, of_ray = targets[i] if i < len(targets) else unused
            values |= {
                f"class_{i}": _CLASSES[path_list] if i < len(targets) else PathClass(0),
                f"list_{i}": self._list(path_list, of_ray),
                f"length_{i}": _length_place(path_list, of_ray),
            }
        size = -(-bound // layout.COMPACT_BLOCK)
        self._launch_listed("compact", chunk, ray, size, source or PathList.LIVE, **values)

    def _list(self, path_list: PathList, ray: int) -> cl.Buffer:
        return self._live[ray % 2] if path_list == PathList.LIVE else self._lists[path_list]

    def _launch_listed(
        self,
        name: str,
        chunk: _Chunk,
        ray: int,
        bound: int,
        paths: PathList,
        features: tuple[str, ...] = (),
        **values: Any,
    ) -> None:
        """Launch a kernel over a list of paths, which are `bound` at most."""
        values |= {"list": self._list(paths, ray), "lengths": self._lengths}
        values["length_place"] = _length_place(paths, ray)
        self._launch(name, chunk, bound, features, **values)

    def _launch(
        self, name: str, chunk: _Chunk, size: int, features: tuple[str, ...] = (), **values: Any
    ) -> None:
        """Launch a kernel; its arguments are `values` by name, the planes of paths, and the buffers of the
        scene."""
        known = {**self._planes, "params": chunk.params, "radiance": chunk.batch.path_buffer, **values}
        arguments = bindings.arguments(bindings.KERNELS[name], known, chunk.tables)
        kernel = self.device.kernel(name, features=features)
        self.device.launch(kernel, max(size, self._least_size), *arguments)


def _length_place(path_list: PathList, ray: int) -> int:
    """Where the length of a list of a ray stands."""
    return len(PathList) * ray + path_list
