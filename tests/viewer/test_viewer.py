"""What a viewer is shown while the scene is edited; with a clock that only rendering moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from support.small_scenes import mixed_scene

from incpt.accel import bvh
from incpt.core.errors import DeviceError, InputError
from incpt.device.device import Device
from incpt.render.modes import Mode
from incpt.render.session import Session, StepReport
from incpt.scene.model import Scene
from incpt.viewer.pace import Pace
from incpt.viewer.view import Frame, View
from incpt.viewer.viewer import Viewer

SLOW = 6e4
"""Paths a second with which the test picture (1,536 paths) does not fit a step of 10 ms."""
FAST = 1e7


class Clock:
    """Seconds pass only while a step renders: `speed` paths in each, and `stall` seconds in the next step."""

    def __init__(self, speed: float) -> None:
        self.now, self.speed, self.stall = 100.0, speed, 0.0
        self.edits = 0

    def __call__(self) -> float:
        return self.now


MakeViewer = Callable[..., tuple[Viewer, Clock]]


@pytest.fixture
def make_viewer(device: Device, monkeypatch: pytest.MonkeyPatch) -> MakeViewer:
    def make(view: View, speed: float = SLOW) -> tuple[Viewer, Clock]:
        clock = Clock(speed)
        step, edit = Session.step, Session.edit

        def timed_step(session: Session, slots: int | None = None) -> StepReport:
            report = step(session, slots)
            clock.now += report.paths / clock.speed + clock.stall
            clock.stall = 0.0
            return report

        def counted_edit(*args: object, **more: object) -> object:
            clock.edits += 1
            return edit(*args, **more)  # type: ignore[arg-type]

        monkeypatch.setattr(Session, "step", timed_step)
        monkeypatch.setattr(Session, "edit", counted_edit)
        return Viewer(view, device, clock=clock), clock

    return make


def view_of(scene: Scene, **changes: object) -> View:
    return View(scene, **{"step_ms": 10.0, **changes})  # type: ignore[arg-type]


def frames_until_rest(viewer: Viewer, view: View, most: int = 2000) -> list[Frame]:
    frames = []
    for _ in range(most):
        frame = viewer.advance(view)
        assert frame is not None
        frames.append(frame)
        if frame.resting:
            assert viewer.advance(view) is None
            return frames
    raise AssertionError("does not come to rest")


def test_the_next_edit_is_prepared_once_there_is_a_picture(
    make_viewer: MakeViewer, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device, "built", set())
    scene = mixed_scene(strategy="impact")
    view = view_of(scene, target_spp=4)
    viewer, _ = make_viewer(view, speed=FAST)
    pieces: list[Mode] = []
    prepare = Session.prepare_edit
    monkeypatch.setattr(
        Session, "prepare_edit", lambda session: (pieces.append(session.mode), prepare(session))[1]
    )
    frames = frames_until_rest(viewer, view)
    assert 0 < len(pieces) < len(frames) and set(pieces) == {Mode.REFINE}
    while viewer.prepare():
        assert len(pieces) < 100
    assert len(pieces) > 10
    with monkeypatch.context() as patch:
        patch.setattr(device, "build", None)
        frames_until_rest(viewer, view_of(moved(scene), target_spp=5))


def test_what_cannot_be_prepared_is_left_to_the_edit(
    make_viewer: MakeViewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = mixed_scene(strategy="impact")
    viewer, _ = make_viewer(view_of(scene), speed=FAST)
    tried: list[int] = []

    def fail(session: Session) -> bool:
        tried.append(1)
        raise DeviceError("no memory")

    monkeypatch.setattr(Session, "prepare_edit", fail)
    frames_until_rest(viewer, view_of(scene, target_spp=9))
    assert len(tried) == 1 and not viewer.prepare()


def run_to(viewer: Viewer, view: View, condition: Callable[[Frame], bool], most: int = 500) -> Frame:
    for _ in range(most):
        frame = viewer.advance(view)
        assert frame is not None
        if condition(frame):
            return frame
    raise AssertionError("never happens")


def assert_fresh(device: Device, frame: Frame, scene: Scene, spp: int) -> None:
    """The frame shows what a new session would."""
    # Of a copy of the scene no tables live, so that they are made without those of the scenes before.
    fresh = Session(replace(scene), device=device)
    fresh.render(spp)
    picture = frame.pictures[-1]
    assert (picture.tile_spp == spp).all()
    np.testing.assert_allclose(picture.image[..., :3], fresh.image(), rtol=2e-4, atol=1e-5)
    assert (picture.image[..., 3] == 1).all()


def moved(scene: Scene, x: float = 0.2) -> Scene:
    return scene.with_object("red cube", position=(x, 0.5, 0.4))


def turned(scene: Scene, fov_y: float) -> Scene:
    return scene.with_camera(fov_y=fov_y)


def test_starts_with_a_preview_and_converges_to_the_fresh_picture(
    make_viewer: MakeViewer, device: Device
) -> None:
    if not device.is_cpu:
        pytest.skip("other devices are taken for fast until they have shown that they are not")
    scene = mixed_scene(size=(176, 112))
    viewer, _ = make_viewer(view_of(scene), speed=1e5)
    view = view_of(scene, target_spp=4)
    frames = frames_until_rest(viewer, view)
    assert frames[0].is_preview and frames[0].pictures[0].image.shape[0] < 112
    assert (frames[0].pictures[0].image[..., 3] == 1).all()
    assert not any(frame.is_preview for frame in frames[1:])
    assert (frames[1].pictures[0].image[..., 3] == 0).any()
    assert_fresh(device, frames[-1], scene, 4)


def test_fast_device_shows_no_preview(make_viewer: MakeViewer, device: Device) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene), speed=FAST)
    run_to(viewer, view_of(scene), lambda frame: frame.pictures[0].mode is Mode.REFINE)
    for fov_y in range(43, 60):
        frame = viewer.advance(view_of(turned(scene, fov_y)))
        assert frame is not None and not frame.is_preview
        assert frame.pictures[0].image.shape == (28, 44, 4) and frame.pictures[0].replaced.all()
    end = frames_until_rest(viewer, view_of(turned(scene, 59), target_spp=3))[-1]
    assert_fresh(device, end, turned(scene, 59), 3)


def test_camera_moves_in_previews_and_rests_at_full_resolution(
    make_viewer: MakeViewer, device: Device
) -> None:
    scene = mixed_scene()
    viewer, clock = make_viewer(view_of(scene, target_spp=2))
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    for fov_y in range(43, 50):
        view = view_of(turned(scene, fov_y), target_spp=2)
        frame = run_to(viewer, view, lambda f, v=view: f.view == v)
        assert frame.is_preview and (frame.pictures[0].image[..., 3] == 1).all()
        assert frame.pictures[0].replaced.all()
    changed = clock.now
    frame = run_to(viewer, view, lambda frame: not frame.is_preview)
    assert 0.1 < clock.now - changed < 0.3
    assert frame.pictures[0].image.shape == (28, 44, 4)
    tile_of = frame.pictures[0].grid.tile_of_pixels()
    np.testing.assert_array_equal(frame.pictures[0].image[..., 3] == 1, frame.pictures[0].replaced[tile_of])
    assert_fresh(device, frames_until_rest(viewer, view)[-1], view.scene, 2)


def test_end_of_a_drag_of_the_environment_returns_at_once(make_viewer: MakeViewer) -> None:
    scene = mixed_scene(strategy="spiral")
    viewer, clock = make_viewer(view_of(scene))
    run_to(
        viewer, view_of(scene), lambda frame: frame.pictures[0].tile_spp.min() > 0 and not frame.is_preview
    )
    last = scene.with_environment(intensity=0.7)
    assert run_to(viewer, view_of(last, before=scene), lambda frame: frame.is_preview)
    began = clock.now
    run_to(viewer, view_of(last), lambda frame: not frame.is_preview)
    assert clock.now - began < 0.05


def test_drag_repeats_less_and_ends_with_the_whole_nor(make_viewer: MakeViewer, device: Device) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False, nor=32)
    viewer, _ = make_viewer(view_of(scene, target_spp=2), speed=FAST)
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    for x in (0.2, 0.3, 0.4):
        view = view_of(moved(scene, x), before=scene, drag_nor=4)
        frame = viewer.advance(view)
        assert frame is not None and frame.pictures[0].mode in (Mode.INCREMENTAL, Mode.REFINE)
        assert frame.pictures[0].tile_spp[frame.pictures[0].replaced].tolist()
        assert set(frame.pictures[0].tile_spp[frame.pictures[0].replaced]) == {4}
    # Old place and new place: the spiral starts between them.
    end = view_of(moved(scene, 0.4), target_spp=33)
    frame = viewer.advance(end)
    assert frame is not None
    assert set(frame.pictures[0].tile_spp[frame.pictures[0].replaced]) == {32}
    assert_fresh(device, frames_until_rest(viewer, end)[-1], end.scene, 33)


def test_drag_is_measured_from_where_it_began(make_viewer: MakeViewer) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False, nor=32)
    viewer, _ = make_viewer(view_of(scene, target_spp=2), speed=1.2e5)
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    for x in (-0.5, -1.0, -1.5):
        viewer.advance(view_of(moved(scene, x), before=scene, drag_nor=4))
    alone = Session(scene, device=viewer.device)
    alone.render(1)
    alone.edit(moved(scene, -1.5))
    queue = viewer.session.queue.tiles
    np.testing.assert_array_equal(queue, alone.queue.tiles)


def test_every_edit_of_a_fast_drag_is_answered_by_a_tile(make_viewer: MakeViewer) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False)
    viewer, clock = make_viewer(view_of(scene, target_spp=1), speed=1.2e5)
    frames_until_rest(viewer, view_of(scene, target_spp=1))
    clock.edits, clock.speed = 0, 1.2e4  # so that a tile of the drag, 4 x 64 paths, takes two steps
    steps, answers = 60, 0
    for i in range(steps):
        frame = viewer.advance(view_of(moved(scene, 0.2 + 0.01 * i), before=scene, drag_nor=4))
        assert frame is not None
        answers += bool(frame.pictures[0].replaced.any())
    # Each edit but the last was followed by a finished tile before the next one was taken up.
    assert steps / 4 < clock.edits <= answers + 1 < steps


def test_edits_between_two_steps_become_one(make_viewer: MakeViewer) -> None:
    scene = mixed_scene()
    viewer, clock = make_viewer(view_of(scene), speed=FAST)
    run_to(viewer, view_of(scene), lambda frame: frame.pictures[0].mode is Mode.REFINE)
    clock.edits = 0
    viewer.advance(view_of(moved(scene, 0.7)))
    viewer.advance(view_of(moved(scene, 0.7)))
    assert clock.edits == 1
    assert viewer.session.scene == moved(scene, 0.7)


@pytest.mark.slow
@pytest.mark.parametrize("step_ms", [5.0, 20.0])
def test_steps_take_the_time_they_are_given(make_viewer: MakeViewer, step_ms: float) -> None:
    scene = mixed_scene(size=(176, 112))
    viewer, clock = make_viewer(view_of(scene, step_ms=step_ms), speed=3e5)
    view = view_of(scene, step_ms=step_ms)
    run_to(viewer, view, lambda frame: frame.pictures[0].tile_spp.min() >= 1 and not frame.is_preview)
    seconds = np.array([viewer.advance(view).step_seconds for _ in range(100)])  # type: ignore[union-attr]
    assert np.median(seconds) == pytest.approx(step_ms / 1e3, rel=0.15)
    assert seconds.max() < 1.5 * step_ms / 1e3
    # A stall of the machine neither stops the rendering nor leads to long steps after it.
    clock.stall = 1.0
    assert viewer.advance(view).step_seconds > 1  # type: ignore[union-attr]
    after = [viewer.advance(view).step_seconds for _ in range(100)]  # type: ignore[union-attr]
    assert max(after) < 1.5 * step_ms / 1e3 and np.median(after) > 0.8 * step_ms / 1e3


def test_refused_edit_is_told_once_and_the_old_picture_goes_on(
    make_viewer: MakeViewer, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False)
    viewer, _ = make_viewer(view_of(scene, target_spp=2))
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    bad = view_of(moved(scene), target_spp=4)

    def fail(*_: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr("incpt.accel.top_level.build_top", fail)
        with pytest.raises(MemoryError):
            viewer.advance(bad)
        end = frames_until_rest(viewer, bad)[-1]
    assert end.view.scene == scene
    assert_fresh(device, end, scene, 4)
    assert_fresh(
        device, frames_until_rest(viewer, view_of(moved(scene), target_spp=17))[-1], moved(scene), 17
    )


def test_refused_setting_is_told_once(make_viewer: MakeViewer, device: Device) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene))
    run_to(viewer, view_of(scene), lambda frame: frame.pictures[0].mode is Mode.REFINE)
    for camera in (scene, turned(scene, 50)):
        bad = view_of(replace(camera, settings=replace(scene.settings, sample_rate=4096, tile_size=1024)))
        with pytest.raises(InputError, match="sample_rate"):
            viewer.advance(bad)
        frame = viewer.advance(bad)
        assert frame is not None and frame.view.scene == scene


def test_size_that_memory_does_not_hold_is_told_after_the_preview(
    make_viewer: MakeViewer, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene, target_spp=2))
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    empty = device.empty

    def small(nbytes: int) -> object:
        if nbytes >= 16 * 400 * 400:
            raise DeviceError("no memory")
        return empty(nbytes)

    monkeypatch.setattr(device, "empty", small)
    large = replace(scene, settings=replace(scene.settings, size=(400, 400)))
    run_to(viewer, view_of(large), lambda frame: frame.is_preview)
    with pytest.raises(DeviceError, match="no memory"):
        run_to(viewer, view_of(large), lambda frame: not frame.is_preview)
    end = run_to(viewer, view_of(large), lambda f: not f.is_preview and f.pictures[0].tile_spp.min() == 2)
    assert end.view.scene == scene


def test_frames_tell_which_part_of_the_paths_ended_in_glass(make_viewer: MakeViewer) -> None:
    for passages, is_some in ((0, True), (40, False)):
        view = view_of(mixed_scene(transmission_bounces=passages), target_spp=2)
        viewer, _ = make_viewer(view)
        frame = frames_until_rest(viewer, view)[-1]
        assert 0 <= frame.cut_off < 0.2 and (frame.cut_off > 0.01) == is_some


def test_paused_view_takes_edits_and_renders_nothing(make_viewer: MakeViewer, device: Device) -> None:
    scene = mixed_scene()
    viewer, clock = make_viewer(view_of(scene, target_spp=2), speed=FAST)
    frames_until_rest(viewer, view_of(scene, target_spp=2))
    began = clock.now
    for camera in (scene, turned(scene, 60)):
        view = view_of(camera, paused=True)
        frame = viewer.advance(view)
        assert frame is not None and frame.resting and frame.view == view
        assert viewer.advance(view) is None
    assert clock.now == began and viewer.session.scene == turned(scene, 60)
    end = frames_until_rest(viewer, view_of(turned(scene, 60), target_spp=2))[-1]
    assert_fresh(device, end, turned(scene, 60), 2)


def test_split_gives_both_sides_equal_time(make_viewer: MakeViewer) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False, size=(88, 56))
    viewer, _ = make_viewer(view_of(scene, split=True), speed=2e5)
    view = view_of(scene, split=True)
    run_to(viewer, view, lambda frame: all(p.tile_spp.min() >= 2 for p in frame.pictures))
    edited = view_of(moved(scene), split=True)
    for _ in range(30):
        frame = viewer.advance(edited)
        assert frame is not None and not frame.is_preview
    restart, spiral = frame.pictures
    assert (restart.strategy, spiral.strategy) == ("restart", "spiral")
    assert abs(restart.seconds - spiral.seconds) <= 0.035 and spiral.seconds > 0.1
    assert spiral.mode is Mode.INCREMENTAL and restart.tile_spp.min() >= 1
    assert set(spiral.tile_spp[spiral.replaced]) == {16}
    assert len(viewer.advance(view_of(moved(scene))).pictures) == 1  # type: ignore[union-attr]


@pytest.mark.parametrize("strategy", ["spiral", "impact"])
def test_a_picture_is_whole_where_it_shows_the_scene_alone(make_viewer: MakeViewer, strategy: str) -> None:
    scene = mixed_scene(strategy=strategy)
    viewer, _ = make_viewer(view_of(scene), speed=FAST)
    assert not viewer.is_whole(view_of(scene)), "it has pixels without a sample"
    run_to(viewer, view_of(scene), lambda frame: frame.pictures[0].tile_spp.min() >= 2)
    assert viewer.is_whole(view_of(scene))
    edited = view_of(moved(scene))
    assert not viewer.is_whole(edited), "it shows the scene before the edit"
    viewer.advance(edited)
    assert not viewer.is_whole(edited), "a part of it does"
    left = set()
    while not viewer.is_whole(edited):
        frame = viewer.advance(edited)
        assert frame is not None
        left.add(bool(frame.pictures[0].error_left))
    assert (True in left) == (strategy == "impact") and frame.pictures[0].mode is Mode.REFINE
    assert viewer.is_whole(edited) and not viewer.is_whole(view_of(moved(scene), before=scene))


def test_error_against_a_pinned_reference(make_viewer: MakeViewer) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene, target_spp=4), speed=FAST)
    frames_until_rest(viewer, view_of(scene, target_spp=4))
    viewer.pin_reference(True)
    frame = viewer.advance(view_of(scene, target_spp=4))
    assert frame is not None and frame.pictures[0].error == 0 and frame.is_pinned
    assert not frame.is_stale
    last = frames_until_rest(viewer, view_of(turned(scene, 61), target_spp=4))[-1]
    pinned = last.pictures[0].error
    assert pinned is not None and 0.01 < pinned < 1 and last.is_stale
    other_settings = replace(scene, settings=replace(scene.settings, nor=8))
    assert not frames_until_rest(viewer, view_of(other_settings, target_spp=4))[-1].is_stale
    viewer.pin_reference(False)
    last = frames_until_rest(viewer, view_of(turned(scene, 61), target_spp=4))[-1]
    assert not last.is_pinned and not last.is_stale
    viewer.pin_reference(True)
    last = frames_until_rest(viewer, view_of(turned(scene, 61), target_spp=4))[-1]
    assert last.is_pinned and not last.is_stale and last.pictures[0].error == 0
    smaller = view_of(turned(scene, 61), target_spp=4, resolution_scale=0.5)
    last = frames_until_rest(viewer, smaller)[-1]
    assert last.pictures[0].error is None and not last.is_pinned
    back = frames_until_rest(viewer, view_of(turned(scene, 61), target_spp=4))[-1]
    assert back.pictures[0].error is None


def test_first_hits_come_when_wanted_and_small_while_moving(
    make_viewer: MakeViewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False)
    viewer, _ = make_viewer(view_of(scene, target_spp=1))
    assert all(frame.first_hits is None for frame in frames_until_rest(viewer, view_of(scene, target_spp=1)))
    still = view_of(scene, target_spp=1, first_hits=True)
    frame = frames_until_rest(viewer, still)[-1]
    assert frame.first_hits is not None and frame.first_hits.depth.shape == (28, 44)
    np.testing.assert_array_equal(frame.first_hits.object_id, viewer.session.first_hits().object_id)
    # Only rendering moves this clock: say that the rays of first hits are slow too.
    viewer._hits.pace = Pace(60_000.0)
    monkeypatch.setattr(viewer._hits, "_learn", lambda *_: None)
    view = view_of(moved(scene), before=scene, first_hits=True)
    moving = run_to(viewer, view, lambda frame: frame.view == view and bool(frame.pictures[0].replaced.any()))
    assert moving.first_hits is not None and moving.first_hits.depth.shape[0] < 28
    assert moving.first_hits is not frame.first_hits
    end = view_of(moved(scene), first_hits=True, target_spp=17)
    last = frames_until_rest(viewer, end)[-1].first_hits
    assert last is not None and last.depth.shape == (28, 44)
    np.testing.assert_array_equal(last.object_id, viewer.session.first_hits().object_id)


def test_picks_by_point(make_viewer: MakeViewer) -> None:
    viewer, _ = make_viewer(view_of(mixed_scene()))
    assert viewer.pick((0.5, 0.5)) == "red cube"
    assert viewer.pick((0.02, 0.95)) == "floor"
    assert viewer.pick((0.0, 0.0)) is None and viewer.pick((1.5, 0.5)) is None


def test_picks_what_is_seen_in_a_box(make_viewer: MakeViewer) -> None:
    viewer, _ = make_viewer(view_of(mixed_scene()))
    assert viewer.pick_box((0.45, 0.45), (0.55, 0.55)) == ("red cube",)
    assert viewer.pick_box((-1.0, -1.0), (2.0, 2.0)) == ("floor", "red cube", "glass ball", "grey drum")
    assert viewer.pick_box((0.0, 0.0), (0.05, 0.05)) == ()
    assert viewer.pick_box((1.2, 0.0), (1.4, 1.0)) == ()


def test_export_writes_the_whole_picture_of_full_size(make_viewer: MakeViewer, tmp_path: Path) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene))
    run_to(viewer, view_of(scene), lambda frame: frame.pictures[0].mode is Mode.REFINE)
    run_to(viewer, view_of(turned(scene, 50)), lambda frame: frame.is_preview)
    viewer.export(tmp_path / "a.exr", aovs=True)
    layers = OpenEXR.File(str(tmp_path / "a.exr")).channels()
    assert layers["RGB"].pixels.shape == (28, 44, 3) and layers["RGB"].pixels.min(axis=2).max() > 0
    assert {"albedo", "normal.X", "depth.Z", "object_id"} <= set(layers)
    viewer.export(tmp_path / "a.png")
    viewer.export(tmp_path / "b.png", exposure=2.0, curve="srgb")
    a, b = (np.asarray(PIL.Image.open(tmp_path / f"{name}.png")) for name in "ab")
    assert a.shape == (28, 44, 3) and b.mean() > a.mean() + 20
    with pytest.raises(InputError, match="known format"):
        viewer.export(tmp_path / "a.jpg")


def test_restart_throws_away_what_was_accumulated(make_viewer: MakeViewer) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene, target_spp=3), speed=FAST)
    frames_until_rest(viewer, view_of(scene, target_spp=3))
    viewer.restart()
    frame = viewer.advance(view_of(scene, target_spp=3))
    assert frame is not None and frame.pictures[0].tile_spp.max() == 1


def test_settings_reset_only_what_they_must(make_viewer: MakeViewer, device: Device) -> None:
    scene = mixed_scene()
    viewer, _ = make_viewer(view_of(scene, target_spp=3), speed=FAST)
    frames_until_rest(viewer, view_of(scene, target_spp=3))

    def with_settings(**changes: object) -> Scene:
        return replace(scene, settings=replace(scene.settings, **changes))  # type: ignore[arg-type]

    kept = frames_until_rest(viewer, view_of(with_settings(nor=7, base_nor=2), target_spp=3))
    assert len(kept) == 1 and (kept[0].pictures[0].tile_spp == 3).all()
    other = with_settings(max_bounces=0)
    frames = frames_until_rest(viewer, view_of(other, target_spp=3))
    assert frames[0].pictures[0].tile_spp.max() == 1
    assert_fresh(device, frames[-1], other, 3)
    small = frames_until_rest(viewer, view_of(other, target_spp=2, resolution_scale=0.4))[-1]
    assert small.pictures[0].image.shape == (11, 18, 4)


def test_unchanged_picture_is_not_read_again(make_viewer: MakeViewer) -> None:
    scene = mixed_scene(size=(176, 112))
    viewer, clock = make_viewer(view_of(scene), speed=1e6)
    view = view_of(scene, step_ms=2.0)
    run_to(viewer, view, lambda frame: frame.pictures[0].tile_spp.min() >= 2)
    began = clock.now
    images = {id(image): image for image in (viewer.advance(view).pictures[0].image for _ in range(200))}  # type: ignore[union-attr]
    assert len(images) <= (clock.now - began) / 0.1 + 2


def test_reports_the_building_of_kernels(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "built", set())
    seen: list[tuple[int, int]] = []
    Viewer(view_of(mixed_scene()), device, lambda done, total: seen.append((done, total)))
    total = seen[0][1]
    assert seen == [(done, total) for done in range(1, total + 1)] and total >= 10


def test_the_sides_of_a_split_view_share_their_tables(
    make_viewer: MakeViewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second side builds no tree, neither at first nor while something is dragged."""
    trees: list[int] = []
    build = bvh.build_boxes
    monkeypatch.setattr(bvh, "build_boxes", lambda *args: (trees.append(args[1]), build(*args))[1])
    scene = mixed_scene()
    built = []
    for split in (False, True):
        viewer, _ = make_viewer(view_of(replace(scene), target_spp=2, split=split), speed=1.2e5)
        trees.clear()
        for x in (-0.5, -1.0):
            view = view_of(moved(scene, x), before=scene, target_spp=2, split=split)
            frames_until_rest(viewer, view)
        built.append(len(trees))
        del viewer
    assert built[0] == built[1] > 0


