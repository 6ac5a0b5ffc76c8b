"""The light tree as the host builds it: lights are where their trails lead, within all bounds on the way."""

from __future__ import annotations

import numpy as np
import pytest
from support.light_trees import Tree, made_up

from incpt.core import layout
from incpt.core.layout import LIGHT_TREE_BITS, LightNodePlane
from incpt.tables import light_tree
from incpt.tables.light_tree import TreeLights

PLANE = LightNodePlane
COUNTS = [1, 2, 8, 9, 64, 65, 700, 4100]


def ways(tree: Tree) -> list[list[tuple[int, int]]]:
    """Of each light the nodes and children that its trail leads through."""
    found = []
    for trail in tree.trails.tolist():
        way, reference = [], 0
        for level in range(tree.levels):
            way.append((reference, trail >> LIGHT_TREE_BITS * level & 7))
            reference = int(tree.nodes["child"][way[-1]])
        assert trail < 1 << LIGHT_TREE_BITS * tree.levels and reference & layout.NODE_LEAF
        found.append(way)
    return found


@pytest.mark.parametrize("count", COUNTS)
def test_trails_lead_to_the_lights(count: int) -> None:
    lights = made_up(count)
    tree = Tree.of(lights)
    leaves = [int(tree.nodes["child"][way[-1]]) & ~layout.NODE_LEAF for way in ways(tree)]
    np.testing.assert_array_equal(leaves, lights.numbers)
    children = tree.nodes["child"] != layout.NODE_EMPTY
    np.testing.assert_array_equal(children.sum(axis=1), tree.nodes["last"] + 1)
    assert (
        children.argmin(axis=1)[tree.nodes["last"] < 7] == tree.nodes["last"][tree.nodes["last"] < 7] + 1
    ).all()
    # No more nodes than lights need that fill them half.
    assert len(tree.nodes) <= max(count / 2, 1)


@pytest.mark.parametrize("offset", [0.0, 10_000.0])
@pytest.mark.parametrize("count", [9, 700])
def test_bounds_hold_the_lights(count: int, offset: float) -> None:
    lights = made_up(count, offset=offset)
    tree = Tree.of(lights)
    slack = 1e-6 + 2.0**-22 * offset
    for i, way in enumerate(ways(tree)):
        corners = np.stack(np.meshgrid(*lights.bounds[i].T), axis=-1).reshape(-1, 3)
        for place, slot in way:
            planes = tree.nodes["planes"][place, :, slot].astype(np.float64)
            center, axis = (
                planes[PLANE.CENTER_X : PLANE.CENTER_Z + 1],
                planes[PLANE.AXIS_X : PLANE.AXIS_Z + 1],
            )
            assert np.linalg.norm(corners - center, axis=1).max() <= planes[PLANE.RADIUS] + slack
            angle = np.arccos(np.clip(axis @ lights.axis[i], -1, 1))
            spread = np.arctan2(planes[PLANE.SIN_SPREAD], planes[PLANE.COS_SPREAD])
            assert spread > 3 or min(angle + lights.spread[i], np.pi) <= spread + 1e-3
            assert np.arccos(planes[PLANE.COS_FALLOFF]) >= lights.falloff[i] - 1e-3
            box = tree.boxes["bounds"][place, :, slot].astype(np.float64)
            if lights.met[i]:
                assert (box[0::2] < lights.bounds[i, 0]).all() and (lights.bounds[i, 1] < box[1::2]).all()


def test_powers_add_up() -> None:
    tree = Tree.of(made_up(700))
    power = tree.nodes["planes"][:, PLANE.POWER]
    assert power[0].sum() == pytest.approx(1, rel=1e-5)
    inner = np.argwhere(tree.nodes["child"] < layout.NODE_LEAF)
    assert len(inner) > 8
    for place, slot in inner:
        below = power[tree.nodes["child"][place, slot]].sum()
        assert below == pytest.approx(power[place, slot], rel=1e-5)


def test_rays_see_no_box_around_what_they_cannot_meet() -> None:
    lights = made_up(200)
    dark = TreeLights(**{**vars(lights), "met": np.zeros(200, np.bool_)})
    boxes = Tree.of(dark).boxes
    assert (boxes["child"] == layout.NODE_EMPTY).all() and (boxes["bounds"][:, 0::2] == np.inf).all()
    assert not (Tree.of(lights).boxes["child"] == layout.NODE_EMPTY).all()


def test_children_have_an_order_for_every_octant() -> None:
    boxes = Tree.of(made_up(300)).boxes
    places = (boxes["order"][:, :, None] >> (3 * np.arange(8, dtype=np.uint32))) & 7
    np.testing.assert_array_equal(np.sort(places, axis=2), np.broadcast_to(np.arange(8), places.shape))
    # Along +x +y +z the last, which is taken first, is nearest.
    root = boxes[0]
    there = [place for place in places[0, 0].tolist() if root["child"][place] != layout.NODE_EMPTY]
    along = root["bounds"][:, there].sum(axis=0)
    assert len(along) > 1 and (np.diff(along) <= 1e-5).all()


def test_lights_in_one_place_are_parted() -> None:
    lights = made_up(100)
    same = TreeLights(**{**vars(lights), "bounds": np.zeros((100, 2, 3))})
    assert len({tuple(way) for way in ways(Tree.of(same))}) == 100


def test_an_opposed_pair_shines_everywhere() -> None:
    up, down = np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, -1.0, 0.0]])
    axis, spread = light_tree.merged_cones((up, np.zeros(1)), (down, np.zeros(1)))
    assert np.linalg.norm(axis) == pytest.approx(1) and spread[0] == pytest.approx(np.pi)
    axis, spread = light_tree.merged_cones(
        (up, np.full(1, 0.1)), (np.array([[1.0, 0.0, 0.0]]), np.full(1, 0.4))
    )
    assert spread[0] == pytest.approx(np.pi / 4 + 0.4)
