"""The renderer as the window sees it: views and requests go in, messages come out, nothing blocks.

`ThreadedRenderer` runs a `Viewer` in a thread of its own. The device is opened in there too, so that the
window stands before the first kernel is compiled. PyOpenCL lets other threads run while the device works.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from incpt.core.errors import DeviceError, InputError, OutputError, one_line
from incpt.device.device import Device
from incpt.scene.model import Scene
from incpt.viewer.denoising import DenoisingThread
from incpt.viewer.finals import FinalQueue
from incpt.viewer.renderer import (
    Building,
    CopiedPicture,
    Copy,
    EndFinal,
    Export,
    Exported,
    Finals,
    Forget,
    Message,
    Pick,
    PickBox,
    Picked,
    PickedBox,
    PickedPlace,
    PickPlace,
    Pin,
    Problem,
    RenderFinal,
    Request,
    TakeNow,
    Waiting,
)
from incpt.viewer.view import Frame, View
from incpt.viewer.viewer import RenderingStoppedError, Viewer

_NICER = 5

DRAWING_SECONDS = 0.025
"""The longest that a drag's next step waits for the window to draw the last one."""
FIGURES_SECONDS = 0.1
"""The time between two Frames with the same picture, since a window redraws for each."""


class ThreadedRenderer:
    """A Viewer on `device` (what chooses one: see `Device`) in a thread. `wake` is called there whenever
    messages are ready."""

    def __init__(
        self, device: Device | str | int | None = None, wake: Callable[[], None] | None = None
    ) -> None:
        self._device = device
        self._wake = wake or (lambda: None)
        self._condition = threading.Condition()
        self._view: View | None = None
        self._requests: deque[Request] = deque()
        self._messages: list[Message] = []
        self._waiting: list[Request] = []
        self._closing = False
        self._images: tuple[object, ...] = ()
        self._posted_at = 0.0
        self._drawn: Scene | None = None
        self._denoiser = DenoisingThread(self._post, lambda text: self._post(Problem(text)))
        self._thread = threading.Thread(target=self._run, name="renderer", daemon=True)
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs: not after `close`, nor after a fatal problem."""
        return self._thread.is_alive()

    def show(self, view: View) -> None:
        with self._condition:
            self._view = view
            self._condition.notify()

    def request(self, request: Request) -> None:
        with self._condition:
            self._requests.append(request)
            self._condition.notify()

    def poll(self) -> list[Message]:
        with self._condition:
            messages, self._messages = self._messages, []
        return messages

    def close(self) -> None:
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join()
        self._denoiser.close()

    def _post(self, message: Message) -> None:
        with self._condition:
            if isinstance(message, Frame | Building | Finals):
                self._messages = [m for m in self._messages if type(m) is not type(message)]
            self._messages.append(message)
        self._wake()

    def _is_worth_showing(self, frame: Frame) -> bool:
        """Whether it has a new picture, or new figures after a while."""
        now = time.perf_counter()
        images = (*(picture.image for picture in frame.pictures), frame.first_hits)
        is_new = len(images) != len(self._images) or any(
            new is not old for new, old in zip(images, self._images, strict=True)
        )
        if not (is_new or frame.resting or now - self._posted_at >= FIGURES_SECONDS):
            return False
        self._images, self._posted_at = images, now
        return True

    def _wait_for_news(self, seen: View | None) -> None:
        """Until there is a request or another view than `seen`, or the window closes."""
        with self._condition:
            self._condition.wait_for(
                lambda: (
                    self._closing
                    or (self._view is not None and (self._view is not seen or bool(self._requests)))
                )
            )

    def _take_requests(self) -> list[Request]:
        with self._condition:
            requests = list(self._requests)
            self._requests.clear()
        return requests

    def _has_edit_after(self, view: View) -> bool:
        latest = self._view
        return latest is not None and latest.scene is not view.scene

    def _run(self) -> None:
        try:
            self._loop()
        except _ClosedError:
            pass
        except (InputError, DeviceError, MemoryError) as error:
            self._post(Problem(_explain(error), fatal=True))
        except Exception as error:
            self._post(Problem(f"unexpected {type(error).__name__}: {one_line(error)}", fatal=True))

    def _report_building(self, done: int, total: int) -> None:
        self._post(Building(done, total))
        if self._closing:
            raise _ClosedError

    def _loop(self) -> None:
        _give_way()
        device = self._device if isinstance(self._device, Device) else Device(self._device)
        self._wait_for_news(None)
        if self._view is None:
            return
        viewer = Viewer(self._view, device, self._report_building)
        finals = FinalQueue(device, self._post, self._report_building, _explain)
        while not self._closing:
            view = self._view
            self._answer_all(viewer, finals, view)
            try:
                frame = viewer.advance(view, partial(self._has_edit_after, view))
            except RenderingStoppedError:
                raise
            except (InputError, DeviceError, MemoryError) as error:
                self._post(Problem(_explain(error)))
                continue
            if frame is not None and self._is_worth_showing(frame):
                self._post(self._denoiser.shown(frame))
                if viewer.device.is_cpu:
                    self._let_draw(frame)
            if not finals.is_idle and viewer.has_answered and not self._has_edit_after(view):
                finals.advance(view.step_ms / 1e3)
            elif frame is None and not viewer.prepare():
                self._wait_for_news(view)

    def _let_draw(self, frame: Frame) -> None:
        """In a drag, leave the processor to the window while it draws the first picture of an edit: on
        software OpenGL a frame takes twice as long beside rendering. The next edit ends it."""
        view, picture = frame.view, frame.pictures[-1]
        # Strategies that compare scenes show what moved from the first picture on.
        shows_edit = bool(picture.error_left) or bool(picture.replaced.any())
        if view.before is None or view.scene is self._drawn or not shows_edit:
            return
        self._drawn = view.scene
        with self._condition:
            self._condition.wait_for(
                lambda: self._closing or bool(self._requests) or self._has_edit_after(view), DRAWING_SECONDS
            )

    def _answer_all(self, viewer: Viewer, finals: FinalQueue, view: View) -> None:
        """Answer what was asked, but for what waits until the picture of the view is whole."""
        before = list(self._waiting)
        for request in self._take_requests():
            match request:
                case Export() | Copy() | Pin(on=True):
                    self._waiting += [request] if request not in self._waiting else []
                case TakeNow():
                    self._answer_waiting(viewer)
                case Forget():
                    self._waiting = []
                case RenderFinal():
                    finals.add(request)
                case EndFinal():
                    finals.end(request.is_kept)
                case _:
                    if isinstance(request, Pin):
                        self._waiting = [one for one in self._waiting if not isinstance(one, Pin)]
                    self._answer(viewer, request)
        if self._waiting and viewer.is_whole(view):
            self._answer_waiting(viewer)
        if self._waiting != before:
            self._post(Waiting(tuple(self._waiting)))

    def _answer_waiting(self, viewer: Viewer) -> None:
        waiting, self._waiting = self._waiting, []
        for request in waiting:
            self._answer(viewer, request)

    def _answer(self, viewer: Viewer, request: Request) -> None:
        try:
            if isinstance(request, Pick):
                self._post(Picked(request.point, viewer.pick(request.point), request.additive))
            elif isinstance(request, PickBox):
                self._post(PickedBox(viewer.pick_box(request.low, request.high), request.takes_out))
            elif isinstance(request, PickPlace):
                self._post(PickedPlace(viewer.session.place_at(request.point)))
            elif isinstance(request, Export):
                denoised = self._denoiser.denoised if request.denoise else None
                viewer.export(request.path, request.aovs, request.exposure, request.curve, denoised)
                self._post(Exported(request.path, viewer.session.size))
            elif isinstance(request, Copy):
                denoised = self._denoiser.denoised if request.denoise else None
                self._post(CopiedPicture(viewer.displayed(request.exposure, request.curve, denoised)))
            elif isinstance(request, Pin):
                viewer.pin_reference(request.on)
            else:
                viewer.restart()
        except (InputError, DeviceError, OutputError, MemoryError) as error:
            self._post(Problem(_explain(error)))


class _ClosedError(Exception):
    """The window closed while kernels were being built."""


def _give_way() -> None:
    """Let the window go first where rendering and drawing share the processor: on Linux a thread has a
    priority of its own, which the threads of a device on the CPU inherit."""
    if sys.platform == "linux":
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + _NICER)


def _explain(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "memory ran out; use a smaller image or scene"
    return one_line(error)
