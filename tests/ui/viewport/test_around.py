"""What stands around the objects in the picture, and what is left out of it: axes, grid, local view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, places, state

from incpt.scene.camera import Camera
from incpt.scene.selection import Selection
from incpt.ui.viewport import floor_grid
from incpt.ui.viewport.axis_widget import SIDES

SCENE = mixed_scene(size=(48, 32))
SHOWN = {one.name for one in SCENE.objects}


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


@pytest.mark.parametrize("side", [side for pair in SIDES for side in pair])
def test_a_click_on_an_axis_looks_along_it(user: Desk, side: str) -> None:
    user.editor.look(Camera((3, 2, 4), (0, 0.5, 0)), "Orbit")
    user.frames(2)
    rect = places.find(f"axis {side}")
    assert rect is not None
    user.null.requests.clear()
    user.click_at(rect.left, rect.top, 1)
    back = np.subtract(user.editor.shown.camera.position, user.editor.shown.camera.target)
    axis = next(i for i, pair in enumerate(SIDES) if side in pair)
    assert abs(back[axis]) == pytest.approx(np.linalg.norm(back), rel=1e-5)
    assert (back[axis] > 0) == (side == SIDES[axis][0])
    assert user.scene is SCENE and not user.null.requests, "nothing is picked behind it"


def test_the_axes_are_as_the_camera_sees_them(user: Desk) -> None:
    middle = np.mean([places.find(f"axis {side}").middle for pair in SIDES for side in pair], axis=0)  # type: ignore[union-attr]
    right, up, _ = SCENE.camera.image_plane(1.0)
    for axis, (side, _) in enumerate(SIDES):
        way = np.subtract(places.find(f"axis {side}").middle, middle)  # type: ignore[union-attr]
        expected = np.array([right[axis] / np.linalg.norm(right), -up[axis] / np.linalg.norm(up)])
        length = np.linalg.norm(expected)
        if length > 0.1:
            np.testing.assert_allclose(way / np.linalg.norm(way), expected / length, atol=1e-3)
    user.run("Axes")
    assert not user.shows("axis top")


def test_switching_them_changes_the_preferences_alone(user: Desk) -> None:
    before = state(user.editor)
    user.run("Floor grid")
    user.frames(2)
    assert changes(before, state(user.editor)) == {"preferences.display.floor_grid"}


@pytest.mark.parametrize(("way", "metres"), [(5.0, 1.0), (50.0, 10.0), (0.05, 0.01), (2000.0, 100.0)])
def test_the_grid_fits_what_is_looked_at(way: float, metres: float) -> None:
    assert floor_grid.spacing(Camera((0, 0, way), (0, 0, 0))) == pytest.approx(metres)


def test_lines_are_cut_before_the_camera() -> None:
    camera = Camera((0, 1, 0), (0, 1, -5))
    ahead = np.array([(0.0, 0.0, -1.0), (0.0, 0.0, -9.0)])
    assert floor_grid._before(camera, ahead) is ahead
    assert floor_grid._before(camera, -ahead) is None
    cut = floor_grid._before(camera, np.array([(0.0, 0.0, 4.0), (0.0, 0.0, -4.0)]))
    assert cut is not None and cut[:, 2].max() == pytest.approx(-0.005)


# ---------------------------------------------------------------------------------- what is left out of it


def seen(user: Desk) -> set[str]:
    return {one.name for one in user.null.views[-1].scene.objects if one.visible}


def test_a_local_view_shows_what_was_selected_and_what_shines(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.key("Slash")
    assert seen(user) == {"red cube", "lamp"} and user.scene is SCENE and user.undo_count == 0
    user.run("Cube")
    assert user.undo_count == 1 and all(one.visible for one in user.scene.objects), "edits hide nothing"
    user.editor.look(replace(SCENE.camera, fov_y=20), "Zoom")
    user.frames(2)
    assert seen(user) == {"red cube", "lamp"}
    user.key("Slash")
    assert seen(user) == SHOWN | {"cube"}
    user.editor.select(Selection())
    user.run("Local view")
    assert seen(user) == SHOWN | {"cube"}, "nothing is selected"


def test_all_but_the_selection_is_hidden_in_one_edit(user: Desk) -> None:
    user.editor.select(Selection(("red cube", "floor")))
    user.key("Shift+H")
    assert seen(user) == {"red cube", "floor"} and user.undo_count == 1
    user.key("Ctrl+Z")
    assert user.scene == SCENE
    user.editor.choose_navigation("plain")
    user.run("Hide")
    user.key("Shift+H")
    assert all(one.visible for one in user.scene.objects), "in the plain set it shows all"


def test_several_are_aligned_and_dropped(user: Desk) -> None:
    user.editor.select(Selection(("lamp", "glass ball")))
    user.run("Middle X")
    assert user.scene.object("lamp").position[0] == pytest.approx(1.1) and user.undo_count == 1
    user.key("End")
    assert user.undo_count == 2 and user.scene.object("lamp").position[1] == pytest.approx(0.0)
