"""Pictures without the environment behind them, and with an alpha."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.picture.tone_mapping import tone_map
from incpt.render.export import write_picture
from incpt.render.modes import Mode
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.light import Light
from incpt.scene.model import Scene

pytestmark = pytest.mark.slow
SPP = 16


def lit_scene() -> Scene:
    """The mixed scene with a lamp in front of the sky, and a sun behind everything."""
    bulb = Light("bulb", "sphere", position=(-1.6, 2.2, -1.0), radius=0.3, power=60.0)
    sun = Light("sun", "sun", rotation=(0, 180, 0), angle=20.0, irradiance=1.0)
    return mixed_scene().with_added_light(bulb).with_added_light(sun)


def rendered(device: Device, scene: Scene, in_blocks: bool = True, **settings: object) -> Session:
    session = Session(
        scene, settings=replace(scene.settings, **{"transparent": True, **settings}), device=device
    )
    if not in_blocks:
        session._tracer = Wavefront(device)
    session.render(SPP)
    return session


@pytest.mark.parametrize("in_blocks", [True, False])
def test_what_is_covered_is_as_bright_as_ever(device: Device, in_blocks: bool) -> None:
    image = rendered(device, lit_scene(), in_blocks).image(alpha=True)
    opaque = rendered(device, lit_scene(), in_blocks, transparent=False, aovs=True)
    alpha = image[..., 3]
    np.testing.assert_array_equal(alpha, opaque.pass_image("alpha")[..., 0])
    assert (opaque.image(alpha=True)[..., 3] == 1).all()
    covered, free = alpha == 1, alpha == 0
    assert covered.sum() > 200 and free.sum() > 100 and (~covered & ~free).sum() > 10
    np.testing.assert_array_equal(image[covered, :3], opaque.image()[covered])
    assert not image[free, :3].any() and opaque.image()[free].all()
    edge = ~covered & ~free
    assert (image[edge, :3] <= opaque.image()[edge]).all()


def test_lamps_cover_and_suns_do_not(device: Device) -> None:
    scene = replace(lit_scene(), objects=(), materials={}).with_environment(color=(0, 0, 0))
    for in_blocks in (True, False):
        image = rendered(device, scene, in_blocks).image(alpha=True)
        lamp = image[..., 3] == 1
        assert 5 < lamp.sum() < 200 and image[lamp, :3].min() > 1
        assert not image[image[..., 3] == 0].any()


def test_the_environment_lights_and_is_reflected(device: Device) -> None:
    scene = mixed_scene()
    lit, dark = (rendered(device, one).image() for one in (scene, scene.with_environment(color=(0, 0, 0))))
    cylinder = rendered(device, scene).first_hits().object_id == 3
    assert lit[cylinder].mean() > 1.5 * dark[cylinder].mean() > 0


def test_edits_and_undo_change_alpha_with_the_picture(device: Device) -> None:
    start = mixed_scene()
    session = rendered(device, start, strategy="impact")
    moved = start.with_object("red cube", position=(0.9, 1.3, 0.4))
    for scene in (moved, start):
        session.edit(scene)
        while session.mode is Mode.INCREMENTAL:
            session.step()
        session.render(2 * SPP)
        expected = rendered(device, scene, seed=3).image(alpha=True)
        alpha = session.image(alpha=True)[..., 3]
        assert np.abs(alpha - expected[..., 3]).mean() < 0.02
        assert np.mean(np.abs(alpha - expected[..., 3]) > 0.5) == 0


def test_first_sight_covers_the_new_place_and_not_the_old_one(device: Device) -> None:
    start = mixed_scene().with_object("red cube", position=(0, 1.5, 0), scale=(0.3, 0.3, 0.3))
    session = rendered(device, start, strategy="impact")
    session.edit(start.with_object("red cube", position=(0.5, 1.6, 0)))
    now = session.first_sight()
    assert now is not None
    hits = session.first_hits().object_id
    was = rendered(device, start).first_hits().object_id
    uncovered, appeared = (was >= 0) & (hits < 0), (was < 0) & (hits >= 0)
    assert uncovered.any() and appeared.any()
    assert now[appeared, 3].min() == 1
    assert np.median(now[uncovered, 3]) == 0


def test_files_have_the_alpha(device: Device, tmp_path: Path) -> None:
    session = rendered(device, mixed_scene())
    image = session.image(alpha=True)
    write_picture(tmp_path / "a.exr", session)
    write_picture(tmp_path / "a.png", session, exposure=1.0, curve="srgb")
    channels = OpenEXR.File(str(tmp_path / "a.exr")).channels()
    np.testing.assert_array_equal(channels["RGBA"].pixels, image)
    with PIL.Image.open(tmp_path / "a.png") as file:
        assert file.mode == "RGBA"
        png = np.asarray(file)
    np.testing.assert_array_equal(png[..., 3], np.rint(255 * image[..., 3]))
    edge = (image[..., 3] > 0) & (image[..., 3] < 1)
    straight = image[edge, :3] / image[edge, 3:]
    np.testing.assert_array_equal(png[edge, :3], tone_map(straight, 1.0, "srgb"))


def test_it_is_a_setting_that_starts_the_picture_over(device: Device) -> None:
    session = rendered(device, mixed_scene(), transparent=False)
    session.configure(replace(session.settings, transparent=True))
    assert session.mode is Mode.BASE
    session.render(1)
    assert session.image(alpha=True)[..., 3].min() == 0
