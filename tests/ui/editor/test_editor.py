"""The editor as a whole: what the renderer is shown, what it answers, undo of anything."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from imgui_bundle import imgui
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, changes, desk, flat, frame_of, state, tell

from incpt.core.errors import DeviceError, InputError
from incpt.render.modes import Mode
from incpt.scene import edits
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.commands import command, materials, objects, pictures, table
from incpt.ui.editor import clipboard
from incpt.ui.panels.notices import status_text
from incpt.ui.preferences import DisplaySettings, Preferences
from incpt.viewer.renderer import (
    Building,
    CopiedPicture,
    Copy,
    Export,
    Exported,
    Forget,
    Pin,
    Problem,
    TakeNow,
    Waiting,
)
from incpt.viewer.view import Frame

SCENE = mixed_scene(size=(48, 32))


@pytest.fixture
def user() -> Iterator[Desk]:
    with desk(SCENE) as made:
        yield made


# ---------------------------------------------------------------------------------------- what is shown


def test_frames_without_a_change_show_equal_views(user: Desk) -> None:
    user.frames(5)
    assert len(user.null.views) >= 8 and all(view == user.null.views[0] for view in user.null.views)
    assert user.null.views[-1].scene is SCENE and user.null.views[-1].before is None


def test_edits_of_one_frame_are_one_view(user: Desk) -> None:
    user.null.views.clear()
    user.editor.select(Selection(("red cube",)))
    user.editor.propose(SCENE.with_object("red cube", position=(1, 1, 1)), "Move")
    user.editor.propose(user.scene.with_camera(fov_y=50), "Camera")
    user.editor.propose(user.scene.with_material("red", metallic=1.0), "Material")
    assert user.null.views == []
    user.frame()
    assert len(user.null.views) == 1
    assert changes(flat(SCENE), flat(user.null.views[0].scene)) == {
        "camera.fov_y",
        "materials.red.metallic",
        *(f"objects.red cube.position.{i}" for i in range(3)),
    }


def test_a_panel_and_the_picture_in_one_frame_are_one_view(user: Desk) -> None:
    user.editor.select(Selection(("red cube",)))
    user.frames(2)
    user.open_field("Position X")
    user.key("Ctrl+A")
    user.write("3")
    # The click into the picture ends the typing and begins an orbit in the same frame.
    user.move(*user.at_picture(0.1, 0.1))
    user.press(2)
    user.press(0)
    seen = [view.scene for view in user.null.views]
    assert seen[-1].object("red cube").position == (3, 0.5, 0)
    user.release(0)
    user.release(2)


def test_display_never_changes_the_scene_that_is_shown(user: Desk) -> None:
    user.panel("Method")
    before = user.editor.view
    user.type("Exposure", "3")
    user.choose("Curve", "sRGB, clipped")
    for label in ("Tile grid", "Outline"):
        user.click(label)
    for name in ("Order of the queue", "Samples per pixel", "Replaced tiles"):
        user.run(name)
    assert user.editor.view == before and all(view == before for view in user.null.views)
    user.run("Normals")
    assert user.editor.view == replace(before, first_hits=True)
    user.run("None")
    user.run("Split view")
    assert user.editor.view == replace(before, split=True)
    assert all(view.scene is SCENE for view in user.null.views)


def test_controls_reach_the_renderer(user: Desk) -> None:
    before = user.editor.view
    user.panel("Render")
    user.type("Target spp", "64")
    user.type("Resolution", "50")
    user.type("Step time", "20")
    user.choose("Strategy", "Spiral")  # which uses it
    user.type("NoR in a drag", "4")
    user.click("Pause")
    scene = user.scene
    wanted = replace(
        before, scene=scene, target_spp=64, resolution_scale=0.5, step_ms=20.0, drag_nor=4, paused=True
    )
    assert user.null.views[-1] == wanted and user.null.views[-1].size == (24, 16)
    user.click("Go on")
    user.type("Target spp", "0")
    assert user.null.views[-1] == replace(wanted, paused=False, target_spp=None)


# ------------------------------------------------------------------------------ what the renderer tells


def test_building_shows_a_bar_until_there_is_a_picture(user: Desk) -> None:
    tell(user, Building(1, 5))
    assert user.shows("building")
    tell(user, Building(5, 5))
    assert not user.shows("building")
    tell(user, Building(1, 5))
    tell(user, frame_of(user.editor.view))
    assert not user.shows("building") and user.editor.frame is not None


def test_a_problem_is_a_message_and_nothing_else(user: Desk) -> None:
    tell(user, frame_of(user.editor.view))
    before, frame = state(user.editor), user.editor.frame
    tell(user, Problem("memory ran out; use a smaller image"))
    assert changes(before, state(user.editor)) == {"notices"} and user.editor.frame is frame
    assert user.texts() == ["memory ran out; use a smaller image"]
    user.rest(1000.0)
    assert len(user.texts()) == 1  # an error stays until it is dismissed
    user.click("dismiss 0")
    assert user.texts() == []


def test_after_a_fatal_problem_the_scene_is_still_edited_and_restart_opens_the_device(user: Desk) -> None:
    tell(user, Building(1, 3), Problem("the device is gone", fatal=True))
    assert (
        user.editor.rendering.has_failed
        and not user.shows("building")
        and user.texts() == ["the device is gone"]
    )
    tell(user, Problem("the picture is not written"))
    assert user.editor.rendering.has_failed
    user.run("Cube")
    assert user.undo_count == 1 and user.devices == [None]
    user.run("Restart")
    assert user.devices == [None, None] and user.null.closed and not user.editor.rendering.has_failed
    assert user.null.views[-1].scene == user.scene


def test_another_device_is_opened(user: Desk) -> None:
    user.editor.rendering = replace(user.editor.rendering, is_pinned=True)
    user.editor.change_device("other")
    assert user.devices == [None, "other"] and user.null.closed and not user.editor.rendering.is_pinned


def test_what_was_exported_is_said_for_a_while(user: Desk, tmp_path: Path) -> None:
    tell(user, Exported(tmp_path, (48, 32)))
    assert (
        user.texts() == [f"{tmp_path} is written, 48 × 32 pixels"]
        and user.editor.notices.next_end is not None
    )
    user.rest(6.0)
    assert user.texts() == [] and user.editor.notices.next_end is None


def test_what_waits_for_the_whole_picture_says_so(user: Desk, tmp_path: Path) -> None:
    frame = frame_of(user.editor.view, Mode.INCREMENTAL)
    tell(user, frame, Waiting((Export(tmp_path / "a.png"),)))
    assert user.shows("waiting")
    user.click("Take it as it is")
    assert user.null.requests == [TakeNow()]
    user.click("Give up##waiting")
    assert user.null.requests == [TakeNow(), Forget()]
    tell(user, Waiting(()))
    assert not user.shows("waiting")


def test_a_copy_goes_to_the_clipboard_once_it_is_there(user: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    monkeypatch.setattr(clipboard, "copy_picture", lambda pixels: taken.append(int(pixels.sum())))
    tell(user, frame_of(user.editor.view))
    user.editor.change_display(DisplaySettings(exposure=2.0, curve="filmic"))
    user.run("Copy picture")
    assert user.null.requests == [Copy(2.0, "filmic")] and not taken and user.texts() == []
    tell(user, CopiedPicture(np.ones((2, 3, 3), np.uint8)))
    assert taken == [18] and "is on the clipboard" in user.texts()[-1]


def test_a_stale_reference_is_marked(user: Desk) -> None:
    user.panel("Method")
    tell(user, replace(frame_of(user.editor.view, error=0.25), is_pinned=True, is_stale=True))
    user.click("Pin again")
    assert user.null.requests == [Pin(True)]
    assert "RMSE 0.25000 to a stale reference" in status_text(user.editor.frame, False, Selection())
    tell(user, replace(frame_of(user.editor.view), is_pinned=True))
    assert not user.shows("Pin again")


def test_pinning_and_exporting_ask_the_renderer(user: Desk, tmp_path: Path) -> None:
    tell(user, frame_of(user.editor.view))
    user.panel("Method")
    user.click("Pin this picture")
    tell(user, replace(frame_of(user.editor.view), is_pinned=True))
    user.click("Unpin")
    user.editor.change_display(DisplaySettings(exposure=2.0, curve="filmic"))
    path = tmp_path / "a.png"
    pictures.export_to(user.editor, path)
    assert user.null.requests == [Pin(True), Pin(False), Export(path, True, 2.0, "filmic")]
    with pytest.raises(InputError, match="png"):
        pictures.export_to(user.editor, tmp_path / "a.gif")


def test_the_status_says_mode_samples_and_selection(user: Desk) -> None:
    def status() -> str:
        return status_text(user.editor.frame, user.editor.control.paused, user.editor.selection)

    assert status() == ""
    tell(user, frame_of(user.editor.view, Mode.INCREMENTAL, 1234, 0.5))
    user.editor.select(Selection(("lamp",)))
    assert "Incremental" in status() and "1,234" in status()
    assert "0.50000" in status() and status().endswith("lamp")
    user.run("Pause")
    user.run("Select all")
    assert status().startswith("Paused") and "5 objects" in status()


def frame_with(user: Desk, error_left: float | None, mode: Mode = Mode.INCREMENTAL) -> Frame:
    frame = frame_of(user.editor.view, mode, 3)
    return replace(frame, pictures=(replace(frame.pictures[0], error_left=error_left),))


def test_the_status_says_how_far_an_edit_is_found(user: Desk) -> None:
    def status(error_left: float | None, mode: Mode = Mode.INCREMENTAL) -> str:
        tell(user, frame_with(user, error_left, mode))
        return status_text(user.editor.frame, user.editor.control.paused, user.editor.selection)

    assert status(1.0).startswith("Change found: 0 %   |   worth 3 samples per pixel on average")
    assert status(0.126).startswith("Change found: 87 %") and "Incremental" not in status(0.126)
    assert status(0.001, Mode.REFINE).startswith("Change found: 99 %"), "something is left"
    assert status(0.0, Mode.REFINE).startswith("Refine") and status(None).startswith("Incremental")
    user.run("Pause")
    assert status(0.5).startswith("Paused   |   Change found: 50 %")


@pytest.mark.parametrize(
    ("error_left", "text"), [(0.25, "Finding"), (0.0, "Incremental"), (None, "Incremental")]
)
def test_the_panel_says_how_far_an_edit_is_found(
    user: Desk, monkeypatch: pytest.MonkeyPatch, error_left: float | None, text: str
) -> None:
    texts: list[str] = []
    bars: list[tuple[float, str]] = []
    written, bar = imgui.text_unformatted, imgui.progress_bar
    monkeypatch.setattr(imgui, "text_unformatted", lambda text: (texts.append(text), written(text))[1])
    monkeypatch.setattr(
        imgui,
        "progress_bar",
        lambda share, size, text: (bars.append((share, text)), bar(share, size, text))[1],
    )
    user.panel("Render")
    tell(user, frame_with(user, error_left))
    assert any(one.startswith(text) for one in texts)
    tiles = f"{2:,} of {len(user.editor.frame.pictures[0].queue):,} tiles"  # type: ignore[union-attr]
    assert bars[-1][1] == ("75 % of the change found" if error_left else tiles)
    if error_left:
        assert bars[-1][0] == pytest.approx(0.75)


def test_every_panel_shows_a_frame_of_either_kind(user: Desk) -> None:
    for split in (False, True):
        user.editor.change_display(DisplaySettings(split=split))
        for step in range(3):
            frame = frame_of(user.editor.view, error=0.1 + step)
            tell(user, frame)
            for panel in ("Object", "Scene", "Render", "Method"):
                user.panel(panel)
        assert user.shows("Step time plot") and user.shows("Error plot")
        assert set(user.workspace.records.errors) == ({"restart (left)", "impact"} if split else {"impact"})
    user.panel("Render")
    assert user.shows("mode") and user.shows("queue") and user.scene is SCENE


def test_what_is_refused_leaves_everything(user: Desk) -> None:
    before = state(user.editor)
    for error in (InputError("a\nb"), DeviceError("c")):

        def fail(error: Exception = error) -> None:
            raise error

        assert not user.editor.attempt(fail)
    assert changes(before, state(user.editor)) == {"notices"} and user.texts() == ["a b", "c"]
    with pytest.raises(ZeroDivisionError):
        user.editor.attempt(lambda: 1 / 0)


def test_another_document_starts_over(user: Desk) -> None:
    from incpt.ui.editor.document import Document

    user.editor.select(Selection(("lamp",)))
    user.editor.control = replace(user.editor.control, point=(0.5, 0.5))
    user.editor.start_over(Document(Scene(), name="x", warnings=("lost something",)))
    assert user.editor.selection.names == () and user.editor.control.point is None
    assert user.texts() == ["lost something"] and user.editor.title == "x - incpt"
    user.frames(2)
    assert user.null.views[-1].scene == Scene() and user.undo_count == 0


# ------------------------------------------------------------------------------------- undo of anything


NAMES = [o.name for o in SCENE.objects] + ["cube", "red cube.001", "lamp.001"]
COMMANDS = [
    "Duplicate", "Delete", "Hide", "Show all", "Select all", "Select none", "Clear all three", "Cube",
    "Frame selected", "Reset camera", "Front", "Match window", "Local axes", "Tile grid", "Pause", "Depth",
]  # fmt: skip
steps = st.one_of(
    st.tuples(st.just("command"), st.sampled_from(COMMANDS)),
    st.tuples(st.just("select"), st.lists(st.sampled_from(NAMES), max_size=3).map(tuple)),
    st.tuples(st.just("rename"), st.sampled_from(["a", "b", "lamp", ""])),
    st.tuples(st.just("material"), st.sampled_from(["new", "copy", "delete", "assign"])),
    st.tuples(st.just("move"), st.floats(-5, 5, allow_nan=False)),
    st.tuples(st.just("drag"), st.integers(-60, 60)),
    st.tuples(st.just("orbit"), st.integers(-60, 60)),
    st.tuples(st.just("wheel"), st.sampled_from([-1.0, 1.0])),
    st.tuples(st.just("undo"), st.integers(1, 3)),
    st.tuples(st.just("redo"), st.integers(1, 3)),
)


def act(user: Desk, kind: str, value: Any) -> None:
    if kind == "command":
        user.run(value)
    elif kind == "select":
        user.editor.select(Selection(value))
    elif kind in ("undo", "redo"):
        for _ in range(value):
            user.run(kind.capitalize())
    elif kind == "orbit":
        user.drag_at(user.at_picture(0.02, 0.02), (value, 0.0), button=2)
    elif kind == "wheel":
        user.move(*user.at_picture(0.02, 0.02))
        user.wheel(value)
        user.rest(1.0)
    elif user.editor.selection.active is not None:
        act_on(user, user.editor.selection.active, kind, value)
    user.frame()


def act_on(user: Desk, name: str, kind: str, value: Any) -> None:
    editor = user.editor
    material = editor.scene.object(name).material
    if kind == "drag" and user.shows("Position X"):
        user.drag("Position X", value)
    elif kind == "move":
        editor.propose(editor.scene.with_object(name, position=(value, 0, 0)), "Move")
    elif kind == "rename":
        editor.attempt(lambda: objects.rename_to(editor, name, value))
    elif value == "new":
        materials.new_material(editor)
    elif value == "copy":
        materials.duplicate_material(editor, material)
    elif value == "delete":
        editor.attempt(lambda: editor.propose(edits.delete_material(editor.scene, material), "Delete"))
    elif value == "assign":
        editor.propose(edits.assign_material(editor.scene, editor.selection.names, "glass"), "Assign")


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(steps, min_size=4, max_size=40))
def test_undo_and_redo_lead_through_the_same_scenes(sequence: list[tuple[str, Any]]) -> None:
    with desk(SCENE, Preferences()) as user:
        history = user.editor.document.history
        for kind, value in sequence:
            before, selected = user.scene, user.editor.selection.names
            could_redo = history.can_redo
            act(user, kind, value)
            assert history.before is None
            if kind not in ("undo", "redo") and user.scene != before:
                # One step: undo leads back to scene and selection, redo to what came of it.
                after, selected_after = user.scene, user.editor.selection.names
                assert not history.can_redo
                user.run("Undo")
                assert user.scene == before and user.editor.selection.names == selected
                user.run("Redo")
                assert user.scene == after and user.editor.selection.names == selected_after
            elif kind not in ("undo", "redo"):
                assert history.can_redo == could_redo
            assert all(name in user.scene.object_index for name in user.editor.selection)
            assert user.null.views[-1].scene == user.editor.shown
        scenes = [user.scene]
        while history.can_undo:
            command.run(user.editor, table.command("Undo"))
            scenes.append(user.scene)
        assert user.scene == SCENE and not user.editor.document.is_dirty
        for scene in scenes[-2::-1]:
            command.run(user.editor, table.command("Redo"))
            assert user.scene == scene


def test_an_error_is_copied(user: Desk) -> None:
    user.editor.say("all is well", "done")
    user.editor.say("x.obj: no such file", "error")
    user.frames(3)
    assert not user.shows("copy 0")
    user.click("copy 1")
    assert imgui.get_clipboard_text() == "x.obj: no such file" and len(user.texts()) == 2


def test_a_scene_in_which_nothing_shines_says_so(user: Desk) -> None:
    assert not user.shows("darkness")
    user.editor.propose(SCENE.with_environment(image=None, color=(0, 0, 0)), "Night")
    user.frames(2)
    assert not user.shows("darkness"), "the lamp shines"
    user.editor.propose(user.scene.with_object("lamp", visible=False), "Hide")
    user.frames(2)
    assert user.shows("darkness")
    scene, (name,) = edits.add_light(user.scene, "spot")
    user.editor.propose(scene, "Light")
    user.frames(2)
    assert not user.shows("darkness")
    user.editor.propose(user.scene.with_light(name, visible=False), "Hide")
    user.frames(2)
    assert user.shows("darkness")
