"""Meshes as glTF has them: what they have at corners stands at vertices."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from incpt.core.layout import TextureSlot
from incpt.formats.gltf_writer.container import Container
from incpt.formats.welding import welded
from incpt.scene.material import Material, texture_of
from incpt.scene.mesh import Mesh
from incpt.scene.tangents import corner_tangents

Array = npt.NDArray[np.float32]


class _Needs(NamedTuple):
    """What a material wants of a mesh in glTF: so many sets of texture coordinates, and tangents by one of
    them, or by none."""

    uv_sets: int
    tangent_set: int | None


class GeometryWriter:
    """Writes the arrays of each mesh once, for all materials that want the same of it."""

    def __init__(self, container: Container) -> None:
        self._container = container
        self._written: dict[tuple[Mesh, _Needs], dict[str, Any]] = {}

    def primitive(self, mesh: Mesh, material: Material) -> dict[str, Any]:
        """The keys of a primitive that hold a mesh for a material."""
        needs = _needs_of(material, mesh)
        key = mesh, needs
        if key not in self._written:
            self._written[key] = self._primitive(mesh, _at_corners(mesh, needs))
        return self._written[key]

    def _primitive(self, mesh: Mesh, at_corners: dict[str, Array]) -> dict[str, Any]:
        """Corners that are alike in all that they have are one vertex."""
        if not at_corners:
            used, faces = np.unique(mesh.faces, return_inverse=True)
            positions, at = mesh.vertices[used], {}
            indices = faces.reshape(-1)
        else:
            corners = [mesh.vertices[mesh.faces], *at_corners.values()]
            rows, indices = welded(np.concatenate(corners, axis=2).reshape(3 * len(mesh.faces), -1))
            ends = np.cumsum([values.shape[2] for values in corners])[:-1]
            positions, *columns = (np.ascontiguousarray(one) for one in np.split(rows, ends, axis=1))
            at = dict(zip(at_corners, columns, strict=True))
        attributes = {"POSITION": self._container.values(positions, with_bounds=True)}
        attributes |= {name: self._container.values(values) for name, values in at.items()}
        return {"attributes": attributes, "indices": self._container.indices(indices)}


def _needs_of(material: Material, mesh: Mesh) -> _Needs:
    textures = [texture_of(material, slot) for slot in TextureSlot if slot is not TextureSlot.BUMP]
    sets = max((one.uv_set + 1 for one in textures if one is not None), default=0)
    has_grooves = material.anisotropy or material.anisotropy_rotation or material.anisotropy_texture
    has_coat = material.clearcoat_normal_texture is not None and material.normal_texture is None
    if not (has_grooves or has_coat) or (mesh.tangents is not None and mesh.normals is not None):
        return _Needs(max(sets, len(mesh.uvs)), None)
    # Readers make tangents for a normal map, and for nothing else.
    maps = (material.normal_texture, material.clearcoat_normal_texture, material.anisotropy_texture)
    chosen = next((one.uv_set for one in maps if one is not None), 0)
    return _Needs(max(sets, len(mesh.uvs)), chosen)


def _at_corners(mesh: Mesh, needs: _Needs) -> dict[str, Array]:
    """(F, 3, n) each, by the names of attributes. Where a mesh has no texture coordinates that a material
    wants, they are 0, as they are here."""
    uvs = [*mesh.uvs] + [np.zeros((len(mesh.faces), 3, 2), np.float32)] * (needs.uv_sets - len(mesh.uvs))
    normals, tangents = mesh.normals, mesh.tangents
    if needs.tangent_set is not None:
        normals, tangents = _normals(mesh), corner_tangents(mesh, needs.tangent_set)
    columns = {
        "NORMAL": normals,
        **{f"TEXCOORD_{number}": values for number, values in enumerate(uvs)},
        "COLOR_0": mesh.colors,
        # Without normals they count for nothing.
        "TANGENT": tangents if normals is not None else None,
    }
    return {name: values for name, values in columns.items() if values is not None}


def _normals(mesh: Mesh) -> Array:
    """(F, 3, 3) unit normals at corners, of flat faces too."""
    if mesh.normals is not None:
        return mesh.normals
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return np.repeat(flat[:, None], 3, axis=1).astype(np.float32)
