"""Reading and writing files so that nothing is half-written and every failure is one line."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path

from incpt.core.errors import InputError, OutputError, one_line


def check_readable(path: Path) -> os.stat_result:
    """Status of a regular, readable file that is not empty. Raises InputError: pipes and devices, which
    could block or never end, folders, and files that are missing, empty or forbidden."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise InputError(f"{path}: cannot be read ({_reason(error)})") from None
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path}: is a folder; name a file in it")
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: is not a regular file")
    if status.st_size == 0:
        raise InputError(f"{path}: is empty")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path}: cannot be read (permission denied)")
    return status


def read_bytes(path: Path) -> bytes:
    """All of a file that `check_readable` accepts. Raises InputError."""
    check_readable(path)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({_reason(error)})") from None


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Calls `write` with a new file beside `path`, flushes it to disk and renames it to `path`.

    Whoever reads `path` sees the old file or the whole new one. On any failure the new file is
    removed. Raises OutputError where the system refuses: full disk, folder missing or not writable.
    """
    temporary: Path | None = None
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; name a file in it")
        # Readable by others, as an ordinary new file is, not private as mkstemp makes it.
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name[:80]}.", suffix=path.suffix, dir=path.parent)
        os.close(descriptor)
        temporary = Path(name)
        write(temporary)
        os.chmod(temporary, 0o666 & ~_umask())
        with open(temporary, "rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(temporary, path)
        temporary = None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise OutputError(f"{path}: cannot be written ({_reason(error)})") from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Writes `content` atomically. Raises OutputError."""
    write_atomically(path, lambda temporary: temporary.write_bytes(content))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return one_line(text[:1].lower() + text[1:])
