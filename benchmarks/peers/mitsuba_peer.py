"""Mitsuba 3: scalar_rgb traces path by path, llvm_ad_rgb as a vectorised wavefront; both use Embree."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from incpt.benchmarks.peers.peer import FloatImage, Job, MissingPeer
from incpt.core.affine import Vector

# Mitsuba counts segments of a path: one to the first hit, one to the light.
_SEGMENTS_BESIDE_BOUNCES = 2
MOST_LANES = 1 << 25
"""Paths that are traced at a time: a wavefront takes a few hundred bytes for each."""


class MitsubaPeer:
    """A variant of Mitsuba. Russian roulette begins as late as ours does, after five segments."""

    def __init__(self, variant: str) -> None:
        try:
            import mitsuba
        except ImportError:
            raise MissingPeer('mitsuba is not installed; run pip install "incpt[peers]"') from None
        self._mi: Any = mitsuba
        try:
            mitsuba.set_variant(variant)
            self._check()
        except Exception as error:  # drjit raises whatever loading LLVM brings
            raise MissingPeer(
                f"mitsuba's {variant} does not run here ({str(error).splitlines()[0]}); llvm variants need "
                "libLLVM (Debian: apt install libllvm19), or its place in DRJIT_LIBLLVM_PATH"
            ) from None
        self._loaded: Any = None
        self._job: Job | None = None

    def _check(self) -> None:
        parts = {"integrator": "path", "sensor": "perspective", "shape": "sphere"}
        tiny = {"type": "scene", **{name: {"type": kind} for name, kind in parts.items()}}
        np.array(self._mi.render(self._mi.load_dict(tiny), spp=1))

    def load(self, job: Job) -> None:
        import drjit

        from incpt.benchmarks.peers.mitsuba_scene import scene_dict

        drjit.set_thread_count(job.threads)
        self._job = job
        depth = job.all_bounces + _SEGMENTS_BESIDE_BOUNCES
        with tempfile.TemporaryDirectory() as folder:
            described = scene_dict(job.scene, job.size, depth, Path(folder), rr_depth=5)
            # Meshes of one material would be merged, and could not be moved apart.
            self._loaded = self._mi.load_dict(described, optimize=False)

    def time(self, spp: int, seed: int) -> float:
        began = time.perf_counter()
        self._render(spp, seed)
        return time.perf_counter() - began

    def image(self, spp: int, seed: int) -> FloatImage:
        return self._render(spp, seed)

    def move(self, name: str, position: Vector, seed: int) -> float:
        from incpt.benchmarks.peers.mitsuba_scene import world_mesh

        assert self._job is not None
        scene = self._job.scene
        moved = scene.with_object(name, position=position)
        # Its meshes have no transform: an edit is new vertices, which are made before the clock starts.
        vertices = world_mesh(moved.object(name))[0]
        parameters = self._mi.traverse(self._loaded)
        key = f"shape_{scene.object_index[name]}.vertex_positions"
        array = type(parameters[key])(vertices.ravel())
        began = time.perf_counter()
        parameters[key] = array
        parameters.update()
        self._render(1, seed)
        return time.perf_counter() - began

    def _render(self, spp: int, seed: int) -> FloatImage:
        assert self._job is not None
        total = np.zeros((*reversed(self._job.size), 3), np.float64)
        for i, part in enumerate(passes(spp, self._job.pixels)):
            # The array waits until the picture is done.
            total += part * np.array(self._mi.render(self._loaded, spp=part, seed=seed + (i << 16)))
        return (total / spp).astype(np.float32)


def passes(spp: int, pixels: int) -> list[int]:
    """Samples per pixel of each render, so that no wavefront is larger than the memory."""
    most = max(MOST_LANES // pixels, 1)
    whole, rest = divmod(spp, most)
    return [most] * whole + [rest] * (rest > 0)
