"""Meshes of few faces with smooth normals: light ends on them as on the surfaces that they stand for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.renders import pixels
from support.small_scenes import small_settings

from incpt.render.blocks import traces_in_blocks
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

pytestmark = pytest.mark.slow
Array = npt.NDArray[np.floating]
SCHEDULES = pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
PAINT = Material((0.8, 0.8, 0.8), specular=0)
SUN = Light("sun", "sun", rotation=(-10, 110, 0), irradiance=np.pi, angle=0.0)
"""So low that half of what is seen of a ball is dark."""


@cache
def ball(faces: int) -> Mesh:
    """Radius 0.05, with a ball's normals: an octahedron, each face divided into four as often as it takes."""
    octants = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    order = np.where(octants.prod(axis=1)[:, None] > 0, [0, 1, 2], [0, 2, 1])
    corners = np.eye(3)[order] * octants[:, None]
    while len(corners) < faces:
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = (
            middle / np.linalg.norm(middle, axis=1, keepdims=True) for middle in (a + b, b + c, c + a)
        )
        corners = np.concatenate(
            [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    vertices, numbers = np.unique(corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
    return Mesh(vertices / 20, numbers.reshape(-1, 3), corners)


def lit(faces: int | None, in_blocks: bool, size: float = 1.0, **placement: Any) -> Array:
    """(32, 32) of a ball of so many faces, or of very many, in the sun: at the origin, of diameter `size`,
    or as it is placed."""
    mesh, unit = (shape("sphere"), 1) if faces is None else (ball(faces), 10)
    scale = np.broadcast_to(placement.pop("scale", size), 3)
    thing = Object("thing", mesh, "paint", scale=tuple(unit * scale), **placement)
    at = np.asarray(thing.position)
    camera = Camera(tuple(at + size * np.array([0.5, 0.4, 3])), tuple(at), fov_y=17)
    settings = small_settings(size=(32, 32), max_bounces=0)
    scene = Scene(camera, Environment((0, 0, 0)), {"paint": PAINT}, (thing,), settings, (SUN,))
    return pixels(scene, 64, in_blocks)[..., 0]


def assert_as_round(coarse: Array, fine: Array, faces: int) -> None:
    """But for its outline, a ball of few faces is shaded as one of many."""
    coarse, fine = coarse[8:24, 8:24], fine[8:24, 8:24]
    assert fine.min() == 0 and fine.max() > 0.1
    assert np.abs(coarse - fine).max() < 4 / faces


@SCHEDULES
@pytest.mark.parametrize("faces", [128, 2048], ids=["top level", "tree of its own"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (-1.1, 1.2, 0.7)], ids=["round", "mirrored and stretched"])
def test_light_ends_on_few_faces_as_on_many(faces: int, scale: tuple[float, ...], in_blocks: bool) -> None:
    placement = {"scale": scale, "rotation": (10, 20, 30)}
    coarse, fine = (lit(count, in_blocks, **placement) for count in (faces, None))
    assert_as_round(coarse, fine, faces)


@SCHEDULES
@pytest.mark.parametrize("size", [1e-6, 1e3])
def test_balls_of_every_size_and_far_away(size: float, in_blocks: bool) -> None:
    fine = lit(None, in_blocks)
    assert_as_round(lit(128, in_blocks, size), fine, 128)
    if size > 1:
        assert_as_round(lit(128, in_blocks, 1.0, position=(1e4, -1e4, 1e4)), fine, 128)


@SCHEDULES
@pytest.mark.parametrize("world", ["constant", "image", "box"])
def test_a_white_ball_of_few_faces_is_not_seen_in_a_white_world(world: str, in_blocks: bool) -> None:
    """What its smooth normals send below its faces is not lost, and both techniques agree on it."""
    if in_blocks and not traces_in_blocks(device()):
        pytest.skip("no blocks on this device")
    materials = {"white": Material((1, 1, 1), specular=0)}
    objects = [Object("ball", ball(128), "white", scale=(10, 10, 10))]
    if world == "box":  # of lamps
        materials["lamp"] = Material((0, 0, 0), specular=0, emission=(1, 1, 1), double_sided=True)
        objects.append(Object("box", shape("cube"), "lamp", scale=(1.3, 1.3, 1.3)))
    environment = Environment(
        (0, 0, 0) if world == "box" else (1, 1, 1), Image(np.ones((4, 8, 3))) if world == "image" else None
    )
    camera = Camera((0.3, 0.2, 0.499), (0.2, 0.1, 0), fov_y=60)
    settings = small_settings(size=(32, 32), max_bounces=40)
    image = pixels(Scene(camera, environment, materials, tuple(objects), settings), 256, in_blocks)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 1, atol=0.0018)


@SCHEDULES
def test_no_light_comes_through_walls_that_a_ball_touches(in_blocks: bool) -> None:
    """A ball of few faces in a box that its corners reach, and a camera in a ball; the lamps are outside."""
    suns = tuple(replace(SUN, name=f"sun {i}", rotation=(25 * i, 70 * i, 0)) for i in range(5))
    settings = small_settings(size=(32, 32), max_bounces=2)
    box = Object("box", shape("cube"), "paint", scale=(1.0001, 1.0001, 1.0001))
    inside = Object("ball", ball(128), "paint", scale=(10, 10, 10))
    for camera, objects in (
        (Camera((0.46, 0.44, 0.45), (0, 0, 0), fov_y=90), (box, inside)),
        (Camera((0.1, 0.1, 0.4), (0, 0, 0), fov_y=90), (inside,)),
    ):
        scene = Scene(camera, Environment((0, 0, 0)), {"paint": PAINT}, objects, settings, suns)
        assert pixels(scene, 64, in_blocks).max() == 0
