"""Scene files: TOML from a Scene, and the meshes and images that no file holds yet beside it."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np

from incpt.core import files
from incpt.core.checks import path_of, require
from incpt.core.errors import InputError, one_line
from incpt.core.layout import TextureSlot
from incpt.core.settings import RenderSettings
from incpt.formats import bitmaps, images, import_report, mesh_files, mesh_store, toml_merge
from incpt.formats.scene_toml import VERSION
from incpt.formats.textures import texture_value
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.image import Image
from incpt.scene.light import STRENGTHS, Light
from incpt.scene.material import Material, texture_name, texture_of
from incpt.scene.mesh import Mesh, MeshSource
from incpt.scene.mesh_part import MeshFile
from incpt.scene.model import CAMERA_NAME, Object, Scene
from incpt.scene.shapes import shape
from incpt.scene.sky import Sky
from incpt.scene.texture import Bitmap, Texture
from incpt.scene.transform import IDENTITY, Transform


def save(scene: Scene, path: str | os.PathLike[str], *, template: str | None = None) -> None:
    """Writes a scene file, atomically; `load` gives an equal scene back.

    `template` is the text of a scene file whose comments, order and spelling are kept, as far as it says the
    same: that which the scene came from.

    Meshes and images that came from files are named relative to the new file. A mesh or image made or
    changed in Python is written beside the scene file under a name with a digest of its content. Raises
    OutputError where a file cannot be written (then nothing is left behind), InputError for a scene
    that no file can hold.
    """
    require("scene", scene, Scene, "a Scene")
    require("template", template, (str, NoneType), "the text of a scene file")
    path = path_of("path", path)
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: a scene is saved as TOML; end its name with .toml")
    files.clear_left_behind(path.parent, path.stem)
    write_scene(scene, path, Beside(path), template)


def write_scene(scene: Scene, path: Path, beside: Beside, template: str | None = None) -> None:
    """Writes a scene file, whose meshes and images `beside` finds or writes; `template` as for `save`. Raises
    OutputError, InputError; then nothing is left behind."""
    try:
        document = _document(scene, beside)
        if template is not None:
            document = toml_merge.merged(template, tomllib.loads(document), _defaults) or document
        files.write_bytes(path, document.encode())
    except UnicodeEncodeError:
        beside.undo()
        raise InputError(f"{path}: a name in the scene is no valid text; rename it") from None
    except BaseException:
        beside.undo()
        raise


class Beside:
    """Files that a scene file refers to: found, or written beside it."""

    def __init__(self, path: Path) -> None:
        """`path`: of the scene file."""
        self.folder = path.parent
        self._stem = path.stem
        self.written: list[Path] = []
        self._names: dict[int, dict[str, str]] = {}
        self._bitmaps: dict[int, dict[str, Any]] = {}
        self._read: dict[str, MeshFile] = {}

    def undo(self) -> None:
        """Removes what was written."""
        for path in self.written:
            path.unlink(missing_ok=True)

    def mesh(self, mesh: Mesh, name: str) -> dict[str, str]:
        """The keys of an object that name its mesh."""
        if id(mesh) not in self._names:
            self._names[id(mesh)] = self._built_in(mesh) or self._mesh(mesh, name)
        return self._names[id(mesh)]

    def _built_in(self, mesh: Mesh) -> dict[str, str]:
        """The key of a mesh that is a built-in shape; none of another."""
        name = mesh.source.shape
        return {"shape": name} if name is not None and _same_mesh(mesh, shape(name)) else {}

    def _mesh(self, mesh: Mesh, name: str) -> dict[str, str]:
        source = mesh.source
        # A placeholder is named as what it stands for.
        if source.file is not None and (mesh.is_placeholder or _same_mesh(mesh, self._mesh_on_disk(source))):
            choice = {"part": source.part, "geometry": source.geometry}
            chosen = {key: name for key, name in choice.items() if name is not None}
            return {"mesh": self._relative(source.file), **chosen}
        path = (
            self.folder
            / f"{self._stem}.{file_label(name, 'mesh')}.{mesh_store.digest(mesh)}{mesh_store.STORED_SUFFIX}"
        )
        if not path.exists():
            mesh_store.store_mesh(path, mesh)
            self.written.append(path)
        return {"mesh": path.name}

    def _mesh_on_disk(self, source: MeshSource) -> Mesh | None:
        file = Path(str(source.file))
        try:
            with import_report.gathered():
                # Kept while the scene is written, so that a file of many meshes is read once.
                self._read[str(file)] = self._read.get(str(file)) or mesh_files.load_file(file)
                if source.geometry is not None:
                    parts = self._read[str(file)].parts
                    return mesh_files.choose_geometry(file, parts, source.geometry)
                return mesh_files.load_mesh(file, source.part)
        except InputError:
            return None

    def image(self, image: Image) -> str:
        """The name of an image's file."""
        if image.source is not None and (image.is_placeholder or is_stored_image(image)):
            return self._relative(image.source)
        path = self.folder / f"{self._stem}.environment.{images.digest(image.pixels)}.exr"
        if not path.exists():
            images.write_exr(path, {"RGB": image.pixels})
            self.written.append(path)
        return path.name

    def bitmap(self, bitmap: Bitmap) -> dict[str, Any]:
        """The keys of a texture that name its image."""
        if id(bitmap) not in self._bitmaps:
            self._bitmaps[id(bitmap)] = self._bitmap(bitmap)
        return self._bitmaps[id(bitmap)]

    def _bitmap(self, bitmap: Bitmap) -> dict[str, Any]:
        source = bitmap.source
        if source.file is not None and (bitmap.is_placeholder or is_stored_bitmap(bitmap)):
            number = {} if source.index is None else {"image": source.index}
            return {"file": self._relative(source.file), **number}
        digest, suffix = bitmaps.digest(bitmap), bitmaps.suffix_of(bitmap)
        path = self.folder / f"{self._stem}.texture.{digest}{suffix}"
        if not path.exists():
            bitmaps.write_bitmap(path, bitmap)
            self.written.append(path)
        return {"file": path.name}

    def _relative(self, file: str) -> str:
        # `..` leaves the folder that a link points to, so links are resolved first.
        absolute = os.path.join(os.path.realpath(os.path.dirname(file)), os.path.basename(file))
        try:
            return os.path.relpath(absolute, os.path.realpath(self.folder)).replace(os.sep, "/")
        except ValueError:  # No relative path leads to another drive.
            return os.path.abspath(file)


