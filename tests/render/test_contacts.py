"""Transparent bodies in contact: the picture is that of bodies which reach into each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.kernels import device
from support.pairs import check, traced_pairs
from support.renders import pixels
from support.small_scenes import small_settings

from incpt.core.affine import Vector
from incpt.render.session import Session
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

pytestmark = pytest.mark.slow
SCHEDULES = pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
GLASS = Material((1, 1, 1), transmission=1, roughness=0, ior=1.5, absorption=(0.2, 0.6, 1), priority=2)
WATER = replace(GLASS, ior=1.33, absorption=(1.2, 0.6, 0.1), priority=1)
STRIPES = Material((0.8, 0.8, 0.8), specular=0, emission=(0.5, 0.5, 0.5), double_sided=True)


def hollow_cube(inner: float) -> Mesh:
    """A cube with edges of a metre around a cubic hole."""
    cube = shape("cube")
    vertices = np.concatenate([cube.vertices, cube.vertices * inner])
    return Mesh(vertices, np.concatenate([cube.faces, cube.faces[:, ::-1] + len(cube.vertices)]))


def scene_of(*bodies: Object, origin: Vector = (0, 0, 0), tilt: float = 0.0, **materials: Material) -> Scene:
    """Bodies before a wall that shines, seen from the side; moved and turned as a whole."""
    wall = Object("wall", shape("plane"), "stripes", (0.4, 0, -1.5), (90, 0, 0), (1.5, 1, 4))
    turn = Object("turn", shape("cube"), "stripes", origin, (0, tilt, 0)).world_from_object
    matrix = np.vstack([turn, [0, 0, 0, 1]])
    objects = tuple(
        replace(obj, matrix=matrix[:3] @ np.vstack([obj.world_from_object, [0, 0, 0, 1]]))
        for obj in (wall, *bodies)
    )
    eye, target = (matrix[:3] @ np.array([*point, 1.0]) for point in ((2.5, 1.5, 3), (0, 0, 0)))
    materials = {"stripes": STRIPES, "glass": GLASS, "water": WATER, **materials}
    settings = small_settings(size=(24, 24), max_bounces=3, transmission_bounces=24)
    camera = Camera(tuple(eye), tuple(target), fov_y=30)
    return Scene(camera, Environment((0.3, 0.4, 0.5)), materials, objects, settings)


def assert_alike(touching: Scene, reaching: Scene, in_blocks: bool) -> None:
    """Most paths take the same turns."""
    one, other = (pixels(scene, 64, in_blocks) for scene in (touching, reaching))
    different = np.abs(one - other).max(axis=2) > 0.05 * other.max(axis=2)
    assert different.mean() < 0.04
    np.testing.assert_allclose(one.mean(axis=(0, 1)), other.mean(axis=(0, 1)), rtol=0.01)


@SCHEDULES
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize(
    ("priorities", "origin", "tilt"),
    [((2, 1), (0, 0, 0), 0), ((1, 2), (0, 0, 0), 33), ((1, 1), (0, 0, 0), 0), ((2, 1), (50, -90, 70), 33)],
    ids=str,
)
def test_bodies_side_by_side(
    priorities: tuple[int, int], origin: Vector, tilt: float, is_first: bool, in_blocks: bool
) -> None:
    """A block of glass and a smaller one of water, which in the other scene reaches a millimetre into it."""
    materials = {
        "glass": replace(GLASS, priority=priorities[0]),
        "water": replace(WATER, priority=priorities[1]),
    }
    glass = Object("glass", shape("cube"), "glass", (-0.5, 0, 0))
    water = Object("water", shape("cube"), "water", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9))
    deep = replace(water, position=(0.3995, 0.05, 0), scale=(0.801, 0.7, 0.9))
    touching, reaching = (
        scene_of(*((glass, one) if is_first else (one, glass)), origin=origin, tilt=tilt, **materials)
        for one in (water, deep)
    )
    assert_alike(touching, reaching, in_blocks)


@SCHEDULES
def test_water_that_fills_a_glass(in_blocks: bool) -> None:
    glass = Object("glass", hollow_cube(0.8), "glass")
    full, more = (Object("water", shape("cube"), "water", scale=(edge,) * 3) for edge in (0.8, 0.801))
    assert_alike(scene_of(full, glass), scene_of(more, glass), in_blocks)


@SCHEDULES
def test_a_body_that_is_there_three_times(in_blocks: bool) -> None:
    """It is seen once, as what has the highest priority."""
    glass, water, third = (Object(name, shape("cube"), name) for name in ("glass", "water", "third"))
    bodies = scene_of(third, water, glass, third=replace(WATER, ior=1.8, priority=1))
    assert_alike(bodies, scene_of(glass), in_blocks)


@SCHEDULES
def test_paths_know_of_bodies_that_come_into_contact(in_blocks: bool) -> None:
    """Where one moves up to another, the other may be the one that grows."""
    glass = Object("glass", shape("cube"), "glass", (-0.5, 0, 0))
    water = Object("water", shape("cube"), "water", (0.4, 0.05, 0), scale=(0.8, 0.7, 0.9))
    touching = scene_of(glass, water)
    for old, new in (
        (touching.with_object("glass", position=(-0.7, 0, 0)), touching),
        (touching, touching.with_material("glass", transmission=0.0)),
        (touching.with_material("water", transmission=0.0), touching),
    ):
        check(traced_pairs(device(), old, new, in_blocks))


def test_an_edit_of_a_material_may_bring_bodies_into_contact() -> None:
    """Objects are then where a fresh start has them, and back again."""
    glass = Object("glass", shape("cube"), "glass", (-0.5, 0, 0))
    touching = scene_of(glass, Object("water", shape("cube"), "water", (0.4, 0, 0), scale=(0.8, 0.8, 0.8)))
    opaque = touching.with_material("water", transmission=0.0)
    session = Session(opaque, device=device())
    for scene in (touching, opaque):
        session.edit(scene)
        fresh = Session(replace(scene), device=device())  # an equal scene, which shares no tables
        bounds = [one._tables.objects.table.bounds for one in (session, fresh)]
        np.testing.assert_array_equal(*bounds)
