"""The stages of a ray: their order, and what features leave of it."""

from __future__ import annotations

import re
from importlib import resources
from itertools import chain, combinations

import pytest

from incpt.core import bindings, stages
from incpt.core.layout import MOST_RAYS, PathList
from incpt.core.stages import STAGES, When, holding, last_ray, stages_of

FEATURES = ("ENVIRONMENT_IMAGE", "TRIANGLE_LIGHTS", "MEDIA", "AOVS", "CHANGES")
VARIANTS = list(chain.from_iterable(combinations(FEATURES, n) for n in range(len(FEATURES) + 1)))


def kernels_on(features: tuple[str, ...], holds: When) -> list[str]:
    return [stage.kernel for stage in stages_of(features) if stage.kernel and stage.when in holds]


def test_a_ray_from_the_camera_with_everything() -> None:
    assert kernels_on(FEATURES, holding(0, 5, sees_sky=True)) == [
        "intersect", "touch_rays", "shade_miss", "write_aovs", "sample_lights", "sample_lights",
        "shade_medium", "shade", "touch_shadow_rays", "trace_shadow",
    ]  # fmt: skip


def test_what_there_is_not_is_left_out() -> None:
    assert kernels_on((), holding(1, 5, sees_sky=False)) == ["intersect", "shade"]
    assert kernels_on(("CHANGES",), holding(1, 5, sees_sky=False)) == ["intersect", "touch_rays", "shade"]
    assert kernels_on(("AOVS",), holding(1, 5, sees_sky=True)) == ["intersect", "shade_miss", "shade"]
    lit = ("TRIANGLE_LIGHTS",)
    changed = holding(1, 5, sees_sky=False, has_changed_lights=True)
    assert "touch_lights" in kernels_on((*lit, "CHANGES"), changed)
    assert "touch_lights" not in kernels_on((*lit, "CHANGES"), holding(1, 5, False))
    assert "touch_lights" not in kernels_on(("ENVIRONMENT_IMAGE", "CHANGES"), changed)
    assert kernels_on(lit, changed) == kernels_on(lit, holding(1, 5, False))
    assert kernels_on(lit, holding(1, 5, False)) == ["intersect", "sample_lights", "shade", "trace_shadow"]


def test_nothing_goes_on_after_the_last_ray_but_in_media() -> None:
    lit, clear = ("TRIANGLE_LIGHTS",), ("TRIANGLE_LIGHTS", "MEDIA")
    last, before = holding(5, 5, sees_sky=False), holding(4, 5, sees_sky=False)
    assert [stage.loop for stage in stages_of(lit) if stage.when in last] == [
        "trace_rays", "setup_surfaces", "finish_paths",
    ]  # fmt: skip
    assert kernels_on(clear, last) == kernels_on(clear, before)
    assert "finish_paths" not in [stage.loop for stage in stages_of(clear)]


def test_the_last_ray() -> None:
    assert last_ray(3, has_media=False) == 4
    assert last_ray(255, has_media=False) == last_ray(3, has_media=True) == MOST_RAYS - 1


@pytest.mark.parametrize("features", VARIANTS, ids=lambda features: " ".join(features) or "plain")
def test_lists_are_complete_before_the_last_stage_that_reads_them(features: tuple[str, ...]) -> None:
    found = [stage for stage in stages_of(features) if stage.kernel is not None]
    for path_list in set(PathList) - {PathList.LIVE}:
        reads = [i for i, stage in enumerate(found) if stage.paths == path_list]
        grows = [i for i, stage in enumerate(found) if path_list in stage.sorts]
        assert not reads or min(grows) < min(reads) and max(grows) < max(reads)


@pytest.mark.parametrize("features", VARIANTS, ids=lambda features: " ".join(features) or "plain")
def test_features_leave_no_condition_of_theirs(features: tuple[str, ...]) -> None:
    asked = When.SKY | When.CHANGED_LIGHTS | When.CAMERA_RAY
    if "MEDIA" not in features:
        asked |= When.GOES_ON | When.ENDS
    assert all(stage.when in asked for stage in stages_of(features))


def test_every_kernel_over_a_list_is_a_stage() -> None:
    listed = {name for name, groups in bindings.KERNELS.items() if bindings.LIST in groups}
    assert {stage.kernel for stage in STAGES} - {None} == listed - {"compact"}


def test_calls_in_c() -> None:
    assert stages.c_header(("TRIANGLE_LIGHTS", "AOVS")) == (
        "#define STAGES_OF_RAY(block, ray) \\\n"
        "    trace_rays(block, ray); \\\n"
        "    if ((ray)->number == 0) write_alpha(block, ray); \\\n"
        "    if ((ray)->number >= (block)->params->first_sky_ray) shade_misses(block, ray); \\\n"
        "    setup_surfaces(block, ray); \\\n"
        "    if ((ray)->number == 0) write_aovs(block, ray); \\\n"
        "    if ((ray)->number != (block)->params->last_ray) shade_surfaces(block, ray); \\\n"
        "    if ((ray)->number == (block)->params->last_ray) finish_paths(block, ray); \\\n"
        "    if ((ray)->number != (block)->params->last_ray) trace_shadows(block, ray);\n"
    )


def test_functions_of_blocks_stand_in_the_order_of_stages() -> None:
    text = (resources.files("incpt.cl") / "cpu/trace_blocks.cl").read_text()
    defined = re.findall(r"^\w+ void (\w+)\(const Block \*block, (?:const )?BlockRay \*ray\)", text, re.M)
    loops = [stage.loop for stage in STAGES if stage.loop is not None]
    assert [name for name in defined if name in loops] == loops
