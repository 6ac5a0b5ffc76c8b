"""Scene files: TOML, version 1, to and from a Scene.

Every value is checked where it stands, so that an error reads `scenes/a.toml: [[objects]] 3 ("red cube"):
position: nan is not a finite number`. What a scene may hold is told by the dataclasses of `scene.py` alone:
their field names are the keys, their own checks the ranges.
"""

from __future__ import annotations

import importlib.resources
import json
import math
import os
import re
import tomllib
import warnings
from collections.abc import Collection, Mapping
from dataclasses import MISSING, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from incpt import files, image_io, mesh_io
from incpt.errors import InputError, InputWarning, in_place, one_line
from incpt.scene import Camera, Environment, Image, Material, Mesh, Object, Scene, shape
from incpt.settings import RenderSettings

_T = TypeVar("_T")

VERSION = 1
_TABLES = ("version", "camera", "environment", "render", "materials", "objects")
_CAMERA_KEYS = ("position", "target", "up", "fov_y")
_ENVIRONMENT_KEYS = ("color", "image", "rotation_y", "intensity")
_OBJECT_KEYS = ("name", "shape", "mesh", "part", "material", "position", "rotation", "scale", "visible")
_MATERIAL_KEYS = tuple(field.name for field in fields(Material))
_LARGEST_INTEGER = 1 << 63
"""TOML promises 64 bits; Python would read any number of digits."""


def load(path: str | os.PathLike[str]) -> Scene:
    """A scene from a scene file (.toml), or a default scene around a mesh file.

    An InputWarning tells of faces that were left out and of a scene that shows nothing. Raises InputError,
    one line that names file, table and key.
    """
    path = Path(path)
    files.check_readable(path)
    suffix = path.suffix[1:].lower()
    if suffix == "toml":
        scene = _load_toml(path)
    elif suffix in mesh_io.mesh_suffixes():
        scene = _scene_around(path)
    else:
        raise InputError(
            f"{path}: files of this type cannot be read; use a scene (.toml) "
            f"or a mesh ({mesh_io.readable_types()})"
        )
    for problem in scene_problems(scene):
        warnings.warn(f"{path}: {problem}", InputWarning, stacklevel=2)
    return scene


def scene_problems(scene: Scene) -> list[str]:
    """What makes the picture of a valid scene empty or black, a line each."""
    problems = []
    if not scene.objects:
        problems.append("the scene has no objects: the picture shows the environment only")
    lit = any(c > 0 for c in scene.environment.radiance) and (
        scene.environment.image is None or bool(scene.environment.image.pixels.any())
    )
    if not lit and not any(o.visible and scene.materials[o.material].is_emissive for o in scene.objects):
        problems.append(
            "the scene has no light: the picture will be black; add an environment or an emissive material"
        )
    return problems


def describe(scene: Scene) -> list[str]:
    """What is in a scene, as lines of text: counts, bounds, lights, problems."""
    meshes = {id(o.mesh): o.mesh for o in scene.objects}
    lights = [o for o in scene.objects if o.visible and scene.materials[o.material].is_emissive]
    hidden = sum(not o.visible for o in scene.objects)
    placed = sum(len(o.mesh.faces) for o in scene.objects)
    stored = sum(len(mesh.faces) for mesh in meshes.values())
    lines = [
        f"objects: {len(scene.objects):,}" + (f" ({hidden:,} hidden)" if hidden else ""),
        f"meshes: {len(meshes):,} with {stored:,} triangles; {placed:,} triangles placed",
        f"materials: {len(scene.materials):,}",
        f"lights: {len(lights):,} emissive objects with {sum(len(o.mesh.faces) for o in lights):,} triangles",
        f"environment: {_described_environment(scene.environment)}",
    ]
    if scene.objects:
        bounds = np.stack([o.world_bounds for o in scene.objects])
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        lines.append(f"bounds: {_described_point(low)} to {_described_point(high)} metres")
    camera = scene.camera
    lines.append(
        f"camera: at {_described_point(camera.position)}, looks at {_described_point(camera.target)}, "
        f"{camera.fov_y:g} degrees high"
    )
    return lines + [f"warning: {problem}" for problem in scene_problems(scene)]