def file_label(name: str, default: str) -> str:
    """What a file is called after a name, which may hold anything."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name)[:40].strip("-") or default


def is_stored_image(image: Image) -> bool:
    """Whether the file that an environment image came from still holds it."""
    try:
        stored = images.load_image(str(image.source))
    except InputError:
        return False
    return np.array_equal(stored.pixels, image.pixels)


def is_stored_bitmap(bitmap: Bitmap) -> bool:
    """Whether the file that a bitmap came from still holds it."""
    try:
        stored = bitmaps.load_bitmap(str(bitmap.source.file), bitmap.source.index)
    except InputError:
        return False
    return stored is bitmap or np.array_equal(stored.pixels, bitmap.pixels)


def _same_mesh(a: Mesh, b: Mesh | None) -> bool:
    if b is None or a is b:
        return a is b
    first, second = mesh_store.arrays(a), mesh_store.arrays(b)
    return first.keys() == second.keys() and all(np.array_equal(first[name], second[name]) for name in first)


def _document(scene: Scene, beside: Beside) -> str:
    """The text of a scene file. Raises InputError for a scene that TOML cannot hold."""
    # Imported here, because most programs that import incpt never save a scene.
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    document = tomlkit.document()
    document["version"] = VERSION
    document.update(_camera_tables(scene))
    document["environment"] = _environment_table(scene.environment, beside)
    render = _changed(scene.settings)
    if render:
        document["render"] = render
    if scene.materials:
        document["materials"] = {
            name: {
                "base_color": _toml(material.base_color),
                **_changed(material),
                **_textures(material, beside),
            }
            for name, material in scene.materials.items()
        }
    if scene.objects:
        document["objects"] = [_object_table(obj, beside) for obj in scene.objects]
    if scene.lights:
        document["lights"] = [_light_table(light) for light in scene.lights]
    try:
        return tomlkit.dumps(document)
    except TOMLKitError as error:
        raise InputError(
            one_line(f"scene: cannot be written as TOML ({error}); rename what is odd")
        ) from None


def _defaults(path: tuple[str, ...], table: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values that the keys of a table of a scene file have where they are missing."""
    match path:
        case ("camera",) | ("cameras", _):
            return _usual(Camera())
        case ("environment",):
            is_picture = "image" in table or "sky" in table
            return {**_usual(Environment()), "color": [1.0, 1.0, 1.0] if is_picture else [0.0, 0.0, 0.0]}
        case ("environment", "sky"):
            return _usual(Sky())
        case ("render",):
            return _usual(RenderSettings())
        case ("materials", _):
            return _usual(Material())
        case ("lights",):
            own = _usual(Light("light", table.get("kind", "point")))
            own = {key: value for key, value in own.items() if key not in (*STRENGTHS, "name", "kind")}
            return {**own, **_usual_placement(table)}
        case ("objects",):
            return {**_usual_placement(table), "visible": True}
    return {}


