"""The editor's state, and what one frame does with it. It knows no window and no OpenGL.

A frame has three parts. `receive` takes what the renderer has to tell. Panels, viewport and keys then call
`propose` with whole scenes: each starts from the scene that the one before it left, so that all edits of a
frame become one. `settle` ends the frame: it closes the entry of the history when nothing is being dragged,
and shows the renderer what is to be seen now.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from incpt.core.errors import DeviceError, InputError, OutputError, one_line
from incpt.picture import denoise
from incpt.scene import edits, placing, summary
from incpt.scene.camera import Camera
from incpt.scene.edits import Copied
from incpt.scene.light import DIRECTED
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui import saved_views
from incpt.ui.display.overlays import NEEDS_FIRST_HITS
from incpt.ui.editor import clipboard, job
from incpt.ui.editor.dialog import Answer, Dialog
from incpt.ui.editor.document import Document
from incpt.ui.editor.job import Job
from incpt.ui.editor.notices import Notices
from incpt.ui.editor.state import Beginning, Control, Gesture, Rendering, Screen, Tool
from incpt.ui.editor.viewing import ShownScenes, Viewing, region_of
from incpt.ui.preferences import DisplaySettings, Preferences, SnapSettings
from incpt.ui.rect import Point, Rect
from incpt.viewer.renderer import (
    CopiedPicture,
    Exported,
    Message,
    Pick,
    PickBox,
    Picked,
    PickedBox,
    PickedPlace,
    PickPlace,
    Problem,
    Renderer,
    Restart,
)
from incpt.viewer.view import Frame, View

OpenRenderer = Callable[[str | None], Renderer]
"""Opens a renderer on a device, given by name or None for the default."""

_REFUSALS = (InputError, OutputError, DeviceError)
"""What an action raises where it refuses: these become notices, anything else is a fault of the program."""


class Editor:
    """Everything between the user and the renderer. `now` is a clock in seconds."""

    def __init__(
        self,
        document: Document,
        open_renderer: OpenRenderer,
        preferences: Preferences,
        device: str | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.now = now
        self._open_renderer = open_renderer
        self.renderer = open_renderer(device)
        self.document = document
        self.selection = Selection()
        self.copied = Copied()
        self.preferences = preferences
        self.tool = Tool()
        self.control = Control(device=device)
        self.rendering = Rendering()
        self.gesture = Gesture()
        self.screen = Screen()
        self.notices = Notices()
        self.dialog: Dialog | None = None
        self.viewing = Viewing()
        self._before_move: Viewing | None = None
        """Where the view was before the move of it that is under way."""
        self.jobs: tuple[Job, ...] = ()
        self._shown = ShownScenes()
        self._lit: tuple[Scene, bool] | None = None
        """The last scene that was asked whether anything shines in it, and whether it does."""

    # ---------------------------------------------------------------------------------- the scene

    @property
    def scene(self) -> Scene:
        """The scene as it is edited now."""
        return self.document.history.scene

    @property
    def shown(self) -> Scene:
        """The same scene as it is looked at; see `viewing`. What is made of it can be proposed as well."""
        return self._shown.of(self.scene, self.viewing.camera)

    @property
    def seen(self) -> Scene:
        """The scene as it is looked at, without what a local view leaves out."""
        return self._shown.rendered(self.shown, None, self.viewing.local)

    @property
    def has_light(self) -> bool:
        """Whether anything shines in the scene."""
        if self._lit is None or self._lit[0] is not self.scene:
            self._lit = self.scene, summary.has_light(self.scene)
        return self._lit[1]

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
        ends in which nothing is held; `rest_seconds` keeps the entry open that long (turns of a wheel). A
        change of the active camera is seen: the view goes back to it."""
        old = self.scene
        scene = self._shown.edited(scene, self.viewing.camera, old.camera)
        if scene is old:
            return
        after = self.selection if selection is None else selection
        self.document.history.propose(
            scene, label, key, selection=self.selection.names, selection_after=after.within(scene).names
        )
        self.selection = after.within(scene)
        self.gesture = replace(self.gesture, rest_until=self.now() + rest_seconds)
        self._follow_camera(old)

    def look(self, camera: Camera, label: str, key: str | None = None, rest_seconds: float = 0.0) -> None:
        """Look at the scene by another camera. This is no edit, unless the view is locked to the active
        camera; `label`, `key` and `rest_seconds` are those of `propose`."""
        if camera == self.shown.camera:
            return
        if self.viewing.is_locked and not self.viewing.is_free:
            scene = replace(self.scene, camera=camera)
            self.propose(scene, label, key, rest_seconds=rest_seconds)
            return
        if key is not None and self._before_move is None:
            self._before_move = self.viewing
        self.viewing = self.viewing.moved(camera)
        self.gesture = replace(self.gesture, rest_until=self.now() + rest_seconds)

    def look_through_camera(self) -> None:
        """See the scene through its active camera."""
        self.viewing = self.viewing.through_camera()

    def _follow_camera(self, old: Scene) -> None:
        if self.scene.camera != old.camera:
            self.look_through_camera()

    def attempt(self, action: Callable[[], object]) -> bool:
        """Run `action`; what it refuses becomes a notice, and everything stays as it was."""
        try:
            action()
        except _REFUSALS as error:
            self.say(one_line(str(error)), "error")
            return False
        return True

    def answer(self, answer: Answer) -> None:
        """Put the open dialog away and do what was chosen in it; see `Answer`."""
        self.dialog = None
        try:
            following = answer.action()
        except _REFUSALS as error:
            reason = one_line(str(error))
            if answer.explain is None:
                self.say(reason, "error")
            else:
                answer.explain(reason)
            following = answer.again
        if self.dialog is None:
            self.dialog = following

    def begin_job(self, label: str, work: Callable[[], Any], then: Callable[[Any], object]) -> None:
        """Do `work` in a thread, and then in a frame to come `then` with what it gives; at once where it
        takes no time. Raises what either raises then."""
        begun = Job(label, work, then)
        if begun.wait(job.QUICK_SECONDS):
            begun.finish()
        else:
            self.jobs = (*self.jobs, begun)

    def give_up_job(self, given_up: Job) -> None:
        """Let nothing come of a job."""
        self.jobs = tuple(one for one in self.jobs if one is not given_up)

    def say(self, text: str, level: str) -> None:
        """Show a notice; `level` is one of notices.LEVELS."""
        self.notices = self.notices.with_notice(text, level, self.now())

    def undo(self) -> None:
        """Take back the last edit; a drag under way is given up."""
        self._end_drag()
        old = self.scene
        self._restore_selection(self.document.history.undo())
        self._follow_camera(old)

    def redo(self) -> None:
        """Do again what was taken back; a drag under way is ended."""
        self._end_drag()
        old = self.scene
        self._restore_selection(self.document.history.redo())
        self._follow_camera(old)

    def cancel_drag(self) -> bool:
        """Give up the drag under way; returns whether there was one."""
        if not self._is_dragging:
            return False
        if self._before_move is not None:
            self.viewing = self._before_move
        self._end_drag()
        self.document.history.cancel()
        return True

    def select(self, selection: Selection) -> None:
        """Another selection; not an edit."""
        self.selection = selection.within(self.scene)

    def begin(self, action: str, label: str) -> None:
        """Begin something in the picture in this frame; see Beginning."""
        self.gesture = replace(self.gesture, beginning=Beginning(action, label))

    def pick(self, pick: Pick, wants_menu: bool = False) -> None:
        """Ask which object is at a point of the picture, to select it, or where `wants_menu` and it is
        selected, to open its menu; an edit to come starts there. What lies beside a region is not seen."""
        point = self._in_region(pick.point)
        if not Rect(0.0, 0.0, 1.0, 1.0).contains(point):
            return
        self.control = replace(self.control, point=point)
        self.screen = replace(self.screen, menu_point=point if wants_menu else None)
        self.renderer.request(replace(pick, point=point))

    def pick_box(self, box: PickBox) -> None:
        """Ask which objects are seen in a box of the picture, to select them."""
        low, high = self._in_region(box.low), self._in_region(box.high)
        self.renderer.request(replace(box, low=low, high=high))

    def drop_material(self, material: str, point: tuple[float, float]) -> None:
        """Give a material to the object that is at a point of the picture."""
        point = self._in_region(point)
        self.screen = replace(self.screen, dropped=(material, point))
        self.renderer.request(Pick(point))

    def aim(self, point: Point) -> None:
        """Turn the selected lights to what is seen at a point of the picture."""
        self.renderer.request(PickPlace(self._in_region(point)))

    def show_region(self, box: Rect[float] | None) -> None:
        """Render a region of the picture alone from now on, given in units of it; None: all of it."""
        region = None if box is None else region_of(box, self.scene.settings.size)
        if box is not None and region is None:
            self.say("The region is too small; draw it larger", "warning")
            return
        self.control = replace(self.control, point=None)
        self.viewing = replace(self.viewing, region=region)

    @property
    def region(self) -> Rect[float] | None:
        """The part of the picture that alone is rendered, in units of it; None: all of it is. A split view
        and shading show all of it."""
        is_whole = self.preferences.display.split or not self.is_rendered
        return None if is_whole else self.viewing.region

    @property
    def is_rendered(self) -> bool:
        """Whether the rendered picture is shown, and not the scene shaded by OpenGL."""
        return self.preferences.display.shading == "rendered"

    def _in_region(self, point: Point) -> Point:
        """A point of the picture in units of what is rendered of it."""
        return point if self.region is None else self.region.relative(point)

    def open_menu(self, name: str) -> None:
        """Open a menu at the mouse in the next frame."""
        self.screen = replace(self.screen, wanted_menu=name)

    def _end_drag(self) -> None:
        if self._is_dragging:
            self.gesture = replace(self.gesture, is_cancelled=True)
        self._before_move = None

    @property
    def _is_dragging(self) -> bool:
        """Whether an entry of the history is open, or the view is being moved."""
        return self.document.history.before is not None or self._before_move is not None

    def _restore_selection(self, names: tuple[str, ...] | None) -> None:
        if names is not None:
            self.selection = Selection(names).within(self.scene)

    # ------------------------------------------------------------------------------- what is shown

    @property
    def frame(self) -> Frame | None:
        """The renderer's latest frame; None before the first."""
        return self.rendering.frame

    @property
    def view(self) -> View:
        """What the renderer is to show."""
        display, region, before = self.preferences.display, self.region, self._shown_before
        return View(
            scene=self._shown.rendered(self.shown, region, self.viewing.local),
            before=None if before is None else self._shown.rendered(before, region, self.viewing.local),
            point=self.control.point,
            resolution_scale=self.preferences.resolution_scale,
            # While the scene is shaded the device rests, but for what waits for the whole picture.
            paused=self.control.paused or not (self.is_rendered or self.rendering.waiting),
            target_spp=self.control.target_spp,
            step_ms=self.preferences.step_ms,
            drag_nor=self.preferences.drag_nor,
            split=display.split,
            first_hits=display.overlay in NEEDS_FIRST_HITS and self.is_rendered,
            denoise=display.denoise and denoise.is_available(),
            region=None if region is None else (region.left, region.top, region.width, region.height),
        )

    @property
    def _shown_before(self) -> Scene | None:
        """The scene before what is dragged, as it was shown; None: nothing is."""
        if self._before_move is not None:
            return self._shown.of(self.scene, self._before_move.camera)
        before = self.document.history.before
        return None if before is None else self._shown.of(before, self.viewing.camera)

    def resize_viewport(self, size: tuple[int, int] | None) -> None:
        """The panels leave so many pixels for the picture; None where that is too little for one."""
        if size != self.screen.viewport_size:
            self.screen = replace(self.screen, viewport_size=size)

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

    def restart(self) -> None:
        """Render the picture from nothing; where the device failed, open it again first."""
        if self.rendering.has_failed:
            self.change_device(self.control.device)
        else:
            self.renderer.request(Restart())

    def change_device(self, device: str | None) -> None:
        """Render on another device from now on. The last picture stays until that one has one; a final render
        under way is given up."""
        self.renderer.close()
        if self.rendering.final is not None:
            self.say(f"{self.rendering.final.path}: is given up with its device; render it again", "warning")
        self.control = replace(self.control, device=device)
        self.rendering = replace(
            self.rendering, is_pinned=False, is_stale=False, waiting=(), final=None, has_failed=False
        )
        self.renderer = self._open_renderer(device)
        self.renderer.show(self.view)

    # ----------------------------------------------------------------------------------- one frame

    def receive(self) -> list[Message]:
        """Take what jobs have read, and the renderer's messages, which are returned."""
        for done in [one for one in self.jobs if one.is_done]:
            self.give_up_job(done)
            self.attempt(done.finish)
        messages = self.renderer.poll()
        for message in messages:
            self.rendering = self.rendering.after(message)
            match message:
                case Picked():
                    self._take_pick(message)
                case PickedBox():
                    self.select(self.selection.boxed(message.names, message.takes_out))
                case PickedPlace():
                    self._take_place(message)
                case Exported():
                    width, height = message.size
                    self.say(f"{message.path} is written, {width} × {height} pixels", "done")
                case CopiedPicture():
                    self.attempt(partial(self._take_copy, message))
                case Problem():
                    self.say(message.text, "error")
        return messages

    def _take_copy(self, copied: CopiedPicture) -> None:
        clipboard.copy_picture(copied.pixels)
        self.say("the picture is on the clipboard", "done")

    def _take_pick(self, picked: Picked) -> None:
        dropped = self.screen.dropped
        if dropped is not None and picked.point == dropped[1]:
            self.screen = replace(self.screen, dropped=None)
            self.attempt(lambda: self._assign_dropped(dropped[0], picked.name))
            return
        is_for_menu = picked.point == self.screen.menu_point and picked.name in self.selection
        self.screen = replace(self.screen, menu_point=None)
        if is_for_menu:
            self.open_menu("selection")
        else:
            self.select(self.selection.clicked(picked.name, picked.additive))

    def _take_place(self, picked: PickedPlace) -> None:
        if picked.place is None:
            self.say("Nothing is there to aim at: click a surface", "warning")
            return
        lights = [one for one in self.scene.lights if one.name in self.selection and one.kind in DIRECTED]
        aimed = {one.name: placing.aimed(one, picked.place) for one in lights}
        self.propose(edits.with_all(self.scene, aimed), "Aim light")

    def _assign_dropped(self, material: str, name: str | None) -> None:
        if name is None or name not in self.scene.object_index:
            self.say("No object is there to be given a material", "warning")
            return
        self.propose(edits.assign_material(self.scene, (name,), material), "Assign material")

    def settle(self, is_held: bool, is_flying: bool = False, hint: str = "") -> None:
        """End a frame; `is_held` tells whether a widget, the gizmo or the camera is being dragged, or a
        transform is under way, `hint` what keys do then (see Gesture)."""
        if not is_held and self.now() >= self.gesture.rest_until:
            self.document.history.settle()
            self._before_move = None
        self.gesture = Gesture(is_held, is_flying, self.gesture.rest_until, hint=hint)
        self.selection = self.selection.within(self.scene)
        self.renderer.show(self.view)

    @property
    def is_waiting(self) -> bool:
        """Whether a frame is due soon without an event: the camera flies, a file is read, or an entry of the
        history, or a move of the view, waits for a rest."""
        is_at_work = self.gesture.is_flying or bool(self.jobs)
        return is_at_work or (self._is_dragging and not self.gesture.is_held)

    # --------------------------------------------------------------------------------------- files

    def start_over(self, document: Document, opened: Path | None = None) -> None:
        """Edit another document from now on."""
        self.document = document
        self.viewing = Viewing(is_locked=self.viewing.is_locked, saved=saved_views.of_scene(document.path))
        self._before_move = None
        self.select(Selection())
        self.control = replace(self.control, point=None)
        # Nobody asks what the picture of another document has in common with this one.
        self.renderer.request(Restart())
        for warning in document.warnings:
            self.say(warning, "warning")
        if opened is not None:
            self.preferences = self.preferences.with_recent(opened)

    @property
    def title(self) -> str:
        """The title of the window."""
        return f"{self.document.title} - incpt"
