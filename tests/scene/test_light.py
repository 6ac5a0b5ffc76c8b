"""Lights: every value is checked, and what they emit follows from what is told of them."""

from __future__ import annotations

import copy
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from incpt.core.errors import InputError
from incpt.scene.change import affected_objects, diff
from incpt.scene.light import KINDS, Light, changed, keys_of
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape


def of_kind(kind: str, **values: Any) -> Light:
    return Light("lamp", kind, **values)


SCENE = Scene(
    materials={"m": Material()},
    objects=(Object("cube", shape("cube"), "m"),),
    lights=(of_kind("point", power=10), Light("sun", "sun")),
)
WRONG = {
    "color": (-1, 0, 0), "power": -1, "radiance": float("nan"), "irradiance": "much", "radius": -1,
    "size": (1, 0), "angle": 200, "spot_angle": 0, "spot_blend": 2, "double_sided": 1, "visible": None,
    "camera_visible": "yes", "casts_shadows": 0.5, "kind": "lamp", "name": "", "transform": 3,
}  # fmt: skip


def test_every_value_is_checked() -> None:
    assert WRONG.keys() == {field.name for field in fields(Light)}
    for name, value in WRONG.items():
        given = {"name": "lamp", "kind": "sun" if name == "irradiance" else "rectangle", name: value}
        with pytest.raises(InputError, match=f"^{name}: "):
            Light(**given)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("sphere", {"radius": 0}, "radius: 0 is nothing; a sphere has one, a point may have 0"),
        ("disk", {"radius": 1e-9}, "radius: 1e-09 is nothing"),
        ("point", {"radius": 0, "radiance": 1}, "radiance: the light has no size; give its power"),
        ("sun", {"angle": 0, "radiance": 1}, "radiance: the light has no size; give its irradiance"),
        ("sun", {"power": 1}, "power: a sun has none; give its irradiance"),
        ("rectangle", {"irradiance": 1}, "irradiance: a rectangle has none; give its power"),
        ("spot", {"power": 1, "radiance": 2}, "radiance: stands beside power; give one of them"),
        ("rectangle", {"size": 1}, "size: 1 is not a list of two numbers, width and height"),
    ],
)
def test_what_does_not_fit_together(kind: str, values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}"):
        of_kind(kind, **values)


def test_strengths_follow_from_each_other() -> None:
    ball = of_kind("sphere", radius=0.5, power=60, color=(1, 0.5, 0))
    assert ball.emitted == pytest.approx((60 / (np.pi * np.pi), 30 / (np.pi * np.pi), 0))
    assert of_kind("point", radius=0, power=60).emitted[0] == pytest.approx(60 / (4 * np.pi))
    pane = of_kind("rectangle", size=(2, 3), scale=(0.5, -1, 9), radiance=2)
    assert pane.watts[0] == pytest.approx(2 * np.pi * 3)
    assert replace(pane, double_sided=True).watts[0] == pytest.approx(4 * np.pi * 3)
    assert of_kind("disk", radius=2, radiance=1).watts[0] == pytest.approx(np.pi * np.pi * 4)
    hemisphere = of_kind("spot", radius=0, power=10, spot_angle=180, spot_blend=0)
    assert hemisphere.emitted[0] == pytest.approx(10 / (2 * np.pi))
    sun = of_kind("sun", irradiance=5, angle=0.5)
    assert sun.emitted[0] == pytest.approx(5 / (np.pi * np.sin(np.radians(0.25)) ** 2))
    assert sun.watts[0] == pytest.approx(5) and of_kind("sun", angle=0, irradiance=5).emitted[0] == 5
    assert of_kind("point").strength == ("power", 100.0) and of_kind("sun").strength == ("irradiance", 3.0)
    assert changed(pane, {"power": 7}).strength == ("power", 7.0)


