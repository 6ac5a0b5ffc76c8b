"""The window: GLFW, a moderngl core context, and imgui's own compiled backends for both."""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from imgui_bundle import imgui  # It comes before glfw, because it brings the library that glfw loads.

import glfw  # isort: skip
import moderngl

from incpt.core.errors import DeviceError
from incpt.ui.widgets import theme

_GLSL = "#version 330"
"""The version of GLSL that imgui's renderer is to use."""
_SETTLING_FRAMES = 3
"""Frames that imgui needs after an event until hover and layout are at rest."""
_TOOLTIP_SECONDS = 0.5
"""After the last event comes a frame for tooltips, which wait until the mouse rests."""


class Dropped(NamedTuple):
    """A file that was dropped on the window, and where: points from its top left."""

    path: Path
    x: float
    y: float


class Window:
    """A window with a context that is current, and imgui in it. Raises DeviceError where none opens."""

    def __init__(
        self, size: tuple[int, int], title: str, layout_file: Path, scale: float | None, theme_name: str
    ) -> None:
        _init_glfw()
        for hint, value in (
            (glfw.CONTEXT_VERSION_MAJOR, 3),
            (glfw.CONTEXT_VERSION_MINOR, 3),
            (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
            (glfw.OPENGL_FORWARD_COMPAT, True),  # Without it macOS gives no core profile.
            (glfw.SCALE_TO_MONITOR, True),
        ):
            glfw.window_hint(hint, value)
        self.handle = glfw.create_window(*on_screen(size), title, None, None)
        if not self.handle:
            glfw.terminate()
            raise DeviceError("the window needs OpenGL 3.3; install or update the graphics driver")
        glfw.make_context_current(self.handle)
        glfw.swap_interval(1)
        self.context = moderngl.create_context(require=330)
        self.dropped: list[Dropped] = []
        self.wants_to_close = False
        self._title = title
        self._frames_due = _SETTLING_FRAMES
        self._tooltip_at = math.inf
        self._fixed_scale, self._theme = scale, theme_name
        self._place_before: tuple[int, int, int, int] | None = None
        """Where the window was before it took the whole screen: left, top, width, height."""
        self._listen()
        self._start_imgui(layout_file)

    def _listen(self) -> None:
        # This comes before imgui's backend starts, which goes on calling the callbacks that it finds.
        for listen in (
            glfw.set_cursor_pos_callback,
            glfw.set_mouse_button_callback,
            glfw.set_scroll_callback,
            glfw.set_key_callback,
            glfw.set_char_callback,
            glfw.set_window_focus_callback,
            glfw.set_cursor_enter_callback,
            glfw.set_framebuffer_size_callback,
            glfw.set_window_refresh_callback,
        ):
            listen(self.handle, lambda *_: self._touched())
        glfw.set_drop_callback(self.handle, self._drop)
        glfw.set_window_close_callback(self.handle, self._close_asked)

    def _start_imgui(self, layout_file: Path) -> None:
        imgui.create_context()
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.config_windows_move_from_title_bar_only = True
        io.config_drag_click_to_input_text = False
        io.set_ini_filename(str(layout_file))
        theme.load_font()
        self._scale = 0.0
        self._applied: tuple[float, str] | None = None
        self._follow_scale()
        address = ctypes.cast(self.handle, ctypes.c_void_p).value
        assert address is not None
        imgui.backends.glfw_init_for_opengl(address, True)
        imgui.backends.opengl3_init(_GLSL)

    @property
    def scale(self) -> float:
        """Pixels of the framebuffer per point of the user interface."""
        return self._scale

    @property
    def size(self) -> tuple[int, int]:
        """Width and height as the system counts them: what to open the next window with."""
        if self._place_before is not None:
            return self._place_before[2:]
        width, height = glfw.get_window_size(self.handle)
        return width, height

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        width, height = glfw.get_framebuffer_size(self.handle)
        return width, height

    def look(self, scale: float | None, theme_name: str) -> None:
        """Draw texts and widgets at that scale (None: as the monitor says) and in that theme from now on."""
        if (scale, theme_name) != (self._fixed_scale, self._theme):
            self._fixed_scale, self._theme = scale, theme_name
            self.redraw()

    def show_full_screen(self, on: bool) -> None:
        """Take the whole of the screen on which the window is, or go back to where it was."""
        if on == (self._place_before is not None):
            return
        if on:
            at, size = glfw.get_window_pos(self.handle), glfw.get_window_size(self.handle)
            screen = _screen_at(at[0] + size[0] // 2, at[1] + size[1] // 2)
            mode = glfw.get_video_mode(screen)
            glfw.set_window_monitor(self.handle, screen, 0, 0, *mode.size, mode.refresh_rate)
            self._place_before = (*at, *size)
        elif self._place_before is not None:
            # The stubs of glfw have no NULL there, which the C signature takes.
            no_screen: Any = None
            glfw.set_window_monitor(self.handle, no_screen, *self._place_before, glfw.DONT_CARE)
            self._place_before = None
        self.redraw()

    def redraw(self) -> None:
        """Draw the next few frames, whatever happens."""
        self._frames_due = _SETTLING_FRAMES

    def _touched(self) -> None:
        self.redraw()
        self._tooltip_at = time.monotonic() + _TOOLTIP_SECONDS

    def wait(self, timeout_seconds: float) -> bool:
        """Take events, at most waiting that long for the first one; returns whether a frame is due."""
        if self._frames_due > 0:
            glfw.poll_events()
        else:
            left = self._tooltip_at - time.monotonic()
            glfw.wait_events_timeout(min(timeout_seconds, max(left, 0.001)))
            if time.monotonic() >= self._tooltip_at:
                self._tooltip_at = math.inf
                self.redraw()
        due = self._frames_due > 0
        self._frames_due = max(self._frames_due - 1, 0)
        return due

    @staticmethod
    def wake() -> None:
        """End `wait`, from any thread."""
        glfw.post_empty_event()

    def begin_frame(self) -> None:
        self._follow_scale()
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()

    def end_frame(self, draw_below: Callable[[], None], is_swapped: bool = True) -> None:
        """Show the frame; `draw_below` draws into the framebuffer what lies below the panels."""
        imgui.render()
        self.context.screen.use()
        self.context.viewport = (0, 0, *self.framebuffer_size)
        grey = theme.surround()
        self.context.clear(grey, grey, grey)
        draw_below()
        self.context.screen.use()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
        if is_swapped:
            glfw.swap_buffers(self.handle)

    def set_title(self, title: str) -> None:
        if title != self._title:
            self._title = title
            glfw.set_window_title(self.handle, title)

    def take_dropped(self) -> list[Dropped]:
        """Files dropped on the window since the last call."""
        dropped, self.dropped = self.dropped, []
        return dropped

    def close(self) -> None:
        """Close the window for good; imgui writes its layout."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        self.context.release()
        glfw.destroy_window(self.handle)
        glfw.terminate()

    def _follow_scale(self) -> None:
        # On macOS the system's screen coordinates are points already; elsewhere the content scale tells how
        # many pixels a point has.
        content = glfw.get_window_content_scale(self.handle)[0]
        points = self.framebuffer_size[0] / max(glfw.get_window_size(self.handle)[0], 1)
        scale = self._fixed_scale or content / max(points, 1.0)
        if (scale, self._theme) != self._applied:
            self._scale, self._applied = scale, (scale, self._theme)
            theme.apply(scale, self._theme)

    def _drop(self, _window: Any, paths: Any, *_: Any) -> None:
        # The stubs of glfw have the C signature; the wrapper passes a list of paths.
        x, y = glfw.get_cursor_pos(self.handle)
        self.dropped += (Dropped(Path(path), x, y) for path in paths)
        self.redraw()

    def _close_asked(self, window: Any) -> None:
        glfw.set_window_should_close(window, False)
        self.wants_to_close = True
        self.redraw()


def _init_glfw() -> None:
    # GLFW prints its errors unless somebody listens.
    messages: list[str] = []
    glfw.set_error_callback(lambda _code, text: messages.append(_text(text)))
    if not glfw.init():
        reason = messages[-1] if messages else "the system gives no reason"
        raise DeviceError(
            f"no window can be opened ({reason}); the editor needs a display, rendering does not"
        )


def on_screen(size: tuple[int, int]) -> tuple[int, int]:
    """A width and a height no larger than what the first screen has room for, beside bars of the desktop."""
    screen = glfw.get_primary_monitor()
    if not screen:
        return size
    _, _, width, height = glfw.get_monitor_workarea(screen)
    # Where nobody knows the room it is 0.
    return min(size[0], width or size[0]), min(size[1], height or size[1])


def _screen_at(x: int, y: int) -> Any:
    """The monitor on which a point of the desktop is; the first one where it is on none."""
    for screen in glfw.get_monitors():
        (left, top), mode = glfw.get_monitor_pos(screen), glfw.get_video_mode(screen)
        if 0 <= x - left < mode.size.width and 0 <= y - top < mode.size.height:
            return screen
    return glfw.get_primary_monitor()


def _text(message: Any) -> str:
    return message.decode(errors="replace") if isinstance(message, bytes) else str(message)
