"""Things in line with one another and on what is below them, and the rays that find out what that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.small_scenes import mixed_scene

from incpt.device.device import Device
from incpt.render.session import Session
from incpt.scene import arranging, ray_cast
from incpt.scene.arranging import ENDS, aligned, dropped, extent
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SCENE = Scene(
    materials={"m": Material()},
    objects=(
        Object("table", shape("cube"), "m", (0, 0.5, 0), (0, 30, 0), (2, 1, 2)),
        Object("ball", shape("sphere"), "m", (0.3, 5, 0.2), scale=(0.5, 1, 0.5)),
        Object("far", shape("cube"), "m", (20, 3, 0), (30, 20, 10)),
        Object("hidden", shape("cube"), "m", (0, 2, 0), visible=False),
        Object("floor", shape("plane"), "m", (0, -1, 0), scale=(9, 1, 9)),
    ),
    lights=(Light("lamp", "rectangle", (1, 4, 1), (-90, 0, 0), size=(2, 1)),),
)


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("axis", range(3))
def test_extents_are_brought_into_line(axis: int, end: str) -> None:
    scene = aligned(SCENE, ("ball", "lamp"), "far", axis, end)
    wanted = extent(SCENE.object("far"))[:, axis]
    for name in ("ball", "lamp"):
        low, high = extent(scene.placed(name))[:, axis]
        share = ENDS[end]
        assert low + share * (high - low) == pytest.approx(wanted[0] + share * (wanted[1] - wanted[0]))
        moved = np.subtract(scene.placed(name).position, SCENE.placed(name).position)
        assert not np.delete(moved, axis).any()
    assert scene.object("far") == SCENE.object("far")
    assert aligned(scene, ("ball",), "far", axis, end) == scene


def test_what_is_dropped_stands_on_what_is_below_it() -> None:
    scene = dropped(SCENE, ("ball", "far", "lamp"))
    assert extent(scene.object("ball"))[0, 1] == pytest.approx(1.0), "on the table, through what is hidden"
    assert extent(scene.object("far"))[0, 1] == pytest.approx(0.0), "there is nothing"
    assert scene.light("lamp").position == pytest.approx((1, -1, 1)), "beside the turned table"
    assert scene.object("ball").rotation == SCENE.object("ball").rotation
    assert dropped(scene, ("ball", "far")) == scene
    both = dropped(SCENE, ("ball", "table"))
    assert extent(both.object("table"))[0, 1] == pytest.approx(-1.0)
    assert extent(both.object("ball"))[0, 1] == pytest.approx(-1.0), "what falls too is no ground"


def test_what_is_a_little_in_the_ground_is_lifted() -> None:
    sunk = SCENE.with_object("ball", position=(0.3, 1.3, 0.2))
    assert extent(dropped(sunk, ("ball",)).object("ball"))[0, 1] == pytest.approx(1.0)
    deep = SCENE.with_object("ball", position=(0.3, 0.9, 0.2))
    assert extent(dropped(deep, ("ball",)).object("ball"))[0, 1] == pytest.approx(0.0)


coordinates = st.floats(-3, 3)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[coordinates] * 3), st.tuples(*[coordinates] * 3).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_a_ray_meets_a_ball_where_it_should(origin: tuple[float, ...], way: tuple[float, ...]) -> None:
    """A fine sphere, within what its facets leave out."""
    ball = Object("b", shape("sphere"), "m", (0.5, -0.2, 0.1), scale=(2, 2, 2))
    start, direction = np.array(origin), np.array(way) / np.linalg.norm(way)
    away = start - ball.position
    middle, apart = away @ direction, away @ away - 1.0
    root = middle**2 - apart
    hit = ray_cast.cast([ball], start, direction)
    if root < -0.05 or (apart > 0.05 and middle > 0):
        assert hit is None
    elif root > 0.2 and abs(apart) > 0.2:
        inside = apart < 0
        expected = -middle + (np.sqrt(root) if inside else -np.sqrt(root))
        assert hit is not None and hit.distance == pytest.approx(expected, abs=0.1)
        outward = (hit.place - ball.position) / np.linalg.norm(hit.place - ball.position)
        assert hit.normal @ direction < 0
        assert hit.normal @ outward * (-1 if inside else 1) > 0.9


def test_rays_meet_what_the_renderer_sees(device: Device) -> None:
    scene = mixed_scene()
    turned = scene.with_object("red cube", rotation=(20, 40, 10), scale=(1, 2, -0.5))
    turned = replace(turned, objects=(*turned.objects, Object("odd", shape("cube"), "red", matrix=np.array(
        [[0.4, 0.3, 0, -0.9], [0, 0.5, 0.2, 1.2], [0, 0, 0.3, 0.4]]))))  # fmt: skip
    session = Session(turned, device=device)
    hits = session.first_hits()
    width, height = session.size
    for x in range(1, width, 5):
        for y in range(1, height, 5):
            at = np.array([[(x + 0.5) / width, (y + 0.5) / height]])
            starts, ways = turned.camera.rays(at, width / height)
            way = ways[0] / np.linalg.norm(ways[0])
            hit = ray_cast.cast(turned.objects, starts[0], way)
            index = hits.object_id[y, x]
            assert (None if hit is None else hit.name) == (turned.objects[index].name if index >= 0 else None)
            if hit is not None:
                assert hit.distance == pytest.approx(float(hits.depth[y, x]), rel=1e-4)


def test_extent_is_that_of_vertices_and_not_of_a_turned_box() -> None:
    one = Object("b", shape("sphere"), "m", rotation=(45, 45, 0))
    assert extent(one)[1] - extent(one)[0] == pytest.approx([1, 1, 1], abs=0.03)
    assert arranging.extent(SCENE.light("lamp")) is SCENE.light("lamp").world_bounds
