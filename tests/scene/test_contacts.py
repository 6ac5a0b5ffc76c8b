"""Bodies in contact: which of them grow, and by how much."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.core.affine import Vector
from incpt.scene.camera import Camera
from incpt.scene.contacts import grown_bodies, separated
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

GLASS = Object("glass", shape("cube"), "glass", (-0.5, 0, 0))
WATER = Object("water", shape("cube"), "glass", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9))


def scene_of(*objects: Object) -> Scene:
    materials = {
        "glass": Material(transmission=1),
        "pane": Material(transmission=1, thin_walled=True),
        "stone": Material(),
    }
    return Scene(Camera((0, 0, 9), (0, 0, 0)), Environment(), materials, objects)


def test_the_smaller_of_two_bodies_in_contact_grows_by_some_micrometres() -> None:
    scene = scene_of(WATER, GLASS)
    grown = grown_bodies(scene)
    assert set(grown) == {"water"} and separated(scene) == (grown["water"], GLASS)
    moved = np.abs(grown["water"].world_bounds - WATER.world_bounds)
    assert 5e-6 < moved[0, 0] < 2e-5 and moved.max() < 2e-5


@pytest.mark.parametrize(
    "other",
    [
        Object("water", shape("cube"), "glass", (0.401, 0.05, 0), scale=(0.8, 0.7, 0.9)),
        Object("water", shape("cube"), "glass", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9), visible=False),
        Object("pane", shape("cube"), "pane", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9)),
        Object("stone", shape("cube"), "stone", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9)),
        Object("inside", shape("sphere"), "glass", (-0.5, 0, 0), scale=(0.9, 0.9, 0.9)),
        Object("beside", shape("cube"), "glass", (0.5, 1.001, 0)),
    ],
    ids=["apart", "hidden", "a thin wall", "opaque", "crossing", "in the same plane"],
)
def test_what_is_not_in_contact_stays_where_it_is(other: Object) -> None:
    scene = scene_of(GLASS, other)
    assert not grown_bodies(scene) and separated(scene) is scene.objects


def test_bodies_that_are_one_lie_in_each_other() -> None:
    """However often: each grows by more than the one before."""
    ball = shape("sphere")
    apart = Mesh(ball.vertices + np.float32([3, 1, 2]), ball.faces, ball.normals)  # rounded in another way
    same = [Object(name, ball, "glass", (0.1, 0.2, 0)) for name in "ab"]
    same.append(Object("c", apart, "glass", (-2.9, -0.8, -2)))
    sizes = sorted(float(np.ptp(obj.world_bounds[:, 0])) for obj in separated(scene_of(*same)))
    assert np.diff(sizes).min() > 5e-6


def test_a_body_in_a_hole_of_another_grows() -> None:
    cube = shape("cube")
    hollow = Mesh(
        np.concatenate([cube.vertices, cube.vertices * 0.8]),
        np.concatenate([cube.faces, cube.faces[:, ::-1] + len(cube.vertices)]),
    )
    filling, glass = Object("water", cube, "glass", scale=(0.8, 0.8, 0.8)), Object("glass", hollow, "glass")
    assert set(grown_bodies(scene_of(filling, glass))) == {"water"}
    # By more than the hole does.
    slab = Object("slab", cube, "glass", (0, -1, 0), scale=(3, 1, 3))
    grown = grown_bodies(scene_of(filling, glass, slab))
    shares = [np.ptp(grown[name].world_bounds[:, 0]) / size for name, size in (("glass", 1), ("water", 0.8))]
    assert 1 < shares[0] < shares[1] - 5e-6


@pytest.mark.parametrize("position", [(0, 0, 0), (3, -4, 5)], ids=str)
@pytest.mark.parametrize("turn", [(0, 0, 0), (10, 20, 30)], ids=str)
def test_contact_is_found_wherever_it_is(position: Vector, turn: Vector) -> None:
    frame = np.vstack([Object("o", shape("cube"), "glass", position, turn).world_from_object, [0, 0, 0, 1]])
    placed = [
        Object(obj.name, obj.mesh, "glass", matrix=frame @ np.vstack([obj.world_from_object, [0, 0, 0, 1]]))
        for obj in (GLASS, WATER)
    ]
    assert set(grown_bodies(scene_of(*placed))) == {"water"}


def test_a_body_that_stays_in_contact_is_the_same_object() -> None:
    """So that an edit of another one does not describe it again."""
    scene = scene_of(GLASS, WATER, Object("stone", shape("cube"), "stone"))
    moved = scene.with_object("stone", position=(0, 5, 0))
    assert separated(moved)[1] is separated(scene)[1] is not WATER


def test_many_bodies_side_by_side_grow_by_few_steps() -> None:
    """Each pair that touches face to face overlaps."""
    cubes = [Object(f"{i}", shape("cube"), "glass", (i % 6, 0, i // 6)) for i in range(36)]
    bounds = np.array([obj.world_bounds for obj in separated(scene_of(*cubes))])
    growth = (np.ptp(bounds, axis=1)[:, 0] - 1) / 2
    assert growth.max() < 4e-4
    for i, j in ((0, 1), (0, 6), (7, 8), (20, 26), (34, 35)):
        assert growth[i] + growth[j] > 1e-5
