"""The local memory of a block of paths: which planes it holds, when, and where (cl/cpu/trace_blocks.cl).

A block takes its paths through the *phases* of one ray after the other. A *region* is a number of planes with
one meaning, and names the phases in which its values are needed. Regions without a common phase share memory,
and so do regions that say it (`may_cover`); nothing else does. Places follow from that table alone; the
header has them as ARENA_ and the name, in planes.

The whole has to stay in the caches of a core, and in the local memory that OpenCL gives a work-group: Intel's
runtime has 256 KiB. Where the planes of a large block do not fit, the device takes a smaller one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag, auto
from functools import cache

from incpt.core import layout

BLOCK_SIZES = (1024, 512)
"""Paths of a block, the largest first: a device takes the first size whose arena fits its local memory."""

STRIDE_PADDING = 16
"""Floats between the planes of a block beyond its paths. At a power of two the planes would compete for the
few lines of the nearest cache that are kept for their addresses. Loops over sixteen lanes also write up to
fifteen places past the last path."""


class Phase(IntFlag):
    """The phases of one ray of a block, in order. START comes before the first ray only."""

    START = auto()
    """Paths are started: they get the ray from the camera."""
    COMPACT = auto()
    """The paths that still live move together, to the planes in which they are traced."""
    BRUTE_FORCE = auto()
    """Nearest hits with what is tested without a tree."""
    TRACE = auto()
    """Nearest hits by the way of trees."""
    CLASSIFY = auto()
    """Paths are sorted by what their rays met; those that met nothing gather light from far away."""
    GATHER = auto()
    """The paths that met something move together, back to their own planes."""
    SETUP = auto()
    """Hits become surfaces."""
    SHADE = auto()
    """Lights are sampled, surfaces shaded."""
    SHADOW_BRUTE_FORCE = auto()
    """Shadow rays against what is tested without a tree."""
    SHADOW_TRACE = auto()
    """Shadow rays by the way of trees."""


_ALWAYS = Phase(sum(Phase))
_SHADOW = Phase.SHADOW_BRUTE_FORCE | Phase.SHADOW_TRACE
_TRACED = Phase.COMPACT | Phase.BRUTE_FORCE | Phase.TRACE | Phase.CLASSIFY | Phase.GATHER
_OWN = Phase.START | Phase.COMPACT | Phase.GATHER | Phase.SETUP | Phase.SHADE | _SHADOW


@dataclass(frozen=True)
class Region:
    """Planes of a block with one meaning. `may_cover`: regions whose memory it may take over though both are
    needed in one phase, because the loop there reads all of a path's old values before it writes new ones."""

    name: str
    planes: int
    phases: Phase
    may_cover: tuple[str, ...] = ()


REGIONS = (
    # What each path has gathered, red, green and blue, in the order in which paths were started.
    Region("radiance", 3, _ALWAYS),
    # Places of paths.
    Region("list", 1, _ALWAYS),
    # The words of up to four subsets of the paths (compaction.cl).
    Region("subsets", 4, _ALWAYS),
    # A number for each path by which subsets are chosen.
    Region("keys", 1, _ALWAYS),
    # RayPlane and PathPlane between the rays.
    Region("rays", len(layout.RayPlane), _OWN),
    Region("paths", len(layout.PathPlane), _OWN),
    # The same, while a ray is traced: compaction reads one place and writes the other.
    Region("traced_rays", len(layout.RayPlane), _TRACED),
    Region("traced_paths", len(layout.PathPlane), _TRACED),
    Region(
        "raw_hits",
        len(layout.RawHitPlane),
        Phase.BRUTE_FORCE | Phase.TRACE | Phase.CLASSIFY | Phase.GATHER | Phase.SETUP,
    ),
    Region("surfaces", len(layout.SurfacePlane), Phase.SETUP | Phase.SHADE, may_cover=("raw_hits",)),
    Region("shadows", len(layout.ShadowPlane), Phase.SHADE | _SHADOW),
    # What brute force finds: see FOUND_PLACE.
    Region("found", 5, Phase.BRUTE_FORCE),
    # Rays that are ready for interleaved traversal: see PREPARED_INVERSE.
    Region("prepared", 13, Phase.TRACE),
    Region("prepared_shadows", 13, Phase.SHADOW_TRACE),
    # How far rays have come that go through what does not cover.
    Region("travelled", 1, Phase.TRACE),
    # As raw_hits, of shadow rays where surfaces may let them through.
    Region("shadow_hits", len(layout.RawHitPlane), Phase.SHADOW_TRACE),
    # Half of the paths wait here while the other half moves together.
    Region("moved", 1, Phase.GATHER),
    # Shadow rays with the same largest component, up to and with their radiance; the place where each adds
    # it; its path; and what brute force has found in its way.
    Region("occlusion_rays", layout.ShadowPlane.RADIANCE_B + 1, Phase.SHADOW_BRUTE_FORCE),
    Region("occlusion_results", 1, Phase.SHADOW_BRUTE_FORCE),
    Region("occlusion_paths", 1, Phase.SHADOW_BRUTE_FORCE),
    Region("occluders", 1, Phase.SHADOW_BRUTE_FORCE),
)


@cache
def placed(regions: tuple[Region, ...]) -> Mapping[str, int]:
    """The first plane of every region: the lowest place where it covers nothing that it must not."""
    first: dict[str, int] = {}
    known: dict[str, Region] = {}
    for region in regions:
        kept_off = [(first[other.name], first[other.name] + other.planes)
                    for other in known.values()
                    if other.phases & region.phases and other.name not in region.may_cover]  # fmt: skip
        place = 0
        for begin, end in sorted(kept_off):
            if place + region.planes <= begin:
                break
            place = max(place, end)
        first[region.name], known[region.name] = place, region
    return first


@cache
def plane_count(regions: tuple[Region, ...] = REGIONS) -> int:
    """Planes of the whole arena."""
    first = placed(regions)
    return max(first[region.name] + region.planes for region in regions)


def stride(paths: int) -> int:
    """Floats from plane to plane in a block of so many paths."""
    return paths + STRIDE_PADDING


def byte_count(paths: int, planes: int | None = None) -> int:
    """Local memory of a block of so many paths; `planes`: of the arena, if not those that it has."""
    return 4 * stride(paths) * (plane_count() if planes is None else planes)


def block_paths(local_memory: int) -> int | None:
    """How many paths a block takes on a device with so many bytes of local memory; None: it is too small."""
    return next((paths for paths in BLOCK_SIZES if byte_count(paths) <= local_memory), None)


def c_header(paths: int) -> str:
    """OpenCL C text of the size of a block and of the places of all regions."""
    constants = {"BLOCK_PATHS": paths, "BLOCK_STRIDE": stride(paths)}
    constants |= {f"ARENA_{name.upper()}": place for name, place in placed(REGIONS).items()}
    return "".join(f"#define {name} {value}u\n" for name, value in constants.items())
