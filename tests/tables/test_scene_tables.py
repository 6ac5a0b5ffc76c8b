"""The scene on the device after edits is the one that a fresh start would put there."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core import layout
from incpt.core.layout import LightPlane
from incpt.device.device import Device
from incpt.scene.camera import Camera
from incpt.scene.change import diff
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import scene_tables
from incpt.tables.scene_tables import DeviceScene

MATERIALS = {
    "matt": Material(specular=0.0),
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
        st.sampled_from(("move", "hide", "assign", "add", "remove", "swap", "mesh")), st.integers(0, 99)
    ),
    min_size=1,
    max_size=6,
)


def edited(scene: Scene, kind: str, number: int) -> Scene:
    objects = list(scene.objects)
    if kind == "add" or not objects:
        free = next(name for name in map(str, count()) if name not in scene.object_index)
        return scene.with_added(placed(free, number))
    i = number % len(objects)
    obj = objects[i]
    if kind == "remove":
        return scene.without_object(obj.name)
    if kind == "swap":
        objects[i], objects[-1] = objects[-1], objects[i]
        return replace(scene, objects=tuple(objects))
    changes: dict[str, Any] = {
        "move": {"position": (0.1 * number, 0.0, 1.0)},
        "hide": {"visible": not obj.visible},
        "assign": {"material": list(MATERIALS)[number % len(MATERIALS)]},
        "mesh": {"mesh": shape(SHAPES[number % len(SHAPES)])},
    }[kind]
    return scene.with_object(obj.name, **changes)


def contents(device: Device, described: DeviceScene) -> dict[str, npt.NDArray[np.uint8]]:
    """Buffers, byte for byte, but those of meshes: their order tells which came first."""
    names = ("top_packs", "facets", "solids", "clusters", "materials")
    found = {name: read(device, described, name) for name in names}
    if described.light_count:  # in whatever order: no object refers to them
        planes = read(device, described, "lights").view(np.float32).reshape(len(LightPlane), -1)
        planes = planes[: LightPlane.ALIAS_PROBABILITY]
        found["lights"] = np.ascontiguousarray(planes[:, np.lexsort(planes)]).view(np.uint8)
    return found


def read(device: Device, described: DeviceScene, name: str) -> npt.NDArray[np.uint8]:
    buffer = described.buffer(name)
    return device.read(buffer, np.empty(buffer.size, np.uint8))


def objects_of(device: Device, described: DeviceScene) -> npt.NDArray[np.void]:
    return read(device, described, "objects").view(layout.OBJECT)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 6), EDITS, st.sampled_from((20, 4096)))
def test_after_any_edits_all_is_as_from_a_fresh_start(
    device: Device, start: int, edits: list[tuple[str, int]], most_on_top: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        # With few, objects come to the top level and leave it.
        patch.setattr(scene_tables, "_MOST_FACES_IN_ALL_ON_TOP", most_on_top)
        check_edits(device, start, edits)


def check_edits(device: Device, start: int, edits: list[tuple[str, int]]) -> None:
    scene = scene_of(placed(f"{i}", i) for i in range(start))
    described = DeviceScene(device, scene)
    for kind, number in edits:
        scene = edited(scene, kind, number)
        described.update(scene)
    fresh = DeviceScene(device, scene)
    assert described.variant == fresh.variant and described.cluster_count == fresh.cluster_count
    for name, expected in contents(device, fresh).items():
        np.testing.assert_array_equal(contents(device, described)[name], expected, err_msg=name)
    if not scene.objects:
        return
    rows, expected_rows = objects_of(device, described), objects_of(device, fresh)
    for name in layout.OBJECT.names or ():
        if not name.startswith("first"):  # meshes stand in the order in which they came
            np.testing.assert_array_equal(rows[name], expected_rows[name], err_msg=name)
    for row, obj in zip(rows, scene.objects, strict=True):
        firsts = row["first_node"], row["first_pack"], row["first_normal"]
        assert firsts == described._places[obj.mesh]


def test_objects_that_stay_are_not_described_again(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(placed(f"{i}", i) for i in range(40))
    described = DeviceScene(device, scene)
    again: list[str] = []
    original = scene_tables._describe
    monkeypatch.setattr(
        scene_tables, "_describe", lambda obj, *rest: (again.append(obj.name), original(obj, *rest))
    )
    described.update(scene.with_object("7", position=(9.0, 0.0, 0.0)))
    assert again == ["7"]


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
