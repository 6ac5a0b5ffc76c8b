"""Which reader takes which file: `load` reads a scene from any file that holds one."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from incpt.core import files
from incpt.core.errors import InputError, InputWarning
from incpt.formats import mesh_files
from incpt.formats.mesh_scene import scene_around
from incpt.formats.scene_toml import load_scene_toml
from incpt.scene.model import Scene
from incpt.scene.summary import scene_problems


def load(path: str | os.PathLike[str]) -> Scene:
    """A scene from a scene file (.toml), or a default scene around a mesh file.

    An InputWarning tells of faces that were left out and of a scene that shows nothing. Raises InputError,
    one line that names file, table and key.
    """
    path = Path(path)
    files.check_readable(path)
    suffix = path.suffix[1:].lower()
    if suffix == "toml":
        scene = load_scene_toml(path)
    elif suffix in mesh_files.mesh_suffixes():
        scene = scene_around(path)
    else:
        raise InputError(
            f"{path}: files of this type cannot be read; use a scene (.toml) "
            f"or a mesh ({mesh_files.readable_types()})"
        )
    for problem in scene_problems(scene):
        warnings.warn(f"{path}: {problem}", InputWarning, stacklevel=2)
    return scene
