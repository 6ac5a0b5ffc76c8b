"""The parts of a 3MF file, which is a ZIP archive after the Open Packaging Conventions.

How much an archive gives is bounded by its own size, so that a small file cannot fill the memory.
"""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from incpt.core.checks import described
from incpt.core.errors import InputError, reason_of
from incpt.formats.threemf.markup import read_elements

MOST_GROWTH = 50
"""How many times its size an archive may have when it is unpacked; meshes as text grow about ten times."""
_ALLOWANCE = 1 << 20
_PIECE = 1 << 20
_RELATIONSHIPS = "_rels/.rels"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"


class Package:
    """An archive that is open. All methods raise InputError."""

    def __init__(self, path: Path) -> None:
        self._left = _ALLOWANCE + MOST_GROWTH * path.stat().st_size
        # An archive leaves its file open as long as anybody may read on in one of its parts.
        self._file = path.open("rb")
        try:
            self._archive = zipfile.ZipFile(self._file)
        except Exception as error:  # zipfile raises errors of many types for damaged files.
            self._file.close()
            raise InputError(f"is no 3MF file, or a damaged one ({reason_of(error)})") from None

    def __enter__(self) -> Package:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._archive.close()
        self._file.close()

    def pieces(self, name: str) -> Iterator[bytes]:
        """What a part holds, piece by piece. `name` begins with a slash, as those of parts do."""
        try:
            entry = self._archive.getinfo(name.lstrip("/"))
        except KeyError:
            raise InputError(f"{described(name)} is not in the archive; the file is damaged") from None
        if entry.file_size > self._left:
            raise InputError(f"{described(name)} is too large for its archive; the file is damaged")
        self._left -= entry.file_size
        try:
            with self._archive.open(entry) as stream:
                while piece := stream.read(_PIECE):
                    yield piece
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{described(name)} cannot be read ({reason_of(error)})") from None

    def content(self, name: str) -> bytes:
        """The whole of a part."""
        return b"".join(self.pieces(name))

    def model(self) -> str:
        """The name of the part that holds the model."""
        targets: list[str] = []

        def take(name: str, given: dict[str, str]) -> None:
            if given.get("Type") == _MODEL and "Target" in given:
                targets.append(posixpath.join("/", given["Target"]))

        read_elements(self.pieces(_RELATIONSHIPS), _RELATIONSHIPS, take)
        if not targets:
            raise InputError("names no model; it is no 3MF file, or a damaged one")
        return targets[0]
