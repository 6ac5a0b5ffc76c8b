"""The editor without a display: imgui with events by hand, a renderer that renders nothing, a clock by hand.

Nothing is drawn on a screen; widgets are found by the places that they note (`ui/widgets/places.py`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

if not os.environ.get("CI"):
    pytest.importorskip("imgui_bundle", reason="the editor's packages are not installed")

from imgui_bundle import imgui, implot

from incpt.render import tiles
from incpt.render.modes import Mode
from incpt.scene.image import Image
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.scene.texture import Bitmap
from incpt.scene.transform import Transform
from incpt.ui.commands import command, menus, table
from incpt.ui.editor import job
from incpt.ui.editor.document import Document
from incpt.ui.editor.editor import Editor
from incpt.ui.frame import take_frame
from incpt.ui.preferences import Preferences
from incpt.ui.rect import Rect
from incpt.ui.viewport.viewport import Viewport
from incpt.ui.widgets import places, theme
from incpt.ui.workspace import Workspace
from incpt.viewer.renderer import Message, Renderer
from incpt.viewer.view import Frame, Picture, View
from support.null_renderer import NullRenderer

job.QUICK_SECONDS = 60.0
"""Tests are about what is read and not about waiting for it, unless they say so."""
WINDOW = (1600, 3400)
"""Tall enough that no panel has to be scrolled."""
SECONDS_PER_FRAME = 1 / 60

_MODIFIERS = {"Ctrl": imgui.Key.mod_ctrl, "Shift": imgui.Key.mod_shift, "Alt": imgui.Key.mod_alt}


class Desk:
    """An editor with its panels, and a user before it who does one thing per frame."""

    def __init__(self, scene: Scene, preferences: Preferences, renderer: Renderer | None = None) -> None:
        self.seconds = 100.0
        self.null = NullRenderer()
        self._renderer: Renderer = renderer or self.null
        self.devices: list[str | None] = []
        """Those that renderers were opened on."""
        self.editor = Editor(Document(scene, name="test"), self._open, preferences, now=lambda: self.seconds)
        self.workspace = Workspace()
        self.viewport = Viewport()
        self.area: Rect[float] = Rect(0.0, 0.0, 1.0, 1.0)
        self.on_frame: Callable[[], object] = lambda: None
        self.frames(3)

    def _open(self, device: str | None) -> Renderer:
        self.devices.append(device)
        return self._renderer

    @property
    def scene(self) -> Scene:
        return self.editor.scene

    # ---------------------------------------------------------------------------------------- frames

    def frame(self, seconds: float = SECONDS_PER_FRAME) -> None:
        """What `App.frame` does, without a window."""
        self.editor.receive()
        self.begin(seconds)
        self.area = take_frame(self.editor, self.workspace, self.viewport)
        self.end()
        self.on_frame()

    def begin(self, seconds: float = SECONDS_PER_FRAME) -> None:
        """Begin a frame of imgui."""
        self.seconds += seconds
        io = imgui.get_io()
        io.display_size = imgui.ImVec2(*WINDOW)
        io.delta_time = seconds
        imgui.new_frame()

    @staticmethod
    def end() -> None:
        """End the frame that `begin` began."""
        imgui.render()
        acknowledge_textures()

    def frames(self, count: int) -> None:
        for _ in range(count):
            self.frame()

    def rest(self, seconds: float) -> None:
        """Nothing happens for so long."""
        self.frame(seconds)
        self.frame()

    # ----------------------------------------------------------------------------------------- mouse

    def place(self, name: str, across: float = 0.5) -> tuple[float, float]:
        """The middle of a widget, or a place that far from its left to its right."""
        rect = places.find(name)
        assert rect is not None, f"{name!r} is not shown; shown are {sorted(places.names())}"
        x, y = rect.left + across * rect.width, rect.middle[1]
        assert 0 <= x < WINDOW[0] and 0 <= y < WINDOW[1], f"{name!r} lies outside of the window"
        return x, y

    def height(self, name: str) -> float:
        """Of what is seen of a widget, points."""
        rect = places.find(name)
        assert rect is not None
        return rect.height

    def shows(self, name: str) -> bool:
        return places.find(name) is not None

    def at_picture(self, x: float, y: float) -> tuple[float, float]:
        """A point of the picture, in units of it."""
        picture = self.picture
        return picture.left + x * picture.width, picture.top + y * picture.height

    @property
    def picture(self) -> Rect[float]:
        rect = places.find("picture")
        assert rect is not None
        return rect

    def move(self, x: float, y: float) -> None:
        imgui.get_io().add_mouse_pos_event(x, y)
        self.frame()

    def press(self, button: int = 0) -> None:
        imgui.get_io().add_mouse_button_event(button, True)
        self.frame()

    def release(self, button: int = 0) -> None:
        imgui.get_io().add_mouse_button_event(button, False)
        self.frame()

    def click(self, name: str, button: int = 0) -> None:
        self.click_at(*self.place(name), button)

    def click_at(self, x: float, y: float, button: int = 0) -> None:
        self.rest(1.0)  # no double click with the one before
        self.move(x, y)
        self.frame()
        self.press(button)
        self.release(button)
        self.frames(2)  # places are those of the frame before

    def drag(self, name: str, dx: float, across: float = 0.5) -> None:
        self.drag_at(self.place(name, across), (dx, 0.0))

    def drag_at(
        self, start: tuple[float, float], by: tuple[float, float], *, button: int = 0, steps: int = 4
    ) -> None:
        self.hold_at(start, by, button=button, steps=steps)
        self.release(button)
        self.frame()

    def hold_at(
        self, start: tuple[float, float], by: tuple[float, float], *, button: int = 0, steps: int = 4
    ) -> None:
        """A drag that has not ended."""
        self.rest(1.0)
        self.move(*start)
        self.frame()
        self.press(button)
        for step in range(1, steps + 1):
            self.move(start[0] + by[0] * step / steps, start[1] + by[1] * step / steps)

    def wheel(self, turns: float) -> None:
        imgui.get_io().add_mouse_wheel_event(0.0, turns)
        self.frame()

    def wheel_at(self, name: str, turns: float) -> None:
        """Turn the wheel over a widget."""
        self.move(*self.place(name))
        self.wheel(turns)
        self.frames(2)

    # ------------------------------------------------------------------------------------------ keys

    def key(self, keys: str) -> None:
        """Press and release keys written like those of commands."""
        with self.held_keys(keys):
            pass
        self.frame()

    @contextmanager
    def held_keys(self, keys: str) -> Iterator[None]:
        *modifiers, last = keys.split("+")
        chord = [_MODIFIERS[name] for name in modifiers]
        if last in _MODIFIERS:
            chord.append(_MODIFIERS[last])
        else:
            chord.append(imgui.Key(menus.key_chord(last)))
        io = imgui.get_io()
        for one in chord:
            io.add_key_event(one, True)
        self.frame()
        yield
        for one in reversed(chord):
            io.add_key_event(one, False)
        self.frame()

    def write(self, text: str) -> None:
        """Type characters, one a frame."""
        for character in text:
            imgui.get_io().add_input_characters_utf8(character)
            self.frame()
        self.frame()

    def open_field(self, name: str, across: float = 0.5) -> None:
        """Double click: a number becomes a text that can be typed over."""
        self.rest(1.0)
        self.move(*self.place(name, across))
        for _ in range(2):
            self.press()
            self.release()

    def type(self, name: str, text: str, end: str = "Enter", across: float = 0.5) -> None:
        """Type a value into a field and end it by a key."""
        self.open_field(name, across)
        self.key("Ctrl+A")
        self.write(text)
        self.key(end)

    # -------------------------------------------------------------------------------------- editor

    def panel(self, name: str) -> None:
        """Bring a tab to the front."""
        self.begin()
        self.workspace.draw(self.editor)
        imgui.set_window_focus(name)
        self.end()
        self.frames(2)

    def run(self, name: str) -> None:
        """Run a command, in a frame of its own."""
        command.run(self.editor, table.command(name))
        self.frames(2)

    def choose(self, name: str, text: str) -> None:
        """Choose from a list that drops down."""
        self.click(name)
        self.frames(2)  # the list finds its place
        self.click(f"{name}: {text}")

    def texts(self) -> list[str]:
        """The notices that are shown."""
        return [notice.text for notice in self.editor.notices.said]

    @property
    def undo_count(self) -> int:
        """How many edits can be undone; leaves all as it is."""
        history = self.editor.document.history
        assert history.before is None
        count = 0
        while history.undo() is not None:
            count += 1
        for _ in range(count):
            history.redo()
        return count


@contextmanager
def desk(
    scene: Scene, preferences: Preferences | None = None, renderer: Renderer | None = None
) -> Iterator[Desk]:
    """A Desk in an imgui context of its own."""
    imgui.create_context()
    implot.create_context()
    io = imgui.get_io()
    io.set_ini_filename("")
    io.config_flags |= imgui.ConfigFlags_.docking_enable
    io.config_windows_move_from_title_bar_only = True
    io.config_drag_click_to_input_text = False
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    theme.load_font()
    theme.apply(1.0)
    try:
        yield Desk(scene, preferences or Preferences(), renderer)
    finally:
        for texture in imgui.get_platform_io().textures:
            texture.status = imgui.ImTextureStatus.destroyed
        implot.destroy_context()
        imgui.destroy_context()


def acknowledge_textures() -> None:
    """What a renderer of imgui has to do at least."""
    for texture in imgui.get_platform_io().textures:
        if texture.status in (imgui.ImTextureStatus.want_create, imgui.ImTextureStatus.want_updates):
            if texture.status == imgui.ImTextureStatus.want_create:
                texture.set_tex_id(1)
            texture.status = imgui.ImTextureStatus.ok
        elif texture.status == imgui.ImTextureStatus.want_destroy:
            texture.set_tex_id(0)
            texture.status = imgui.ImTextureStatus.destroyed


def flat(value: Any, place: str = "") -> dict[str, Any]:
    """Every number, text and array of a scene or of preferences by its place: "objects.cube.position.0"."""
    if isinstance(value, (Mesh, Image, Bitmap)) or value is None:
        return {place: value}
    parts: Iterator[tuple[str, Any]]
    if isinstance(value, Scene):
        # The active camera stands among all cameras too.
        others = {name: one for name, one in value.cameras.items() if name != value.camera_name}
        parts = ((f.name, others if f.name == "cameras" else getattr(value, f.name)) for f in fields(value))
    elif is_dataclass(value):
        parts = ((f.name, getattr(value, f.name)) for f in fields(value))
    elif isinstance(value, Mapping):
        parts = ((str(key), one) for key, one in value.items())
    elif isinstance(value, tuple):
        parts = ((getattr(one, "name", str(i)), one) for i, one in enumerate(value))
    else:
        return {place: value}
    found: dict[str, Any] = {}
    for name, one in parts:
        # The parts of a transform are found at the object, which has them by these names too.
        below = place if isinstance(one, Transform) else f"{place}.{name}" if place else name
        found.update(flat(one, below))
    return found


def state(editor: Editor) -> dict[str, Any]:
    """All that a widget may change: scene, preferences, and what steers the renderer."""
    return {
        **flat(editor.scene, "scene"),
        **flat(editor.preferences, "preferences"),
        "selection": editor.selection.names,
        **flat(editor.tool, "tool"),
        **flat(editor.control, "control"),
        "is_pinned": editor.rendering.is_pinned,
        "viewing": editor.viewing,
        "dialog": editor.dialog,
        "is_closing": editor.screen.is_closing,
        "notices": tuple(notice.text for notice in editor.notices.said),
    }


def changes(before: dict[str, Any], after: dict[str, Any]) -> set[str]:
    """The places whose value is another one, or that came or went."""
    gone = object()
    return {name for name in {**before, **after} if before.get(name, gone) != after.get(name, gone)}


def frame_of(view: View, mode: Mode = Mode.REFINE, spp: int = 4, error: float | None = None) -> Frame:
    """What a renderer would send: a grey picture."""
    grid = tiles.TileGrid(*view.size, view.scene.settings.tile_size)
    picture = Picture(
        image=np.full((view.size[1], view.size[0], 4), 0.5, np.float32),
        grid=grid,
        mode=mode,
        queue=np.arange(grid.count, dtype=np.int32),
        queue_done=2,
        tile_spp=np.full(grid.count, spp, np.int64),
        replaced=np.ones(grid.count, np.bool_),
        seconds=1.0,
        error=error,
        strategy=view.scene.settings.strategy,
    )
    pictures = (replace(picture, strategy="restart"), picture) if view.split else (picture,)
    return Frame(view, pictures, False, 0.02, 1e6, "a device", None, 0, 0.0, False)


def tell(user: Desk, *messages: Message) -> None:
    """The renderer says something."""
    user.null.messages += messages
    user.frames(3)  # a window that appears has its size and place in its second frame
