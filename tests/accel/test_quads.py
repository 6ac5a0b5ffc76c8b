"""Parallelograms and parallelepipeds among few triangles, and rays against them by brute force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.accel import clusters, quads
from incpt.benchmarks.kit.scenes import crowd, icosphere
from incpt.core import affine, bindings, layout
from incpt.core.layout import SurfacePlane
from incpt.device.device import Device
from incpt.render import blocks
from incpt.render.blocks import traces_in_blocks
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import SceneTables, tables_of

Floats = npt.NDArray[np.float32]


def grid(columns: int, rows: int, skew: float = 0.0) -> Mesh:
    """A flat net of parallelograms, each cut in two."""
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    vertices = np.stack([x + skew * y, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below, above = corner, corner + columns + 1
    faces = np.concatenate([
        np.stack([below, below + 1, above + 1], axis=1), np.stack([above + 1, above, below], axis=1)
    ])  # fmt: skip
    return Mesh(vertices, faces)


def soup(count: int, seed: int) -> Mesh:
    """Triangles that share nothing."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(3 * count, 3)) * 0.4 + np.repeat(rng.normal(size=(count, 3)), 3, axis=0)
    return Mesh(vertices.astype(np.float32), np.arange(3 * count).reshape(-1, 3))


def turned(mesh: Mesh, seed: int) -> Mesh:
    """The same faces in another order, each from another corner on, with vertices of their own, and a normal
    at each corner that tells it from all others."""
    rng = np.random.default_rng(seed)
    faces = np.stack([np.roll(face, rng.integers(3)) for face in mesh.faces])[
        rng.permutation(len(mesh.faces))
    ]
    normals = rng.normal(size=(len(faces), 3, 3)) + np.array([0, 0, 3.0])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Mesh(
        mesh.vertices[faces].reshape(-1, 3),
        np.arange(3 * len(faces)).reshape(-1, 3),
        normals.astype(np.float32),
    )


# --------------------------------------------------------------------------------------------- pairing


def check_quads(mesh: Mesh, own: quads.Quads) -> int:
    """Asserts that quads are what they are said to be; returns how many are parallelograms."""
    pairs = own.faces[:, 0] != own.faces[:, 1]
    every = np.concatenate([own.faces[:, 0], own.faces[pairs, 1]])
    assert sorted(every) == list(range(len(mesh.faces)))
    position = mesh.vertices.astype(np.float64)
    a, b, c, d = position[own.corners].transpose(1, 0, 2)
    scale = np.abs(position).max()
    np.testing.assert_allclose((a + c)[pairs], (b + d)[pairs], rtol=0, atol=1e-6 * scale)
    for half, corners in ((0, own.corners[:, [0, 1, 2]]), (1, own.corners[:, [0, 2, 3]])):
        at = (own.turns[:, half, None] + np.arange(3)) % 3
        found = mesh.vertices[mesh.faces[own.faces[:, half, None], at]]
        chosen = pairs if half else slice(None)
        np.testing.assert_array_equal(found[chosen], mesh.vertices[corners][chosen])
    assert (own.corners[~pairs, 2] == own.corners[~pairs, 3]).all()
    assert own.groups[0] == 0 and max(np.diff([*own.groups, len(own.faces)])) <= 8
    check_sides(mesh, own)
    return int(pairs.sum())


