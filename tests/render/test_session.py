"""The session: what a step does, what an edit keeps, and when it starts over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene, small_settings

from incpt.core.errors import DeviceError, InputError
from incpt.core.settings import STRATEGIES
from incpt.device.device import Device
from incpt.render import wavefront
from incpt.render.modes import Mode
from incpt.render.plan import Cursor, Queue
from incpt.render.session import Session
from incpt.render.tiles import base_queue
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.tables import object_table


def rendered(device: Device, scene: Scene, spp: int, **settings: object) -> Session:
    # Of a copy of the scene no tables live, so that they are made without those of the scenes before.
    session = Session(replace(scene), settings=replace(scene.settings, **settings), device=device)
    session.render(spp)
    return session


def assert_same(a: np.ndarray, b: np.ndarray) -> None:
    """The same samples, added up in another order."""
    np.testing.assert_allclose(a, b, rtol=2e-4, atol=1e-5)


@pytest.fixture(scope="module")
def converged(device: Device) -> np.ndarray:
    """64 samples of the mixed scene, one a step."""
    return rendered(device, mixed_scene(), 64).image()


def test_starts_black_and_finishes_base_in_one_step(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    assert session.mode is Mode.BASE
    assert not session.image().any() and not session.spp().any()
    report = session.step()
    assert report.mode is Mode.BASE and session.mode is Mode.REFINE
    assert report.tiles.tolist() == list(range(24))
    assert report.queue_done == report.queue_length == 24
    assert (session.spp() == 1).all()
    assert np.isfinite(session.image()).all() and session.image().mean() > 0.05
    assert report.nonfinite == 0


def test_refine_accumulates(device: Device) -> None:
    session = rendered(device, mixed_scene(), 3)
    assert (session.spp() == 3).all() and session.mode is Mode.REFINE


def test_picture_has_the_size_asked_for(device: Device) -> None:
    session = Session(mixed_scene(), size=(19, 11), device=device)
    session.step()
    assert session.image().shape == (11, 19, 3)
    assert session.image().dtype == np.float32


@pytest.mark.slow
@pytest.mark.parametrize(("nor", "slots"), [(1, 7), (16, None), (16, 5), (64, None), (64, 5), (64, 300)])
def test_repetitions_equal_refinement_passes(
    device: Device, converged: np.ndarray, nor: int, slots: int | None
) -> None:
    assert_same(rendered(device, mixed_scene(base_nor=nor, slots_per_step=slots), 64).image(), converged)


@pytest.mark.slow
def test_nor_256_equals_256_refinement_passes(device: Device) -> None:
    passes = rendered(device, mixed_scene(), 256).image()
    tile = rendered(device, mixed_scene(base_nor=256, slots_per_step=100), 256)
    assert (tile.spp() == 256).all()
    assert_same(tile.image(), passes)


def test_sample_rate_multiplies_samples(device: Device, converged: np.ndarray) -> None:
    session = Session(mixed_scene(sample_rate=4), device=device)
    session.step()
    assert (session.spp() == 4).all()
    session.render(64)
    assert_same(session.image(), converged)


def test_order_of_tiles_does_not_matter(device: Device, converged: np.ndarray) -> None:
    session = Session(mixed_scene(), device=device)
    order = np.random.default_rng(5).permutation(base_queue(session.grid))
    queue = Queue.even(order.astype(np.int32), 64, True)  # any order: the public ways offer two
    session._state = replace(session._state, progress=replace(session.progress, queue=queue))
    session.render(64)
    assert_same(session.image(), converged)


@pytest.mark.parametrize("tile_size", [1, 5, 16, 64])
def test_tile_size_does_not_matter(device: Device, converged: np.ndarray, tile_size: int) -> None:
    assert_same(rendered(device, mixed_scene(tile_size=tile_size, base_nor=8), 64).image(), converged)


@pytest.mark.slow
def test_paths_go_in_squares_where_they_go_through_trees(device: Device) -> None:
    """As cl/path/tile.cl has it. It is seen by what the path buffer holds of a tile of which a lamp fills the
    left half, with and without a ball that has a tree of its own."""
    lamp = Object("lamp", shape("plane"), "lamp", (-5, 0, -10), (90, 0, 0), (10, 1, 10))
    behind = Object("ball", shape("sphere"), "grey", (0, 0, 10))
    materials = {"lamp": Material(emission=(1, 1, 1)), "grey": Material()}
    for objects, edge in (((lamp,), 1), ((lamp, behind), 4)):
        scene = Scene(Camera((0, 0, 0), (0, 0, -1)), Environment(), materials, objects)
        session = Session(scene, settings=small_settings(size=(8, 8), tile_size=8), device=device)
        session.step()
        buffer = session._state.path_buffer
        planes = np.empty((buffer.planes, buffer.stride), np.float32)
        lit = session.device.read(buffer.floats, planes)[0, :64] > 0
        y, x = np.divmod(np.arange(64), 8)
        order = np.lexsort((x % edge, y % edge, x // edge, y // edge))
        assert (lit == (x[order] < 4)).all()


@pytest.mark.slow
def test_chunks_do_not_matter(device: Device, converged: np.ndarray) -> None:
    session = Session(mixed_scene(base_nor=4), device=device)
    session._tracer = tracer = Wavefront(device)
    tracer.chunk_paths = 320  # less than a group of slots
    session.render(64)
    assert_same(session.image(), converged)


def test_seeds_give_other_noise(device: Device) -> None:
    a, b = (rendered(device, mixed_scene(seed=seed), 1).image() for seed in (0, 1))
    assert np.abs(a - b).mean() > 0.01


def moved(scene: Scene) -> Scene:
    return scene.with_object("red cube", position=(0.2, 0.5, 0.4))


def test_edit_replaces_tile_by_tile_from_the_point_of_change(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="spiral", nor_adapts=False, slots_per_step=32), 4)
    before = session.image()
    session.edit(moved(session.scene))
    assert session.mode is Mode.INCREMENTAL
    assert_same(session.image(), before)
    report = session.step()
    assert report.mode is Mode.INCREMENTAL and len(report.tiles) == 2
    # The cube is right of the middle of the image, and so is the first tile.
    x, y = session.grid.origin(int(report.tiles[0]))
    assert 16 <= x <= 24 and 8 <= y <= 16
    after = session.image()
    changed = np.zeros(before.shape[:2], bool)
    for tile in report.tiles:
        x, y = session.grid.origin(int(tile))
        changed[y : y + 8, x : x + 8] = True
    assert (session.spp() == np.where(changed, 16, 4)).all()
    np.testing.assert_array_equal(after[~changed], before[~changed])
    fresh = rendered(device, moved(mixed_scene(strategy="spiral", nor_adapts=False)), 16).image()
    assert_same(after[changed], fresh[changed])


def test_tile_is_shown_only_when_complete(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="spiral", nor_adapts=False, slots_per_step=6), 2)
    session.edit(moved(session.scene))
    before = session.image()
    for _ in range(2):
        assert len(session.step().tiles) == 0
        np.testing.assert_array_equal(session.image(), before)
    assert len(session.step().tiles) == 1  # 18 slots for 16 repetitions
    assert (session.image() != before).any()


def test_incremental_ends_in_refine(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="spiral", nor_adapts=False), 2)
    session.edit(moved(session.scene))
    reports = []
    while session.mode is Mode.INCREMENTAL:
        reports.append(session.step())
    assert session.mode is Mode.REFINE and (session.spp() == 16).all()
    assert sorted(tile for report in reports for tile in report.tiles) == list(range(24))


def test_edit_during_incremental_starts_a_new_spiral(device: Device) -> None:
    session = rendered(device, mixed_scene(slots_per_step=64), 2)
    session.edit(moved(session.scene))
    session.step()
    session.edit(session.scene.with_object("grey drum", position=(-1.2, 0.4, 0)))
    assert session.mode is Mode.INCREMENTAL and session.cursor == Cursor()
    x, _ = session.grid.origin(int(session.queue.tiles[0]))
    assert x < 16


@pytest.mark.parametrize(
    ("edit", "strategy"),
    [
        (lambda s: s.with_camera(fov_y=50.0), "impact"),
        (lambda s: s.with_camera(fov_y=50.0), "spiral"),
        (lambda s: s.with_environment(intensity=1.0), "spiral"),
    ],
)
def test_global_change_starts_over(device: Device, edit, strategy: str) -> None:
    session = rendered(device, mixed_scene(slots_per_step=8, strategy=strategy), 2)
    before = session.image()
    session.edit(edit(session.scene))
    assert session.mode is Mode.BASE and not session.spp().any()
    # Until a tile is rendered anew, the old picture stands in for it.
    np.testing.assert_array_equal(session.image(), before)
    session.step()
    assert np.unique(session.spp()).tolist() == [0, 1]


def test_restart_strategy_starts_over_on_every_edit(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="restart"), 2)
    session.edit(moved(session.scene))
    assert session.mode is Mode.BASE


def test_change_that_nobody_sees_keeps_everything(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    session.edit(session.scene.with_material("unused", roughness=0.3))
    session.edit(session.scene.with_material("unused", roughness=0.7))
    session.edit(session.scene)
    session.edit(replace(session.scene, objects=session.scene.objects[::-1]))
    assert session.mode is Mode.REFINE and (session.spp() == 2).all()
    assert_same(rendered(device, mixed_scene(), 3).image(), (session.step(), session.image())[1])


def test_steps_of_a_drag_are_measured_from_where_it_began(device: Device) -> None:
    start = mixed_scene(strategy="spiral", nor_adapts=False)
    session = rendered(device, start, 1)
    far = [start.with_object("red cube", position=(x, 0.5, 0.4)) for x in (0.5, 1.0, 2.0)]
    for scene in far:
        session.edit(scene, since=start)
    alone = rendered(device, start, 1)
    alone.edit(far[-1])
    np.testing.assert_array_equal(session.queue.tiles, alone.queue.tiles)
    session.edit(start, since=start)  # back where it was: the last place counts
    assert session.mode is Mode.INCREMENTAL


def test_end_of_a_drag_repeats_with_the_whole_nor(device: Device) -> None:
    start = mixed_scene(strategy="spiral", nor_adapts=False, nor=4)
    session = rendered(device, start, 1)
    end = moved(start)
    session.edit(end, since=start)
    session.render(6)
    session.configure(replace(session.settings, nor=16))
    assert session.mode is Mode.REFINE
    session.end_drag(start)
    assert session.mode is Mode.INCREMENTAL and session.cursor == Cursor()
    alone = rendered(device, start, 1)
    alone.edit(end)
    np.testing.assert_array_equal(session.queue.tiles, alone.queue.tiles)
    session.render(16)
    assert_same(session.image(), rendered(device, end, 16).image())


def test_end_of_a_drag_starts_nothing_over(device: Device) -> None:
    start = mixed_scene()
    end = moved(start)
    session = Session(start, settings=replace(start.settings, slots_per_step=5), device=device)
    session.edit(end, since=start)
    session.step()
    cursor = session.cursor
    session.end_drag(start)
    assert session.mode is Mode.BASE and session.cursor == cursor
    turned = start.with_camera(fov_y=50.0)
    session.edit(turned, since=start)
    session.render(2)
    session.end_drag(start)
    assert session.mode is Mode.REFINE and (session.spp() == 2).all()
    session.end_drag(turned)
    assert session.mode is Mode.REFINE and (session.spp() == 2).all()


def test_same_scene_again_is_no_edit(device: Device) -> None:
    start = mixed_scene(nor=4)
    session = rendered(device, start, 1)
    end = moved(start)
    session.edit(end, since=start)
    session.render(6)
    session.edit(end, since=start)
    assert session.mode is Mode.REFINE and (session.spp() >= 6).all()


def test_nor_may_change_before_the_first_step_of_an_edit(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="spiral", nor_adapts=False), 1)
    session.edit(moved(session.scene))
    order = session.queue.tiles
    session.configure(replace(session.settings, nor=3))
    np.testing.assert_array_equal(session.queue.tiles, order)
    report = session.step()
    assert report.mode is Mode.INCREMENTAL
    assert (session.tile_spp[report.tiles] == 3).all()


def test_nobody_else_writes_to_what_a_session_goes_by(device: Device) -> None:
    session = rendered(device, mixed_scene(), 1)
    for _ in range(2):  # at first, and after a step
        for array in (session.tile_spp, session.queue.tiles, session.queue.samples):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
        session.step()
    counts = session.spp()
    counts[:] = 0  # an array of the caller's own
    assert session.tile_spp.min() > 0


@pytest.mark.slow
def test_step_takes_as_many_slots_as_it_is_given(device: Device, converged: np.ndarray) -> None:
    session = Session(mixed_scene(slots_per_step=1), device=device)
    assert [session.step(slots).paths // 64 for slots in (1, 5, 3, 1000, 24)] == [1, 5, 3, 15, 24]
    session.render(64)
    assert_same(session.image(), converged)


def test_memory_of_long_steps_goes_back_with_settings_that_need_less(device: Device) -> None:
    session = Session(mixed_scene(slots_per_step=4), device=device)
    strides = [session._state.path_buffer.stride]
    for change in ({}, {"nor": 3}, {"slots_per_step": 8}, {"slots_per_step": 2}):
        session.step(20)
        session.configure(replace(session.settings, **change))
        strides.append(session._state.path_buffer.stride)
    first, grown, kept, more, less = strides
    assert first < grown == kept == more and less < first


def test_step_makes_do_with_the_memory_there_is(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(mixed_scene(slots_per_step=4), device=device)

    def fail(_: int) -> None:
        raise DeviceError("no memory")

    empty = device.empty
    monkeypatch.setattr(device, "empty", lambda nbytes: fail(nbytes) if nbytes > 12 * 400 else empty(nbytes))
    assert session.step(20).paths == 4 * 64
    monkeypatch.undo()
    session.render(4)
    assert_same(session.image(), rendered(device, mixed_scene(), 4).image())


def test_alpha_tells_where_there_was_a_picture(device: Device) -> None:
    session = Session(mixed_scene(slots_per_step=6), device=device)
    session.step()
    image = session.image(alpha=True)
    assert image.shape == (28, 44, 4)
    np.testing.assert_array_equal(image[..., 3], session.spp() == 1)
    session.restart()
    assert not session.spp().any() and session.mode is Mode.BASE
    np.testing.assert_array_equal(session.image(alpha=True), image)


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [False, True])
def test_no_kernel_is_built_after_building(
    device: Device, monkeypatch: pytest.MonkeyPatch, in_blocks: bool
) -> None:
    # For what is built, launches of one size will do.
    monkeypatch.setattr(wavefront, "BUILD_SIZES", (1,))
    bright = mixed_scene().with_environment(image=None)
    opaque = mixed_scene().without_object("glass ball").with_material("glass", transmission=0.0)
    for scene in (mixed_scene(), bright, bright.without_object("lamp"), opaque):
        monkeypatch.setattr(device, "_kernels", {})
        monkeypatch.setattr(device, "built", set())
        session = Session(scene, settings=replace(scene.settings, strategy="spiral"), device=device)
        session._tracer = session._tracer if in_blocks else Wavefront(device)
        seen: list[tuple[int, int]] = []
        session.build(lambda *progress: seen.append(progress))  # noqa: B023
        assert seen == [(i + 1, len(seen)) for i in range(len(seen))] and len(seen) > 6
        with monkeypatch.context() as patch:
            patch.setattr(device, "build", None)
            session.render(3)
            session.edit(moved(scene))
            session.render(17)
            session.image()
            session.first_hits()
            assert session.pick((22, 14)) == "red cube"
            session.build(lambda *_: pytest.fail("is built already"))
        assert_same(session.image(), rendered(device, moved(scene), 17).image())


@pytest.mark.slow
@pytest.mark.parametrize(("strategy", "in_blocks"), [*((s, True) for s in STRATEGIES), ("impact", False)])
def test_an_edit_that_was_prepared_builds_nothing(
    device: Device, monkeypatch: pytest.MonkeyPatch, strategy: str, in_blocks: bool
) -> None:
    monkeypatch.setattr(device, "_kernels", {})
    monkeypatch.setattr(device, "built", set())
    session = Session(mixed_scene(strategy=strategy), device=device)
    # For what is built, launches of one size will do.
    monkeypatch.setattr(wavefront, "BUILD_SIZES", (1,))
    session._tracer = session._tracer if in_blocks else Wavefront(device)
    session.build(for_edits=False)
    session.render(3)
    image, pieces = session.image(), 0
    while session.prepare_edit():
        pieces += 1
    assert (pieces > 6) == (strategy == "impact")
    assert not session.prepare_edit()
    assert_same(session.image(), image)
    with monkeypatch.context() as patch:
        patch.setattr(device, "build", None)
        # Planes of the picture's size are there.
        asked: list[int] = []
        empty = Device.empty
        patch.setattr(Device, "empty", lambda self, nbytes: (asked.append(nbytes), empty(self, nbytes))[1])
        session.edit(moved(session.scene))
        assert sum(asked) < 44 * 28 * 40 * (strategy == "impact") + 100_000
        session.build(lambda *_: pytest.fail("is built already"))
        session.render(17)
        session.image()


def test_what_is_prepared_serves_other_edits_and_is_of_the_scene(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    while session.prepare_edit():
        pass
    estimator = session._state.prepared.estimator  # type: ignore[union-attr]
    # A turn of the camera shows something else.
    turned = session.scene.with_camera(fov_y=50)
    session.edit(turned)
    session.render(2)
    for scene in (moved(turned), turned, turned.without_object("lamp")):
        session.edit(scene)
        session.render(4)
        assert session._state.prepared.estimator is estimator  # type: ignore[union-attr]
    alone = rendered(device, turned, 2)
    alone.edit(turned.without_object("lamp"))
    for one in (session, alone):
        hits, expected = one._state.comparison.hits, one.first_hits()  # type: ignore[union-attr]
        np.testing.assert_array_equal(hits.objects, expected.object_id)
        assert_same(hits.normals, expected.normal)


def test_building_may_be_stopped_and_go_on(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "built", set())
    session = Session(mixed_scene(), device=device)

    def stop(done: int, _: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        session.build(stop)
    seen: list[int] = []
    session.build(lambda done, _: seen.append(done))
    assert seen[0] == 1 and len(seen) > 3
    session.render(2)
    assert_same(session.image(), rendered(device, mixed_scene(), 2).image())


def test_point_of_change_may_be_the_pixel(device: Device) -> None:
    session = rendered(device, mixed_scene(strategy="spiral", nor_adapts=False, point_of_change="pixel"), 1)
    session.edit(moved(session.scene), pixel=(43, 27))
    assert session.queue.tiles[0] == session.grid.count - 1


@pytest.mark.parametrize(("position", "corner"), [((-40, 0.5, -5), 0), ((40, 0.5, -5), 5)])
def test_point_of_change_off_screen_starts_at_that_side(
    device: Device, position: tuple[float, float, float], corner: int
) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False).with_added(
        Object("far", shape("cube"), "red", position=position)
    )
    session = rendered(device, scene, 1)
    session.edit(scene.with_object("far", rotation=(0, 10, 0)))
    assert session.queue.tiles[0] % session.grid.columns == corner


def test_edit_behind_the_camera_starts_at_the_centre(device: Device) -> None:
    scene = mixed_scene(strategy="spiral", nor_adapts=False).with_added(
        Object("behind", shape("cube"), "red", position=(0, 1, 9))
    )
    session = rendered(device, scene, 1)
    session.edit(scene.without_object("behind"))
    assert session.mode is Mode.INCREMENTAL
    assert session.queue.tiles[0] == session.grid.tile_at(22, 14)


def test_failed_edit_keeps_scene_and_picture(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    session = rendered(device, mixed_scene(), 2)
    before, scene = session.image(), session.scene

    def fail(*_: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr("incpt.accel.top_level.build_top", fail)
        with pytest.raises(MemoryError):
            session.edit(moved(scene))
    assert session.scene is scene and session.mode is Mode.REFINE
    np.testing.assert_array_equal(session.image(), before)
    session.render(4)
    assert_same(session.image(), rendered(device, mixed_scene(), 4).image())


@pytest.mark.parametrize("name", ["max_bounces", "transmission_bounces", "roulette_depth", "seed"])
def test_settings_of_the_picture_start_over(device: Device, name: str) -> None:
    session = rendered(device, mixed_scene(), 2)
    session.configure(replace(session.settings, **{name: getattr(session.settings, name) + 1}))
    assert session.mode is Mode.BASE
    session.render(2)
    assert_same(
        session.image(), rendered(device, mixed_scene(), 2, **{name: getattr(session.settings, name)}).image()
    )


def test_settings_of_the_method_keep_the_picture(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    session.configure(replace(session.settings, nor=3, strategy="restart", slots_per_step=5, base_nor=2))
    assert session.mode is Mode.REFINE and (session.spp() == 2).all()
    session.render(6)
    assert_same(session.image(), rendered(device, mixed_scene(), 6).image())


def test_another_size_starts_a_new_film(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    session.configure(replace(session.settings, size=(30, 20)))
    assert not session.image().any() and session.image().shape == (20, 30, 3)
    session.render(2)
    assert_same(session.image(), rendered(device, mixed_scene(size=(30, 20)), 2).image())


@pytest.mark.parametrize("change", [{"sample_rate": 4}, {"size": (90, 50)}, {"tile_size": 16}])
def test_failed_configure_keeps_settings_and_picture(
    device: Device, monkeypatch: pytest.MonkeyPatch, change: dict[str, object]
) -> None:
    session = rendered(device, mixed_scene(), 2)
    before, settings = session.image(), session.settings
    other = Session(mixed_scene(**change).with_object("red cube", visible=False), device=device).snapshot()
    scene = session.scene

    def fail(_: int) -> None:
        raise DeviceError("no memory")

    with monkeypatch.context() as patch:
        patch.setattr(device, "empty", fail)
        with pytest.raises(DeviceError):
            session.configure(replace(settings, **change))
        with pytest.raises(DeviceError):
            session.restore(other)
    assert session.settings is settings and session.scene is scene and session.mode is Mode.REFINE
    np.testing.assert_array_equal(session.image(), before)
    session.render(4)
    assert_same(session.image(), rendered(device, mixed_scene(), 4).image())


def test_step_beyond_32_bits_is_refused(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    session = rendered(device, mixed_scene(), 2)
    # As a device with memory enough would do.
    monkeypatch.setattr(device, "empty", lambda _: session._state.path_buffer.floats)
    largest = ((1 << 32) // 3 - 64) // 64
    session.configure(replace(session.settings, slots_per_step=largest // 4096, sample_rate=4096))
    with pytest.raises(InputError, match=r"^sample_rate: a step of .* slots is more"):
        session.configure(replace(session.settings, slots_per_step=largest // 4096 + 1))


def test_snapshot_brings_the_picture_back(device: Device) -> None:
    session = rendered(device, mixed_scene(), 3)
    snapshot, before = session.snapshot(), session.image()
    session.edit(moved(session.scene).with_camera(fov_y=60.0))
    session.render(2)
    session.restore(snapshot)
    np.testing.assert_array_equal(session.image(), before)
    session.render(5)
    assert_same(session.image(), rendered(device, mixed_scene(), 5).image())


def test_picks_what_is_under_the_pixel(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    assert session.pick((22, 14)) == "red cube"
    assert session.pick((2, 26)) == "floor"
    assert session.pick((0, 0)) is None
    with pytest.raises(InputError, match="outside the image"):
        session.pick((44, 0))


def test_picks_what_is_under_a_point(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    for y in range(0, 28, 3):
        for x in range(0, 44, 5):
            assert session.pick_point(((x + 0.5) / 44, (y + 0.5) / 28)) == session.pick((x, y))
    ids, names = session.first_hits().object_id, [obj.name for obj in session.scene.objects]
    for y in range(0, 28, 3):
        for x in range(0, 44, 5):
            assert session.pick((x, y)) == (names[ids[y, x]] if ids[y, x] >= 0 else None)


def test_a_place_is_on_the_surface_that_is_seen(device: Device) -> None:
    scene = mixed_scene()
    for camera in (scene.camera, replace(scene.camera, projection="orthographic", near=0.5)):
        session = Session(replace(scene, camera=camera), device=device)
        hits = session.first_hits()
        for x, y in ((22, 14), (3, 25), (34, 16)):
            place = session.place_at(((x + 0.5) / 44, (y + 0.5) / 28))
            assert place is not None
            where, _ = camera.project(np.array([place]), 44 / 28)
            np.testing.assert_allclose(where[0] * (44, 28), (x + 0.5, y + 0.5), atol=1e-3)
            starts, _ = camera.rays(np.array([[(x + 0.5) / 44, (y + 0.5) / 28]]), 44 / 28)
            assert np.linalg.norm(place - starts[0]) == pytest.approx(float(hits.depth[y, x]), rel=1e-4)
    session = Session(scene, device=device)
    assert session.place_at((0.02, 0.02)) is None and session.place_at((1.5, 0.5)) is None


def test_pick_passes_hidden_objects(device: Device) -> None:
    session = Session(mixed_scene().with_object("red cube", visible=False), device=device)
    assert session.pick((22, 14)) != "red cube"


def test_pick_keeps_the_picture(device: Device) -> None:
    session = rendered(device, mixed_scene(), 2)
    before = session.image()
    session.pick((5, 5))
    session.first_hits()
    np.testing.assert_array_equal(session.image(), before)
    session.render(4)
    assert_same(session.image(), rendered(device, mixed_scene(), 4).image())


def test_first_hits_may_have_another_size(device: Device) -> None:
    session = rendered(device, mixed_scene(), 1)
    small = session.first_hits((11, 7))
    assert small.depth.shape == (7, 11) and small.normal.shape == (7, 11, 3)
    np.testing.assert_array_equal(
        small.object_id, Session(mixed_scene(size=(11, 7)), device=device).first_hits().object_id
    )


def test_first_hits_come_by_rows_too(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    whole = session.first_hits()
    for rows in ((0, 3), (3, 20), (20, 28)):
        part = session.first_hits(rows=rows)
        np.testing.assert_array_equal(part.object_id, whole.object_id[slice(*rows)])
        np.testing.assert_allclose(part.depth, whole.depth[slice(*rows)], rtol=1e-4)
        np.testing.assert_allclose(part.normal, whole.normal[slice(*rows)], atol=1e-3)


def test_first_hits_are_those_of_pixel_centres(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    hits = session.first_hits()
    names = [o.name for o in session.scene.objects]
    assert names[hits.object_id[14, 22]] == "red cube" == session.pick((22, 14))
    assert hits.object_id[0, 0] == -1 and np.isinf(hits.depth[0, 0]) and not hits.normal[0, 0].any()
    assert names[hits.object_id[26, 2]] == "floor"
    np.testing.assert_allclose(hits.normal[26, 2], (0, 1, 0), atol=1e-6)
    np.testing.assert_allclose(hits.albedo[14, 22], (0.8, 0.1, 0.1), atol=1e-6)
    hit = hits.object_id >= 0
    np.testing.assert_allclose(np.linalg.norm(hits.normal[hit], axis=1), 1, atol=1e-5)
    # The floor lies 1.4 m below the camera: distance along the ray from its angle.
    height, half = 1.4, np.tan(np.radians(21))
    y = (1 - 2 * (26.5 / 28)) * half
    x = (2 * (2.5 / 44) - 1) * half * 44 / 28
    pitch = np.arctan2(-0.9, 4.2)
    down = -(np.sin(pitch) + y * np.cos(pitch)) / np.sqrt(1 + x * x + y * y)
    np.testing.assert_allclose(hits.depth[26, 2], height / down, rtol=1e-4)


def test_empty_scene_is_the_environment(device: Device) -> None:
    session = Session(Scene(settings=small_settings()).with_environment(color=(0.2, 0.4, 0.6)), device=device)
    session.step()
    np.testing.assert_allclose(session.image(), np.broadcast_to((0.2, 0.4, 0.6), (28, 44, 3)), rtol=1e-6)
    assert session.pick((3, 3)) is None


def test_render_reports_every_step(device: Device) -> None:
    reports = []
    Session(mixed_scene(), device=device).render(3, reports.append)
    assert [report.mode for report in reports] == [Mode.BASE, Mode.REFINE, Mode.REFINE]
    assert all(report.paths == 24 * 64 and report.seconds > 0 for report in reports)


@pytest.mark.parametrize(("of_one", "of_all"), [(0, 0), (512, 20), (512, 15), (10000, 100000)])
def test_triangles_on_top_look_like_objects(
    device: Device, monkeypatch: pytest.MonkeyPatch, of_one: int, of_all: int
) -> None:
    """Small meshes lie in the top level in world space; how many do changes nothing but speed."""
    scene = mixed_scene().with_object("red cube", scale=(-1, 1, 0.5))
    scene = scene.with_object("grey drum", scale=(0.7, -0.8, 0.7), rotation=(10, 20, 30))
    scene = scene.with_added(Object("hidden", shape("cube"), "red", scale=(3, 3, 3), visible=False))
    expected = Session(scene, device=device)
    expected.render(8)
    monkeypatch.setattr(object_table, "_MOST_FACES_OF_ONE", of_one)
    monkeypatch.setattr(object_table, "_MOST_FACES_OF_ALL", of_all)
    session = Session(replace(scene), device=device)  # of a copy no tables live
    session.render(8)
    difference = np.abs(session.image() - expected.image())
    assert np.median(difference) < 1e-5
    assert session.image().mean() == pytest.approx(expected.image().mean(), rel=1e-2)
    actual, wanted = session.first_hits(), expected.first_hits()
    same = actual.object_id == wanted.object_id
    assert same.mean() > 0.999
    np.testing.assert_allclose(actual.normal[same], wanted.normal[same], atol=1e-3)
    seen = same & (actual.object_id >= 0)
    np.testing.assert_allclose(actual.depth[seen], wanted.depth[seen], rtol=1e-4)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e39, -0.1, 1.1])
def test_points_that_no_picture_has_show_nothing(device: Device, bad: float) -> None:
    session = Session(mixed_scene(), device=device)
    assert session.pick_point((bad, 0.5)) is None and session.pick_point((0.5, bad)) is None
    with pytest.raises(InputError, match="is outside the image"):
        session.pick((session.size[0] * bad if abs(bad) > 1 else bad - 1, 0))  # type: ignore[arg-type]


def test_rows_that_no_picture_has_are_refused(device: Device) -> None:
    session = Session(mixed_scene(), device=device)
    for rows in ((5, 2), (0, 0), (-3, 5), (0, 1000)):
        with pytest.raises(InputError, match="are no rows of 28; name one at least"):
            session.first_hits(rows=rows)
    for size in ((0, 5), (10**6, 10**6)):
        with pytest.raises(InputError, match="size"):
            session.first_hits(size)
