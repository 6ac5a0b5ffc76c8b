"""Several objects selected: fields say where values differ, and change all of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, places

from incpt.scene.edits import LIGHT_NAMES, add_light
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.widgets import mixed

NAMES = ("red cube", "glass ball", "floor")


def lit() -> Scene:
    scene = mixed_scene(size=(48, 32))
    for kind in ("point", "rectangle"):
        scene = add_light(scene, kind)[0]
    return scene.with_light(LIGHT_NAMES["point"], power=10.0)


SCENE = lit()


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.editor.select(Selection(NAMES))
        made.frames(2)
        made.click("Uniform scale")
        yield made


def positions(user: Desk, axis: int) -> list[float]:
    return [user.scene.object(name).position[axis] for name in NAMES]


def test_what_is_typed_holds_for_all(user: Desk) -> None:
    user.type("Position Y", "0.75")
    assert positions(user, 1) == [0.75] * 3 and user.undo_count == 1
    assert changes(flat(SCENE), flat(user.scene)) == {f"objects.{name}.position.1" for name in NAMES}
    user.key("Ctrl+Z")
    assert user.scene == SCENE


def test_what_is_typed_holds_for_all_where_the_active_one_has_it(user: Desk) -> None:
    active = SCENE.object("floor").position[1]
    user.type("Position Y", f"{active}")
    assert positions(user, 1) == [active] * 3 and user.undo_count == 1


def test_a_drag_moves_all_as_far(user: Desk) -> None:
    before = positions(user, 1)
    assert len(set(before)) > 1
    user.drag("Position Y", 40.0)
    moved = [after - old for after, old in zip(positions(user, 1), before, strict=True)]
    assert moved[0] > 0.1 and moved == pytest.approx([moved[0]] * 3, abs=1e-6) and user.undo_count == 1
    scales = [SCENE.object(name).scale[0] for name in NAMES]
    user.drag("Scale X", 40.0)
    factors = [user.scene.object(n).scale[0] / old for n, old in zip(NAMES, scales, strict=True)]
    assert factors[0] > 1.001 and factors == pytest.approx([factors[0]] * 3, rel=1e-6)


def test_a_material_is_assigned_to_all_also_that_of_the_active_one(user: Desk) -> None:
    active = SCENE.object("floor").material
    user.choose("Material", active)
    assert {user.scene.object(name).material for name in NAMES} == {active} and user.undo_count == 1


def test_a_parameter_is_changed_in_all_their_materials(user: Desk) -> None:
    user.type("Roughness", "0.125")
    used = {SCENE.object(name).material for name in NAMES}
    assert changes(flat(SCENE), flat(user.scene)) <= {f"materials.{name}.roughness" for name in used}
    assert {user.scene.materials[name].roughness for name in used} == {0.125} and user.undo_count == 1


def test_lights_are_changed_together(user: Desk) -> None:
    lamps = (LIGHT_NAMES["point"], LIGHT_NAMES["rectangle"])
    user.editor.select(Selection(("red cube", *lamps)))
    user.frames(2)
    user.type("Power", "42")
    assert [user.scene.light(name).power for name in lamps] == [42.0, 42.0] and user.undo_count == 1
    user.click("Seen by camera")
    assert len({user.scene.light(name).camera_visible for name in lamps}) == 1
    user.type("Width of light", "3")
    assert user.scene.light(lamps[1]).size[0] == 3 and user.scene.light(lamps[0]).kind == "point"
    assert user.texts() == []


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("red cube",), set()),
        (("red cube", "glass ball"), {"Position X", "Material", "Roughness", "Base colour"}),
    ],
)
def test_fields_say_where_values_differ(
    user: Desk, names: tuple[str, ...], expected: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: set[str] = set()
    is_in = mixed.is_in

    def noted(label: str) -> bool:
        found = is_in(label)
        seen.update({label} if found else ())
        return found

    monkeypatch.setattr(mixed, "is_in", noted)
    user.editor.select(Selection(names))
    user.frames(2)
    assert seen >= expected and bool(seen) == bool(expected)
    assert "Uniform scale" not in seen and places.find("Position X") is not None


@pytest.mark.parametrize(("text", "end"), [("9", "Escape"), ("", "Enter"), ("", "Tab"), ("", "Escape")])
def test_a_field_that_is_left_as_it_was_changes_nothing(user: Desk, text: str, end: str) -> None:
    user.open_field("Position Y")
    user.write(text)
    user.key(end)
    user.key("Escape")
    assert user.scene == SCENE and user.undo_count == 0


def test_buttons_put_all_back(user: Desk) -> None:
    user.editor.select(Selection(("floor", "red cube")))
    user.frames(2)
    user.click("Rotation")
    assert user.scene.object("red cube").rotation == user.scene.object("floor").rotation == (0.0, 0.0, 0.0)
