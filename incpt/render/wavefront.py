"""The path tracer as a wavefront of small kernels (Laine, Karras and Aila 2013).

Instead of one kernel with the path loop, each stage of all paths runs as a kernel of its own, over lists
of the paths that need it: a terminated path costs nothing more, and on PoCL the straight-line stages run
in SIMD lanes. Paths are traced in chunks whose state fits the caches of a CPU.

    generate -> [ intersect -> shade_miss, sample_lights, shade_medium, shade -> trace_shadow ] once a ray
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings, layout
from incpt.device.device import BUILD_SIZES, Device
from incpt.render import blocks
from incpt.tables.scene_tables import SceneTables

_MOST_LISTS = 3

_Class = layout.PathClass
_PLANES = {
    "rays": layout.RayPlane,
    "paths": layout.PathPlane,
    "surfaces": layout.SurfacePlane,
    "shadows": layout.ShadowPlane,
}


class Wavefront:
    """Traces the paths of a step on a device; holds the state of one chunk of paths."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.in_blocks = blocks.traces_in_blocks(device)
        self.chunk_paths = device.tuning.chunk_paths
        # The last place is a scratch path, which idle lanes of a group read and write.
        self.stride = self.chunk_paths + layout.WORK_GROUP_SIZE
        self._planes = {name: device.empty(4 * len(planes) * self.stride) for name, planes in _PLANES.items()}
        for buffer in self._planes.values():
            device.fill(buffer, 0, buffer.size)
        self._live, self._next, self._surfaces, self._media, self._misses, self._shadowed = (
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
            blocks.trace(self.device, scene, params, slots, path_count, radiance)
            return
        for first in range(0, path_count, self.chunk_paths):
            chunk = self._chunk_params(params, first, path_count)
            count = self._generate(chunk, slots, radiance)
            for ray in range(layout.MOST_RAYS):
                if count == 0:
                    break
                count = self._bounce(scene, chunk, ray, count, radiance)

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
        """What camera rays meet: `surface` and `object_ids` as cl/film/first_hits.cl fills them."""
        for first in range(0, path_count, self.chunk_paths):
            chunk = self._chunk_params(params, first, path_count)
            count = self._generate(chunk, slots, radiance)
            self._intersect(scene, chunk, count, radiance)
            self._first_hits(scene, chunk, surface, object_ids, radiance)

    def idle_launches(
        self, scene: SceneTables, params: npt.NDArray[np.void], slots: cl.Buffer, radiance: cl.Buffer
    ) -> list[Callable[[], None]]:
        """A launch of every kernel that `trace` and `first_hits` may need for this scene, each with nothing
        to do; see `Device.built`. `slots` holds one slot, which lanes without a path read."""
        chunk = self._chunk_params(params, 0, 0)
        nothing = self._counters
        stages: list[Callable[[], object]] = [
            partial(self._generate, chunk, slots, radiance),
            partial(self._intersect, scene, chunk, 0, radiance),
            partial(self._first_hits, scene, chunk, nothing, nothing, radiance),
        ]
        if not self.in_blocks:
            stages += [
                partial(self._sample_lights, scene, chunk, 0, self._surfaces, radiance),
                partial(self._shade, scene, chunk, 0, radiance),
                partial(self._trace_shadows, scene, chunk, 0, radiance),
                partial(self._shade_misses, scene, chunk, 0, radiance),
            ]
            if scene.has_media:
                stages.append(partial(self._shade_media, scene, chunk, 0, radiance))
            else:
                stages.append(partial(self._shade, scene, chunk, 0, radiance, last=True))
        launches: list[Callable[[], None]] = [
            partial(self._launch_idle, stage, size) for stage in stages for size in BUILD_SIZES
        ]
        if self.in_blocks:  # a work-item is a block of paths, so that grids are small always
            launches.append(partial(blocks.trace, self.device, scene, params, slots, 0, radiance))
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
        self._launch("generate", size, radiance, params=params, slots=slots)
        return self._compact(params, size, None, radiance, (_Class.LIVE, self._live))[0]

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
        self._intersect(scene, params, count, radiance)
        surface_count, miss_count, medium_count = self._compact(
            params,
            count,
            self._live,
            radiance,
            (_Class.SURFACE, self._surfaces),
            (_Class.MISS, self._misses),
            (_Class.MEDIUM, self._media),
        )
        if miss_count and any(scene.environment_radiance):
            self._shade_misses(scene, params, miss_count, radiance)
        # Without media every ray is a scattering event, so that all paths end with the same one.
        last = not scene.has_media and ray > int(params["max_bounces"])
        if surface_count and not last:
            self._sample_lights(scene, params, surface_count, self._surfaces, radiance)
        if medium_count:
            self._sample_lights(scene, params, medium_count, self._media, radiance)
            surface_count = self._shade_media(scene, params, medium_count, radiance)
        if surface_count:
            self._shade(scene, params, surface_count, radiance, last)
        next_count, shadow_count, _ = self._compact(
            params, count, self._live, radiance, (_Class.LIVE, self._next), (_Class.SHADOW, self._shadowed)
        )
        if shadow_count:
            self._trace_shadows(scene, params, shadow_count, radiance)
        self._live, self._next = self._next, self._live
        return next_count

    def _intersect(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> None:
        self._launch("intersect", count, radiance, scene, params=params, list=self._live)

    def _shade_misses(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> None:
        features = (*scene.features, *(("MEDIA",) if scene.has_media else ()))
        self._launch("shade_miss", count, radiance, scene, features, params=params, list=self._misses)

    def _shade(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        count: int,
        radiance: cl.Buffer,
        last: bool = False,
    ) -> None:
        features = ("EMISSION_ONLY",) if last else scene.features
        self._launch("shade", count, radiance, scene, features, params=params, list=self._surfaces)

    def _trace_shadows(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> None:
        self._launch("trace_shadow", count, radiance, scene, params=params, list=self._shadowed)

    def _first_hits(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        surface: cl.Buffer,
        object_ids: cl.Buffer,
        radiance: cl.Buffer,
    ) -> None:
        pixels = int(params["width"]) * int(params["height"])
        self._launch(
            "first_hits", int(params["path_count"]), radiance, scene,
            params=params, pixels=pixels, first_surface=surface, object_ids=object_ids,
        )  # fmt: skip

    def _sample_lights(
        self,
        scene: SceneTables,
        params: npt.NDArray[np.void],
        count: int,
        paths: cl.Buffer,
        radiance: cl.Buffer,
    ) -> None:
        if scene.features:
            self._launch("sample_lights", count, radiance, scene, scene.features, params=params, list=paths)

    def _shade_media(
        self, scene: SceneTables, params: npt.NDArray[np.void], count: int, radiance: cl.Buffer
    ) -> int:
        """Shade the paths at or in transparent bodies. Those that stand on an opaque surface in there join
        the others; returns how many they are then."""
        self._launch("shade_medium", count, radiance, scene, scene.features, params=params, list=self._media)
        return self._compact(
            params, count, self._media, radiance, (_Class.SURFACE, self._surfaces), append=True
        )[0]

    def _compact(
        self,
        params: npt.NDArray[np.void],
        count: int,
        source: cl.Buffer | None,
        radiance: cl.Buffer,
        *lists: tuple[_Class, cl.Buffer],
        append: bool = False,
    ) -> tuple[int, int, int]:
        """Sort paths of `source` (None: all) into up to three lists by class; returns the lists' lengths.
        `append` goes on with the lists of the last call."""
        if not append:
            self.device.fill(self._counters, 0, 4 * _MOST_LISTS)
        unused = (_Class(0), self._misses)
        values: dict[str, Any] = {"takes_all": source is None, "list": source or self._live, "count": count}
        for i, (bits, target) in enumerate((*lists, unused, unused)[:_MOST_LISTS]):
            values |= {f"class_{i}": bits, f"list_{i}": target}
        self._launch(
            "compact", -(-count // layout.COMPACT_BLOCK), radiance,
            params=params, counters=self._counters, **values,
        )  # fmt: skip
        first, second, third = self.device.read(self._counters, np.empty(_MOST_LISTS, np.uint32)).tolist()
        return first, second, third

    def _launch(
        self,
        name: str,
        size: int,
        radiance: cl.Buffer,
        scene: SceneTables | None = None,
        features: tuple[str, ...] = (),
        **values: Any,
    ) -> None:
        """Launch a kernel; its arguments are `values` by name, the planes of paths, and the buffers of the
        scene. `count` is the number of work-items that have something to do, if `values` does not say it."""
        known = {**self._planes, "radiance": radiance, "count": size, **values}
        arguments = bindings.arguments(bindings.KERNELS[name], known, scene)
        kernel = self.device.kernel(name, features=features)
        self.device.launch(kernel, max(size, self._least_size), *arguments)
