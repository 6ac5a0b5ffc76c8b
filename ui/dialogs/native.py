"""The system's own dialog for files."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import NamedTuple

from imgui_bundle import portable_file_dialogs

_PROGRAMS = ("zenity", "kdialog", "matedialog", "qarma")
"""Programs that show the dialog on Linux."""


class FileFilter(NamedTuple):
    """Files that a dialog asks for: what they are called, and the suffixes that they have, with their dot."""

    name: str
    suffixes: tuple[str, ...]


def is_there() -> bool:
    """Whether the system has such a dialog."""
    # On Linux portable-file-dialogs runs one of these programs, and waits forever where there is none.
    return not sys.platform.startswith("linux") or any(map(shutil.which, _PROGRAMS))


class NativeDialog:
    """The system's dialog, from the moment when it is made until it is answered."""

    def __init__(self, title: str, kind: FileFilter, is_saving: bool, folder: Path) -> None:
        filters = [kind.name, " ".join(f"*{suffix}" for suffix in kind.suffixes)]
        ask = portable_file_dialogs.save_file if is_saving else portable_file_dialogs.open_file
        self._asked = ask(title, f"{folder}/", filters)

    @property
    def is_answered(self) -> bool:
        return self._asked.ready(0)

    @property
    def path(self) -> Path | None:
        """The file that was chosen; None where the dialog was cancelled."""
        result = self._asked.result()
        answer = result if isinstance(result, str) else next(iter(result), "")
        return Path(answer) if answer else None
