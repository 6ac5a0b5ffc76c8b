"""What meshes have at the corners of their faces, as kernels find it for each object: texture coordinates,
colours, tangents; and on faces, gradients of texture coordinates. They lie in the pool of geometry; scenes
without textures don't ask for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pyopencl as cl

from incpt.core import layout
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.tables.geometry_pool import GeometryPool, PooledMesh


class AttributeTable:
    """Where the meshes of a scene's objects have their attributes. Made by `attribute_table`."""

    def __init__(
        self, pool: GeometryPool, scene: Scene, meshes: Mapping[Mesh, PooledMesh], is_used: bool
    ) -> None:
        self._pool, self._meshes = pool, meshes
        self._objects = scene.objects if is_used else ()
        self._tangent_sets, self._gradient_sets = (
            _tangent_sets(scene.materials),
            _gradient_sets(scene.materials),
        )
        self.has_colors = any(mesh.colors is not None for mesh in meshes)
        self._buffer = self._uploaded()

    @property
    def buffer(self) -> cl.Buffer:
        """Rows of layout.ATTRIBUTES that refer to places in the pool as they are now."""
        if self._packings != self._pool.packings:
            self._buffer = self._uploaded()
        return self._buffer

    def _uploaded(self) -> cl.Buffer:
        """One row at least, which kernels read for a ray that meets nothing."""
        self._packings = self._pool.packings
        rows = np.zeros(max(len(self._objects), 1), layout.ATTRIBUTES)
        by_kind: dict[tuple[Mesh, int | None, int | None], int] = {}
        kinds = [
            by_kind.setdefault(
                (obj.mesh, self._tangent_sets.get(obj.material), self._gradient_sets.get(obj.material)),
                len(by_kind),
            )
            for obj in self._objects
        ]
        described = np.zeros(len(by_kind), layout.ATTRIBUTES)
        for row, (mesh, tangent_set, gradient_set) in zip(described, by_kind, strict=True):
            _describe(row, self._meshes[mesh], tangent_set, gradient_set)
        if kinds:
            rows[:] = described[kinds]
        return self._pool.device.upload(rows)


def attribute_table(
    pool: GeometryPool, scene: Scene, meshes: Mapping[Mesh, PooledMesh], has_textures: bool
) -> AttributeTable:
    """Of a scene whose meshes are held. What they have at their corners is uploaded where `has_textures`, or
    some have colours; tangents are computed where normal maps or stretched reflections need them, and
    gradients where height maps do. Raises DeviceError where there is no room for it."""
    is_used = (
        has_textures
        or any(mesh.colors is not None for mesh in meshes)
        or any(material.anisotropy > 0 for material in scene.materials.values())
    )
    if is_used:
        pool.hold_corners(_needed(scene, meshes), meshes)
    return AttributeTable(pool, scene, meshes, is_used)


def _needed(scene: Scene, meshes: Iterable[Mesh]) -> dict[tuple[Mesh, str], None]:
    """What meshes have at their corners, and tangents and gradients of those whose materials need them."""
    needed: dict[tuple[Mesh, str], None] = {}
    for mesh in meshes:
        needed |= dict.fromkeys((mesh, f"uvs {number}") for number in range(len(mesh.uvs)))
        if mesh.colors is not None:
            needed[mesh, "colors"] = None
    for kind, sets in (
        ("tangents", _tangent_sets(scene.materials)),
        ("gradients", _gradient_sets(scene.materials)),
    ):
        mapped = (obj for obj in scene.objects if obj.material in sets)
        needed |= dict.fromkeys((obj.mesh, f"{kind} {sets[obj.material]}") for obj in mapped)
    return needed


def _tangent_sets(materials: Mapping[str, Material]) -> dict[str, int]:
    """The set of texture coordinates by which the tangents of each material go that needs them: for a normal
    map, for that of its clearcoat, or because its reflections are stretched along them."""
    found = {}
    for name, material in materials.items():
        maps = (material.normal_texture, material.clearcoat_normal_texture, material.anisotropy_texture)
        texture = next((one for one in maps if one is not None), None)
        if texture is not None or material.anisotropy > 0:
            found[name] = texture.uv_set if texture is not None else 0
    return found


def _gradient_sets(materials: Mapping[str, Material]) -> dict[str, int]:
    """The set of texture coordinates of the height map of each material that has one."""
    return {
        name: material.bump_texture.uv_set
        for name, material in materials.items()
        if material.bump_texture is not None
    }


def _describe(row: np.void, mesh: PooledMesh, tangent_set: int | None, gradient_set: int | None) -> None:
    for number in range(2):
        row["first_uv"][number], row["has_uv"][number] = mesh.place_of(f"uvs {number}")
    row["first_color"], row["has_color"] = mesh.place_of("colors")
    if tangent_set is not None:
        row["first_tangent"], row["has_tangent"] = mesh.place_of(f"tangents {tangent_set}")
    if gradient_set is not None:
        row["first_gradient"], row["has_gradient"] = mesh.place_of(f"gradients {gradient_set}")
