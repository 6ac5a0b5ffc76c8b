"""Batches of paths: the same ones in another scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import cornell, glass
from incpt.device.device import Device
from incpt.render.film import Film
from incpt.render.session import Session
from incpt.render.tracer import tracer_of
from incpt.render.wavefront import Wavefront
from incpt.scene.environment import Environment
from incpt.scene.model import Scene
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import tables_of


def dark_scene() -> Scene:
    """The mixed scene without lamp and sky, under a plain grey."""
    scene = mixed_scene()
    return replace(scene.without_object("lamp"), environment=Environment((0.2, 0.2, 0.2)))


def without_sky() -> Scene:
    """The mixed scene with a weaker lamp and nothing around it."""
    scene = mixed_scene().with_material("lamp", emission=(3, 2, 1))
    return replace(scene, environment=Environment((0, 0, 0)))


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [False, True], ids=["wavefront", "blocks"])
@pytest.mark.parametrize("other", [dark_scene, without_sky, cornell, glass], ids=lambda make: make.__name__)
def test_the_same_paths_in_another_scene(other: Callable[[], Scene], in_blocks: bool, device: Device) -> None:
    """A batch with other tables brings what the same pixels and samples bring in a session with that scene,
    whether it has other lights, another sky, no media, or no trees."""
    scene = mixed_scene(base_nor=3)
    there = replace(other(), camera=scene.camera, settings=scene.settings)
    tracer = tracer_of(device) if in_blocks else Wavefront(device)
    fresh = Session(there, device=device)
    fresh._tracer = tracer
    fresh.render(3)

    session = Session(scene, device=device)
    plan = session.progress.planned(3 * session.grid.count)
    batch = session._batch(plan.slots, session._state.path_buffer.grown(device, len(plan.slots), 8))
    before = batch.params.copy()
    tracer.trace(replace(batch, tables=tables_of(GeometryPool.of(device), there)))
    film = Film(device, *session.size)
    film.reduce(batch.params, plan, batch.slots, batch.path_buffer)
    np.testing.assert_array_equal(film.image(), fresh.image(alpha=True))
    assert batch.params == before and fresh.image().any()


@pytest.mark.parametrize("in_blocks", [False, True], ids=["wavefront", "blocks"])
@pytest.mark.parametrize("make", [mixed_scene, cornell], ids=lambda make: make.__name__)
def test_the_paths_of_a_list(make: Callable[[], Scene], in_blocks: bool, device: Device) -> None:
    """They bring what they bring among all paths, in the order of the list, to the bit."""
    session = Session(replace(make(), settings=mixed_scene().settings), device=device)
    tracer = tracer_of(device) if in_blocks else Wavefront(device)
    slots = 8 * session.grid.count
    path_buffer = session._state.path_buffer.grown(device, slots, 8)
    batch = session._batch(session.progress.planned(slots).slots, path_buffer)
    tracer.trace(batch)
    every = device.read(path_buffer.floats, np.empty((3, path_buffer.stride), np.float32))
    random = np.random.default_rng(0)
    for places in ([5], random.permutation(batch.path_count)[:1500], random.permutation(batch.path_count)):
        listed = np.array(places, np.uint32)
        tracer.trace(replace(batch, places=device.upload(listed), path_count=len(listed)))
        found = device.read(path_buffer.floats, np.empty((3, path_buffer.stride), np.float32))
        np.testing.assert_array_equal(found[:, : len(listed)], every[:, listed])
