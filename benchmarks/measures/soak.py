"""`incpt bench soak`: random actions on the editor's window, for minutes, beside a model of what they do.

The model is a list of scenes with a cursor, changed by plain functions of its own. After every action the
editor's scene has to equal the model's, and at rest the scene of the last frame; after a save the file has to
hold it. What an action changes by the mouse cannot be said in advance: there the model takes over the scene,
after a look that nothing else has changed.
"""

from __future__ import annotations

import contextlib
import math
import os
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from itertools import zip_longest
from pathlib import Path
from statistics import median
from typing import Annotated

import psutil
import typer

from incpt.benchmarks.kit import options
from incpt.benchmarks.kit.desktop import Hand, virtual_display
from incpt.formats import registry, scene_save
from incpt.scene.model import Object, Scene

SCREEN = (1000, 680)
WINDOW = (960, 640)
SIZE = (160, 96)
SHOWN_ACTIONS = 25
"""How many of the last actions are told where a check fails."""
MOST_OBJECTS = 40
GROWTH = 1.10
"""Memory of the last fifth may be so much that of the second minute."""


class SoakError(Exception):
    """The editor and the model differ, or memory grows."""


@dataclass
class Model:
    """What the editor has to hold."""

    scenes: list[Scene]
    cursor: int = 0

    @property
    def scene(self) -> Scene:
        return self.scenes[self.cursor]

    def push(self, scene: Scene) -> None:
        """An edit; one that changes nothing is none."""
        if scene != self.scene:
            self.scenes[self.cursor + 1 :] = [scene]
            self.cursor += 1


@dataclass
class Soak:
    """One run: the editor, its model, and what was counted."""

    hand: Hand
    model: Model
    file: Path
    random: random.Random
    counts: Counter[str] = field(default_factory=Counter)
    log: list[str] = field(default_factory=list)
    megabytes: list[tuple[float, float]] = field(default_factory=list)

    # ------------------------------------------------------------------------------------- one action

    def act(self) -> None:
        """A random action, and the checks after it."""
        self.do(self.random.choices(list(_ACTIONS), list(_ACTIONS.values()))[0])

    def do(self, action: Callable[[Soak], None]) -> None:
        """An action, and the checks after it."""
        name = action.__name__.strip("_")
        self.log.append(name)
        self.counts[name] += 1
        action(self)
        self.check()

    def warm_up(self) -> None:
        """Everything once, before memory is watched: kernels, a second session, first-hit images."""
        for action in _ACTIONS:
            self.do(action)
        for action in (_switch_split, _type_transform, _choose_overlay, _drag_transform, _switch_split):
            self.do(action)

    def check(self) -> None:
        """Wait until the editor rests, and compare."""
        editor = self.hand.app.editor
        self.hand.pump(lambda: editor.document.history.before is None, frames=1, timeout=20)
        if editor.dialog is not None:
            raise SoakError("a dialog is left open")
        if editor.scene != self.model.scene:
            raise SoakError(f"not what the model has: {_difference(editor.scene, self.model.scene)}")
        if editor.rendering.has_failed:
            raise SoakError(f"rendering stopped: {[one.text for one in editor.notices.said]}")
        if not editor.control.paused:
            self.hand.pump(self._is_shown, frames=0, timeout=60)

    def _is_shown(self) -> bool:
        frame = self.hand.app.editor.frame
        return frame is not None and frame.view.scene == self.hand.app.editor.view.scene

    def say(self, what: str) -> None:
        """More about the action in the log."""
        self.log[-1] += f" {what}"

    def take_over(self, allowed: Callable[[Scene, Scene], bool]) -> None:
        """Push what the mouse made of the scene, where only what is `allowed` has changed."""
        self.hand.pump(lambda: self.hand.app.editor.document.history.before is None, frames=2, timeout=20)
        new = self.hand.app.editor.scene
        if not allowed(self.model.scene, new):
            raise SoakError("an action changed what it must not")
        self.model.push(new)

    def select_one(self) -> str | None:
        """Select a random object of the outliner's first rows; None where there is none."""
        from incpt.ui.widgets import places

        # The outliner scrolls to what was selected last, which may be known only now.
        self.hand.show_tab("Object")
        names = [o.name for o in self.model.scene.objects if places.find(f"object {o.name}") is not None]
        if not names:
            return None
        name = self.random.choice(names)
        self.say(name)
        self.hand.click(f"object {name}")
        if self.hand.app.editor.selection.names != (name,):
            raise SoakError(f"a click in the outliner selects {self.hand.app.editor.selection.names}")
        return name


