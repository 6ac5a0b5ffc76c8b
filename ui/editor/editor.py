"""The editor's state, and what one frame does with it. It knows no window and no OpenGL.

A frame has three parts. `receive` takes what the renderer has to tell. Panels, viewport and keys then call
`propose` with whole scenes: each starts from the scene that the one before it left, so that all edits of a
frame become one. `settle` ends the frame: it closes the entry of the history when nothing is being dragged,
and shows the renderer what is to be seen now.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from incpt.core.errors import DeviceError, InputError, OutputError, one_line
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui.display.overlays import NEEDS_AOVS
from incpt.ui.editor.document import Document
from incpt.ui.editor.messages import Messages
from incpt.ui.preferences import DisplaySettings, Preferences, SnapSettings
from incpt.viewer.threaded import Building, Exported, Message, Picked, Problem, Renderer, Restart
from incpt.viewer.viewer import Frame, View

if TYPE_CHECKING:
    from incpt.ui.dialogs.dialogs import Dialog
    from incpt.ui.panels.render import Control

ZOOM_REST_SECONDS = 0.4
"""Turns of the wheel closer together than this are one entry of the history."""
OpenRenderer = Callable[[str | None], Renderer]


@dataclass(frozen=True)
class Tool:
    """The gizmo: `operation` is move, rotate or scale; `space` is world or local."""

    operation: str = "move"
    space: str = "world"


class Editor:
    """Everything between the user and the renderer. `open_renderer` makes one for a device, given by name or
    None for the default; `now` is a clock in seconds."""

    def __init__(
        self,
        document: Document,
        open_renderer: OpenRenderer,
        preferences: Preferences,
        device: str | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.document = document
        self.device = device
        self._open_renderer = open_renderer
        self.renderer = open_renderer(device)
        self.preferences = preferences
        self.now = now
        self.selection = Selection()
        self.tool = Tool()
        self.messages = Messages(now)
        self.dialog: Dialog | None = None
        self.frame: Frame | None = None
        self.building: Building | None = None
        self.paused = False
        self.target_spp: int | None = None
        self.is_pinned = False
        self.point: tuple[float, float] | None = None
        self.device_failed = False
        self.viewport_size: tuple[int, int] | None = None
        self.is_closing = False
        self.asked_layout_reset = False
        self.is_flying = False
        self._hold_until = 0.0
        self._is_held = False
        self._has_cancelled = False

    # ---------------------------------------------------------------------------------- the scene

    @property
    def scene(self) -> Scene:
        """The scene as it is edited now."""
        return self.document.history.scene

    def propose(
        self,
        scene: Scene,
        label: str,
        key: str | None = None,
        *,
        selection: Selection | None = None,
        rest_seconds: float = 0.0,
    ) -> None:
        """Make `scene` the current one. Proposals under one `key` are one entry of the history until a frame
        ends in which nothing is held; `rest_seconds` keeps the entry open that long (turns of a wheel)."""
        if scene is self.scene:
            return
        after = self.selection if selection is None else selection
        self.document.history.propose(
            scene, label, key, selection=self.selection.names, selection_after=after.within(scene).names
        )
        self.selection = after.within(scene)
        self._hold_until = self.now() + rest_seconds

    def attempt(self, action: Callable[[], object]) -> bool:
        """Run `action`; what it refuses becomes a message, and everything stays as it was."""
        try:
            action()
        except (InputError, OutputError, DeviceError) as error:
            self.messages.add(one_line(str(error)), "error")
            return False
        return True

    def undo(self) -> None:
        """Take back the last edit; a drag under way is given up."""
        self._has_cancelled |= self.document.history.before is not None
        self._restore_selection(self.document.history.undo())

    def redo(self) -> None:
        """Do again what was taken back; a drag under way is ended."""
        self._has_cancelled |= self.document.history.before is not None
        self._restore_selection(self.document.history.redo())

    def cancel(self) -> None:
        """Escape: give up the drag under way, else the selection."""
        if self.document.history.before is not None:
            self.document.history.cancel()
            self._hold_until = 0.0
            self._has_cancelled = True
        elif self.selection:
            self.select(Selection())

    def take_cancelled(self) -> bool:
        """Whether a drag was given up since the last call: whoever holds it lets go."""
        has_cancelled, self._has_cancelled = self._has_cancelled, False
        return has_cancelled

    def select(self, selection: Selection) -> None:
        """Another selection; not an edit."""
        self.selection = selection.within(self.scene)

    def _restore_selection(self, names: tuple[str, ...] | None) -> None:
        if names is not None:
            self.selection = Selection(names).within(self.scene)

    # ------------------------------------------------------------------------------- what is shown

    @property
    def view(self) -> View:
        """What the renderer is to show."""
        display = self.preferences.display
        return View(
            scene=self.scene,
            before=self.document.history.before,
            point=self.point,
            resolution_scale=self.preferences.resolution_scale,
            paused=self.paused,
            target_spp=self.target_spp,
            step_ms=self.preferences.step_ms,
            drag_nor=self.preferences.drag_nor,
            split=display.split,
            aovs=display.overlay in NEEDS_AOVS,
        )

    def change_display(self, display: DisplaySettings) -> None:
        """Show the picture otherwise; nothing is rendered anew."""
        if display != self.preferences.display:
            self.preferences = replace(self.preferences, display=display)

    def change_snap(self, snap: SnapSettings) -> None:
        """Other steps of the gizmo."""
        if snap != self.preferences.snap:
            self.preferences = replace(self.preferences, snap=snap)

    def choose_navigation(self, navigation: str) -> None:
        """One of the two sets of keys and moves of the mouse."""
        if navigation != self.preferences.navigation:
            self.preferences = replace(self.preferences, navigation=navigation)

    def steer(self, control: Control) -> None:
        """Pause, aim and resolution of rendering. Raises InputError."""
        self.paused, self.target_spp = control.paused, control.target_spp
        changed = replace(
            self.preferences,
            resolution_scale=control.resolution_scale,
            step_ms=control.step_ms,
            drag_nor=control.drag_nor,
        )
        if changed != self.preferences:
            self.preferences = changed

    def restart(self) -> None:
        """Render the picture from nothing; where the device failed, open it again first."""
        if self.device_failed:
            self.change_device(self.device)
        else:
            self.renderer.request(Restart())

    def change_device(self, device: str | None) -> None:
        """Render on another device from now on. The last picture stays until that one has one."""
        self.renderer.close()
        self.device, self.device_failed, self.is_pinned = device, False, False
        self.renderer = self._open_renderer(device)
        self.renderer.show(self.view)

    # ----------------------------------------------------------------------------------- one frame

    def receive(self) -> list[Message]:
        """Take the renderer's messages, and return them."""
        messages = self.renderer.poll()
        for message in messages:
            match message:
                case Frame():
                    self.frame, self.building = message, None
                    self.is_pinned = message.is_pinned
                case Building():
                    self.building = message if message.done < message.total else None
                case Picked():
                    self._picked(message)
                case Exported():
                    self.messages.add(f"{message.path} is written", "done")
                case Problem():
                    self.device_failed |= message.fatal
                    self.messages.add(message.text, "error")
        return messages

    def settle(self, is_held: bool) -> None:
        """End a frame; `is_held` tells whether a widget, the gizmo or the camera is being dragged."""
        if not is_held and self.now() >= self._hold_until:
            self.document.history.settle()
        self._is_held = is_held
        self.selection = self.selection.within(self.scene)
        self.renderer.show(self.view)

    @property
    def is_waiting(self) -> bool:
        """Whether a frame is due soon without an event: the camera flies, or an entry of the history waits
        for a rest."""
        return self.is_flying or (self.document.history.before is not None and not self._is_held)

    def _picked(self, picked: Picked) -> None:
        self.select(self.selection.clicked(picked.name, picked.additive))

    # --------------------------------------------------------------------------------------- files

    def start_over(self, document: Document, opened: Path | None = None) -> None:
        """Edit another document from now on."""
        self.document = document
        self.select(Selection())
        self.point = None
        for warning in document.warnings:
            self.messages.add(warning, "warning")
        if opened is not None:
            self.preferences = self.preferences.with_recent(opened)

    @property
    def title(self) -> str:
        """The title of the window."""
        return f"{self.document.title} - incpt"
