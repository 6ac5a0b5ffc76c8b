"""Mouse and keys in the picture between the panels: moves of the camera, picking, the gizmo, and the bar of
the split view."""

from __future__ import annotations

from dataclasses import dataclass, replace

from imgui_bundle import imgui

from incpt.scene import camera_moves
from incpt.scene.camera import Camera
from incpt.scene.model import Scene
from incpt.scene.selection import Selection
from incpt.ui import bindings
from incpt.ui.bindings import Button, MouseAction
from incpt.ui.display.projection import split_x
from incpt.ui.editor.state import TRANSFORM_KEY, Beginning, Tool
from incpt.ui.preferences import DisplaySettings, Preferences, SnapSettings
from incpt.ui.rect import Point, Rect
from incpt.ui.viewport import (
    axis_widget,
    box_select,
    floor_grid,
    light_marks,
    modal_input,
    modal_marks,
    point_pick,
)
from incpt.ui.viewport.box_select import BoxSelect
from incpt.ui.viewport.gizmo import Gizmo
from incpt.ui.viewport.light_handles import LightHandles
from incpt.ui.viewport.point_pick import PointPick
from incpt.ui.viewport.transform_mode import TransformMode
from incpt.ui.widgets import places
from incpt.viewer.renderer import Pick, PickBox

ZOOM_REST_SECONDS = 0.4
"""Turns of the wheel that are closer together than this are one entry of the history."""

_ANY_WINDOW = imgui.HoveredFlags_.any_window
_ANY_POPUP = imgui.PopupFlags_.any_popup
_BAR_POINTS = 6.0
"""How near the mouse has to be to take the bar of the split view."""
_LEAST_PIXELS = 16
"""The least width and height that a picture may have."""


@dataclass(frozen=True)
class Proposal:
    """A scene to take the place of the one before it; the fields are the arguments of `Editor.propose`. One
    with another camera is a move of the view."""

    scene: Scene
    label: str
    key: str
    rest_seconds: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """What the user's hand did in the picture in one frame.

    scene, selection, display   the three after this frame.
    proposals                   the edits that led to `scene`, one after the other.
    pick                        a click or a box on the picture, to be asked of the renderer.
    region                      a box that was drawn as the region to be rendered, in units of the picture.
    aim                         a point of the picture, in the same units, at which lights shall shine.
    wants_menu                  the click asks for the menu of what is selected, if it is on that.
    """

    scene: Scene
    selection: Selection
    display: DisplaySettings
    proposals: tuple[Proposal, ...] = ()
    pick: Pick | PickBox | None = None
    region: Rect[float] | None = None
    aim: Point | None = None
    wants_menu: bool = False

    def proposed(self, proposal: Proposal) -> Outcome:
        """After one more edit; one that leaves the scene as it is counts for nothing."""
        if proposal.scene is self.scene:
            return self
        return replace(self, scene=proposal.scene, proposals=(*self.proposals, proposal))


@dataclass
class _Press:
    """A mouse button that went down in the picture: what it does as a drag and as a click."""

    button: int
    at: Point
    last: Point
    action: MouseAction | None
    click: MouseAction | None
    is_drag: bool = False


