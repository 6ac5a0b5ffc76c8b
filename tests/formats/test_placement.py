"""Geometry under matrices: by vertex and by corner, with sides and normals as they look."""

from __future__ import annotations

import numpy as np
import pytest

from incpt.formats.clean import usable_mesh
from incpt.formats.placement import placed_arrays, placed_mesh
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.mesh import Mesh, MeshSource

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
NORMALS = np.array([[-1.0, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TANGENTS = np.array([[1.0, -1, 0, 1]] * 4)
SHEARED = np.array([[1.0, 0.5, 0, 2], [0, 2, 0.25, 0], [0, 0, 0.5, -1], [0, 0, 0, 1]])


def outward(mesh: Mesh) -> np.ndarray:
    """(F,) how far each face looks away from the middle of the mesh."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.einsum("fi,fi->f", facing, corners.mean(axis=1) - corners.mean(axis=(0, 1)))


@pytest.mark.parametrize("mirror", [1, -1])
def test_outsides_stay_outsides_and_both_ways_agree(mirror: int) -> None:
    matrix = SHEARED @ np.diag([mirror, 1, 1, 1])
    attributes = VertexAttributes((VERTICES[:, :2],), None, TANGENTS)
    plain = usable_mesh(VERTICES, FACES, NORMALS, {}, attributes)
    assert plain is not None and (outward(plain) > 0).all()
    by_corner = placed_mesh(plain, matrix[:3], MeshSource())
    arrays = placed_arrays(VERTICES, FACES, NORMALS, matrix)
    by_vertex = usable_mesh(*arrays, {}, attributes.placed(matrix[:3, :3]))
    assert by_vertex is not None
    for placed in (by_corner, by_vertex):
        assert (outward(placed) > 0).all()
        normals = placed.normals
        assert normals is not None
        np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-6)
    np.testing.assert_array_equal(by_corner.faces, by_vertex.faces)
    np.testing.assert_allclose(by_corner.vertices, by_vertex.vertices, atol=1e-6)
    for name in ("normals", "tangents"):
        np.testing.assert_allclose(getattr(by_corner, name), getattr(by_vertex, name), atol=1e-6)
    np.testing.assert_array_equal(by_corner.uvs[0], by_vertex.uvs[0])
    # Normals stay at right angles to what they were at right angles to.
    assert by_corner.normals is not None
    flat = np.cross([0.0, 1, 0], [0, 0, 1]) @ np.linalg.inv(matrix[:3, :3])
    along_x = by_corner.normals[by_corner.faces == 1]
    np.testing.assert_allclose(
        along_x, np.broadcast_to(flat / np.linalg.norm(flat), along_x.shape), atol=1e-6
    )
