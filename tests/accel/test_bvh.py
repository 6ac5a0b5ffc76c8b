"""Bounding volume hierarchies: their trees, and rays through them against brute force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.accel import bvh, top_level
from incpt.core import affine, bindings, layout
from incpt.core.errors import DeviceError, InputError
from incpt.core.layout import PathClass, PathPlane, RayPlane, ShadowPlane, SurfacePlane
from incpt.device.device import Device
from incpt.scene import model, shapes
from incpt.scene.mesh import Mesh

Floats = npt.NDArray[np.float32]


@dataclass
class Hits:
    """What `intersect` wrote, by plane."""

    planes: Floats
    classes: npt.NDArray[np.uint32]

    def floats(self, first: SurfacePlane, count: int = 1) -> Floats:
        return self.planes[first] if count == 1 else self.planes[first : first + count].T

    def uints(self, plane: SurfacePlane) -> npt.NDArray[np.uint32]:
        return self.planes[plane].view(np.uint32)

    @property
    def hit(self) -> npt.NDArray[np.bool_]:
        return self.uints(SurfacePlane.OBJECT) != layout.NO_INDEX


@dataclass
class World:
    """Objects on the device, as the kernels see them."""

    device: Device
    objects: Sequence[model.Object]
    trees: dict[int, bvh.Bvh] = field(default_factory=dict)
    material_flags: int = 0

    def __post_init__(self) -> None:
        nodes, packs, normals, first = [], [], [], {}
        counts = [0, 0, 0]
        for obj in self.objects:
            mesh = obj.mesh
            if id(mesh) in first:
                continue
            tree = self.trees.setdefault(id(mesh), bvh.build_mesh(self.device, mesh))
            first[id(mesh)] = (*counts[:2], *((0, 0) if mesh.normals is None else (counts[2], 1)))
            nodes.append(tree.nodes)
            packs.append(tree.packs)
            if mesh.normals is not None:
                normals.append(mesh.normals.ravel())
                counts[2] += mesh.normals.size
            counts[0] += len(tree.nodes)
            counts[1] += len(tree.packs)
        bounds = np.array([obj.world_bounds for obj in self.objects]).reshape(-1, 2, 3)
        top = top_level.build_top(self.device, bounds)
        records = np.zeros(max(len(self.objects), 1), layout.OBJECT)
        for record, obj in zip(records, self.objects, strict=False):
            matrix = obj.world_from_object
            record["world_from_object"] = matrix.ravel()
            inverse = affine.invert(matrix)
            record["object_from_world"] = inverse.ravel()
            columns = ("first_node", "first_pack", "first_normal", "is_smooth")
            for name, value in zip(columns, first[id(obj.mesh)], strict=True):
                record[name] = value
            record["visible"] = obj.visible
        material = np.zeros(1, layout.MATERIAL)
        material["flags"] = self.material_flags
        tables = {
            "top_nodes": top.nodes,
            "top_packs": np.zeros(1, layout.TRIANGLE_PACK),
            "nodes": np.concatenate(nodes or [top.nodes]),
            "packs": np.concatenate(packs or [np.zeros(1, layout.TRIANGLE_PACK)]),
            "objects": records,
            "normals": np.concatenate(normals or [np.zeros(9, np.float32)]),
            "materials": material,
        }
        tables |= {
            a.name: np.zeros(1, np.float32) for a in bindings.SHADING.arguments if a.name not in tables
        }
        tables |= {argument.name: np.zeros(1, np.float32) for argument in bindings.EMITTERS.arguments}
        self.buffers = {name: self.device.upload(table) for name, table in tables.items()}

    def _launch(self, name: str, count: int, planes: dict[str, Floats]) -> dict[str, Floats]:
        """Launches a kernel over `count` paths; returns the planes of each kind afterwards."""
        params = np.zeros((), layout.PARAMS)
        params["path_stride"] = params["buffer_stride"] = count
        state = {
            argument.name: np.zeros(1, np.float32) for argument in bindings.PATH_STATE.arguments
        } | planes
        buffers = {kind: self.device.upload(array) for kind, array in state.items()}
        path_list = self.device.upload(np.arange(count, dtype=np.uint32))
        values = {
            "params": params,
            "lengths": self.device.upload(np.array([count], np.uint32)),
            "length_place": 0,
            "list": path_list,
            **self.buffers,
            **buffers,
        }
        arguments = bindings.arguments(bindings.KERNELS[name], values)
        self.device.launch(self.device.kernel(name), count, *arguments)
        return {kind: self.device.read(buffers[kind], array.copy()) for kind, array in planes.items()}

    def intersect(self, origins: Floats, directions: Floats, medium: int = layout.NO_INDEX) -> Hits:
        count = len(origins)
        rays = np.zeros((len(RayPlane), count), np.float32)
        rays[RayPlane.ORIGIN_X : RayPlane.ORIGIN_Z + 1] = origins.T
        rays[RayPlane.DIRECTION_X : RayPlane.DIRECTION_Z + 1] = directions.T
        paths = np.zeros((len(PathPlane), count), np.float32)
        paths[PathPlane.MEDIUM_0].view(np.uint32)[:] = medium
        # Distances of rays that meet nothing are not written.
        surfaces = np.full((len(SurfacePlane), count), np.inf, np.float32)
        after = self._launch("intersect", count, {"rays": rays, "paths": paths, "surfaces": surfaces})
        return Hits(after["surfaces"], after["paths"][PathPlane.CLASS].view(np.uint32))

    def occlude(self, origins: Floats, directions: Floats, distance: Floats | float) -> Floats:
        """(N, 3) radiance that arrives where (1, 2, 3) is sent."""
        count = len(origins)
        shadows = np.zeros((len(ShadowPlane), count), np.float32)
        shadows[ShadowPlane.ORIGIN_X : ShadowPlane.ORIGIN_Z + 1] = origins.T
        shadows[ShadowPlane.DIRECTION_X : ShadowPlane.DIRECTION_Z + 1] = directions.T
        shadows[ShadowPlane.DISTANCE] = distance
        shadows[ShadowPlane.RADIANCE_R : ShadowPlane.RADIANCE_B + 1] = np.array([[1], [2], [3]])
        radiance = np.zeros((3, count), np.float32)
        return self._launch("trace_shadow", count, {"shadows": shadows, "radiance": radiance})["radiance"].T


def brute_force(obj: model.Object, origins: Floats, directions: Floats) -> npt.NDArray[np.float64]:
    """(N, F) distances to every face in float64 (Moeller and Trumbore), infinite where it is missed."""
    world = affine.apply(obj.world_from_object, obj.mesh.vertices.astype(np.float64))
    a, b, c = world[obj.mesh.faces].transpose(1, 0, 2)
    o, d = origins.astype(np.float64)[:, None], directions.astype(np.float64)[:, None]
    with np.errstate(all="ignore"):
        p = np.cross(d, c - a)
        determinant = np.sum(p * (b - a), axis=-1)
        u = np.sum(p * (o - a), axis=-1) / determinant
        q = np.cross(o - a, b - a)
        v = np.sum(q * d, axis=-1) / determinant
        t = np.sum(q * (c - a), axis=-1) / determinant
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (np.abs(determinant) > 0)
    return np.where(inside, t, np.inf)


def soup(rng: np.random.Generator, count: int, size: float = 0.3) -> Mesh:
    corners = rng.random((count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def random_rays(rng: np.random.Generator, count: int, size: float = 2.0) -> tuple[Floats, Floats]:
    origins = (rng.random((count, 3)) - 0.5) * size
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins.astype(np.float32), directions.astype(np.float32)


def as_object(mesh: Mesh, **placement: object) -> model.Object:
    return model.Object("object", mesh, "material", **placement)  # type: ignore[arg-type]


def assert_agrees(world: World, origins: Floats, directions: Floats) -> Hits:
    """Compares both kernels with brute force. A ray within rounding of an edge may go either way."""
    distances = [brute_force(obj, origins, directions) for obj in world.objects if obj.visible]
    expected = np.min([d.min(axis=1) for d in distances], axis=0)
    hits = world.intersect(origins, directions)
    actual = hits.floats(SurfacePlane.DISTANCE)
    differs = ~np.isclose(actual, expected, rtol=1e-3, atol=1e-4)
    assert differs.mean() <= 2e-3, f"{differs.sum()} of {len(origins)} rays differ from brute force"
    some = hits.hit & ~differs
    points = origins + directions * actual[:, None]
    np.testing.assert_allclose(hits.floats(SurfacePlane.POSITION_X, 3)[some], points[some], atol=2e-3)
    free = world.occlude(origins, directions, np.inf)
    np.testing.assert_array_equal(free, np.where(hits.hit[:, None], 0, [[1, 2, 3]]))
    return hits


def check_tree(tree: bvh.Bvh, face_boxes: Floats, is_mesh: bool) -> int:
    """Every primitive in exactly one leaf and inside the boxes above it. Returns the depth."""
    found: list[int] = []
    stack = [(0, np.array([[-np.inf] * 3, [np.inf] * 3]), 1)]
    visited, deepest = 0, 1
    while stack:
        index, outer, depth = stack.pop()
        visited, deepest = visited + 1, max(deepest, depth)
        assert tree.levels[depth - 1] <= index < tree.levels[depth]
        node = tree.nodes[index]
        check_order(node)
        for child, reference in enumerate(node["child"]):
            box = node["bounds"][:, child].reshape(3, 2).T
            if reference == layout.NODE_EMPTY:
                assert (box[0] > box[1]).all()
                continue
            assert (box[0] >= outer[0]).all() and (box[1] <= outer[1]).all()
            if not reference & layout.NODE_LEAF:
                stack.append((int(reference), box, depth + 1))
                continue
            leaf = int(reference) & ~layout.NODE_LEAF
            faces = tree.packs[leaf]["face"] if is_mesh else np.array([leaf])
            faces = faces[faces != layout.NO_INDEX]
            assert len(faces) > 0
            assert (face_boxes[faces, 0] >= box[0]).all() and (face_boxes[faces, 1] <= box[1]).all()
            found += faces.tolist()
    assert visited == len(tree.nodes) == tree.levels[-1]
    assert sorted(found) == list(range(len(face_boxes)))
    assert deepest == len(tree.levels) - 1 <= layout.BVH_MAX_DEPTH
    return deepest


def check_order(node: np.void) -> None:
    """Every child has its place in the order of each octant; those that are farther along it come first."""
    used = node["child"] != layout.NODE_EMPTY
    centers = node["bounds"].reshape(3, 2, -1)[:, :, used].astype(np.float64).mean(axis=1)
    depth = np.full(layout.BVH_WIDTH, np.inf)
    for octant, order in enumerate(node["order"]):
        children = (int(order) >> 3 * np.arange(layout.BVH_WIDTH)) & 7
        assert sorted(children) == list(range(layout.BVH_WIDTH))
        depth[used] = [-1 if octant >> axis & 1 else 1 for axis in range(3)] @ centers
        along = depth[children][used[children]]
        assert (np.diff(along) <= 1e-5 * (np.abs(centers).max() + 1e-30)).all()


def face_boxes(mesh: Mesh) -> Floats:
    corners = mesh.vertices[mesh.faces]
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)


# --- the tree -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 8, 9, 64, 65, 5000])
def test_every_face_lies_in_one_leaf(device: Device, count: int) -> None:
    mesh = soup(np.random.default_rng(count), count)
    tree = bvh.build_mesh(device, mesh)
    check_tree(tree, face_boxes(mesh), is_mesh=True)
    np.testing.assert_array_equal(tree.bounds, mesh.bounds)


@settings(max_examples=40, deadline=None)
@given(
    corners=st.lists(
        st.tuples(*[st.floats(-1e9, 1e9, width=32) | st.integers(-2, 2).map(float)] * 3),
        min_size=3,
        max_size=90,
    )
)
def test_any_mesh_gives_a_valid_tree(device: Device, corners: list[tuple[float, float, float]]) -> None:
    faces = np.arange(len(corners) // 3 * 3).reshape(-1, 3)
    mesh = Mesh(np.array(corners), faces)
    check_tree(bvh.build_mesh(device, mesh), face_boxes(mesh), is_mesh=True)


def test_same_mesh_gives_same_tree(device: Device) -> None:
    mesh = soup(np.random.default_rng(3), 3000)
    first, second = bvh.build_mesh(device, mesh), bvh.build_mesh(device, mesh)
    assert first.nodes.tobytes() == second.nodes.tobytes()
    assert first.packs.tobytes() == second.packs.tobytes()


def test_equal_faces_are_split_evenly(device: Device) -> None:
    mesh = Mesh(np.eye(3), np.tile([0, 1, 2], (1000, 1)))
    tree = bvh.build_mesh(device, mesh)
    assert check_tree(tree, face_boxes(mesh), is_mesh=True) <= 4


def nested_triangles() -> Mesh:
    # Each group is twice as far out as the one before: the heuristic alone cuts off one at a time.
    scale = np.ldexp(1.0, np.arange(-100, 29)).repeat(40)[:, None, None]
    corners = np.array([[1, 0, 0], [1.1, 0, 0], [1, 0.1, 0]]) * scale
    return Mesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))


def test_depth_is_bounded(device: Device) -> None:
    mesh = nested_triangles()
    check_tree(bvh.build_mesh(device, mesh), face_boxes(mesh), is_mesh=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mesh",
    [
        soup(np.random.default_rng(4), 3000),
        shapes.shape("cylinder"),
        nested_triangles(),
        Mesh(np.eye(3), np.tile([0, 1, 2], (1000, 1))),
    ],
    ids=["soup", "cylinder", "nested", "equal"],
)
@pytest.mark.parametrize(("largest", "chunk"), [(100, 64), (9, 4)])
def test_large_ranges_are_split_alike(
    device: Device, mesh: Mesh, largest: int, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    serial = bvh.build_mesh(device, mesh)
    monkeypatch.setattr(bvh, "LARGEST_SERIAL_RANGE", largest)
    monkeypatch.setattr(bvh, "CHUNK", chunk)
    chunked = bvh.build_mesh(device, mesh)
    check_tree(chunked, face_boxes(mesh), is_mesh=True)
    assert len(chunked.nodes) == pytest.approx(len(serial.nodes), rel=0.05)
    np.testing.assert_array_equal(chunked.bounds, serial.bounds)


def test_memory_per_triangle(device: Device) -> None:
    mesh = shapes.shape("sphere")
    tree = bvh.build_mesh(device, mesh)
    normals = 36 * len(mesh.faces)
    assert (tree.nodes.nbytes + tree.packs.nbytes + normals) / len(mesh.faces) < 160
    assert np.mean(tree.packs["face"] != layout.NO_INDEX) > 0.74


def test_a_device_that_splits_wrongly_is_an_error(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = soup(np.random.default_rng(2), 500)
    with monkeypatch.context() as patch:
        patch.setattr(layout, "BVH_MAX_DEPTH", 1)
        with pytest.raises(DeviceError, match="deeper than 1 levels"):
            bvh.build_mesh(device, mesh)
    monkeypatch.setattr(bvh, "LARGEST_SERIAL_RANGE", 100)
    monkeypatch.setattr(bvh, "_cheapest_split", lambda *_: (0, 0))
    with pytest.raises(DeviceError, match="leaves 0 of 500 boxes"):
        bvh.build_mesh(device, mesh)


def test_more_packs_than_kernels_can_address_are_an_error(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bvh, "MOST_PACKS", 60)
    with pytest.raises(DeviceError, match="60 packs"):
        bvh.build_mesh(device, soup(np.random.default_rng(2), 500))


@pytest.mark.parametrize("count", [0, 1, 2, 9, 1000])
def test_top_level_has_every_object_once(device: Device, count: int) -> None:
    rng = np.random.default_rng(count)
    lower = rng.normal(size=(count, 3)) * 10
    bounds = np.stack([lower, lower + rng.random((count, 3))], axis=1)
    tree = top_level.build_top(device, bounds)
    assert len(tree.packs) == 0 and len(tree.nodes) >= 1
    if count:
        check_tree(tree, bounds, is_mesh=False)
        np.testing.assert_allclose(tree.bounds, [bounds[:, 0].min(0), bounds[:, 1].max(0)], rtol=1e-6)
    else:
        assert (tree.nodes["child"] == layout.NODE_EMPTY).all()


@pytest.mark.slow
def test_refit_fits_the_new_vertices(device: Device) -> None:
    rng = np.random.default_rng(5)
    mesh = soup(rng, 2000)
    tree = bvh.build_mesh(device, mesh)
    moved = Mesh(mesh.vertices * [1, -2, 0.5] + rng.normal(size=mesh.vertices.shape) * 0.1, mesh.faces)
    refitted = bvh.refit_mesh(device, tree, moved)
    check_tree(refitted, face_boxes(moved), is_mesh=True)
    np.testing.assert_array_equal(refitted.nodes["child"], tree.nodes["child"])
    np.testing.assert_array_equal(refitted.bounds, moved.bounds)
    world = World(device, [as_object(moved)], {id(moved): refitted})
    assert_agrees(world, *random_rays(rng, 500, 4))


def test_refit_to_the_same_vertices_changes_nothing(device: Device) -> None:
    mesh = soup(np.random.default_rng(6), 700)
    tree = bvh.build_mesh(device, mesh)
    again = bvh.refit_mesh(device, tree, mesh)
    assert again.nodes.tobytes() == tree.nodes.tobytes() and again.packs.tobytes() == tree.packs.tobytes()


def test_refit_refuses_another_number_of_faces(device: Device) -> None:
    rng = np.random.default_rng(7)
    tree = bvh.build_mesh(device, soup(rng, 20))
    with pytest.raises(InputError, match="21 faces"):
        bvh.refit_mesh(device, tree, soup(rng, 21))


# --- rays against brute force -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("count", "size"), [(1, 1.0), (7, 1.0), (300, 0.3), (3000, 0.02)])
def test_triangle_soups(device: Device, count: int, size: float) -> None:
    rng = np.random.default_rng(count)
    hits = assert_agrees(World(device, [as_object(soup(rng, count, size))]), *random_rays(rng, 2000))
    assert hits.hit.any() and not hits.hit.all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cube", "plane", "cylinder"])
@pytest.mark.parametrize(
    "placement",
    [
        {},
        {"position": (0.3, -0.2, 0.1), "rotation": (20, 50, 70), "scale": (1, 0.5, 2)},
        {"rotation": (10, 0, 40), "scale": (-1, 0.7, 1.3)},
        {"scale": (-0.5, -0.6, -0.7)},
    ],
)
def test_shapes_and_their_normals(device: Device, name: str, placement: dict[str, object]) -> None:
    rng = np.random.default_rng(11)
    obj = as_object(shapes.shape(name), **placement)
    origins, directions = random_rays(rng, 1500, 3)
    hits = assert_agrees(World(device, [obj]), origins, directions)
    some = hits.hit
    mesh, faces = obj.mesh, hits.uints(SurfacePlane.FACE)[some]
    a, b, c = mesh.vertices[mesh.faces[faces]].astype(np.float64).transpose(1, 0, 2)
    inverse = np.linalg.inv(obj.world_from_object[:, :3])
    normal = np.cross(b - a, c - a) @ inverse  # row vectors: the inverse transpose
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    geometric, shading = (
        hits.floats(SurfacePlane.GEOMETRIC_X, 3)[some],
        hits.floats(SurfacePlane.SHADING_X, 3)[some],
    )
    np.testing.assert_allclose(geometric, normal, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(shading, axis=1), 1, atol=1e-5)
    assert (np.sum(shading * geometric, axis=1) >= 0).all()
    if mesh.normals is None:
        np.testing.assert_array_equal(shading, geometric)


def test_shading_normals_of_a_sphere_point_from_its_centre(device: Device) -> None:
    obj = as_object(shapes.shape("sphere"), position=(1, 2, 3), rotation=(30, 60, 10), scale=(2, 2, 2))
    origins, directions = random_rays(np.random.default_rng(12), 2000, 0.5)
    hits = World(device, [obj]).intersect(origins + np.float32([1, 2, 3]), directions)
    assert hits.hit.all()
    outward = hits.floats(SurfacePlane.POSITION_X, 3) - [1, 2, 3]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose(hits.floats(SurfacePlane.SHADING_X, 3), outward, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 9, 1000])
def test_many_objects(device: Device, count: int) -> None:
    rng = np.random.default_rng(count)
    meshes = [shapes.shape("cube"), soup(rng, 12, 0.5), shapes.shape("plane")]
    objects = [
        as_object(
            meshes[i % 3],
            position=rng.normal(size=3),
            rotation=rng.random(3) * 360,
            scale=(0.05 + rng.random(3)) * rng.choice([-0.3, 0.3], 3),
            visible=i % 7 != 3,
        )
        for i in range(count)
    ]
    origins, directions = random_rays(rng, 300, 4)
    hits = assert_agrees(World(device, objects), origins, directions)
    seen = np.unique(hits.uints(SurfacePlane.OBJECT)[hits.hit])
    assert all(objects[i].visible for i in seen)


def test_a_scene_without_objects_is_empty(device: Device) -> None:
    origins, directions = random_rays(np.random.default_rng(0), 100)
    world = World(device, [])
    assert not world.intersect(origins, directions).hit.any()
    assert (world.occlude(origins, directions, np.inf) == [1, 2, 3]).all()


def test_shadow_rays_end_before_their_distance(device: Device) -> None:
    world = World(device, [as_object(shapes.shape("plane"))])
    origins = np.tile(np.float32([0.1, 2, 0.2]), (4, 1))
    directions = np.tile(np.float32([0, -1, 0]), (4, 1))
    free = world.occlude(origins, directions, np.float32([1, 1.999, 2.001, np.inf]))
    np.testing.assert_array_equal(free[:, 0], [1, 1, 0, 0])


def test_classes_of_paths(device: Device) -> None:
    origins = np.tile(np.float32([0.1, 2, 0.2]), (2, 1))
    directions = np.float32([[0, -1, 0], [0, 1, 0]])
    surface, medium, escaped = PathClass.SURFACE, PathClass.MEDIUM, PathClass.MISS
    objects = [as_object(shapes.shape("plane"))]
    glass = World(device, objects, material_flags=layout.MaterialFlag.TRANSMISSIVE)
    diffuse = World(device, objects)
    assert glass.intersect(origins, directions).classes.tolist() == [medium, escaped]
    assert diffuse.intersect(origins, directions).classes.tolist() == [surface, escaped]
    assert diffuse.intersect(origins, directions, medium=0xFFFF0000).classes.tolist() == [medium, escaped]


# --- what goes wrong in careless traversals -----------------------------------------------------------------


def directions_to(targets: npt.NDArray[np.floating], origins: npt.NDArray[np.floating]) -> Floats:
    d = targets - origins
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize(
    "placement", [{}, {"position": (3, 1, -2), "rotation": (12, 34, 56), "scale": (1, 2, 3)}]
)
def test_closed_meshes_are_watertight(device: Device, placement: dict[str, object]) -> None:
    rng = np.random.default_rng(13)
    obj = as_object(shapes.shape("sphere"), **placement)
    mesh, matrix = obj.mesh, obj.world_from_object
    a, b, _ = mesh.vertices[mesh.faces].astype(np.float64).transpose(1, 0, 2)
    weight = rng.random((4, len(a), 1))
    edges = (a + (b - a) * weight).reshape(-1, 3)
    targets = affine.apply(matrix, np.concatenate([edges, mesh.vertices, mesh.vertices]))
    inside = affine.apply(matrix, rng.normal(size=(len(targets), 3)) * 0.08)
    inside[-len(mesh.vertices) :] = affine.apply(matrix, np.zeros((1, 3)))
    origins = inside.astype(np.float32)
    directions = directions_to(targets, origins)
    world = World(device, [obj])
    assert world.intersect(origins, directions).hit.all()
    assert (world.occlude(origins, directions, np.inf) == 0).all()


@pytest.mark.slow
def test_no_ray_slips_through_where_reciprocals_are_two_ulps_off() -> None:
    mesh = shapes.shape("sphere")
    rng = np.random.default_rng(14)
    targets = np.concatenate([mesh.vertices] * 10).astype(np.float64)
    origins = (rng.normal(size=targets.shape) * 0.08).astype(np.float32)
    directions = directions_to(targets, origins)
    missed = []
    for features in (("PERTURBED_DIVISION",), ("PERTURBED_DIVISION", "INEXACT_DIVISION")):
        world = World(Device(features=features), [as_object(mesh)])
        missed.append(int((~world.intersect(origins, directions).hit).sum()))
    assert missed[0] > 0, "this does not need the slack that it tests"
    assert missed[1] == 0


@pytest.mark.parametrize("name", ["cube", "sphere"])
def test_axis_parallel_rays_are_watertight(device: Device, name: str) -> None:
    mesh = shapes.shape(name)
    steps = np.linspace(-0.3, 0.3, 33)
    origins, directions = [], []
    own = mesh.vertices[np.linalg.norm(mesh.vertices, axis=1) > 0][:3000] * 0.5
    for axis in range(3):
        for sign in (1.0, -1.0):
            for zero in (0.0, -0.0):
                u, v = (m.ravel() for m in np.meshgrid(steps, steps))
                grid = np.insert(np.stack([u, v], axis=1), axis, 0.0, axis=1)
                start = np.concatenate([grid, own])  # halved vertices: planes of the boxes, for the cube
                direction = np.full(3, zero)
                direction[axis] = sign
                origins.append(start)
                directions.append(np.tile(direction, (len(start), 1)))
    world = World(device, [as_object(mesh)])
    o, d = np.concatenate(origins).astype(np.float32), np.concatenate(directions).astype(np.float32)
    hits = world.intersect(o, d)
    assert hits.hit.all()
    assert np.isfinite(hits.planes[: SurfacePlane.OBJECT]).all()


def test_axis_parallel_rays_in_box_planes(device: Device) -> None:
    # Rays straight down on every vertex of a grid: each lies in planes of the boxes around it.
    grid = np.stack(np.meshgrid(*[np.arange(-4, 5)] * 2), axis=-1).reshape(-1, 2)
    low = [[x, 0.0, z] for x, z in grid]
    faces = []
    for row in range(8):
        for column in range(8):
            i = row * 9 + column
            faces += [[i, i + 1, i + 9], [i + 1, i + 10, i + 9]]
    floor = Mesh(np.array(low), np.array(faces))
    origins = np.array([[x, 1.0, z] for x, z in grid], np.float32)
    directions = np.tile(np.float32([0, -1, 0]), (len(origins), 1))
    hits = World(device, [as_object(floor)]).intersect(origins, directions)
    assert hits.hit.all()
    np.testing.assert_array_equal(hits.floats(SurfacePlane.DISTANCE), 1)


def test_degenerate_faces_are_never_hit(device: Device) -> None:
    rng = np.random.default_rng(17)
    good = soup(rng, 50)
    ends = rng.integers(0, 256, (60, 2, 3)) / np.float32(256)  # so that the middle is exact
    points = np.stack([ends[:, 0], (ends[:, 0] + ends[:, 1]) / 2, ends[:, 1]], axis=1)
    points[:20] = points[:20, :1]  # to a point
    points[20:40, 1] = points[20:40, 0]  # to a line: two corners coincide
    vertices = np.concatenate([good.vertices, points.reshape(-1, 3)])
    mesh = Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    tree = bvh.build_mesh(device, mesh)
    check_tree(tree, face_boxes(mesh), is_mesh=True)
    targets = np.concatenate([points.reshape(-1, 3)] * 8)
    origins = random_rays(rng, len(targets), 4)[0]
    both, alone = World(device, [as_object(mesh)]), World(device, [as_object(good)])
    directions = directions_to(targets, origins)
    hits = both.intersect(origins, directions)
    assert (hits.uints(SurfacePlane.FACE)[hits.hit] < 50).all()
    np.testing.assert_array_equal(hits.hit, alone.intersect(origins, directions).hit)
    assert np.isfinite(hits.planes[: SurfacePlane.OBJECT][:, hits.hit]).all()


@pytest.mark.parametrize("exponent", [-9, -6, 6, 8])
def test_sizes(device: Device, exponent: int) -> None:
    rng = np.random.default_rng(19)
    unit = soup(rng, 200)
    mesh = Mesh(unit.vertices.astype(np.float64) * 10.0**exponent, unit.faces)
    origins, directions = random_rays(rng, 1000)
    expected = World(device, [as_object(unit)]).intersect(origins, directions)
    scaled = World(device, [as_object(mesh)]).intersect(origins * np.float32(10.0**exponent), directions)
    assert np.mean(expected.hit != scaled.hit) < 2e-3
    same = expected.uints(SurfacePlane.FACE) == scaled.uints(SurfacePlane.FACE)
    normals = [h.floats(SurfacePlane.GEOMETRIC_X, 3)[same & expected.hit] for h in (expected, scaled)]
    np.testing.assert_allclose(*normals, atol=1e-3)


# --- leaving a surface --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "placement",
    [
        {},
        {"rotation": (12, 34, 56)},
        {"rotation": (12, 34, 56), "scale": (100, 0.01, 3)},
        {"position": (1000, -300, 50), "rotation": (1, 2, 3)},
        {"scale": (100, 100, 100), "rotation": (45, 0, 30), "position": (5, 5, 5)},
    ],
)
@pytest.mark.parametrize("name", ["cube", "plane", "soup"])
def test_rays_from_a_surface_never_meet_it_again(
    device: Device, name: str, placement: dict[str, object]
) -> None:
    rng = np.random.default_rng(23)
    mesh = Mesh(soup(rng, 1, 1.0).vertices, [[0, 1, 2]]) if name == "soup" else shapes.shape(name)
    obj = as_object(mesh, **placement)
    world = World(device, [obj])
    a, b, c = (
        mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=20000)]].astype(float).transpose(1, 0, 2)
    )
    u, v = rng.random((2, 20000, 1))
    targets = affine.apply(obj.world_from_object, a + np.sqrt(u) * ((b - a) + v * (c - b)))
    origins = (targets + rng.normal(size=targets.shape) * rng.choice([0.1, 1, 30], (20000, 1))).astype("f4")
    hits = world.intersect(origins, directions_to(targets, origins))
    position = hits.floats(SurfacePlane.POSITION_X, 3)[hits.hit]
    normal = hits.floats(SurfacePlane.GEOMETRIC_X, 3)[hits.hit]
    offset = hits.floats(SurfacePlane.OFFSET)[hits.hit][:, None]
    away = rng.normal(size=normal.shape)
    away -= normal * np.sum(away * normal, axis=1, keepdims=True)
    away += normal * 10 ** rng.uniform(-7, 1, (len(away), 1))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    for side in (1, -1):
        start = (position + side * offset * normal).astype(np.float32)
        direction = (away - (1 - side) * normal * np.sum(away * normal, axis=1, keepdims=True)).astype("f4")
        again = world.intersect(start, direction)
        same = again.hit & (again.uints(SurfacePlane.FACE) == hits.uints(SurfacePlane.FACE)[hits.hit])
        assert not same.any(), f"{same.sum()} of {len(same)} rays on side {side}"
    extent = np.linalg.norm(np.diff(obj.world_bounds, axis=0)) + np.abs(obj.world_bounds).max()
    assert (offset >= 0).all() and offset.max() < 3e-5 * extent, "shadows would detach"
