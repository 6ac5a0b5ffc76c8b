"""Scene files: a Scene from TOML, version 2 or 1, which has no textures. `scene_save` writes them.

Every value is checked where it stands, so that an error reads `scenes/a.toml: [[objects]] 3 ("red cube"):
position: nan is not a finite number`. What a scene may hold is told by the dataclasses of `incpt.scene`
alone: their field names are the keys, their own checks the ranges.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from incpt.core.errors import InputError, in_place
from incpt.core.settings import RenderSettings
from incpt.formats import images, placeholders, textures
from incpt.formats.mesh_library import MeshLibrary
from incpt.formats.reading_progress import each
from incpt.formats.toml_kit import check_keys, quoted, read_toml, table_of, text_of
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.light import KINDS, Light
from incpt.scene.material import Material
from incpt.scene.model import CAMERA_NAME, Object, Scene
from incpt.scene.sky import Sky

_T = TypeVar("_T")
VERSION = 2
"""That is written."""
_READ = (1, 2)
_TABLES = (
    "version",
    "camera",
    "cameras",
    "active_camera",
    "environment",
    "render",
    "materials",
    "objects",
    "lights",
)
CAMERA_KEYS = tuple(field.name for field in fields(Camera))
SKY_KEYS = tuple(field.name for field in fields(Sky))
ENVIRONMENT_KEYS = tuple(field.name for field in fields(Environment))
MATERIAL_KEYS = tuple(field.name for field in fields(Material))
PLACEMENT_KEYS = ("position", "rotation", "scale", "matrix", "visible")
MESH_KEYS = ("shape", "mesh", "part", "geometry")
LIGHT_KEYS = (
    *(field.name for field in fields(Light) if field.name not in ("name", "transform", "visible")),
    *PLACEMENT_KEYS,
)
_OBJECT_KEYS = ("name", *MESH_KEYS, "material", *PLACEMENT_KEYS)


def load_scene_toml(path: Path) -> Scene:
    """The scene of a TOML file. Raises InputError, one line that names table and key, but not the file."""
    tables = read_toml(path)
    _check_version(tables)
    check_keys(tables, _TABLES, "table or key")
    cameras = _cameras(tables)
    active = _active_camera(tables, cameras)
    with in_place("[environment]"):
        environment = _environment(table_of(tables, "environment"), path.parent)
    with in_place("[render]"):
        settings = _built(RenderSettings, table_of(tables, "render"), RenderSettings.names())
    materials = _materials(table_of(tables, "materials"), path.parent)
    objects = _objects(tables.get("objects", []), materials, path.parent)
    lights = _lights(tables.get("lights", []))
    return Scene(
        cameras[active], environment, materials, tuple(objects), settings, tuple(lights), camera_name=active,
        cameras=cameras,
    )  # fmt: skip


def _check_version(tables: Mapping[str, Any]) -> None:
    if "version" not in tables:
        raise InputError(f"version: is missing; write `version = {VERSION}` in the first line")
    version = tables["version"]
    if version not in _READ or isinstance(version, (bool, float)):
        known = " and ".join(map(str, _READ))
        raise InputError(f"version: {version!r} cannot be read; this program reads versions {known}")


def _built(kind: type[_T], table: Mapping[str, Any], known: Collection[str]) -> _T:
    check_keys(table, known)
    return kind(**table)


def _cameras(tables: Mapping[str, Any]) -> dict[str, Camera]:
    """By name, in the order of the file; that of the table [camera] is the first."""
    cameras: dict[str, Camera] = {}
    if "camera" in tables or not table_of(tables, "cameras"):
        with in_place("[camera]"):
            cameras[CAMERA_NAME] = _built(Camera, table_of(tables, "camera"), CAMERA_KEYS)
    for name, table in table_of(tables, "cameras").items():
        with in_place(f"[cameras.{name if name.isidentifier() else quoted(name)}]"):
            if not isinstance(table, dict):
                raise InputError("is not a table; write its values below")
            if name in cameras:
                raise InputError("is the name of the table [camera] too; rename one of them")
            cameras[name] = _built(Camera, table, CAMERA_KEYS)
    return cameras


def _active_camera(tables: Mapping[str, Any], cameras: Mapping[str, Camera]) -> str:
    """The name of the camera that the scene is seen through: the first one, unless the file says another."""
    if "active_camera" not in tables:
        return next(iter(cameras))
    name = text_of(dict(tables), "active_camera", "name one of [cameras]")
    if name not in cameras:
        raise InputError(f"active_camera: {name!r} is not in [cameras]; it has {', '.join(cameras)}")
    return name


def _environment(table: dict[str, Any], folder: Path) -> Environment:
    check_keys(table, ENVIRONMENT_KEYS)
    values = dict(table)
    if "image" in values:
        with in_place("image"):
            name = text_of({"image": values["image"]}, "image", "name an OpenEXR file")
            values["image"] = placeholders.read_or(
                lambda: images.load_image(folder / name),
                lambda: placeholders.image(os.path.abspath(folder / name)),
                "an even grey",
            )
        values.setdefault("color", (1.0, 1.0, 1.0))
    if "sky" in values:
        values["sky"] = sky_of(values["sky"])
        values.setdefault("color", (1.0, 1.0, 1.0))
    return Environment(**values)


def sky_of(table: Any) -> Sky:
    """The sky of a table. Raises InputError."""
    with in_place("sky"):
        if not isinstance(table, dict):
            raise InputError("is not a table; write [environment.sky] and its keys below")
        return _built(Sky, table, SKY_KEYS)


def _materials(tables: dict[str, Any], folder: Path) -> dict[str, Material]:
    materials = {}
    for name, table in tables.items():
        with in_place(f"[materials.{name if name.isidentifier() else quoted(name)}]"):
            if not isinstance(table, dict):
                raise InputError("is not a table; write its values below")
            check_keys(table, MATERIAL_KEYS)
            materials[name] = Material(**textures.with_textures(table, folder))
    return materials


def _objects(tables: Any, materials: Mapping[str, Material], folder: Path) -> list[Object]:
    if not isinstance(tables, list):
        raise InputError("objects: is one table; write [[objects]] with double brackets")
    library = MeshLibrary(folder)
    objects: list[Object] = []
    numbers: dict[str, int] = {}
    for number, table in enumerate(each(tables), 1):
        label = table.get("name") if isinstance(table, dict) else None
        shown = f" ({quoted(label)})" if isinstance(label, str) and label else ""
        with in_place(f"[[objects]] {number}{shown}"):
            if not isinstance(table, dict):
                raise InputError("is not a table; write [[objects]] and its keys below")
            for obj in _object(table, materials, library):
                if obj.name in numbers:
                    raise InputError(f"name: [[objects]] {numbers[obj.name]} has that name too; rename one")
                numbers[obj.name] = number
                objects.append(obj)
    return objects


def _lights(tables: Any) -> list[Light]:
    if not isinstance(tables, list):
        raise InputError("lights: is one table; write [[lights]] with double brackets")
    lights = []
    for number, table in enumerate(tables, 1):
        label = table.get("name") if isinstance(table, dict) else None
        shown = f" ({quoted(label)})" if isinstance(label, str) and label else ""
        with in_place(f"[[lights]] {number}{shown}"):
            if not isinstance(table, dict):
                raise InputError("is not a table; write [[lights]] and its keys below")
            check_keys(table, ("name", *LIGHT_KEYS))
            text_of(table, "name", "give every light a name of its own")
            text_of(table, "kind", f"choose one of {', '.join(KINDS)}")
            lights.append(Light(**table))
    return lights


def _object(table: dict[str, Any], materials: Mapping[str, Material], library: MeshLibrary) -> list[Object]:
    """The object of a table, or several where its mesh file holds several: "name/part"."""
    check_keys(table, _OBJECT_KEYS)
    name = text_of(table, "name", "give every object a name of its own")
    material = text_of(table, "material", "name one of [materials]")
    if material not in materials:
        close = get_close_matches(material, materials, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"add [materials.{material}]"
        raise InputError(f"material: {material!r} is not in [materials]; {hint}")
    placement = {k: v for k, v in table.items() if k in PLACEMENT_KEYS}
    meshes = library.meshes(table)
    names = [name] if len(meshes) == 1 else [f"{name}/{part}" for part, _ in meshes]
    return [Object(n, mesh, material, **placement) for n, (_, mesh) in zip(names, meshes, strict=True)]
