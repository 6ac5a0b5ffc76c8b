"""Reading and writing files so that nothing is half-written and every failure is one line."""

from __future__ import annotations

import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from incpt.core.errors import InputError, OutputError, one_line

_LONGEST_NAME = 80
"""Characters of a file's name that its temporary file has."""
_WRITER = re.compile(r"\.(\d+)-\w{8}(\.\w+)?$")
"""How a temporary file's name ends: the process that writes it."""
_STILL_SECONDS = 10.0
"""How long a file has not been written to before it counts as left behind."""
_LONG_SECONDS = 86_400.0
"""The same where nothing tells whether its writer lives."""


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

    Whoever reads `path` sees the old file or the whole new one. On any failure the new file is removed; what
    a writer that was killed has left of the same file is removed too. Raises OutputError where the system
    refuses: full disk, folder missing or not writable.
    """
    temporary: Path | None = None
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; name a file in it")
        clear_left_behind(path.parent, path.name[:_LONGEST_NAME])
        prefix = f".{path.name[:_LONGEST_NAME]}.{os.getpid()}-"
        # Readable by others, as an ordinary new file is, not private as mkstemp makes it.
        descriptor, name = tempfile.mkstemp(prefix=prefix, suffix=path.suffix, dir=path.parent)
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


def clear_left_behind(folder: Path, name: str = "") -> None:
    """Removes what writers that were killed have left in a folder of files whose names begin with `name`."""
    with suppress(OSError):
        entries = [Path(entry) for entry in os.scandir(folder) if entry.name.startswith(f".{name}")]
        for path in entries:
            writer = _WRITER.search(path.name)
            if writer is not None and _is_left_behind(path, int(writer[1])):
                path.unlink(missing_ok=True)


def _is_left_behind(path: Path, process: int) -> bool:
    still = time.time() - path.stat().st_mtime
    if sys.platform == "win32":  # There a signal that only asks would end a process.
        return still > _LONG_SECONDS
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return still > _STILL_SECONDS
    except (OSError, OverflowError):
        return False
    return False


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
