"""The thread between window and rendering. Times in here are limits for a machine that is busy."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
import PIL.Image
import pytest
from support.null_renderer import NullRenderer
from support.small_scenes import mixed_scene

from incpt.core.errors import DeviceError
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene.model import Scene
from incpt.viewer.renderer import (
    Building,
    CopiedPicture,
    Copy,
    Export,
    Exported,
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
    Renderer,
    Restart,
    TakeNow,
    Waiting,
)
from incpt.viewer.threaded import ThreadedRenderer
from incpt.viewer.view import Frame, View

PATIENCE = 60.0


@pytest.fixture
def renderer(device: Device) -> Iterator[ThreadedRenderer]:
    renderer = ThreadedRenderer(device)
    yield renderer
    renderer.close()
    assert not renderer.is_alive


_unread: WeakKeyDictionary[Renderer, list[Message]] = WeakKeyDictionary()


def wait_for(renderer: Renderer, kind: type, condition: Callable[..., bool] = lambda _: True) -> Message:
    """The next message of that kind that meets the condition."""
    deadline = time.monotonic() + PATIENCE
    unread = _unread.setdefault(renderer, [])
    seen: list[Message] = []
    while time.monotonic() < deadline:
        unread += renderer.poll()
        while unread:
            seen.append(unread.pop(0))
            if isinstance(seen[-1], kind) and condition(seen[-1]):
                return seen[-1]
        time.sleep(0.002)
    raise AssertionError(f"no {kind.__name__} among {[type(message).__name__ for message in seen]}")


def moved(scene: Scene) -> Scene:
    return scene.with_object("red cube", position=(0.2, 0.5, 0.4))


def test_shows_the_latest_view_until_it_rests(renderer: ThreadedRenderer) -> None:
    renderer.show(View(mixed_scene(), target_spp=2))
    end = View(moved(mixed_scene()), target_spp=20)
    renderer.show(end)
    frame = wait_for(renderer, Frame, lambda frame: frame.resting and frame.view == end)
    assert isinstance(frame, Frame)
    assert frame.pictures[0].image.shape == (28, 44, 4) and frame.pictures[0].tile_spp.min() >= 16
    assert renderer.poll() == []


def test_wakes_the_window_and_keeps_the_latest_frame_only(device: Device) -> None:
    woken = threading.Event()
    renderer = ThreadedRenderer(device, woken.set)
    try:
        renderer.show(View(mixed_scene(), step_ms=2))
        assert woken.wait(PATIENCE)
        time.sleep(0.3)
        messages = renderer.poll()
        assert len([message for message in messages if isinstance(message, Frame)]) == 1
    finally:
        renderer.close()


def test_answers_requests(renderer: ThreadedRenderer, tmp_path: Path) -> None:
    renderer.request(Pick((0.5, 0.5), additive=True))
    scene = mixed_scene()
    renderer.show(View(scene, target_spp=2))
    assert wait_for(renderer, Picked) == Picked((0.5, 0.5), "red cube", True)
    renderer.request(Pick((0.0, 0.0)))
    assert wait_for(renderer, Picked) == Picked((0.0, 0.0), None, False)
    renderer.request(PickBox((0.48, 0.48), (0.52, 0.52), takes_out=True))
    assert wait_for(renderer, PickedBox) == PickedBox(("red cube",), True)
    renderer.request(PickPlace((0.5, 0.5)))
    place = wait_for(renderer, PickedPlace)
    assert isinstance(place, PickedPlace) and place.place is not None and abs(place.place[0]) < 0.1
    renderer.request(Export(tmp_path / "a.exr", aovs=True))
    assert wait_for(renderer, Exported) == Exported(tmp_path / "a.exr", mixed_scene().settings.size)
    assert (tmp_path / "a.exr").stat().st_size > 1000
    renderer.show(View(scene, target_spp=3))
    wait_for(renderer, Frame, lambda frame: frame.resting and frame.view.target_spp == 3)
    renderer.request(Pin(True))
    frame = wait_for(renderer, Frame, lambda frame: frame.resting and frame.pictures[0].error == 0)
    renderer.request(Restart())
    again = wait_for(renderer, Frame, lambda frame: frame.resting)
    assert isinstance(frame, Frame) and isinstance(again, Frame)
    assert again.pictures[0].image is not frame.pictures[0].image and again.pictures[0].error < 1e-3


def until(renderer: Renderer, last: Message) -> list[Message]:
    """All messages up to that one."""
    said: list[Message] = []
    end = time.monotonic() + PATIENCE
    while last not in said:
        assert time.monotonic() < end, said
        said += renderer.poll()
        time.sleep(0.005)
    return said


def test_what_takes_the_picture_waits_until_it_is_whole(renderer: ThreadedRenderer, tmp_path: Path) -> None:
    scene = mixed_scene()
    edited = moved(scene)
    renderer.show(View(scene, target_spp=8))
    wait_for(renderer, Frame, lambda frame: frame.resting)
    export, other = Export(tmp_path / "a.png"), Export(tmp_path / "b.png")
    renderer.show(View(edited, target_spp=8, paused=True))
    for request in (export, Copy(), export, Pin(True)):
        renderer.request(request)
    wait_for(renderer, Waiting, lambda told: told.requests == (export, Copy(), Pin(True)))
    renderer.request(Pin(False))
    wait_for(renderer, Waiting, lambda told: told.requests == (export, Copy()))
    assert not (tmp_path / "a.png").exists()
    renderer.request(TakeNow())
    said = until(renderer, Waiting(()))
    assert [one.path for one in said if isinstance(one, Exported)] == [export.path]
    (copied,) = [one for one in said if isinstance(one, CopiedPicture)]
    assert copied.pixels.shape == (*scene.settings.size[::-1], 3)
    renderer.request(other)
    wait_for(renderer, Waiting, lambda told: told.requests == (other,))
    renderer.request(Forget())
    wait_for(renderer, Waiting, lambda told: told.requests == ())
    renderer.request(other)
    renderer.show(View(edited, target_spp=8))
    wait_for(renderer, Exported)
    before, after = (np.asarray(PIL.Image.open(path.path), float) for path in (export, other))
    difference = np.abs(before - after)
    assert difference.max() > 60, "one shows what moved, the other does not"


def test_problem_of_a_request_or_an_edit_ends_nothing(
    renderer: ThreadedRenderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    renderer.show(View(mixed_scene(), target_spp=2))
    wait_for(renderer, Frame)
    renderer.request(Export(tmp_path / "missing" / "a.png"))
    problem = wait_for(renderer, Problem)
    assert isinstance(problem, Problem) and not problem.fatal and "missing" in problem.text

    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("incpt.accel.top_level.build_top", fail)
    renderer.show(View(moved(mixed_scene()), target_spp=3))
    problem = wait_for(renderer, Problem)
    assert problem == Problem("memory ran out; use a smaller image or scene")
    wait_for(renderer, Frame, lambda frame: frame.resting and frame.pictures[0].tile_spp.min() == 3)


def test_device_that_is_not_there_is_a_fatal_problem() -> None:
    renderer = ThreadedRenderer("no such device")
    renderer.show(View(mixed_scene()))
    problem = wait_for(renderer, Problem)
    assert isinstance(problem, Problem) and problem.fatal and "no such device" in problem.text
    renderer.request(Pick((0.5, 0.5)))
    renderer.close()
    renderer.close()


def test_device_that_fails_in_a_step_is_a_fatal_problem(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise DeviceError("the device is gone")

    monkeypatch.setattr(Session, "step", fail)
    renderer = ThreadedRenderer(device)
    renderer.show(View(mixed_scene()))
    assert wait_for(renderer, Problem) == Problem("the device is gone", fatal=True)
    renderer.close()


def test_tells_of_kernels_and_closes_while_they_are_built(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device, "built", set())
    renderer = ThreadedRenderer(device)
    renderer.show(View(mixed_scene()))
    building = wait_for(renderer, Building)
    assert isinstance(building, Building) and 0 < building.done <= building.total
    renderer.close()
    assert not renderer.is_alive


def test_closes_without_a_view() -> None:
    ThreadedRenderer("no such device").close()


def test_null_renderer_records_and_answers() -> None:
    renderer = NullRenderer()
    renderer.picks[0.5, 0.5] = "red cube"
    renderer.show(View(mixed_scene()))
    renderer.request(Pick((0.5, 0.5), additive=True))
    renderer.request(Pick((0.1, 0.1)))
    assert renderer.poll() == [Picked((0.5, 0.5), "red cube", True), Picked((0.1, 0.1), None, False)]
    assert renderer.poll() == [] and len(renderer.views) == 1 and len(renderer.requests) == 2
    renderer.close()
    assert renderer.closed


def test_the_window_draws_before_a_drag_goes_on(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    if not device.is_cpu:
        pytest.skip("only a device that is the processor is in the window's way")
    monkeypatch.setattr("incpt.viewer.threaded.DRAWING_SECONDS", PATIENCE)
    renderer = ThreadedRenderer(device)
    try:
        scene = mixed_scene(nor=4)
        renderer.show(View(scene, step_ms=2))
        wait_for(renderer, Frame, lambda frame: frame.pictures[0].tile_spp.min() >= 2)
        edited = moved(scene)

        def answers(frame: Frame) -> bool:
            picture = frame.pictures[0]
            return frame.view.scene is edited and bool(picture.error_left or picture.replaced.any())

        renderer.show(View(edited, before=scene, step_ms=2))
        wait_for(renderer, Frame, answers)
        time.sleep(0.3)
        assert renderer.poll() == []
        # The next edit, and the end of the drag, are not kept waiting.
        renderer.show(View(scene, before=scene, step_ms=2))
        wait_for(renderer, Frame, lambda frame: frame.view.scene is scene)
    finally:
        renderer.close()
