"""A scene with everything that it needs in one folder, or in one archive, to be handed to somebody else."""

from __future__ import annotations

import os
import shutil
import tempfile
import zipfile
from pathlib import Path
from typing import Any

from incpt.core.checks import path_of, require
from incpt.core.errors import InputError, OutputError
from incpt.core.files import write_atomically
from incpt.formats import bitmaps, images, mesh_store
from incpt.formats.names import Names
from incpt.formats.relink import check_nothing_missing
from incpt.formats.scene_save import (
    Beside,
    file_label,
    is_stored_bitmap,
    is_stored_image,
    write_scene,
)
from incpt.scene.image import Image
from incpt.scene.mesh import Mesh
from incpt.scene.model import Scene
from incpt.scene.texture import Bitmap

SCENE_NAME = "scene.toml"
_OLDEST = (1980, 1, 1, 0, 0, 0)
"""The date of files in archives, so that the same scene gives the same archive."""


def pack(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Writes `scene.toml`, and below `meshes` and `textures` all that it names, into a new or empty folder;
    with a `path` that ends in .zip, into an archive. Nothing outside is needed to load an equal scene.

    Meshes are stored as they are in memory (.npz), images as the files that they came from, or exactly as
    .png or .exr. Raises OutputError where a file cannot be written (then nothing is left behind), InputError
    for a folder that has something in it, and for a scene that no file can hold.
    """
    require("scene", scene, Scene, "a Scene")
    check_nothing_missing(scene)
    path = path_of("path", path)
    if path.suffix.lower() == ".zip":
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made) / path.stem
            _fill(scene, folder)
            write_atomically(path, lambda temporary: _archive(folder, temporary))
        return
    was_there = path.is_dir()
    if was_there and any(path.iterdir()):
        raise InputError(f"{path}: has something in it; name a new folder")
    try:
        _fill(scene, path)
    except BaseException:
        _remove(path, was_there)
        raise


def _fill(scene: Scene, folder: Path) -> None:
    """Writes a scene into a folder, which need not be there."""
    try:
        for one in (folder, folder / "meshes", folder / "textures"):
            one.mkdir(exist_ok=True)
        write_scene(scene, folder / SCENE_NAME, _Inside(folder))
        for one in (folder / "meshes", folder / "textures"):
            if not any(one.iterdir()):
                one.rmdir()
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from None


def _remove(folder: Path, was_there: bool) -> None:
    """Removes what was written into a folder, and the folder where it is new."""
    for name in ("meshes", "textures"):
        shutil.rmtree(folder / name, ignore_errors=True)
    if not was_there and folder.is_dir():
        folder.rmdir()


def _archive(folder: Path, path: Path) -> None:
    """Puts a folder into an archive, under its own name."""
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(one for one in folder.rglob("*") if one.is_file()):
            entry = zipfile.ZipInfo(file.relative_to(folder.parent).as_posix(), _OLDEST)
            # Of the others all that is large is compressed already.
            entry.compress_type = zipfile.ZIP_DEFLATED if file.suffix == ".toml" else zipfile.ZIP_STORED
            with file.open("rb") as stream, archive.open(entry, "w") as stored:
                shutil.copyfileobj(stream, stored)


class _Inside(Beside):
    """Files of a scene that are all in its folder."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / SCENE_NAME)
        self._labels = Names()

    def _mesh(self, mesh: Mesh, name: str) -> dict[str, str]:
        place = self._place("meshes", name, "mesh", mesh_store.STORED_SUFFIX)
        mesh_store.store_mesh(self.folder / place, mesh)
        return {"mesh": place}

    def image(self, image: Image) -> str:
        """The name of an image's file."""
        if image.source is not None and is_stored_image(image):
            return self._copied(image.source, "environment")
        place = self._place("textures", "environment", "environment", ".exr")
        images.write_exr(self.folder / place, {"RGB": image.pixels})
        return place

    def _bitmap(self, bitmap: Bitmap) -> dict[str, Any]:
        source = bitmap.source
        if source.file is not None and source.index is None and is_stored_bitmap(bitmap):
            return {"file": self._copied(source.file, "texture")}
        name = "texture" if source.file is None else f"{Path(source.file).stem} {source.index}"
        place = self._place("textures", name, "texture", bitmaps.suffix_of(bitmap))
        bitmaps.write_bitmap(self.folder / place, bitmap)
        return {"file": place}

    def _copied(self, file: str, default: str) -> str:
        suffix = Path(file).suffix
        place = self._place("textures", Path(file).stem, default, suffix)
        write_atomically(self.folder / place, lambda temporary: shutil.copyfile(file, temporary))
        return place

    def _place(self, folder: str, name: str, default: str, suffix: str) -> str:
        """A new name, also where capital and small letters are the same."""
        return self._labels.new(f"{folder}/{file_label(name, default).lower()}") + suffix.lower()