class Viewport:
    """State of the mouse in the picture between two frames. It changes nothing but itself: `update` returns
    what the hand did."""

    def __init__(self) -> None:
        self.gizmo = Gizmo()
        self._transform = TransformMode()
        self._box = BoxSelect()
        self._point = PointPick()
        self._handles = LightHandles()
        self._held_by_gizmo: tuple[int, tuple[str, ...]] = (0, ())
        self._press: _Press | None = None
        self._holds_bar = False
        self._flies_freely = False
        self._last_mouse = (0.0, 0.0)
        self._is_blocked = False
        self._drags = 0
        """Drags of the camera so far: each is an entry of its own in the history."""

    # ------------------------------------------------------------------------------------ one frame

    def update(
        self,
        scene: Scene,
        selection: Selection,
        tool: Tool,
        preferences: Preferences,
        picture: Rect[float],
        *,
        is_blocked: bool = False,
        beginning: Beginning | None = None,
    ) -> Outcome:
        """Take the mouse and the keys of a frame. The picture lies at `picture`, in points. `is_blocked`
        tells that a dialog is open, which takes them instead; `beginning` is what a command begins here."""
        self._is_blocked = is_blocked
        places.note_rect("picture", picture)
        outcome = Outcome(scene, selection, preferences.display)
        if preferences.display.floor_grid:
            floor_grid.draw(scene.camera, picture)
        if preferences.display.axes:
            axis_widget.draw(scene.camera, picture, _mouse())
        if preferences.display.outline:
            light_marks.draw(scene, selection, picture)
        if beginning is not None:
            # What it takes begins with the next frame: the key of this one is that of the command.
            self._begin(beginning, outcome, tool, preferences.snap, picture)
        elif self._transform.is_on:
            outcome = self._use_transform(outcome, preferences.snap, picture)
        elif self._box.is_on:
            outcome = self._use_box(outcome, picture)
        elif self._point.is_on:
            at = self._point.update(is_blocked=self._is_blocked)
            outcome = outcome if at is None else replace(outcome, aim=picture.relative(at))
        else:
            outcome = self._use_handles(outcome, picture)
            outcome = self._use_gizmo(outcome, tool, preferences.snap, picture)
            outcome = self._use_bar(outcome, picture)
            outcome = self._use_mouse(outcome, preferences, picture)
            outcome = self._use_wheel(outcome, preferences.navigation, picture)
        modal_input.take_mouse(bool(self.hint))
        return outcome

    @property
    def is_held(self) -> bool:
        """Whether the gizmo, the bar or the camera is being dragged, or a transform is under way."""
        is_dragging = self._press is not None and self._press.is_drag
        is_steered = self._transform.is_on or self._flies_freely
        has_handle = self.gizmo.is_using or self._handles.is_held
        return has_handle or self._holds_bar or is_dragging or is_steered

    @property
    def is_flying(self) -> bool:
        """Whether the camera flies, so that frames are due without an event and letters are no commands."""
        holds = self._press is not None and self._press.is_drag and self._press.action is MouseAction.FLY
        return self._flies_freely or holds

    @property
    def hint(self) -> str:
        """What the keys do while something in the picture takes them, one line; empty: they are commands."""
        if self._box.is_on:
            return box_select.REGION_HINT if self._box.is_region else box_select.HINT
        if self._point.is_on:
            return point_pick.HINT
        return modal_marks.HINT if self._transform.is_on else ""

    def let_go(self) -> None:
        """Give up what is being dragged: nothing more happens until the button is released."""
        imgui.internal.clear_active_id()
        self.gizmo.give_up()
        self._transform.stop()
        self._box.stop()
        self._point.stop()
        self._handles.give_up()
        self._press = None

    # ------------------------------------------------------------------- what commands begin here

    def _begin(
        self,
        beginning: Beginning,
        outcome: Outcome,
        tool: Tool,
        snap: SnapSettings,
        picture: Rect[float],
    ) -> None:
        self.let_go()
        self.gizmo.is_over = False
        if beginning.action in ("box", "region"):
            self._box.begin(is_region=beginning.action == "region")
            return
        if beginning.action == "aim":
            self._point.begin()
            return
        names = outcome.selection.names
        self._transform.begin(beginning, outcome.scene, names, snap, picture, tool.pivot)

    def _use_transform(self, outcome: Outcome, snap: SnapSettings, picture: Rect[float]) -> Outcome:
        scene = self._transform.update(
            outcome.scene,
            snap.enabled,
            picture,
            is_blocked=self._is_blocked,
            is_split=outcome.display.split,
        )
        return outcome.proposed(Proposal(scene, self._transform.label, TRANSFORM_KEY))

    def _use_box(self, outcome: Outcome, picture: Rect[float]) -> Outcome:
        box = self._box.update(is_blocked=self._is_blocked)
        if box is None:
            return outcome
        low = picture.relative((box.rect.left, box.rect.top))
        high = picture.relative((box.rect.right, box.rect.bottom))
        if self._box.is_region:
            return replace(outcome, region=Rect(*low, high[0] - low[0], high[1] - low[1]))
        selection = outcome.selection if box.is_added or box.takes_out else Selection()
        lights = light_marks.lights_in(outcome.scene, box.rect, picture) if outcome.display.outline else ()
        pick = PickBox(low, high, box.takes_out)
        return replace(outcome, selection=selection.boxed(lights, box.takes_out), pick=pick)

    # ------------------------------------------------------------------- handles of lights, the gizmo

    def _use_handles(self, outcome: Outcome, picture: Rect[float]) -> Outcome:
        if not outcome.display.outline:
            return outcome
        # They are small, and go before what lies under them.
        is_free = picture.contains(_mouse()) and self._is_free(Button.MIDDLE)
        scene = self._handles.update(outcome.scene, outcome.selection.active, picture, is_free)
        return outcome.proposed(Proposal(scene, "Light", f"light handle {self._handles.drags}"))

    def _use_gizmo(self, outcome: Outcome, tool: Tool, snap: SnapSettings, picture: Rect[float]) -> Outcome:
        names = outcome.selection.names
        if self.gizmo.is_using and self._held_by_gizmo != (id(outcome.scene), names):
            self.gizmo.give_up()  # The scene was undone or edited, or the object deselected, under the drag.
        has_handle = self._handles.is_over or self._handles.is_held
        scene = self.gizmo.draw(outcome.scene, names, tool, snap, picture, is_enabled=not has_handle)
        self._held_by_gizmo = id(scene), names
        return outcome.proposed(Proposal(scene, tool.operation.capitalize(), "gizmo"))

    # -------------------------------------------------------------------------------- the split's bar

    def _use_bar(self, outcome: Outcome, picture: Rect[float]) -> Outcome:
        if not outcome.display.split or outcome.display.shading != "rendered":
            self._holds_bar = False
            return outcome
        mouse = _mouse()
        x = split_x(picture, outcome.display.split_position)
        places.note_rect("split bar", Rect(x, picture.top, 0.0, picture.height))
        is_near = abs(mouse[0] - x) < _BAR_POINTS and picture.contains(mouse)
        if is_near and self._is_free():
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            if imgui.is_mouse_clicked(imgui.MouseButton_.left):
                self._holds_bar = True
        if not self._holds_bar:
            return outcome
        self._holds_bar = imgui.is_mouse_down(imgui.MouseButton_.left)
        position = min(max(picture.relative(mouse)[0], 0.0), 1.0)
        return replace(outcome, display=replace(outcome.display, split_position=position))

    # ------------------------------------------------------------------------------ mouse and camera

    def _use_mouse(self, outcome: Outcome, preferences: Preferences, picture: Rect[float]) -> Outcome:
        if self._flies_freely:
            return self._fly_freely(outcome, preferences.fly_speed, picture)
        if self._press is None:
            self._begin_press(preferences.navigation)
            return outcome
        return self._hold_press(outcome, self._press, preferences.fly_speed, picture)

    def _begin_press(self, navigation: str) -> None:
        if self._holds_bar:
            return
        mouse = _mouse()
        for index, button in enumerate((Button.LEFT, Button.RIGHT, Button.MIDDLE)):
            if imgui.is_mouse_clicked(index) and self._is_free(button):
                action = bindings.action_for(navigation, button, _modifiers())
                click = bindings.click_action(button, _modifiers())
                self._press = _Press(index, mouse, mouse, action, click)
                self._drags += 1
                return
        if imgui.is_key_pressed(imgui.Key.grave_accent, False) and self._is_free(Button.GRAVE):
            self._flies_freely = (
                bindings.action_for(navigation, Button.GRAVE, _modifiers()) is MouseAction.FLY
            )
            self._last_mouse = mouse
            self._drags += 1

    def _hold_press(self, outcome: Outcome, press: _Press, fly_speed: float, picture: Rect[float]) -> Outcome:
        mouse = _mouse()
        if bindings.is_drag(mouse[0] - press.at[0], mouse[1] - press.at[1]):
            press.is_drag = True
        if press.is_drag and press.action is not None:
            moved = _moved(outcome.scene.camera, press.action, press.last, mouse, picture.size)
            if press.action is MouseAction.FLY:
                moved = _flown(moved, fly_speed)
            outcome = self._with_camera(outcome, moved, press.action)
        press.last = mouse
        if imgui.is_mouse_down(press.button):
            return outcome
        self._press = None
        if press.is_drag or press.click is None:
            return outcome
        return _clicked(outcome, press.at, press.click, picture)

    def _fly_freely(self, outcome: Outcome, speed: float, picture: Rect[float]) -> Outcome:
        mouse = modal_input.mouse(self._last_mouse)
        moved = _moved(outcome.scene.camera, MouseAction.FLY, self._last_mouse, mouse, picture.size)
        self._last_mouse = mouse
        is_clicked = any(map(imgui.is_mouse_clicked, range(3)))
        if is_clicked or imgui.is_key_pressed(imgui.Key.escape, False):
            self._flies_freely = False
        return self._with_camera(outcome, _flown(moved, speed), MouseAction.FLY)

    def _with_camera(self, outcome: Outcome, camera: Camera, action: MouseAction) -> Outcome:
        if camera == outcome.scene.camera:
            return outcome
        scene = replace(outcome.scene, camera=camera)
        return outcome.proposed(Proposal(scene, action.value.capitalize(), f"camera {self._drags}"))

    def _use_wheel(self, outcome: Outcome, navigation: str, picture: Rect[float]) -> Outcome:
        turns = imgui.get_io().mouse_wheel
        if not turns or not self._is_free(Button.WHEEL):
            return outcome
        if bindings.action_for(navigation, Button.WHEEL, _modifiers()) is not MouseAction.ZOOM:
            return outcome
        x, y = _mouse()
        cursor = x - picture.left, y - picture.top
        camera = camera_moves.wheel(outcome.scene.camera, turns, cursor, picture.size)
        scene = replace(outcome.scene, camera=camera)
        return outcome.proposed(Proposal(scene, "Zoom", "zoom", ZOOM_REST_SECONDS))

    def _is_free(self, button: Button = Button.LEFT) -> bool:
        """Whether the mouse belongs to the picture: to no panel, no menu, no dialog, and no handle of the
        gizmo, which takes the left button only."""
        if self.gizmo.is_using or self._handles.is_held or self._is_blocked:
            return False
        if button is Button.LEFT:
            is_over_handle = self.gizmo.is_over or self._handles.is_over
            return not (imgui.get_io().want_capture_mouse or is_over_handle)
        # want_capture_mouse does not help here, because a handle of the gizmo under the mouse sets it too.
        is_over_panel = imgui.is_window_hovered(_ANY_WINDOW) or imgui.is_any_item_active()
        return not (is_over_panel or imgui.is_popup_open("", _ANY_POPUP))


