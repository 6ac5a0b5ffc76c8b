"""Moves that snap to what the mouse points at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.scene.arranging import extent
from incpt.scene.light import Light
from incpt.scene.model import Object
from incpt.scene.selection import Selection
from incpt.scene.shapes import shape
from incpt.ui.preferences import Preferences, SnapSettings
from incpt.ui.rect import Rect
from incpt.ui.viewport import snapping

SCENE = mixed_scene(size=(48, 32)).with_object("red cube", rotation=(0, 0, 0)).with_added_light(
    Light("spot", "spot", (-1.5, 2.0, 0.0))
)  # fmt: skip


@pytest.fixture
def user(request: pytest.FixtureRequest) -> Iterator[Desk]:
    snap = SnapSettings(enabled=True, target=request.param)
    with desk(SCENE, Preferences(snap=snap)) as made:
        made.editor.select(Selection(("red cube",)))
        made.frames(2)
        yield made


def on_screen(user: Desk, place: tuple[float, float, float]) -> tuple[float, float]:
    seen, _ = SCENE.camera.project(np.array([place]), 1.5)
    return user.at_picture(float(seen[0, 0]), float(seen[0, 1]))


@pytest.mark.parametrize("user", ["surface"], indirect=True)
def test_what_is_moved_stands_on_the_surface_under_the_mouse(user: Desk) -> None:
    user.move(*on_screen(user, (0, 0.5, 0)))
    user.key("G")
    for place in ((0.9, 0.0, 1.5), (-2.0, 0.0, -1.0)):
        user.move(*on_screen(user, place))
        assert user.scene.object("red cube").position == pytest.approx((place[0], 0.5, place[2]), abs=0.02)
    user.move(*on_screen(user, (-1.1, 0.8, 0.0)))
    top = extent(SCENE.object("grey drum"))[1, 1]
    assert extent(user.scene.object("red cube"))[0, 1] == pytest.approx(top, abs=0.02), "on the drum"
    user.key("X")
    assert user.scene.object("red cube").position[1:] == (0.5, 0.0), "held along an axis"
    assert user.scene.object("red cube").position[0] == pytest.approx(-1.1, abs=0.05)
    user.key("Enter")
    assert user.undo_count == 1


@pytest.mark.parametrize("user", ["vertex"], indirect=True)
def test_a_corner_comes_to_another_corner(user: Desk) -> None:
    corner = (-4.0, 0.0, -4.0)
    user.move(*on_screen(user, (-0.5, 1.0, 0.5)))
    user.key("G")
    x, y = on_screen(user, corner)
    user.move(x + 3, y - 2)
    moved = np.array(user.scene.object("red cube").position) - (0, 0.5, 0)
    np.testing.assert_allclose(np.add((-0.5, 1.0, 0.5), moved), corner, atol=1e-6)
    with user.held_keys("Ctrl"):
        user.move(x + 4, y - 2)
        free = np.array(user.scene.object("red cube").position)
        assert np.abs(free - moved - (0, 0.5, 0)).max() > 0.1, "Ctrl turns snapping off"
    user.write("1")
    assert user.scene.object("red cube").position == (1.0, 0.5, 0.0), "numbers count"
    user.key("Escape")
    assert user.scene == SCENE


@pytest.mark.parametrize("user", ["surface", "vertex"], indirect=True)
def test_where_there_is_nothing_it_moves_freely(user: Desk) -> None:
    user.move(*on_screen(user, (0, 0.5, 0)))
    user.key("G")
    before = user.scene
    user.move(*user.at_picture(0.5, 0.01))
    assert user.scene != before
    x, y, _ = user.scene.object("red cube").position
    assert y > 1.0 and abs(x) < 0.1 and round(y, 1) != y


def test_lights_have_a_base_too_and_moved_objects_are_no_target() -> None:
    picture = Rect(0.0, 0.0, 150.0, 100.0)
    place = snapping.base(SCENE, ("spot",), picture, (0.0, 0.0), "vertex", np.array([1.0, 2.0, 3.0]))
    assert tuple(place) == (1.0, 2.0, 3.0)
    low = snapping.base(SCENE, ("spot",), picture, (0.0, 0.0), "surface", np.zeros(3))
    assert low[1] == pytest.approx(1.9)
    middle = (75.0, 50.0)
    with_cube = snapping.target(SCENE, ("floor",), picture, middle, "surface")
    without = snapping.target(SCENE, ("red cube",), picture, middle, "surface")
    assert with_cube is not None and without is not None and with_cube[2] > without[2] + 0.3


def test_vertices_behind_the_camera_are_no_target() -> None:
    behind = Object("b", shape("cube"), "red", (0, 0, 9))
    scene = SCENE.with_camera(position=(0, 0, 5), target=(0, 0, 0))
    picture = Rect(0.0, 0.0, 90.0, 90.0)
    found = snapping._nearest_vertex(scene, [behind], picture, picture.middle, 1e9)
    assert found is None
