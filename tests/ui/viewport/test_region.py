"""A region of the picture: it alone is rendered, by a camera that sees nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk, frame_of, places, tell

from incpt.scene.selection import Selection
from incpt.ui.editor.viewing import region_of
from incpt.ui.panels.notices import status_text
from incpt.ui.rect import Rect
from incpt.viewer.renderer import Pick, PickBox

SIZE = (96, 64)
SCENE = mixed_scene(size=SIZE)
REGION = Rect(0.25, 0.25, 0.5, 0.25)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def draw(user: Desk, low: tuple[float, float], high: tuple[float, float]) -> None:
    user.key("Ctrl+B")
    start, end = user.at_picture(*low), user.at_picture(*high)
    assert "this part" in user.editor.gesture.hint
    user.drag_at(start, (end[0] - start[0], end[1] - start[1]))


def test_a_box_is_rendered_alone_until_escape(user: Desk) -> None:
    before = user.null.views[-1]
    draw(user, (0.26, 0.251), (0.749, 0.495))
    assert user.editor.region == REGION, "on whole pixels"
    view = user.null.views[-1]
    assert view.size == (48, 16) and view.region == (0.25, 0.25, 0.5, 0.25)
    assert view.scene.objects is SCENE.objects and user.scene is SCENE and user.undo_count == 0
    at = np.array([[0.5, 0.375], [0.25, 0.25]])
    there = np.array([[0.5, 0.5], [0.0, 0.0]])
    np.testing.assert_allclose(
        view.scene.camera.rays(there, 3.0)[1], SCENE.camera.rays(at, 1.5)[1], atol=1e-12
    )
    user.frames(3)
    assert user.null.views[-1] is view or user.null.views[-1].scene is view.scene, "it is no edit each frame"
    user.key("Escape")
    assert user.editor.region is None and user.null.views[-1] == before
    assert not user.shows("region")


def test_clicks_and_boxes_are_those_of_the_region(user: Desk) -> None:
    user.editor.show_region(REGION)
    user.frames(2)
    user.null.requests.clear()
    user.click_at(*user.at_picture(0.5, 0.375))
    (pick,) = user.null.requests
    assert isinstance(pick, Pick) and pick.point == pytest.approx((0.5, 0.5), abs=0.01)
    user.editor.select(Selection(("lamp",)))
    user.click_at(*user.at_picture(0.1, 0.9))
    assert user.null.requests == [pick] and user.editor.selection.names == ("lamp",)
    user.run("Box select")
    start, end = user.at_picture(0.25, 0.25), user.at_picture(1.0, 1.0)
    user.drag_at(start, (end[0] - start[0] - 1, end[1] - start[1] - 1))
    box = user.null.requests[-1]
    assert isinstance(box, PickBox)
    assert box.low == pytest.approx((0.0, 0.0), abs=0.02) and box.high == pytest.approx((1.5, 3.0), abs=0.02)


def test_edits_and_moves_of_the_view_keep_it(user: Desk) -> None:
    user.editor.show_region(REGION)
    user.editor.select(Selection(("red cube",)))
    user.run("Move")
    user.write("1")
    user.frame()
    view = user.null.views[-1]
    assert view.before is not None and view.before.camera == view.scene.camera != SCENE.camera
    user.key("Enter")
    user.editor.look(replace(SCENE.camera, fov_y=20), "Zoom")
    user.frames(2)
    assert user.null.views[-1].size == (48, 16) and user.null.views[-1].scene.camera != view.scene.camera
    user.run("Split view")
    assert user.null.views[-1].region is None and user.null.views[-1].size == SIZE
    user.run("Split view")
    user.run("Clear region")
    assert user.null.views[-1].region is None


def test_the_status_says_so(user: Desk) -> None:
    user.editor.show_region(REGION)
    user.frames(2)
    tell(user, frame_of(user.null.views[-1]))
    rect = places.find("region")
    assert rect is not None and rect.width == pytest.approx(user.picture.width / 2)
    assert status_text(user.editor.frame, False, Selection()).startswith("Region of 48 × 16 pixels")


def test_one_that_is_too_small_is_refused(user: Desk) -> None:
    draw(user, (0.5, 0.5), (0.55, 0.9))
    assert user.editor.region is None and "too small" in user.texts()[-1]
    assert region_of(Rect(0.5, 0.5, 0.01, 0.9), (4096, 64)) is None, "no shift of the camera reaches it"
    assert region_of(Rect(-1.0, -1.0, 3.0, 3.0), SIZE) == Rect(0.0, 0.0, 1.0, 1.0)
