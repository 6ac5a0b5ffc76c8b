"""The clamp of indirect light: what it takes, and what it leaves alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.pairs import check, session_of, traced_pairs
from support.reference_scenes import cornell, environment, frosted
from support.renders import render
from support.small_scenes import mixed_scene

from incpt.core.errors import InputError
from incpt.core.settings import RenderSettings
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

LIMIT = 0.05


def box(spp: int = 1, **settings: Any) -> npt.NDArray[np.float64]:
    return render(cornell(), spp, seed=3, **{"max_bounces": 3, "roulette_depth": 255, **settings})


def test_each_addition_is_held_below_the_limit() -> None:
    direct, clamped, free = box(max_bounces=0), box(clamp_indirect=LIMIT), box()
    added, could = clamped - direct, free - direct
    # Light sampling and BSDF sampling add up to three times each.
    assert added.min() > -1e-5 and added.mean(axis=-1).max() < 6 * LIMIT + 1e-5
    few = could.mean(axis=-1) <= LIMIT
    np.testing.assert_allclose(added[few], could[few], atol=1e-5)
    assert 0.05 < few.mean() < 0.95
    assert (added[~few].mean(axis=-1) < could[~few].mean(axis=-1)).any()
    assert (added <= could + 1e-5).all()
    # It is the mean of the components that is held: where one addition is all there is, it ends on the limit.
    assert np.isclose(added.mean(axis=-1), LIMIT, rtol=1e-4).mean() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("make", [cornell, frosted, environment], ids=lambda make: make.__name__)
def test_direct_light_stays_and_nothing_else(make: Callable[[], Scene]) -> None:
    """Of opaque surfaces, rough glass and an image of the environment, which stages of their own bring."""
    common: dict[str, Any] = {"seed": 3, "roulette_depth": 255}
    direct = render(make(), 64, max_bounces=0, **common)
    without = render(make(), 64, max_bounces=0, clamp_indirect=1e-6, **common)
    np.testing.assert_allclose(without, direct, rtol=1e-4, atol=1e-6)
    clamped = render(make(), 64, max_bounces=3, clamp_indirect=1e-6, **common)
    np.testing.assert_allclose(clamped, direct, rtol=1e-3, atol=1e-4)
    assert render(make(), 64, max_bounces=3, **common).mean() > 1.02 * direct.mean()


def test_a_limit_that_nothing_reaches_changes_nothing() -> None:
    np.testing.assert_allclose(box(16, clamp_indirect=1e8), box(16), rtol=1e-5, atol=1e-6)


def test_the_clamp_darkens() -> None:
    means = [box(256, clamp_indirect=limit).mean() for limit in (0.02, 0.1, 0.5, 0.0)]
    assert means == sorted(means) and means[0] < 0.95 * means[-1]


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
def test_a_lamp_behind_glass_is_seen_whole_and_a_caustic_is_not(in_blocks: bool) -> None:
    materials = {
        "pane": Material((1, 1, 1), roughness=0, transmission=1, ior=1.5),
        "lamp": Material((0, 0, 0), emission=(9, 9, 9), double_sided=True),
        "floor": Material((0.8, 0.8, 0.8), specular=0),
    }
    pane = Object("pane", shape("cube"), "pane", (0, 0, 0), scale=(3, 3, 0.1))
    lamp = Object("lamp", shape("plane"), "lamp", (0, 0, -2), (90, 0, 0), (4, 1, 4))
    camera = Camera((0, 0, 3), (0, 0, 0), fov_y=5)
    seen = Scene(camera, Environment(), materials, (pane, lamp))
    # Light that a matte floor gets through a pane of glass: no lamp can be sampled there.
    floor = Object("floor", shape("plane"), "floor", (0, 0, 2), (90, 0, 0), scale=(0.5, 1, 0.5))
    lit = Scene(
        replace(camera, position=(0, 0, 0.6), target=(0, 0, 2)), Environment(), materials, (pane, lamp, floor)
    )
    pictures = []
    for scene in (seen, lit):
        for limit in (0.0, 1e-3):
            settings = RenderSettings(size=(8, 8), strategy="restart", clamp_indirect=limit, max_bounces=2)
            session = session_of(device(), replace(scene, settings=settings), in_blocks)
            session.render(64)
            pictures.append(session.image())
    # All but what is mirrored to and fro.
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=3e-3)
    assert pictures[0].mean() > 8 and pictures[2].mean() > 0.1
    assert pictures[3].mean() < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("make", [mixed_scene, cornell], ids=["mixed", "cornell"])
def test_blocks_and_wavefront_agree(make: Any) -> None:
    scene = make()
    settings = replace(scene.settings, size=(53, 37), base_nor=8, roulette_depth=1, clamp_indirect=0.1)
    images = []
    for in_blocks in (True, False):
        session = session_of(device(), replace(scene, settings=settings), in_blocks, 8)
        session.render(8)
        images.append(session.image())
    assert np.median(np.abs(images[0] - images[1])) < 1e-5
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["restart", "spiral", "impact"])
def test_another_limit_starts_the_picture_over(strategy: str) -> None:
    scene = mixed_scene(strategy=strategy, base_nor=4)
    session = Session(scene, device=device())
    session.render(4)
    session.edit(scene.with_object("red cube", position=(0.2, 0.5, 0)))
    session.step()
    session.configure(replace(session.settings, clamp_indirect=0.2))
    assert session.mode is Mode.BASE
    session.render(4)
    fresh = Session(session.scene, settings=session.settings, device=device())
    fresh.render(4)
    np.testing.assert_array_equal(session.image(), fresh.image())


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
def test_pairs_of_paths_are_clamped_alike(in_blocks: bool) -> None:
    scene = mixed_scene(clamp_indirect=0.1)
    check(
        traced_pairs(device(), scene, scene.with_object("red cube", position=(0.15, 0.5, -0.1)), in_blocks),
        0.4,
    )


@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf"), "much", None, True, 1e10])
def test_the_limit_is_checked(value: Any) -> None:
    with pytest.raises(InputError, match=r"^clamp_indirect: "):
        RenderSettings(clamp_indirect=value)
