"""A camera inside of transparent bodies sees through them from the start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.kernels import device
from support.pairs import check, session_of, traced_pairs
from support.renders import render

from incpt.core.settings import RenderSettings
from incpt.scene.camera import Camera
from incpt.scene.enclosing import transparent_bodies_around, winding_number
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

CLEAR = Material((1, 1, 1), roughness=0, transmission=1, ior=1.0, specular=0, priority=1)
DARK = replace(CLEAR, absorption=(2, 1, 0), priority=2)
DARKER = replace(CLEAR, absorption=(4, 4, 4), priority=1)


def nested(*bodies: tuple[str, float]) -> Scene:
    """Cubes of these materials and sizes around a camera, and nothing else."""
    objects = [
        Object(f"{name} {size}", shape("cube"), name, scale=(size,) * 3, rotation=(0, 0, 0))
        for name, size in bodies
    ]
    materials = {"clear": CLEAR, "dark": DARK, "darker": DARKER, "matte": Material((0.5, 0.5, 0.5))}
    camera = Camera((0, 0, 0), (0, 0, -1), fov_y=1)
    return Scene(camera, Environment((1, 1, 1)), materials, tuple(objects))


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
@pytest.mark.parametrize(
    ("bodies", "depth"),
    [
        ((("dark", 2.0),), (2.0, 1.0, 0.0)),
        ((("clear", 2.0),), (0.0, 0.0, 0.0)),
        ((("clear", 1.0), ("dark", 2.0)), (2.0, 1.0, 0.0)),  # the higher priority wins
        ((("darker", 3.0), ("dark", 1.0)), (5.0, 4.5, 4.0)),  # half a metre of the one, one of the other
        ((("dark", 1.0), ("darker", 3.0)), (5.0, 4.5, 4.0)),
    ],
)
def test_light_is_absorbed_on_the_way_to_the_camera(
    bodies: tuple[tuple[str, float], ...], depth: tuple[float, float, float], in_blocks: bool
) -> None:
    scene = replace(nested(*bodies), settings=RenderSettings(size=(8, 8), strategy="restart"))
    session = session_of(device(), scene, in_blocks)
    session.render(1)
    expected = np.broadcast_to(np.exp(-np.array(depth)), (8, 8, 3))
    np.testing.assert_allclose(session.image(), expected, rtol=1e-3)


def test_winding_numbers() -> None:
    for name in ("cube", "sphere", "cylinder"):
        mesh = shape(name)
        assert winding_number(mesh, np.array([0.1, 0.05, -0.1])) == pytest.approx(1, abs=1e-6)
        assert winding_number(mesh, np.array([0.1, 0.8, -0.1])) == pytest.approx(0, abs=1e-6)
    mirrored = nested(("dark", 2.0)).with_object("dark 2.0", scale=(-2, 2, 2))
    assert len(transparent_bodies_around(mirrored, (0, 0, 0))) == 1
    assert not transparent_bodies_around(mirrored, (0, 0, 1.1))
    hidden = nested(("dark", 2.0)).with_object("dark 2.0", visible=False)
    assert not transparent_bodies_around(hidden, (0, 0, 0))


def test_hidden_from_outside_nothing_changes() -> None:
    scene = nested(("dark", 2.0)).with_camera(position=(0, 0, 3))
    image = render(scene, 4, (8, 8))
    np.testing.assert_allclose(image, np.broadcast_to(np.exp([-4.0, -2.0, 0.0]), image.shape), rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("in_blocks", [True, False], ids=["blocks", "wavefront"])
def test_paths_notice_that_the_medium_around_the_camera_changes(in_blocks: bool) -> None:
    ball = Object("ball", shape("sphere"), "matte", (0, 0, -0.5), scale=(0.3, 0.3, 0.3))
    settings = RenderSettings(size=(16, 16), tile_size=8)
    scene = replace(nested(("dark", 2.0)).with_added(ball), settings=settings)
    after = scene.with_material("dark", absorption=(1, 1, 1))
    check(traced_pairs(device(), scene, after, in_blocks, 4))