# ------------------------------------------------------------------------------------------- edits


def _type_transform(soak: Soak) -> None:
    name = soak.select_one()
    if name is None:
        return
    kind, axis = soak.random.choice(("Position", "Rotation")), soak.random.randrange(3)
    value = round(soak.random.uniform(-2, 2) if kind == "Position" else soak.random.uniform(-180, 180), 2)
    soak.say(f"{kind} {'XYZ'[axis]} {value}")
    soak.hand.type_into(f"{kind} {'XYZ'[axis]}", str(value))
    field = kind.lower()
    values = list(getattr(soak.model.scene.object(name), field))
    found = getattr(soak.hand.app.editor.scene.object(name), field)[axis]
    # Fields may hold single precision.
    values[axis] = found if math.isclose(found, value, rel_tol=1e-6, abs_tol=1e-6) else value
    soak.model.push(soak.model.scene.with_object(name, **{field: tuple(values)}))


def _type_nonsense(soak: Soak) -> None:
    if soak.select_one() is not None:
        soak.hand.type_into("Scale X", soak.random.choice(("0", "1e99", "nan", "x")))


def _drag_transform(soak: Soak) -> None:
    name = soak.select_one()
    if name is None:
        return
    x, y = soak.hand.middle(f"{soak.random.choice(('Position', 'Rotation'))} {soak.random.choice('XYZ')}")
    soak.hand.drag((x, y), (x + soak.random.randint(-60, 60), y + soak.random.randint(-9, 9)), steps=4)
    soak.take_over(lambda old, new: _others(old, (name,)) == _others(new, (name,)))


def _drag_gizmo(soak: Soak) -> None:
    from incpt.ui.widgets import places

    if soak.select_one() is None or places.find("gizmo") is None:
        return
    soak.hand.click("menu Edit")
    soak.hand.click(soak.random.choice(("Move handles", "Rotate handles", "Scale handles")))
    x, y = soak.hand.middle("gizmo")
    picture = soak.hand.place("picture")
    is_across = picture.left + 40 < x < picture.right - 120
    if not (is_across and picture.top + 40 < y < picture.bottom - 40):
        return
    names = soak.hand.app.editor.selection.names
    soak.hand.drag((x + 30, y), (x + soak.random.randint(40, 100), y + soak.random.randint(-30, 30)), steps=4)
    # Beside the handles it is a drag on the picture, which selects nothing and moves nothing.
    soak.take_over(lambda old, new: _others(old, names) == _others(new, names))


def _transform_by_keys(soak: Soak) -> None:
    """G, R or S with an axis, by the mouse or a typed number, and kept or given up."""
    name = soak.select_one()
    if name is None or not soak.model.scene.object(name).visible:
        return  # there is nothing to move, and X deletes
    operation, axis = soak.random.choice("grs"), soak.random.choice("xyz")
    number, end = soak.random.choice(("", "0.5", "1+0.25", "-0.75")), soak.random.choice(("Return", "Escape"))
    soak.say(f"{operation} {axis} {number} {end}")
    before, model = soak.hand.app.editor.scene, soak.model
    soak.hand.move(soak.hand.in_picture(0.6, 0.5))
    soak.hand.key(operation)
    soak.hand.move(soak.hand.in_picture(soak.random.uniform(0.3, 0.7), soak.random.uniform(0.3, 0.7)))
    soak.hand.key(axis)
    soak.hand.type(number)
    soak.hand.key(end)
    if end == "Escape":
        if soak.hand.app.editor.scene is not before:
            raise SoakError("a transform that was given up leaves another scene")
        return
    soak.take_over(lambda old, new: _others(old, (name,)) == _others(new, (name,)))
    if operation == "g" and number:
        wanted = list(before.object(name).position)
        wanted["xyz".index(axis)] += {"0.5": 0.5, "1+0.25": 1.25, "-0.75": -0.75}[number]
        if model.scene.object(name).position != tuple(wanted):
            raise SoakError(f"{name} is at {model.scene.object(name).position} instead of {wanted}")


def _drop(soak: Soak) -> None:
    name = soak.select_one()
    if name is None:
        return
    before = soak.model.scene.object(name)
    soak.hand.key("End")
    soak.take_over(lambda old, new: _others(old, (name,)) == _others(new, (name,)))
    after = soak.model.scene.object(name)
    if after.position[::2] != before.position[::2] or after.rotation != before.rotation:
        raise SoakError(f"{name} is dropped from {before.position} to {after.position}")


