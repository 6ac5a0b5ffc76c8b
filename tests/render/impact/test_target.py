"""A second edit of the same object starts from the picture of the first, as far as both show the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.render.impact.center_hits import CenterHits
from incpt.render.impact.first_sight import widened
from incpt.render.impact.target import KNOWN, Target
from incpt.render.session import Session
from incpt.render.tiles import TileGrid
from incpt.scene.model import Scene

pytestmark = pytest.mark.slow

SIZE = (96, 64)
CUBE = "red cube"
Picture = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]


def start() -> Scene:
    """A small cube on a glossy floor, which mirrors it."""
    scene = mixed_scene(strategy="impact", base_nor=16).without_object("glass ball")
    return scene.with_object(CUBE, scale=(0.4, 0.4, 0.4), position=(0.5, 0.2, 0.9))


def moved(scene: Scene, x: float) -> Scene:
    return scene.with_object(CUBE, position=(x, 0.2, 0.9))


START = start()
FIRST, SECOND = moved(START, -0.7), moved(START, -0.1)


def refined(device: Device, scene: Scene, spp: int = 64) -> Session:
    session = Session(replace(scene), size=SIZE, device=device)
    session.render(spp)
    return session


def known(session: Session) -> None:
    """Go on until the edit is known well enough to start from."""
    for _ in range(400):
        session.step()
        left = session.error_left()
        assert left is not None and session.snapshot().progress.anchor is not None
        if left < 0.5 * KNOWN:
            return
    raise AssertionError("the edit was not found")


def hits_of(device: Device, scene: Scene) -> CenterHits:
    found = Session(replace(scene), size=SIZE, device=device).first_hits()
    return CenterHits(scene, found.object_id, found.normal, found.albedo)


def shows_cube(device: Device, scene: Scene) -> Mask:
    return np.asarray(hits_of(device, scene).objects == scene.object_index[CUBE])


def test_it_has_what_looks_the_same_in_both(device: Device) -> None:
    hits = hits_of(device, FIRST)
    target = Target(hits, np.ones((*SIZE[::-1], 4), np.float32))
    grid = TileGrid(*SIZE, 8)
    cubes = shows_cube(device, FIRST) | shows_cube(device, SECOND)
    np.testing.assert_array_equal(target.shows(hits_of(device, SECOND), grid), ~widened(cubes, 1))
    recoloured = FIRST.with_material("red", base_color=(0.1, 0.1, 0.8))
    cube = widened(shows_cube(device, FIRST), 1)
    np.testing.assert_array_equal(target.shows(hits_of(device, recoloured), grid), ~cube)
    without = FIRST.without_object(CUBE)
    np.testing.assert_array_equal(target.shows(hits_of(device, without), grid), ~cube)
    assert target.shows(hits, grid).all()
    empty = Target(hits, np.zeros((*SIZE[::-1], 4), np.float32))
    assert not empty.shows(hits, grid).any()


def test_nothing_comes_back_that_was_gone(device: Device) -> None:
    truths = [refined(device, scene, 1024).image() for scene in (START, FIRST, SECOND)]
    session = refined(device, START)
    session.edit(FIRST)
    known(session)
    session.edit(SECOND)
    cubes = np.logical_or.reduce([shows_cube(device, scene) for scene in (START, FIRST, SECOND)])
    differs = np.abs(truths[0] - truths[2]).max(axis=2)
    same = np.abs(truths[1] - truths[2]).max(axis=2)
    gone = (differs > 0.03) & (same < 0.015) & ~widened(cubes, 2)
    assert gone.sum() > 20, "the first edit took a reflection away"
    before = np.abs(truths[0] - truths[2])[gone].mean()
    for _ in range(12):
        shown = session.image(first_sight=True)
        assert np.abs(shown - truths[2])[gone].mean() < 0.5 * before
        session.step(8)


def test_before_the_first_step_the_picture_before_stands(device: Device) -> None:
    session = refined(device, START)
    session.edit(FIRST)
    known(session)
    before = session.image()
    session.edit(SECOND)
    cubes = widened(shows_cube(device, FIRST) | shows_cube(device, SECOND), 2)
    np.testing.assert_allclose(session.image()[~cubes], before[~cubes], rtol=1e-5, atol=1e-6)
    shown = session.first_sight()
    assert shown is not None
    np.testing.assert_allclose(shown[~cubes][:, :3], before[~cubes], rtol=1e-5, atol=1e-6)


def test_the_drag_after_it_starts_from_before_the_drag(device: Device) -> None:
    """Until its picture is known, a step of a drag is nothing to start from."""
    session = refined(device, START)
    session.edit(FIRST)
    known(session)
    for x in (-0.6, -0.4, -0.2):
        session.edit(moved(FIRST, x), since=FIRST)
        session.step(4)
    target = session.snapshot().target
    assert target is not None and target.hits.scene is FIRST
    known(session)
    dragged = session.scene
    session.edit(SECOND)
    target = session.snapshot().target
    assert target is not None and target.hits.scene is dragged


def test_a_first_edit_has_none(device: Device) -> None:
    session = refined(device, START)
    assert session.snapshot().target is None
    session.edit(FIRST)
    session.step(4)
    session.edit(SECOND)
    assert session.snapshot().target is None, "little was known of the first"


def test_another_object_folds_the_picture_and_has_none(device: Device) -> None:
    session = refined(device, START)
    session.edit(FIRST)
    known(session)
    session.edit(SECOND)
    session.edit(SECOND.with_object("grey drum", position=(-1.0, 0.4, 0.2)))
    for _ in range(10):
        session.step()
    session.edit(session.scene.with_object("lamp", position=(0.1, 2.5, 0.5)))
    assert session.snapshot().target is None


def test_snapshots_hold_it(device: Device) -> None:
    session = refined(device, START)
    session.edit(FIRST)
    known(session)
    session.edit(SECOND)
    session.step(8)
    kept, shown = session.snapshot(), session.image(first_sight=True)
    for _ in range(5):
        session.step()
    assert not np.array_equal(session.image(), shown)
    session.restore(kept)
    np.testing.assert_allclose(session.image(first_sight=True), shown, rtol=1e-5, atol=1e-6)


def test_the_picture_converges_to_that_of_the_scene(device: Device) -> None:
    fresh = refined(device, SECOND, 96).image()
    truth = Session(replace(SECOND), size=SIZE, settings=replace(SECOND.settings, seed=9), device=device)
    truth.render(512)
    session = refined(device, START)
    for scene in (FIRST, moved(FIRST, 0.1), SECOND):
        session.edit(scene)
        known(session)
    session.render(96)
    errors = [float(np.sqrt(((image - truth.image()) ** 2).mean())) for image in (session.image(), fresh)]
    assert errors[0] < 1.25 * errors[1]
