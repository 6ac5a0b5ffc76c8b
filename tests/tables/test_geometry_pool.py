"""Meshes on a device: each is built and uploaded once, and dropped when nobody holds it."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from incpt.accel import bvh, quads
from incpt.core import layout
from incpt.core.errors import DeviceError
from incpt.device.device import Device
from incpt.scene.mesh import Mesh
from incpt.scene.shapes import shape
from incpt.tables import geometry_pool, range_buffer
from incpt.tables.geometry_pool import GeometryPool, PooledMesh


def soup(count: int, seed: int = 0, smooth: bool = False) -> Mesh:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    vertices = rng.normal(size=(3 * count, 3)).astype(np.float32)
    return Mesh(vertices, np.arange(3 * count).reshape(-1, 3), normals if smooth else None)


def copied(mesh: Mesh) -> Mesh:
    """The same content in other arrays, as from a file that is read again."""
    normals = None if mesh.normals is None else mesh.normals.copy()
    return Mesh(mesh.vertices.copy(), mesh.faces.copy(), normals)


@pytest.fixture
def pool(device: Device) -> GeometryPool:
    return GeometryPool(device)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is done to get trees, in order."""
    done: list[str] = []
    for name in ("build_mesh", "refit_mesh"):
        original = getattr(bvh, name)
        monkeypatch.setattr(
            bvh, name, lambda *args, name=name, original=original: (done.append(name), original(*args))[1]
        )
    return done


def used(pool: GeometryPool) -> tuple[int, int, int]:
    """Nodes, packs, and floats of normals that are taken."""
    nodes, packs, normals = (pool._buffers[name].used for name in ("nodes", "packs", "normals"))
    return nodes, packs, normals


def read(pool: GeometryPool, name: str, dtype: npt.DTypeLike, first: int, count: int) -> npt.NDArray[np.void]:
    array = np.empty(count, dtype)
    return pool.device.read(pool.buffer(name), array, first * array.itemsize)


def check_place(pool: GeometryPool, mesh: Mesh, pooled: PooledMesh, tree: bvh.Bvh) -> None:
    """Where the handle says lies that tree, with the normals of the mesh."""
    first_node, first_pack, first_normal, is_smooth = pooled.place
    nodes = read(pool, "nodes", layout.NODE, first_node, len(tree.nodes))
    packs = read(pool, "packs", layout.TRIANGLE_PACK, first_pack, len(tree.packs))
    assert nodes.tobytes() == tree.nodes.tobytes() and packs.tobytes() == tree.packs.tobytes()
    if mesh.normals is None:
        assert (first_normal, is_smooth) == (0, 0)
    else:
        normals = read(pool, "normals", np.float32, first_normal, mesh.normals.size)
        np.testing.assert_array_equal(normals, mesh.normals.ravel())


def test_everything_is_where_handles_say(pool: GeometryPool, device: Device) -> None:
    meshes = [soup(30, 1), soup(200, 2, smooth=True), shape("cube"), soup(9, 3, smooth=True)]
    held = pool.hold(meshes[:2])
    held |= pool.hold(meshes)
    for mesh in meshes:
        check_place(pool, mesh, held[mesh], bvh.build_mesh(device, mesh))


def test_a_mesh_is_built_and_uploaded_once(pool: GeometryPool, built: list[str]) -> None:
    mesh = soup(100)
    held = [pool.hold([mesh, shape("cube"), mesh]), pool.hold([mesh])]
    assert held[0][mesh] is held[1][mesh] and built == ["build_mesh"] * 2
    assert used(pool)[0] == sum(len(pooled.built.tree.nodes) for pooled in held[0].values())


def test_the_same_content_is_the_same_mesh(pool: GeometryPool, built: list[str]) -> None:
    mesh = soup(100, smooth=True)
    first = pool.hold([mesh])
    before = used(pool)
    others = [copied(mesh), copied(mesh)]
    held = pool.hold(others)
    assert {*held.values()} == {first[mesh]} and built == ["build_mesh"] and used(pool) == before
    # The content lives as long as one of the meshes that have it.
    del mesh, first, held, others[0]
    gc.collect()
    assert used(pool) == (0, 0, 0)
    assert pool.hold(others) and built == ["build_mesh"]


@pytest.mark.parametrize("part", ["vertices", "faces", "normals", "no normals"])
def test_other_content_is_another_mesh(pool: GeometryPool, part: str) -> None:
    mesh = soup(20, smooth=True)
    other = {
        "vertices": replace(mesh, vertices=mesh.vertices * np.float32(1.0001)),
        "faces": replace(mesh, faces=mesh.faces[:, [1, 2, 0]]),
        "normals": replace(mesh, normals=-np.asarray(mesh.normals)),
        "no normals": replace(mesh, normals=None),
    }[part]
    held = pool.hold([mesh, other])
    assert held[mesh] is not held[other]
    for each in (mesh, other):
        check_place(pool, each, held[each], held[each].built.tree)


