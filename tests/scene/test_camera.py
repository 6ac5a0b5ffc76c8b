"""Where the camera sees points."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.scene.camera import Camera


def test_row_0_is_on_top() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), fov_y=90)
    points = np.array([[0, 0, 0], [10, 0, 0], [0, 5, 0], [-10, -5, 0], [0, 0, 9]])
    places, in_front = camera.project(points, 2.0)
    np.testing.assert_allclose(places[:4], [[0.5, 0.5], [1, 0.5], [0.5, 0], [0, 1]], atol=1e-9)
    assert in_front.tolist() == [True, True, True, True, False]


@pytest.mark.parametrize("target", [(0, 5, 0), (0, -5, 0)])
def test_looking_along_up_still_gives_an_image_plane(target: tuple[float, float, float]) -> None:
    right, up, forward = Camera((0, 0, 0), target, fov_y=60).image_plane(1.0)
    assert abs(right @ up) < 1e-12 and abs(right @ forward) < 1e-12 and np.linalg.norm(right) > 0.1
    right, up, forward = Camera((0, 0, 0), (0, 0, 3), (0, 0, 1), 60).image_plane(1.0)
    assert np.isfinite(right).all() and abs(up @ forward) < 1e-12


@pytest.mark.parametrize("length", [2e-9, 1.0, 1e9])
def test_length_of_up_does_not_matter(length: float) -> None:
    for target, up in (((0, 0.98, 0.17), (0, 1, 0)), ((0.3, 0.5, 0.8), (0.3, 0.5, 0.8))):
        scaled = tuple(length * c for c in up)
        plane = Camera((0, 0, 0), target, scaled, 90).image_plane(1.0)
        np.testing.assert_allclose(plane, Camera((0, 0, 0), target, up, 90).image_plane(1.0), atol=1e-9)
        np.testing.assert_allclose(np.array(plane) @ np.transpose(plane), np.eye(3), atol=1e-9)
