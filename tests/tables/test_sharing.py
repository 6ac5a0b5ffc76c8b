"""Sessions of one device share geometry: what the second one uploads and builds, and that both are right."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt.accel import bvh
from incpt.benchmarks.kit.scenes import icosphere
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import geometry_pool, range_buffer
from incpt.tables.geometry_pool import GeometryPool


def ball(radius: float) -> Mesh:
    """A mesh that no other test has."""
    mesh = icosphere(3)
    return Mesh(np.float32(radius) * mesh.vertices, mesh.faces)


def with_ball(mesh: Mesh, x: float = 0.0) -> Scene:
    return mixed_scene().with_added(Object("ball", mesh, "grey", (x, 0.6, 0.9), scale=(0.5, 0.5, 0.5)))


@contextmanager
def own_pool() -> Iterator[None]:
    """Sessions that start here share nothing with those of before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry_pool, "_POOLS", WeakValueDictionary())
        yield


@pytest.fixture
def _alone() -> Iterator[None]:
    with own_pool():
        yield


@pytest.fixture
def uploads(device: Device, monkeypatch: pytest.MonkeyPatch) -> list[npt.NDArray[Any]]:
    """Every array that goes to the device."""
    seen: list[npt.NDArray[Any]] = []
    upload, write = device.upload, device.write
    monkeypatch.setattr(device, "upload", lambda array: (seen.append(array), upload(array))[1])
    monkeypatch.setattr(
        device, "write", lambda buffer, array, offset=0: (seen.append(array), write(buffer, array, offset))[1]
    )
    return seen


