"""The final render: what is asked for, what becomes of it, and how it is ended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk, tell

from incpt.picture import denoise
from incpt.render.final import FinalSettings
from incpt.ui.dialogs import native
from incpt.ui.dialogs.question import Question
from incpt.ui.dialogs.render_dialog import RenderDialog, proportional
from incpt.ui.editor.state import FinalChoice
from incpt.ui.panels.notices import final_text
from incpt.viewer.renderer import EndFinal, FinalProgress, Finals, Problem, RenderFinal

SCENE = mixed_scene(size=(48, 32)).with_camera("top", position=(0, 9, 0.1))


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(native, "is_there", lambda: False)
    monkeypatch.setattr(denoise, "is_available", lambda: False)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


def orders(user: Desk) -> list[RenderFinal]:
    return [one for one in user.null.requests if isinstance(one, RenderFinal)]


def opened(user: Desk) -> RenderDialog:
    user.key("F12")
    user.frames(3)
    dialog = user.editor.dialog
    assert isinstance(dialog, RenderDialog)
    return dialog


def test_a_picture_of_the_active_camera_is_rendered_as_was_asked(user: Desk, tmp_path: Path) -> None:
    dialog = opened(user)
    user.type("Width", "96")
    assert user.editor.dialog is dialog, "Enter ended the typing of a number"
    assert dialog.order.size == (96, 64)
    user.click("Keep proportions")
    user.type("Height", "40")
    user.type("Samples", "12")
    user.type("Time limit", "7")
    user.choose("Seen through", "top")
    user.choose("Format", "OpenEXR, linear")
    user.click("Passes")
    user.click("Render")
    assert user.editor.dialog is None
    (order,) = orders(user)
    assert order.wanted == FinalSettings(tmp_path / "test.exr", 12, 7.0, aovs=True)
    assert order.scene == replace(
        SCENE.with_active_camera("top"), settings=replace(SCENE.settings, size=(96, 40))
    )
    assert user.scene == SCENE and user.undo_count == 0
    assert opened(user).order.choice == FinalChoice(12, 7.0, ".exr", aovs=True), "it is remembered"


def test_a_free_view_is_what_is_rendered_unless_another_camera_is_chosen(user: Desk, tmp_path: Path) -> None:
    user.editor.look(replace(SCENE.camera, fov_y=20), "Zoom")
    opened(user)
    user.key("Enter")
    user.frames(2)
    (order,) = orders(user)
    assert order.scene.camera.fov_y == 20 and order.wanted == FinalSettings(tmp_path / "test.png")


def test_what_cannot_be_is_said_in_the_dialog_which_stays(user: Desk, tmp_path: Path) -> None:
    dialog = opened(user)
    for path, reason in (("missing/a.png", "no such folder"), ("a.gif", "no known format"), (" ", "empty")):
        user.type("File", path)
        user.click("Render")
        assert user.editor.dialog is dialog and reason in dialog._refusal
    user.click("Denoise")
    assert "Open Image Denoise" in dialog._refusal and not dialog.order.choice.denoise
    user.key("Escape")
    assert user.editor.dialog is None and not orders(user)


def test_a_file_that_is_there_is_not_replaced_without_a_question(user: Desk, tmp_path: Path) -> None:
    (tmp_path / "test.png").write_bytes(b"old")
    opened(user)
    user.click("Render")
    assert isinstance(user.editor.dialog, Question) and not orders(user)
    user.frames(3)
    user.click("Replace")
    assert len(orders(user)) == 1


def test_the_place_is_chosen_and_the_dialog_comes_back(user: Desk, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    dialog = opened(user)
    for end, path in (("Escape", "test.png"), ("Enter", "sub/shot.exr")):
        user.click("Choose…##file")
        user.frames(3)
        user.key("Ctrl+A")
        user.write(str(tmp_path / path))
        user.key(end)
        user.frames(3)
        assert user.editor.dialog is dialog
    assert Path(dialog.order.path) == tmp_path / "sub/shot.exr" and dialog.order.choice.suffix == ".exr"


def test_one_that_is_under_way_is_shown_and_ended(user: Desk) -> None:
    progress = FinalProgress(Path("shot.png"), 0.25, 64, 20.0, 60.0, 1)
    assert final_text(progress) == "shot.png: 25 %, 1:00 left, 1 more"
    assert not user.shows("final")
    tell(user, Finals(progress))
    for button, is_kept in (("Write now", True), ("Give up", False)):
        user.click(f"final: {button}")
        assert user.null.requests[-1] == EndFinal(is_kept)
    user.run("Quit")
    user.frames(3)
    user.click("Keep rendering")
    assert not user.editor.screen.is_closing
    user.editor.change_device("another")
    assert "given up" in user.texts()[-1] and user.editor.rendering.final is None
    tell(user, Finals(progress))
    user.run("Quit")
    user.frames(3)
    user.click("Give up and quit")
    assert user.editor.screen.is_closing
    tell(user, Problem("the device is gone", fatal=True))
    assert not user.shows("final")


def test_proportions_are_kept_by_either_side() -> None:
    assert proportional((48, 32), (96, 32)) == (96, 64)
    assert proportional((48, 32), (48, 16)) == (24, 16)
    assert proportional((48, 32), (48, 32)) == (48, 32)
    assert proportional((100, 1), (16384, 1))[1] == 164 and proportional((1, 100), (1, 1)) == (1, 1)
