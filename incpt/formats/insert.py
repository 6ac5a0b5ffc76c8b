"""Puts files into a scene: meshes as objects, an image as the environment."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from incpt.core.affine import Vector
from incpt.core.errors import InputError
from incpt.formats import images, import_report, mesh_files, registry
from incpt.formats.registry import FileKind
from incpt.scene import edits
from incpt.scene.edits import Names
from incpt.scene.environment import Environment
from incpt.scene.model import Scene

PANORAMAS = (".exr", ".hdr")
"""Images with light in them, of which one that is dropped on the window is meant as environment."""


def add_mesh(
    scene: Scene, path: str | os.PathLike[str], at: Vector | None = None, material: str | None = None
) -> tuple[Scene, Names]:
    """The scene with all meshes of a file, and the new names; see `edits.add_parts`. What is left out of the
    file is told by InputWarnings, also its lights and cameras. Raises InputError."""
    file = mesh_files.load_file(path)
    with import_report.in_file(str(path)):
        for what, count in (
            ("lights", len(file.lights)),
            ("cameras", len(file.cameras)),
            ("environment", int(file.environment is not None)),
        ):
            if count:
                import_report.left_out(f"{count} {what}: open the file by itself to have them")
    return edits.add_parts(scene, file.parts, Path(path).stem, at, material)


def file_kind(path: str | os.PathLike[str]) -> FileKind:
    """What a file that is dropped on the window is taken for, by its suffix. Raises InputError for a type
    that has no use here."""
    row = registry.format_of(path, *FileKind)
    if row is None:
        scenes, images_, meshes = (
            registry.listed(k) for k in (FileKind.SCENE, FileKind.IMAGE, FileKind.MESH)
        )
        raise InputError(
            f"{path}: files of this type cannot be used; drop a scene ({scenes}), an environment ({images_}) "
            f"or a mesh ({meshes})"
        )
    return row.kind


def drop_file(scene: Scene, path: str | os.PathLike[str]) -> tuple[Scene, Names]:
    """The scene with a mesh added or with another environment image; the names of new objects. Raises
    InputError, also for a scene file: that is to be opened in place of this scene (see `file_kind`)."""
    kind = file_kind(path)
    if kind is FileKind.MESH:
        return add_mesh(scene, path)
    if kind is FileKind.IMAGE:
        if Path(path).suffix.lower() not in PANORAMAS:
            raise InputError(
                f"{path}: drop an image on the row of a texture in the Object panel, or choose it as "
                "environment in the Scene panel"
            )
        return set_environment_image(scene, path), ()
    raise InputError(f"{path}: is a scene; open it in place of this one")


def set_environment_image(scene: Scene, path: str | os.PathLike[str]) -> Scene:
    """The scene lit by an image at its own radiance. Raises InputError."""
    image = images.load_image(path)
    old = scene.environment
    # A colour that stood alone was a radiance. Beside an image it would tint the image, or hide it by black.
    color = old.color if old.image is not None and any(old.color) else (1.0, 1.0, 1.0)
    intensity = old.intensity if old.image is not None and old.intensity > 0 else 1.0
    return replace(scene, environment=Environment(color, image, old.rotation_y, intensity))
