"""Lights in the editor: their panel, the outliner, the menu that adds them, their marks in the picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, places, state

from incpt.picture.color import linear_from_srgb
from incpt.scene.edits import LIGHT_NAMES
from incpt.scene.light import KINDS, STRENGTHS, Light, keys_of
from incpt.scene.selection import Selection
from incpt.ui.rect import Rect
from incpt.ui.viewport import light_marks

LIGHTS = tuple(
    Light(kind, kind, (0.4 * i - 1, 1, 0), color=(1, 0.5, 0.5), radius=0.2) for i, kind in enumerate(KINDS)
)
SCENE = replace(mixed_scene(size=(48, 32)), lights=LIGHTS)
FIELDS = {
    "radius": "Radius", "size": "Width of light", "angle": "Diameter", "spot_angle": "Cone",
    "spot_blend": "Blend", "color": "Light colour", "power": "Power", "irradiance": "Irradiance",
}  # fmt: skip
BOXES = {"double_sided": "Both sides", "camera_visible": "Seen by camera", "casts_shadows": "Casts shadows"}


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def turn_to(user: Desk, name: str) -> None:
    user.panel("Object")
    user.editor.select(Selection((name,)))
    user.frames(2)


def test_every_value_has_a_field() -> None:
    for kind in KINDS:
        shown = {*FIELDS, *BOXES, "visible", "radiance"}
        assert set(keys_of(kind)) <= shown


CASES = [
    (kind, key)
    for kind in KINDS
    for key in keys_of(kind)
    if key in FIELDS
    and not (key == "power" and kind == "sun")
    and not (key == "irradiance" and kind != "sun")
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "key"), CASES)
def test_a_number_is_typed(user: Desk, kind: str, key: str) -> None:
    turn_to(user, kind)
    before, scene = state(user.editor), user.scene
    user.type(FIELDS[key], "0.25", across=0.12 if key == "color" else 0.5)
    part = {"size": ".0", "color": ".0"}.get(key, "")
    place = f"scene.lights.{kind}.{key}{part}"
    assert changes(before, state(user.editor)) == {place}
    expected = float(linear_from_srgb(0.25)) if key == "color" else 0.25
    assert state(user.editor)[place] == pytest.approx(expected) and user.undo_count == 1
    user.key("Ctrl+Z")
    assert user.scene == scene
    user.type(FIELDS[key], "-5", across=0.12 if key == "color" else 0.5)
    assert changes(before, state(user.editor)) == {"notices"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "key"), [(kind, key) for kind in KINDS for key in keys_of(kind) if key in BOXES]
)
def test_a_box_is_checked(user: Desk, kind: str, key: str) -> None:
    turn_to(user, kind)
    before = state(user.editor)
    user.click(BOXES[key])
    assert changes(before, state(user.editor)) == {f"scene.lights.{kind}.{key}"}


@pytest.mark.parametrize("kind", KINDS)
def test_fields_are_those_of_the_kind(user: Desk, kind: str) -> None:
    turn_to(user, kind)
    for key, label in {**FIELDS, **BOXES}.items():
        has = key in keys_of(kind) and (key not in STRENGTHS or key == user.scene.light(kind).strength[0])
        assert user.shows(label) == has
    assert not user.shows("Base colour") and user.shows("Position X")


def test_another_unit_and_another_kind(user: Desk) -> None:
    turn_to(user, "rectangle")
    before = user.scene.light("rectangle")
    user.choose("Unit", "Radiance")
    after = user.scene.light("rectangle")
    assert after.strength[0] == "radiance" and after.emitted == pytest.approx(before.emitted)
    user.choose("Unit", "Power")
    assert user.scene.light("rectangle").watts == pytest.approx(before.watts)
    user.choose("Kind", "Sun")
    assert user.scene.light("rectangle").is_far and user.scene.light("rectangle").irradiance == 3.0
    user.choose("Unit", "Radiance")
    assert user.scene.light("rectangle").watts == pytest.approx((3.0, 1.5, 1.5))
    assert user.undo_count == 4


def test_the_transform_moves_a_light(user: Desk) -> None:
    turn_to(user, "spot")
    before = state(user.editor)
    user.type("Position Y", "2.5")
    assert changes(before, state(user.editor)) == {"scene.lights.spot.position.1"}


def test_the_outliner_lists_lights(user: Desk) -> None:
    user.click("object disk")
    assert user.editor.selection.names == ("disk",)
    user.click("visible disk")
    assert not user.scene.light("disk").visible and user.undo_count == 1
    user.open_field("object disk")
    user.key("Ctrl+A")
    user.write("panel")
    user.key("Enter")
    assert user.scene.light("panel") and user.editor.selection.names == ("panel",)
    user.open_field("object panel")
    user.key("Ctrl+A")
    user.write("red cube")
    user.key("Enter")
    assert user.scene.light("panel") and "is taken" in user.texts()[-1]


def test_lights_are_added_copied_and_deleted(user: Desk) -> None:
    for kind, name in LIGHT_NAMES.items():
        user.run(name.capitalize())
        (new,) = user.editor.selection.names
        assert user.scene.light(new).kind == kind
    user.run("Duplicate")
    assert user.editor.selection.names == ("sphere light.001",)
    user.run("Delete")
    assert "sphere light.001" not in user.scene.light_index
    user.editor.select(Selection(("red cube", "point")))
    user.run("Hide")
    assert not user.scene.light("point").visible and not user.scene.object("red cube").visible
    user.run("Show all")
    assert user.scene.light("point").visible
    user.run("Clear all three")
    assert user.scene.light("point").position == (0, 0, 0)
    user.run("Select all")
    assert set(user.editor.selection.names) == user.scene.names
    user.run("Delete")
    assert not user.scene.names


def test_a_material_of_lights_and_objects_is_the_objects(user: Desk) -> None:
    user.editor.select(Selection(("point", "red cube")))
    user.frames(2)
    user.choose("Material", "grey")
    assert user.scene.object("red cube").material == "grey" and not user.texts()


def test_icons_pick_lights(user: Desk) -> None:
    for name in ("spot", "sphere"):
        rect = places.find(f"light {name}")
        assert rect is not None
        user.move(rect.left + 3, rect.top - 3)
        user.press()
        user.release()
        assert user.editor.selection.names == (name,) and not user.null.requests
    user.frames(2)  # now its lines are drawn
    user.run("Outline")
    assert not user.shows("light sphere")


def test_a_handle_moves_a_light(user: Desk) -> None:
    turn_to(user, "spot")
    before = state(user.editor)
    user.hold_at(user.place("gizmo"), (40.0, 0.0))
    user.release()
    user.frame()
    moved = changes(before, state(user.editor))
    assert moved and all(place.startswith("scene.lights.spot.position") for place in moved)
    assert user.undo_count == 1


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.kind)
def test_lines_show_the_shape(light: Light) -> None:
    lines = light_marks.shape_lines(light)
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    assert (low <= light.world_bounds[0] + 1e-2).all() and (high >= light.world_bounds[1] - 1e-2).all()
    behind = replace(SCENE.camera, position=(0, 1, -5), target=(0, 1, -9))
    assert light_marks.place(behind, light, Rect(0.0, 0.0, 9.0, 9.0)) is None
    assert light_marks.on_screen(behind, points, Rect(0.0, 0.0, 9.0, 9.0)) is None
