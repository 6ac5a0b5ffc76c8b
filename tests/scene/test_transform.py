"""Transforms as values: numbers as they were typed, or a matrix that keeps its shear."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core import affine
from incpt.core.errors import InputError
from incpt.scene import edits
from incpt.scene.change import affected_objects, diff
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.transform import IDENTITY, Transform

Matrix = npt.NDArray[np.float64]

SHEARED = np.array([[1.0, 0.5, 0.0, 3.0], [0.0, 2.0, 0.25, -1.0], [0.1, 0.0, 1.5, 2.0]])
MIRRORED = SHEARED * [-1.0, 1.0, 1.0, 1.0]

quick = settings(max_examples=80, deadline=None)
vectors = st.tuples(*[st.floats(-100, 100)] * 3)
angles = st.tuples(*[st.floats(-400, 400)] * 3)
scales = st.tuples(*[st.floats(0.05, 20) | st.floats(-20, -0.05)] * 3)
shears = st.tuples(*[st.floats(-1.5, 1.5)] * 3)


@st.composite
def matrices(draw: st.DrawFn) -> Matrix:
    """Scaled, sheared, turned, moved; mirrored or not."""
    world = affine.compose(draw(vectors), draw(angles), (1, 1, 1))
    xy, xz, yz = draw(shears)
    world[:, :3] = world[:, :3] @ np.array([[1, xy, xz], [0, 1, yz], [0, 0, 1]]) * draw(scales)
    return world


def close(matrix: Matrix, expected: Matrix) -> None:
    np.testing.assert_allclose(matrix, expected, atol=1e-9 * np.abs(expected).max())


@quick
@given(vectors, angles, scales)
def test_numbers_stay_as_they_were_typed(position: Any, rotation: Any, scale: Any) -> None:
    placed = Transform(position, rotation, scale)
    assert (placed.position, placed.rotation, placed.scale) == (position, rotation, scale)
    assert placed.matrix is None
    assert np.array_equal(placed.world_from_object, affine.compose(position, rotation, scale))
    assert placed == Transform(position, rotation, scale) and hash(placed) == hash(replace(placed))


@quick
@given(matrices())
def test_a_matrix_is_kept_exactly(matrix: Matrix) -> None:
    placed = Transform.from_matrix(matrix)
    assert np.array_equal(placed.world_from_object, matrix)
    assert placed == Transform.from_matrix(np.vstack([matrix, [0, 0, 0, 1]]).tolist())
    assert hash(placed) == hash(Transform.from_matrix(matrix))
    assert placed.position == tuple(matrix[:, 3])
    assert pickle.loads(pickle.dumps(placed)) == copy.deepcopy(placed) == placed


@quick
@given(vectors, angles, scales)
def test_without_shear_the_numbers_say_all_of_a_matrix(position: Any, rotation: Any, scale: Any) -> None:
    matrix = affine.compose(position, rotation, scale)
    placed = Transform.from_matrix(matrix)
    numbers = Transform(placed.position, placed.rotation, placed.scale)
    np.testing.assert_allclose(numbers.world_from_object, matrix, atol=1e-4)


@quick
@given(matrices(), vectors)
def test_another_position_moves_a_matrix_alone(matrix: Matrix, position: Any) -> None:
    placed = Transform.from_matrix(matrix).with_parts(position=position)
    assert placed.position == position
    assert np.array_equal(placed.world_from_object, np.column_stack([matrix[:, :3], position]))


@quick
@given(matrices(), angles)
def test_another_rotation_turns_a_matrix_about_its_position(matrix: Matrix, rotation: Any) -> None:
    old = Transform.from_matrix(matrix)
    new = old.with_parts(rotation=rotation)
    np.testing.assert_allclose(new.rotation, rotation, atol=1e-3)
    np.testing.assert_allclose(new.scale, old.scale, rtol=1e-6)
    assert new.position == old.position
    turn = affine.rotation_matrix(rotation) @ affine.rotation_matrix(old.rotation).T
    close(new.world_from_object[:, :3], turn @ matrix[:, :3])
    # The lengths of the axes and the angles between them are what a rotation leaves alone.
    close(new.world_from_object[:, :3].T @ new.world_from_object[:, :3], matrix[:, :3].T @ matrix[:, :3])


@quick
@given(matrices(), scales)
def test_another_scale_multiplies_the_axes_of_a_matrix(matrix: Matrix, factors: Any) -> None:
    old = Transform.from_matrix(matrix)
    scale = tuple(float(f * s) for f, s in zip(factors, old.scale, strict=True))
    new = old.with_parts(scale=scale)  # type: ignore[arg-type]
    close(new.world_from_object, matrix * [*factors, 1])
    if min(factors) > 0:
        np.testing.assert_allclose(new.scale, scale, rtol=1e-6)
        np.testing.assert_allclose(new.rotation, old.rotation, atol=1e-3)


@quick
@given(matrices(), vectors, angles)
def test_parts_typed_back_restore_a_matrix(matrix: Matrix, position: Any, rotation: Any) -> None:
    old = Transform.from_matrix(matrix)
    there = old.with_parts(position=position, rotation=rotation, scale=(1, 2, 3))
    back = there.with_parts(position=old.position, rotation=old.rotation, scale=old.scale)
    np.testing.assert_allclose(back.world_from_object, matrix, atol=1e-6 * np.abs(matrix).max())


def test_angles_of_a_matrix_follow_a_field_past_a_quarter_turn() -> None:
    """Near a quarter turn about y other angles describe the same: a field that is dragged would stick."""
    placed = Transform.from_matrix(SHEARED)
    x, y, z = placed.rotation
    for step in range(1, 60):
        placed = placed.with_parts(rotation=(x, y + 5 * step, z))
        np.testing.assert_allclose(placed.rotation, (x, y + 5 * step, z), atol=1e-3)


def test_how_a_matrix_is_shown_makes_no_difference() -> None:
    whole_turn = Transform(rotation=(0, 360, 0), matrix=Transform.from_matrix(SHEARED).matrix)
    assert whole_turn == Transform.from_matrix(SHEARED)
    assert whole_turn.rotation != Transform.from_matrix(SHEARED).rotation
    assert Transform.from_matrix(np.eye(4)) != IDENTITY
    assert IDENTITY.with_parts() is IDENTITY


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.zeros((3, 4)), "flattens"),
        (np.diag([1.0, 1e-7, 1.0, 1.0]), "flattens"),
        (np.array([[1.0, 1, 0, 0], [0, 1e-7, 0, 0], [0, 0, 1, 0]]), "flattens"),
        (np.diag([1.0, np.nan, 1.0, 1.0]), "not a finite number"),
        (np.diag([1.0, np.inf, 1.0, 1.0]), "not a finite number"),
        (np.diag([1.0, 1e10, 1.0, 1.0]), "out of range"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row is"),
        (np.eye(3), "three or four rows of four"),
        (np.eye(5), "three or four rows of four"),
        ([[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0]], "three or four rows of four"),
        (["abcd", "abcd", "abcd"], "not a list of rows"),
        ([[True, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "not a number"),
        (7, "not a list of rows"),
    ],
)
def test_matrices_that_place_nothing_are_refused(matrix: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"^matrix: .*{message}"):
        Transform.from_matrix(matrix)
    with pytest.raises(InputError, match=message):
        Object("a", shape("cube"), "red", matrix=matrix)


def test_a_transform_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        IDENTITY.position = (1, 2, 3)  # type: ignore[misc]
    for placed in (IDENTITY, Transform.from_matrix(SHEARED)):
        with pytest.raises(ValueError, match="read-only"):
            placed.world_from_object[0, 3] = 7
    with pytest.raises(InputError, match="flattens"):
        Transform(scale=(1, 0, 1))
    with pytest.raises(InputError, match="flattens"):
        Transform.from_matrix(SHEARED).with_parts(scale=(1, 0, 1))


# ------------------------------------------------------------------------------------- objects and scenes

SCENE = Scene(
    materials={"red": Material()},
    objects=(
        Object("cube", shape("cube"), "red", (1, 2, 3), (10, 20, 30), (1, 2, 3)),
        Object("odd", shape("cube"), "red", matrix=SHEARED),
    ),
)


def test_an_object_takes_numbers_a_matrix_or_a_transform() -> None:
    cube, odd = SCENE.objects
    assert cube.transform == Transform((1, 2, 3), (10, 20, 30), (1, 2, 3))
    assert replace(cube, transform=odd.transform).transform == Transform.from_matrix(SHEARED)
    assert replace(cube, scale=(1, 1, 1)).transform == Transform((1, 2, 3), (10, 20, 30))
    assert replace(cube, matrix=SHEARED) == replace(odd, name="cube")
    assert replace(odd, transform=IDENTITY).position == (0, 0, 0)
    with pytest.raises(InputError, match="matrix: stands beside position and scale; give one"):
        SCENE.with_object("cube", matrix=SHEARED, position=(1, 2, 3), scale=(1, 2, 3))
    with pytest.raises(InputError, match="transform: 'up' is not a Transform"):
        SCENE.with_object("cube", transform="up")
    with pytest.raises(InputError, match=r"translation: is no property of object; it has .*position.*matrix"):
        SCENE.with_object("cube", translation=(1, 2, 3))


def test_bounds_under_a_matrix_hold_every_corner() -> None:
    odd = SCENE.object("odd")
    corners = affine.apply(SHEARED, odd.mesh.vertices)
    np.testing.assert_allclose(odd.world_bounds, [corners.min(axis=0), corners.max(axis=0)])


def test_a_difference_sees_every_move_of_a_matrix() -> None:
    bent = SHEARED + np.array([[0, 0, 1e-6, 0], [0, 0, 0, 0], [0, 0, 0, 0]])
    for changes in ({"matrix": bent}, {"position": (0, 0, 0)}, {"rotation": (0, 0, 9)}):
        new = SCENE.with_object("odd", **changes)
        change = diff(SCENE, new)
        assert change.objects == change.moved == {"odd"}
        assert affected_objects(SCENE, new, change) == [SCENE.object("odd"), new.object("odd")]
    assert not diff(SCENE, SCENE.with_object("odd", matrix=SHEARED)).is_local


@quick
@given(matrices(), matrices(), vectors)
def test_a_gizmo_keeps_the_shear_of_a_matrix(matrix: Matrix, delta: Matrix, pivot: Any) -> None:
    """Whatever the matrix of the movement is, every corner goes where it says."""
    scene = SCENE.with_object("odd", matrix=matrix)
    moved = edits.transform_objects(scene, ("odd",), np.vstack([delta, [0, 0, 0, 1]]), pivot).object("odd")
    corners = affine.box_corners(moved.mesh.bounds)
    before = affine.apply(matrix, corners)
    expected = affine.apply(delta, before - pivot) + pivot
    found = affine.apply(moved.world_from_object, corners)
    assert moved.transform.matrix is not None
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max() + 1e-6)


def test_a_matrix_that_would_be_flattened_stays_as_it_was() -> None:
    flat = np.diag([1.0, 0.0, 1.0, 1.0])
    assert edits.transform_objects(SCENE, ("odd",), flat) == SCENE
    far = edits.transform_objects(SCENE, ("odd",), np.array([[1, 0, 0, 1e12], *np.eye(4)[1:]]))
    assert far.object("odd").position == (1e9, -1.0, 2.0)


@pytest.mark.parametrize("matrix", [SHEARED, MIRRORED])
def test_turning_a_matrix_by_a_gizmo_does_not_make_its_angles_jump(matrix: Matrix) -> None:
    scene = SCENE.with_object("odd", matrix=matrix)
    turn = np.eye(4)
    turn[:3, :3] = affine.rotation_matrix((0, 7, 0))
    for _ in range(60):
        old = scene.object("odd")
        scene = edits.transform_objects(scene, ("odd",), turn, old.position)
        new = scene.object("odd")
        assert np.abs(np.subtract(new.rotation, old.rotation)).max() < 60
        assert np.array_equal(np.sign(new.scale), np.sign(old.scale))