def _usual(owner: Any) -> dict[str, Any]:
    values = {field.name: getattr(owner, field.name) for field in fields(owner)}
    return {k: _toml(v) for k, v in values.items() if isinstance(v, (bool, int, float, str, tuple))}


def _usual_placement(table: Mapping[str, Any]) -> dict[str, Any]:
    return {} if "matrix" in table else _placement(IDENTITY)


def _camera_tables(scene: Scene) -> dict[str, Any]:
    """The keys of the file that hold the cameras."""
    if list(scene.cameras) == [CAMERA_NAME]:
        return {"camera": _camera_table(scene.camera)}
    cameras = {name: _camera_table(camera) for name, camera in scene.cameras.items()}
    return {"active_camera": scene.camera_name, "cameras": cameras}


def _camera_table(camera: Camera) -> dict[str, Any]:
    plain = {name: _toml(getattr(camera, name)) for name in ("position", "target", "up", "fov_y")}
    return {**plain, **_changed(camera)}


def _environment_table(environment: Environment, beside: Beside) -> dict[str, Any]:
    table: dict[str, Any] = {"color": _toml(environment.color)}
    if environment.image is not None:
        table["image"] = beside.image(environment.image)
    for name in ("rotation_y", "intensity"):
        table[name] = getattr(environment, name)
    if environment.sky is not None:
        # What it looks like most by is said always.
        table["sky"] = {"sun_elevation": environment.sky.sun_elevation, **_changed(environment.sky)}
    return table


def _object_table(obj: Object, beside: Beside) -> dict[str, Any]:
    table: dict[str, Any] = {"name": obj.name, **beside.mesh(obj.mesh, obj.name), "material": obj.material}
    table |= _placement(obj.transform)
    if not obj.visible:
        table["visible"] = False
    return table


def _light_table(light: Light) -> dict[str, Any]:
    strength, value = light.strength
    table: dict[str, Any] = {"name": light.name, "kind": light.kind, **_placement(light.transform)}
    table |= {"color": _toml(light.color), strength: value}
    default = Light(light.name, light.kind)
    kept = (*table, *STRENGTHS, "transform")
    return table | {
        field.name: _toml(getattr(light, field.name))
        for field in fields(light)
        if field.name not in kept and getattr(light, field.name) != getattr(default, field.name)
    }


def _placement(transform: Transform) -> dict[str, Any]:
    names = ("position", "rotation", "scale") if transform.matrix is None else ("matrix",)
    return {name: _toml(getattr(transform, name)) for name in names}


def _material_table(material: Material, beside: Beside) -> dict[str, Any]:
    color = _toml(material.base_color)
    return {"base_color": color, **_changed(material), **_textures(material, beside)}


def _textures(material: Material, beside: Beside) -> dict[str, Any]:
    found = {texture_name(slot): texture_of(material, slot) for slot in TextureSlot}
    return {
        name: _toml(texture_value(texture, beside.bitmap))
        for name, texture in found.items()
        if texture is not None
    }


def _changed(owner: Any) -> dict[str, Any]:
    """The fields of a dataclass that differ from their defaults, as TOML has them, but for textures."""
    changed = {
        field.name: getattr(owner, field.name)
        for field in fields(owner)
        if field.default is MISSING or getattr(owner, field.name) != field.default
    }
    return {name: _toml(value) for name, value in changed.items() if not isinstance(value, Texture)}


def _toml(value: Any) -> Any:
    if isinstance(value, dict):
        # Tables in tables are written on one line, as people write them.
        import tomlkit

        table = tomlkit.inline_table()
        table.update({key: _toml(item) for key, item in value.items()})
        return table
    return [_toml(item) for item in value] if isinstance(value, tuple) else value
