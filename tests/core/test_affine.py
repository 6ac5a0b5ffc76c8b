"""Taking a matrix apart into position, rotation and scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incpt.core import affine

angles = st.one_of(
    st.floats(-720, 720),
    st.sampled_from([-270.0, -180.0, -90.0, 0.0, 90.0, 180.0, 450.0]),
    st.floats(-1e-4, 1e-4).map(lambda small: 90 + small),
)
rotations = st.tuples(angles, angles, angles)
sizes = st.floats(-3, 3).map(lambda exponent: 10**exponent)
scales = st.tuples(*[st.tuples(sizes, st.sampled_from([-1, 1])).map(np.prod)] * 3)
positions = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
quick = settings(max_examples=150, deadline=None)


@quick
@given(positions, rotations, scales, rotations)
def test_the_parts_give_the_matrix_again(position, rotation, scale, near) -> None:  # type: ignore[no-untyped-def]
    matrix = affine.compose(position, rotation, scale)
    parts = affine.decompose(matrix, near, scale)
    again = affine.compose(*parts)
    assert parts[0] == position
    assert np.array_equal(np.sign(parts[2]), np.sign(scale))
    np.testing.assert_allclose(parts[2], scale, rtol=1e-9)
    np.testing.assert_allclose(again / [*np.abs(scale), 1], matrix / [*np.abs(scale), 1], atol=3e-6)


@quick
@given(rotations, scales)
def test_the_rotation_does_not_jump(rotation, scale) -> None:  # type: ignore[no-untyped-def]
    matrix = affine.compose((0, 0, 0), rotation, scale)
    _, found, _ = affine.decompose(matrix, rotation, scale)
    np.testing.assert_allclose(found, rotation, atol=2e-4)


@quick
@given(rotations, rotations)
def test_no_other_whole_turn_is_nearer(rotation, near) -> None:  # type: ignore[no-untyped-def]
    matrix = affine.compose((0, 0, 0), rotation, (1, 1, 1))
    _, found, _ = affine.decompose(matrix, near)
    distance = np.linalg.norm(np.subtract(found, near))
    x, y, z = found
    for first in ((x, y, z), (x + 180, 180 - y, z + 180)):
        turns = 360 * np.round(np.subtract(near, first) / 360)
        assert distance <= np.linalg.norm(first + turns - near) + 1e-4


def test_a_mirror_turns_one_sign_and_keeps_the_rotation_near() -> None:
    matrix = affine.compose((0, 0, 0), (10, 20, 30), (1, 2, -3))
    position, rotation, scale = affine.decompose(matrix, (10, 20, 30), (1, 1, 1))
    np.testing.assert_allclose(rotation, (10, 20, 30), atol=1e-9)
    np.testing.assert_allclose(scale, (1, 2, -3), atol=1e-9)
    assert position == (0, 0, 0)


def test_shear_is_dropped_evenly() -> None:
    sheared = np.column_stack([np.array([[1, 0.2, 0], [0.2, 1, 0], [0, 0, 1]]), np.zeros(3)])
    _, rotation, scale = affine.decompose(sheared)
    np.testing.assert_allclose(rotation, 0, atol=1e-9)  # symmetric: neither x nor y is preferred
    assert scale[0] == pytest.approx(scale[1]) == 1 and scale[2] == pytest.approx(1)


@pytest.mark.parametrize("scale", [(0, 1, 1), (1, np.nan, 1), (1, np.inf, 1)])
def test_what_cannot_be_taken_apart_is_refused(scale: tuple[float, float, float]) -> None:
    matrix = np.column_stack([np.diag(scale), np.zeros(3)])
    with pytest.raises(np.linalg.LinAlgError):
        affine.decompose(matrix)


def test_flat_axes_are_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        affine.decompose(np.array([[1.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0]]))
