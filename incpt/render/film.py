"""The film: what the paths brought, added up over the picture, with the number of samples behind each pixel.

A film has named passes; radiance is one of them, and auxiliary images (albedo, normal) of the same jittered
samples may be others. Each holds sums, which `resolve` divides by the number of
samples, so that tiles may differ in it. A finished tile either replaces what a pass has of it or is added;
one that is under way waits in `pending`, so that nobody sees half of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import accumulate
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl

from incpt.core import bindings
from incpt.core.layout import Counter, SlotFlag
from incpt.device.device import BUILD_SIZES, Device
from incpt.render.plan import Plan
from incpt.render.tiles import TileGrid

Float32Array = npt.NDArray[np.float32]


class Accumulation(Enum):
    """What a pass adds up; values are the features of cl/film/reduce.cl, in one text."""

    SUM = ""
    SQUARES = "SQUARES"


class Resolution(Enum):
    """What the picture of a pass is; values are the features of cl/film/resolve.cl, in one text."""

    MEAN = ""
    SUM = "KEEP_SUMS"


@dataclass(frozen=True)
class FilmPass:
    """One of the things that a film holds of each pixel.

    name          by which its picture is asked for.
    channels      the floats that each path brings for it, as planes of the path buffer.
    accumulation  what is added up of them.
    resolution    what the picture is made of these sums.
    is_aov        whether it is an auxiliary image, which some tiles replace though they add to radiance.
    """

    name: str
    channels: int
    accumulation: Accumulation = Accumulation.SUM
    resolution: Resolution = Resolution.MEAN
    is_aov: bool = False

    @property
    def replace_flags(self) -> SlotFlag:
        """The flags of slots by which a tile replaces what the film has of this pass."""
        return SlotFlag.REPLACE | SlotFlag.REPLACE_AOVS if self.is_aov else SlotFlag.REPLACE


@dataclass(frozen=True)
class FilmPlanes:
    """What a strategy keeps of each pixel by itself: so many planes of floats, 0 at first."""

    name: str
    count: int


RADIANCE = FilmPass("radiance", 3)
"""Red, green and blue, as `Session.image` shows them."""
ALBEDO = FilmPass("albedo", 3, is_aov=True)
"""Base colour of the first surface, 0 where there is none: the mean over the samples is antialiased."""
NORMAL = FilmPass("normal", 3, is_aov=True)
"""Shading normal of the first surface in world space, 0 where there is none. It points to the outside of the
face, from whichever side the ray comes. Means are shorter than 1 where the samples of a pixel differ."""
ALPHA = FilmPass("alpha", 1, is_aov=True)
"""The share of a pixel that surfaces and lights cover, as the camera sees them: of its samples, those that
met one."""
AOVS = (ALBEDO, NORMAL, ALPHA)
"""Auxiliary images, as denoisers expect them: means over the samples of the picture. They lie in the path
buffer as layout.SamplePlane says.

