"""Paths that end because no passages through glass are left are counted, and only those."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.small_scenes import mixed_scene

from incpt.core.layout import Counter
from incpt.core.settings import RenderSettings
from incpt.device.device import Device
from incpt.render.session import Session
from incpt.render.wavefront import Wavefront
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SIZE, SPP = (32, 32), 256
GLASS = Material((1, 1, 1), roughness=0, transmission=1)
REFLECTED = 0.04
"""Of light that meets glass at a right angle."""


@pytest.fixture(params=[False, True], ids=["wavefront", "blocks"])
def in_blocks(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


def share_cut_off(device: Device, in_blocks: bool, material: Material, passages: int) -> float:
    """Of paths that all meet a pane at a right angle, in front of nothing."""
    pane = Object("pane", shape("cube"), "pane", scale=(9, 9, 0.1))
    camera = Camera((0, 0, 5), (0, 0, 0), fov_y=2)
    scene = Scene(camera, Environment((1, 1, 1)), {"pane": material}, (pane,))
    settings = RenderSettings(
        SIZE, max_bounces=2, transmission_bounces=passages, roulette_depth=255, sample_rate=SPP
    )
    session = Session(scene, settings=settings, device=device)
    session._tracer = session._tracer if in_blocks else Wavefront(device)
    report = session.step()
    assert report.paths == SIZE[0] * SIZE[1] * SPP
    return report.cut_off / report.paths


@pytest.mark.slow
@pytest.mark.parametrize("passages", [0, 1, 2, 3])
def test_the_share_is_what_fresnel_leaves_in_the_pane(device: Device, in_blocks: bool, passages: int) -> None:
    # The first passage leads in. Of those behind it a path takes another where it is reflected inside.
    inside = (1 - REFLECTED) * REFLECTED ** max(passages - 1, 0)
    error = np.sqrt(inside / (SIZE[0] * SIZE[1] * SPP))
    share = share_cut_off(device, in_blocks, GLASS, passages)
    assert abs(share - inside) < 5 * error + 1e-3 * inside


def test_paths_that_carry_nothing_more_are_not_counted(device: Device, in_blocks: bool) -> None:
    assert share_cut_off(device, in_blocks, replace(GLASS, base_color=(0, 0, 0)), 0) == 0
    assert share_cut_off(device, in_blocks, replace(GLASS, base_color=(0.1, 0, 0)), 0) > 0.9


@pytest.mark.slow
def test_other_ends_are_not_counted(device: Device, in_blocks: bool) -> None:
    rough = replace(GLASS, roughness=0.5)  # max_bounces is for these
    for material in (rough, replace(GLASS, transmission=0, roughness=0.3), replace(GLASS, ior=1.0)):
        assert share_cut_off(device, in_blocks, material, 60) == 0
    assert share_cut_off(device, in_blocks, rough, 0) == 0
    assert share_cut_off(device, in_blocks, replace(GLASS, transmission=0), 0) == 0


def test_partners_do_not_count(device: Device) -> None:
    """What the scene before an edit had of glass says nothing of the picture."""
    scene = mixed_scene(transmission_bounces=0, sample_rate=4)
    session = Session(scene, device=device)
    before = session.step()
    assert 0 < before.cut_off < before.paths / 4
    session.edit(scene.with_object("glass ball", material="red"))
    report = session.step()
    assert report.partners > 0 and report.cut_off == 0
    pairs = session._state.path_buffer.pairs
    assert pairs is not None and device.read(pairs.counters, np.empty(2, np.uint32))[Counter.CUT_OFF] > 0
