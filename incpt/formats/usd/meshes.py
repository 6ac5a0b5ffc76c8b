"""Meshes as triangles: polygons of either handedness, with holes, and subsets with materials of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom, UsdShade

from incpt.core.errors import InputError
from incpt.formats import import_report
from incpt.formats.clean import usable_mesh
from incpt.formats.polygons import Triangles, triangles_of
from incpt.formats.smooth_normals import smooth_normals
from incpt.formats.usd.primvars import AtCorners, at_corners, joined, of_primvar
from incpt.formats.vertex_attributes import VertexAttributes
from incpt.scene.mesh import Mesh

Array = npt.NDArray[np.floating[Any]]
Indices = npt.NDArray[np.int64]
_FLIP, _BOTTOM = np.array([1, -1], np.float32), np.array([0, 1], np.float32)
"""What makes texture coordinates whose v goes down of those whose v goes up."""
_SMOOTH_SCHEMES = ("catmullClark", "loop")


@dataclass(frozen=True)
class Wanted:
    """What a material reads of a mesh: texture coordinates, a colour and an opacity, by the names of their
    primvars."""

    uvs: tuple[str, ...] = ()
    color: str | None = None
    opacity: str | None = None


def subsets_of(prim: Any) -> list[Any]:
    """The prims of the subsets of a mesh that have materials of their own."""
    return [subset.GetPrim() for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()]


def moves(prim: Any) -> bool:
    """Whether the shape of a mesh changes over time."""
    return bool(UsdGeom.Mesh(prim).GetPointsAttr().ValueMightBeTimeVarying())


class Polygons:
    """The triangles of a mesh prim at a moment. `is_cage` tells whether it is to be subdivided, which is not
    done. Raises InputError, where its arrays do not fit together."""

    def __init__(self, prim: Any, moment: Any, bent: Array | None = None) -> None:
        """`bent` (V, 3) are points in place of those of the file."""
        self._mesh, self._moment = UsdGeom.Mesh(prim), moment
        self._path = str(prim.GetPath())
        self._subsets = [self._faces_of(subset) for subset in subsets_of(prim)]
        self._is_bent = bent is not None
        self.points = _vectors("points", self._mesh.GetPointsAttr().Get(moment) if bent is None else bent)
        sizes = _indices(self._mesh.GetFaceVertexCountsAttr(), moment)
        corners = _indices(self._mesh.GetFaceVertexIndicesAttr(), moment)
        if (sizes < 0).any() or sizes.sum() != len(corners):
            raise InputError(f"has {len(corners)} corners for faces of {sizes.sum()}; the file is damaged")
        triangles = triangles_of(sizes, self.points, corners)
        holes = _indices(self._mesh.GetHoleIndicesAttr(), moment)
        self.triangles = _chosen(triangles, ~np.isin(triangles.polygons, holes)) if len(holes) else triangles
        self._scheme = str(self._mesh.GetSubdivisionSchemeAttr().Get(moment))
        if self._mesh.GetOrientationAttr().Get(moment) == "leftHanded":
            turned = self.triangles
            self.triangles = replace(turned, faces=turned.faces[:, ::-1], corners=turned.corners[:, ::-1])
        self.is_cage = self._scheme != "none" and bool(len(self.triangles.faces))

    def _faces_of(self, prim: Any) -> Indices:
        subset = UsdGeom.Subset(prim)
        if subset.GetElementTypeAttr().Get(self._moment) != "face":
            import_report.left_out(f"the subset {prim.GetPath()}: is not one of faces")
            return np.zeros(0, np.int64)
        return _indices(subset.GetIndicesAttr(), self._moment)

    def mesh(self, subset: int, wanted: Wanted, counts: dict[str, int]) -> Mesh | None:
        """The mesh of the faces of a subset, by its number; below 0 of those that are in none. None where no
        face is left. `counts` is that of `usable_mesh`."""
        triangles = self.triangles
        if subset >= 0:
            triangles = _chosen(triangles, np.isin(triangles.polygons, self._subsets[subset]))
        elif self._subsets:
            is_rest = ~np.isin(triangles.polygons, np.concatenate(self._subsets))
            triangles = _chosen(triangles, is_rest)
        if not len(triangles.faces):
            return None
        normals = None if self._is_bent else self._normals(triangles)
        if normals is None and (self._is_bent or self._scheme in _SMOOTH_SCHEMES):
            normals = self._smooth_normals(triangles)
        uvs, uv_at = joined([found for name in wanted.uvs if (found := self._uv(name, triangles))])
        colors = self._colors(wanted, triangles)
        used, places = _used(triangles.faces)
        return usable_mesh(
            self.points[used],
            places,
            None if normals is None else normals.values,
            counts,
            VertexAttributes(
                tuple(one * _FLIP + _BOTTOM for one in uvs),
                None if colors is None else colors.values,
            ),
            normal_at=None if normals is None else normals.at,
            uv_at=uv_at,
            color_at=None if colors is None else colors.at,
        )

    def _normals(self, triangles: Triangles) -> AtCorners | None:
        """Those of the file."""
        primvar = UsdGeom.PrimvarsAPI(self._mesh).GetPrimvar("normals")
        try:
            if primvar and primvar.HasAuthoredValue():
                return of_primvar(primvar, 3, self._moment, triangles)
            attribute = self._mesh.GetNormalsAttr()
            if attribute.HasAuthoredValue():
                values = _vectors("normals", attribute.Get(self._moment))
                interpolation = str(self._mesh.GetNormalsInterpolation())
                return at_corners(values, None, interpolation, triangles)
        except InputError as error:
            import_report.left_out(f"the normals of {self._path}: {error}")
        return None

    def _smooth_normals(self, triangles: Triangles) -> AtCorners:
        """Of all triangles of the mesh, so that its pieces meet smoothly."""
        faces = self.triangles.faces
        faces = faces[(faces >= 0).all(axis=1)]
        smooth = smooth_normals(self.points[faces].astype(np.float64), faces, len(self.points))
        return AtCorners(smooth, np.maximum(triangles.faces, 0))

    def _uv(self, name: str, triangles: Triangles) -> AtCorners | None:
        """Texture coordinates by the name of their primvar; zeros where a mesh has none, because others are
        counted after them."""
        found = self._primvar(name, 2, triangles)
        return found or AtCorners(np.zeros((1, 2), np.float32), np.zeros_like(triangles.faces))

    def _colors(self, wanted: Wanted, triangles: Triangles) -> AtCorners | None:
        """Linear colours and opacities in one."""
        color = self._primvar(wanted.color, 3, triangles)
        opacity = self._primvar(wanted.opacity, 1, triangles)
        if color is None and opacity is None:
            return None
        color = color or AtCorners(np.ones((1, 3), np.float32), np.zeros_like(triangles.faces))
        opacity = opacity or AtCorners(np.ones((1, 1), np.float32), np.zeros_like(triangles.faces))
        (rgb, alpha), at = joined([color, opacity])
        assert at is not None
        if len(alpha) != len(rgb):
            alpha = np.broadcast_to(alpha[:1], (len(rgb), 1))
        return AtCorners(np.concatenate([rgb, alpha], axis=1), at)

    def _primvar(self, name: str | None, width: int, triangles: Triangles) -> AtCorners | None:
        if name is None:
            return None
        primvar = UsdGeom.PrimvarsAPI(self._mesh).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return None
        try:
            return of_primvar(primvar, width, self._moment, triangles)
        except InputError as error:
            import_report.left_out(f"the primvar {name!r} of {self._path}: {error}")
            return None


def _vectors(name: str, found: Any) -> Array:
    """(N, 3) what an attribute has, whose type may be another one than that of its schema. Raises
    InputError."""
    values = _numbers(name, np.zeros((0, 3)) if found is None else found, np.float32)
    if values.ndim != 2 or values.shape[1] != 3:
        raise InputError(f"{name}: have not three numbers each; the file is damaged")
    return values


def _indices(attribute: Any, moment: Any) -> Indices:
    """(N,) Raises InputError."""
    found = attribute.Get(moment)
    values = _numbers(str(attribute.GetName()), [] if found is None else found, np.int64)
    if values.ndim != 1:
        raise InputError(f"{attribute.GetName()}: is no list of numbers; the file is damaged")
    return values


def _numbers(name: str, found: Any, kind: type[np.generic]) -> npt.NDArray[Any]:
    try:
        return np.asarray(found).astype(kind)
    except (TypeError, ValueError):
        raise InputError(f"{name}: hold no numbers; the file is damaged") from None


def _chosen(triangles: Triangles, which: npt.NDArray[np.bool_]) -> Triangles:
    return replace(
        triangles,
        faces=triangles.faces[which],
        corners=triangles.corners[which],
        polygons=triangles.polygons[which],
    )


def _used(faces: Indices) -> tuple[Indices, Indices]:
    """The vertices that faces use, and the faces among them; what is not there stays -1."""
    used = np.unique(faces[faces >= 0])
    places = np.searchsorted(used, faces)
    return used, np.where(faces >= 0, places, -1)
