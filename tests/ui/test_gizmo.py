"""Where the gizmo's handles stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cameras import cameras

from incpt.core.affine import Vector
from incpt.scene import edits
from incpt.scene.camera import Camera
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape
from incpt.ui.display.projection import clip_from_world
from incpt.ui.editor.state import Tool
from incpt.ui.rect import Rect
from incpt.ui.viewport import gizmo

SHEARED = np.array([[1.0, 0.5, 0.0, 3.0], [0.0, 2.0, 0.25, -1.0], [0.1, 0.0, 1.5, 2.0]])
SCENE = Scene(
    materials={"red": Material()},
    objects=(
        Object("cube", shape("cube"), "red", (1, 2, 3), (10, 20, 30), (1, 2, -3)),
        Object("odd", shape("cube"), "red", matrix=SHEARED),
    ),
)


def test_handles_stand_at_the_matrix_of_an_object() -> None:
    np.testing.assert_array_equal(
        gizmo.handles(SCENE, ("cube",), Tool(space="local"))[:3], SCENE.objects[0].world_from_object
    )


@pytest.mark.parametrize(
    ("pivot", "place"), [("median", (0.5, 2.0, 4.0)), ("active", (1, 2, 3)), ("individual", (0.5, 2.0, 4.0))]
)
def test_handles_of_several_stand_at_the_pivot(pivot: str, place: Vector) -> None:
    scene = edits.add_shape(SCENE, "cube", (0.0, 1.5, 5.0))[0]
    matrix = gizmo.handles(scene, ("cube.001", "cube"), Tool(pivot=pivot))
    assert tuple(matrix[:3, 3]) == place


def test_handles_of_a_sheared_object_are_at_right_angles_and_keep_its_shear() -> None:
    """ImGuizmo makes the axes of its matrix orthogonal: it must be given none that are not."""
    start = gizmo.handles(SCENE, ("odd",), Tool(space="local"))
    products = start[:3, :3].T @ start[:3, :3]
    np.testing.assert_allclose(products, np.diag(np.diag(products)), atol=1e-12)
    assert tuple(start[:3, 3]) == SCENE.object("odd").position
    # What a scaling by the handle of x returns.
    delta = start @ np.diag([2.0, 1.0, 1.0, 1.0]) @ np.linalg.inv(start)
    scaled = edits.transform_objects(SCENE, ("odd",), delta).object("odd")
    assert scaled.scale == pytest.approx(np.multiply(SCENE.object("odd").scale, (2, 1, 1)), rel=0.2)
    np.testing.assert_allclose(
        scaled.world_from_object, delta[:3, :3] @ SHEARED + [[0, 0, 0, x] for x in delta[:3, 3]]
    )


@given(cameras(), st.floats(0.3, 4), st.floats(0.1, 50), st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_handles_and_outlines_are_where_the_camera_sees_them(
    camera: Camera, aspect: float, distance: float, place: tuple[float, float]
) -> None:
    starts, directions = camera.rays(np.array([place]), aspect)
    point = np.append(starts + distance * directions, 1.0)
    rect = Rect(0, 0, 256, 256)
    for matrix in (
        gizmo.projection_matrix(camera, aspect) @ gizmo.view_matrix(camera),
        clip_from_world(camera, aspect, Rect(0.0, 0.0, 256.0, 256.0), rect),
    ):
        clip = matrix @ point
        assert clip[3] > 0 and abs(clip[2]) <= clip[3]
        assert (clip[0] / clip[3] + 1) / 2 == pytest.approx(place[0], abs=1e-6)
        assert (1 - clip[1] / clip[3]) / 2 == pytest.approx(place[1], abs=1e-6)
        behind = matrix @ np.append(starts - distance * directions, 1.0)
        assert behind[3] <= 0 or behind[2] < -behind[3]
