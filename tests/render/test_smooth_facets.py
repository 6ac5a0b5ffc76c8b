"""Bodies of few facets with smooth normals: where the two disagree nothing turns black."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from support.renders import render

from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene


def ball(subdivisions: int) -> Mesh:
    """A sphere of radius 1 with 20 * 4^subdivisions triangles and its own normals."""
    made = trimesh.creation.icosphere(subdivisions)
    vertices, faces = np.asarray(made.vertices, np.float32), np.asarray(made.faces)
    return Mesh(vertices, faces, vertices[faces])


def in_white(material: Material, subdivisions: int) -> Scene:
    objects = (Object("ball", ball(subdivisions), "m"),)
    return Scene(Camera((0, 0, 4), (0, 0, 0), fov_y=34), Environment((1, 1, 1)), {"m": material}, objects)


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [1, 2])
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_no_facet_of_smooth_metal_is_black(subdivisions: int, roughness: float) -> None:
    material = Material((1, 1, 1), metallic=1, roughness=roughness)
    image = render(in_white(material, subdivisions), 64, (64, 64), max_bounces=8)
    assert image.min() > 0.6
    if roughness == 0:
        assert image.mean() > 0.999


def test_smooth_glass_keeps_its_light_at_the_silhouette() -> None:
    glass = Material((1, 1, 1), transmission=1, roughness=0)
    image = render(in_white(glass, 2), 64, (64, 64), max_bounces=200, transmission_bounces=200)
    assert image.mean() > 0.998