def _described_environment(environment: Environment) -> str:
    colour = f"radiance {_described_point(environment.radiance)}"
    if environment.image is None:
        return colour if any(environment.radiance) else "none"
    height, width = environment.image.pixels.shape[:2]
    name = os.path.basename(environment.image.source or "made in Python")
    return f"{colour} times {name}, {width} x {height} pixels"


def _described_point(point: Collection[float]) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError with line and column."""
    content = files.read_bytes(path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}: line {line}: is not UTF-8 text; save it as UTF-8") from None
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:
        message = one_line(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
        at = f"line {place[1]}, column {place[2]}: " if place else ""
        reason = message[: place.start()] if place else message
        raise InputError(one_line(f"{path}: {at}is no valid TOML ({reason})")) from None
    except RecursionError:
        raise InputError(f"{path}: is no valid TOML (nested too deeply)") from None
    _check_integers(path, table)
    return table


def _check_integers(path: Path, table: dict[str, Any]) -> None:
    left: list[tuple[str, Any]] = list(table.items())
    while left:
        key, value = left.pop()
        if isinstance(value, dict):
            left += value.items()
        elif isinstance(value, list):
            left += [(key, item) for item in value]
        elif isinstance(value, int) and not -_LARGEST_INTEGER <= value < _LARGEST_INTEGER:
            raise InputError(
                f"{path}: {one_line(key)}: a whole number of more than 64 bits; use a smaller one"
            )


def check_keys(table: Mapping[str, Any], known: Collection[str], what: str = "key") -> None:
    """Raises InputError for the first key that is not known, with the one that was meant."""
    for key in table:
        if key not in known:
            close = get_close_matches(key, known, 1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
            raise InputError(f"{key}: is no known {what}; {hint}")


def table_of(tables: Mapping[str, Any], key: str) -> dict[str, Any]:
    """The table under `key`, empty where there is none. Raises InputError for anything but a table."""
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{key}: is not a table; write [{key}] and its keys below")
    return table


def text_of(table: Mapping[str, Any], key: str, why: str) -> str:
    """The text under `key`. Raises InputError where it is missing, empty, or not a text."""
    if key not in table:
        raise InputError(f"{key}: is missing; {why}")
    value = table[key]
    if not isinstance(value, str) or not value:
        raise InputError(f"{key}: {value!r} is not a text; {why}")
    return value


def quoted(name: str) -> str:
    """A name as it stands in a message: in quotes, on one line, not too long."""
    text = json.dumps(name, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + '…"'


def _load_toml(path: Path) -> Scene:
    tables = read_toml(path)
    with in_place(str(path)):
        _check_version(tables)
        check_keys(tables, _TABLES, "table or key")
        with in_place("[camera]"):
            camera = _built(Camera, table_of(tables, "camera"), _CAMERA_KEYS)
        with in_place("[environment]"):
            environment = _environment(table_of(tables, "environment"), path.parent)
        with in_place("[render]"):
            settings = _built(RenderSettings, table_of(tables, "render"), RenderSettings.names())
        materials = _materials(table_of(tables, "materials"))
        objects = _objects(tables.get("objects", []), materials, path.parent)
        return Scene(camera, environment, materials, tuple(objects), settings)


def _check_version(tables: Mapping[str, Any]) -> None:
    if "version" not in tables:
        raise InputError(f"version: is missing; write `version = {VERSION}` in the first line")
    version = tables["version"]
    if version != VERSION or isinstance(version, bool):
        raise InputError(f"version: {version!r} cannot be read; this program reads version {VERSION}")


def _built(kind: type[_T], table: Mapping[str, Any], known: Collection[str]) -> _T:
    check_keys(table, known)
    return kind(**table)


def _environment(table: dict[str, Any], folder: Path) -> Environment:
    check_keys(table, _ENVIRONMENT_KEYS)
    values = dict(table)
    if "image" in values:
        with in_place("image"):
            name = text_of({"image": values["image"]}, "image", "name an OpenEXR file")
            values["image"] = image_io.load_image(folder / name)
        values.setdefault("color", (1.0, 1.0, 1.0))
    return Environment(**values)


def _materials(tables: dict[str, Any]) -> dict[str, Material]:
    materials = {}
    for name, table in tables.items():
        with in_place(f"[materials.{name if name.isidentifier() else quoted(name)}]"):
            if not isinstance(table, dict):
                raise InputError("is not a table; write its values below")
            materials[name] = _built(Material, table, _MATERIAL_KEYS)
    return materials


def _objects(tables: Any, materials: Mapping[str, Material], folder: Path) -> list[Object]:
    if not isinstance(tables, list):
        raise InputError("objects: is one table; write [[objects]] with double brackets")
    library = MeshLibrary(folder)
    objects: list[Object] = []
    numbers: dict[str, int] = {}
    for number, table in enumerate(tables, 1):
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


def _object(table: dict[str, Any], materials: Mapping[str, Material], library: MeshLibrary) -> list[Object]:
    """The object of a table, or several where its mesh file holds several: "name/part"."""
    check_keys(table, _OBJECT_KEYS)
    name = text_of(table, "name", "give every object a name of its own")
    material = text_of(table, "material", "name one of [materials]")
    if material not in materials:
        close = get_close_matches(material, materials, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"add [materials.{material}]"
        raise InputError(f"material: {material!r} is not in [materials]; {hint}")
    placement = {k: v for k, v in table.items() if k in ("position", "rotation", "scale", "visible")}
    meshes = library.meshes(table)
    names = [name] if len(meshes) == 1 else [f"{name}/{part}" for part, _ in meshes]
    return [Object(n, mesh, material, **placement) for n, (_, mesh) in zip(names, meshes, strict=True)]


class MeshLibrary:
    """The meshes that one file names, relative to its folder; each file is read once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._parts: dict[str, tuple[mesh_io.MeshPart, ...]] = {}

    def meshes(self, table: Mapping[str, Any]) -> list[tuple[str | None, Mesh]]:
        """(part, mesh) that the keys `shape`, or `mesh` and `part`, of a table ask for. Raises InputError."""
        if ("shape" in table) == ("mesh" in table):
            both = "has both `shape` and `mesh`" if "shape" in table else "has neither `shape` nor `mesh`"
            raise InputError(f"{both}; give it one of them")
        if "shape" in table:
            if "part" in table:
                raise InputError("part: belongs to a mesh file; leave it out beside `shape`")
            return [(None, shape(text_of(table, "shape", "name a built-in shape")))]
        name = text_of(table, "mesh", "name a mesh file")
        if name not in self._parts:
            with in_place("mesh"):
                self._parts[name] = mesh_io.load_parts(self.folder / name)
        parts = self._parts[name]
        if "part" in table:
            part = text_of(table, "part", "name a geometry of the mesh file")
            parts = (mesh_io.choose_part(self.folder / name, parts, part),)
        return [(p.name, p.mesh) for p in parts]


