"""Files that are written whole or not at all, and what killed writers leave behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from incpt.core import files

WRITER = """
import pathlib, sys, time
from incpt.core import files
def write(temporary):
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
files.write_atomically(pathlib.Path(sys.argv[1]), write)
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def killed_writer(path: Path) -> Path:
    """The file that a writer left that was killed, as old as a person takes to come back."""
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "writing\n"
    (left,) = [one for one in path.parent.iterdir() if one.name.startswith(f".{path.name}.")]
    files.write_bytes(path, b"whole")
    assert left.exists(), "its writer lives"
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    old = time.time() - 60
    os.utime(left, (old, old))
    return left


@pytest.mark.skipif(sys.platform == "win32", reason="there it is told by age alone")
def test_what_a_killed_writer_left_goes_with_the_next_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    left = killed_writer(path)
    other = tmp_path / left.name.replace("scene.toml", "other.toml")
    other.write_text("of another file")
    foreign = tmp_path / ".scene.toml.swp"
    foreign.write_text("of another program")
    os.utime(foreign, (0, 0))
    files.write_bytes(path, b"next")
    assert path.read_bytes() == b"next" and names(tmp_path) == [other.name, foreign.name, path.name]
    mine = tmp_path / f".scene.toml.{os.getpid()}-abcdefgh.toml"
    mine.write_text("under way")
    os.utime(mine, (0, 0))
    files.clear_left_behind(tmp_path, "scene")
    assert mine.exists(), "its writer lives"


def test_a_folder_that_is_not_there_is_no_failure(tmp_path: Path) -> None:
    files.clear_left_behind(tmp_path / "nothing")


def test_what_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    files.write_bytes(path, b"old")

    def fail(temporary: Path) -> None:
        temporary.write_bytes(b"half")
        raise OSError("full")

    with pytest.raises(files.OutputError, match="cannot be written"):
        files.write_atomically(path, fail)
    assert path.read_bytes() == b"old" and names(tmp_path) == ["a.bin"]
