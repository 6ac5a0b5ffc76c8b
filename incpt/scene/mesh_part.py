"""What a mesh file gives, before it is put into a scene: meshes with a name and a material."""

from __future__ import annotations

from dataclasses import dataclass

from incpt.scene.material import Material
from incpt.scene.mesh import Mesh


@dataclass(frozen=True)
class MeshPart:
    """One placed geometry of a mesh file. `name` is None where the file holds only one; the material is
    that of the file (glTF), or None."""

    name: str | None
    mesh: Mesh
    material_name: str | None = None
    material: Material | None = None
