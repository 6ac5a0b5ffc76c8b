"""`incpt edit`: opens the window and runs the loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui, implot

from incpt.core.errors import OutputError
from incpt.ui import preferences
from incpt.ui.commands import files
from incpt.ui.display.display import Display
from incpt.ui.editor import recovery
from incpt.ui.editor.document import Document
from incpt.ui.editor.editor import Editor
from incpt.ui.frame import draw_picture, take_frame
from incpt.ui.panels import textures
from incpt.ui.rect import Rect
from incpt.ui.viewport.viewport import Viewport
from incpt.ui.window import Window
from incpt.ui.workspace import Workspace
from incpt.viewer.threaded import ThreadedRenderer
from incpt.viewer.view import Frame

_IDLE_SECONDS = 0.5
"""How long the loop sleeps without an event: notices go away and autosaves are made in between."""
_WAITING_SECONDS = 0.05
"""How long it sleeps while an entry of the history waits for a rest."""


class App:
    """The editor in its window. `turn` does one turn of the loop; the caller owns the loop. `shown_frame` is
    what is on the screen."""

    def __init__(self, document: Document, device: str | None = None, opened: Path | None = None) -> None:
        kept, complaints = preferences.load()
        self._has_window = False
        # The device is opened in the renderer's thread while the window opens in this one.
        self.editor = Editor(document, self._open_renderer, kept, device)
        self.editor.start_over(document, opened)
        self.editor.renderer.show(self.editor.view)
        try:
            self.window = Window(
                kept.window_size, "incpt", preferences.layout_path(), kept.ui_scale, kept.theme
            )
        except BaseException:
            self.editor.renderer.close()
            raise
        self._has_window = True
        implot.create_context()
        self.display = Display(self.window.context)
        self.workspace = Workspace()
        self.viewport = Viewport()
        self.recovery = recovery.Recovery(kept.autosave_seconds)
        for complaint in complaints:
            self.editor.say(complaint, "warning")
        self._area: Rect[float] = Rect(0.0, 0.0, 1.0, 1.0)
        self.shown_frame: Frame | None = None
        self._kept = kept
        files.offer_recovery(self.editor, self.recovery)
        if self.editor.dialog is None and files.has_missing(self.editor):
            files.find_missing(self.editor)

    def run(self) -> None:
        """The loop, until the window is closed."""
        try:
            while not self.editor.screen.is_closing:
                self.turn()
        finally:
            self.close()

    def turn(self) -> None:
        """Wait for something to happen, and draw a frame if it did."""
        editor = self.editor
        is_changing = editor.is_waiting or editor.notices.is_fading(editor.now())
        wait = 0.0 if editor.gesture.is_flying else _WAITING_SECONDS if is_changing else _IDLE_SECONDS
        is_due = self.window.wait(wait)
        if received := editor.receive():
            is_due = True
            # A picture moves no widget, so one frame is enough to show it.
            if not all(isinstance(message, Frame) for message in received):
                self.window.redraw()
        if is_due or is_changing:
            self.frame()
        self._autosave()

    def frame(self, is_swapped: bool = True) -> None:
        """Draw one frame and take its edits; `is_swapped` brings it to the screen."""
        editor, window = self.editor, self.window
        if window.wants_to_close:
            window.wants_to_close = False
            files.quit_(editor)
        for dropped in window.take_dropped():
            slot = textures.slot_at(dropped.x, dropped.y)
            editor.attempt(lambda path=dropped.path, slot=slot: files.drop(editor, path, slot))  # type: ignore[misc]
        if editor.frame is not None and editor.frame is not self.shown_frame:
            view = editor.frame.view
            region = None if view.region is None else Rect(*view.region)
            self.display.upload(editor.frame.pictures, editor.frame.first_hits, region, view.scene.camera)
            self.shown_frame = editor.frame
        window.begin_frame()
        self._area = take_frame(editor, self.workspace, self.viewport, self.display.overlay())
        window.set_title(editor.title)
        window.show_full_screen(editor.screen.is_full_screen)
        window.look(editor.preferences.ui_scale, editor.preferences.theme)
        self.recovery.seconds = editor.preferences.autosave_seconds
        window.end_frame(self._draw_below, is_swapped)
        self._keep_preferences()

    def close(self) -> None:
        """Stop the renderer, keep the preferences, close the window."""
        self.editor.renderer.close()
        self.recovery.remove()
        self.editor.preferences = self.editor.preferences.with_window_size(*self.window.size)
        self._keep_preferences()
        self.display.release()
        implot.destroy_context()
        self.window.close()

    def read_pixels(self) -> npt.NDArray[np.uint8]:
        """(H, W, 3) the frame drawn last, row 0 on top."""
        width, height = self.window.framebuffer_size
        # It draws a frame of its own, because what the back buffer holds is undefined after a swap.
        self.frame(is_swapped=False)
        # moderngl takes the screen for as large as it was at first.
        read = self.window.context.screen.read((0, 0, width, height), components=3, alignment=1)
        flat = np.frombuffer(read, np.uint8)
        return flat.reshape(height, width, 3)[::-1]

    def _open_renderer(self, device: str | None) -> ThreadedRenderer:
        return ThreadedRenderer(device, self._wake)

    def _wake(self) -> None:
        if self._has_window:
            Window.wake()

    def _draw_below(self) -> None:
        pixels = imgui.get_io().display_framebuffer_scale.x
        size = self.window.framebuffer_size
        draw_picture(self.editor, self.display, self._area, size, pixels)

    def _keep_preferences(self) -> None:
        if self.editor.preferences != self._kept and not imgui.is_any_item_active():
            self._kept = self.editor.preferences
            try:
                preferences.save(self._kept)
            except OutputError as error:
                self.editor.say(str(error), "warning")

    def _autosave(self) -> None:
        self.editor.attempt(lambda: self.recovery.update(self.editor.document, self.editor.now()))


def main(file: Path | None, device: str | None, options: Mapping[str, Any] = MappingProxyType({})) -> int:
    """The editor on a scene file or a mesh, by default on an example; returns the exit status. `options` are
    keywords of `registry.load_with_report`. Raises InputError for a file or a device that is not there,
    DeviceError where no window opens."""
    document = Document.example() if file is None else Document.open(file, **options)
    App(document, device, file).run()
    return 0