def _delete(soak: Soak) -> None:
    name = soak.select_one()
    if name is not None and len(soak.model.scene.objects) > 3:
        soak.hand.key(soak.random.choice(("Delete", "x")))
        kept = tuple(o for o in soak.model.scene.objects if o.name != name)
        soak.model.push(replace(soak.model.scene, objects=kept))


def _duplicate(soak: Soak) -> None:
    if len(soak.model.scene.objects) < MOST_OBJECTS and soak.select_one() is not None:
        count = len(soak.model.scene.objects)
        soak.hand.key("shift+d")
        soak.hand.key("Escape")  # the copy stays in its place
        soak.take_over(lambda old, new: new.objects[:count] == old.objects and len(new.objects) == count + 1)


def _add(soak: Soak) -> None:
    count = len(soak.model.scene.objects)
    if count < MOST_OBJECTS:
        soak.hand.click("menu Object")
        soak.hand.move(soak.hand.middle("menu Object/Add"))
        soak.hand.pump(frames=12)
        soak.hand.click(soak.random.choice(("Cube", "Sphere", "Plane", "Cylinder")))
        soak.take_over(lambda old, new: new.objects[:count] == old.objects and len(new.objects) == count + 1)


def _hide_or_show(soak: Soak) -> None:
    name = soak.select_one()
    if name is not None:
        soak.hand.click(f"visible {name}")
        soak.model.push(soak.model.scene.with_object(name, visible=not soak.model.scene.object(name).visible))


def _rename(soak: Soak) -> None:
    name = soak.select_one()
    if name is not None:
        new = f"object {soak.random.randrange(10**6)}"
        soak.hand.key("F2")
        soak.hand.type(new)
        soak.hand.key("Return")
        objects = tuple(replace(o, name=new) if o.name == name else o for o in soak.model.scene.objects)
        soak.model.push(replace(soak.model.scene, objects=objects))


def _move_camera(soak: Soak) -> None:
    start = soak.hand.in_picture(soak.random.uniform(0.2, 0.8), soak.random.uniform(0.1, 0.9))
    end = soak.hand.in_picture(soak.random.uniform(0.2, 0.8), soak.random.uniform(0.1, 0.9))
    held = soak.random.choice(("", "shift"))
    with soak.hand.holding(held) if held else contextlib.nullcontext():
        soak.hand.drag(start, end, button=2, steps=4)
    soak.take_over(lambda old, new: replace(new, camera=old.camera) == old)


def _wheel(soak: Soak) -> None:
    soak.hand.click(soak.hand.in_picture(soak.random.random(), 0.5), button=soak.random.choice((4, 5)))
    soak.take_over(lambda old, new: replace(new, camera=old.camera) == old)


def _undo_redo(soak: Soak) -> None:
    for _ in range(soak.random.randint(1, 6)):
        model = soak.model
        if soak.random.random() < 0.65:
            soak.hand.key("ctrl+z")
            model.cursor = max(model.cursor - 1, 0)
        else:
            soak.hand.key("ctrl+shift+z")
            model.cursor = min(model.cursor + 1, len(model.scenes) - 1)


# --------------------------------------------------------------------------------- what changes no scene


def _pick(soak: Soak) -> None:
    from incpt.ui.widgets import places

    button = soak.random.choice((1, 3))
    soak.hand.click(soak.hand.in_picture(soak.random.random() * 0.99, soak.random.random() * 0.99), button)
    soak.hand.pump(frames=12)  # until the renderer has said what is there
    soak.take_over(lambda old, new: old == new)
    if button == 3:
        # On what is selected it opens a menu, once the renderer has said what is there.
        soak.hand.pump(lambda: soak.hand.app.editor.screen.menu_point is None, timeout=20)
        if "Rename…" in places.names():
            soak.hand.key("Escape")


def _press_key(soak: Soak) -> None:
    key = soak.random.choice(("F5", "F6", "F7", "F8", "F9", "Escape", "a", "ctrl+r", "comma", "shift+Tab"))
    soak.say(key)
    soak.hand.key(key)


def _switch_split(soak: Soak) -> None:
    soak.hand.key("F6")


