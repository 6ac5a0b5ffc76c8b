"""What an edit moved is seen at its new place, and not at its old one, before any sample of it is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.render.impact import first_sight
from incpt.render.impact.center_hits import CenterHits
from incpt.render.impact.first_sight import FirstSight
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.model import Scene

pytestmark = pytest.mark.slow

SIZE = (96, 64)
CUBE = "red cube"
Picture = npt.NDArray[np.float32]


def small_cube() -> Scene:
    scene = mixed_scene(strategy="impact", base_nor=16).without_object("glass ball")
    return scene.with_object(CUBE, scale=(0.4, 0.4, 0.4), position=(0.3, 0.2, 0.8))


def refined(device: Device, scene: Scene, spp: int = 64) -> Session:
    session = Session(replace(scene), size=SIZE, device=device)
    session.render(spp)
    return session


def places(session: Session, old: Scene, new: Scene) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Pixels that show the cube in the old scene only, and in the new one only."""
    shown = []
    for scene in (old, new):
        ids = Session(scene, size=SIZE, device=session.device).first_hits().object_id
        index = scene.object_index[CUBE] if scene.object(CUBE).visible else -2
        shown.append(ids == index)
    return shown[0] & ~shown[1], shown[1] & ~shown[0]


def error(image: Picture, truth: Picture, where: npt.NDArray[np.bool_]) -> float:
    return float(np.sqrt(((image[..., :3] - truth) ** 2)[where].mean()))