def check_sides(mesh: Mesh, own: quads.Quads) -> None:
    """Sides stand in order, and local axes lead from A to B and to D as they are said to."""
    assert len(own.faces) == own.loose + 6 * len(own.parallelepipeds)
    assert (own.along[: own.loose] == 0).all()
    position = mesh.vertices.astype(np.float64)
    for body, first in zip(own.parallelepipeds, range(own.loose, len(own.faces), 6), strict=True):
        axes = position[body[1:]] - position[body[0]]
        for side in range(6):
            local = np.linalg.solve(axes.T, (position[own.corners[first + side]] - position[body[0]]).T).T
            np.testing.assert_allclose(local[:, side // 2], side % 2, atol=1e-5)
            for bits, corner in ((own.along[first + side] & 7, 1), (own.along[first + side] >> 3, 3)):
                expected = np.zeros(3)
                expected[bits & 3] = -1 if bits & 4 else 1
                np.testing.assert_allclose(local[corner] - local[0], expected, atol=1e-5)


def sheared(mesh: Mesh, matrix: Any) -> Mesh:
    return Mesh((mesh.vertices @ np.array(matrix, float).T).astype(np.float32), mesh.faces)


@pytest.mark.parametrize(
    "matrix", [np.eye(3), np.diag([-2, 3, 0.1]), [[1, 0.3, 0], [0, 2, 0.7], [0.1, 0, 1]]]
)
@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_cube_is_a_parallelepiped(matrix: Any, seed: int | None) -> None:
    mesh = sheared(shape("cube"), matrix)
    if seed is not None:
        mesh = turned(mesh, seed)
    own = quads.find_quads(mesh)
    assert check_quads(mesh, own) == 6
    assert own.loose == 0 and len(own.parallelepipeds) == 1


def joined(*meshes: Mesh) -> Mesh:
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def moved(mesh: Mesh, *by: float) -> Mesh:
    return Mesh(mesh.vertices + np.float32(by), mesh.faces)


def test_parallelepipeds_beside_other_quads() -> None:
    mesh = joined(moved(grid(3, 2), 5, 0, 0), shape("cube"), soup(3, 1), moved(shape("cube"), 0, 3, 0))
    own = quads.find_quads(mesh)
    assert check_quads(mesh, own) == 6 + 12
    assert own.loose == 6 + 3 and len(own.parallelepipeds) == 2


_CUBE = shape("cube")


@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(_CUBE.vertices, _CUBE.faces[:-2]),  # open
        Mesh(_CUBE.vertices, _CUBE.faces[:-1]),
        joined(_CUBE, moved(_CUBE, 1, 1, 1)),  # two that share a corner
        joined(_CUBE, moved(_CUBE, 1, 0, 0)),
        Mesh(_CUBE.vertices * np.where(_CUBE.vertices[:, 1:2] > 0, [0.5, 1, 0.5], 1), _CUBE.faces),
        sheared(_CUBE, np.diag([1, 0, 1])),  # flat
    ],
    ids=["open", "half", "corner", "side", "frustum", "flat"],
)
def test_what_is_no_parallelepiped(mesh: Mesh) -> None:
    own = quads.find_quads(mesh)
    check_quads(mesh, own)
    assert len(own.parallelepipeds) == 0 and own.loose == len(own.faces)


@pytest.mark.slow
@given(st.integers(1, 6), st.integers(1, 6), st.sampled_from([0.0, 0.3, -1.7]), st.integers(0, 99))
def test_nets_pair_up_whatever_corner_faces_start_with(
    columns: int, rows: int, skew: float, seed: int
) -> None:
    mesh = turned(grid(columns, rows, skew), seed)
    assert check_quads(mesh, quads.find_quads(mesh)) >= 0.9 * columns * rows


@given(st.integers(1, 40), st.integers(0, 99))
def test_triangles_that_share_nothing_stay_alone(count: int, seed: int) -> None:
    mesh = soup(count, seed)
    assert check_quads(mesh, quads.find_quads(mesh)) == 0


@pytest.mark.parametrize(
    "faces",
    [
        [[0, 1, 2], [2, 0, 3]],  # the winding of the second is against that of the first
        [[0, 1, 2], [0, 2, 4]],  # a trapezium
        [[0, 1, 2], [2, 1, 0]],  # both sides of a triangle
        [[0, 1, 2], [0, 2, 5]],  # not in a plane
    ],
)
def test_what_is_no_parallelogram(faces: list[list[int]]) -> None:
    points = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0.5, 0], [0, 1, 1e-3]])
    assert check_quads(Mesh(points, faces), quads.find_quads(Mesh(points, faces))) == 0


def test_half_a_parallelogram_in_large_coordinates_is_told_by_its_rounding() -> None:
    far = Mesh(grid(2, 2).vertices * np.float32(1e-3) + np.float32(1000.1), grid(2, 2).faces)
    assert check_quads(far, quads.find_quads(far)) == 4


# ------------------------------------------------------------------------------------------- clusters


def scene_of(objects: Sequence[Object]) -> Scene:
    return Scene(Camera(), Environment(color=(1, 1, 1)), {"white": Material()}, tuple(objects))


def described(device: Device, scene: Scene) -> SceneTables:
    return tables_of(GeometryPool.of(device), scene)


