"""Triangle meshes as values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import NoneType

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import frozen, numbers
from incpt.core.checks import require
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST


@dataclass(frozen=True)
class MeshSource:
    """Where a mesh came from, which is what a scene file stores: a built-in shape, or a file and a part
    of it (a named geometry, where the file holds several). Both None: made in Python."""

    shape: str | None = None
    file: str | None = None
    part: str | None = None

    def __post_init__(self) -> None:
        for name in ("shape", "file", "part"):
            require(name, getattr(self, name), (str, NoneType), "a text")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space: `vertices` (V, 3) float32, `faces` (F, 3) int32 counter-clockwise from
    outside, `normals` (F, 3, 3) float32 unit shading normals per corner, or None for flat faces.

    Compared by identity: objects that share one Mesh share its BVH.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    normals: npt.NDArray[np.float32] | None = None
    source: MeshSource = MeshSource()

    def __post_init__(self) -> None:
        vertices = frozen(numbers("vertices", self.vertices, np.float32))
        faces = frozen(numbers("faces", self.faces, np.int32))
        require("source", self.source, MeshSource, "a MeshSource")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise InputError(f"vertices: have shape {vertices.shape}; a mesh has shape (V, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise InputError(f"faces: have shape {faces.shape}; a mesh has one triangle or more, (F, 3)")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(f"faces: use a vertex outside 0 to {len(vertices) - 1}")
        if not np.isfinite(vertices).all() or np.abs(vertices).max() > LARGEST:
            raise InputError(f"vertices: hold a number that is not finite or beyond {LARGEST:g}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        if self.normals is not None:
            normals = frozen(numbers("normals", self.normals, np.float32))
            if normals.shape != (len(faces), 3, 3) or not np.isfinite(normals).all():
                raise InputError(f"normals: need shape ({len(faces)}, 3, 3) and finite numbers")
            object.__setattr__(self, "normals", normals)

    @cached_property
    def bounds(self) -> npt.NDArray[np.float32]:
        """(2, 3) least and greatest coordinates of the vertices that faces use, object space."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])


def is_deformation(old: Mesh, new: Mesh) -> bool:
    """Whether `new` has the faces of `old` with other vertices, so that its BVH can be refitted."""
    same_faces = old.faces is new.faces or np.array_equal(old.faces, new.faces)
    return same_faces and (old.normals is None) == (new.normals is None)
