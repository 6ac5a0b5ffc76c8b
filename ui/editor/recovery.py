"""Autosave: what a crash leaves behind, and finding it at the next start.

Every running editor that has something unsaved keeps one scene file of it in the user's state folder. The
file goes when the document is saved and when the editor ends; one whose editor is gone was left by a crash.

Whether an editor still runs is told by a lock on a file beside it, which the system gives back however the
process ends. A process id alone would not do: after a restart of the machine it may be somebody else's.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO

import platformdirs

from incpt.core import files
from incpt.core.errors import InputError, OutputError, one_line
from incpt.formats import registry, scene_save
from incpt.scene.model import Scene
from incpt.ui.editor.document import UNTITLED, Document, collected_warnings, scene_text
from incpt.ui.preferences import CONFIG_DIR

_ORIGINAL = "# original: "
"""How the first line of a recovery file begins; the path of the scene file follows as JSON."""
_LOCK = ".lock"
"""The suffix of the file whose lock tells that the editor runs."""


@dataclass(frozen=True)
class LeftBehind:
    """A recovery file whose editor is gone. `original` is the scene file that was edited, or None; `time`
    is when the recovery file was written, seconds since the epoch."""

    path: Path
    original: Path | None
    time: float

    @property
    def name(self) -> str:
        """What the scene was called."""
        return UNTITLED if self.original is None else self.original.name

    @property
    def saved_at(self) -> str:
        """The time as local text."""
        return datetime.fromtimestamp(self.time).strftime("%Y-%m-%d %H:%M")

    def open(self) -> Document:
        """The document as it was, unsaved, to be saved where it came from, with placeholders for files that
        are gone since. The file stays. Raises InputError."""
        with collected_warnings() as messages:
            scene = registry.load(self.path, allow_missing=True)
        text = None if self.original is None else scene_text(self.original)
        warnings = tuple(messages)
        return Document(scene, self.original, name=self.name, warnings=warnings, is_saved=False, text=text)

    def remove(self) -> None:
        """Removes the recovery file and what was written beside it: nobody wants it."""
        _remove(self.path)
        self.path.with_suffix(_LOCK).unlink(missing_ok=True)


class Recovery:
    """The recovery file of this editor. Nothing is made on disk before there is something to keep.

    `seconds` is the time between two writes. Times are those of any one clock, given by the caller.
    """

    def __init__(self, seconds: float, folder: Path | None = None) -> None:
        self.seconds = seconds
        self._folder = recovery_folder() if folder is None else folder
        self._path: Path | None = None
        self._lock: IO[bytes] | None = None
        self._kept: Scene | None = None
        self._due: float | None = None

    @property
    def path(self) -> Path | None:
        """The recovery file, or None while there is nothing to recover."""
        return self._path if self._kept is not None else None

    def update(self, document: Document, now: float) -> bool:
        """Once a frame: writes the scene when it is due; returns whether it was written.

        It is due when the document is dirty, differs from what is kept and `seconds` went by since it
        became dirty, was written, or failed to be. A drag under way waits for its end. When the document
        is clean the recovery file goes. Raises OutputError where it cannot be written, InputError for a
        scene that no file can hold; the next try is `seconds` later.
        """
        if not document.is_dirty:
            self.clear()
            return False
        if self._due is None:
            self._due = now + self.seconds
        is_dragging = document.history.before is not None
        if now < self._due or is_dragging or document.scene is self._kept:
            return False
        self._due = now + self.seconds
        self.write(document.scene, document.path)
        return True

    def write(self, scene: Scene, original: Path | None) -> None:
        """Keeps a scene now. Paths in it lead from the recovery folder to the meshes and images, so that
        it can be read where it lies. Raises OutputError and InputError."""
        path = self._claim()
        scene_save.save(scene, path)
        note = _ORIGINAL + json.dumps(None if original is None else str(original)) + "\n"
        files.write_bytes(path, note.encode() + files.read_bytes(path))
        self._kept = scene

    def clear(self) -> None:
        """Removes the recovery file: there is nothing unsaved any more."""
        self._due = None
        if self._path is not None and self._kept is not None:
            _remove(self._path)
        self._kept = None

    def remove(self) -> None:
        """At the end of the editor: removes every trace of it."""
        self.clear()
        if self._lock is not None and self._path is not None:
            self._lock.close()
            self._path.with_suffix(_LOCK).unlink(missing_ok=True)
        self._lock = self._path = None

    def recover(self, left: LeftBehind) -> Document:
        """Opens what a crash left behind, and keeps it under this editor's own name before the old file
        goes: another crash loses nothing. Raises InputError and OutputError; then the old file stays."""
        document = left.open()
        self.write(document.scene, document.path)
        left.remove()
        return document

    def _claim(self) -> Path:
        """The path of this editor's recovery file, locked before the file is there."""
        if self._path is None:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                descriptor, name = tempfile.mkstemp(_LOCK, f"{os.getpid()}-", self._folder)
                self._lock = os.fdopen(descriptor, "wb")
            except OSError as error:
                raise OutputError(
                    one_line(f"{self._folder}: cannot be written ({error.strerror}); nothing is autosaved")
                ) from None
            _try_lock(self._lock)
            self._path = Path(name).with_suffix(".toml")
        return self._path


def recovery_folder() -> Path:
    """Where recovery files are kept; it need not exist. It lies in the folder that
    INCPT_CONFIG_DIR names, where that is set."""
    chosen = os.environ.get(CONFIG_DIR)
    base = Path(chosen) if chosen else Path(platformdirs.user_state_dir("incpt", appauthor=False))
    return base / "recovery"


def find_left_behind(folder: Path | None = None) -> list[LeftBehind]:
    """The recovery files whose editor is gone, the latest first. Files that cannot be looked at are left
    out, and locks of editors that ended without something to recover are removed, as is what was left half
    written."""
    folder = recovery_folder() if folder is None else folder
    files.clear_left_behind(folder)
    found = []
    try:
        locks = sorted(folder.glob(f"*{_LOCK}"))
    except OSError:
        return []
    for lock in locks:
        path = lock.with_suffix(".toml")
        try:
            if _is_locked(lock):
                continue
            if path.exists():
                found.append(LeftBehind(path, _original(path), path.stat().st_mtime))
            else:
                lock.unlink(missing_ok=True)
        except (OSError, InputError):
            continue
    return sorted(found, key=lambda left: left.time, reverse=True)


def _remove(path: Path) -> None:
    """The file, and the meshes and images beside it that carry its name."""
    for beside in path.parent.glob(f"{path.stem}.*"):
        if beside.suffix != _LOCK:
            beside.unlink(missing_ok=True)


def _original(path: Path) -> Path | None:
    first = files.read_bytes(path).split(b"\n", 1)[0].decode(errors="replace")
    try:
        original = json.loads(first.removeprefix(_ORIGINAL))
    except ValueError:
        return None
    return Path(original) if isinstance(original, str) else None


def _is_locked(lock: Path) -> bool:
    with lock.open("r+b") as stream:
        return not _try_lock(stream)


if sys.platform == "win32":
    import msvcrt

    def _try_lock(stream: IO[bytes]) -> bool:
        """Locks a file until it is closed; False if another has it locked."""
        try:
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _try_lock(stream: IO[bytes]) -> bool:
        """Locks a file until it is closed; False if another has it locked."""
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
