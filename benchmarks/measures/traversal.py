"""Rays through a scene on incpt's kernels and on Embree: what `incpt bench rays` times."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import affine, bindings, layout
from incpt.device.device import Device
from incpt.render import blocks
from incpt.scene.camera import Camera
from incpt.scene.model import Scene
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import tables_of

Floats = npt.NDArray[np.float32]

_FARTHEST = 1e30

_RAYS = bindings.Group(
    "RAYS",
    None,
    (
        bindings.Argument("count", "uint", "rays"),
        bindings.Argument("given", "__global const float *", "origins and directions, six planes"),
        bindings.Argument("limits", "__global const float *", "how far each ray looks"),
        bindings.Argument("any_hit", "uint", "1: any hit will do, 0: the nearest is asked for"),
        bindings.Argument("from_camera", "uint", "1: neighbours go much the same way"),
    ),
)
_DISTANCES = bindings.Group(
    "DISTANCES", None, (bindings.Argument("distances", "__global float *", "what was found, by ray"),)
)
_VISITS = bindings.Group(
    "VISITS", None, (bindings.Argument("visits", "__global uint *", "nodes and packs tested, by ray"),)
)


@dataclass(frozen=True, eq=False)
class Rays:
    """`origins` and `directions` (N, 3) of unit length, and how far each looks (N,), infinity for as far as
    there is something. `any_hit`: it is asked whether there is anything, not what is nearest. `from_camera`:
    neighbours go much the same way."""

    origins: Floats
    directions: Floats
    limits: Floats
    any_hit: bool = False
    from_camera: bool = False

    def __len__(self) -> int:
        return len(self.origins)

    @cached_property
    def planes(self) -> Floats:
        """(6, N) as the kernels read them."""
        return np.ascontiguousarray(np.hstack([self.origins, self.directions]).T, np.float32)


class Tracer:
    """incpt's traversal of a scene with a lamp, as its path tracer does it on that device, or, as `in_blocks`
    says, as it does it with blocks of paths (on PoCL alone) or with a wavefront.

    in_squares tells in which order the path tracer takes the pixels of a tile; see `camera_rays`.
    """

    def __init__(self, device: Device, scene: Scene, in_blocks: bool | None = None) -> None:
        self.device = device
        # The buffers hold the scene as long as its tables live.
        self._tables = tables_of(GeometryPool.of(device), scene)
        self.in_squares = self._tables.has_trees
        self._in_blocks = blocks.traces_in_blocks(device) if in_blocks is None else in_blocks
        file, features = ("trace_blocks", self._tables.variant) if self._in_blocks else ("bvh", ())
        program = self._build(file, features)
        self._kernels = {name: cl.Kernel(program, name) for name in ("trace_closest", "trace_any")}
        self._count = cl.Kernel(self._build("bvh", ("COUNT_VISITS",)), "count_visits")

    def _build(self, file: str, features: tuple[str, ...]) -> cl.Program:
        own = (resources.files("incpt.benchmarks") / "measures/trace.cl").read_text("utf-8")
        groups = bindings.c_header((_RAYS, _DISTANCES, _VISITS))
        text = self.device.program_text(file, features)
        return self.device.build(f"{text}\n{groups}\n{own}", "measures/trace.cl")

    def place(self, rays: Rays) -> PlacedRays:
        """Rays on the device."""
        return PlacedRays(self, rays)

    def visits(self, rays: Rays) -> tuple[float, float]:
        """Nodes, and packs of up to eight triangles, that a ray is tested against in the mean, where it goes
        through the trees alone and nearer boxes first."""
        count = len(rays)
        buffer = self.device.empty(8 * count)
        values = {
            **_ray_values(rays, self.device.upload(rays.planes), self.device.upload(rays.limits)),
            "visits": buffer,
        }
        groups = (_RAYS, bindings.GEOMETRY, _VISITS)
        self.device.launch(self._count, count, *bindings.arguments(groups, values, self._tables))
        found = self.device.read(buffer, np.empty((count, 2), np.uint32))
        nodes, packs = found.mean(axis=0).tolist()
        return nodes, packs

    def launch(self, placed: PlacedRays) -> None:
        """Trace; returns before it is done."""
        count = len(placed.rays)
        kernel = self._kernels["trace_any" if placed.rays.any_hit else "trace_closest"]
        values = {
            **_ray_values(placed.rays, placed.planes, placed.limits),
            "distances": placed.distances,
        }
        if self._in_blocks:
            groups = (_RAYS, *bindings.BLOCK, _DISTANCES)
            blocks.launch(self.device, kernel, groups, count, values, self._tables)
        else:
            arguments = bindings.arguments((_RAYS, bindings.GEOMETRY, _DISTANCES), values, self._tables)
            self.device.launch(kernel, count, *arguments)


class PlacedRays:
    """Rays in buffers of the device."""

    def __init__(self, tracer: Tracer, rays: Rays) -> None:
        device = tracer.device
        self._tracer, self.rays = tracer, rays
        self.planes, self.limits = device.upload(rays.planes), device.upload(rays.limits)
        self.distances = device.empty(4 * len(rays))

    def seconds(self) -> float:
        """How long it takes to trace all of them once."""
        self._tracer.device.finish()
        began = time.perf_counter()
        self._tracer.launch(self)
        self._tracer.device.finish()
        return time.perf_counter() - began

    def result(self) -> Floats:
        """(N,) distances, infinite where there is nothing; 1 or 0 for any-hit rays."""
        self._tracer.launch(self)
        return self._tracer.device.read(self.distances, np.empty(len(self.rays), np.float32))


class EmbreeTracer:
    """Embree's traversal of the same triangles, one ray at a time on each of `threads`.

    Raises ImportError where embreex is not installed.
    """

    def __init__(self, scene: Scene, threads: int) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners = [
            affine.apply(obj.world_from_object, obj.mesh.vertices)[obj.mesh.faces]
            for obj in scene.objects
            if obj.visible
        ]
        self._scene: Any = EmbreeScene()
        self._mesh: Any = TriangleMesh(self._scene, np.concatenate(corners).astype(np.float32))
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads)  # embreex lets other threads run while it traces

    def seconds(self, rays: Rays) -> float:
        """How long it takes to trace all of them once."""
        began = time.perf_counter()
        self._run(rays)
        return time.perf_counter() - began

    def result(self, rays: Rays) -> Floats:
        """As that of `PlacedRays`."""
        found = np.concatenate(self._run(rays))
        if rays.any_hit:
            return (found >= 0).astype(np.float32)
        return np.where(found < 0.1 * _FARTHEST, found, np.inf).astype(np.float32)

    def _run(self, rays: Rays) -> Sequence[Any]:
        edges = np.linspace(0, len(rays), self._threads + 1).astype(int)
        limits = np.minimum(rays.limits, np.float32(_FARTHEST))
        query = "OCCLUDED" if rays.any_hit else "DISTANCE"

        def part(i: int) -> Any:
            at = slice(edges[i], edges[i + 1])
            return self._scene.run(rays.origins[at], rays.directions[at], dists=limits[at], query=query)

        return list(self._pool.map(part, range(self._threads)))


def _ray_values(rays: Rays, planes: cl.Buffer, limits: cl.Buffer) -> dict[str, Any]:
    """What the arguments of _RAYS are bound to."""
    return {
        "count": len(rays),
        "given": planes,
        "limits": limits,
        "any_hit": rays.any_hit,
        "from_camera": rays.from_camera,
    }


# ------------------------------------------------------------------------------------------ ray sets


def camera_rays(camera: Camera, size: tuple[int, int], in_squares: bool = False) -> Rays:
    """Through the pixels' centres, tile by tile of 16 x 16, and in each row by row or in squares, as
    cl/path/tile.cl does it: coherent."""
    width, height = size
    right, up, forward = camera.image_plane(width / height)
    y, x = (places.ravel() for places in np.mgrid[0:height, 0:width])
    edge = 4 if in_squares else 1
    order = np.lexsort((x % edge, y % edge, x // edge, y // edge, x // 16, y // 16))
    u = (2 * (x + 0.5) / width - 1)[order, None]
    v = (2 * (y + 0.5) / height - 1)[order, None]
    directions = np.asarray(forward) + u * np.asarray(right) - v * np.asarray(up)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return replace(_rays(np.tile(camera.position, (len(directions), 1)), directions), from_camera=True)


def scattered_rays(first: Rays, distances: Floats, count: int, seed: int) -> Rays:
    """From what the first rays met, in uniform directions back from there, in random order: incoherent."""
    generator = np.random.default_rng(seed)
    origins, incoming = _hit_points(first, distances, count, generator)
    directions = generator.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    away = (directions * incoming).sum(axis=1, keepdims=True) > 0
    return _rays(origins, np.where(away, -directions, directions))


def shadow_rays(scene: Scene, first: Rays, distances: Floats, seed: int) -> Rays:
    """From what the first rays met, in their order, to points of the lamps. Any hit ends them."""
    generator = np.random.default_rng(seed)
    hit = np.isfinite(distances)
    origins = first.origins[hit] + first.directions[hit] * (distances[hit, None] * (1 - 1e-4))
    targets = _lamp_points(scene, len(origins), generator)
    ways = targets - origins
    lengths = np.linalg.norm(ways, axis=1)
    return _rays(origins, ways / lengths[:, None], lengths * (1 - 1e-3), any_hit=True)


def _hit_points(
    first: Rays, distances: Floats, count: int, generator: np.random.Generator
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    chosen = generator.choice(np.flatnonzero(np.isfinite(distances)), count)
    back = distances[chosen, None].astype(np.float64) * (1 - 1e-4)
    incoming = first.directions[chosen].astype(np.float64)
    return first.origins[chosen] + incoming * back, incoming


def _lamp_points(scene: Scene, count: int, generator: np.random.Generator) -> npt.NDArray[np.float64]:
    corners = np.concatenate(
        [
            affine.apply(obj.world_from_object, obj.mesh.vertices)[obj.mesh.faces]
            for obj in scene.objects
            if scene.materials[obj.material].is_emissive
        ]
    )
    edges = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    chosen = generator.choice(len(corners), count, p=areas / areas.sum())
    u, v = generator.random((2, count, 1))
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    return np.asarray(corners[chosen, 0] + u * edges[chosen, 0] + v * edges[chosen, 1])


def _rays(
    origins: npt.NDArray[np.floating[Any]],
    directions: npt.NDArray[np.floating[Any]],
    limits: npt.NDArray[np.floating[Any]] | None = None,
    any_hit: bool = False,
) -> Rays:
    far = np.full(len(origins), np.inf) if limits is None else limits
    return Rays(
        np.ascontiguousarray(origins, np.float32),
        np.ascontiguousarray(directions, np.float32),
        np.ascontiguousarray(far, np.float32),
        any_hit,
    )


def bytes_read(nodes: float, packs: float) -> float:
    """By so many tests."""
    return nodes * layout.NODE.itemsize + packs * layout.TRIANGLE_PACK.itemsize