def _choose_overlay(soak: Soak) -> None:
    from incpt.ui.panels.display import OVERLAY_TEXTS

    soak.hand.show_tab("Method")
    overlay = soak.random.choice(list(OVERLAY_TEXTS.values()))
    soak.say(overlay)
    soak.hand.click("Overlay")
    soak.hand.click(f"Overlay: {overlay}")
    soak.hand.show_tab("Object")


def _draw_region(soak: Soak) -> None:
    """A part of the picture alone, or all of it again."""
    if soak.hand.app.editor.viewing.region is not None:
        soak.hand.key("ctrl+alt+b")
        return
    soak.hand.key("ctrl+b")
    ends = [(soak.random.uniform(0.05, 0.45), soak.random.uniform(0.55, 0.95)) for _ in range(2)]
    start, end = (soak.hand.in_picture(*corner) for corner in zip(*ends, strict=True))
    soak.hand.drag(start, end, steps=3)


def _shade(soak: Soak) -> None:
    from incpt.ui.panels.display import SHADING_TEXTS

    text = soak.random.choice(list(SHADING_TEXTS.values()))
    soak.say(text)
    soak.hand.show_tab("Method")
    soak.hand.click("Shading")
    soak.hand.click(f"Shading: {text}")
    soak.hand.show_tab("Object")


def _leave_alone(soak: Soak) -> None:
    """The picture has the window, and gives it back."""
    for _ in range(2):
        soak.hand.key("ctrl+space")


def _switch_local(soak: Soak) -> None:
    soak.hand.key("slash")


def _click_axis(soak: Soak) -> None:
    from incpt.ui.widgets import places

    side = soak.random.choice(("front", "back", "left", "right", "top", "bottom"))
    if places.find(f"axis {side}") is not None:
        soak.hand.click(f"axis {side}")


def _render_picture(soak: Soak) -> None:
    """A final render of a few samples beside all else, whose file is whole."""
    path, editor = soak.file.with_name("final.exr"), soak.hand.app.editor
    path.unlink(missing_ok=True)
    soak.hand.key("F12")
    soak.hand.type_into("File", str(path))
    soak.hand.type_into("Samples", "2")
    soak.hand.click("Render")
    soak.hand.pump(lambda: path.exists() and editor.rendering.final is None, timeout=60)


def _open_menus(soak: Soak) -> None:
    soak.hand.click(f"menu {soak.random.choice(('File', 'Edit', 'View', 'Render', 'Help'))}")
    soak.hand.key("Escape")


def _show_help(soak: Soak) -> None:
    soak.hand.key("F1")
    soak.hand.key("Escape")


# ---------------------------------------------------------------------------------------------- files


def _save(soak: Soak) -> None:
    soak.hand.key("ctrl+s")
    soak.hand.pump(frames=2)
    if registry.load(soak.file) != soak.model.scene:
        raise SoakError("the saved file does not hold the model's scene")


def _open(soak: Soak) -> None:
    editor = soak.hand.app.editor
    is_dirty = editor.document.is_dirty
    soak.hand.key("ctrl+o")
    if is_dirty:
        soak.hand.click("Do not save")
    soak.hand.type_into("Path", str(soak.file))
    soak.hand.pump(lambda: not editor.jobs)
    soak.model = Model([registry.load(soak.file)])


def _export(soak: Soak) -> None:
    path = soak.file.with_name(f"picture{soak.random.choice(('.exr', '.png'))}")
    path.unlink(missing_ok=True)
    soak.hand.key("ctrl+e")
    soak.hand.type_into("Path", str(path))
    editor = soak.hand.app.editor
    soak.hand.pump(lambda: path.exists() or bool(editor.rendering.waiting), timeout=60)
    if not path.exists():
        # What is left of an edit takes minutes, and forever where rendering is paused.
        soak.hand.click("Take it as it is")
    soak.hand.pump(path.exists, timeout=60)


_ACTIONS: dict[Callable[[Soak], None], float] = {
    _type_transform: 10, _type_nonsense: 2, _drag_transform: 8, _drag_gizmo: 8, _transform_by_keys: 8,
    _drop: 2, _delete: 2, _duplicate: 2,
    _add: 2, _hide_or_show: 4, _rename: 1, _move_camera: 6, _wheel: 3, _undo_redo: 8, _pick: 8, _press_key: 8,
    _choose_overlay: 3, _draw_region: 3, _shade: 3, _leave_alone: 1, _switch_local: 2,
    _click_axis: 1, _render_picture: 0.5, _open_menus: 2, _show_help: 1, _save: 3, _open: 1, _export: 0.5,
}  # fmt: skip
"""How often each comes, beside the others."""


