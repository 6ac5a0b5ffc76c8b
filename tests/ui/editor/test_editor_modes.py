"""The mode that follows each thing a user does, with a real Viewer behind the editor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from support.small_scenes import mixed_scene
from support.ui_harness import Desk, desk

from incpt.device.device import Device
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport
from incpt.scene import edits
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.commands import files, objects
from incpt.ui.preferences import DisplaySettings, Preferences
from incpt.viewer.renderer import Message, Pick, Picked, Request, Restart
from incpt.viewer.view import Frame, View
from incpt.viewer.viewer import Viewer

BASE, REFINE, INCREMENTAL = Mode.BASE, Mode.REFINE, Mode.INCREMENTAL
SCENE = mixed_scene(size=(48, 32), nor=8)
STEP_SECONDS = 0.01


class SteppedRenderer:
    """A Viewer without a thread: `advance` is called by the test, which sees every frame."""

    def __init__(self, device: Device, clock: Callable[[], float]) -> None:
        self._device, self._clock = device, clock
        self.viewer: Viewer | None = None
        self.view: View | None = None
        self.frame: Frame | None = None
        self._messages: list[Message] = []

    def show(self, view: View) -> None:
        self.view = view
        if self.viewer is None:
            self.viewer = Viewer(view, self._device, clock=self._clock)

    def request(self, request: Request) -> None:
        assert self.viewer is not None
        if isinstance(request, Pick):
            self._messages.append(Picked(request.point, self.viewer.pick(request.point), request.additive))
        elif isinstance(request, Restart):
            self.viewer.restart()

    def poll(self) -> list[Message]:
        messages, self._messages = self._messages, []
        return messages

    def close(self) -> None:
        pass

    @property
    def session(self) -> Session:
        assert self.viewer is not None
        return self.viewer.session

    def advance(self) -> Frame | None:
        assert self.viewer is not None and self.view is not None
        frame = self.viewer.advance(self.view)
        if frame is not None:
            self.frame = frame
            self._messages.append(frame)
        return frame

    def take_up(self) -> None:
        """Follow the view without a step: a step may end the queue of so small a picture."""
        assert self.viewer is not None and self.view is not None
        self.viewer._follow(self.view)

    def until(self, condition: Callable[[Frame], bool]) -> Frame:
        for _ in range(400):
            frame = self.advance()
            if frame is not None and condition(frame):
                return frame
        raise AssertionError("never happens")


@dataclass
class Table:
    """A user before an editor, and the renderer behind it."""

    user: Desk
    renderer: SteppedRenderer

    def settle(self) -> None:
        """Until the picture is refined at full resolution, and nothing has been edited for a while."""

        def is_refined(frame: Frame) -> bool:
            picture = frame.pictures[-1]
            return picture.mode is REFINE and not frame.is_preview and bool((picture.tile_spp > 0).all())

        self.renderer.until(is_refined)
        self.user.frames(2)


@pytest.fixture
def table(device: Device, monkeypatch: pytest.MonkeyPatch) -> Iterator[Table]:
    seconds = [0.0]
    step = Session.step

    def timed_step(session: Session, slots: int | None = None) -> StepReport:
        seconds[0] += STEP_SECONDS
        return step(session, slots)

    monkeypatch.setattr(Session, "step", timed_step)
    renderer = SteppedRenderer(device, lambda: seconds[0])
    with desk(SCENE, Preferences(step_ms=20.0), renderer) as user:
        user.editor.select(Selection(("red cube",)))
        made = Table(user, renderer)
        made.settle()
        yield made


def mode_after(table: Table, act: Callable[[Desk], object]) -> tuple[Mode, bool]:
    """The mode once the edit is taken up, and whether the picture before is kept: as samples, or as what the
    edited scene is compared with."""
    session = table.renderer.session
    before = session.spp().copy()
    act(table.user)
    table.user.frames(2)
    table.renderer.take_up()
    session = table.renderer.session
    after = session.spp()
    kept = after.shape == before.shape and bool((after >= before).all())
    return session.mode, kept or session.progress.anchor is not None


def edit(change: Callable[[Scene], Scene]) -> Callable[[Desk], object]:
    return lambda user: user.editor.propose(change(user.scene), "x")


def typed(panel: str, label: str, text: str) -> Callable[[Desk], object]:
    def act(user: Desk) -> None:
        user.panel(panel)
        user.type(label, text)

    return act


def chosen(panel: str, label: str, text: str) -> Callable[[Desk], object]:
    def act(user: Desk) -> None:
        user.panel(panel)
        user.choose(label, text)

    return act


def command(name: str) -> Callable[[Desk], object]:
    return lambda user: user.run(name)


def wheel(user: Desk) -> None:
    user.move(*user.at_picture(0.02, 0.02))
    user.wheel(1.0)
    user.rest(1.0)


def orbit(user: Desk) -> None:
    user.drag_at(user.at_picture(0.02, 0.02), (40.0, 0.0), button=2)


def gizmo(user: Desk) -> None:
    x, y = user.place("gizmo")
    user.drag_at((x + 60, y), (40.0, 0.0))


AFTER: dict[str, tuple[Callable[[Desk], object], Mode]] = {
    # The whole image alike: from nothing.
    "camera typed": (typed("Scene", "Field of view", "50"), BASE),
    "orbit": (orbit, BASE),
    "wheel": (wheel, BASE),
    "frame selected": (command("Frame selected"), BASE),
    "width": (typed("Render", "Width", "40"), BASE),
    "resolution": (typed("Render", "Resolution", "50"), BASE),
    "bounces": (typed("Render", "Bounces", "1"), BASE),
    "seed": (typed("Render", "Seed", "7"), BASE),
    "restart": (command("Restart"), BASE),
    # All of it too, but compared with what is there.
    "environment intensity": (typed("Scene", "Intensity", "2"), INCREMENTAL),
    "environment turned": (typed("Scene", "Turn", "90"), INCREMENTAL),
    "environment image": (lambda user: (user.panel("Scene"), user.click("Remove##image")), INCREMENTAL),
    # A part of it: where the edit is, first.
    "position typed": (typed("Object", "Position X", "0.3"), INCREMENTAL),
    "gizmo": (gizmo, INCREMENTAL),
    "rotation": (typed("Object", "Rotation Y", "10"), INCREMENTAL),
    "scale": (typed("Object", "Scale X", "1.2"), INCREMENTAL),
    "material": (typed("Object", "Roughness", "0.3"), INCREMENTAL),
    "assigned material": (chosen("Object", "Material", "grey"), INCREMENTAL),
    "new material": (lambda user: user.click("New##material"), INCREMENTAL),
    "light": (edit(lambda scene: scene.with_material("lamp", emission=(3, 3, 3))), INCREMENTAL),
    "moved light": (edit(lambda scene: scene.with_object("lamp", position=(0.5, 2.5, 0))), INCREMENTAL),
    "add": (command("Cube"), INCREMENTAL),
    "duplicate and move": (
        lambda user: (user.run("Duplicate"), user.type("Position X", "1")),
        INCREMENTAL,
    ),
    "delete": (command("Delete"), INCREMENTAL),
    "hide": (command("Hide"), INCREMENTAL),
    "clear transform": (command("Clear all three"), INCREMENTAL),
    # What no pixel shows.
    "exposure": (typed("Method", "Exposure", "2"), REFINE),
    "curve": (chosen("Method", "Curve", "Filmic"), REFINE),
    "overlay": (command("Samples per pixel"), REFINE),
    "overlay of first hits": (command("Normals"), REFINE),
    "tile grid": (command("Tile grid"), REFINE),
    "outline": (command("Outline"), REFINE),
    "selection": (command("Select all"), REFINE),
    "click": (lambda user: user.click_at(*user.at_picture(0.5, 0.5)), REFINE),
    "rename": (lambda user: objects.rename_to(user.editor, "red cube", "a"), REFINE),
    "rename material": (
        edit(lambda scene: edits.rename_material(scene, "red", "paint")),
        REFINE,
    ),
    "unused material": (
        edit(lambda scene: edits.add_material(scene)[0]),
        REFINE,
    ),
    "gizmo tool": (command("Rotate"), REFINE),
    "pause": (command("Pause"), REFINE),
    "target": (typed("Render", "Target spp", "128"), REFINE),
    "step time": (typed("Render", "Step time", "30"), REFINE),
    "NoR": (typed("Render", "NoR", "64"), REFINE),
    "NoR in a drag": (typed("Render", "NoR in a drag", "2"), REFINE),
    "strategy": (chosen("Render", "Strategy", "Restart"), REFINE),
    "navigation": (command("Plain"), REFINE),
    "help": (command("Keys and mouse"), REFINE),
    "split view": (command("Split view"), REFINE),
    "a value that is refused": (typed("Object", "Scale X", "0"), REFINE),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", AFTER)
def test_the_mode_after(table: Table, name: str) -> None:
    act, wanted = AFTER[name]
    mode, kept = mode_after(table, act)
    assert mode is wanted
    assert kept == (wanted is not BASE)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, (_, mode) in AFTER.items() if mode is INCREMENTAL])
def test_under_restart_every_edit_starts_over(table: Table, name: str) -> None:
    table.user.editor.propose(
        replace(table.user.scene, settings=replace(table.user.scene.settings, strategy="restart")), "x"
    )
    table.user.frames(2)
    table.settle()
    mode, kept = mode_after(table, AFTER[name][0])
    assert mode is BASE and not kept


def test_an_edit_during_base_starts_over(table: Table) -> None:
    table.user.run("Restart")
    assert table.renderer.session.mode is BASE
    assert mode_after(table, AFTER["position typed"][0])[0] is BASE


def test_undo_of_a_local_edit_keeps_the_picture(table: Table) -> None:
    before = table.renderer.session.image()
    mode_after(table, AFTER["position typed"][0])
    table.settle()
    # The picture from before the edit is there at once.
    assert mode_after(table, command("Undo"))[0] is REFINE
    np.testing.assert_array_equal(table.renderer.session.image(), before)
    table.settle()
    assert mode_after(table, command("Redo")) == (INCREMENTAL, True)
    mode_after(table, AFTER["camera typed"][0])
    table.settle()
    assert mode_after(table, command("Undo"))[0] is BASE


def test_a_drag_is_rendered_with_fewer_repetitions_until_it_ends(table: Table) -> None:
    user = table.user
    user.panel("Render")
    user.choose("Strategy", "Spiral")
    user.panel("Object")
    x, y = user.place("Position X")
    user.type("Roughness", "0.5")
    table.settle()
    user.editor.preferences = replace(user.editor.preferences, drag_nor=2)
    user.hold_at((x, y), (40.0, 0.0))
    table.renderer.take_up()
    assert table.renderer.session.mode is INCREMENTAL and table.renderer.session.settings.nor <= 2
    user.release()
    user.frames(2)
    table.renderer.until(lambda frame: bool(frame.pictures[-1].replaced.any()))
    table.renderer.take_up()
    assert table.renderer.session.mode is INCREMENTAL and table.renderer.session.settings.nor == 8


def test_the_click_picks_what_is_there(table: Table) -> None:
    user = table.user
    user.editor.select(Selection())
    user.click_at(*user.at_picture(0.5, 0.55), 1)
    user.frames(2)
    assert user.editor.selection.names == ("red cube",)
    user.click_at(*user.at_picture(0.02, 0.02))
    user.frames(2)
    assert user.editor.selection.names == ()


def test_display_leaves_the_accumulation_alone(table: Table) -> None:
    session = table.renderer.session
    spp, image = session.spp().copy(), session.image().copy()
    for display in (
        DisplaySettings(exposure=3),
        DisplaySettings(curve="srgb", overlay="spp", tile_grid=True),
    ):
        table.user.editor.change_display(display)
        table.user.frames(2)
    assert table.renderer.view is not None and table.renderer.view.scene is table.user.scene
    np.testing.assert_array_equal(session.spp(), spp)
    np.testing.assert_array_equal(session.image(), image)


def test_a_paused_edit_waits(table: Table) -> None:
    table.user.run("Pause")
    table.user.editor.propose(table.user.scene.with_object("red cube", position=(0.4, 0.5, 0)), "Move")
    table.user.frames(2)
    frame = table.renderer.advance()
    assert frame is not None and frame.resting and table.renderer.advance() is None
    assert table.renderer.session.mode is INCREMENTAL
    before = table.renderer.session.image()
    table.user.run("Pause")
    table.renderer.until(lambda frame: not frame.resting and frame.pictures[-1].seconds > 0)
    assert (table.renderer.session.image() != before).any()


def test_a_new_document_starts_over(table: Table, tmp_path: Path) -> None:
    from incpt.formats import scene_save

    path = tmp_path / "other.toml"
    scene_save.save(SCENE.without_object("lamp"), path)
    mode, kept = mode_after(table, lambda user: files.open_file(user.editor, path))
    assert mode is BASE and not kept and table.renderer.view is not None
    table.settle()
    assert table.renderer.session.scene == table.user.scene
