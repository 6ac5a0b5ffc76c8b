"""`incpt bench latency`: how soon the editor answers, measured on a real window on a virtual display.

What is timed begins with the motion of the pointer, which the X server is told directly: as xdotool does it,
but without the start of a program in the time. It ends when the frame has been drawn and swapped; what the
screen takes after that is not the editor's.
"""

from __future__ import annotations

import ctypes
import itertools
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import as_file, files
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, TypeVar

from rich.table import Table

from incpt.benchmarks.kit import environment, experiment, options
from incpt.benchmarks.kit.desktop import Hand, virtual_display
from incpt.benchmarks.kit.experiment import Outcome, Task, Work
from incpt.benchmarks.kit.store import Results, Store
from incpt.benchmarks.kit.tables import print_table
from incpt.benchmarks.kit.timing import summary
from incpt.device.device import Device
from incpt.formats import registry

if TYPE_CHECKING:
    from incpt.ui.app import App

T = TypeVar("T")

NAME = "latency"
SCREEN = (1440, 900)
OBJECT = "red cube"
REST_SECONDS = 0.4
"""Between two edits that are measured one by one."""
MOUSE_SECONDS = 1 / 125
"""Between two reports of a common mouse."""
SWEEP_SECONDS = 4.0
EDIT, DRAG, ORBIT, START_CACHED, START_EMPTY = "edit", "drag", "orbit", "start cached", "start empty"
WHAT = {
    EDIT: "one step of a drag, to the first updated tile on the screen, ms",
    DRAG: "dragging without a pause, pictures a second",
    ORBIT: "orbiting without a pause, pictures a second",
    START_CACHED: "start to first picture, kernels cached, s",
    START_EMPTY: "start to first picture, kernels compiled, s",
}
TARGETS = {EDIT: "at most 100", ORBIT: "at least 10", START_CACHED: "at most 2"}


@dataclass(frozen=True)
class Plan:
    """What is measured: `edits` single steps, `sweeps` of 4 seconds, `starts` of each kind."""

    size: tuple[int, int] = (960, 540)
    edits: int = 30
    sweeps: int = 3
    starts: int = 5
    cold_starts: int = 2


class Pointer:
    """The mouse of a display, moved through libX11."""

    def __init__(self) -> None:
        self._x11 = ctypes.CDLL("libX11.so.6")
        for function in (self._x11.XOpenDisplay, self._x11.XDefaultRootWindow):
            function.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(None))
        self._root = ctypes.c_void_p(self._x11.XDefaultRootWindow(self._display))

    def move(self, at: tuple[float, float]) -> None:
        """To that place of the screen, at once."""
        none = ctypes.c_void_p(0)
        self._x11.XWarpPointer(self._display, none, self._root, 0, 0, 0, 0, round(at[0]), round(at[1]))
        self._x11.XFlush(self._display)

    def close(self) -> None:
        self._x11.XCloseDisplay(self._display)


@contextmanager
def desktop(plan: Plan) -> Iterator[Hand]:
    """The editor on the example scene, with a whole picture of the plan's size."""
    from incpt.ui.app import App
    from incpt.ui.editor.document import Document

    with tempfile.TemporaryDirectory() as folder, virtual_display(SCREEN):
        os.environ["INCPT_CONFIG_DIR"] = folder
        app = App(Document(_example(plan.size)))
        try:
            hand = Hand(app)
            hand.pump(lambda: _has_samples(app, 4))
            yield hand
        finally:
            app.close()
            del os.environ["INCPT_CONFIG_DIR"]


def _example(size: tuple[int, int]) -> Any:
    with as_file(files("incpt.scenes") / "editing.toml") as path:
        scene = registry.load(path)
    return replace(scene, settings=replace(scene.settings, size=size))


def _has_samples(app: App, count: int) -> bool:
    frame = app.editor.frame
    return frame is not None and not frame.is_preview and int(frame.pictures[-1].tile_spp.min()) >= count


# ------------------------------------------------------------------------------------------------ edits