@pytest.fixture
def trees(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of boxes of every tree that is built."""
    counts: list[int] = []
    build = bvh.build_boxes
    monkeypatch.setattr(bvh, "build_boxes", lambda *args: (counts.append(args[1]), build(*args))[1])
    return counts


@pytest.mark.usefixtures("_alone")
def test_a_second_session_uploads_no_mesh(
    device: Device, uploads: list[npt.NDArray[Any]], trees: list[int]
) -> None:
    mesh = ball(1.5)
    first = Session(with_ball(mesh), device=device)
    assert len(mesh.faces) in trees
    nbytes = sum(array.nbytes for array in uploads)
    uploads.clear(), trees.clear()
    copy = Mesh(mesh.vertices.copy(), mesh.faces.copy())
    second = Session(with_ball(copy, 0.7), device=device)
    # Only the small tables and the top level, of a scene with another place of the ball, are its own.
    assert len(mesh.faces) not in trees
    held = [pooled.built.tree for pooled in second._tables.meshes.values()]
    assert not any(array is tree.nodes or array is tree.packs for array in uploads for tree in held)
    assert sum(array.nbytes for array in uploads) < nbytes / 10
    assert first._tables.meshes[mesh] is second._tables.meshes[copy]


@pytest.mark.usefixtures("_alone")
def test_a_split_view_builds_no_tree_twice(
    device: Device, uploads: list[npt.NDArray[Any]], trees: list[int]
) -> None:
    scene = with_ball(ball(1.6))
    left = Session(scene, settings=replace(scene.settings, strategy="spiral"), device=device)
    assert trees
    trees.clear(), uploads.clear()
    right = Session(scene, settings=replace(scene.settings, strategy="restart"), device=device)
    assert not trees and not uploads
    for x in (0.1, 0.2):
        scene = scene.with_object("ball", position=(x, 0.6, 0.9))
        left.edit(scene)
        assert trees
        trees.clear(), uploads.clear()
        right.edit(scene)
        assert not trees and not uploads
    assert left._tables is right._tables


@pytest.mark.usefixtures("_alone")
def test_adding_a_cube_uploads_a_cube(
    device: Device, uploads: list[npt.NDArray[Any]], trees: list[int]
) -> None:
    session = Session(with_ball(ball(1.7)).without_object("red cube"), device=device)
    cube = replace(shape("cube"), vertices=shape("cube").vertices.copy())
    uploads.clear(), trees.clear()
    session.edit(session.scene.with_added(Object("new", cube, "red")))
    tree = session._tables.meshes[cube].built.tree
    pooled = [array for array in uploads if array is tree.nodes or array is tree.packs]
    assert len(pooled) == 2 and trees[0] == len(cube.faces)
    # The rest is small: the tables of objects, lights and materials, and the top level.
    assert sum(array.nbytes for array in uploads) < 100_000
    uploads.clear(), trees.clear()
    session.edit(session.scene.with_added(Object("another", cube, "red", (0.5, 0.5, 0.5))))
    assert not any(array is tree.nodes or array is tree.packs for array in uploads)
    assert len(cube.faces) not in trees


def picture(scene: Scene, device: Device) -> npt.NDArray[np.float32]:
    """What a session shows that shares nothing."""
    with own_pool():
        session = Session(replace(scene), device=device)
        session.render(2)
        return session.image()


@pytest.mark.slow
@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize("in_blocks", [True, False])
def test_two_sessions_take_turns(device: Device, monkeypatch: pytest.MonkeyPatch, in_blocks: bool) -> None:
    """While one is edited, so that the pool grows and meshes move, the other goes on with its picture."""
    # Without room to spare, what is added moves the rest together wherever there are gaps.
    monkeypatch.setattr(range_buffer, "_LEAST_CAPACITY", 1)
    monkeypatch.setattr(range_buffer, "_ROOM", 1.0)
    # Under a strategy that keeps an anchor the geometry of that would stay, too.
    balls = (with_ball(ball(r), r - 2) for r in (1.8, 1.9))
    first, second = (
        Session(scene, settings=replace(scene.settings, strategy="restart"), device=device) for scene in balls
    )
    for session in (first, second):
        session._tracer = session._tracer if in_blocks else Wavefront(device)
    pool = first._tables.pool
    assert second._tables.pool is pool
    packings = pool.packings
    for i in range(3):
        # The old ball leaves a gap, which is too small for the new one and the lump together.
        other = second.scene.with_object("ball", mesh=ball(2 + 0.1 * i))
        second.edit(other.with_added(Object(f"lump {i}", icosphere(2), "red", (i - 1.0, 1.2, 0.5))))
        lump = replace(icosphere(2), vertices=np.float32(1 + i) * icosphere(2).vertices)
        first.edit(first.scene.with_object("red cube", mesh=lump, scale=(0.3, 0.3, 0.3)))
        second.restart(), first.restart()
        first.render(2), second.render(2)
        for session in (first, second):
            if in_blocks:
                np.testing.assert_array_equal(session.image(), picture(session.scene, device))
            else:
                np.testing.assert_allclose(
                    session.image(), picture(session.scene, device), rtol=2e-4, atol=1e-5
                )
    assert pool.packings > packings


@pytest.mark.usefixtures("_alone")
def test_tables_follow_meshes_that_move(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh goes that lay in front of those of a session, which is not edited meanwhile."""
    session = Session(with_ball(ball(2.6)), device=device)
    pool = session._tables.pool
    held = pool.hold([ball(2.7)])
    session.edit(session.scene.with_object("ball", mesh=ball(2.8)))
    session.render(2)
    expected, packings = session.image(), pool.packings
    held.clear()
    monkeypatch.setattr(range_buffer, "_LEAST_USE", 1.0)
    monkeypatch.setattr(range_buffer, "_ROOM", 1.0)
    pool.shrink()
    assert pool.packings > packings
    session.restart()
    session.render(2)
    np.testing.assert_allclose(session.image(), expected, rtol=2e-4, atol=1e-5)


@pytest.mark.usefixtures("_alone")
def test_an_edit_after_a_large_scene_gives_memory_back(device: Device) -> None:
    session = Session(with_ball(icosphere(6)), device=device)
    pool = session._tables.pool
    capacity = pool._packs.capacity
    session.edit(session.scene.without_object("ball").without_object("glass ball"))
    session.edit(session.scene.with_camera(fov_y=50.0))
    assert pool._packs.capacity < capacity / 4


@pytest.mark.usefixtures("_alone")
def test_geometry_goes_with_the_last_session(device: Device) -> None:
    scene = with_ball(ball(2.5))
    first, second = (Session(replace(scene), device=device) for _ in range(2))
    pool = GeometryPool.of(device)
    taken = pool._packs.used
    del first
    gc.collect()
    assert pool._packs.used == taken
    of_ball = len(second._tables.meshes[scene.object("ball").mesh].built.tree.packs)
    second.edit(second.scene.without_object("ball"))
    assert pool._packs.used == taken - of_ball
    del second
    gc.collect()
    assert pool._packs.used == 0
