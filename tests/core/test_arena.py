"""The memory of a block of paths: nothing shares it by accident, and it fits."""

from __future__ import annotations

from itertools import combinations

import pytest

from incpt.core import arena
from incpt.core.arena import Phase, Region, placed
from incpt.device.device import Device
from incpt.render.blocks import traces_in_blocks

INTEL_LOCAL_MEMORY = 256 << 10
"""What Intel's runtime gives a work-group, in bytes: the least that a device with blocks has."""

MORE_PLANES = 16
"""Planes that must be free for what comes."""


def overlaps(regions: tuple[Region, ...], a: Region, b: Region) -> bool:
    first = placed(regions)
    return first[a.name] < first[b.name] + b.planes and first[b.name] < first[a.name] + a.planes


def test_regions_of_one_phase_share_memory_only_where_they_say_it() -> None:
    shared = {
        (a.name, b.name)
        for a, b in combinations(arena.REGIONS, 2)
        if a.phases & b.phases and overlaps(arena.REGIONS, a, b)
    }
    assert shared <= {("raw_hits", "surfaces")}
    for region in arena.REGIONS:
        assert 0 <= placed(arena.REGIONS)[region.name] <= arena.plane_count() - region.planes


def test_regions_without_a_common_phase_share_memory() -> None:
    regions = (
        Region("a", 3, Phase.START | Phase.COMPACT),
        Region("b", 2, Phase.TRACE),
        Region("c", 2, Phase.COMPACT | Phase.TRACE),
        Region("d", 1, Phase.TRACE),
        Region("e", 3, Phase.COMPACT, may_cover=("a",)),
    )
    assert placed(regions) == {"a": 0, "b": 0, "c": 3, "d": 2, "e": 0}
    assert arena.plane_count(regions) == 5


def test_every_size_of_block_leaves_room_on_the_smallest_device() -> None:
    large, small = arena.BLOCK_SIZES
    assert arena.block_paths(INTEL_LOCAL_MEMORY) == large
    assert arena.byte_count(small, arena.plane_count() + MORE_PLANES) <= INTEL_LOCAL_MEMORY


def test_blocks_get_smaller_with_the_memory_of_the_device() -> None:
    large, small = arena.BLOCK_SIZES
    assert arena.block_paths(arena.byte_count(large)) == large
    assert arena.block_paths(arena.byte_count(large) - 1) == small
    assert arena.block_paths(arena.byte_count(small) - 1) is None


def test_planes_do_not_compete_for_lines_of_the_cache() -> None:
    for paths in arena.BLOCK_SIZES:
        assert 4 * arena.stride(paths) % 64 == 0 and 4 * arena.stride(paths) % 2048 != 0


def test_the_header_has_every_region() -> None:
    header = arena.c_header(512)
    assert "#define BLOCK_PATHS 512u" in header and f"#define BLOCK_STRIDE {arena.stride(512)}u" in header
    for name, place in placed(arena.REGIONS).items():
        assert f"#define ARENA_{name.upper()} {place}u" in header


def test_the_device_traces_as_many_paths_at_a_time_as_fit(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    assert device.block_paths == arena.block_paths(device.cl_device.local_mem_size)
    monkeypatch.setattr(arena, "block_paths", lambda local_memory: None)
    assert not traces_in_blocks(Device())
