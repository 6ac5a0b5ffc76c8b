"""The path tracer as a wavefront of small kernels (Laine, Karras and Aila 2013).

Instead of one kernel with the path loop, each stage of all paths runs as a kernel of its own, over lists
of the paths that need it: a terminated path costs nothing more, and on PoCL the straight-line stages run
in SIMD lanes. Paths are traced in chunks whose state fits the caches of a CPU. `generate` starts them; then
every ray goes through the stages of core/stages.py.

The lengths of the lists stay on the device. The host launches each stage over a bound of its list, and learns
how many paths are left of a ray while the device is at work on a later one; work-items beyond the list have
nothing to do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings, layout
from incpt.core.layout import PathClass, PathList
from incpt.core.stages import Stage, When, holding, stages_of
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.batch import Batch
from incpt.render.params import launch_params

_RAYS_AHEAD = 2
"""Rays whose stages are enqueued before the host needs to know how many paths the first of them has left."""

_PLANES = {
    "rays": layout.RayPlane,
    "paths": layout.PathPlane,
    "surfaces": layout.SurfacePlane,
    "shadows": layout.ShadowPlane,
}
_CLASSES = {path_list: PathClass[path_list.name] for path_list in PathList}
"""Which paths are in which list."""
_SHAPED, _TREE, _CLAMP = "SHAPED_LIGHTS", "LIGHT_TREE", "CLAMP_INDIRECT"
_LIGHTS = ("ENVIRONMENT_IMAGE", "SUN", "TRIANGLE_LIGHTS", _SHAPED, _TREE)
_TEXTURES = ("TEXTURES", "VERTEX_COLORS")
_MATERIALS = (*_TEXTURES, "TRAITS")
_TRACED = (*_MATERIALS, "CUTOUTS")
"""Of first hits, which pass through lights."""
_FEATURES: Mapping[str | None, tuple[str, ...]] = {
    "generate": ("LENS",),
    "intersect": (*_TRACED, _SHAPED, _TREE, "MEDIA", _CLAMP),
    "shade_miss": (*_LIGHTS, "MEDIA", _CLAMP),
    "choose_lights": ("TRIANGLE_LIGHTS", _SHAPED, _TREE),
    "sample_lights": (*_LIGHTS, *_TEXTURES),
    "touch_lights": (*_LIGHTS, *_MATERIALS),
    "shade_medium": (*_LIGHTS, *_MATERIALS, _CLAMP),
    "shade": (*_LIGHTS, *_MATERIALS, _CLAMP),
    "write_aovs": _MATERIALS,
    "first_hits": _MATERIALS,
    "trace_shadow": (*_TRACED, _SHAPED, _TREE),
}
"""The features of a scene without which a kernel would leave something out. Those that would only make it
quicker, as they do blocks, would be more variants to build."""
_NEW_LISTS = 3
"""Lists that `compact` appends to at a time."""


@dataclass(frozen=True)
class _StageLaunch:
    """A stage of a ray, with its kernel and the features that choose a variant of it."""

    stage: Stage
    kernel: str
    features: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Paths of a batch whose state is on the device at the same time, with the parameters of their launches
    and what is launched on each of their rays."""

    batch: Batch
    params: npt.NDArray[np.void]
    launches: tuple[_StageLaunch, ...]

    @property
    def has_other_lights(self) -> bool:
        """Whether it is asked of paths whether they meet changes, and lights are among them."""
        test = self.batch.touch_test
        return test is not None and test.changes.difference.lights

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
        if batch.touch_test is not None:
            self.device.fill(batch.touch_test.touched, 0, 4 * batch.path_count)
        for chunk in self._chunks(batch):
            self._trace_chunk(chunk)

    def first_hits(self, batch: Batch, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        """See `tracer.Tracer`."""
        for chunk in self._chunks(batch):
            self._generate(chunk)
            self._intersect(chunk, chunk.size)
            self._first_hits(chunk, surface, object_ids)

    def idle_launches(self, batch: Batch) -> list[Callable[[], None]]:
        """See `tracer.Tracer`."""
        chunk = self._chunk(batch, 0, 0)
        kernels = dict.fromkeys((one.kernel, one.features) for one in chunk.launches)
        # First hits need it too.
        kernels.pop(("intersect", _chosen(batch.features, _TRACED)), None)
        return [
            *self.idle_first_hits(batch),
            *self._idle(
                partial(self._launch_listed, kernel, chunk, 0, 0, PathList.LIVE, features)
                for kernel, features in kernels
            ),
        ]

    def idle_first_hits(self, batch: Batch) -> list[Callable[[], None]]:
        """As `idle_launches`, of the kernels that `first_hits` needs alone."""
        chunk, nothing = self._chunk(batch, 0, 0), self._lengths
        return self._idle(
            [
                partial(self._generate, chunk),
                partial(self._intersect, chunk, 0),
                partial(self._first_hits, chunk, nothing, nothing),
            ]
        )

    def _idle(self, launches: Iterable[Callable[[], None]]) -> list[Callable[[], None]]:
        return [partial(self._launch_idle, launch, size) for launch in launches for size in BUILD_SIZES]

    def _launch_idle(self, launch: Callable[[], None], size: int) -> None:
        self._least_size = size
        self.device.fill(self._lengths, 0, self._lengths.size)
        try:
            launch()
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
        params["listed"] = batch.places is not None
        return _Chunk(batch, params, _launches_of(batch.features))

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
        last, first_sky_ray = int(chunk.params["last_ray"]), int(chunk.params["first_sky_ray"])
        holds = holding(ray, last, ray >= first_sky_ray, chunk.has_other_lights)
        for one in chunk.launches:
            stage = one.stage
            if stage.when in holds:
                self._launch_listed(one.kernel, chunk, ray, bound, stage.paths, one.features)
                if stage.sorts:
                    self._compact(chunk, ray, bound, stage.paths, stage.sorts)

    def _generate(self, chunk: _Chunk) -> None:
        """Start the paths of a chunk, and list those that lie in the image."""
        self._launch("generate", chunk, chunk.size, _chosen(chunk.batch.features, _FEATURES["generate"]))
        self.device.fill(self._lengths, 0, self._lengths.size)
        self._compact(chunk, 0, chunk.size, None, (PathList.LIVE,))

    def _intersect(self, chunk: _Chunk, size: int) -> None:
        """Trace the camera rays of a chunk."""
        features = _chosen(chunk.batch.features, _TRACED)
        self._launch_listed("intersect", chunk, 0, size, PathList.LIVE, features)

    def _first_hits(self, chunk: _Chunk, surface: cl.Buffer, object_ids: cl.Buffer) -> None:
        pixels = int(chunk.params["width"]) * int(chunk.params["height"])
        features = _chosen(chunk.batch.features, _FEATURES["first_hits"])
        values = {"pixels": pixels, "first_surface": surface, "object_ids": object_ids}
        self._launch("first_hits", chunk, chunk.size, features, **values)

    def _compact(
        self, chunk: _Chunk, ray: int, bound: int, source: PathList | None, targets: tuple[PathList, ...]
    ) -> None:
        """Append the paths of `source` to up to three lists, by their classes. None are all paths, that is to
        say those that were just started, whose first ray is this one and not the next."""
        values: dict[str, Any] = {"takes_all": source is None}
        for i in range(_NEW_LISTS):
            path_list = targets[i] if i < len(targets) else targets[0]
            of_ray = ray + 1 if path_list == PathList.LIVE and source is not None else ray
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
        known = {**self._planes, **chunk.batch.values, "params": chunk.params}
        known |= {"radiance": chunk.batch.path_buffer, **values}
        arguments = bindings.arguments(bindings.KERNELS[name], known, chunk.batch.tables)
        kernel = self.device.kernel(name, bindings.FILES.get(name), features)
        self.device.launch(kernel, max(size, self._least_size), *arguments)


@cache
def _launches_of(features: tuple[str, ...]) -> tuple[_StageLaunch, ...]:
    """The kernels of a ray in order, for paths that are traced with these features."""
    return tuple(
        _StageLaunch(stage, stage.kernel, _features_of(stage, features))
        for stage in stages_of(features)
        if stage.kernel is not None
    )


def _features_of(stage: Stage, features: tuple[str, ...]) -> tuple[str, ...]:
    """Those that choose the variant of the stage's kernel."""
    if When.ENDS in stage.when:
        return ("EMISSION_ONLY", *_chosen(features, (*_MATERIALS, _CLAMP)))
    names = _FEATURES.get(stage.kernel, ())
    if stage.kernel == "intersect" and _SHAPED not in features:
        names = _TRACED
    return _chosen(features, names)


def _chosen(features: tuple[str, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the features that have these names; some come with a number."""
    return tuple(feature for feature in features if feature.split()[0] in names)


def _length_place(path_list: PathList, ray: int) -> int:
    """Where the length of a list of a ray stands."""
    return len(PathList) * ray + path_list
