"""The scene on the device after edits is the one that a fresh start would put there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core import layout
from incpt.core.errors import DeviceError
from incpt.core.layout import LightPlane
from incpt.device.device import Device
from incpt.scene.camera import Camera
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import object_table, range_buffer
from incpt.tables.geometry_pool import GeometryPool
from incpt.tables.scene_tables import SceneTables, tables_of

MATERIALS = {
    "matte": Material(specular=0.0),
    "lamp": Material(emission=(3, 2, 1)),
    "glass": Material(transmission=1.0),
}
SHAPES = ("cube", "plane", "sphere", "cylinder")


def scene_of(objects: Any) -> Scene:
    return Scene(Camera(), Environment(color=(1, 1, 1)), MATERIALS, tuple(objects))


def placed(name: str, number: int) -> Object:
    return Object(
        name,
        shape(SHAPES[number % len(SHAPES)]),
        list(MATERIALS)[number % len(MATERIALS)],
        (number % 7 - 3.0, number % 5 - 2.0, number % 3 - 1.0),
        (0.0, 13.0 * number, 0.0),
    )


EDITS = st.lists(
    st.tuples(
        st.sampled_from(
            ("move", "hide", "assign", "add", "remove", "swap", "mesh", "deform", "shine", "tint", "name",
             "sky", "light", "camera")
        ),
        st.integers(0, 99),
        st.booleans(),
    ),
    min_size=1,
    max_size=8,
)  # fmt: skip
"""What is done, to which object, and whether the tables before go on to live."""


def edited(scene: Scene, kind: str, number: int) -> Scene:
    objects = list(scene.objects)
    if kind == "add" or not objects:
        free = next(name for name in map(str, count()) if name not in scene.object_index)
        return scene.with_added(placed(free, number))
    whole: dict[str, Callable[[], Scene]] = {
        "remove": lambda: scene.without_object(obj.name),
        "shine": lambda: scene.with_material("matte", emission=(number % 3, 0, 1)),
        "tint": lambda: scene.with_material("glass", absorption=(number % 2, 0, 1)),
        "name": lambda: replace(
            scene, materials={f"new {number}": Material(roughness=0.3), **scene.materials}
        ),
        "sky": lambda: scene.with_environment(image=SKIES[number % len(SKIES)]),
        "light": lambda: scene.with_environment(intensity=float(number % 3)),
        "camera": lambda: scene.with_camera(position=(0.0, number, 5.0)),
    }
    i = number % len(objects)
    obj = objects[i]
    if kind in whole:
        return whole[kind]()
    if kind == "swap":
        objects[i], objects[-1] = objects[-1], objects[i]
        return replace(scene, objects=tuple(objects))
    changes: dict[str, Any] = {
        "move": {"position": (0.1 * number, 0.0, 1.0)},
        "hide": {"visible": not obj.visible},
        "assign": {"material": list(scene.materials)[number % len(scene.materials)]},
        "mesh": {"mesh": shape(SHAPES[number % len(SHAPES)])},
        "deform": {"mesh": replace(obj.mesh, vertices=obj.mesh.vertices * np.float32([1, 0.9, 1.2]))},
    }[kind]
    return scene.with_object(obj.name, **changes)


SKIES = (
    None,
    Image(np.zeros((4, 8, 3), np.float32)),
    Image(np.linspace(0, 1, 96, dtype=np.float32).reshape(4, 8, 3)),
)
NAMES = (
    "top_nodes", "block_nodes", "top_packs", "quads", "parallelepipeds", "clusters", "materials", "layers",
    "environment_image", "marginal", "conditional", "texel_pdf",
)  # fmt: skip
"""The buffers but for those of meshes, and lights, whose order tells which came first."""
VALUES = (
    "variant", "has_media", "has_trees", "cluster_count", "light_count", "environment_probability",
    "environment_radiance",
)  # fmt: skip


def contents(tables: SceneTables) -> dict[str, npt.NDArray[np.uint8]]:
    """Buffers, byte for byte, but those of meshes."""
    found = {name: read(tables, name) for name in NAMES}
    if tables.light_count:  # in whatever order: no object refers to them
        planes = read(tables, "lights").view(np.float32).reshape(LightPlane.TEXTURE, -1)
        planes = planes[: LightPlane.ALIAS_PROBABILITY]
        found["lights"] = np.ascontiguousarray(planes[:, np.lexsort(planes)]).view(np.uint8)
    return found


def read(tables: SceneTables, name: str) -> npt.NDArray[np.uint8]:
    buffer = tables.buffer(name)
    return tables.pool.device.read(buffer, np.empty(buffer.size, np.uint8))


def objects_of(tables: SceneTables) -> npt.NDArray[np.void]:
    return read(tables, "objects").view(layout.OBJECT)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 6), EDITS, st.sampled_from((20, 4096)))
def test_after_any_edits_all_is_as_from_a_fresh_start(
    device: Device, start: int, edits: list[tuple[str, int, bool]], most_in_world_space: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        # With few, objects come to the top level and leave it.
        patch.setattr(object_table, "_MOST_FACES_OF_ALL", most_in_world_space)
        # Buffers of the pool grow and shrink, and meshes move, at the first occasion.
        patch.setattr(range_buffer, "_LEAST_CAPACITY", 1)
        patch.setattr(range_buffer, "_LEAST_USE", 1.0)
        patch.setattr(range_buffer, "_ROOM", 1.0)
        check_edits(GeometryPool(device), start, edits)


def check_edits(pool: GeometryPool, start: int, edits: list[tuple[str, int, bool]]) -> None:
    tables = tables_of(pool, scene_of(placed(f"{i}", i) for i in range(start)))
    living = []
    for kind, number, lives_on in edits:
        if lives_on:
            living.append(tables)
        tables = tables_of(pool, edited(tables.scene, kind, number), tables)
    for each in (*living, tables):
        check_as_fresh(each)


def check_as_fresh(tables: SceneTables) -> None:
    """Everything but the order of meshes is as on a device that has seen nothing else."""
    scene = tables.scene
    fresh = tables_of(GeometryPool(tables.pool.device), scene)
    assert fresh is not tables
    for name in VALUES:
        assert getattr(tables, name) == getattr(fresh, name), name
    found = contents(tables)
    for name, expected in contents(fresh).items():
        np.testing.assert_array_equal(found[name], expected, err_msg=name)
    if not scene.objects:
        return
    rows, expected_rows = objects_of(tables), objects_of(fresh)
    for name in layout.OBJECT.names or ():
        if not name.startswith("first"):  # meshes stand in the order in which they came
            np.testing.assert_array_equal(rows[name], expected_rows[name], err_msg=name)
    nodes, packs = read(tables, "nodes").view(layout.NODE), read(tables, "packs").view(layout.TRIANGLE_PACK)
    normals = read(tables, "normals").view(np.float32)
    for row, obj in zip(rows, scene.objects, strict=True):
        first_node, first_pack, first_normal = (
            int(row[n]) for n in layout.OBJECT.names or () if "first" in n
        )
        check_mesh(obj.mesh, nodes[first_node:], packs[first_pack:])
        if obj.mesh.normals is None:
            assert (first_normal, int(row["is_smooth"])) == (0, 0)
        else:
            found = normals[first_normal : first_normal + obj.mesh.normals.size]
            np.testing.assert_array_equal(found, obj.mesh.normals.ravel())


def check_mesh(mesh: Mesh, nodes: npt.NDArray[np.void], packs: npt.NDArray[np.void]) -> None:
    """From the first node one gets to every face once, and boxes hold what is below them."""
    faces, level = [], np.zeros(1, np.uint32)
    while level.size:
        children, bounds = nodes[level]["child"], nodes[level]["bounds"]
        is_used = children != layout.NODE_EMPTY
        is_leaf = is_used & (children & layout.NODE_LEAF != 0)
        pack = packs[children[is_leaf] ^ layout.NODE_LEAF]
        leaf, lane = np.nonzero(pack["face"] != layout.NO_INDEX)
        corners, face = pack["vertex"][leaf, :, lane].reshape(-1, 3, 3), pack["face"][leaf, lane]
        np.testing.assert_array_equal(corners, mesh.vertices[mesh.faces[face]])
        node, child = np.nonzero(is_leaf)
        box = bounds[node, :, child].reshape(-1, 1, 3, 2)[leaf]
        assert (corners >= box[..., 0]).all() and (corners <= box[..., 1]).all()
        faces += face.tolist()
        level = children[is_used & ~is_leaf]
    assert sorted(faces) == list(range(len(mesh.faces)))


def test_tables_share_what_an_edit_leaves_alone(device: Device) -> None:
    """Which parts are made anew, by edit: the table of the module, seen from outside."""
    scene = scene_of(placed(f"{i}", i) for i in range(8))
    expected = {
        "camera": set(),
        "tint": {"lights", "materials"},
        "light": {"lights", "materials"},
        "sky": {"environment", "lights", "materials"},
        "assign": {"objects", "lights", "materials"},
        "name": {"objects", "lights", "materials"},
        "move": {"objects", "top_level", "lights", "materials"},
        "hide": {"objects", "top_level", "lights", "materials"},
        "deform": {"meshes", "objects", "top_level", "lights", "materials"},
        "add": {"meshes", "objects", "top_level", "lights", "materials"},
    }
    before = tables_of(GeometryPool(device), scene)
    for kind, parts in expected.items():
        after = tables_of(before.pool, edited(scene, kind, 11), before)
        names = ("meshes", "objects", "top_level", "environment", "lights", "materials")
        assert {name for name in names if getattr(before, name) is not getattr(after, name)} == parts, kind


def test_a_deformed_mesh_is_refitted(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its tree is not built anew, though the mesh is another one."""
    scene = scene_of([placed("ball", 2)])
    tables = tables_of(GeometryPool(device), scene)
    monkeypatch.setattr("incpt.accel.bvh.build_mesh", None)
    before = tables.meshes[scene.object("ball").mesh].built.tree
    tables = tables_of(tables.pool, edited(scene, "deform", 0), tables)
    (pooled,) = tables.meshes.values()
    np.testing.assert_array_equal(pooled.built.tree.nodes["child"], before.nodes["child"])


