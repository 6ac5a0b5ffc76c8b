"""The editor in a real window, worked by mouse and keyboard. window.py says where pictures of it are kept."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from support import window
from support.window import is_answered, keep, projected

from incpt.benchmarks.kit import desktop
from incpt.benchmarks.kit.desktop import Hand
from incpt.formats import registry
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.model import Scene
from incpt.ui.window import on_screen

pytestmark = pytest.mark.slow

CUBE = (-0.3, 0.5, 0.6)


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    window.require_display()
    with desktop.virtual_display(window.DISPLAY_SIZE) as name:
        yield name


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return window.scene_file(tmp_path)


@pytest.fixture
def hand(display: str, file: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hand]:
    with window.opened(file, monkeypatch) as hand:
        yield hand


def pick(hand: Hand, name: str, button: int = 3) -> None:
    """Click the middle of an object in the picture."""
    scene = hand.app.editor.scene
    x, y = projected(scene, scene.object(name).position)
    hand.click(hand.in_picture(x, y), button)
    hand.pump(lambda: hand.app.editor.selection.active == name, timeout=20)


def answer_path(hand: Hand, path: Path) -> None:
    hand.type_into("Path", str(path))
    hand.pump(lambda: hand.app.editor.dialog is None, timeout=20)


def read_exr(path: Path) -> dict[str, np.ndarray]:
    channels = OpenEXR.File(str(path)).channels()
    return {name: np.asarray(channel.pixels) for name, channel in channels.items()}


def settled(hand: Hand) -> None:
    hand.pump(lambda: is_answered(hand), timeout=30)


# ------------------------------------------------------------------------------------ selecting, editing


def test_a_right_click_selects_and_a_click_on_nothing_deselects(hand: Hand) -> None:
    from incpt.ui.widgets import places

    editor = hand.app.editor
    before = keep(hand, "1-start")
    assert editor.frame.pictures[-1].mode is Mode.REFINE
    assert "Position X" not in places.names()
    pick(hand, "red cube")
    after = keep(hand, "2-picked")
    assert "Position X" in places.names()
    x, y = map(round, hand.in_picture(*projected(editor.scene, CUBE)))
    box = slice(y - 70, y + 70), slice(x - 70, x + 70)
    changed = np.abs(after[box].astype(int) - before[box]).max(axis=-1) > 60
    assert changed.sum() > 150, "neither outline nor gizmo"
    with hand.holding("ctrl"):
        pick(hand, "blue ball", button=1)
    assert editor.selection.names == ("red cube", "blue ball")
    hand.click(hand.in_picture(0.5, 0.03), button=3)
    hand.pump(lambda: not editor.selection, timeout=20)
    assert not editor.document.is_dirty and not editor.document.history.can_undo


def test_values_are_dragged_and_typed_undone_saved_and_opened_again(
    hand: Hand, file: Path, tmp_path: Path
) -> None:
    editor = hand.app.editor
    opened = editor.scene
    pick(hand, "red cube")

    modes, steps = set(), []

    def watch() -> None:
        modes.add(editor.frame.pictures[-1].mode)
        steps.append(editor.document.history.before is not None)

    x, y = hand.middle("Rotation Y")
    hand.drag((x, y), (x + 40, y), between=watch)
    turned = editor.scene
    assert turned.object("red cube").rotation[1] > 40 and Mode.BASE not in modes and any(steps)
    assert turned.object("red cube").position == CUBE
    settled(hand)

    hand.type_into("Position X", "0.35")
    moved = editor.scene
    assert moved.object("red cube").position == (pytest.approx(0.35), 0.5, 0.6)
    hand.type_into("Scale Y", "0")
    assert editor.scene == moved, "a scale of 0 is refused, and the field keeps the last good value"
    settled(hand)
    keep(hand, "3-edited")

    hand.key("ctrl+z")
    assert editor.scene == turned
    hand.key("ctrl+z")
    assert editor.scene == opened and not editor.document.is_dirty
    assert editor.document.history.undo_label is None, "a drag is one entry"
    hand.key("ctrl+shift+z")
    hand.key("ctrl+shift+z")
    assert editor.scene == moved and editor.title == "table.toml (edited) - incpt"

    hand.key("ctrl+shift+s")
    keep(hand, "4-save-as")
    answer_path(hand, tmp_path / "moved.toml")
    assert registry.load(tmp_path / "moved.toml") == moved
    assert registry.load(file) == opened, "save as leaves the first file alone"
    assert editor.title == "moved.toml - incpt"

    hand.key("ctrl+n")
    assert len(editor.scene.objects) == 2
    hand.key("ctrl+o")
    answer_path(hand, tmp_path / "moved.toml")
    hand.pump(lambda: not editor.jobs)
    assert editor.scene == moved and not editor.document.history.can_undo
    hand.pump(lambda: is_answered(hand) and window.is_whole(hand))
    keep(hand, "5-opened-again")


def test_the_gizmo_moves_the_object_and_the_exported_picture_shows_it_there(
    hand: Hand, tmp_path: Path
) -> None:
    editor = hand.app.editor
    pick(hand, "red cube")
    x, y = hand.middle("gizmo")
    hand.drag((x + 45, y), (x + 100, y))
    moved = editor.scene.object("red cube").position
    assert moved[0] > CUBE[0] + 0.3 and moved[1:] == pytest.approx(CUBE[1:], abs=1e-5)
    assert editor.document.history.undo_label == "Move" and editor.selection.names == ("red cube",)
    hand.pump(lambda: is_answered(hand) and editor.frame.pictures[-1].mode is Mode.REFINE)
    keep(hand, "6-moved-by-gizmo")

    picture = tmp_path / "moved.exr"
    hand.key("ctrl+e")
    answer_path(hand, picture)
    hand.pump(lambda: any(one.level == "done" for one in editor.notices.said), timeout=60)
    channels = read_exr(picture)
    rows, columns = np.nonzero(channels["object_id"] == 1)
    width, height = window.PICTURE_SIZE
    middle = (columns.mean() + 0.5) / width, (rows.mean() + 0.5) / height
    assert middle == pytest.approx(tuple(projected(editor.scene, moved)), abs=0.02)
    radiance = channels["RGB"]
    assert (radiance[rows, columns, 0] > 2 * radiance[rows, columns, 2]).mean() > 0.95, (
        "the cube is red there"
    )
    x0, y0 = projected(editor.scene, CUBE) * (width, height)
    left_behind = radiance[round(y0) - 4 : round(y0) + 4, round(x0) - 14 : round(x0) - 8].mean(axis=(0, 1))
    assert left_behind[0] < 1.3 * left_behind[2], "the table is grey where the cube was"
    assert {"normal.X", "depth.Z", "object_id"} < set(channels) and any("albedo" in n for n in channels)


def test_keys_move_what_is_selected_and_give_it_up(hand: Hand) -> None:
    from incpt.ui.widgets import places

    editor = hand.app.editor
    opened, modes = editor.scene, set()
    pick(hand, "red cube")
    hand.key("g")
    start = hand.in_picture(0.5, 0.5)
    for step in range(4):
        hand.move((start[0] + 12 * step, start[1]))
        hand.pump(lambda: hand.app.shown_frame.view.scene == editor.scene, frames=0)
        modes.add(hand.app.shown_frame.pictures[-1].mode)
        assert step == 0 or hand.app.shown_frame.view.before is opened
    assert Mode.BASE not in modes, "what was rendered is kept"
    before = keep(hand, "6-moved-by-mouse")
    hand.key("x")
    hand.type("1+.5")
    after = keep(hand, "6-moved-by-number")
    y, x = np.nonzero(np.abs(after.astype(int) - before).max(axis=-1) > 60)
    line = hand.in_picture(*projected(opened, CUBE))[1]
    beside = x < hand.in_picture(0.1, 0)[0]
    assert (np.abs(y[beside] - line) < 3).any(), "the axis reaches to the edge of the picture"
    hand.key("Return")
    assert editor.scene.object("red cube").position == (1.2, 0.5, 0.6)
    assert editor.document.history.undo_label == "Move" and "gizmo" in places.names()
    hand.pump(lambda: is_answered(hand) and editor.frame.pictures[-1].mode is Mode.REFINE)
    moved = editor.scene

    hand.key("r")
    hand.move((start[0], start[1] + 30))
    hand.move((start[0] - 40, start[1] + 30))
    assert editor.scene != moved
    hand.click(start, button=3)
    assert editor.scene is moved and editor.selection.names == ("red cube",)
    hand.key("ctrl+z")
    assert editor.scene == opened and not editor.document.history.can_undo


def test_a_box_and_the_menu_of_what_is_selected(hand: Hand) -> None:
    from incpt.ui.widgets import places

    editor = hand.app.editor
    ball, drum = (hand.in_picture(*projected(editor.scene, place)) for place in ((1.5, 0.5, 0), (-2, 0.5, 0)))
    hand.key("b")
    hand.drag((ball[0] - 4, ball[1] - 4), (ball[0] + 4, ball[1] + 4))
    hand.pump(lambda: editor.selection.names == ("blue ball",), timeout=20)
    with hand.holding("shift"):
        hand.click(drum)
    hand.pump(lambda: editor.selection.names == ("blue ball", "grey drum"), timeout=20)
    hand.click(drum, button=3)
    hand.pump(lambda: "Rename…" in places.names(), timeout=20)
    keep(hand, "5-menu")
    hand.click("Duplicate and move")
    hand.type("2")
    hand.key("Return")
    copies = [editor.scene.object(f"{name}.001").position for name in ("blue ball", "grey drum")]
    assert copies == [(3.5, 0.5, 0.0), (0.0, 0.5, 0.0)]
    hand.key("x")
    assert editor.scene.names == {"table", "red cube", "blue ball", "grey drum"}


def test_what_is_dragged_is_seen_at_once_and_leaves_no_ghost(hand: Hand) -> None:
    """In the first picture of each step of a drag under impact, and in the picture once the edit is found."""
    from incpt.ui.panels import notices

    editor = hand.app.editor
    settings = replace(editor.scene.settings, strategy="impact", size=(960, 540))
    editor.propose(replace(editor.scene, settings=settings), "Strategy")
    hand.pump(lambda: is_answered(hand) and editor.frame.pictures[-1].tile_spp.min() >= 16)
    pick(hand, "red cube")
    start, looks, told = editor.scene, [], []

    def look() -> None:
        hand.pump(lambda: hand.app.shown_frame.view.scene == editor.scene, frames=0)
        told.append(notices.status_text(hand.app.shown_frame, False, editor.selection))
        looks.append((editor.scene, hand.app.shown_frame.pictures[-1].image[..., :3].copy()))

    x, y = hand.middle("gizmo")
    hand.drag((x + 45, y), (x + 160, y), between=look)
    keep(hand, "6-dragged-under-impact")
    assert len({id(scene) for scene, _ in looks}) >= 4
    assert any(text.startswith("Change found: ") for text in told), told
    old_place = cube_alone(start, editor.scene)
    for scene, image in looks[2:]:
        place = cube_alone(scene, start)
        assert is_red(image)[place].mean() > 0.9, "the cube is not drawn where it is"
        left_behind = cube_alone(start, scene)
        assert is_red(image)[left_behind].mean() < 0.1, "the cube is still drawn where it was"

    hand.pump(lambda: is_answered(hand) and editor.frame.pictures[-1].error_left < 0.25)
    shown = editor.frame.pictures[-1].image[..., :3]
    settings = replace(editor.scene.settings, strategy="restart", base_nor=16)
    session = Session(replace(editor.scene, settings=settings))
    session.render(64)
    errors = np.abs(shown - session.image()).max(axis=-1)
    # How much noise is left there depends on how far it got; a ghost would be ten times as much.
    assert np.quantile(errors[old_place], 0.98) < 2 * np.quantile(errors[~old_place], 0.995)
    keep(hand, "6-found-under-impact")


def cube_alone(there: Scene, not_there: Scene) -> np.ndarray:
    """(H, W) where the cube is seen in one scene and not in the other, without the pixels at its edges."""
    was, others = (
        Session(replace(scene)).first_hits().object_id == scene.object_index["red cube"]
        for scene in (there, not_there)
    )
    inner = was.copy()
    for axis in (0, 1):
        for by in (-2, 2):
            inner &= np.roll(was, by, axis) & ~np.roll(others, by, axis)
    return inner & ~others


def is_red(image: np.ndarray) -> np.ndarray:
    return image[..., 0] > 2 * image[..., 2]


def test_tiles_far_from_an_edit_keep_their_samples(hand: Hand) -> None:
    editor = hand.app.editor
    # So many repetitions that the queue is seen on its way on a fast machine too.
    settings = replace(editor.scene.settings, strategy="spiral", nor=256, nor_adapts=False)
    editor.propose(replace(editor.scene, settings=settings), "NoR")
    hand.pump(lambda: editor.frame.pictures[-1].tile_spp.min() >= 4)
    hand.key("F5")
    hand.pump(lambda: editor.frame.resting)
    before = editor.frame.pictures[-1]
    pick(hand, "red cube")
    hand.type_into("Position Z", "0.9")
    settled(hand)
    assert editor.frame.resting and np.array_equal(editor.frame.pictures[-1].image, before.image)

    seen = []

    def note() -> bool:
        picture = editor.frame.pictures[-1]
        if picture.mode is Mode.INCREMENTAL and picture.queue_done > 0:
            seen.append(picture)
        return picture.mode is Mode.REFINE

    hand.key("F5")
    hand.pump(note)
    partly = [picture for picture in seen if picture.queue_done < len(picture.queue) // 2]
    assert partly, "the queue was never seen on its way"
    for picture in partly:
        done = np.zeros(picture.grid.count, bool)
        done[picture.queue[: picture.queue_done]] = True
        tile_of_pixels = picture.grid.tile_of_pixels()
        kept = ~picture.replaced[tile_of_pixels]
        assert np.array_equal(picture.image[kept], before.image[kept])
        assert np.array_equal(picture.tile_spp[~done], before.tile_spp[~done])
        assert (picture.tile_spp[done] == editor.scene.settings.nor).all()
    first = partly[0].queue[0]
    column, row = np.array(projected(editor.scene, (-0.3, 0.5, 0.9))) * window.PICTURE_SIZE // window.TILE
    assert abs(first % before.grid.columns - column) <= 2 and abs(first // before.grid.columns - row) <= 2


# ------------------------------------------------------------------------------------------ camera, display


def test_the_middle_button_orbits_and_the_camera_follows_by_one_edit(hand: Hand) -> None:
    editor = hand.app.editor
    camera = editor.scene.camera
    previews = []
    start, end = hand.in_picture(0.4, 0.5), hand.in_picture(0.6, 0.45)
    hand.drag(start, end, button=2, between=lambda: previews.append(editor.frame.is_preview))
    turned = editor.shown.camera
    distance = np.linalg.norm(np.subtract(camera.position, camera.target))
    assert turned.position != camera.position and turned.target == camera.target
    assert np.linalg.norm(np.subtract(turned.position, turned.target)) == pytest.approx(distance)
    hand.pump(lambda: is_answered(hand) and window.is_whole(hand))
    assert editor.frame.view.scene.camera == turned
    assert editor.scene.camera == camera and not editor.document.is_dirty, "a free view is no edit"
    keep(hand, "7-orbited")
    hand.click("menu View")
    hand.click("Camera to view")
    assert editor.scene.camera == turned and not editor.viewing.is_free
    hand.key("ctrl+z")
    assert editor.scene.camera == camera == editor.shown.camera and not editor.document.history.can_undo


def test_the_split_view_shows_both_strategies_and_its_bar_is_dragged(hand: Hand, file: Path) -> None:
    editor = hand.app.editor
    hand.key("F6")
    hand.pump(lambda: len(editor.frame.pictures) == 2)
    pick(hand, "blue ball")
    hand.type_into("Position X", "1.2")
    hand.pump(lambda: is_answered(hand) and all((p.tile_spp > 0).all() for p in editor.frame.pictures))
    assert [picture.strategy for picture in editor.frame.pictures] == ["restart", "impact"]
    left, right = (picture.image[..., :3].mean(axis=(0, 1)) for picture in editor.frame.pictures)
    assert left == pytest.approx(right, rel=0.05), "both sides show the same scene"
    assert editor.frame.pictures[0].seconds > 0
    bar, y = hand.middle("split bar")
    hand.drag((bar, y), (bar - 120, y))
    position = hand.place("picture").relative((bar - 120, y))[0]
    assert editor.preferences.display.split_position == pytest.approx(position, abs=0.01)
    keep(hand, "8-split")
    hand.key("F6")
    hand.pump(lambda: len(editor.frame.pictures) == 1)
    assert registry.load(file) != editor.scene and editor.document.history.undo_label == "Transform"


# ------------------------------------------------------------------------------------------------- closing


def test_closing_asks_about_unsaved_changes(hand: Hand, file: Path) -> None:
    editor = hand.app.editor
    pick(hand, "grey drum")
    hand.key("Delete")
    assert "grey drum" not in {o.name for o in editor.scene.objects}
    hand.key("ctrl+q")
    keep(hand, "9-question")
    hand.click("Cancel")
    assert editor.dialog is None and not editor.screen.is_closing
    hand.close_window()
    assert editor.dialog is not None and not editor.screen.is_closing
    hand.click("Save")
    assert editor.screen.is_closing and registry.load(file) == editor.scene


def test_the_editor_runs_as_a_program_of_its_own(display: str, file: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "INCPT_CONFIG_DIR": str(tmp_path / "configuration")}
    command = [sys.executable, "-m", "incpt", "edit", str(file)]
    program = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        found = wait_for_window(program, "table.toml - incpt")
        desktop.ask_to_close(int(found))
        _, errors = program.communicate(timeout=60)
    finally:
        program.kill()
    assert program.returncode == 0 and errors == ""
    assert (tmp_path / "configuration" / "preferences.toml").is_file()


def wait_for_window(program: subprocess.Popen[str], title: str) -> str:
    end = time.monotonic() + 60
    while time.monotonic() < end and program.poll() is None:
        search = ["xdotool", "search", "--name", f"^{title}$"]
        found = subprocess.run(search, check=False, capture_output=True, text=True, timeout=20)
        if found.stdout.strip():
            return found.stdout.split()[0]
        time.sleep(0.1)
    raise AssertionError(f"no window {title!r}; status {program.poll()}")


def run_editor(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "incpt", "edit", *arguments],
        env=os.environ | environment,
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_no_window_is_larger_than_the_screen(hand: Hand) -> None:
    assert hand.app.window.size <= window.DISPLAY_SIZE
    assert on_screen((9000, 200)) == (window.DISPLAY_SIZE[0], 200)
    assert on_screen((200, 9000)) == (200, window.DISPLAY_SIZE[1])


def test_a_missing_file_is_one_line_and_status_2(display: str, tmp_path: Path) -> None:
    result = run_editor("missing.toml", INCPT_CONFIG_DIR=str(tmp_path))
    assert result.returncode == 2 and result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert "missing.toml" in line


def test_no_display_is_one_line_and_status_1(file: Path, tmp_path: Path) -> None:
    window.require_display()
    result = run_editor(str(file), DISPLAY="", WAYLAND_DISPLAY="", INCPT_CONFIG_DIR=str(tmp_path))
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert "display" in line


# ------------------------------------------------------------------- beside the picture, and a part of it


def test_a_final_render_goes_on_while_a_region_is_edited_and_the_screen_is_filled(
    hand: Hand, tmp_path: Path
) -> None:
    editor = hand.app.editor
    hand.key("F12")
    hand.type_into("File", str(tmp_path / "final.exr"))
    hand.type_into("Width", "112")
    hand.type_into("Samples", "40")
    hand.click("Render")
    opened = editor.scene
    hand.key("ctrl+b")
    hand.drag(hand.in_picture(0.25, 0.25), hand.in_picture(0.75, 0.75))
    hand.pump(lambda: editor.frame.view.region is not None, timeout=30)
    pick(hand, "red cube")
    hand.type_into("Position X", "0.35")
    settled_region = editor.view.scene
    hand.pump(lambda: editor.frame.view.scene == settled_region, timeout=30)
    hand.pump(lambda: (tmp_path / "final.exr").exists() and editor.rendering.final is None, timeout=120)
    session = Session(opened, size=(112, 72))
    session.render(40)
    assert np.array_equal(read_exr(tmp_path / "final.exr")["RGB"], session.image())
    hand.key("F11")
    hand.pump(frames=6)
    assert hand.app.window.framebuffer_size == window.DISPLAY_SIZE
    assert hand.app.window.size == window.WINDOW_SIZE, "the next window is no full screen"
    keep(hand, "region-alone")
    hand.key("Escape")
    hand.pump(lambda: hand.app.window.framebuffer_size == window.WINDOW_SIZE, timeout=20)
    hand.key("Escape")
    hand.pump(lambda: editor.frame.view.region is None, timeout=30)


def test_texts_are_sharp_at_any_scale_and_the_theme_is_changed_at_once(hand: Hand) -> None:
    from imgui_bundle import imgui

    editor = hand.app.editor

    def sharpness(scale: float) -> float:
        """Of the edges of the letters in a tab: how much of them is neither ink nor ground."""
        editor.preferences = replace(editor.preferences, ui_scale=scale)
        hand.pump(frames=8)
        shown = keep(hand, f"scale-{scale:g}")
        place = hand.place("menu View")
        box = shown[int(place.top) : int(place.bottom), int(place.left) : int(place.right)].astype(float)
        grey = (box.mean(axis=2) - box.min()) / (box.max() - box.min())
        return float(((grey > 0.2) & (grey < 0.8)).sum() / (grey >= 0.8).sum())

    sharp = {scale: sharpness(scale) for scale in (1.0, 1.5, 2.0)}
    # Letters that were blown up would have edges as much wider as they are, and the ink between grows too.
    assert sharp[2.0] < 0.75 * sharp[1.0] and sharp[1.5] < sharp[1.0], sharp
    tab = imgui.internal.find_window_by_name("Method").dc.dock_tab_item_rect
    assert tab.max.x - tab.min.x > 100 and tab.max.x <= window.WINDOW_SIZE[0], "the last tab is seen whole"
    editor.preferences = replace(editor.preferences, ui_scale=1.0)
    hand.pump(frames=6)
    dark = keep(hand, "dark")
    hand.key("ctrl+comma")
    hand.pump(frames=4)
    hand.click("Theme")
    hand.pump(frames=4)
    hand.click("Theme: Light")
    hand.key("Escape")
    light = keep(hand, "light")
    assert light[:10].mean() > dark[:10].mean() + 100, "the menu bar"
    x, y = map(round, hand.in_picture(0.5, 0.5))
    assert np.abs(light[y, x].astype(int) - dark[y, x]).max() < 120