def arranged(device: Device, scene: Scene) -> dict[str, npt.NDArray[np.void]]:
    """QUAD, PARALLELEPIPED and CLUSTER as they are on the device."""
    tables = described(device, scene)
    found = {}
    for name, dtype in (
        ("quads", layout.QUAD),
        ("parallelepipeds", layout.PARALLELEPIPED),
        ("clusters", layout.CLUSTER),
    ):
        buffer = tables.buffer(name)
        found[name] = device.read(buffer, np.empty(buffer.size // dtype.itemsize, dtype))
    assert tables.cluster_count == len(found["clusters"])
    return found


def check_tables(tables: dict[str, npt.NDArray[np.void]], loose: int, parallelepipeds: int) -> None:
    rows, table = tables["quads"], tables["clusters"]
    assert len(table) <= clusters.MOST_CLUSTERS
    for first, end, count in (
        ("first", "end", loose),
        ("first_parallelepiped", "parallelepiped_end", parallelepipeds),
    ):
        assert table[first].tolist() == [0, *table[end][:-1].tolist()] and table[end][-1] == count
    assert tables["parallelepipeds"]["first_side"][:parallelepipeds].tolist() == [
        loose + 6 * i for i in range(parallelepipeds)
    ]
    for body in tables["parallelepipeds"][:parallelepipeds]:
        away = rows["vertex"][body["first_side"] : body["first_side"] + 6].reshape(6, 4, 3) - body["corner"]
        local = away @ body["local_from_world"].reshape(3, 3).T
        for side in range(6):
            np.testing.assert_allclose(local[side, :, side // 2], side % 2, atol=1e-3)
    for i, cluster in enumerate(table):
        first, middle, end = (int(cluster[name]) for name in ("first", "first_triangle", "end"))
        single = rows["place"][first:end, 0] == rows["place"][first:end, 1]
        np.testing.assert_array_equal(single, np.arange(first, end) >= middle)
        sides = [
            rows["vertex"][side : side + 6]
            for side in tables["parallelepipeds"]["first_side"][
                cluster["first_parallelepiped"] : cluster["parallelepiped_end"]
            ]
        ]
        corners = np.concatenate([rows["vertex"][first:end], *sides]).reshape(-1, 3)
        if i < len(table) - 1:
            least, greatest = cluster["bounds"].reshape(3, 2).T
            assert (corners.min(axis=0) == least).all() and (corners.max(axis=0) == greatest).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 60), st.integers(0, 6), st.integers(0, 10), st.integers(0, 99))
def test_every_quad_is_in_a_cluster(device: Device, planes: int, cubes: int, alone: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    meshes = [shape("plane")] * planes + [shape("cube")] * cubes + ([soup(alone, seed)] if alone else [])
    objects = [
        Object(
            f"{i}", mesh, "white", tuple(rng.normal(size=3)), tuple(rng.uniform(0, 360, 3)), (0.3, 0.5, 0.7)
        )
        for i, mesh in enumerate(meshes)
    ]
    scene = scene_of(objects)
    if "BRUTE_FORCE" not in described(device, scene).variant:
        return
    tables = arranged(device, scene)
    assert len(tables["quads"]) == planes + 6 * cubes + alone
    check_tables(tables, planes + alone, cubes)


def test_a_parallelepiped_that_is_too_thin_stands_for_its_sides(device: Device) -> None:
    sheet = Object("sheet", shape("cube"), "white", (5, 0, 0), scale=(1, 1e-5, 1))
    brick = Object("brick", shape("cube"), "white", (0, 1, 0), (0, 20, 0), (1, 0.1, 1))
    check_tables(arranged(device, scene_of([sheet, brick])), 6, 1)


def test_parallelepipeds_stand_in_the_order_of_their_clusters(device: Device) -> None:
    room = Object("room", shape("cube"), "white", scale=(9, 9, 9))  # whose box is not worth asking
    bricks = [Object(f"{i}", shape("cube"), "white", (i, 0, 0), (0, 9 * i, 0), (0.3,) * 3) for i in (-2, 2)]
    tables = arranged(device, scene_of([room, *bricks]))
    check_tables(tables, 0, 3)
    assert tables["clusters"]["parallelepiped_end"].tolist() == [1, 2, 3]


def test_small_bodies_get_boxes_and_walls_do_not(device: Device) -> None:
    walls = [Object("floor", shape("plane"), "white", scale=(4, 1, 4)),
             Object("wall", shape("plane"), "white", (0, 2, -2), (90, 0, 0), (4, 1, 4))]  # fmt: skip
    bodies = [Object(f"{i}", shape("cube"), "white", (i, 0.2, 0), scale=(0.3,) * 3) for i in (-1, 1)]
    table = arranged(device, scene_of(walls + bodies))["clusters"]
    assert table["parallelepiped_end"].tolist() == [1, 2, 2] and table["end"].tolist() == [0, 0, 2]


def test_faces_without_area_are_left_out(device: Device) -> None:
    points = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    mesh = Mesh(points, [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    check_tables(arranged(device, scene_of([Object("one", mesh, "white")])), 1, 0)
    nothing = Mesh(points, [[0, 1, 4], [1, 0, 4]])
    check_tables(arranged(device, scene_of([Object("none", nothing, "white")])), 0, 0)


# ---------------------------------------------------------------------------------------------- brute force

_KERNEL = """
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) WIDE void
surfaces_of_rays(const uint count, __global const float *given, BLOCK_PARAMETERS, __global float *planes) {
    const Block block = BLOCK_OF(0, 0, 0, 0, 0, 0, count);
    for (uint i = 0; i < block.size; i++) {
        for (uint p = 0; p < RAY_PLANES; p++)
            block.state.rays[p * BLOCK_STRIDE + i] = given[p * count + block.first + i];
        store_class(&block.state, i, CLASS_LIVE);
        store_result(&block.state, i, i);
        ((__global uint *)planes)[SURFACE_OBJECT * count + block.first + i] = NO_INDEX;
    }
    BlockRay ray;
    ray.number = 0;
    ray.count = block.size;
    trace_rays(&block, &ray);
    setup_surfaces(&block, &ray);
    for (uint p = 0; p < SURFACE_PLANES; p++)
        for (uint i = 0; i < ray.count; i++)
            planes[p * count + block.first + load_result(&block.state, i)] =
                block.state.surfaces[p * BLOCK_STRIDE + i];
}
"""


def hits(device: Device, scene: Scene, rays: Floats, by_brute_force: bool) -> Floats:
    """(SURFACE_PLANES, N) of what `rays` (6, N) meet, by brute force or by the way of trees."""
    tables = described(device, scene)
    assert "BRUTE_FORCE" in tables.variant
    features = tuple(name for name in tables.variant if by_brute_force or name != "BRUTE_FORCE")
    count = rays.shape[1]
    planes = device.empty(4 * len(SurfacePlane) * count)
    values = {"count": count, "given": device.upload(rays), "planes": planes}
    if not by_brute_force:
        values["top_nodes"] = tables.buffer("top_nodes")
    groups = (
        bindings.Group(
            "OWN", None, (bindings.Argument("count", "uint", ""), bindings.Argument("given", "*", ""))
        ),
        *bindings.BLOCK,
        bindings.Group("RESULT", None, (bindings.Argument("planes", "*", ""),)),
    )
    text = device.program_text("trace_blocks", features) + _KERNEL
    kernel = cl.Kernel(device.build(text, "the test"), "surfaces_of_rays")
    blocks.launch(device, kernel, groups, count, values, tables)
    return device.read(planes, np.empty((len(SurfacePlane), count), np.float32))


def rays_at(scene: Scene, count: int, seed: int, size: float = 1.0) -> Floats:
    """From around the objects, that are of that size, to points among them, and along all axes."""
    rng = np.random.default_rng(seed)
    bounds = np.stack([obj.world_bounds for obj in scene.objects])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    origins = rng.uniform(low - size, high + size, (count, 3))
    directions = rng.uniform(low, high, (count, 3)) - origins
    along = rng.integers(0, 4, count)
    directions[along < 3] = (
        np.where(rng.random((count, 1)) < 0.5, -1.0, 1.0)[along < 3] * np.eye(3)[along[along < 3]]
    )
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.ascontiguousarray(np.hstack([origins, directions]).T, np.float32)


def check_brute_force(device: Device, scene: Scene, rays: Floats) -> None:
    forced, walked = (hits(device, scene, rays, way) for way in (True, False))
    found, expected = (h[SurfacePlane.OBJECT].view(np.uint32) != layout.NO_INDEX for h in (forced, walked))
    np.testing.assert_array_equal(found, expected)
    assert 0.05 < found.mean() < 1
    forced, walked = forced[:, found], walked[:, found]
    scale = np.abs(walked[SurfacePlane.POSITION_X : SurfacePlane.POSITION_Z + 1]).max()
    distances = (hit[SurfacePlane.DISTANCE] for hit in (forced, walked))
    np.testing.assert_allclose(*distances, rtol=1e-5, atol=3e-7 * scale)
    same = np.ones(found.sum(), np.bool_)
    for plane in (SurfacePlane.OBJECT, SurfacePlane.FACE, SurfacePlane.MATERIAL):
        same &= forced[plane].view(np.uint32) == walked[plane].view(np.uint32)
    assert same.mean() > 0.99  # the others lie on an edge
    for first, atol in (
        (SurfacePlane.POSITION_X, 3e-6 * scale),
        (SurfacePlane.GEOMETRIC_X, 1e-6),
        (SurfacePlane.SHADING_X, 1e-4),
    ):
        np.testing.assert_allclose(
            forced[first : first + 3, same], walked[first : first + 3, same], rtol=0, atol=atol
        )


def placed(meshes: Sequence[Mesh], seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    return scene_of([
        Object(f"{i}", mesh, "white", tuple(rng.normal(size=3)), tuple(rng.uniform(0, 360, 3)),
               tuple(rng.uniform(0.4, 1.5, 3) * rng.choice([-1, 1], 3)))
        for i, mesh in enumerate(meshes)
    ])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_brute_force_meets_what_trees_meet(device: Device, seed: int) -> None:
    """Object, face, position and normals, whichever half of a parallelogram and wherever faces start."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    meshes = [turned(grid(2, 3, 0.4), seed), shape("cube"), soup(9, seed), turned(shape("cube"), seed + 1)]
    scene = placed(meshes, seed)
    check_brute_force(device, scene, rays_at(scene, 5000, seed))


@pytest.mark.parametrize("size", [1e-5, 1e5])
def test_brute_force_in_small_and_large_scenes(device: Device, size: float) -> None:
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    scene = placed([turned(grid(3, 3), 5), shape("cube")], 5)
    objects = [
        replace(obj, position=tuple(size * c for c in obj.position), scale=tuple(size * c for c in obj.scale))
        for obj in scene.objects
    ]
    scene = replace(scene, objects=tuple(objects))
    check_brute_force(device, scene, rays_at(scene, 3000, 5, size))


def test_no_ray_slips_through_the_seams_of_parallelograms(device: Device) -> None:
    """Rays from within a closed body to points on its edges, corners and the diagonals of its sides."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    scene = placed([shape("cube")], 7)
    box = scene.objects[0]
    rng = np.random.default_rng(7)
    vertices = box.mesh.vertices.astype(np.float64)
    world = affine.apply(box.world_from_object, vertices).astype(np.float32)
    faces = rng.integers(0, len(box.mesh.faces), 20000)
    side = rng.integers(0, 3, 20000)
    ends = world[box.mesh.faces[faces, side]], world[box.mesh.faces[faces, (side + 1) % 3]]
    share = rng.choice([0.0, 1.0, 0.5, 0.25, 0.7], 20000)[:, None].astype(np.float32)
    target = ends[0] + share * (ends[1] - ends[0])
    origin = np.tile(world.mean(axis=0), (20000, 1)) + rng.normal(size=(20000, 3)) * 0.02
    direction = target - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = np.ascontiguousarray(np.hstack([origin, direction]).T, np.float32)
    found = hits(device, scene, rays, by_brute_force=True)
    assert (found[SurfacePlane.OBJECT].view(np.uint32) == 0).all()


def test_rays_along_the_sides_of_a_parallelepiped(device: Device) -> None:
    """Some components of their directions are 0 in its coordinates, and the rays start inside."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    rng = np.random.default_rng(3)
    origins = rng.uniform(-0.9, 0.9, (6000, 3))
    directions = rng.normal(size=(6000, 3)) * (rng.random((6000, 3)) < 0.5)
    directions[~directions.any(axis=1)] = (0, 1, 0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = np.ascontiguousarray(np.hstack([origins, directions]).T, np.float32)
    scene = scene_of([Object("room", shape("cube"), "white", scale=(2, 2, 2))])
    found, expected = (hits(device, scene, rays, way) for way in (True, False))
    assert (found[SurfacePlane.OBJECT].view(np.uint32) == 0).all()
    distances = (planes[SurfacePlane.DISTANCE] for planes in (found, expected))
    np.testing.assert_allclose(*distances, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "placement",
    [
        {"rotation": (12, 34, 56)},
        {"rotation": (12, 34, 56), "scale": (100, 0.01, 3)},
        {"position": (1000, -300, 50), "rotation": (1, 2, 3)},
        {"position": (5, 5, 5), "rotation": (45, 0, 30), "scale": (100, 100, 100)},
    ],
)
@pytest.mark.parametrize("name", ["plane", "cube"])
def test_rays_from_a_side_never_meet_it_again(device: Device, name: str, placement: dict[str, Any]) -> None:
    """As those from triangles (test_bvh.py): distances in the half ACD are those of the plane through ABC,
    and those to parallelepipeds come about in another way than the positions that rays start from."""
    if not traces_in_blocks(device):
        pytest.skip("no blocks on this device")
    rng = np.random.default_rng(23)
    scene = scene_of([Object("one", shape(name), "white", **placement)])
    matrix = scene.objects[0].world_from_object
    local = rng.uniform(-0.5, 0.5, (20000, 3))
    if name == "plane":
        local[:, 1] = 0
    targets = affine.apply(matrix, local)
    origins = targets + rng.normal(size=targets.shape) * rng.choice([0.1, 1, 30], (20000, 1))

    def met(starts: npt.NDArray[Any], directions: npt.NDArray[Any]) -> Floats:
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        rays = np.ascontiguousarray(np.hstack([starts, unit]).T, np.float32)
        return hits(device, scene, rays, by_brute_force=True)

    first = met(origins, targets - origins)
    first = first[:, first[SurfacePlane.OBJECT].view(np.uint32) != layout.NO_INDEX]
    assert len(first.T) > 15000
    assert len(np.unique(first[SurfacePlane.FACE].view(np.uint32))) > len(scene.objects[0].mesh.faces) / 2
    position = first[SurfacePlane.POSITION_X : SurfacePlane.POSITION_Z + 1].T
    normal = first[SurfacePlane.GEOMETRIC_X : SurfacePlane.GEOMETRIC_Z + 1].T
    away = rng.normal(size=normal.shape)
    away -= normal * np.sum(away * normal, axis=1, keepdims=True)
    up = normal * 10 ** rng.uniform(-7, 1, (len(away), 1))
    for side in (1, -1):
        again = met(position + side * first[SurfacePlane.OFFSET][:, None] * normal, away + side * up)
        hit = again[SurfacePlane.OBJECT].view(np.uint32) != layout.NO_INDEX
        if name == "cube" and side == -1:
            assert hit.mean() > 0.99  # the others have left along an edge
            same = (
                np.sum(again[SurfacePlane.GEOMETRIC_X : SurfacePlane.GEOMETRIC_Z + 1].T * normal, axis=1)
                > 0.999
            )
            hit &= same
        assert not hit.any(), (side, hit.sum())


@pytest.mark.parametrize(
    ("count", "mesh", "by_brute_force"),
    [
        (40, None, True),
        (200, None, False),
        (2, icosphere(1), True),
        (6, icosphere(1), False),
        (16, icosphere(0), False),
    ],
    ids=["boxes", "many boxes", "balls", "more balls", "small balls"],
)
def test_what_is_quicker_by_a_tree_is_not_done_by_brute_force(
    device: Device, count: int, mesh: Mesh | None, by_brute_force: bool
) -> None:
    variant = described(device, crowd(count, mesh)).variant
    assert "TOP_LEVEL_ONLY" in variant and ("BRUTE_FORCE" in variant) == by_brute_force


def test_dear_clusters_are_not_done_by_brute_force(device: Device) -> None:
    """Few enough quads, but nearly all rays would meet all of them."""
    nest = Object("nest", soup(100, 3), "white")
    assert "BRUTE_FORCE" not in described(device, scene_of([nest])).variant
    assert "BRUTE_FORCE" in described(device, scene_of([replace(nest, mesh=soup(30, 3))])).variant
