"""Triangle meshes as values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import NoneType

import numpy as np
import numpy.typing as npt

from incpt.core.arrays import frozen, numbers
from incpt.core.checks import require, require_bool
from incpt.core.errors import InputError
from incpt.scene.checks import LARGEST, is_list
from incpt.scene.texture import UV_SETS


@dataclass(frozen=True)
class MeshSource:
    """Where a mesh came from, which is what a scene file stores: a built-in shape, or a file and, where that
    holds several, one of them: a `part`, by its name, as the file places it, or a `geometry`, in its own
    space, which the file may show at several places. All None: made in Python."""

    shape: str | None = None
    file: str | None = None
    part: str | None = None
    geometry: str | None = None

    def __post_init__(self) -> None:
        for name in ("shape", "file", "part", "geometry"):
            require(name, getattr(self, name), (str, NoneType), "a text")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space, and what they have at their corners.

    vertices  (V, 3) float32
    faces     (F, 3) int32, counter-clockwise from outside
    normals   (F, 3, 3) float32 unit shading normals, or None for flat faces
    uvs       up to two sets of texture coordinates, (F, 3, 2) float32 each; (0, 0) is the top left corner of
              an image, see Texture
    colors    (F, 3, 4) float32 linear red, green, blue and alpha from 0 to 1, which base colours are
              multiplied with, or None
    tangents  (F, 3, 4) float32 unit tangents, along which u grows, and the side on which v does (1: that of
              normal x tangent; -1), or None: they are computed where normal maps need them (`tangents.py`)
    is_placeholder  whether it stands for what `source` names, which could not be read

    Compared by identity: objects that share one Mesh share its BVH.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    normals: npt.NDArray[np.float32] | None = None
    source: MeshSource = MeshSource()
    uvs: tuple[npt.NDArray[np.float32], ...] = ()
    colors: npt.NDArray[np.float32] | None = None
    tangents: npt.NDArray[np.float32] | None = None
    is_placeholder: bool = False

    def __post_init__(self) -> None:
        vertices = frozen(numbers("vertices", self.vertices, np.float32))
        faces = frozen(numbers("faces", self.faces, np.int32))
        require("source", self.source, MeshSource, "a MeshSource")
        require_bool("is_placeholder", self.is_placeholder)
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
        self._set_at_corners("normals", 3)
        self._set_at_corners("colors", 4, low=0.0, high=1.0)
        self._set_at_corners("tangents", 4)
        if not is_list(self.uvs) or len(self.uvs) > UV_SETS:
            raise InputError(f"uvs: are not a list of at most {UV_SETS} arrays, (F, 3, 2) each")
        sets = tuple(self._at_corners("uvs", values, 2, -LARGEST, LARGEST) for values in self.uvs)
        object.__setattr__(self, "uvs", sets)

    def _set_at_corners(self, name: str, count: int, low: float = -np.inf, high: float = np.inf) -> None:
        values = getattr(self, name)
        if values is not None:
            object.__setattr__(self, name, self._at_corners(name, values, count, low, high))

    def _at_corners(
        self, name: str, values: npt.ArrayLike, count: int, low: float, high: float
    ) -> npt.NDArray[np.float32]:
        """So many numbers for each corner of each face. Raises InputError."""
        array: npt.NDArray[np.float32] = frozen(numbers(name, values, np.float32))
        shape = (len(self.faces), 3, count)
        if array.shape != shape or not np.isfinite(array).all():
            raise InputError(f"{name}: need shape {shape} and finite numbers")
        if array.min() < low or array.max() > high:
            raise InputError(f"{name}: hold a number out of range; use {low:g} to {high:g}")
        return array

    @cached_property
    def bounds(self) -> npt.NDArray[np.float32]:
        """(2, 3) least and greatest coordinates of the vertices that faces use, object space."""
        is_used = np.zeros(len(self.vertices), bool)
        is_used[self.faces] = True
        used = self.vertices[is_used]
        return np.stack([used.min(axis=0), used.max(axis=0)])


def is_deformation(old: Mesh, new: Mesh) -> bool:
    """Whether `new` has the faces of `old` with other vertices, so that its BVH can be refitted."""
    same_faces = old.faces is new.faces or np.array_equal(old.faces, new.faces)
    return same_faces and (old.normals is None) == (new.normals is None)