def test_the_moved_object_is_drawn_and_leaves_no_ghost(device: Device) -> None:
    session = refined(device, small_cube())
    scene, before = session.scene, session.image()
    edited = scene.with_object(CUBE, position=(-0.7, 0.2, 0.9))
    truth = refined(device, edited, 512).image()
    was, now = places(session, scene, edited)
    assert was.sum() > 30 and now.sum() > 30
    session.edit(edited)
    assert np.allclose(session.image(), before, rtol=1e-5, atol=1e-6), "only who asks for it gets the guess"
    shown = session.image(alpha=True, first_sight=True)
    at_once = session.first_sight()
    assert at_once is not None and session.queue is not None and not session.progress.drawn.any()
    np.testing.assert_allclose(at_once, shown, rtol=1e-5, atol=1e-6)
    assert error(shown, truth, now) < 0.4 * error(before, truth, now)
    assert error(shown, truth, was) < 0.4 * error(before, truth, was)
    # Wherever the cube neither is nor was, nothing is touched.
    outside = ~(was | now)
    inside = np.zeros_like(outside)
    for y, x in np.argwhere(was | now):
        inside[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = True
    np.testing.assert_array_equal(shown[outside & ~inside][:, :3], session.image()[outside & ~inside])


def test_it_gives_way_to_samples_tile_by_tile(device: Device) -> None:
    session = refined(device, small_cube())
    session.edit(session.scene.with_object(CUBE, position=(-0.7, 0.2, 0.9)))
    mixed = 0
    while session.mode is Mode.INCREMENTAL:
        session.step(8)
        assert session.first_sight() is None
        measured, guessed = session.image(), session.image(first_sight=True)
        is_drawn = (session.progress.drawn > 0)[session.grid.tile_of_pixels()]
        np.testing.assert_array_equal(guessed[is_drawn], measured[is_drawn])
        mixed += bool((guessed != measured).any() and is_drawn.any())
    assert mixed, "no step was seen between the first tile and the last"
    np.testing.assert_array_equal(session.image(first_sight=True), session.image())


def test_it_changes_nothing_of_what_is_found(device: Device) -> None:
    plain, asked = (refined(device, small_cube()) for _ in range(2))
    for x in (-0.7, 0.1):
        for session in (plain, asked):
            session.edit(session.scene.with_object(CUBE, position=(x, 0.2, 0.9)))
        asked.first_sight()
        for _ in range(12):
            plain.step()
            asked.step()
            asked.image(first_sight=True)
    np.testing.assert_array_equal(plain.image(), asked.image())


@pytest.mark.parametrize("visible", [False, True])
def test_objects_come_and_go(device: Device, visible: bool) -> None:
    old = small_cube().with_object(CUBE, visible=not visible)
    new = old.with_object(CUBE, visible=visible)
    session = refined(device, old)
    before, truth = session.image(), refined(device, new, 512).image()
    was, now = places(session, old, new)
    session.edit(new)
    shown = session.first_sight()
    assert shown is not None
    # Of what comes only the colour is known, and the light around it.
    assert error(shown, truth, was | now) < (0.85 if visible else 0.6) * error(before, truth, was | now)


def test_a_drag_takes_its_light_from_before_it(device: Device) -> None:
    session = refined(device, small_cube())
    scene = session.scene
    for x in (-0.2, -0.5, -0.7):
        edited = scene.with_object(CUBE, position=(x, 0.2, 0.9))
        session.edit(edited, since=scene)
        shown = session.first_sight()
        session.step()
    other = refined(device, scene)
    other.edit(edited)
    at_once = other.first_sight()
    assert shown is not None and at_once is not None
    np.testing.assert_allclose(shown, at_once, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("colour", [(0.1, 0.8, 0.1), (0.9, 0.9, 0.9), (0.02, 0.02, 0.02)])
def test_another_colour_is_seen_at_once(device: Device, colour: tuple[float, float, float]) -> None:
    old = small_cube()
    new = old.with_material("red", base_color=colour)
    session = refined(device, old)
    before, truth = session.image(), refined(device, new, 512).image()
    cube = Session(replace(old), size=SIZE, device=device).first_hits().object_id == old.object_index[CUBE]
    session.edit(new)
    shown = session.first_sight()
    assert shown is not None
    assert error(shown, truth, cube) < 0.4 * error(before, truth, cube)


def test_another_finish_stays_as_it_was(device: Device) -> None:
    """What mirrors, shines through or glows cannot be told from a colour."""
    session = refined(device, small_cube(), 16)
    before = session.image()
    session.edit(session.scene.with_material("red", base_color=(0.1, 0.8, 0.1), metallic=1.0))
    shown = session.first_sight()
    assert shown is not None
    np.testing.assert_allclose(shown[..., :3], before, rtol=1e-5, atol=1e-6)


def test_where_there_is_nothing_to_draw_there_is_none(device: Device) -> None:
    session = refined(device, small_cube(), 16)
    scene = session.scene
    assert session.first_sight() is None
    session.edit(scene.with_added(replace(scene.object(CUBE), name="inside", scale=(0.1, 0.1, 0.1))))
    assert session.first_sight() is None, "what is out of sight shows nothing"
    session.edit(scene)
    session.edit(scene.with_object("floor", position=(0, -0.1, 0)))
    assert session.first_sight() is None, "most of the picture is shown anew"
    other = Session(
        replace(scene, settings=replace(scene.settings, strategy="spiral")), size=SIZE, device=device
    )
    other.render(1)
    other.edit(scene.with_object(CUBE, position=(-0.7, 0.2, 0.9)))
    assert other.first_sight() is None
    np.testing.assert_array_equal(other.image(first_sight=True), other.image())


def test_holes_are_filled_along_their_rows() -> None:
    values = np.zeros((4, 9, 3), np.float32)
    values[0], values[1], values[2] = 1.0, 2.0, 3.0
    weights = np.ones((4, 9), np.float32)
    weights[:3, 3:7], weights[3] = 0, 0
    values[weights == 0] = np.nan
    filled = first_sight._filled(np.nan_to_num(values, nan=1e6), weights)
    np.testing.assert_allclose(
        filled[:3], np.array([1, 2, 3], np.float32)[:, None, None].repeat(9, 1).repeat(3, 2)
    )
    assert (filled[3] > 1).all() and (filled[3] <= 3).all(), "a row without any takes the rows around"


def test_a_table_gives_back_what_it_learnt() -> None:
    random = np.random.default_rng(3)
    places = random.uniform(0, first_sight._TABLE_SIZE - 1, (3, 2))
    values = random.random((3, 3)).astype(np.float32)
    learnt = first_sight._table_of(values.repeat(50, axis=0), places.repeat(50, axis=0))
    np.testing.assert_allclose(first_sight._looked_up(learnt, places), values, rtol=1e-5)


def test_windows_that_overlap_are_drawn_once() -> None:
    scene = small_cube()
    none = np.zeros((4, 4, 3), np.float32)
    hits = CenterHits(scene, np.zeros((4, 4), np.int32), none, none)
    sight = FirstSight(hits, hits, [(0, 0, 2, 2), (3, 0, 4, 1), (1, 1, 4, 2)])
    assert sight._windows == ((0, 0, 4, 2),)
