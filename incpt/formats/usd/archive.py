"""The files in a .usdz archive, which are stored as they are."""

from __future__ import annotations

import zipfile
from pathlib import Path

from incpt.core.errors import InputError, reason_of

SUFFIX = ".usdz"


def names_in(path: Path) -> list[str]:
    """Of all files of an archive, in their order. Raises InputError."""
    with _opened(path) as archive:
        return archive.namelist()


def image_in(path: Path, number: int) -> tuple[bytes, str]:
    """The content of a file of an archive, by its number, and its suffix. Raises InputError."""
    with _opened(path) as archive:
        entries = archive.infolist()
        if number >= len(entries):
            raise InputError(f"image: {number} is not in the file, which has {len(entries)}")
        entry = entries[number]
        # Compressed ones, which the format does not allow, could grow without bounds.
        if entry.compress_type != zipfile.ZIP_STORED or entry.file_size > path.stat().st_size:
            raise InputError(f"{entry.filename[:80]!r} is compressed; make the archive anew with usdzip")
        try:
            return archive.read(entry), Path(entry.filename).suffix
        except (zipfile.BadZipFile, OSError, RuntimeError, NotImplementedError) as error:
            raise InputError(f"{entry.filename[:80]!r} is damaged ({reason_of(error)})") from None


def _opened(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise InputError(f"is no archive, or a damaged one ({reason_of(error)})") from None
