"""Objects placed by a matrix look like the same objects with the matrix applied to their vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from support.kernels import device
from support.renders import render
from support.small_scenes import mixed_scene

from incpt.core import affine
from incpt.core.settings import RenderSettings
from incpt.render.session import Session
from incpt.scene.mesh import Mesh
from incpt.scene.model import Object, Scene

SIZE = (44, 28)
SHEAR = np.array([[1.0, 0.6, -0.2], [0.0, 1.0, 0.0], [0.3, 0.4, 1.0]])
MIRRORS = {"upright": np.ones(3), "mirrored": np.array([-1.0, 1.0, 1.0])}


def sheared(mirror: npt.NDArray[np.float64]) -> Scene:
    """The mixed scene with a matrix for every object but the floor: a cube and a lamp, which lie in the top
    level, a glass ball and a drum with normals, which have trees of their own."""
    scene = mixed_scene()
    objects = []
    for obj in scene.objects:
        matrix = obj.world_from_object.copy()
        matrix[:, :3] = matrix[:, :3] @ (SHEAR * mirror)
        # The lamp must go on shining downwards.
        is_moved = obj.name != "floor" and (obj.name != "lamp" or mirror.prod() > 0)
        objects.append(replace(obj, matrix=matrix) if is_moved else obj)
    return replace(scene, objects=tuple(objects))


def baked(obj: Object) -> Object:
    """The object at the origin, with a mesh of its own in world space; normals go by the inverse transpose,
    and faces that a mirror turned over are turned back."""
    mesh, linear = obj.mesh, obj.world_from_object[:, :3]
    faces, normals = mesh.faces, mesh.normals
    if normals is not None:
        turned = normals @ np.linalg.inv(linear)
        normals = (turned / np.linalg.norm(turned, axis=2, keepdims=True)).astype(np.float32)
    if np.linalg.det(linear) < 0:
        faces = faces[:, ::-1]
        normals = None if normals is None else normals[:, ::-1]
    vertices = affine.apply(obj.world_from_object, mesh.vertices).astype(np.float32)
    return Object(obj.name, Mesh(vertices, faces, normals), obj.material)


@pytest.mark.parametrize("mirror", MIRRORS.values(), ids=MIRRORS)
def test_a_sheared_object_is_the_object_with_sheared_vertices(mirror: npt.NDArray[np.float64]) -> None:
    scene = sheared(mirror)
    plain = replace(scene, objects=tuple(baked(obj) for obj in scene.objects))
    found, expected = (render(one, 64, SIZE, max_bounces=2) for one in (scene, plain))
    # A path that grazes an edge, or an interface of the ball, may go another way for the last bit.
    same = np.isclose(found, expected, rtol=1e-3, atol=1e-4).all(axis=2)
    assert same.mean() > 0.98
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=1e-3)


@pytest.mark.parametrize("mirror", MIRRORS.values(), ids=MIRRORS)
def test_first_hits_and_normals_under_shear(mirror: npt.NDArray[np.float64]) -> None:
    scene = sheared(mirror)
    plain = replace(scene, objects=tuple(baked(obj) for obj in scene.objects))
    found, expected = (Session(one, SIZE, RenderSettings(), device()).first_hits() for one in (scene, plain))
    same = found.object_id == expected.object_id
    assert same.mean() > 0.99 and set(np.unique(found.object_id)) >= set(range(len(scene.objects) - 1))
    np.testing.assert_allclose(found.depth[same], expected.depth[same], rtol=1e-4)
    np.testing.assert_allclose(found.normal[same], expected.normal[same], atol=2e-3)


def test_a_sheared_object_is_picked_where_it_is_seen() -> None:
    """The top of the cube leans to the right; its bottom stays."""
    scene = mixed_scene()
    cube = scene.object("red cube")
    leaning = cube.world_from_object.copy()
    leaning[0, :3] += 0.8 * leaning[1, :3]
    leaning[:, 3] += [0.8 * cube.position[1] / 2, 0, 0]
    session = Session(scene, SIZE, RenderSettings(), device())
    before = session.first_hits().object_id == 1
    session.edit(scene.with_object("red cube", matrix=leaning))
    after = session.first_hits().object_id == 1
    rows = np.flatnonzero(before.any(axis=1) & after.any(axis=1))
    middle = [np.flatnonzero(image[rows[1]]).mean() for image in (before, after)]
    assert middle[1] > middle[0] + 2
    y, x = rows[1], int(np.flatnonzero(after[rows[1]]).max())
    assert not before[y, x] and session.pick((x, int(y))) == "red cube"
