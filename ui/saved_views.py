"""Views that were saved under a name, by the scene file that they are of: TOML in the user's configuration
folder, since a free view is no part of a scene.

A file that is broken, or written by another version, never keeps the editor from working: what cannot be used
is left out.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import tomlkit

from incpt.core import files
from incpt.core.errors import InputError, OutputError, one_line
from incpt.scene.camera import Camera
from incpt.ui.preferences import config_folder

MOST_SCENES = 100
"""Of how many scene files views are kept; those that were saved longest ago go first."""

Views = Mapping[str, Camera]
"""Cameras by the names of the views."""


def path() -> Path:
    """The file that holds them; it need not exist."""
    return config_folder() / "views.toml"


def of_scene(scene_file: Path | None) -> dict[str, Camera]:
    """The views that were saved of a scene file, in order; none of a scene without one."""
    table = _tables().get(str(scene_file), {}) if scene_file is not None else {}
    found = {}
    for name, values in table.items() if isinstance(table, dict) else ():
        camera = _camera(values)
        if camera is not None:
            found[name] = camera
    return found


def keep(scene_file: Path, views: Views) -> None:
    """Keep these views of a scene file, in place of those that were kept before. Raises OutputError."""
    tables = _tables()
    tables.pop(str(scene_file), None)
    if views:
        tables[str(scene_file)] = {name: _values(camera) for name, camera in views.items()}
    for oldest in list(tables)[: max(len(tables) - MOST_SCENES, 0)]:
        del tables[oldest]
    try:
        path().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(one_line(f"{path()}: cannot be written ({error.strerror})")) from None
    files.write_bytes(path(), tomlkit.dumps(tables).encode())


def _tables() -> dict[str, Any]:
    try:
        return tomllib.loads(files.read_bytes(path()).decode("utf-8-sig"))
    except (InputError, ValueError, RecursionError):
        return {}


def _values(camera: Camera) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value for name, value in asdict(camera).items()
    }


def _camera(values: Any) -> Camera | None:
    if not isinstance(values, dict):
        return None
    known = {field.name for field in fields(Camera)}
    try:
        return Camera(**{name: value for name, value in values.items() if name in known})
    except InputError:
        return None