def test_a_black_image_is_no_light(device: Device) -> None:
    black, shining = (
        tables_of(GeometryPool(device), scene_of([]).with_environment(image=image)) for image in SKIES[1:]
    )
    assert "ENVIRONMENT_IMAGE" in shining.features and shining.environment_probability == 1.0
    assert "ENVIRONMENT_IMAGE" not in black.features and black.environment_probability == 0.0
    assert black.environment_radiance == (0.0, 0.0, 0.0)


def test_beside_brute_force_the_tree_holds_the_other_objects(device: Device) -> None:
    tables = tables_of(GeometryPool(device), scene_of([placed("cube", 0), placed("ball", 2)]))
    assert "BRUTE_FORCE" in tables.variant and tables.has_trees
    for name, has_packs in (("top_nodes", True), ("block_nodes", False)):
        child = read(tables, name).view(layout.NODE)["child"]
        leaves = child[(child >= layout.NODE_LEAF) & (child != layout.NODE_EMPTY)] & ~np.uint32(
            layout.NODE_LEAF
        )
        assert 1 in leaves  # the ball
        assert (leaves >= layout.NODE_PACK).any() == has_packs, name


def test_objects_that_stay_are_not_described_again(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(placed(f"{i}", i) for i in range(40))
    tables = tables_of(GeometryPool(device), scene)
    again: list[str] = []
    original = object_table._describe
    monkeypatch.setattr(
        object_table, "_describe", lambda obj, *rest: (again.append(obj.name), original(obj, *rest))
    )
    tables_of(tables.pool, scene.with_object("7", position=(9.0, 0.0, 0.0)), tables)
    assert again == ["7"]


@pytest.mark.parametrize(
    "place", ["accel.bvh.build_mesh", "accel.top_level.build_top", "tables.albedo.layer_row"]
)
def test_after_an_error_the_tables_before_are_right(
    device: Device, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    scene = scene_of(placed(f"{i}", i) for i in range(4))
    tables = tables_of(GeometryPool(device), scene)
    after = scene.with_added(placed("new", 5)).with_object("0", position=(0.0, 7.0, 0.0))
    after = after.with_object("1", mesh=replace(shape("sphere"), vertices=2 * shape("sphere").vertices))

    def fail(*_: object) -> None:
        raise DeviceError("device memory ran out")

    with monkeypatch.context() as patch:
        patch.setattr(f"incpt.{place}", fail)
        with pytest.raises(DeviceError):
            tables_of(tables.pool, after, tables)
    check_as_fresh(tables)
    check_as_fresh(tables_of(tables.pool, after, tables))


@given(st.permutations(range(6)), st.sets(st.integers(0, 5)), st.integers(0, 3), st.integers(0, 3))
def test_differences_between_orders(order: list[int], moved: set[int], fewer: int, more: int) -> None:
    """What `diff` says of objects that come, go, move and change places, from its definition."""
    old = [placed(f"{i}", i) for i in range(6)]
    kept = [replace(old[i], position=(5.0, 5.0, 5.0)) if i in moved else old[i] for i in order][fewer:]
    new = kept + [placed(f"new {i}", i) for i in range(more)]
    change = diff(scene_of(old), scene_of(new))
    names = [o.name for o in kept]
    assert change.added == {f"new {i}" for i in range(more)}
    assert change.removed == {o.name for o in old} - set(names)
    assert change.moved == {f"{i}" for i in moved} & set(names)
    assert change.reordered == (names != sorted(names))


def test_a_scene_without_objects_has_a_row_that_kernels_may_read(device: Device) -> None:
    """Rays that meet nothing ask the first object for its material, whatever that is."""
    tables = tables_of(GeometryPool.of(device), scene_of([]))
    rows = device.read(tables.buffer("objects"), np.ones(1, layout.OBJECT))
    assert rows["material"][0] == 0 and not rows["visible"][0]
