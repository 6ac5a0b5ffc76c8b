"""What differs between two scenes, as far as paths can meet it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.small_scenes import mixed_scene

from incpt.benchmarks.kit.scenes import crowd, icosphere
from incpt.core import layout
from incpt.scene.light import Light
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import change_tables
from incpt.tables.change_tables import change_row, difference, joined


def bounds_of(*objects: Object) -> set[bytes]:
    return {obj.world_bounds.tobytes() for obj in objects}


def bent(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices * np.float32(1.5), mesh.faces, mesh.normals)


@pytest.mark.parametrize(
    "edit",
    [
        lambda s: s.with_object("red cube", position=(1, 1, 1)),
        lambda s: s.with_object("red cube", mesh=bent(shape("cube"))),
        lambda s: s.with_object("red cube", mesh=icosphere(1)),
    ],
    ids=["moved", "deformed", "reshaped"],
)
def test_boxes_stand_where_an_object_was_and_where_it_is(edit: Callable[[Scene], Scene]) -> None:
    old = mixed_scene()
    new = edit(old)
    for a, b in ((old, new), (new, old)):
        found = difference(a, b)
        assert {box.tobytes() for box in found.boxes} == bounds_of(
            old.object("red cube"), new.object("red cube")
        )
        assert not found.objects.any() and not found.is_empty


def test_what_comes_or_goes_or_is_hidden_has_one_box() -> None:
    old = mixed_scene()
    cube = old.object("red cube")
    hidden = old.with_object("red cube", visible=False)
    for other in (old.without_object("red cube"), hidden):
        for a, b in ((old, other), (other, old)):
            assert {box.tobytes() for box in difference(a, b).boxes} == bounds_of(cube)
    moved = hidden.with_object("red cube", position=(3, 3, 3))
    assert difference(hidden, moved).is_empty
    assert {box.tobytes() for box in difference(moved, old).boxes} == bounds_of(cube)


def test_a_hit_is_enough_where_only_the_material_is_another_one() -> None:
    old = mixed_scene()
    for new in (old.with_material("red", roughness=0.1), old.with_object("red cube", material="grey")):
        found = difference(old, new)
        assert len(found.boxes) == 0 and not found.is_empty
        assert found.objects.tolist() == [obj.name == "red cube" for obj in new.objects]
    # By the order of the new scene.
    turned = replace(old.with_material("red", roughness=0.1), objects=old.objects[::-1])
    assert difference(old, turned).objects.tolist() == [obj.name == "red cube" for obj in turned.objects]


def test_what_no_path_can_meet_is_no_difference() -> None:
    old = mixed_scene()
    alike = replace(mixed_scene(), environment=old.environment)
    for new in (old, alike, old.with_material("unused", metallic=1.0), old.with_material("red")):
        assert difference(old, new).is_empty
    assert difference(Scene(), Scene()).is_empty


@pytest.mark.parametrize("far", [False, True], ids=["environment", "sun"])
def test_every_path_meets_light_from_far_away(far: bool) -> None:
    sun = Light("sun", "sun", irradiance=1.0)
    old = mixed_scene().with_added_light(sun)
    new = old.with_light("sun", irradiance=2.0) if far else old.with_environment(rotation_y=10.0)
    found = difference(old, new)
    assert len(found.boxes) == 1 and found.lights == far and not found.objects.any()
    row = change_row(found)
    assert (row["least"][:2] < -1e29).all() and (row["greatest"][:2] > 1e29).all()
    moved = difference(old, new.with_object("red cube", position=(1, 1, -7)))
    assert len(moved.boxes) == 1, "that box holds all others"


def test_the_row_of_a_change() -> None:
    old = mixed_scene()
    new = old.with_object("red cube", position=(1, 1, -7)).with_material("grey", roughness=0.1)
    found = difference(old, new)
    row = change_row(found)
    assert row["box_count"] == 2 and row["has_objects"] == 1
    kept = np.stack([row["least"][:2], row["greatest"][:2]], axis=1)
    np.testing.assert_array_equal(kept, found.boxes.astype(np.float32))
    assert row["reach"] == np.float32(np.abs(found.boxes).max()) > 7
    assert 2.0**-21 < row["padding"] < 1e-5
    # Kernels go over boxes two at a time.
    single = change_row(difference(old, old.without_object("red cube")))
    assert single["box_count"] == 2
    np.testing.assert_array_equal(single["least"][0], single["least"][1])
    nothing = change_row(difference(old, old))
    assert nothing["box_count"] == nothing["has_objects"] == 0


def test_a_sheared_object_is_padded_more() -> None:
    """Its rays are rounded in its own space, and errors grow on their way back."""
    old = mixed_scene()
    plain = old.with_object("red cube", position=(1, 1, 1))
    sheared = old.with_object("red cube", matrix=[[1, 500, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]])
    assert difference(old, sheared).padding > 100 * difference(old, plain).padding


_POINT = st.tuples(*[st.floats(-10, 10)] * 3)


@given(st.lists(st.tuples(_POINT, _POINT), min_size=0, max_size=30), st.integers(1, 8))
def test_joined_boxes_cover_all(
    corners: list[tuple[tuple[float, ...], tuple[float, ...]]], most: int
) -> None:
    boxes = np.sort(np.array(corners, float).reshape(-1, 2, 3), axis=1)
    found = joined(boxes, most)
    assert len(found) == min(len(boxes), most)
    inside = (found[None, :, 0] <= boxes[:, None, 0]) & (found[None, :, 1] >= boxes[:, None, 1])
    assert inside.all(axis=2).any(axis=1).all()
    if len(boxes):
        np.testing.assert_array_equal(found[:, 0].min(axis=0), boxes[:, 0].min(axis=0))
        np.testing.assert_array_equal(found[:, 1].max(axis=0), boxes[:, 1].max(axis=0))


def test_boxes_that_stand_together_are_joined() -> None:
    low = np.array([(x, 0, 0) for x in (0, 10, 20, 0.1, 10.1, 20.1)], float)
    found = joined(np.stack([low, low + 1], axis=1), 3)
    assert sorted(found[:, 0, 0]) == [0, 10, 20] and sorted(found[:, 1, 0]) == [1.1, 11.1, 21.1]


def test_many_boxes_are_joined_by_place() -> None:
    """Two crowds far from each other stay apart, however many there are, and it takes no time."""
    assert layout.MOST_CHANGED_BOXES == 8 < change_tables._MOST_PAIRED
    random = np.random.default_rng(3)
    low = random.random((5000, 3))
    low[::2] += 100
    found = joined(np.stack([low, low + 0.01], axis=1), layout.MOST_CHANGED_BOXES)
    assert len(found) == 8 and np.ptp(found, axis=1).max() < 2
    for box in np.stack([low, low + 0.01], axis=1):
        assert ((found[:, 0] <= box[0]) & (found[:, 1] >= box[1])).all(axis=1).any()


def test_many_boxes_in_one_place() -> None:
    for count in (65, 100, 1000):
        low = np.concatenate([np.zeros((count - 3, 3)), np.eye(3)])
        found = joined(np.stack([low, low + 1], axis=1), 8)
        assert found.min() == 0 and found.max() == 2 and len(found) == 8


def test_a_whole_crowd_that_moves() -> None:
    old = crowd(200)
    moved = tuple(replace(o, position=tuple(np.add(o.position, (0, 1, 0)).tolist())) for o in old.objects)
    row = change_row(difference(old, replace(old, objects=moved)))
    assert row["box_count"] == layout.MOST_CHANGED_BOXES
