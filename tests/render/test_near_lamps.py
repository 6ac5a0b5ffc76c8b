"""Lamps close to a surface, beside large ones, and far from the origin: none of their light is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.pairs import session_of

from incpt.core.affine import Vector
from incpt.core.settings import RenderSettings
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SCHEDULES = pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
FLOOR = Material((0.8, 0.8, 0.8), specular=0.0)
LAMP = Material((0, 0, 0), specular=0.0, emission=(10, 10, 10))


def lamp_above(
    origin: Vector, height: float, floor_size: float = 4.0, lamp_size: float = 1.0, eye: float = 1.0
) -> Scene:
    """A square lamp above a floor, whose middle fills the picture; the eye is so far from it."""
    x, y, z = origin
    floor = Object("floor", shape("plane"), "floor", origin, scale=(floor_size, 1, floor_size))
    square = (lamp_size, 1, lamp_size)
    lamp = Object("lamp", shape("plane"), "lamp", (x, y + height, z), (180, 0, 0), square)
    camera = Camera((x + eye, y + 0.25 * eye, z), origin, fov_y=1)
    return Scene(camera, Environment((0, 0, 0)), {"floor": FLOOR, "lamp": LAMP}, (floor, lamp))


def seen(scene: Scene, in_blocks: bool, spp: int = 64, **settings: int) -> float:
    """The mean of a picture."""
    kept = RenderSettings(size=(16, 16), strategy="restart", max_bounces=0)
    scene = replace(scene, settings=replace(kept, **settings))
    session = session_of(device(), scene, in_blocks, spp)
    session.render(spp)
    return float(session.image().mean())


@pytest.mark.slow
@SCHEDULES
@pytest.mark.parametrize(
    ("origin", "within"),
    [((0, 0, 0), 0.01), ((0, 100, 0), 0.01), ((0, 1e4, 0), 0.012), ((-1e4, 1e4, 1e4), 0.012)],
    ids=str,
)
def test_floor_under_a_lamp_far_from_the_origin(origin: Vector, within: float, in_blocks: bool) -> None:
    # The form factor of a square from a point at a distance of its edge is 0.23945.
    found = seen(lamp_above(origin, 1.0, eye=2.0), in_blocks)
    assert found == pytest.approx(10 * 0.8 * 0.23945, rel=within)


@pytest.mark.slow
@SCHEDULES
@pytest.mark.parametrize("floor_size", [4.0, 1000.0])
@pytest.mark.parametrize("height", [1e-1, 1e-3, 1e-5, 1e-6])
def test_floor_under_a_lamp_that_nearly_touches_it(height: float, floor_size: float, in_blocks: bool) -> None:
    scene = lamp_above((0, 0, 0), height, floor_size)
    camera = Camera((0.3, height / 2, 0.04), (0.3 + height / 4, 0, 0.04), (0, 0, 1), fov_y=1)
    found = seen(replace(scene, camera=camera), in_blocks)
    assert found == pytest.approx(8.0, rel=1e-3 if height < 0.01 else 0.1)


@SCHEDULES
@pytest.mark.parametrize("size", [1e-6, 1e3])
def test_sizes_of_a_lamp_and_its_floor(size: float, in_blocks: bool) -> None:
    # Of a micrometre beside a body of a kilometre, and of a kilometre.
    scene = lamp_above((0, 0, 0), size, 4 * size, size, 2 * size)
    large = Object("large", shape("cube"), "floor", (0, -600, 0), scale=(1000, 1000, 1000))
    scene = scene if size > 1 else replace(scene, objects=(*scene.objects, large))
    assert seen(scene, in_blocks) == pytest.approx(1.9156, rel=0.01)


@pytest.mark.slow
@SCHEDULES
def test_a_turned_floor_far_away_neither_loses_light_nor_lets_any_through(in_blocks: bool) -> None:
    """A lamp above a turned board is seen from above as it is near the origin, and not at all from below."""
    tilt, scale = (20.0, 35.0, 50.0), (3.0, 1.0, 3.0)
    means = []
    for away in (0.0, 3000.0):
        board = Object("board", shape("plane"), "floor", (away, away, -away), tilt, scale)
        normal = board.world_from_object[:, 1]
        lamp = Object("lamp", shape("plane"), "lamp", matrix=square_that_faces(board, 0.5))
        sides = []
        for side in (0.4, -0.4):
            eye = board.position + side * normal + 0.1 * board.world_from_object[:, 0]
            camera = Camera(tuple(eye), board.position, tuple(board.world_from_object[:, 2]), fov_y=30)
            scene = Scene(camera, Environment((0, 0, 0)), {"floor": FLOOR, "lamp": LAMP}, (board, lamp))
            sides.append(seen(scene, in_blocks, max_bounces=2))
        assert sides[1] == 0
        means.append(sides[0])
    assert means[1] == pytest.approx(means[0], rel=0.01)


def square_that_faces(board: Object, height: float) -> npt.NDArray[np.float64]:
    """(3, 4) of a unit square above a board."""
    x, y, z = board.world_from_object[:, :3].T / [[3.0], [1.0], [3.0]]
    return np.column_stack([x, -y, z, np.asarray(board.position) + height * y])
