"""What a mesh file gives, before it is put into a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import Light
from incpt.scene.material import Material
from incpt.scene.mesh import Mesh
from incpt.scene.transform import IDENTITY, Transform


@dataclass(frozen=True)
class MeshPart:
    """One placed geometry of a mesh file. `name` is None where the file holds only one; the material is
    that of the file, or None; the transform takes the mesh to the space of the file."""

    name: str | None
    mesh: Mesh
    material_name: str | None = None
    material: Material | None = None
    transform: Transform = IDENTITY
    visible: bool = True


@dataclass(frozen=True)
class MeshFile:
    """All that a mesh file gives. Names of lights may be alike; `cameras` are in the order of the file.
    `files` are those beside it that it was read from: while they and the file keep their ages and sizes,
    reading it again gives the same. `environment` is the light from far away, where a file has it."""

    parts: tuple[MeshPart, ...]
    lights: tuple[Light, ...] = ()
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    environment: Environment | None = None
