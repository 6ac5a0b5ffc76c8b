"""Where the camera sees points."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.cameras import cameras

from incpt.core.errors import InputError
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


fractions = st.floats(0, 1)
places = st.tuples(fractions, fractions)
quick = settings(max_examples=100, deadline=None)


@pytest.mark.slow
@quick
@given(cameras(), st.lists(places, min_size=1, max_size=8), st.floats(0.2, 5), st.floats(0.01, 100))
def test_a_ray_meets_what_is_seen_in_its_place(
    camera: Camera, at: list[tuple[float, float]], aspect: float, distance: float
) -> None:
    starts, directions = camera.rays(np.array(at), aspect)
    np.testing.assert_allclose(directions @ camera.image_plane(aspect)[2], 1)
    found, in_front = camera.project(starts + distance * directions, aspect)
    assert in_front.all()
    np.testing.assert_allclose(found, at, atol=1e-4)
    assert not camera.project(starts - distance * directions, aspect)[1].any()


@pytest.mark.parametrize("aspect", [2.0, 0.5])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_shift_is_a_fraction_of_the_larger_side(projection: str, aspect: float) -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), fov_y=90, projection=projection, ortho_height=10)
    shifted = replace(camera, shift_x=0.1, shift_y=0.2)
    points = np.array([[0.3, 0.2, 0], [-0.5, 0.7, 1]])
    # As the picture moves right and up, what it shows moves left and down.
    moved = shifted.project(points, aspect)[0] - camera.project(points, aspect)[0]
    larger = max(aspect, 1)
    np.testing.assert_allclose(moved, [[-0.1 * larger / aspect, 0.2 * larger]] * 2, atol=1e-12)


def test_an_orthographic_picture_shows_its_height() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), projection="orthographic", ortho_height=4)
    corners = np.array([[-4, 2, 0], [4, -2, 3], [0, 0, -90]])
    np.testing.assert_allclose(camera.project(corners, 2.0)[0], [[0, 0], [1, 1], [0.5, 0.5]], atol=1e-12)


@pytest.mark.parametrize(
    ("fit", "aspect", "height_mm"),
    [("auto", 2.0, 18.0), ("auto", 0.5, 36.0), ("horizontal", 2.0, 18.0), ("horizontal", 0.5, 72.0),
     ("vertical", 2.0, 24.0), ("vertical", 0.5, 24.0)],
)  # fmt: skip
def test_focal_length_and_sensor_tell_the_field_of_view(fit: str, aspect: float, height_mm: float) -> None:
    # As in Blender, whose cameras say 2 atan(sensor / (2 lens)).
    camera = Camera(focal_length=50, sensor_fit=fit)
    angle = math.degrees(2 * math.atan(height_mm / 100))
    assert camera.fov_y_at(aspect) == pytest.approx(angle)
    same = Camera(fov_y=angle, sensor_fit=fit)
    np.testing.assert_allclose(camera.image_plane(aspect), same.image_plane(aspect))
    assert same.focal_length_at(aspect) == pytest.approx(50)
    assert replace(same, f_stop=2).lens_radius(aspect) == pytest.approx(0.050 / 4)
    assert replace(camera, f_stop=2).lens_radius(aspect) == pytest.approx(0.050 / 4)


def test_the_lens_of_an_orthographic_camera_is_a_metre_long() -> None:
    camera = Camera(projection="orthographic", f_stop=4, focal_length=35)
    assert camera.lens_radius(1.5) == pytest.approx(1 / 8)
    assert Camera().lens_radius(1.5) == 0


def test_what_is_sharp_is_where_the_target_is_unless_said_otherwise() -> None:
    camera = Camera((0, 0, 5), (0, 0, 1), f_stop=1)
    assert camera.sharp_distance == 4 and replace(camera, focus_distance=2.5).sharp_distance == 2.5
    assert not camera.blur(np.array([[7.0, 3.0, 1.0]]), 2.0).any()


@quick
@given(cameras(), st.floats(0.2, 5), st.floats(0.05, 20), st.floats(0, 2 * math.pi))
def test_blur_is_how_far_a_point_moves_in_the_picture(
    camera: Camera, aspect: float, distance: float, angle: float
) -> None:
    """A camera whose position is on the rim of the aperture, and whose picture is shifted such that what is
    sharp keeps its place, sees what is seen through the rim."""
    lens = replace(camera, f_stop=0.5)
    radius, sharp = lens.lens_radius(aspect), lens.sharp_distance
    right, up, forward = lens.image_plane(aspect)
    starts, directions = lens.rays(np.array([[0.3, 0.6]]), aspect)
    point = starts + distance * directions
    aside = radius * (
        math.cos(angle) * right / np.linalg.norm(right) + math.sin(angle) * up / np.linalg.norm(up)
    )
    # From the rim, through the point to the plane that is sharp, and from there through the middle.
    ray = point - (np.asarray(lens.position) + aside if not lens.is_orthographic else starts + aside)
    if lens.is_orthographic:
        # Rays of a place all meet where it is sharp: the one through the point and the rim starts at another.
        middle = point - aside * (1 - distance / sharp) - distance * forward
        on_plane = middle + sharp * forward
    else:
        on_plane = np.asarray(lens.position) + aside + ray * sharp / (ray @ forward)
    moved = lens.project(on_plane, aspect)[0] - lens.project(point, aspect)[0]
    blur = lens.blur(point, aspect)
    np.testing.assert_allclose(
        moved[0],
        blur[0] * [math.cos(angle), -math.sin(angle)] * np.sign(1 / sharp - 1 / distance),
        atol=1e-6 + 1e-6 * float(blur.max()),
    )


def test_where_paths_start() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0))
    assert camera.start == camera.position and replace(camera, near=2).start == (0, 0, 3)


@pytest.mark.parametrize(
    ("name", "value"),
    [("projection", "fisheye"), ("sensor_fit", "fill"), ("ortho_height", 0.0), ("focal_length", -1.0),
     ("sensor_width", 0.0), ("sensor_height", "full"), ("shift_x", float("nan")), ("shift_y", 1e3),
     ("f_stop", -2.8), ("focus_distance", -1.0), ("blades", 2), ("blades", 5.5), ("blade_rotation", None),
     ("near", -0.1)],
)  # fmt: skip
def test_every_field_is_checked(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: "):
        Camera(**{name: value})