def _scene_around(path: Path) -> Scene:
    """The meshes of a file with their materials (grey where it has none), framed by the camera."""
    parts = mesh_io.load_parts(path)
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
        return Scene(camera, _pleasant_environment(), materials, tuple(objects))


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
        return Environment((1.0, 1.0, 1.0), image_io.load_image(studio))
    return Environment((0.8, 0.8, 0.8))


def save(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Writes a scene file, atomically; `load` gives an equal scene back.

    Meshes and images that came from files are named relative to the new file. A mesh or image made or
    changed in Python is written beside the scene file under a name with a digest of its content. Raises
    OutputError where a file cannot be written (then nothing is left behind), InputError for a scene
    that no file can hold.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: a scene is saved as TOML; end its name with .toml")
    beside = _Beside(path)
    try:
        document = _document(scene, beside)
        files.write_bytes(path, document.encode())
    except UnicodeEncodeError:
        beside.undo()
        raise InputError(f"{path}: a name in the scene is no valid text; rename it") from None
    except BaseException:
        beside.undo()
        raise


class _Beside:
    """Files that a scene file refers to: found, or written beside it."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent
        self._stem = path.stem
        self._written: list[Path] = []
        self._names: dict[int, dict[str, str]] = {}

    def undo(self) -> None:
        """Removes what was written."""
        for path in self._written:
            path.unlink(missing_ok=True)

    def mesh(self, mesh: Mesh, name: str) -> dict[str, str]:
        """The keys of an object that name its mesh."""
        if id(mesh) not in self._names:
            self._names[id(mesh)] = self._mesh(mesh, name)
        return self._names[id(mesh)]

    def _mesh(self, mesh: Mesh, name: str) -> dict[str, str]:
        source = mesh.source
        if source.shape is not None and _same_mesh(mesh, shape(source.shape)):
            return {"shape": source.shape}
        if source.file is not None and _same_mesh(mesh, _mesh_on_disk(source.file, source.part)):
            part = {} if source.part is None else {"part": source.part}
            return {"mesh": self._relative(source.file), **part}
        label = re.sub(r"[^A-Za-z0-9]+", "-", name)[:40].strip("-") or "mesh"
        path = self._folder / f"{self._stem}.{label}.{mesh_io.digest(mesh)}.{mesh_io.STORED_SUFFIX}"
        if not path.exists():
            mesh_io.store_mesh(path, mesh)
            self._written.append(path)
        return {"mesh": path.name}

    def image(self, image: Image) -> str:
        """The name of an image's file."""
        if image.source is not None:
            try:
                stored = image_io.load_image(image.source)
            except InputError:
                stored = None
            if stored is not None and np.array_equal(stored.pixels, image.pixels):
                return self._relative(image.source)
        path = self._folder / f"{self._stem}.environment.{image_io.digest(image.pixels)}.exr"
        if not path.exists():
            image_io.write_exr(path, {"RGB": image.pixels})
            self._written.append(path)
        return path.name

    def _relative(self, file: str) -> str:
        # `..` leaves the folder that a link points to, so links are resolved first.
        absolute = os.path.join(os.path.realpath(os.path.dirname(file)), os.path.basename(file))
        try:
            return os.path.relpath(absolute, os.path.realpath(self._folder)).replace(os.sep, "/")
        except ValueError:  # another drive
            return os.path.abspath(file)


def _mesh_on_disk(file: str, part: str | None) -> Mesh | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            return mesh_io.load_mesh(file, part)
    except InputError:
        return None


def _same_mesh(a: Mesh, b: Mesh | None) -> bool:
    if b is None or a is b:
        return a is b
    if (a.normals is None) != (b.normals is None):
        return False
    same_normals = a.normals is None or b.normals is None or np.array_equal(a.normals, b.normals)
    return same_normals and np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)


