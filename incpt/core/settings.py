"""How to render, apart from what: frozen, validated, with the defaults of the thesis."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass, fields
from typing import Any

from incpt.core.checks import described, one_of, require_bool, whole
from incpt.core.errors import InputError

STRATEGIES = ("restart", "spiral", "impact")
"""Names of the strategies of `incpt.render.strategies`, so that scenes can be read without a device."""
POINTS_OF_CHANGE = ("bounds", "pixel")
MAX_IMAGE_PIXELS = 1 << 26
"""8,192 x 8,192: what fits the 32-bit plane indices of the kernels with room to spare."""


@dataclass(frozen=True)
class RenderSettings:
    """Settings of a session. Defaults: thesis, section 4.2 (tile 16, rate 1, 3 bounces, NoR 1/1/256), but for
    the strategy.

    size                  width and height of the image, pixels.
    max_bounces           scattering events after the first hit; 0 is direct light only.
    transmission_bounces  passages through smooth dielectrics, counted apart. Where none are left a path
                          ends, and its light is lost; `StepReport.cut_off` counts these.
    roulette_depth        scattering events before Russian roulette may end a path.
    multiple_scattering   whether light that meets several microfacets of rough metal or glass goes on;
                          else it is lost, as in renderers that scatter once.
    clamp_indirect        the most that a sample adds at once after the first bounce, as the mean of red,
                          green and blue; 0: all. It takes away fireflies and the light that they stand
                          for, so that the picture gets darker than it should be: biased, as in Cycles.
    tile_size             edge of a tile, pixels.
    nor                   repetitions of a tile while an edit is re-rendered, under "spiral" (NoR of
                          INCREMENTAL).
    nor_adapts            whether `nor` is the most, and tiles are repeated as often as the rest of the
                          picture was; those of the edited object come at once, repeated 1, 4, 16 ... times.
                          Where it is off, every tile is repeated `nor` times (the thesis).
    base_nor              repetitions in BASE and REFINE.
    sample_rate           paths per pixel and slot.
    strategy              "restart" (every edit starts over), "spiral" (the thesis) or "impact" (what an edit
                          changes is measured by pairs of paths; see incpt/render/impact/README.md).
    point_of_change       "bounds" (centre of the object's 2D bounding box, old and new place) or
                          "pixel" (the pixel given with the edit: the thesis's choice).
    slots_per_step        tiles that fit one step; None: as many as the image has (the thesis).
    texture_limit         the most pixels that images of textures have a side on the device: larger ones are
                          halved until they fit; 0: all as they are.
    seed                  chooses the random numbers.
    aovs                  whether base colour and shading normal of what the samples meet first are passes of
                          the film, beside radiance: see `Session.pass_image`.
    transparent           whether light from far away, the environment and suns, stays out of sight of the
                          camera, so that the picture can be laid over another one: see `Session.image`. It
                          lights the scene all the same, and is seen by reflection and through glass that
                          bends rays.
    """

    size: tuple[int, int] = (960, 540)
    max_bounces: int = 3
    transmission_bounces: int = 12
    roulette_depth: int = 4
    multiple_scattering: bool = True
    clamp_indirect: float = 0.0
    tile_size: int = 16
    nor: int = 256
    nor_adapts: bool = True
    base_nor: int = 1
    sample_rate: int = 1
    strategy: str = "impact"
    point_of_change: str = "bounds"
    slots_per_step: int | None = None
    texture_limit: int = 0
    seed: int = 0
    aovs: bool = False
    transparent: bool = False

    def __post_init__(self) -> None:
        width, height = _whole_pair(self.size)
        object.__setattr__(self, "size", (width, height))
        if width * height > MAX_IMAGE_PIXELS:
            raise InputError(
                f"size: {width} x {height} is more than {MAX_IMAGE_PIXELS:,} pixels; choose a smaller image"
            )
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if name == "slots_per_step" and value is None:
                continue
            object.__setattr__(self, name, whole(name, value, low, high))
        object.__setattr__(self, "clamp_indirect", _radiance("clamp_indirect", self.clamp_indirect))
        require_bool("multiple_scattering", self.multiple_scattering)
        require_bool("aovs", self.aovs)
        require_bool("transparent", self.transparent)
        require_bool("nor_adapts", self.nor_adapts)
        one_of("strategy", self.strategy, STRATEGIES)
        one_of("point_of_change", self.point_of_change, POINTS_OF_CHANGE)

    @property
    def has_aovs(self) -> bool:
        """Whether auxiliary images are passes of the film: coverage is one of them."""
        return self.aovs or self.transparent

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of all settings, in order of declaration."""
        return tuple(field.name for field in fields(cls))


_MOST_RADIANCE = 1e9
_RANGES: dict[str, tuple[int, int]] = {
    "max_bounces": (0, 200),
    "transmission_bounces": (0, 200),
    "roulette_depth": (0, 255),
    "tile_size": (1, 1024),
    "nor": (1, 1 << 16),
    "base_nor": (1, 1 << 16),
    "sample_rate": (1, 4096),
    "slots_per_step": (1, 1 << 24),
    "texture_limit": (0, 1 << 14),
    "seed": (0, (1 << 32) - 1),
}


def _radiance(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(f"{name}: {described(value)} is not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not 0 <= number <= _MOST_RADIANCE:
        raise InputError(f"{name}: {described(value)} is out of range; use 0 to {_MOST_RADIANCE:g}")
    return number


def _whole_pair(value: Any) -> tuple[int, int]:
    try:
        width, height = value
        is_pair = not isinstance(value, str)
    except (TypeError, ValueError):
        is_pair = False
    if not is_pair:
        raise InputError(f"size: {described(value)} is not a pair of width and height, such as [960, 540]")
    limit = math.isqrt(MAX_IMAGE_PIXELS) * 4
    return whole("size (width)", width, 1, limit), whole("size (height)", height, 1, limit)


CUT_OFF_WORTH_TELLING = 1e-2
"""The share of paths that end because `transmission_bounces` is used up from which people are told."""

PICTURE_SETTINGS = (
    *("max_bounces", "transmission_bounces", "roulette_depth", "multiple_scattering", "clamp_indirect"),
    "transparent",
    "texture_limit",
    "seed",
)
"""Settings that change what a sample is worth, so that what was accumulated cannot be kept."""