def picture_rect(area: Rect[float], size: tuple[int, int]) -> Rect[int]:
    """Where an image of `size` pixels lies in what the panels leave: as large as fits, in the middle, on
    whole points."""
    scale = min(area.width / size[0], area.height / size[1])
    width, height = max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)
    left, top = area.left + (area.width - width) / 2, area.top + (area.height - height) / 2
    return Rect(round(left), round(top), width, height)


def pixels_in(area: Rect[float]) -> tuple[int, int] | None:
    """Width and height of a rectangle in pixels; None where it is too small for a picture."""
    pixels = imgui.get_io().display_framebuffer_scale
    width, height = int(area.width * pixels.x), int(area.height * pixels.y)
    return (width, height) if min(width, height) >= _LEAST_PIXELS else None


def _clicked(outcome: Outcome, at: Point, action: MouseAction, picture: Rect[float]) -> Outcome:
    is_additive, wants_menu = action is MouseAction.SELECT_MORE, action is MouseAction.SELECT_OR_MENU
    side = axis_widget.side_at(outcome.scene.camera, picture, at) if outcome.display.axes else None
    if side is not None:
        looking = replace(outcome.scene, camera=camera_moves.set_view(outcome.scene.camera, side))
        return outcome.proposed(Proposal(looking, f"Look from {side}", f"look from {side}"))
    if not picture.contains(at):
        return outcome if is_additive else replace(outcome, selection=Selection())
    light = light_marks.light_at(outcome.scene, at, picture) if outcome.display.outline else None
    if light is None:
        return replace(outcome, pick=Pick(picture.relative(at), is_additive), wants_menu=wants_menu)
    if wants_menu and light in outcome.selection:
        return replace(outcome, wants_menu=True)
    return replace(outcome, selection=outcome.selection.clicked(light, is_additive))