def _document(scene: Scene, beside: _Beside) -> str:
    document = tomlkit.document()
    document["version"] = VERSION
    document["camera"] = {name: _toml(getattr(scene.camera, name)) for name in _CAMERA_KEYS}
    document["environment"] = _environment_table(scene.environment, beside)
    render = _changed(scene.settings)
    if render:
        document["render"] = render
    if scene.materials:
        document["materials"] = {
            name: {"base_color": _toml(material.base_color), **_changed(material)}
            for name, material in scene.materials.items()
        }
    if scene.objects:
        document["objects"] = [_object_table(obj, beside) for obj in scene.objects]
    try:
        return tomlkit.dumps(document)
    except TOMLKitError as error:
        raise InputError(
            one_line(f"scene: cannot be written as TOML ({error}); rename what is odd")
        ) from None


def _environment_table(environment: Environment, beside: _Beside) -> dict[str, Any]:
    table: dict[str, Any] = {"color": _toml(environment.color)}
    if environment.image is not None:
        table["image"] = beside.image(environment.image)
    for name in ("rotation_y", "intensity"):
        table[name] = getattr(environment, name)
    return table


def _object_table(obj: Object, beside: _Beside) -> dict[str, Any]:
    table: dict[str, Any] = {"name": obj.name, **beside.mesh(obj.mesh, obj.name), "material": obj.material}
    for name in ("position", "rotation", "scale"):
        table[name] = _toml(getattr(obj, name))
    if not obj.visible:
        table["visible"] = False
    return table


def _changed(owner: Any) -> dict[str, Any]:
    """The fields of a dataclass that differ from their defaults."""
    return {
        field.name: _toml(getattr(owner, field.name))
        for field in fields(owner)
        if field.default is MISSING or getattr(owner, field.name) != field.default
    }


def _toml(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
