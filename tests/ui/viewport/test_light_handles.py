"""Handles of lights: what each changes, one edit for each drag, and lights that are aimed by a click."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, places, tell

from incpt.scene import placing
from incpt.scene.camera import Camera
from incpt.scene.light import DIRECTED, KINDS, Light
from incpt.scene.selection import Selection
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import light_handles, light_marks
from incpt.ui.viewport.light_handles import handles
from incpt.viewer.renderer import PickedPlace, PickPlace

LIGHTS = tuple(
    Light(kind, kind, (0.3, 0.6, 0.2), (-70, 25, 10), radius=0.4, size=(1.2, 0.8), power=None)
    for kind in KINDS
)
SCENE = replace(mixed_scene(size=(48, 32)), lights=LIGHTS, objects=())


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def at(user: Desk, handle: str) -> Point:
    rect = places.find(f"light handle {handle}")
    assert rect is not None, sorted(places.names())
    return rect.left, rect.top


def drag(user: Desk, light: str, handle: str, share: float = 1.3) -> Light:
    """Drag a handle away from the middle of its light, to `share` of the way on the screen."""
    user.editor.select(Selection((light,)))
    user.frames(2)
    start = at(user, handle)
    middle = light_marks.place(SCENE.camera, SCENE.light(light), user.picture)
    assert middle is not None
    user.drag_at(start, ((share - 1) * (start[0] - middle[0]), (share - 1) * (start[1] - middle[1])))
    return user.scene.light(light)


CASES = [
    ("rectangle", "width", "size.0"), ("rectangle", "height", "size.1"), ("rectangle", "width 2", "size.0"),
    ("disk", "radius 0", "radius"), ("disk", "radius 3", "radius"), ("sphere", "radius", "radius"),
    ("point", "radius", "radius"), ("spot", "radius", "radius"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "handle", "place"), CASES)
def test_a_size_follows_the_mouse(user: Desk, kind: str, handle: str, place: str) -> None:
    light = drag(user, kind, handle)
    changed = changes(flat(SCENE), flat(user.scene))
    assert changed == {f"lights.{kind}.{place}"} and user.undo_count == 1
    old, new = flat(SCENE), flat(user.scene)
    assert new[changed.pop()] > 1.1 * old[f"lights.{kind}.{place}"]
    # The handle is where the mouse let go.
    (now,) = [one for one in handles(light, SCENE.camera) if one.name == handle]
    shown = light_marks.on_screen(SCENE.camera, now.place[None], user.picture)
    assert shown is not None
    user.frames(2)
    assert at(user, handle) == pytest.approx(tuple(shown[0]), abs=0.5)
    user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_a_cone_gets_wider_and_softer(user: Desk) -> None:
    user.editor.select(Selection(("spot",)))
    user.frames(2)
    x, y = at(user, "cone")
    (handle,) = [one for one in handles(SCENE.light("spot"), SCENE.camera) if one.name == "cone"]
    further = light_marks.on_screen(SCENE.camera, (handle.place + 0.2 * handle.axis)[None], user.picture)
    assert further is not None
    user.drag_at((x, y), (further[0, 0] - x, further[0, 1] - y))
    assert changes(flat(SCENE), flat(user.scene)) == {"lights.spot.spot_angle"}
    length = light_marks.shown_length(SCENE.light("spot"))
    expected = 2 * np.degrees(np.arctan(np.tan(np.radians(30)) + 0.2 / length))
    assert user.scene.light("spot").spot_angle == pytest.approx(expected, abs=0.5)
    wide = replace(SCENE.light("spot"), spot_angle=60.0)
    for name, way, values in (
        ("cone", 1e6, {"spot_angle": 179.0}), ("cone", -1e6, {"spot_angle": 0.1}),
        ("blend", 1e6, {"spot_blend": 0.0}), ("blend", -1e6, {"spot_blend": 1.0}),
    ):  # fmt: skip
        (handle,) = [one for one in handles(wide, SCENE.camera) if one.name == name]
        assert handle.moved(way) == replace(wide, **values)


@pytest.mark.parametrize("kind", DIRECTED)
def test_a_light_is_turned_by_the_end_of_its_line(user: Desk, kind: str) -> None:
    user.editor.select(Selection((kind,)))
    user.frames(2)
    start = at(user, "aim")
    user.drag_at(start, (40.0, -30.0))
    light = user.scene.light(kind)
    assert {p.split(".")[2] for p in changes(flat(SCENE), flat(user.scene))} == {"rotation"}
    assert user.undo_count == 1 and light.scale == SCENE.light(kind).scale
    end = np.asarray(light.position) - 0.5 * light.axes[2]
    shown = light_marks.on_screen(SCENE.camera, np.array([light.position, end]), user.picture)
    assert shown is not None
    way, wanted = shown[1] - shown[0], np.add(start, (40, -30)) - shown[0]
    assert way @ wanted == pytest.approx(np.linalg.norm(way) * np.linalg.norm(wanted), rel=1e-3)


@pytest.mark.parametrize("keys", ["Escape", "Ctrl+Z"])
def test_a_drag_is_given_up(user: Desk, keys: str) -> None:
    user.editor.select(Selection(("rectangle",)))
    user.frames(2)
    x, y = at(user, "width")
    user.hold_at((x, y), (50.0, 0.0))
    assert user.scene != SCENE and user.editor.gesture.is_held
    user.key(keys)
    assert user.scene == SCENE
    user.move(x + 90, y)
    user.release()
    user.frames(2)
    assert user.scene == SCENE and user.editor.selection.names == ("rectangle",)


def test_it_takes_the_mouse_before_the_gizmo_and_what_lies_below(user: Desk) -> None:
    """A click on one selects nothing, and in the plain set a drag moves no camera."""
    user.editor.choose_navigation("plain")
    user.editor.select(Selection(("spot",)))
    user.frames(2)
    user.null.requests.clear()
    user.click_at(*at(user, "cone"))
    assert not user.null.requests and user.editor.selection.names == ("spot",) and user.scene == SCENE
    drag(user, "spot", "cone")
    assert not user.editor.viewing.is_free and user.undo_count == 1


def test_sizes_have_an_end_and_hidden_marks_have_no_handles(user: Desk) -> None:
    for kind in KINDS:
        for handle in handles(SCENE.light(kind), SCENE.camera):
            if handle.axis is not None:
                assert handle.moved(-1e9).has_size or kind == "spot"
    user.editor.select(Selection(("disk",)))
    user.frames(2)
    assert user.shows("light handle radius 0")
    user.run("Outline")
    assert not user.shows("light handle radius 0")
    assert handles(Light("p", "point", radius=0.0), Camera()) == []


def test_each_handle_is_seen_once_and_has_a_word() -> None:
    for light in LIGHTS:
        found = handles(light, SCENE.camera)
        names = [one.name for one in found]
        assert len(set(names)) == len(names) and ("aim" in names) == (light.kind in DIRECTED)
        assert all(one.told(light) for one in found)
    assert light_handles._seen(found, Camera((0, 0, -5), (0, 0, -9)), Rect(0, 0, 9, 9)) == []


# ----------------------------------------------------------------------------------------- aimed by a click


def test_a_light_shines_at_what_is_clicked(user: Desk) -> None:
    user.editor.select(Selection(("sun", "point", "spot")))
    user.key("Shift+T")
    assert "shine at" in user.editor.gesture.hint
    user.click_at(*user.at_picture(0.25, 0.5))
    request = user.null.requests[-1]
    assert isinstance(request, PickPlace) and request.point == pytest.approx((0.25, 0.5), abs=0.01)
    tell(user, PickedPlace((1.0, -2.0, 0.5)))
    assert user.undo_count == 1 and user.scene.light("point") == SCENE.light("point")
    for name in ("sun", "spot"):
        light = user.scene.light(name)
        way = np.subtract((1.0, -2.0, 0.5), light.position)
        np.testing.assert_allclose(-light.axes[2], way / np.linalg.norm(way), atol=1e-9)
    user.key("Shift+T")
    user.click_at(*user.at_picture(0.25, 0.5))
    tell(user, PickedPlace(None))
    assert user.undo_count == 1 and "Nothing is there" in user.texts()[-1]
    user.key("Shift+T")
    user.key("Escape")
    assert not user.editor.gesture.hint


def test_the_least_turn_is_taken_also_where_it_is_turned_round() -> None:
    light = Light("l", "spot", (1, 2, 3), (-90, 0, 0))
    assert placing.aimed(light, (1, -5, 3)) == light and placing.aimed(light, light.position) == light
    up = placing.aimed(light, (1, 9, 3))
    np.testing.assert_allclose(up.axes[2], (0, -1, 0), atol=1e-9)
    plain = Light("l", "spot", (0, 0, 0))
    assert placing.aimed(plain, (0, 0, -3)) == plain
    np.testing.assert_allclose(placing.aimed(plain, (0, 0, 5)).axes[2], (0, 0, -1), atol=1e-9)
    side = placing.aimed(light, (9, 2, 3))
    np.testing.assert_allclose(side.axes[2], (-1, 0, 0), atol=1e-9)
    assert side.position == light.position and side.scale == light.scale