def impact_view(scene: Scene, **changes: object) -> View:
    return view_of(replace(scene, settings=replace(scene.settings, strategy="impact")), **changes)


def small_cube(x: float = 0.3) -> Scene:
    return mixed_scene(size=(96, 64)).with_object("red cube", scale=(0.4, 0.4, 0.4), position=(x, 0.2, 0.8))


def test_what_an_edit_moved_is_seen_before_its_first_step(make_viewer: MakeViewer) -> None:
    start = impact_view(small_cube(), target_spp=4)
    viewer, clock = make_viewer(start)
    before = frames_until_rest(viewer, start)[-1].pictures[0].image
    began, dragged = clock.now, start.scene.with_object("red cube", position=(-0.7, 0.2, 0.8))
    edited = replace(start, scene=dragged, before=start.scene)
    frame = viewer.advance(edited)
    assert frame is not None and frame.view == edited and clock.now == began, "a step was done before"
    picture = frame.pictures[0]
    changed = np.abs(picture.image - before).max(axis=2) > 0.02
    now = viewer.session.first_hits().object_id == dragged.object_index["red cube"]
    assert changed[now].mean() > 0.9 and picture.error_left == 1 and not frame.resting
    following = viewer.advance(edited)
    assert following is not None and clock.now > began, "the sight comes once"
    assert not np.array_equal(following.pictures[0].image, picture.image)


def test_while_another_edit_waits_no_sight_is_drawn(make_viewer: MakeViewer) -> None:
    start = impact_view(small_cube(), target_spp=4)
    viewer, clock = make_viewer(start)
    frames_until_rest(viewer, start)
    began, dragged = clock.now, start.scene.with_object("red cube", position=(-0.7, 0.2, 0.8))
    viewer.advance(replace(start, scene=dragged, before=start.scene), lambda: True)
    assert clock.now > began


def test_pictures_tell_how_far_an_edit_is_found(make_viewer: MakeViewer) -> None:
    start = impact_view(small_cube(), target_spp=4)
    viewer, _ = make_viewer(start)
    assert frames_until_rest(viewer, start)[-1].pictures[0].error_left == 0
    edited = replace(start, scene=start.scene.with_object("red cube", position=(-0.7, 0.2, 0.8)))
    found = run_to(viewer, edited, lambda frame: frame.pictures[0].findings is not None).pictures[0]
    assert found.findings is not None and found.findings.touched.shape == (found.grid.count,)
    assert found.error_left == found.findings.error_left == viewer.session.error_left()