def _alone(function: Callable[..., T], *arguments: object) -> T:
    """What the function returns in a process of its own. Threads of a device that is open already would have
    the priority of those that opened it, and not that of the editor's renderer."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def _edits(plan: Plan, work: Work) -> Outcome:
    work.timing_starts()
    return Outcome({"what": WHAT[EDIT]}, [{"ms": 1e3 * seconds} for seconds in _alone(edit_seconds, plan)])


def edit_seconds(plan: Plan) -> list[float]:
    """Single steps of a drag of a field, with a rest between them: seconds until each was answered."""
    found = []
    with desktop(plan) as hand, _held(hand, "Position X") as (pointer, place):
        for i in range(plan.edits):
            _idle(hand.app, REST_SECONDS + 0.05 * (i % 4))
            found.append(_answer_seconds(hand.app, pointer, (place[0] + 4 * (i + 1), place[1])))
    return found


@contextmanager
def _held(hand: Hand, field: str) -> Iterator[tuple[Pointer, tuple[float, float]]]:
    """The left button held down on a field of the selected object, a first bit of the drag behind it."""
    hand.click(f"object {OBJECT}")
    pointer = Pointer()
    x, y = hand.middle(field)
    with hand.pressed((x - 60, y)):
        pointer.move((x - 50, y))
        hand.pump(frames=6)
        yield pointer, (x - 50, y)
    pointer.close()


def _answer_seconds(app: App, pointer: Pointer, place: tuple[float, float]) -> float:
    """From the motion until a frame is on the screen that shows what moved, or a tile finished after its
    edit."""
    before = app.editor.shown
    began = time.perf_counter()
    pointer.move(place)
    while time.perf_counter() - began < 30.0:
        app.turn()
        frame = app.shown_frame
        scene = app.editor.shown
        if scene is not before and frame is not None and frame.view.scene is scene and _is_updated(frame):
            app.window.context.finish()
            return time.perf_counter() - began
    raise TimeoutError("the edit was not answered within 30 s")


def _is_updated(frame: Any) -> bool:
    # Strategies that compare scenes show what moved from the first picture on.
    picture = frame.pictures[-1]
    return bool(picture.replaced.any()) or bool(picture.error_left)


def _idle(app: App, seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        app.turn()


# ----------------------------------------------------------------------------------------- without a pause


def _sweep(kind: str, plan: Plan, work: Work) -> Outcome:
    work.timing_starts()
    return Outcome(_alone(sweep, kind, plan))


def sweep(kind: str, plan: Plan) -> dict[str, float]:
    """The mouse moves all the time; counted are pictures of new scenes on the screen."""
    with desktop(plan) as hand:
        if kind == DRAG:
            with _held(hand, "Rotation Y") as (_, place):
                return _counted(hand, lambda i: (place[0] + i % 200 - 100, place[1]))
        start = hand.in_picture(0.5, 0.5)
        with hand.pressed(start, button=2):
            return _counted(hand, lambda i: (start[0] + 2 * (i % 250), start[1] + (i % 250) / 5))


def _counted(hand: Hand, place: Callable[[int], tuple[float, float]]) -> dict[str, float]:
    """Pictures of new scenes that come to the screen while a thread moves the pointer."""
    app, stop = hand.app, threading.Event()
    mover = threading.Thread(target=_keep_moving, args=(place, stop), daemon=True)
    mover.start()
    times, frames, shown = [], 0, None
    end = time.perf_counter() + SWEEP_SECONDS
    while time.perf_counter() < end:
        app.turn()
        frames += 1
        frame = app.shown_frame
        if frame is not None and frame.view.scene is not shown and _is_updated(frame):
            app.window.context.finish()
            shown = frame.view.scene
            times.append(time.perf_counter())
    stop.set()
    mover.join()
    gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
    return {
        "pictures_per_second": len(gaps) / (times[-1] - times[0]),
        "worst_gap_ms": 1e3 * max(gaps),
        "frames_per_second": frames / SWEEP_SECONDS,
    }


def _keep_moving(place: Callable[[int], tuple[float, float]], stop: threading.Event) -> None:
    pointer = Pointer()
    for i in itertools.count():
        if stop.wait(MOUSE_SECONDS):
            break
        pointer.move(place(i))
    pointer.close()


# ------------------------------------------------------------------------------------------------ start


def _start(plan: Plan, is_cached: bool, work: Work) -> Outcome:
    """From the start of the program to a whole picture (of reduced resolution, where one of full size takes
    longer than a step) on the screen."""
    with tempfile.TemporaryDirectory() as folder, virtual_display(SCREEN):
        caches = {} if is_cached else dict.fromkeys(("POCL_CACHE_DIR", "XDG_CACHE_HOME"), folder)
        program = f"from {__name__} import first_picture; first_picture({plan.size})"
        variables = {**os.environ, **caches, "INCPT_CONFIG_DIR": folder}
        work.timing_starts()
        began = time.monotonic()
        found = subprocess.run(
            [sys.executable, "-c", program],
            env=variables,
            check=True,
            capture_output=True,
            text=True,
            timeout=300,
        )
    window, picture = (float(moment) - began for moment in found.stdout.split())
    return Outcome({"window_s": window, "picture_s": picture})


def first_picture(size: tuple[int, int]) -> None:
    """Run in a program of its own: open the editor, and print the moments of the first frame of the window
    and of the first picture in it."""
    from incpt.ui.app import App
    from incpt.ui.editor.document import Document

    app = App(Document(_example(size)))
    app.turn()
    app.window.context.finish()
    window = time.monotonic()
    while app.shown_frame is None or app.shown_frame.pictures[-1].image[..., 3].min() == 0:
        app.turn()
    app.window.context.finish()
    print(window, time.monotonic())
    app.close()


# -------------------------------------------------------------------------------------------- the command


def tasks(plan: Plan) -> list[Task]:
    """In the order of the table."""
    size = {"size": list(plan.size)}
    made = [Task(EDIT, {"measure": EDIT, **size, "edits": plan.edits}, partial(_edits, plan), 20)]
    for kind, turn in itertools.product((DRAG, ORBIT), range(plan.sweeps)):
        subject = {"measure": kind, **size, "repetition": turn}
        made.append(Task(f"{kind} {turn + 1}", subject, partial(_sweep, kind, plan), 8))
    for kind, count in ((START_CACHED, plan.starts), (START_EMPTY, plan.cold_starts)):
        for turn in range(count):
            subject = {"measure": kind, **size, "repetition": turn}
            run = partial(_start, plan, kind == START_CACHED)
            made.append(Task(f"{kind} {turn + 1}", subject, run, 3))
    return made


def figures(results: Results, measure: str) -> list[float]:
    """What was measured: milliseconds, pictures a second, or seconds, as WHAT says."""
    if measure == EDIT:
        return [row["ms"] for record in results.where(measure=EDIT) for row in record.rows]
    name = "picture_s" if measure in (START_CACHED, START_EMPTY) else "pictures_per_second"
    return [record.values[name] for record in results.where(measure=measure)]


def table(results: Results) -> Table:
    """Median and worst of each."""
    shown = Table(title="latency", title_justify="left", box=None, pad_edge=False)
    for column in ("", "median", "worst", "target", "n"):
        shown.add_column(column, justify="left" if not column else "right")
    for measure, what in WHAT.items():
        values = figures(results, measure)
        if values:
            worst = min(values) if measure in (DRAG, ORBIT) else max(values)
            median = summary(values).median
            shown.add_row(what, f"{median:.3g}", f"{worst:.3g}", TARGETS.get(measure, ""), str(len(values)))
    return shown


def latency(
    output: options.OutputOption = options.DEFAULT_FOLDER,
    size: options.SizeOption = None,
    repetitions: options.RepetitionsOption = None,
    quick: options.QuickOption = False,
) -> None:
    """How soon the editor answers an edit, orbits and starts, on a virtual display (Xvfb)."""
    plan = Plan(options.parse_size(size, Plan.size))
    if quick:
        plan = replace(plan, edits=8, sweeps=1, starts=2, cold_starts=1)
    if repetitions is not None:
        plan = replace(plan, sweeps=repetitions, starts=repetitions, edits=10 * repetitions)
    for module in ("imgui_bundle", "glfw", "moderngl"):
        options.optional(module, "latency", "ui")
    store = Store(output, NAME)
    found = experiment.run(store, tasks(plan), environment.describe(Device(None)))
    print_table(table(found), found, store)