def test_bounds_hold_the_surface() -> None:
    pane = of_kind("rectangle", position=(1, 2, 3), rotation=(-90, 0, 0), size=(2, 4))
    np.testing.assert_allclose(pane.world_bounds, [[0, 2, 1], [2, 2, 5]], atol=1e-12)
    disk = of_kind("disk", rotation=(0, 0, 45), radius=1, scale=(2, 1, 1))
    np.testing.assert_allclose(disk.world_bounds[1], [np.sqrt(2.5), np.sqrt(2.5), 0], atol=1e-12)
    ball = of_kind("sphere", position=(1, 0, 0), radius=0.5, scale=(1, 1, 8))
    np.testing.assert_allclose(ball.world_bounds, [[0, -1, -1], [2, 1, 1]], atol=1e-12)
    np.testing.assert_allclose(of_kind("point", radius=0).world_bounds, 0)


def test_scenes_with_lights() -> None:
    assert SCENE.light("sun").is_far and SCENE.placed("lamp").position == (0, 0, 0)
    assert SCENE.placed("cube") is SCENE.object("cube") and SCENE.names == {"cube", "lamp", "sun"}
    moved = SCENE.with_light("lamp", position=(1, 2, 3), radiance=4)
    assert moved.light("lamp").strength == ("radiance", 4.0) and moved.light("lamp").power is None
    assert moved.light("sun") is SCENE.light("sun")
    sun = SCENE.with_light("lamp", kind="sun").light("lamp")
    assert sun.strength == ("irradiance", 3.0)
    assert SCENE.without_light("sun").lights == SCENE.lights[:1]
    assert SCENE.with_added_light(Light("new", "disk")).light_index["new"] == 2
    assert copy.deepcopy(moved).lights == moved.lights and copy.deepcopy(moved).light("lamp")
    for wrong, message in (
        (lambda: SCENE.light("cube"), "light 'cube' is not in the scene; it has lamp, sun"),
        (lambda: SCENE.with_light("lamp", radious=1), "radious: is no property of light"),
        (lambda: SCENE.with_added_light(Light("sun", "sun")), "lights: two are named 'sun'"),
        (lambda: SCENE.with_added_light(Light("cube", "sun")), "lights: 'cube' is the name of an object too"),
        (lambda: SCENE.with_object("cube", name="sun"), "lights: 'sun' is the name of an object too"),
        (lambda: replace(SCENE, lights=3), "lights: 3 is not a list of Lights"),
        (lambda: replace(SCENE, lights=(3,)), "lights: 3 is not a Light"),
    ):
        with pytest.raises(InputError, match=f"^{message}"):
            wrong()


def test_changes_of_lights() -> None:
    def difference(new: Scene) -> tuple[set[str], bool, int]:
        found = diff(SCENE, new)
        return set(found.lights), found.is_global, len(affected_objects(SCENE, new, found))

    assert difference(replace(SCENE)) == (set(), False, 0)
    assert difference(SCENE.with_light("lamp", power=11)) == ({"lamp"}, False, 2)
    assert diff(SCENE, SCENE.with_light("lamp", power=11)).is_local
    assert difference(SCENE.with_light("sun", irradiance=1)) == ({"sun"}, True, 2)
    assert difference(SCENE.with_light("lamp", kind="sun"))[1]
    assert difference(SCENE.without_light("lamp")) == ({"lamp"}, False, 1)
    assert difference(SCENE.with_added_light(Light("new", "disk"))) == ({"new"}, False, 1)
    assert difference(SCENE.with_light("lamp", visible=False)) == ({"lamp"}, False, 1)
    assert difference(SCENE.with_light("lamp", name="bulb")) == ({"lamp", "bulb"}, False, 0)
    assert difference(replace(SCENE, lights=SCENE.lights[::-1])) == (set(), False, 0)


def test_keys_of_every_kind() -> None:
    known = {field.name for field in fields(Light)}
    for kind in KINDS:
        assert set(keys_of(kind)) <= known
    assert "spot_angle" in keys_of("spot") and "size" not in keys_of("disk")
