"""What is edited: the scene with its history, and the file that it came from or goes to."""

from __future__ import annotations

import importlib.resources
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from incpt.core import files
from incpt.core.errors import InputError, InputWarning, one_line
from incpt.formats import registry, scene_save
from incpt.formats.import_report import NOTHING_TOLD, ImportReport
from incpt.scene.camera import Camera
from incpt.scene.environment import Environment
from incpt.scene.history import History
from incpt.scene.material import Material
from incpt.scene.model import Object, Scene
from incpt.scene.shapes import shape

SUFFIX = ".toml"
"""The suffix of a scene file."""
UNTITLED = "untitled"
"""What a document without a file is called."""


class Document:
    """A scene under edit. `path` is its scene file, or None while it has none; `warnings` are what came up
    while it was read, a line each, and `report` is what became of its files; `first_scene` is what it began
    with. `text` is that of the scene file, whose comments are kept when it is saved."""

    def __init__(
        self,
        scene: Scene,
        path: Path | None = None,
        *,
        name: str = UNTITLED,
        warnings: tuple[str, ...] = (),
        report: ImportReport = NOTHING_TOLD,
        is_saved: bool = True,
        text: str | None = None,
    ) -> None:
        self.history = History(scene)
        self.path = path
        self.warnings = warnings
        self.report = report
        self.first_scene = scene
        self._name = name
        self._text = text
        self._saved: Scene | None = scene if is_saved else None

    @classmethod
    def new(cls) -> Document:
        """A document around `new_scene`, without a file."""
        return cls(new_scene())

    @classmethod
    def example(cls) -> Document:
        """What `incpt` opens without a file: an untitled copy of the shipped scenes/editing.toml.

        A copy, so that Save asks for a place: the shipped file lies among the program's own, which an
        update replaces and which may be read-only. Raises InputError where the file is missing.
        """
        resource = importlib.resources.files("incpt.scenes") / "editing.toml"
        with importlib.resources.as_file(resource) as path, collected_warnings() as messages:
            scene = registry.load(path)
        return cls(scene, warnings=tuple(messages))

    @classmethod
    def open(cls, file: str | os.PathLike[str], **options: Any) -> Document:
        """A document from a scene file, or an untitled one of a file that is not saved to: a mesh, or a scene
        of another renderer. `options` are those of `registry.load_with_report`; placeholders stand for meshes
        and images of a scene file that cannot be read. Raises InputError."""
        absolute = absolute_path(file)
        files.clear_left_behind(absolute.parent, absolute.stem)
        scene, report = registry.load_with_report(absolute, allow_missing=True, **options)
        warnings = tuple(map(one_line, registry.complaints(absolute, scene, report)))
        is_scene = absolute.suffix.lower() == SUFFIX
        name = absolute.name if is_scene else absolute.stem
        text = scene_text(absolute) if is_scene else None
        path = absolute if is_scene else None
        return cls(scene, path, name=name, warnings=warnings, report=report, text=text)

    @property
    def scene(self) -> Scene:
        """The scene as it is edited now."""
        return self.history.scene

    @property
    def is_dirty(self) -> bool:
        """Whether the scene differs from the one saved or opened; undoing back to that makes it clean."""
        return self._saved is None or (self.scene is not self._saved and self.scene != self._saved)

    @property
    def name(self) -> str:
        """The file's name, or what stands for it."""
        return self.path.name if self.path is not None else self._name

    @property
    def title(self) -> str:
        """What the window's title says: the name, and whether there is something to save."""
        return f"{self.name} (edited)" if self.is_dirty else self.name

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the scene to a scene file, atomically; it is the document's own from then on. Returns its
        absolute path.

        Comments of the scene file that it came from stay. ".toml" is added to a name without a suffix. A mesh
        or image that exists only in memory is written beside it. Raises InputError (another suffix, a scene
        that no file can hold) and OutputError (the system refuses); then file and dirty mark stay as they
        were.
        """
        self.history.settle()
        absolute = scene_path(path)
        scene = self.scene
        scene_save.save(scene, absolute, template=self._text)
        self.path = absolute
        self._saved = scene
        self._text = scene_text(absolute)
        return absolute


def new_scene() -> Scene:
    """A cube on a floor under an even sky, seen from the front right: something to begin with."""
    return Scene(
        camera=Camera((3.0, 2.2, 4.5), (0.0, 0.5, 0.0), fov_y=35.0),
        environment=Environment((0.9, 0.95, 1.0), intensity=0.8),
        materials={
            "floor": Material((0.5, 0.5, 0.5), roughness=0.8),
            "orange": Material((0.8, 0.3, 0.06), roughness=0.5),
        },
        objects=(
            Object("floor", shape("plane"), "floor", scale=(10.0, 1.0, 10.0)),
            Object("cube", shape("cube"), "orange", position=(0.0, 0.5, 0.0), rotation=(0.0, 20.0, 0.0)),
        ),
    )


def scene_text(path: Path) -> str | None:
    """The text of a scene file; None where there is none that can be read."""
    try:
        return path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return None


def scene_path(path: str | os.PathLike[str]) -> Path:
    """The absolute path of a scene file to write: ".toml" is added where there is no suffix. Raises
    InputError for another suffix or an empty name."""
    if not os.fspath(path).strip():
        raise InputError("path: is empty; name a file")
    absolute = absolute_path(path)
    if not absolute.suffix:
        return absolute.with_name(absolute.name + SUFFIX)
    if absolute.suffix.lower() != SUFFIX:
        raise InputError(f"{absolute}: a scene is saved as TOML; end its name with {SUFFIX}")
    return absolute


def absolute_path(path: str | os.PathLike[str]) -> Path:
    """A path as typed, with ~ for the home folder, made absolute. Raises InputError."""
    try:
        return Path(os.path.abspath(Path(path).expanduser()))
    except (RuntimeError, ValueError) as error:
        raise InputError(one_line(f"{path}: is no usable path ({error})")) from None


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Gathers the InputWarnings of what runs inside as lines of text; others are passed on afterwards."""
    messages: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        yield messages
    for warning in caught:
        if issubclass(warning.category, InputWarning):
            messages.append(one_line(warning.message))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