Distance and object are not among them, because their mean over an outline means nothing: a distance at which
nothing is, a number between those of two objects. `first_hits` finds them along rays through pixel centres.
"""


def plane_count(passes: Sequence[FilmPass]) -> int:
    """The planes that the passes need in the path buffer, where they lie one after the other."""
    return sum(one.channels for one in passes)


class Film:
    """Accumulation over a picture of `width` x `height` pixels, on the device; black at first. No two passes
    may have the same name.

    It counts the samples behind what it *shows*, pixel by pixel and for each pass, since a strategy may give
    pixels or passes different numbers. Which sample comes next does not follow from that count: after a
    change that starts the picture over the film still shows the old one. So `Progress.tile_spp` counts the
    samples of the scene as it is now, on the host, where steps are planned without a read. Both agree
    wherever a tile shows that scene.
    """

    def __init__(
        self,
        device: Device,
        width: int,
        height: int,
        passes: tuple[FilmPass, ...] = (RADIANCE,),
        planes: tuple[FilmPlanes, ...] = (),
        is_transparent: bool = False,
    ) -> None:
        self.device, self.width, self.height, self.passes = device, width, height, passes
        self.is_transparent = is_transparent
        """Whether the picture tells what share of each pixel is covered, for which it has the pass ALPHA."""
        self.revision = 0
        """Another number whenever sums changed, so that what was made of them need not be made twice."""
        self._counters = device.empty(4 * len(Counter))
        device.fill(self._counters, 0, 4 * len(Counter))
        first_planes = accumulate((one.channels for one in passes), initial=0)
        self._layers = {
            one.name: _Layer(device, one, first, width * height)
            for one, first in zip(passes, first_planes, strict=False)
        }
        assert len(self._layers) == len(passes), "passes of a film need different names"
        self._planes = {one: self._zeroed(one) for one in planes}

    def with_planes(self, planes: tuple[FilmPlanes, ...]) -> Film:
        """The same film, with these planes of a strategy and none of another one."""
        if set(planes) == set(self._planes):
            return self
        film = copy(self)
        film._planes = {one: self._planes.get(one) or self._zeroed(one) for one in planes}
        return film

    def has_planes(self, planes: tuple[FilmPlanes, ...]) -> bool:
        """Whether it keeps all of them."""
        return set(planes) <= set(self._planes)

    def planes(self, planes: FilmPlanes) -> cl.Buffer:
        """Planes that the film keeps, of width x height floats each."""
        return self._planes[planes]

    def clear(self, planes: FilmPlanes) -> None:
        """Make the planes 0."""
        self.note_change()
        self.device.fill(self._planes[planes], 0, self._size(planes))

    def note_change(self) -> None:
        """Who writes into the film by kernels of its own has to tell."""
        self.revision += 1

    def radiance_sums(self) -> cl.Buffer:
        """The sums of red, green and blue, and the number of samples: four planes."""
        return self._layers[RADIANCE.name].sums

    def reduce(
        self,
        params: npt.NDArray[np.void],
        plan: Plan,
        slots: cl.Buffer,
        samples: cl.Buffer,
        passes: tuple[FilmPass, ...] | None = None,
    ) -> None:
        """Put the paths of a step into `passes` of the film (None: all): `samples` holds what they brought,
        in the order of `slots`, a plane of params["buffer_stride"] floats for each channel of each pass.
        Slots with gaps are left out, because no pass counts the pixels of a tile apart."""
        whole_tiles = plan.slots[plan.slots["pixel_step"] == 1]
        groups = np.unique(whole_tiles["group_first"]).astype(np.uint32)
        if len(groups) == 0:
            return
        self.note_change()
        size = len(groups) * int(params["tile_size"]) ** 2
        values = {
            "params": params,
            "slots": slots,
            "group_total": len(groups),
            "groups": self.device.upload(groups),
            "samples": samples,
            "counters": self._counters,
        }
        for one in self.passes if passes is None else passes:
            self._layers[one.name].reduce(size, **values)

    @property
    def counters(self) -> cl.Buffer:
        """What kernels count, a uint for each layout.Counter."""
        return self._counters

    def first_plane(self, name: str) -> int:
        """Where the planes of a pass begin in the path buffer."""
        return int(self._layers[name].first_plane)

    def take_counters(self) -> dict[Counter, int]:
        """What was counted since the last call. Samples that are not finite count as black."""
        counts = self.device.read(self._counters, np.empty(len(Counter), np.uint32))
        if counts.any():
            self.device.fill(self._counters, 0, counts.nbytes)
        return {counter: int(counts[counter]) for counter in Counter}

    def idle_launches(self, params: npt.NDArray[np.void], samples: cl.Buffer) -> list[Callable[[], None]]:
        """The launches of the film's kernels, each with nothing to do; see `Device.built`."""
        none = self._counters
        values = {"params": params, "slots": none, "group_total": 0, "groups": none}
        values |= {"samples": samples, "counters": none}
        launches: list[Callable[[], None]] = []
        for layer in self._layers.values():
            launches += [partial(layer.reduce, size, **values) for size in BUILD_SIZES]
            launches += [partial(layer.resolve, size, 0) for size in BUILD_SIZES]
        return launches

    def image(self, name: str = RADIANCE.name) -> Float32Array:
        """(height, width, channels + 1) the picture of a pass, for radiance its mean, linear; the last
        channel is 1, or 0 where there is no sample yet. That of radiance is as `with_coverage` says."""
        layer, pixels = self._layers[name], self.width * self.height
        layer.resolve(pixels, pixels)
        image = np.empty((self.height, self.width, layer.film_pass.channels + 1), np.float32)
        image = self.device.read(layer.image, image)
        return self.with_coverage(image) if name == RADIANCE.name else image

    def with_coverage(self, image: Float32Array) -> Float32Array:
        """A picture (height, width, 4) of radiance; a transparent film puts into its last channel what share
        of each pixel is covered."""
        if self.is_transparent:
            image[..., 3] = self.image(ALPHA.name)[..., 0]
        return image

    @property
    def is_whole(self) -> bool:
        """Whether every pixel has a sample."""
        pixels = self.width * self.height
        counts = self.device.read(self.radiance_sums(), np.empty(pixels, np.float32), 3 * 4 * pixels)
        return bool(counts.min() > 0)

    def sums(self) -> dict[str, Float32Array]:
        """(channels + 1, height, width) of each pass: the sums of its channels, and the number of samples;
        and the planes that are kept beside them."""
        found = {}
        for name, layer in self._layers.items():
            planes = np.empty((layer.film_pass.channels + 1, self.height, self.width), np.float32)
            found[name] = self.device.read(layer.sums, planes)
        for kept, buffer in self._planes.items():
            planes = np.empty((kept.count, self.height, self.width), np.float32)
            found[kept.name] = self.device.read(buffer, planes)
        return found

    def restore(self, sums: Mapping[str, Float32Array]) -> None:
        """Make the film hold what `sums` returned of one of the same size; a pass that is not among them
        stays as it is."""
        self.note_change()
        for name in sums.keys() & self._layers.keys():
            self.device.write(self._layers[name].sums, sums[name])
        for planes, buffer in self._planes.items():
            if planes.name in sums:
                self.device.write(buffer, sums[planes.name])

    def _zeroed(self, planes: FilmPlanes) -> cl.Buffer:
        buffer = self.device.empty(self._size(planes))
        self.device.fill(buffer, 0, self._size(planes))
        return buffer

    def _size(self, planes: FilmPlanes) -> int:
        return 4 * planes.count * self.width * self.height


