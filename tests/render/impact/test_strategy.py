"""What a session shows under `impact`, edit after edit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.render.impact.shrinkage import Shrinkage
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.model import Scene

pytestmark = pytest.mark.slow

SIZE = (40, 28)
BASE_SPP = 512
Picture = np.ndarray


def impact_scene() -> Scene:
    # Without glass, whose rare bright paths would hide what is looked for.
    return mixed_scene(strategy="impact", base_nor=16).without_object("glass ball")


@pytest.fixture(scope="module")
def converged(device: Device) -> Callable[[Scene], Picture]:
    """The picture of a scene with other random numbers than the sessions'."""

    def render(scene: Scene) -> Picture:
        settings = replace(scene.settings, strategy="restart", seed=91, base_nor=64)
        session = Session(replace(scene), size=SIZE, settings=settings, device=device)
        session.render(1024)
        return session.image()

    return render


def refined(device: Device) -> Session:
    session = Session(impact_scene(), size=SIZE, device=device)
    session.render(BASE_SPP)
    return session


def error(image: Picture, truth: Picture) -> float:
    return float(np.sqrt(((image - truth) ** 2).mean()))


def moved(scene: Scene, x: float) -> Scene:
    return scene.with_object("red cube", position=(x, 0.5, 0.9))


def stepped(session: Session, steps: int) -> Session:
    for _ in range(steps):
        session.step()
    return session


def test_an_edit_is_found_and_the_rest_keeps_its_quality(
    device: Device, converged: Callable[[Scene], Picture]
) -> None:
    session = refined(device)
    edited = moved(session.scene, 0.9)
    truth, before = converged(edited), converged(session.scene)
    ghost = error(before, truth)
    session.edit(edited)
    assert session.mode is Mode.INCREMENTAL and session.tile_spp.max() == 0
    errors = [error(stepped(session, steps).image(), truth) for steps in (2, 30)]
    assert errors[0] < 0.5 * ghost and errors[1] < 0.5 * errors[0]
    assert session.mode is Mode.REFINE and session.tile_spp.min() > 0


def test_the_same_object_again_leaves_no_ghost_of_the_edit_before(
    device: Device, converged: Callable[[Scene], Picture]
) -> None:
    session = refined(device)
    first, second = moved(session.scene, 0.9), moved(session.scene, -0.9)
    truth = converged(second)
    ghost = error(converged(first), truth)
    session.edit(first)
    stepped(session, 40)
    anchor = session.progress.anchor
    session.edit(second)
    assert session.progress.anchor is anchor and anchor is not None
    assert error(stepped(session, 20).image(), truth) < 0.15 * ghost


def test_another_object_folds_the_picture(device: Device, converged: Callable[[Scene], Picture]) -> None:
    session = refined(device)
    first = moved(session.scene, 0.9)
    second = first.with_object("grey drum", visible=False)
    truth = converged(second)
    ghost = error(converged(session.scene.with_object("grey drum", visible=False)), truth)
    session.edit(first)
    stepped(session, 40)
    shown = session.image()
    session.edit(second)
    assert session.progress.anchor is not None and session.progress.anchor.scene is first
    np.testing.assert_allclose(session.image(), shown, rtol=1e-4, atol=1e-5)
    assert error(stepped(session, 20).image(), truth) < 0.15 * ghost


def test_taken_back_the_picture_is_there_at_once(device: Device) -> None:
    session = refined(device)
    scene, before, worth = session.scene, session.image(), session.tile_spp
    session.edit(moved(scene, 0.9))
    stepped(session, 3)
    session.edit(scene)
    np.testing.assert_array_equal(session.image(), before)
    np.testing.assert_array_equal(session.tile_spp, worth)
    assert session.mode is Mode.REFINE and session.progress.anchor is None
    stepped(session, 1)
    assert session.tile_spp.sum() > worth.sum()


def test_the_old_picture_stands_until_there_is_more(device: Device) -> None:
    session = refined(device)
    before = session.image()
    session.edit(moved(session.scene, 0.9))
    np.testing.assert_allclose(session.image(), before, rtol=1e-5, atol=1e-6)
    stepped(session, 20)
    shown = session.image()
    session.edit(session.scene.with_camera(position=(0.3, 1.4, 4.2)))
    assert session.mode is Mode.BASE
    np.testing.assert_allclose(session.image(), shown, rtol=1e-4, atol=1e-5)


def test_samples_of_the_kept_picture_never_come_twice(device: Device) -> None:
    session, taken = refined(device), 0
    for x in (0.9, -0.9, 0.4):
        session.edit(moved(session.scene, x))
        assert session.progress.first_sample > taken
        stepped(session, 5)
        taken = session.progress.first_sample + int(session.progress.drawn.max()) - 1


def test_snapshots_hold_the_comparison(device: Device) -> None:
    session = refined(device)
    session.edit(moved(session.scene, 0.9))
    stepped(session, 7)
    snapshot, shown = session.snapshot(), session.image()
    session.edit(moved(session.scene, -0.3))
    stepped(session, 4)
    session.restore(snapshot)
    np.testing.assert_allclose(session.image(), shown, rtol=1e-5, atol=1e-6)
    stepped(session, 2)


@pytest.mark.parametrize("strategy", ["spiral", "restart"])
def test_another_strategy_goes_on_with_the_picture(device: Device, strategy: str) -> None:
    session = refined(device)
    session.edit(moved(session.scene, 0.9))
    stepped(session, 20)
    shown = session.image()
    session.configure(replace(session.settings, strategy=strategy))
    assert session.progress.anchor is None
    np.testing.assert_allclose(session.image(), shown, rtol=1e-4, atol=1e-5)
    stepped(session, 3)
    assert error(session.image(), shown) < 0.1 * float(shown.mean())


def test_an_edit_without_anything_to_see_changes_nothing(device: Device) -> None:
    session = refined(device)
    session.edit(moved(session.scene, 0.9))
    stepped(session, 5)
    shown, progress = session.image(), session.progress
    session.edit(
        session.scene.with_added(replace(session.scene.object("floor"), name="unseen", visible=False))
    )
    assert session.progress is progress
    np.testing.assert_allclose(session.image(), shown, rtol=1e-5, atol=1e-6)


def test_a_picture_is_made_once_for_who_plans_and_who_looks(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, update = [], Shrinkage.update

    def counted(self: Shrinkage, *of: object) -> None:
        made.append(1)
        update(self, *of)

    monkeypatch.setattr(Shrinkage, "update", counted)
    session = Session(impact_scene(), size=SIZE, device=device)
    session.render(16)
    session.edit(moved(session.scene, 0.4))
    first = stepped(session, 8).image()
    assert 0 < len(made) <= 9
    made.clear()
    np.testing.assert_array_equal(session.image(), first)
    assert not made
    assert (stepped(session, 8).image() != first).any() and made
