"""Which files can be read, and by what: one row for each suffix.

To read another format, write its reader and add a row. Readers are named and not imported here, so that the
libraries behind them (trimesh alone takes half a second) are loaded when the first file of their kind is
read.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import NoneType
from typing import Any

from incpt.core.checks import path_of, require
from incpt.core.errors import InputError, InputWarning, in_place
from incpt.core.files import check_readable
from incpt.formats import import_report
from incpt.formats.import_options import ImportOptions, reading_with
from incpt.formats.import_report import Fate, ImportReport
from incpt.scene.model import Scene
from incpt.scene.summary import scene_problems


class FileKind(Enum):
    """What a file holds, and so what reading it gives: a Scene, a MeshFile, or an Image."""

    SCENE = "scene"
    MESH = "mesh"
    IMAGE = "image"


@dataclass(frozen=True)
class Format:
    """A row: files with `suffix` (lower case, with its dot) hold that `kind` of thing.

    `reader` is the module in this folder and the function in it that takes the path of a readable file and
    returns what the kind says; what it raises as InputError does not name the file, which `read` does.
    `needs` are modules that the reader uses and an installation may lack, and `package` is what brings them.
    `says_units`: such files say where up is and what their unit is.
    """

    suffix: str
    kind: FileKind
    reader: tuple[str, str]
    needs: tuple[str, ...] = ()
    package: str = ""
    says_units: bool = False

    @property
    def is_available(self) -> bool:
        """Whether everything that the reader needs is installed."""
        return all(find_spec(name) is not None for name in self.needs)

    def read(self, path: Path) -> Any:
        """What the file holds, see FileKind; what became of the rest is told, see `import_report`. Raises
        InputError."""
        module, function = self.reader
        with in_place(str(path)), import_report.in_file(str(path)):
            return getattr(import_module(f"incpt.formats.{module}"), function)(path)


OPENEXR = Format(".exr", FileKind.IMAGE, ("images", "read_exr"))
_OTHER_IMAGES = (".hdr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
_GLTF = ("gltf.reader", "read_gltf")
_USD = ("usd.reader", "read_usd")
_TRIMESH = ("trimesh_adapter", "read_with_trimesh")
FORMATS = (
    Format(".toml", FileKind.SCENE, ("scene_toml", "load_scene_toml")),
    Format(".xml", FileKind.SCENE, ("mitsuba.reader", "read_mitsuba")),
    Format(".pbrt", FileKind.SCENE, ("pbrt.reader", "read_pbrt")),
    OPENEXR,
    *(Format(suffix, FileKind.IMAGE, ("images", "read_other")) for suffix in _OTHER_IMAGES),
    Format(".glb", FileKind.MESH, _GLTF, says_units=True),
    Format(".gltf", FileKind.MESH, _GLTF, says_units=True),
    Format(".obj", FileKind.MESH, ("obj.reader", "read_obj")),
    Format(".off", FileKind.MESH, ("off", "read_off")),
    Format(".ply", FileKind.MESH, ("ply.reader", "read_ply")),
    Format(".stl", FileKind.MESH, ("stl", "read_stl")),
    Format(".3mf", FileKind.MESH, ("threemf.reader", "read_3mf"), says_units=True),
    Format(".dae", FileKind.MESH, _TRIMESH, needs=("collada",), package="pycollada"),
    *(
        Format(suffix, FileKind.MESH, _USD, needs=("pxr",), package="incpt[usd]", says_units=True)
        for suffix in (".usd", ".usda", ".usdc", ".usdz")
    ),
    Format(".npz", FileKind.MESH, ("mesh_store", "read_stored"), says_units=True),
)
"""All formats, in the order in which messages list them."""


def suffixes(kind: FileKind) -> tuple[str, ...]:
    """Suffixes, with their dot, of the files of a kind that can be read here."""
    return tuple(row.suffix for row in FORMATS if row.kind is kind and row.is_available)


def listed(kind: FileKind) -> str:
    """These suffixes as a list for a message."""
    return ", ".join(suffixes(kind))


def format_of(path: str | os.PathLike[str], *kinds: FileKind) -> Format | None:
    """The format of a file by its suffix, if it is of one of these kinds and can be read here."""
    suffix = Path(path).suffix.lower()
    rows = (row for row in FORMATS if row.suffix == suffix and row.kind in kinds and row.is_available)
    return next(rows, None)


def lacking(path: Path) -> str:
    """What a file cannot be read without, as the end of a message; nothing where that is not it."""
    rows = (row for row in FORMATS if row.suffix == path.suffix.lower() and not row.is_available)
    return next((f' without a library; run: pip install "{row.package}"' for row in rows), "")


def load(
    path: str | os.PathLike[str],
    *,
    time: float | None = None,
    allow_outside: bool = False,
    up: str | None = None,
    unit: float | None = None,
    allow_missing: bool = False,
    clip: str | None = None,
    parameters: Mapping[str, str] | None = None,
) -> Scene:
    """A scene from a scene file (.toml, .xml of Mitsuba, .pbrt), or a default scene around a mesh file.

    `time`: seconds into the animations of its files; None leaves them out. `allow_outside`: files may
    name others outside their own folders. `up` ("y" or "z") and `unit` (metres) say how a mesh file is meant
    whose format does not say it (OBJ, PLY, STL ...). `allow_missing`: cubes and single colours stand for
    meshes and images of a scene file that cannot be read. `clip`: of several animations of a glTF file the
    name of the one that runs; None: all do at once. `parameters`: values of parameters of a Mitsuba scene
    (`<default>`), by their names. InputWarnings tell of all that was left out, and of a scene that shows
    nothing. Raises InputError, one line that names file, table and key.
    """
    scene, report = load_with_report(
        path,
        time=time,
        allow_outside=allow_outside,
        up=up,
        unit=unit,
        allow_missing=allow_missing,
        clip=clip,
        parameters=parameters,
    )
    for complaint in complaints(path, scene, report):
        warnings.warn(complaint, InputWarning, stacklevel=2)
    return scene


def complaints(path: str | os.PathLike[str], scene: Scene, report: ImportReport) -> list[str]:
    """What a user has to know of a scene that was read: what was left out of it, and what makes its picture
    empty or black; a line each."""
    lost = [str(remark) for remark in report.of(Fate.LEFT_OUT)]
    return lost + [f"{os.fspath(path)}: {problem}" for problem in scene_problems(scene)]


def load_with_report(
    path: str | os.PathLike[str],
    *,
    time: float | None = None,
    allow_outside: bool = False,
    up: str | None = None,
    unit: float | None = None,
    allow_missing: bool = False,
    clip: str | None = None,
    parameters: Mapping[str, str] | None = None,
) -> tuple[Scene, ImportReport]:
    """A scene as `load` gives it, and what became of its files: nothing is warned of. Raises InputError."""
    path = path_of("path", path)
    require("parameters", parameters, (Mapping, NoneType), 'a mapping, such as {"spp": "64"}')
    given = tuple(sorted((parameters or {}).items()))
    options = ImportOptions(time, allow_outside, up, unit, clip, given, allow_missing=allow_missing)
    check_readable(path)
    row = format_of(path, FileKind.SCENE, FileKind.MESH)
    if row is None and (what := lacking(path)):
        raise InputError(f"{path}: files of this type cannot be read{what}")
    if row is None:
        raise InputError(
            f"{path}: files of this type cannot be read; use a scene ({listed(FileKind.SCENE)}) "
            f"or a mesh ({listed(FileKind.MESH)})"
        )
    with import_report.gathered() as found, reading_with(options):
        if row.kind is FileKind.SCENE:
            if (up, unit) != (None, None):
                name = "unit" if up is None else "up"
                raise InputError(
                    f"{name}: {path} is a scene, whose y is up and whose unit is the metre; leave it out"
                )
            scene: Scene = row.read(path)
        else:
            # It reads meshes by the table above.
            from incpt.formats.mesh_scene import scene_around

            scene = scene_around(path)
    return scene, found.report
