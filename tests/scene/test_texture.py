"""Bitmaps and textures as values, and the tangents of meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from incpt.core.errors import InputError
from incpt.scene.mesh import Mesh
from incpt.scene.shapes import SHAPES, shape
from incpt.scene.tangents import corner_tangents, uv_gradients
from incpt.scene.texture import BITMAP_MAX_SIZE, Bitmap, Texture

GREY = Bitmap(np.full((2, 3, 3), 128, np.uint8))


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.zeros((2, 2, 3), np.int32), "is not an array of uint8"),
        (np.zeros((2, 2, 5), np.uint8), "have shape"),
        (np.zeros((0, 2, 3), np.uint8), "have shape"),
        (np.zeros(3, np.uint8), "have shape"),
        (np.full((1, 1, 3), np.nan, np.float32), "not finite"),
        (np.zeros((1, BITMAP_MAX_SIZE + 1, 1), np.uint8), "scale the image down"),
        ("wood.png", "is not an array"),
        ([[1], [2, 3]], "is not an array"),
    ],
)
def test_bad_pixels_are_told_in_a_line(pixels: Any, words: str) -> None:
    with pytest.raises(InputError, match=rf"^pixels: [^\n]*{words}"):
        Bitmap(pixels)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bitmap", "wood.png"), ("uv_set", 2), ("uv_set", -1), ("wrap", "tile"), ("wrap", ("repeat",)),
        ("wrap", ("repeat", 3)), ("filter", "cubic"), ("offset", (1,)), ("offset", (np.nan, 0)),
        ("scale", (1, 2, 3)), ("scale", (1e30, 1)), ("rotation", "much"), ("rotation", np.inf),
    ],
)  # fmt: skip
def test_bad_textures_are_told_in_a_line(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: "):
        Texture(**{"bitmap": GREY, name: value})


def test_grey_pixels_have_one_channel_and_doubles_become_floats() -> None:
    bitmap = Bitmap(np.ones((4, 5)))
    assert bitmap.channels == 1 and bitmap.pixels.dtype == np.float32
    assert (bitmap.width, bitmap.height, bitmap.has_alpha) == (5, 4, False)


def test_textures_are_equal_where_they_read_one_bitmap_alike() -> None:
    assert Texture(GREY, wrap="mirror") == Texture(GREY, wrap=("mirror", "mirror"))
    assert Texture(GREY) != Texture(Bitmap(GREY.pixels))
    assert len({Texture(GREY), Texture(GREY), Texture(GREY, uv_set=1)}) == 2


def test_meshes_check_what_they_have_at_corners() -> None:
    cube = shape("cube")
    faces = len(cube.faces)
    for name, value, words in (
        ("uvs", (np.zeros((faces, 3, 3)),), "need shape"),
        ("uvs", (np.full((faces, 3, 2), np.nan),), "need shape"),
        ("uvs", (np.zeros((faces, 3, 2)),) * 3, "at most 2"),
        ("uvs", 3, "at most 2"),
        ("colors", np.full((faces, 3, 4), 1.5), "out of range"),
        ("tangents", np.zeros((faces, 3, 3)), "need shape"),
    ):
        with pytest.raises(InputError, match=f"^{name}: .*{words}"):
            replace(cube, **{name: value})


def signed_areas(uv: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(F,) of triangles in the image."""
    (a, b), (c, d) = ((uv[:, i] - uv[:, 0]).T for i in (1, 2))
    return np.asarray((a * d - b * c) / 2)


@pytest.mark.parametrize("name", SHAPES)
def test_images_lie_on_shapes_upright_and_not_mirrored(name: str) -> None:
    """Along u and downwards along v on the outside, in every face."""
    mesh = shape(name)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    uv = mesh.uvs[0].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (signed_areas(uv) < 0).all()  # v goes downwards
    assert uv.min() >= -0.6 and uv.max() <= 1.01
    upright = np.abs(normal[:, 1]) < 0.7 * np.linalg.norm(normal, axis=1)
    up = corners[..., 1] - corners[..., 1].mean(axis=1, keepdims=True)
    down = uv[..., 1] - uv[..., 1].mean(axis=1, keepdims=True)
    assert ((up * down).sum(axis=1)[upright] < 0).all()


def test_the_image_covers_a_sphere_once() -> None:
    uv = shape("sphere").uvs[0].astype(np.float64)
    # Faces at the poles leave out half of their cells of the map.
    assert -signed_areas(uv).sum() == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("name", SHAPES)
def test_tangents_point_along_u(name: str) -> None:
    mesh = shape(name)
    tangents = corner_tangents(mesh).astype(np.float64)
    corners, uv = mesh.vertices[mesh.faces].astype(np.float64), mesh.uvs[0].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.repeat((normals / np.linalg.norm(normals, axis=1, keepdims=True))[:, None], 3, axis=1)
    normals = normals if mesh.normals is None else mesh.normals
    np.testing.assert_allclose(np.linalg.norm(tangents[..., :3], axis=2), 1, atol=1e-5)
    np.testing.assert_allclose((tangents[..., :3] * normals).sum(axis=2), 0, atol=1e-5)
    assert (tangents[..., 3] == 1).all()
    # A step along the tangent and one along normal x tangent, as the texture coordinates of the face see
    # them.
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    changes = np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1)
    inverse = np.linalg.pinv(edges)  # (F, 3, 2): weights of the edges
    for direction, sign in ((tangents[..., :3], (1, 0)), (np.cross(normals, tangents[..., :3]), (0, -1))):
        step = np.einsum("fcx,fxe,fed->fcd", direction, inverse, changes)
        step /= np.linalg.norm(step, axis=2, keepdims=True)
        inside = np.abs(corners[..., 1]) < 0.45  # not at the poles, where there is no direction of u
        chosen = step[inside] if name == "sphere" else step.reshape(-1, 2)
        assert (chosen @ np.array(sign) > 0.9).all()