def _moved(
    camera: Camera, action: MouseAction, last: Point, mouse: Point, size: tuple[float, float]
) -> Camera:
    dx, dy = mouse[0] - last[0], mouse[1] - last[1]
    if not (dx or dy):
        return camera
    if action is MouseAction.PAN:
        return camera_moves.pan(camera, dx, dy, size)
    moves = {
        MouseAction.ORBIT: camera_moves.orbit,
        MouseAction.DOLLY: camera_moves.dolly,
        MouseAction.FLY: camera_moves.look,
    }
    return moves[action](camera, dx, dy, size[1])


def _flown(camera: Camera, speed: float) -> Camera:
    io = imgui.get_io()
    held = [one for one in bindings.FLY_KEYS if imgui.is_key_down(getattr(imgui.Key, one.key))]
    if not held:
        return camera
    forward, right, up = (sum(getattr(one, way) for one in held) for way in ("forward", "right", "up"))
    speed *= bindings.FLY_FAST if io.key_shift else 1.0
    return camera_moves.fly(camera, forward, right, up, io.delta_time, speed)


def _mouse() -> Point:
    position = imgui.get_mouse_pos()
    return position.x, position.y


def _modifiers() -> list[str]:
    io = imgui.get_io()
    held = ((io.key_ctrl, bindings.CTRL), (io.key_shift, bindings.SHIFT), (io.key_alt, bindings.ALT))
    return [name for is_held, name in held if is_held]