def _difference(found: Scene, expected: Scene) -> str:
    """In words, the first few objects, or the part of the scene."""
    pairs = zip_longest(found.objects, expected.objects)
    objects = [f"{_described(a)} instead of {_described(b)}" for a, b in pairs if a != b]
    parts = [name for name in ("camera", "environment", "materials", "settings")
             if getattr(found, name) != getattr(expected, name)]  # fmt: skip
    return "; ".join(objects[:3] + parts)


def _described(obj: Object | None) -> str:
    return (
        "nothing"
        if obj is None
        else f"{obj.name} at {obj.position}, {obj.rotation}, {obj.scale}, {obj.visible}"
    )


def _others(scene: Scene, names: tuple[str, ...]) -> Scene:
    """The scene without the places of some objects, to compare the rest."""
    for name in names:
        scene = scene.with_object(name, position=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1))
    return scene


# ------------------------------------------------------------------------------------------ the command


@contextlib.contextmanager
def opened(seed: int) -> Iterator[Soak]:
    """The editor on a small copy of the example, in a folder that goes away."""
    with tempfile.TemporaryDirectory() as folder, virtual_display(SCREEN):
        os.environ["INCPT_CONFIG_DIR"] = str(Path(folder) / "configuration")
        from incpt.ui import preferences
        from incpt.ui.app import App
        from incpt.ui.dialogs import native
        from incpt.ui.editor.document import Document

        # The system's dialogs are windows of other programs, which this hand does not reach.
        native.is_there = lambda: False
        preferences.save(preferences.Preferences(window_size=WINDOW, ui_scale=1.0))
        file = Path(folder) / "scene.toml"
        with as_file(files("incpt.scenes") / "editing.toml") as path:
            scene = registry.load(path)
        scene_save.save(replace(scene, settings=replace(scene.settings, size=SIZE, nor=32)), file)
        document = Document.open(file)
        app = App(document)
        try:
            hand = Hand(app)
            hand.pump(lambda: app.editor.frame is not None)
            yield Soak(hand, Model([document.scene]), file, random.Random(seed))
        finally:
            app.close()
            del os.environ["INCPT_CONFIG_DIR"]


def soak(
    minutes: Annotated[float, typer.Option(help="How long.", min=0.1)] = 10.0,
    seed: Annotated[int, typer.Option(help="Chooses the actions.")] = 0,
    output: options.OutputOption = options.DEFAULT_FOLDER,
) -> None:
    """Work the editor at random beside a model of it; fails where an edit is lost or memory grows."""
    for module in ("imgui_bundle", "glfw", "moderngl"):
        options.optional(module, "soak", "ui")
    with opened(seed) as run:
        start = time.monotonic()
        try:
            run.warm_up()
            while time.monotonic() - start < 60 * minutes:
                run.act()
                run.megabytes.append((time.monotonic() - start, psutil.Process().memory_info().rss / 2**20))
            _check_memory(run.megabytes)
        except Exception:
            traceback.print_exc()
            output.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(Exception):
                run.hand.screenshot(output / "soak.png")
            last = ", ".join(run.log[-SHOWN_ACTIONS:])
            print(f"seed {seed}, action {len(run.log)}; the last: {last}", file=sys.stderr)
            raise typer.Exit(1) from None
        finally:
            print(*_figures(run, time.monotonic() - start), sep="\n")


def _check_memory(megabytes: list[tuple[float, float]]) -> None:
    """Flat after the first minute: the last fifth against the second minute."""
    end = megabytes[-1][0]
    early = [size for at, size in megabytes if 60 <= at < 120]
    late = [size for at, size in megabytes if at >= 0.8 * end]
    if end >= 180 and median(late) > GROWTH * median(early):
        raise SoakError(f"memory grew from {median(early):.0f} MB to {median(late):.0f} MB")


def _figures(run: Soak, seconds: float) -> list[str]:
    """Lines for the terminal."""
    lines = [f"{sum(run.counts.values())} actions in {seconds / 60:.1f} minutes: "
             + ", ".join(f"{name} {count}" for name, count in run.counts.most_common())]  # fmt: skip
    if run.megabytes:
        moments = [(m, [s for at, s in run.megabytes if 60 * m <= at < 60 * (m + 1)])
                   for m in range(int(seconds / 60) + 1)]  # fmt: skip
        lines.append("memory by minute, MB: " + ", ".join(f"{median(s):.0f}" for _, s in moments if s))
    return lines
