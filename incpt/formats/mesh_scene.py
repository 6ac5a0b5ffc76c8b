"""A scene around the meshes of a file: where it has no light or camera, a studio and one that frames them."""

from __future__ import annotations

import importlib.resources
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from incpt.core.errors import in_place
from incpt.formats import images, mesh_files, registry
from incpt.formats.orientation import upright
from incpt.formats.registry import FileKind
from incpt.scene.camera import Camera
from incpt.scene.edits import unique_name
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import CAMERA_NAME, Object, Scene


def scene_around(path: Path) -> Scene:
    """The meshes of a file with their materials (grey where it has none), its lights, its environment and
    its cameras, as they are. Without a camera one frames them from the front right and above; without a light
    they stand in a studio. Raises InputError."""
    file = mesh_files.load_file(path)
    row = registry.format_of(path, FileKind.MESH)
    with in_place(str(path)):
        parts = upright(file.parts, says_units=row is not None and row.says_units)
        materials: dict[str, Material] = {}
        objects = []
        for part in parts:
            material_name, material = part.material_name or "grey", part.material or Material(roughness=0.6)
            materials.setdefault(material_name, material)
            name = path.stem if part.name is None else f"{path.stem}/{part.name}"
            objects.append(
                Object(name, part.mesh, material_name, visible=part.visible, transform=part.transform)
            )
        cameras = dict(file.cameras) or {CAMERA_NAME: _framing_camera(*_bounds(objects))}
        active = next(iter(cameras))
        is_lit = any(light.is_emissive for light in file.lights)
        dark_or_studio = Environment((0.0, 0.0, 0.0)) if is_lit else _pleasant_environment()
        scene = Scene(
            cameras[active],
            file.environment or dark_or_studio,
            materials,
            tuple(objects),
            camera_name=active,
            cameras=cameras,
        )
        for light in file.lights:
            name = unique_name(f"{path.stem}/{light.name}", scene.names)
            scene = scene.with_added_light(replace(light, name=name))
        return scene


def _bounds(objects: list[Object]) -> np.ndarray[Any, Any]:
    """(2, 3) of all that are visible, or of all where none is."""
    bounds = np.stack([o.world_bounds for o in [o for o in objects if o.visible] or objects])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _framing_camera(low: np.ndarray[Any, Any], high: np.ndarray[Any, Any]) -> Camera:
    """Looks at the middle of a box from the front right and above, so that its sphere just fits."""
    fov_y = 40.0
    middle = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
    direction = np.array([0.45, 0.3, 1.0]) / np.linalg.norm([0.45, 0.3, 1.0])
    position = middle + direction * radius / math.sin(math.radians(fov_y / 2))
    return Camera(tuple(position.tolist()), tuple(middle.tolist()), fov_y=fov_y)


def _pleasant_environment() -> Environment:
    studio = importlib.resources.files("incpt.scenes") / "studio.exr"
    if isinstance(studio, Path) and studio.is_file():
        return Environment((1.0, 1.0, 1.0), images.load_image(studio))
    return Environment((0.8, 0.8, 0.8))
