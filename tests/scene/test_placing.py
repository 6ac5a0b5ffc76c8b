"""Moves, turns and scalings of one object or light."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.scene import placing
from incpt.scene.checks import LARGEST
from incpt.scene.light import Light
from incpt.scene.model import Object, Placed
from incpt.scene.shapes import shape
from incpt.scene.transform import SMALLEST_SCALE

SHEARED = np.array([[1.0, 0.5, 0.0, 3.0], [0.0, 2.0, 0.25, -1.0], [0.1, 0.0, 1.5, 2.0]])
BOX = Object("box", shape("cube"), "red", (1, 2, 3), (10, 20, 30), (1, 2, -3))
ODD = Object("odd", shape("cube"), "red", matrix=SHEARED)
LAMP = Light("lamp", "rectangle", (0, 3, 0), (-90, 10, 0), (2, 1, 1))
ALL = pytest.mark.parametrize("one", [BOX, ODD, LAMP], ids=lambda one: one.name)
PIVOT = np.array([0.5, -1.0, 2.0])
numbers = st.floats(-10, 10)
vectors = st.tuples(numbers, numbers, numbers)
angles = st.floats(-720, 720)


def world(one: Placed) -> np.ndarray:
    return np.vstack([one.transform.world_from_object, [0, 0, 0, 1]])


def about_pivot(linear: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = PIVOT - linear @ PIVOT
    return matrix


@ALL
@given(by=vectors)
def test_a_move_changes_the_position_alone(one: Placed, by: Vector) -> None:
    moved = placing.moved(one, by)
    assert moved.position == tuple(np.add(one.position, by))
    assert moved.rotation == one.rotation and moved.scale == one.scale
    np.testing.assert_array_equal(world(moved)[:3, :3], world(one)[:3, :3])


@ALL
@given(axis=vectors.filter(lambda v: np.linalg.norm(v) > 0.1), degrees=angles)
def test_a_turn_is_a_rotation_about_the_pivot(one: Placed, axis: Vector, degrees: float) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    turned = placing.turned(one, unit, degrees, PIVOT)
    expected = about_pivot(placing.turn_matrix(unit, degrees)) @ world(one)
    np.testing.assert_allclose(world(turned), expected, atol=1e-4)
    assert one is ODD or turned.scale == one.scale


@given(st.integers(0, 2), angles)
def test_a_turn_is_right_handed(axis: int, degrees: float) -> None:
    rotation = np.zeros(3)
    rotation[axis] = degrees
    expected = affine.rotation_matrix(tuple(rotation))
    np.testing.assert_allclose(placing.turn_matrix(np.eye(3)[axis], degrees), expected, atol=1e-12)


@ALL
@given(factors=st.tuples(*[st.floats(0.1, 5) | st.floats(-5, -0.1)] * 3), is_uniform=st.booleans())
def test_a_scaling_along_its_own_axes_is_exact_and_turns_nothing(
    one: Placed, factors: Vector, is_uniform: bool
) -> None:
    factors = (factors[0],) * 3 if is_uniform else factors
    axes = np.eye(3) if is_uniform else affine.rotation_matrix(one.rotation)
    scaled = placing.scaled(one, axes, factors, PIVOT)
    expected = about_pivot(axes * factors @ axes.T) @ world(one)
    np.testing.assert_allclose(world(scaled), expected, atol=1e-8)
    assert one is ODD or scaled.rotation == one.rotation


@ALL
def test_numbers_stay_in_the_range_of_a_scene(one: Placed) -> None:
    assert placing.moved(one, (1e12, -1e12, 0)).position[:2] == (LARGEST, -LARGEST)
    flat = placing.scaled(one, np.eye(3), (0, 0, 0), PIVOT)
    assert one is ODD or np.abs(flat.scale) == pytest.approx(SMALLEST_SCALE)
    assert one is not ODD or flat == ODD


@ALL
def test_what_does_nothing_gives_the_same_object(one: Placed) -> None:
    assert placing.turned(one, (0, 1, 0), 0.0, PIVOT) is one
    assert placing.scaled(one, np.eye(3), (1.0, 1.0, 1.0), PIVOT) is one
