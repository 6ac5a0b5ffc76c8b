"""A scene around the meshes of a file: default light, and a camera that frames them."""

from __future__ import annotations

import importlib.resources
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from incpt.core.errors import in_place
from incpt.formats import gltf_lights, images, mesh_files
from incpt.scene.camera import Camera
from incpt.scene.edits import unique_name
from incpt.scene.environment import Environment
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene


def scene_around(path: Path) -> Scene:
    """The meshes of a file with their materials (grey where it has none), framed by the camera, and its
    lights."""
    parts = mesh_files.load_parts(path)
    with in_place(str(path)):
        materials: dict[str, Material] = {}
        objects = []
        for part in parts:
            material_name, material = part.material_name or "grey", part.material or Material(roughness=0.6)
            materials.setdefault(material_name, material)
            name = path.stem if part.name is None else f"{path.stem}/{part.name}"
            objects.append(Object(name, part.mesh, material_name))
        bounds = np.stack([o.world_bounds for o in objects])
        camera = _framing_camera(bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0))
        scene = Scene(camera, _pleasant_environment(), materials, tuple(objects))
        for light in gltf_lights.lights_of(path):
            name = unique_name(f"{path.stem}/{light.name}", scene.names)
            scene = scene.with_added_light(replace(light, name=name))
        return scene


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
