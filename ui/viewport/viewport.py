"""The picture between the panels: moves of the camera, picking, the gizmo, the bar of the split view, and
what is written over the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

from imgui_bundle import imgui

from incpt.scene import camera_moves
from incpt.scene.camera import Camera
from incpt.scene.selection import Selection
from incpt.ui import bindings
from incpt.ui.bindings import Action, Button
from incpt.ui.display.display import Display, split_x
from incpt.ui.display.outline import Outlined
from incpt.ui.display.overlays import Overlay
from incpt.ui.editor.editor import ZOOM_REST_SECONDS, Editor
from incpt.ui.viewport.gizmo import Gizmo
from incpt.ui.widgets import places, theme
from incpt.viewer.threaded import Pick
from incpt.viewer.viewer import Frame

Rect = tuple[float, float, float, float]
"""Left, top, width, height in points."""

_ANY_WINDOW = imgui.HoveredFlags_.any_window
_ANY_POPUP = imgui.PopupFlags_.any_popup
_BAR_POINTS = 6.0
"""How near the mouse has to be to take the bar of the split view."""
_NUMBERS_MARGIN = 4.0
"""Tiles have to be that much wider on the screen than their numbers, points."""


@dataclass
class _Press:
    """A mouse button that went down in the picture: what it does as a drag and as a click."""

    button: int
    at: tuple[float, float]
    last: tuple[float, float]
    action: Action | None
    click: Action | None
    is_drag: bool = False


class Viewport:
    """State of the mouse in the picture between two frames."""

    def __init__(self) -> None:
        self.gizmo = Gizmo()
        self._held_by_gizmo: tuple[int, tuple[str, ...]] = (0, ())
        self._press: _Press | None = None
        self._holds_bar = False
        self._is_flying = False
        self._last_mouse = (0.0, 0.0)
        self._drags = 0
        """Drags of the camera so far: each is an entry of its own in the history."""

    # ------------------------------------------------------------------------------------ one frame

    def update(self, editor: Editor, rect: Rect, overlay: Overlay | None = None) -> bool:
        """Take the mouse and the keys of a frame, `rect` being what the panels leave, and write over the
        picture what belongs to its `overlay`; returns whether something is being dragged."""
        picture = picture_rect(rect, editor.scene.settings.size)
        editor.viewport_size = _whole_size(rect)
        places.note_rect(
            "picture", (picture[0], picture[1], picture[0] + picture[2], picture[1] + picture[3])
        )
        if editor.take_cancelled():
            self._let_go()
        self._use_gizmo(editor, picture)
        self._use_bar(editor, picture)
        self._use_mouse(editor, picture)
        self._use_wheel(editor, picture)
        _write_over(editor, picture, overlay)
        is_dragging = self._press is not None and self._press.is_drag
        return self.gizmo.is_using or self._holds_bar or is_dragging or self._is_flying

    @property
    def is_flying(self) -> bool:
        """Whether the camera flies, so that frames are due without an event and letters are no commands."""
        holds = self._press is not None and self._press.is_drag and self._press.action is Action.FLY
        return self._is_flying or holds

    def draw(
        self, editor: Editor, display: Display, rect: Rect, framebuffer_size: tuple[int, int], scale: float
    ) -> None:
        """Draw the picture into the framebuffer; `scale` is framebuffer pixels per point."""
        picture = picture_rect(rect, editor.scene.settings.size)
        selection = None
        if editor.selection:
            names = frozenset(editor.selection.names)
            selection = Outlined(editor.scene, names, editor.selection.active)
        display.draw(
            _scaled(picture, scale),
            editor.preferences.display,
            framebuffer_size=framebuffer_size,
            clip_px=_scaled(rect, scale),
            selection=selection,
            scale=scale,
        )

    def _let_go(self) -> None:
        imgui.internal.clear_active_id()
        self.gizmo.give_up()
        self._press = None

    # ----------------------------------------------------------------------------------- the gizmo

    def _use_gizmo(self, editor: Editor, picture: Rect) -> None:
        if self.gizmo.is_using and self._held_by_gizmo != (id(editor.scene), editor.selection.names):
            self.gizmo.give_up()  # undone, edited or deselected under the drag
        tool = editor.tool
        scene = self.gizmo.draw(
            editor.scene, editor.selection.names, tool.operation, tool.space, editor.preferences.snap, picture
        )
        editor.propose(scene, tool.operation.capitalize(), "gizmo")
        self._held_by_gizmo = id(editor.scene), editor.selection.names

    # -------------------------------------------------------------------------------- the split's bar

    def _use_bar(self, editor: Editor, picture: Rect) -> None:
        display = editor.preferences.display
        if not display.split:
            self._holds_bar = False
            return
        mouse = imgui.get_mouse_pos()
        x = split_x(picture, display.split_position)
        places.note_rect("split bar", (x, picture[1], x, picture[1] + picture[3]))
        is_near = abs(mouse.x - x) < _BAR_POINTS and _is_inside((mouse.x, mouse.y), picture)
        if is_near and self._is_free(editor):
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            if imgui.is_mouse_clicked(imgui.MouseButton_.left):
                self._holds_bar = True
        if self._holds_bar:
            position = (mouse.x - picture[0]) / picture[2]
            editor.change_display(replace(display, split_position=min(max(position, 0.0), 1.0)))
            self._holds_bar = imgui.is_mouse_down(imgui.MouseButton_.left)

    # ------------------------------------------------------------------------------ mouse and camera

    def _use_mouse(self, editor: Editor, picture: Rect) -> None:
        mouse = _mouse()
        if self._is_flying:
            self._fly_freely(editor, mouse, picture)
        elif self._press is None:
            self._begin_press(editor, mouse)
        else:
            self._hold_press(editor, self._press, mouse, picture)

    def _begin_press(self, editor: Editor, mouse: tuple[float, float]) -> None:
        if self._holds_bar:
            return
        navigation = editor.preferences.navigation
        for index, button in enumerate((Button.LEFT, Button.RIGHT, Button.MIDDLE)):
            if imgui.is_mouse_clicked(index) and self._is_free(editor, button):
                action = bindings.action_for(navigation, button, _modifiers())
                click = bindings.click_action(button, _modifiers())
                self._press = _Press(index, mouse, mouse, action, click)
                self._drags += 1
                return
        if imgui.is_key_pressed(imgui.Key.grave_accent, False) and self._is_free(editor, Button.GRAVE):
            self._is_flying = bindings.action_for(navigation, Button.GRAVE, _modifiers()) is Action.FLY
            self._last_mouse = mouse
            self._drags += 1

    def _hold_press(self, editor: Editor, press: _Press, mouse: tuple[float, float], picture: Rect) -> None:
        if bindings.is_drag(mouse[0] - press.at[0], mouse[1] - press.at[1]):
            press.is_drag = True
        if press.is_drag and press.action is not None:
            moved = _moved(editor.scene.camera, press.action, press.last, mouse, picture[3])
            if press.action is Action.FLY:
                moved = _flown(moved, editor.preferences.fly_speed)
            self._propose_camera(editor, moved, press.action)
        press.last = mouse
        if not imgui.is_mouse_down(press.button):
            self._press = None
            if not press.is_drag and press.click is not None:
                self._click(editor, _relative(press.at, picture), press.click is Action.SELECT_MORE)

    def _fly_freely(self, editor: Editor, mouse: tuple[float, float], picture: Rect) -> None:
        camera = _moved(editor.scene.camera, Action.FLY, self._last_mouse, mouse, picture[3])
        self._last_mouse = mouse
        self._propose_camera(editor, _flown(camera, editor.preferences.fly_speed), Action.FLY)
        is_clicked = any(map(imgui.is_mouse_clicked, range(3)))
        if is_clicked or imgui.is_key_pressed(imgui.Key.escape, False):
            self._is_flying = False

    def _propose_camera(self, editor: Editor, camera: Camera, action: Action) -> None:
        if camera != editor.scene.camera:
            scene = replace(editor.scene, camera=camera)
            editor.propose(scene, action.value.capitalize(), f"camera {self._drags}")

    def _click(self, editor: Editor, point: tuple[float, float], additive: bool) -> None:
        if 0 <= point[0] < 1 and 0 <= point[1] < 1:
            editor.point = point
            editor.renderer.request(Pick(point, additive))
        elif not additive:
            editor.select(Selection())

    def _use_wheel(self, editor: Editor, picture: Rect) -> None:
        turns = imgui.get_io().mouse_wheel
        if not turns or not self._is_free(editor, Button.WHEEL):
            return
        if bindings.action_for(editor.preferences.navigation, Button.WHEEL, _modifiers()) is Action.ZOOM:
            cursor = _mouse()[0] - picture[0], _mouse()[1] - picture[1]
            camera = camera_moves.wheel(editor.scene.camera, turns, cursor, picture[2:])
            scene = replace(editor.scene, camera=camera)
            editor.propose(scene, "Zoom", "zoom", rest_seconds=ZOOM_REST_SECONDS)

    def _is_free(self, editor: Editor, button: Button = Button.LEFT) -> bool:
        """Whether the mouse belongs to the picture: to no panel, no menu, no dialog, and no handle of the
        gizmo, which takes the left button only."""
        if self.gizmo.is_using or editor.dialog is not None:
            return False
        if button is Button.LEFT:
            return not (imgui.get_io().want_capture_mouse or self.gizmo.is_over)
        # Not want_capture_mouse, which a handle under the mouse sets too.
        is_over_panel = imgui.is_window_hovered(_ANY_WINDOW) or imgui.is_any_item_active()
        return not (is_over_panel or imgui.is_popup_open("", _ANY_POPUP))


def picture_rect(rect: Rect, size: tuple[int, int]) -> Rect:
    """Where an image of `size` pixels lies in what the panels leave: as large as fits, in the middle, on
    whole points."""
    left, top, width, height = rect
    scale = min(width / size[0], height / size[1])
    w, h = max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)
    return round(left + (width - w) / 2), round(top + (height - h) / 2), w, h


def _moved(
    camera: Camera, action: Action, last: tuple[float, float], mouse: tuple[float, float], height: float
) -> Camera:
    dx, dy = mouse[0] - last[0], mouse[1] - last[1]
    if not (dx or dy):
        return camera
    moves = {
        Action.ORBIT: camera_moves.orbit,
        Action.PAN: camera_moves.pan,
        Action.DOLLY: camera_moves.dolly,
        Action.FLY: camera_moves.look,
    }
    return moves[action](camera, dx, dy, height)


def _flown(camera: Camera, speed: float) -> Camera:
    io = imgui.get_io()
    held = [one for one in bindings.FLY_KEYS if imgui.is_key_down(getattr(imgui.Key, one.key))]
    if not held:
        return camera
    forward, right, up = (sum(getattr(one, way) for one in held) for way in ("forward", "right", "up"))
    speed *= bindings.FLY_FAST if io.key_shift else 1.0
    return camera_moves.fly(camera, forward, right, up, io.delta_time, speed)


def _mouse() -> tuple[float, float]:
    position = imgui.get_mouse_pos()
    return position.x, position.y


def _modifiers() -> list[str]:
    io = imgui.get_io()
    held = ((io.key_ctrl, bindings.CTRL), (io.key_shift, bindings.SHIFT), (io.key_alt, bindings.ALT))
    return [name for is_held, name in held if is_held]


# ------------------------------------------------------------------------- written over the picture


def _write_over(editor: Editor, picture: Rect, overlay: Overlay | None) -> None:
    draw = imgui.get_background_draw_list()
    if overlay is not None and editor.preferences.display.overlay != "none":
        _write_numbers(draw, overlay, editor, picture)
        _write_legend(draw, overlay, picture)
    if editor.frame is not None and editor.preferences.display.split and len(editor.frame.pictures) == 2:
        _write_sides(draw, editor.frame, editor.preferences.display.split_position, picture)


def _write_numbers(draw: imgui.ImDrawList, overlay: Overlay, editor: Editor, picture: Rect) -> None:
    if editor.frame is None or overlay.numbers is None or overlay.numbers_at is None:
        return
    shown = editor.frame.pictures[-1]
    height, width = shown.image.shape[:2]
    scale = picture[2] / width, picture[3] / height
    widest = imgui.calc_text_size(str(int(overlay.numbers.max(initial=0)))).x
    if shown.grid.tile_size * scale[0] < widest + _NUMBERS_MARGIN:
        return
    white, half = imgui.get_color_u32(imgui.ImVec4(1.0, 1.0, 1.0, 0.9)), imgui.get_text_line_height() / 2
    for number, (x, y) in zip(overlay.numbers.tolist(), overlay.numbers_at.tolist(), strict=True):
        text = str(number)
        left = picture[0] + x * scale[0] - imgui.calc_text_size(text).x / 2
        draw.add_text((left, picture[1] + y * scale[1] - half), white, text)


def _write_legend(draw: imgui.ImDrawList, overlay: Overlay, picture: Rect) -> None:
    line = imgui.get_text_line_height()
    x, y = picture[0] + line * 0.6, picture[1] + picture[3] - line * 1.4
    for text, (red, green, blue) in overlay.legend:
        _label(draw, (x + line * 1.2, y), text)
        tint = imgui.get_color_u32(imgui.ImVec4(red / 255, green / 255, blue / 255, 1.0))
        draw.add_rect_filled((x, y), (x + line * 0.8, y + line), tint, 2.0)
        y -= line * 1.35


def _write_sides(draw: imgui.ImDrawList, frame: Frame, position: float, picture: Rect) -> None:
    line = imgui.get_text_line_height()
    bar, y = split_x(picture, position), picture[1] + line * 0.5
    left, right = (f"{p.strategy}, {p.seconds:.2f} s" + _error_text(p.error) for p in frame.pictures)
    _label(draw, (bar - imgui.calc_text_size(left).x - line, y), left)
    _label(draw, (bar + line, y), right)


def _label(draw: imgui.ImDrawList, at: tuple[float, float], text: str) -> None:
    size, pad = imgui.calc_text_size(text), imgui.get_text_line_height() * 0.3
    dark = imgui.get_color_u32(imgui.ImVec4(0.0, 0.0, 0.0, 0.6))
    draw.add_rect_filled(
        (at[0] - pad, at[1] - pad / 2), (at[0] + size.x + pad, at[1] + size.y + pad / 2), dark, 3.0
    )
    draw.add_text(at, imgui.get_color_u32(imgui.ImVec4(*theme.TEXT)), text)


def _error_text(error: float | None) -> str:
    return "" if error is None else f", RMSE {error:.4f}"


def _relative(point: tuple[float, float], rect: Rect) -> tuple[float, float]:
    return (point[0] - rect[0]) / rect[2], (point[1] - rect[1]) / rect[3]


def _is_inside(point: tuple[float, float], rect: Rect) -> bool:
    x, y = _relative(point, rect)
    return 0 <= x < 1 and 0 <= y < 1


def _whole_size(rect: Rect) -> tuple[int, int] | None:
    """Pixels in a rectangle; None where it is too small for a picture."""
    pixels = imgui.get_io().display_framebuffer_scale
    width, height = int(rect[2] * pixels.x), int(rect[3] * pixels.y)
    return (width, height) if width >= 16 and height >= 16 else None


def _scaled(rect: Rect, scale: float) -> Rect:
    x, y, width, height = rect
    return x * scale, y * scale, width * scale, height * scale
