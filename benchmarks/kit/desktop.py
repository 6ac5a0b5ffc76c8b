"""A virtual desktop (Xvfb) with the editor's window on it, worked by xdotool as a hand would.

The loop of the editor runs in the caller's thread: after each input `pump` turns it until a condition holds,
so nothing sleeps on a guess. Tests, the soak and the pictures of the documentation share it.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from incpt.core.errors import DeviceError
from incpt.ui.rect import Rect

if TYPE_CHECKING:
    from incpt.ui.app import App

PROGRAMS = ("Xvfb", "xdotool")
INSTALL = "apt install xvfb xdotool libgl1 libgl1-mesa-dri"
_START_SECONDS = 20.0
_CLIENT_MESSAGE = 33
"""Type of the event, from X.h."""
_MODIFIERS = {"ctrl": "Control_L", "shift": "Shift_L", "alt": "Alt_L"}
_TYPED_AT_ONCE = 12
_KEY_SECONDS = 0.02
"""Between key down and up: a tap without it falls between two frames."""


def missing_programs() -> list[str]:
    """Programs that a virtual desktop needs and this machine lacks."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


@contextmanager
def virtual_display(size: tuple[int, int] = (1440, 900)) -> Iterator[str]:
    """An X server without a screen of its own, as DISPLAY; yields its name. Raises DeviceError."""
    missing = missing_programs()
    if missing:
        raise DeviceError(f"{', '.join(missing)}: not installed; run {INSTALL}")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size[0]}x{size[1]}x24", "-nolisten", "tcp"],
        pass_fds=(write,),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    before = {name: os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")}
    try:
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        if not number:
            raise DeviceError("Xvfb does not start; run it by hand to see why")
        os.environ["DISPLAY"] = f":{number}"
        os.environ.pop("WAYLAND_DISPLAY", None)
        yield f":{number}"
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        server.terminate()
        server.wait(_START_SECONDS)


class Hand:
    """Mouse and keyboard on an editor. Widgets are named as `incpt.ui.widgets.places` notes them."""

    def __init__(self, app: App) -> None:
        self.app = app

    def pump(self, until: Callable[[], bool] | None = None, frames: int = 4, timeout: float = 60.0) -> None:
        """Turn the editor's loop until a condition holds, then `frames` frames more, so that what was asked
        for is drawn. Raises TimeoutError."""
        end = time.monotonic() + timeout
        while until is not None and not until():
            if time.monotonic() > end:
                raise TimeoutError(f"the editor did not come to it within {timeout:g} s; {self._state()}")
            self.app.turn()
        while frames > 0 or _has_input():
            self.app.window.redraw()
            self.app.turn()
            frames -= 1

    def place(self, name: str) -> Rect[float]:
        """Where a widget is, in points. Raises LookupError with the names there are."""
        from incpt.ui.widgets import places

        rect = places.find(name)
        if rect is None:
            raise LookupError(f"no {name!r} on the screen; there are {', '.join(sorted(places.names()))}")
        return rect

    def middle(self, name: str) -> tuple[float, float]:
        """The middle of a widget."""
        return self.place(name).middle

    def in_picture(self, x: float, y: float) -> tuple[float, float]:
        """The place of a point of the picture, given in units of the picture from its top left."""
        picture = self.place("picture")
        return picture.left + x * picture.width, picture.top + y * picture.height

    def show_tab(self, name: str) -> None:
        """Bring the panel of that name to the front by a click on its tab."""
        from imgui_bundle import imgui

        tab = imgui.internal.find_window_by_name(name).dc.dock_tab_item_rect
        self.click(((tab.min.x + tab.max.x) / 2, (tab.min.y + tab.max.y) / 2))

    def move(self, at: tuple[float, float]) -> None:
        """The mouse to that place."""
        _xdotool("mousemove", str(round(at[0])), str(round(at[1])))
        self.pump(frames=2)

    def click(self, at: str | tuple[float, float], button: int = 1, times: int = 1) -> None:
        """A click on a widget or a place; `button` 1 left, 2 middle, 3 right."""
        self.move(self.middle(at) if isinstance(at, str) else at)
        for i in range(times):
            with _patient_double_clicks(i > 0):
                _xdotool("mousedown", str(button))
                self.pump(frames=1)
                _xdotool("mouseup", str(button))
                self.pump(frames=1)
        self.pump(frames=3)

    def drag(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        button: int = 1,
        steps: int = 6,
        between: Callable[[], object] | None = None,
    ) -> None:
        """Press, move in steps, release; `between` is called after each step, while the button is down."""
        with self.pressed(start, button):
            for i in range(1, steps + 1):
                share = i / steps
                self.move((start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share))
                if between is not None:
                    between()
        self.pump(frames=2)

    @contextmanager
    def pressed(self, at: tuple[float, float], button: int = 1) -> Iterator[None]:
        """While a mouse button is held down that was pressed at that place."""
        self.move(at)
        _xdotool("mousedown", str(button))
        self.pump(frames=2)
        try:
            yield
        finally:
            _xdotool("mouseup", str(button))
            self.pump(frames=2)

    def key(self, keys: str) -> None:
        """A tap on a key such as "ctrl+z"; keys are named as X names them."""
        codes = _key_codes(keys)
        _xdotool("keydown", codes)
        time.sleep(_KEY_SECONDS)
        self.pump(frames=2)
        # The modifiers last: a key that repeats because frames take long must not become a letter.
        _xdotool("keyup", "+".join(reversed(codes.split("+"))))
        self.pump(frames=3)

    @contextmanager
    def holding(self, key: str) -> Iterator[None]:
        """While a key is held down."""
        codes = _key_codes(key)
        _xdotool("keydown", codes)
        self.pump(frames=2)
        try:
            yield
        finally:
            _xdotool("keyup", codes)
            self.pump(frames=2)

    def type(self, text: str) -> None:
        """Type a text into what has the focus."""
        for start in range(0, len(text), _TYPED_AT_ONCE):
            _xdotool("type", "--delay", "4", "--", text[start : start + _TYPED_AT_ONCE])
            self.pump(frames=2)

    def type_into(self, name: str, text: str) -> None:
        """Double-click a field, type a text in place of what is there, and press Enter."""
        self.click(name, times=2)
        self.key("ctrl+a")
        self.type(text)
        self.key("Return")

    def close_window(self) -> None:
        """Ask the window to close, as its button in a title bar does."""
        import glfw

        ask_to_close(glfw.get_x11_window(self.app.window.handle))
        self.pump(frames=4)

    def screenshot(self, path: Path | None = None) -> npt.NDArray[np.uint8]:
        """(H, W, 3) what the window shows now, row 0 on top; also written as PNG where a path is given."""
        from PIL import Image

        self.pump(frames=3)
        pixels = self.app.read_pixels()
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(pixels).save(path)
        return pixels

    def _state(self) -> str:
        editor = self.app.editor
        notices = [notice.text for notice in editor.notices.said]
        mode = editor.frame.pictures[-1].mode if editor.frame is not None else None
        return f"mode {mode}, selection {editor.selection.names}, notices {notices}"


class _ClientMessage(ctypes.Structure):
    """XClientMessageEvent, in the room of an XEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong),
        ("message_type", ctypes.c_ulong),
        ("format", ctypes.c_int),
        ("values", ctypes.c_long * 5),
        ("room", ctypes.c_long * 12),
    )


def ask_to_close(window: int) -> None:
    """Send the window with that X id what a window manager sends when its close button is pressed. xdotool
    cannot in the versions that distributions still ship."""
    with _connection() as (x11, display):
        protocols, delete = (
            x11.XInternAtom(display, name, False) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW")
        )
        message = _ClientMessage(type=_CLIENT_MESSAGE, window=window, message_type=protocols, format=32)
        message.values[0] = delete
        x11.XSendEvent(display, ctypes.c_ulong(window), False, ctypes.c_long(0), ctypes.byref(message))
        x11.XSync(display, False)


@contextmanager
def _connection() -> Iterator[tuple[ctypes.CDLL, ctypes.c_void_p]]:
    """libX11 and a connection to the display."""
    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = ctypes.c_ulong
    x11.XStringToKeysym.restype = ctypes.c_ulong
    x11.XKeysymToKeycode.restype = ctypes.c_ubyte
    display = ctypes.c_void_p(x11.XOpenDisplay(None))
    try:
        yield x11, display
    finally:
        x11.XCloseDisplay(display)


def _key_codes(keys: str) -> str:
    """Keys such as "ctrl+z" by their codes on the keyboard. By name, xdotool holds Alt with a function key
    where the keyboard's description says that Alt leaves it what it is, as that of xkb-data 2.48 does."""
    names = [_MODIFIERS.get(name, name) for name in keys.split("+")]
    with _connection() as (x11, display):
        symbols = [ctypes.c_ulong(x11.XStringToKeysym(name.encode())) for name in names]
        codes = [x11.XKeysymToKeycode(display, symbol) for symbol in symbols]
    if 0 in codes:
        raise LookupError(f"no key {names[codes.index(0)]!r} on this keyboard")
    # Of three digits: one alone is the name of a key.
    return "+".join(f"{code:03d}" for code in codes)


@contextmanager
def _patient_double_clicks(on: bool) -> Iterator[None]:
    """Meanwhile, where `on`, a second click may come late, as it does while frames take long."""
    from imgui_bundle import imgui

    io = imgui.get_io()
    usual = io.mouse_double_click_time, io.mouse_single_click_delay
    if on:
        io.mouse_double_click_time, io.mouse_single_click_delay = _START_SECONDS, 2 * _START_SECONDS
    try:
        yield
    finally:
        io.mouse_double_click_time, io.mouse_single_click_delay = usual


def _has_input() -> bool:
    """Whether imgui has not come to all of the input yet: of keys and letters it takes some a frame."""
    from imgui_bundle import imgui

    return len(imgui.get_current_context().input_events_queue) > 0


def _xdotool(*arguments: str) -> None:
    command: Sequence[str] = ("xdotool", *arguments)
    subprocess.run(command, check=True, capture_output=True, timeout=_START_SECONDS)
