"""The path tracer as a wavefront of small kernels (Laine, Karras and Aila 2013).

Instead of one kernel with the path loop, each stage of all paths runs as a kernel of its own, over lists
of the paths that need it: a terminated path costs nothing more, and on PoCL the straight-line stages run
in SIMD lanes. Paths are traced in chunks whose state fits the caches of a CPU.

    generate -> [ intersect -> escape, illuminate, medium_shade, shade -> occlude ] once a ray -> radiance
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
from incpt.tables.scene_tables import SceneTables

_MOST_LISTS = 3
_MOST_RAYS = 256
"""Bound on the rays of a path; kernels end paths before it."""

_SPARE_PLANES = 13
"""Planes of a block that its stages use for themselves; see cl/sweep.cl and cl/flights.cl."""
_BLOCK_PLANES = (
    len(layout.RayPlane),
    len(layout.PathPlane),
    len(layout.ShadowPlane) + len(layout.HitPlane),  # together: see cl/trace_blocks.cl
    3,  # radiance
    1, 1, 3,  # lists of places
    _SPARE_PLANES,
)  # fmt: skip
_BLOCK_BYTES = 4 * layout.BLOCK_STRIDE * sum(_BLOCK_PLANES)

_Class = layout.PathClass


def traces_in_blocks(device: Device) -> bool:
    """Whether paths are traced in blocks, by one kernel that is made for compilers and caches of CPUs."""
    return device.is_clang_cpu and device.cl_device.local_mem_size >= _BLOCK_BYTES


def block_arguments(scene: SceneTables) -> list[Any]:
    """What kernels over blocks of paths need of a scene, and the memory of a block."""
    memory = [cl.LocalMemory(4 * n * layout.BLOCK_STRIDE) for n in _BLOCK_PLANES]
    return [
        scene.buffer("block_nodes"), *scene.geometry[1:], scene.buffer("normals"), scene.buffer("layers"),
        *scene.emitters, *memory, *map(scene.buffer, ("quads", "parallelepipeds", "clusters")),
        np.uint32(scene.cluster_count),
    ]  # fmt: skip


class Wavefront:
    """Traces the paths of a step on a device; holds the state of one chunk of paths."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.in_blocks = traces_in_blocks(device)
        self.chunk_paths = device.tuning.chunk_paths
        # The last place is a scratch path, which idle lanes of a group read and write.
        self.stride = self.chunk_paths + layout.WORK_GROUP_SIZE
        self._rays, self._paths, self._hits, self._shadows = (
            device.empty(4 * len(planes) * self.stride)
            for planes in (layout.RayPlane, layout.PathPlane, layout.HitPlane, layout.ShadowPlane)
        )
        for buffer in (self._rays, self._paths, self._hits, self._shadows):
            device.fill(buffer, 0, buffer.size)
        self._live, self._next, self._surfaces, self._media, self._escaped, self._shadowed = (
            device.empty(4 * self.stride) for _ in range(6)
        )
        self._counters = device.empty(4 * _MOST_LISTS)
        self._least_size = 1

    def trace(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        radiance: cl.Buffer,
    ) -> None:
        """Trace `path_count` paths, those of `slots` in order; `radiance` holds what each brings, as three
        planes of params["buffer_stride"] floats."""
        if self.in_blocks:
            self._trace_blocks(scene, params, slots, path_count, radiance)
            return
        for first in range(0, path_count, self.chunk_paths):
            chunk = self._chunk_params(params, first, path_count)
            count = self._generate(chunk, slots, radiance)
            for ray in range(_MOST_RAYS):
                if count == 0:
                    break
                count = self._bounce(scene, chunk, ray, count, radiance)

    def _trace_blocks(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        radiance: cl.Buffer,
    ) -> None:
        whole = params.copy()
        whole["path_count"] = path_count
        # One at least, to build the kernel. A block past the last path would take its count for a huge one.
        blocks = max(-(-path_count // layout.BLOCK_PATHS), 1)
        kernel = self.device.kernel("trace_blocks", features=scene.variant)
        self.device.launch(kernel, blocks, whole, slots, *block_arguments(scene), radiance, work_group=1)

    def first_hits(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        slots: cl.Buffer,
        path_count: int,
        surface: cl.Buffer,
        object_ids: cl.Buffer,
        radiance: cl.Buffer,
    ) -> None:
        """What camera rays meet: `surface` and `object_ids` as cl/aov.cl fills them, by pixel."""
        pixels = np.uint32(int(params["width"]) * int(params["height"]))
        for first in range(0, path_count, self.chunk_paths):
            chunk = self._chunk_params(params, first, path_count)
            count = self._generate(chunk, slots, radiance)
            self._intersect(scene, chunk, count)
            self._describe(scene, chunk, pixels, surface, object_ids)

    def idle_launches(
        self, scene: SceneTables, params: npt.NDArray[np.void], slots: cl.Buffer, radiance: cl.Buffer
    ) -> list[Callable[[], None]]:
        """A launch of every kernel that `trace` and `first_hits` may need for this scene, each with nothing
        to do; see `Device.built`. `slots` holds one slot, which lanes without a path read."""
        chunk = self._chunk_params(params, 0, 0)
        nothing = self._counters
        stages: list[Callable[[], object]] = [
            partial(self._generate, chunk, slots, radiance),
            partial(self._intersect, scene, chunk, 0),
            partial(self._describe, scene, chunk, np.uint32(0), nothing, nothing),
        ]
        if not self.in_blocks:
            stages += [
                partial(self._illuminate, scene, chunk, 0, self._surfaces),
                partial(self._shade, scene, chunk, 0, radiance),
                partial(self._occlude, scene, chunk, 0, radiance),
                partial(self._escape, scene, chunk, 0, radiance),
            ]
            if scene.has_media:
                stages.append(partial(self._shade_media, scene, chunk, 0, radiance))
            else:
                stages.append(partial(self._shade, scene, chunk, 0, radiance, last=True))
        launches: list[Callable[[], None]] = [
            partial(self._launch_idle, stage, size) for stage in stages for size in BUILD_SIZES
        ]
        if self.in_blocks:  # a work-item is a block of paths, so that grids are small always
            launches.append(partial(self._trace_blocks, scene, params, slots, 0, radiance))
        return launches

    def _launch_idle(self, stage: Callable[[], object], size: int) -> None:
        self._least_size = size
        try:
            stage()
        finally:
            self._least_size = 1

    def _generate(self, params: npt.NDArray[np.void], slots: cl.Buffer, radiance: cl.Buffer) -> int:
        """Start the paths of a chunk; returns how many lie in the image."""
        size = int(params["path_count"])
        self._launch("generate", size, params, slots, self._rays, self._paths, radiance)
        return self._compact(params, size, None, (_Class.LIVE, self._live))[0]

    def _chunk_params(
        self, params: npt.NDArray[np.void], first: int, path_count: int
    ) -> npt.NDArray[np.void]:
        chunk = params.copy()
        chunk["first_path"] = first
        chunk["path_count"] = min(self.chunk_paths, path_count - first)
        chunk["path_stride"] = self.stride
        return chunk

    def _bounce(
        self, scene: SceneTables, params: npt.NDArray[np.void], ray: int, count: int, radiance: cl.Buffer
    ) -> int:
        """Ray number `ray` of every live path; returns how many paths go on."""
        self._intersect(scene, params, count)
        surface_count, escaped_count, medium_count = self._compact(
            params,
            count,
            self._live,
            (_Class.SURFACE, self._surfaces),
            (_Class.MISS, self._escaped),
            (_Class.MEDIUM, self._media),
        )
        if escaped_count and any(scene.environment_radiance):
            self._escape(scene, params, escaped_count, radiance)
        # Without media every ray is a scattering event, so that all paths end with the same one.
        last = not scene.has_media and ray > int(params["max_bounces"])
        if surface_count and not last:
            self._illuminate(scene, params, surface_count, self._surfaces)
        if medium_count:
            self._illuminate(scene, params, medium_count, self._media)
            surface_count = self._shade_media(scene, params, medium_count, radiance)
        if surface_count:
            self._shade(scene, params, surface_count, radiance, last)
        next_count, shadow_count, _ = self._compact(
            params, count, self._live, (_Class.LIVE, self._next), (_Class.SHADOW, self._shadowed)
        )
        if shadow_count:
            self._occlude(scene, params, shadow_count, radiance)
        self._live, self._next = self._next, self._live
        return next_count

    def _intersect(self, scene: SceneTables, params: npt.NDArray[np.void], count: int) -> None:
        self._launch(
            "intersect", count, params, np.uint32(count), self._live, *scene.geometry,
            scene.buffer("normals"), self._rays, self._paths, self._hits,
        )  # fmt: skip

    def _escape(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> None:
        self._launch(
            "shade_miss", count, params, np.uint32(count), self._escaped, scene.buffer("materials"),
            scene.buffer("environment_image"), scene.buffer("texel_pdf"), self._rays, self._paths, radiance,
            features=(*scene.features, *(("MEDIA",) if scene.has_media else ())),
        )  # fmt: skip

    def _shade(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        count: int,
        radiance: cl.Buffer,
        last: bool = False,
    ) -> None:
        self._launch(
            "shade", count, params, np.uint32(count), self._surfaces, scene.buffer("materials"),
            scene.buffer("layers"), *self._state, radiance,
            features=("EMISSION_ONLY",) if last else scene.features,
        )  # fmt: skip

    def _occlude(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> None:
        self._launch(
            "trace_shadow", count, params, np.uint32(count), self._shadowed, *scene.geometry[:5],
            self._shadows, radiance,
        )  # fmt: skip

    def _describe(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        pixels: np.uint32,
        surface: cl.Buffer,
        object_ids: cl.Buffer,
    ) -> None:
        self._launch(
            "first_hits", int(params["path_count"]), params, pixels, scene.buffer("materials"), self._hits,
            self._paths, surface, object_ids,
        )  # fmt: skip

    def _illuminate(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, paths: cl.Buffer
    ) -> None:
        if scene.features:
            self._launch(
                "sample_lights", count, params, np.uint32(count), paths, *scene.emitters, self._hits,
                self._paths, self._shadows, features=scene.features,
            )  # fmt: skip

    def _shade_media(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> int:
        """Shade the paths at or in transparent bodies. Those that stand on an opaque surface in there join
        the others; returns how many they are then."""
        self._launch(
            "shade_medium", count, params, np.uint32(count), self._media, scene.buffer("materials"),
            *self._state, radiance, features=scene.features,
        )  # fmt: skip
        return self._compact(params, count, self._media, (_Class.SURFACE, self._surfaces), append=True)[0]

    @property
    def _state(self) -> tuple[cl.Buffer, ...]:
        return self._hits, self._rays, self._paths, self._shadows

    def _compact(
        self,
        params: npt.NDArray[np.void],
        count: int,
        source: cl.Buffer | None,
        *lists: tuple[_Class, cl.Buffer],
        append: bool = False,
    ) -> tuple[int, int, int]:
        """Sort paths of `source` (None: all) into up to three lists by class; returns the lists' lengths.
        `append` goes on with the lists of the last call."""
        if not append:
            self.device.fill(self._counters, 0, 4 * _MOST_LISTS)
        unused = (_Class(0), self._escaped)
        targets = (*lists, unused, unused)[:_MOST_LISTS]
        self._launch(
            "compact", -(-count // layout.COMPACT_BLOCK), params, np.uint32(count), np.uint32(source is None),
            source or self._live, self._paths,
            *(arg for bits, target in targets for arg in (np.uint32(bits), target)), self._counters,
        )  # fmt: skip
        first, second, third = self.device.read(self._counters, np.empty(_MOST_LISTS, np.uint32)).tolist()
        return first, second, third

    def _launch(self, name: str, size: int, *args: Any, features: tuple[str, ...] = ()) -> None:
        size = max(size, self._least_size)
        self.device.launch(self.device.kernel(name, features=features), size, *args)
