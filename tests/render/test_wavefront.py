"""The wavefront keeps the lengths of its lists on the device, and goes through the same stages as blocks."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import cornell, glass
from incpt.core import bindings, layout, stages
from incpt.core.stages import STAGES
from incpt.device import program
from incpt.device.device import Device
from incpt.render import wavefront
from incpt.render.blocks import traces_in_blocks
from incpt.render.params import launch_params
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.model import Scene
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import SceneTables, tables_of


def described(device: Device, scene: Scene) -> SceneTables:
    return tables_of(GeometryPool.of(device), scene)


@pytest.mark.parametrize("make", [cornell, glass, mixed_scene], ids=lambda make: make.__name__)
def test_a_step_waits_for_one_read(
    make: Callable[[], Scene], device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of the film, when all is done; what the lists of paths hold is not waited for by reading it."""
    session = Session(make(), size=(32, 24), device=device)
    session._tracer = Wavefront(device)
    session.step()
    read, count = device.read, []

    def counted(*args: Any) -> Any:
        count.append(args)
        return read(*args)

    monkeypatch.setattr(device, "read", counted)
    session.step()
    assert len(count) == 1


def test_rays_end_where_the_scene_allows_no_more(device: Device) -> None:
    params = np.zeros((), layout.PARAMS)
    params["max_bounces"] = 3
    opaque, clear = (described(device, make()) for make in (cornell, glass))
    assert launch_params(params, opaque)["last_ray"] == 4
    assert launch_params(params, clear)["last_ray"] == layout.MOST_RAYS - 1
    assert params["last_ray"] == 0  # the parameters of the caller stay as they are
    params["max_bounces"] = 255
    assert launch_params(params, opaque)["last_ray"] == layout.MOST_RAYS - 1


def test_light_from_far_away_is_looked_for_where_there_is_some(device: Device) -> None:
    params = np.zeros((), layout.PARAMS)
    scene = cornell()
    for color, first_sky_ray in (((0, 0, 0), layout.MOST_RAYS), ((0, 0, 0.1), 0)):
        tables = described(device, scene.with_environment(color=color))
        assert launch_params(params, tables)["first_sky_ray"] == first_sky_ray


def test_long_paths_in_media_end(device: Device) -> None:
    """Many more rays than are enqueued ahead, of paths that end at different times."""
    images = []
    for in_blocks in (False, True):
        session = Session(mixed_scene(transmission_bounces=40, max_bounces=20), size=(24, 16), device=device)
        session._tracer = session._tracer if in_blocks else Wavefront(device)
        session.render(4)
        images.append(session.image())
    np.testing.assert_allclose(images[0].mean(), images[1].mean(), rtol=1e-3)
    assert np.median(np.abs(images[0] - images[1])) < 1e-5


def test_work_items_without_a_path_leave_those_of_others_alone(device: Device) -> None:
    """In chunks of another size other work-items lie beyond the lists."""
    images = []
    for chunk_paths in (320, 1 << 12):
        session = Session(mixed_scene(), size=(32, 24), device=device)
        session._tracer = tracer = Wavefront(device)
        tracer.chunk_paths = chunk_paths
        session.render(4)
        images.append(session.image())
    np.testing.assert_array_equal(*images)


@pytest.mark.slow
@pytest.mark.parametrize("without", ["shade_miss", "trace_shadow"])
def test_both_schedules_follow_the_table_of_stages(
    without: str, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stage that is not in the table is done by neither, so that the same light is missing in both."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    scene = cornell().with_environment(color=(0.3, 0.5, 0.7))

    def image(in_blocks: bool) -> npt.NDArray[np.float32]:
        own = Device()  # which knows no kernel of the other table
        session = Session(scene, size=(32, 24), device=own)
        session._tracer = session._tracer if in_blocks else Wavefront(own)
        session.render(2)
        return session.image()

    whole = image(in_blocks=True)
    monkeypatch.setattr(stages, "STAGES", tuple(one for one in STAGES if one.kernel != without))
    monkeypatch.setattr(wavefront, "_launches_of", wavefront._launches_of.__wrapped__)
    in_blocks, in_wavefront = image(in_blocks=True), image(in_blocks=False)
    assert (whole - in_blocks).mean() > 0.01
    np.testing.assert_allclose(in_blocks, in_wavefront, rtol=1e-3, atol=1e-4)


def test_kernels_get_the_features_that_they_ask_for() -> None:
    scene_has = {
        "ENVIRONMENT_IMAGE",
        "TRIANGLE_LIGHTS",
        "SHAPED_LIGHTS",
        "MEDIA",
        "SUN",
        "LENS",
        "CLAMP_INDIRECT",
    }
    for kernel in {"generate", *(stage.kernel for stage in STAGES)} - {None}:
        text = program.source(program.files()[bindings.FILES.get(kernel, kernel)])
        asked = {name for name in scene_has if re.search(rf"(ifn?def |defined\(){name}\b", text)}
        has = set(wavefront._FEATURES.get(kernel, ()))
        assert asked == has & scene_has, kernel
        if "surface_material(const" in text:
            assert {"TEXTURES", "VERTEX_COLORS", "TRAITS"} <= has, kernel
