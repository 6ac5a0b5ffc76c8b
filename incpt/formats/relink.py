"""Files of a scene that could not be read, for which placeholders stand, and other files in their place."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from incpt.core.errors import InputError
from incpt.core.layout import TextureSlot
from incpt.formats import bitmaps, images
from incpt.formats.mesh_library import MeshLibrary
from incpt.scene.edits import unique_name
from incpt.scene.material import Material, texture_name, texture_of
from incpt.scene.model import Object, Scene
from incpt.scene.texture import Texture


@dataclass(frozen=True)
class MissingFile:
    """A file for which placeholders stand. `kind` is "mesh", "texture" or "environment"; `users` are the
    names of the objects, or of the materials, that have it."""

    path: Path
    kind: str
    users: tuple[str, ...] = ()


def missing_files(scene: Scene) -> tuple[MissingFile, ...]:
    """The files of a scene that could not be read, in its order: meshes, textures, the environment."""
    users: dict[tuple[str, str], dict[str, None]] = {}
    for obj in scene.objects:
        if obj.mesh.is_placeholder and obj.mesh.source.file is not None:
            users.setdefault((obj.mesh.source.file, "mesh"), {})[obj.name] = None
    for name, material in scene.materials.items():
        for _, texture in _placeholders(material):
            users.setdefault((str(texture.bitmap.source.file), "texture"), {})[name] = None
    image = scene.environment.image
    if image is not None and image.is_placeholder and image.source is not None:
        users.setdefault((image.source, "environment"), {})
    return tuple(MissingFile(Path(file), kind, tuple(names)) for (file, kind), names in users.items())


def check_nothing_missing(scene: Scene) -> None:
    """Raises InputError, one line, where placeholders would be handed over as if they were the scene."""
    missing = missing_files(scene)
    if missing:
        others = f" and {len(missing) - 1:,} more" if len(missing) > 1 else ""
        raise InputError(f"scene: {missing[0].path}{others}: cannot be read; find what is missing first")


def relinked(scene: Scene, missing: Path, found: Path) -> Scene:
    """The scene with the file `found` in place of `missing`, and in place of all others that are missing what
    is found beside it: under the same name in its folder, or at the place where it was beside `missing`.

    An object becomes several where its mesh file holds several meshes, as when the scene is opened. Raises
    InputError where `found` cannot be read; others that cannot be stay missing.
    """
    scene = _with_file(scene, missing, found)
    for other in missing_files(scene):
        for candidate in _beside(other.path, missing, found):
            try:
                scene = _with_file(scene, other.path, candidate)
                break
            except InputError:
                continue
    return scene


def _beside(path: Path, missing: Path, found: Path) -> Iterator[Path]:
    """Where a file may be that was lost together with `missing`, which is at `found` now."""
    if path == missing:
        return
    places = [found.parent / path.name]
    with suppress(ValueError):  # No relative path leads to another drive.
        places.insert(0, Path(os.path.normpath(found.parent / os.path.relpath(path, missing.parent))))
    yield from (place for place in places if place.is_file())


def _with_file(scene: Scene, missing: Path, found: Path) -> Scene:
    """The scene with `found` in place of `missing` everywhere. Raises InputError."""
    changes: dict[str, Any] = {
        "objects": tuple(_objects(scene, missing, found)),
        "materials": {
            name: _material(material, missing, found) for name, material in scene.materials.items()
        },
    }
    image = scene.environment.image
    if image is not None and image.is_placeholder and image.source == str(missing):
        changes["environment"] = replace(scene.environment, image=images.load_image(found))
    return replace(scene, **changes)


def _objects(scene: Scene, missing: Path, found: Path) -> Iterator[Object]:
    library, taken = MeshLibrary(found.parent), set(scene.names)
    for obj in scene.objects:
        source = obj.mesh.source
        if not obj.mesh.is_placeholder or source.file != str(missing):
            yield obj
            continue
        choice = {"part": source.part, "geometry": source.geometry}
        table = {"mesh": found.name, **{key: name for key, name in choice.items() if name is not None}}
        meshes = library.meshes(table)
        for part, mesh in meshes:
            name = obj.name if len(meshes) == 1 else unique_name(f"{obj.name}/{part}", taken)
            taken.add(name)
            yield replace(obj, name=name, mesh=mesh)


def _material(material: Material, missing: Path, found: Path) -> Material:
    textures: dict[str, Any] = {
        texture_name(slot): replace(texture, bitmap=bitmaps.load_bitmap(found, texture.bitmap.source.index))
        for slot, texture in _placeholders(material)
        if texture.bitmap.source.file == str(missing)
    }
    return replace(material, **textures) if textures else material


def _placeholders(material: Material) -> Iterator[tuple[TextureSlot, Texture]]:
    for slot in TextureSlot:
        texture = texture_of(material, slot)
        if texture is not None and texture.bitmap.is_placeholder and texture.bitmap.source.file is not None:
            yield slot, texture
