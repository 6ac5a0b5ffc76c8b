"""The list of materials."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from imgui_bundle import imgui
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.scene.edits import material_users
from incpt.scene.selection import Selection
from incpt.ui.dialogs.replacement import ReplacementDialog
from incpt.ui.editor.editor import Editor
from incpt.ui.rect import Rect
from incpt.viewer.renderer import Pick

SCENE = mixed_scene(size=(48, 32)).with_material("spare", roughness=0.25).with_material("old", roughness=0.5)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        made.panel("Materials")
        yield made


def test_a_row_shows_its_parameters_and_follows_what_is_selected(user: Desk) -> None:
    user.click("material spare")
    user.type("Roughness", "0.75")
    assert user.scene == SCENE.with_material("spare", roughness=0.75) and user.undo_count == 1
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    user.type("Roughness", "0.125")
    assert user.scene.materials["red"].roughness == 0.125
    user.click("material old")
    user.frames(3)
    user.type("Roughness", "0.25")
    assert user.scene.materials["old"].roughness == 0.25, "what is clicked stays chosen"


def test_the_search_leaves_what_fits(user: Desk) -> None:
    user.click("Search materials")
    user.write("SPA")
    assert user.shows("material spare") and not user.shows("material red")


def test_a_material_is_deleted_where_nobody_has_it(user: Desk) -> None:
    user.click("material spare")
    user.click("Delete##materials")
    assert user.editor.dialog is None and "spare" not in user.scene.materials and user.undo_count == 1


def test_its_objects_get_another_one_where_it_is_deleted(user: Desk) -> None:
    user.click("material red")
    count = material_users(SCENE)["red"]
    user.click("Delete##materials")
    user.frames(2)
    assert isinstance(user.editor.dialog, ReplacementDialog) and user.editor.dialog.users == count
    user.click("Cancel")
    assert user.scene == SCENE
    user.click("Delete##materials")
    user.frames(2)
    user.choose("Replacement", "spare")
    user.click("Delete")
    assert "red" not in user.scene.materials and material_users(user.scene)["spare"] == count
    assert user.undo_count == 1


def test_unused_ones_are_purged(user: Desk) -> None:
    user.click("Purge 2 unused###purge")
    assert set(SCENE.materials) - set(user.scene.materials) == {"spare", "old"} and user.undo_count == 1
    assert "2 unused materials are deleted" in user.texts()[-1]
    user.run("Delete unused materials")
    assert user.undo_count == 1


def test_it_is_assigned_copied_renamed_and_its_users_are_selected(user: Desk) -> None:
    user.editor.select(Selection(("red cube", "floor")))
    user.frames(2)
    user.click("material spare")
    user.click("Assign##materials")
    assert {user.scene.object(name).material for name in ("red cube", "floor")} == {"spare"}
    user.editor.select(Selection(("lamp",)))
    user.frames(2)
    user.click("material spare")
    user.click("Select users##materials")
    assert set(user.editor.selection.names) == {"red cube", "floor"}
    user.click("Duplicate##materials")
    assert "spare.001" in user.scene.materials and user.scene.object("floor").material == "spare"
    user.click("Rename…##materials")
    user.frames(2)
    user.write("paint")
    user.key("Enter")
    assert user.scene.object("floor").material == "paint"


def test_it_is_dragged_onto_what_is_seen(user: Desk) -> None:
    user.editor.select(Selection(("floor",)))
    user.frames(2)
    drop(user, user.at_picture(0.3, 0.4))
    (request,) = user.null.requests
    assert isinstance(request, Pick) and request.point == pytest.approx((0.3, 0.4), abs=0.01)
    assert "No object is there" in user.texts()[-1] and user.undo_count == 0
    user.null.picks[request.point] = "red cube"
    drop(user, user.at_picture(0.3, 0.4))
    assert user.scene.object("red cube").material == "spare" and user.undo_count == 1
    assert user.editor.selection.names == ("floor",), "what is dropped selects nothing"


def test_it_is_dragged_onto_a_row_of_the_outliner(user: Desk) -> None:
    drop(user, user.place("object red cube"))
    assert user.scene.object("red cube").material == "spare" and user.undo_count == 1
    assert not user.null.requests


def test_what_lies_over_the_picture_takes_no_material(user: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    below = user.picture.middle
    monkeypatch.setattr(user.workspace, "draw", drawn_over(user, below))
    drop(user, below)
    assert not user.null.requests and user.scene is SCENE


def drawn_over(user: Desk, at: tuple[float, float]) -> Callable[[Editor], Rect[float]]:
    """The panels, and a window of its own around a place of the picture, as one that was moved there."""
    draw = user.workspace.draw

    def with_window(editor: Editor) -> Rect[float]:
        area = draw(editor)
        imgui.set_next_window_pos((at[0] - 50, at[1] - 50))
        imgui.set_next_window_size((100, 100))
        imgui.begin("moved")
        imgui.end()
        return area

    return with_window


def drop(user: Desk, end: tuple[float, float]) -> None:
    """Drag the row of the material "spare" to a place."""
    start = user.place("material spare")
    user.drag_at(start, (end[0] - start[0], end[1] - start[1]), steps=6)
    user.frames(2)