class _Layer:
    """The buffers of one pass, over `pixels` pixels; its channels begin at `first_plane` of the path
    buffer."""

    def __init__(self, device: Device, film_pass: FilmPass, first_plane: int, pixels: int) -> None:
        self.device, self.film_pass, self.first_plane = device, film_pass, first_plane
        nbytes = 4 * (film_pass.channels + 1) * pixels
        self.sums, self._pending, self.image = (device.empty(nbytes) for _ in range(3))
        device.fill(self.sums, 0, nbytes)

    def reduce(self, size: int, **values: Any) -> None:
        """Launch cl/film/reduce.cl over `size` work-items; `values` are its arguments that do not follow from
        the pass."""
        own = {
            "first_plane": self.first_plane,
            "replace_flags": int(self.film_pass.replace_flags),
            "pending": self._pending,
            "film": self.sums,
        }
        self._launch("reduce", self.film_pass.accumulation.value, size, own | values)

    def resolve(self, size: int, pixels: int) -> None:
        """Launch cl/film/resolve.cl over `size` work-items, for a picture of so many pixels."""
        values = {"pixel_total": pixels, "sums": self.sums, "image": self.image}
        self._launch("resolve", self.film_pass.resolution.value, size, values)

    def _launch(self, name: str, features: str, size: int, values: Mapping[str, Any]) -> None:
        channels = f"CHANNELS {self.film_pass.channels}"
        kernel = self.device.kernel(name, features=(channels, *features.split()))
        self.device.launch(kernel, size, *bindings.arguments(bindings.KERNELS[name], values))


def tile_image(grid: TileGrid, per_tile: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """(height, width) a value per tile, spread over the pixels."""
    return np.asarray(per_tile[grid.tile_of_pixels()], np.int64)