def test_what_nobody_holds_makes_room(pool: GeometryPool, built: list[str]) -> None:
    mesh, other = soup(500, 1, smooth=True), soup(20, 2)
    held, kept = pool.hold([mesh]), pool.hold([other])
    del held
    gc.collect()
    tree = kept[other].built.tree
    assert used(pool) == (len(tree.nodes), len(tree.packs), 0)
    check_place(pool, other, kept[other], tree)
    # The tree stays on the host, for undo.
    held = pool.hold([mesh])
    assert built == ["build_mesh"] * 2
    check_place(pool, mesh, held[mesh], held[mesh].built.tree)


def test_quads_are_found_once_where_they_are_asked_for(
    pool: GeometryPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[Mesh] = []
    find = quads.find_quads
    monkeypatch.setattr(quads, "find_quads", lambda mesh: (found.append(mesh), find(mesh))[1])
    cube = copied(shape("cube"))
    again = copied(cube)
    held = pool.hold([cube, again])
    assert not found
    assert held[cube].built.quads(cube) is held[again].built.quads(again)
    assert found == [cube] and len(held[cube].built.quads(cube).parallelepipeds) == 1


def test_a_deformed_mesh_keeps_the_shape_of_its_tree(pool: GeometryPool, built: list[str]) -> None:
    mesh = soup(300)
    bent = replace(mesh, vertices=mesh.vertices * np.float32([1, 3, 0.5]))
    held = pool.hold([mesh])
    pool.refit(mesh, bent)
    pool.refit(mesh, bent)
    held |= pool.hold([bent])
    assert built == ["build_mesh", "refit_mesh"]
    trees = [held[each].built.tree for each in (mesh, bent)]
    np.testing.assert_array_equal(trees[0].nodes["child"], trees[1].nodes["child"])
    for each, tree in zip((mesh, bent), trees, strict=True):
        check_place(pool, each, held[each], tree)
    # A mesh that comes from elsewhere does not get a tree that suits it badly.
    loaded = copied(bent)
    assert pool.hold([loaded])[loaded] is not held[bent] and built[2:] == ["build_mesh"]


def test_the_tree_of_an_unknown_mesh_is_built(pool: GeometryPool, built: list[str]) -> None:
    mesh = soup(30)
    bent = replace(mesh, vertices=2 * mesh.vertices)
    pool.refit(mesh, bent)
    pool.hold([bent])
    assert built == ["build_mesh"]


@pytest.mark.slow
@pytest.mark.parametrize("most", ["_MOST_NODES", "_MOST_PACKS", "_MOST_NORMALS"])
def test_an_error_takes_nothing(device: Device, monkeypatch: pytest.MonkeyPatch, most: str) -> None:
    monkeypatch.setattr(geometry_pool, most, 20)
    pool = GeometryPool(device)
    small, large = soup(2, 1, smooth=True), soup(900, 2, smooth=True)
    held = pool.hold([small])
    before = used(pool)
    with pytest.raises(DeviceError, match="kernels can address 20"):
        pool.hold([large])
    gc.collect()
    assert used(pool) == before
    check_place(pool, small, held[small], held[small].built.tree)


def test_limits_are_those_of_hits_and_indices() -> None:
    """The place of a hit has no bit of NODE_PACK set."""
    last_lane = geometry_pool._MOST_PACKS * layout.BVH_WIDTH - 1
    assert last_lane < layout.NODE_PACK <= last_lane + 1
    assert geometry_pool._MOST_NORMALS - 1 < layout.NO_INDEX


def test_memory_does_not_grow_with_edits(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two hundred times another mesh comes and one goes."""
    monkeypatch.setattr(range_buffer, "_LEAST_CAPACITY", 4)
    pool, rng = GeometryPool(device), np.random.default_rng(1)
    living, most, capacities = [], 0, []
    for i in range(200):
        mesh = soup(int(rng.integers(20, 400)), i, smooth=bool(i % 2))
        living.append((mesh, pool.hold([mesh])[mesh]))
        most = max(most, used(pool)[1])
        if len(living) > 5:
            del living[int(rng.integers(len(living)))]
        pool.shrink()
        capacities.append(pool._packs.capacity)
    assert most <= max(capacities) <= 1.25 * most
    for mesh, pooled in living:
        check_place(pool, mesh, pooled, pooled.built.tree)


def test_sessions_of_a_device_share_a_pool_while_one_lives(device: Device) -> None:
    pool = GeometryPool.of(device)
    assert GeometryPool.of(device) is pool
    other = Device(0)
    assert GeometryPool.of(other) is not pool
    known = weakref.ref(GeometryPool.of(other))
    assert known() is None, "a pool without users stays"
    gone = weakref.ref(other)
    del other
    assert gone() is None, "a pool keeps its device"