def test_a_mirrored_image_has_tangents_on_the_other_side() -> None:
    plane = shape("plane")
    mirrored = replace(plane, uvs=(plane.uvs[0] * [-1, 1],))
    np.testing.assert_allclose(corner_tangents(mirrored)[..., 0], -1, atol=1e-6)
    assert (corner_tangents(mirrored)[..., 3] == -1).all()


def test_corners_share_a_tangent_where_the_surface_is_smooth() -> None:
    """Of two faces that meet at an angle, with common normals there."""
    vertices = np.float32([[-1, 0, 0], [0, 0.5, 1], [0, 0.5, -1], [1, 0, 0]])
    faces = np.array([[0, 1, 2], [3, 2, 1]])
    normals = np.float32([[-0.4, 1, 0], [0, 1, 0], [0, 1, 0]])
    corner_normals = np.stack([normals, normals * [-1, 1, 1]])
    corner_normals /= np.linalg.norm(corner_normals, axis=2, keepdims=True)
    uv = np.float32([[-1, 0], [0, -1], [0, 1], [1, 0]])[faces]
    mesh = Mesh(vertices, faces, corner_normals, uvs=(uv,))
    tangents = corner_tangents(mesh)
    np.testing.assert_allclose(tangents[0, 1], tangents[1, 2], atol=1e-6)
    np.testing.assert_allclose(tangents[0, 1], [1, 0, 0, tangents[0, 1, 3]], atol=1e-6)
    # Without common normals each face has its own.
    apart = corner_tangents(replace(mesh, normals=None))
    np.testing.assert_allclose(np.abs(apart[..., 1]), 0.5 / np.hypot(1, 0.5), atol=1e-5)


def test_tangents_without_texture_coordinates_go_along_parallels() -> None:
    """On a ball, but for its poles, all faces at a corner have one tangent, which is along u."""
    ball = shape("sphere")
    bare, along_u = corner_tangents(replace(ball, uvs=())), corner_tangents(ball)
    shared = np.full((len(ball.vertices), 4), np.nan)
    shared[ball.faces] = bare
    height = np.abs(ball.vertices[ball.faces][..., 1])
    np.testing.assert_allclose(bare[height < 0.4999], shared[ball.faces][height < 0.4999], atol=1e-6)
    assert ((bare * along_u)[height < 0.45][:, :3].sum(axis=1) > 0.999).all()
    assert (bare[..., 3] == 1).all()


def test_tangents_at_a_pole_are_those_of_the_face() -> None:
    """A cone's tip, whose normal is the y axis: what is brushed around the y axis is so up to there."""
    angle = np.arange(8) * np.pi / 4
    rim = np.column_stack([np.sin(angle), np.zeros(8), np.cos(angle)])
    faces = np.array([(8, i, (i + 1) % 8) for i in range(8)])
    normals = np.concatenate([rim, [[1e-5, 0, 0]]])[faces] + np.array([0, 1, 0])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    cone = Mesh(np.concatenate([rim, [[0, 1, 0]]]), faces, normals)
    tangents = corner_tangents(cone)
    around = (rim[faces[:, 1]] + rim[faces[:, 2]])[:, [2, 1, 0]] * [1, 1, -1]
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    np.testing.assert_allclose(tangents[:, 0, :3], around, atol=1e-4)
    # Without smooth normals the faces of a box that face up have x, and those at its sides go around it.
    for box in (replace(shape("cube"), uvs=()), replace(shape("cube"), uvs=(np.zeros((12, 3, 2)),))):
        corners = box.vertices[box.faces].astype(np.float64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        expected = np.where(np.abs(normal[:, 1:2]) > 0.5, [1, 0, 0], np.cross([0, 1, 0], normal))
        np.testing.assert_allclose(corner_tangents(box)[:, 1, :3], expected, atol=1e-6)


def test_tangents_that_a_mesh_brings_are_taken() -> None:
    own = np.zeros((12, 3, 4), np.float32)
    own[..., 2] = own[..., 3] = 1
    np.testing.assert_array_equal(corner_tangents(replace(shape("cube"), tangents=own)), own)


@pytest.mark.parametrize("name", SHAPES)
def test_gradients_tell_how_texture_coordinates_grow_along_faces(name: str) -> None:
    mesh = shape(name)
    corners, uv = mesh.vertices[mesh.faces].astype(np.float64), mesh.uvs[0]
    gradients = uv_gradients(mesh).astype(np.float64)
    for edge in (1, 2):
        grown = np.einsum("fcd,fd->fc", gradients, corners[:, edge] - corners[:, 0])
        np.testing.assert_allclose(grown, uv[:, edge] - uv[:, 0], atol=1e-5)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(np.einsum("fcd,fd->fc", gradients, normals), 0, atol=1e-5)
    assert not uv_gradients(mesh, 1).any()


def test_gradients_of_slivers_are_numbers() -> None:
    faces = np.array([[0, 1, 2], [0, 0, 3], [0, 1, 3]])
    mesh = Mesh(
        np.float32([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1e-30, 0]]), faces, uvs=(np.ones((3, 3, 2)),)
    )
    sliver = replace(mesh, uvs=(np.arange(18).reshape(3, 3, 2) * 1.0,))
    assert np.isfinite(uv_gradients(sliver)).all() and not uv_gradients(mesh).any()
