"""Moves of the camera, checked on where points land in the picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.cameras import cameras, points, units

from incpt.core import affine
from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.scene import camera_moves
from incpt.scene.camera import Camera
from incpt.scene.camera_moves import MAX_ELEVATION_DEG, VIEWS
from incpt.scene.checks import LARGEST

SIZE = (960, 540)
HEIGHT = SIZE[1]

pixels = st.tuples(st.floats(0, SIZE[0]), st.floats(0, SIZE[1]))
drags = st.tuples(st.floats(-2000, 2000), st.floats(-2000, 2000))


def pixel_of(camera: Camera, point: Vector) -> np.ndarray:
    aspect = SIZE[0] / SIZE[1]
    found, in_front = camera.project(np.array([point]), aspect)
    found = found * SIZE
    assert in_front.all()
    return found[0]


def elevation(camera: Camera) -> float:
    back = np.subtract(camera.position, camera.target)
    up = np.array(camera.up) / math.hypot(*camera.up)
    return math.degrees(math.asin(np.clip(back @ up / np.linalg.norm(back), -1, 1)))


def distance(camera: Camera) -> float:
    return math.dist(camera.position, camera.target)


quick = settings(max_examples=60, deadline=None)


@quick
@given(cameras(), pixels, drags)
def test_pan_keeps_the_point_under_the_cursor(
    camera: Camera, start: tuple[float, float], drag: tuple[float, float]
) -> None:
    point = camera_moves.point_under(camera, start, SIZE)
    assert pixel_of(camera, point) == pytest.approx(start, abs=1e-3)
    panned = camera_moves.pan(camera, *drag, SIZE)
    assert pixel_of(panned, point) == pytest.approx(np.add(start, drag), abs=0.01)
    assert distance(panned) == pytest.approx(distance(camera))


@quick
@given(cameras(), pixels, st.floats(-5, 5))
def test_zoom_keeps_the_point_under_the_cursor(
    camera: Camera, cursor: tuple[float, float], notches: float
) -> None:
    point = camera_moves.point_under(camera, cursor, SIZE)
    zoomed = camera_moves.wheel(camera, notches, cursor, SIZE)
    assert pixel_of(zoomed, point) == pytest.approx(cursor, abs=0.01)
    factor = camera_moves.WHEEL_FACTOR**notches
    if camera.is_orthographic:
        assert zoomed.ortho_height == pytest.approx(camera.ortho_height * factor)
        assert distance(zoomed) == pytest.approx(distance(camera))
    else:
        assert distance(zoomed) == pytest.approx(distance(camera) * factor)
    assert camera_moves.point_under(zoomed, cursor, SIZE) == pytest.approx(point, abs=1e-6)


@quick
@given(cameras(), drags)
def test_orbit_keeps_target_distance_and_stays_off_the_poles(
    camera: Camera, drag: tuple[float, float]
) -> None:
    assume(abs(elevation(camera)) < MAX_ELEVATION_DEG)
    turned = camera_moves.orbit(camera, *drag, HEIGHT)
    assert turned.target == camera.target and distance(turned) == pytest.approx(distance(camera))
    wanted = elevation(camera) + drag[1] * camera_moves.ORBIT_DEG / HEIGHT
    clamped = min(max(wanted, -MAX_ELEVATION_DEG), MAX_ELEVATION_DEG)
    assert elevation(turned) == pytest.approx(clamped, abs=1e-3)
    assert pixel_of(turned, camera.target) == pytest.approx(pixel_of(camera, camera.target), abs=1e-3)


@quick
@given(cameras(), st.lists(drags, min_size=1, max_size=6))
def test_orbit_in_small_steps_is_the_orbit_in_one(camera: Camera, path: list[tuple[float, float]]) -> None:
    sideways = [(dx, 0.0) for dx, _ in path]
    stepped = camera
    for step in sideways:
        stepped = camera_moves.orbit(stepped, *step, HEIGHT)
    at_once = camera_moves.orbit(camera, sum(dx for dx, _ in sideways), 0.0, HEIGHT)
    assert stepped.position == pytest.approx(at_once.position, abs=1e-6 * distance(camera) + 1e-9)


def test_orbit_follows_the_hand() -> None:
    camera = Camera((0, 1, 5), (0, 1, 0))
    near = (0.0, 1.0, 1.0)  # a point before the target: it moves as the hand does
    x, y = pixel_of(camera, near)
    right = pixel_of(camera_moves.orbit(camera, 20, 0, HEIGHT), near)
    down = pixel_of(camera_moves.orbit(camera, 0, 20, HEIGHT), near)
    assert right[0] > x and right[1] == pytest.approx(y)
    assert down[1] > y and down[0] == pytest.approx(x)
    assert elevation(camera_moves.orbit(camera, 0, 20, HEIGHT)) > 0


def test_the_view_never_flips_over_the_pole() -> None:
    camera = Camera((0, 1, 5), (0, 0, 0))
    for _ in range(50):
        turned = camera_moves.orbit(camera, 3, 30, HEIGHT)
        right_before = camera.image_plane(1)[0]
        right_after = turned.image_plane(1)[0]
        assert right_before @ right_after > 0.9 * (right_before @ right_before)
        camera = turned
    assert elevation(camera) == pytest.approx(MAX_ELEVATION_DEG)


@pytest.mark.parametrize("height", [5.0, -5.0])
def test_a_camera_that_looks_along_up_can_be_turned(height: float) -> None:
    camera = Camera((0, height, 0), (0, 0, 0))
    for move in (camera_moves.orbit, camera_moves.look):
        turned = move(camera, 10, 10, HEIGHT)
        assert abs(elevation(turned)) <= MAX_ELEVATION_DEG + 1e-6 and distance(turned) == pytest.approx(5)


@quick
@given(cameras(), drags)
def test_look_turns_in_place(camera: Camera, drag: tuple[float, float]) -> None:
    turned = camera_moves.look(camera, *drag, HEIGHT)
    assert turned.position == camera.position and distance(turned) == pytest.approx(distance(camera))
    wanted = elevation(camera) + drag[1] * camera_moves.LOOK_DEG / HEIGHT
    clamped = min(max(wanted, -MAX_ELEVATION_DEG), MAX_ELEVATION_DEG)
    assert elevation(turned) == pytest.approx(clamped, abs=1e-3)


def test_looking_follows_the_hand() -> None:
    camera = Camera((0, 1, 5), (0, 1, 0))
    to_the_right = camera_moves.look(camera, 540, 0, HEIGHT)
    assert to_the_right.target == pytest.approx((5, 1, 5))
    assert camera_moves.look(camera, 0, 270, HEIGHT).target[1] < 0


@quick
@given(cameras(), units, units, units)
def test_flying_is_no_faster_than_asked(camera: Camera, forward: float, right: float, up: float) -> None:
    moved = camera_moves.fly(camera, forward, right, up, seconds=0.5, speed=4.0)
    step = np.subtract(moved.position, camera.position)
    assert np.linalg.norm(step) <= 2.0 + 1e-6
    assert np.subtract(moved.target, camera.target) == pytest.approx(step, abs=1e-9)


def test_flying_goes_where_the_keys_say() -> None:
    camera = Camera((0, 1, 5), (0, 1, 0))
    for keys, expected in (((1, 0, 0), (0, 1, 3)), ((0, 1, 0), (2, 1, 5)), ((0, 0, 1), (0, 3, 5))):
        assert camera_moves.fly(camera, *keys, 1.0, 2.0).position == pytest.approx(expected)


@quick
@given(cameras(), points, st.tuples(*[st.floats(0, 30)] * 3), st.floats(0.3, 4))
def test_frame_shows_all_of_a_box_with_margin(
    camera: Camera, low: Vector, extent: Vector, aspect: float
) -> None:
    box = np.array([low, np.add(low, extent)])
    framed = camera_moves.frame(camera, box, aspect)
    forward = framed.image_plane(aspect)[2]
    found, in_front = framed.project(affine.box_corners(box), aspect)
    assert in_front.all()
    normalized = np.abs(found * 2 - 1).max()
    assert normalized <= 1 / camera_moves.FRAME_MARGIN + 1e-3
    if max(extent) > 0.01:
        clearance = camera_moves.FRAME_CLEARANCE * math.hypot(*extent)
        if framed.is_orthographic and framed.ortho_height > 1.001 * clearance:
            assert normalized == pytest.approx(1 / camera_moves.FRAME_MARGIN, abs=1e-3)
        nearest = ((affine.box_corners(box) - framed.position) @ forward).min()
        is_close = nearest == pytest.approx(clearance, rel=1e-3) or framed.is_orthographic
        assert is_close or normalized == pytest.approx(1 / camera_moves.FRAME_MARGIN, abs=1e-3)
        middle, _ = framed.project(box.mean(axis=0)[None], aspect)
        assert middle[0] == pytest.approx([0.5, 0.5], abs=1e-6)
        depth = (np.mean(box, axis=0) - framed.position) @ forward
        assert distance(framed) == pytest.approx(depth)


@pytest.mark.parametrize("side", list(VIEWS))
def test_views_look_along_their_axis(side: str) -> None:
    camera = Camera((3, 4, 5), (1, 2, 3), (0.1, 1, 0.2))
    seen = camera_moves.set_view(camera, side)
    back = np.subtract(seen.position, seen.target) / distance(seen)
    assert back == pytest.approx(VIEWS[side], abs=0.002)
    assert seen.target == camera.target and distance(seen) == pytest.approx(distance(camera))
    right, up, _ = seen.image_plane(1)
    expected = {"front": "+x", "back": "-x", "right": "-z", "left": "+z", "top": "+x", "bottom": "+x"}[side]
    axis = "xyz".index(expected[1])
    assert right[axis] * (1 if expected[0] == "+" else -1) == pytest.approx(np.linalg.norm(right))
    upward = {"top": (2, -1), "bottom": (2, 1)}.get(side, (1, 1))
    assert up[upward[0]] * upward[1] > 0.99 * np.linalg.norm(up)


def test_dolly_goes_nearer_and_back() -> None:
    camera = Camera((0, 1, 5), (0, 1, 0))
    near = camera_moves.dolly(camera, 0, -100, HEIGHT)
    assert distance(near) < 5 and near.target == pytest.approx(camera.target)
    assert camera_moves.dolly(near, 0, 100, HEIGHT).position == pytest.approx(camera.position)


def test_zoom_stops_before_the_target_and_turns_back() -> None:
    camera = Camera((0, 1, 5), (0, 1, 0))
    for _ in range(300):
        camera = camera_moves.wheel(camera, 1, (100, 100), SIZE)
    assert distance(camera) == pytest.approx(camera_moves.NEAREST)
    assert distance(camera_moves.wheel(camera, -1, (100, 100), SIZE)) > camera_moves.NEAREST


@settings(max_examples=60, deadline=None)
@given(st.floats(-1e9, 1e9), st.floats(1e-6, 1e9), st.floats(-1e9, 1e9), st.floats(-1e6, 1e6))
def test_no_move_leaves_what_a_scene_allows(x: float, z: float, drag: float, other: float) -> None:
    assume(abs(z) <= LARGEST)
    camera = Camera((x, 0, z), (x, 0, 0))
    box = np.array([[-LARGEST] * 3, [LARGEST] * 3])
    moved = [
        camera_moves.orbit(camera, drag, other, HEIGHT),
        camera_moves.look(camera, drag, other, HEIGHT),
        camera_moves.pan(camera, drag, other, SIZE),
        camera_moves.wheel(camera, drag, (3, 4), SIZE),
        camera_moves.dolly(camera, drag, other, HEIGHT),
        camera_moves.fly(camera, 1, 1, 1, 1.0, drag),
        camera_moves.frame(camera, box, 2.0),
        camera_moves.set_view(camera, "top"),
    ]
    for result in moved:
        assert isinstance(result, Camera) and replace(result) == result


CROPPED = (64, 40)
fractions = st.tuples(st.floats(0, 1), st.floats(0, 1))
boxes = st.tuples(
    *[st.integers(0, side - 8) for side in CROPPED], *[st.integers(8, side) for side in CROPPED]
)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(cameras(), boxes, st.lists(fractions, min_size=1, max_size=4), st.floats(0, 8))
def test_a_cropped_camera_has_the_rays_and_the_lens_of_the_part(
    camera: Camera, box: tuple[int, int, int, int], at: list[tuple[float, float]], f_stop: float
) -> None:
    camera, (width, height) = replace(camera, f_stop=f_stop), CROPPED
    left, top = box[:2]
    right, bottom = min(left + box[2], width), min(top + box[3], height)
    part = camera_moves.cropped(camera, CROPPED, (left, top, right, bottom))
    inside = np.array(at) * (right - left, bottom - top) + (left, top)
    expected = camera.rays(inside / CROPPED, width / height)
    aspect = (right - left) / (bottom - top)
    for ray, wanted in zip(part.rays(np.array(at), aspect), expected, strict=True):
        np.testing.assert_allclose(ray, wanted, rtol=1e-9, atol=1e-9)
    assert part.lens_radius(aspect) == pytest.approx(camera.lens_radius(width / height))


def test_a_crop_without_pixels_is_refused() -> None:
    with pytest.raises(InputError, match="no pixels"):
        camera_moves.cropped(Camera(), CROPPED, (8, 8, 8, 16))
