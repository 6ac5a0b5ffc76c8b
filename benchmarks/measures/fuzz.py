"""`incpt bench fuzz`: damages files at random and reads them; only InputErrors of one line may come out.

Each damage follows from a seed, so that a file that went wrong can be made again. Files are read in another
process, which may end, hang or take too much memory: each is a failure of the file that it was at.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import shutil
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import typer

from incpt.core.errors import InputError, InputWarning
from incpt.formats import bitmaps, edit_script, registry
from incpt.formats.registry import FileKind
from incpt.scene.model import Scene

LARGEST_SAMPLE = 1 << 20
"""Bytes; larger files say nothing more."""
SLOW_SECONDS = 20.0
"""What a damaged file may take at most."""
_EDITS = ".edits.toml"
_INTERESTING = (
    b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"-1", b"nan", b"1e39", b"1e-320", b"9" * 20,
    b'"', b"{", b"]", b"<", b"../", b"\0", b"\n", b"\x80",
)  # fmt: skip
"""What readers may not have thought of, put in anywhere."""


def fuzz(
    folder: Annotated[Path, typer.Argument(help="Whose files are damaged, also those in folders within.")],
    minutes: Annotated[float, typer.Option(help="How long.", min=0.01)] = 15.0,
    seed: Annotated[int, typer.Option(help="Chooses the damages.")] = 0,
    first: Annotated[int, typer.Option(help="The number of the first damage.", min=0)] = 0,
    only: Annotated[str | None, typer.Option(help="Only files with this suffix, such as .obj.")] = None,
) -> None:
    """Damage files at random and read them: no crash, no hang, no traceback."""
    samples = _samples(folder, only)
    if not samples:
        raise InputError(f"{folder}: has no file that can be read")
    counts: Counter[tuple[str, str]] = Counter()
    end = time.monotonic() + 60 * minutes
    for number, sample, outcome in _outcomes(samples, seed, first, end):
        kind = outcome if outcome in ("read", "refused") else "failed"
        counts[sample.suffix.lower(), kind] += 1
        if kind == "failed":
            print(f"{number} {sample}: {outcome}", flush=True)
    for suffix in sorted({suffix for suffix, _ in counts}):
        told = ", ".join(f"{counts[suffix, kind]:,} {kind}" for kind in ("read", "refused", "failed"))
        print(f"{suffix}: {told}")
    failed = sum(count for (_, kind), count in counts.items() if kind == "failed")
    print(f"{sum(counts.values()):,} damaged files of {len(samples):,}, seed {seed}: {failed} failed")
    if failed:
        raise typer.Exit(1)


def _samples(folder: Path, only: str | None) -> list[Path]:
    """The files of a folder that can be read, without those that say the same."""
    known = {suffix for kind in FileKind for suffix in registry.suffixes(kind)}
    known |= {*bitmaps.SUFFIXES, ".mtl"}
    found: dict[tuple[str, bytes], Path] = {}
    for path in sorted(folder.rglob("*")):
        suffix = path.suffix.lower()
        is_wanted = suffix in known and only in (None, suffix) and path.is_file() and not path.is_symlink()
        if is_wanted and 0 < path.stat().st_size <= LARGEST_SAMPLE:
            found.setdefault((suffix, path.read_bytes()), path)
    return list(found.values())


def _outcomes(samples: list[Path], seed: int, first: int, end: float) -> Iterator[tuple[int, Path, str]]:
    """The number, the sample and the outcome of one damage after the other, until a time is over."""
    number = first
    context = multiprocessing.get_context("spawn")
    while time.monotonic() < end:
        ours, theirs = context.Pipe()
        reader = context.Process(target=_read_on, args=(theirs, samples, seed, number), daemon=True)
        reader.start()
        theirs.close()
        try:
            while time.monotonic() < end:
                # The first one is waited for longer, because the process has to begin.
                if not ours.poll(3 * SLOW_SECONDS):
                    yield number, _sample(samples, seed, number), "hangs"
                    break
                yield number, _sample(samples, seed, number), ours.recv()
                number += 1
        except EOFError:
            reader.join()
            yield number, _sample(samples, seed, number), f"ended the process ({reader.exitcode})"
        reader.kill()
        reader.join()
        number += 1


def _sample(samples: list[Path], seed: int, number: int) -> Path:
    return _random(seed, number).choice(samples)


def _random(seed: int, number: int) -> random.Random:
    return random.Random(f"{seed} {number}")


def damaged(samples: list[Path], seed: int, number: int) -> tuple[Path, bytes]:
    """A sample, and what becomes of its content by the damage of that number."""
    chance = _random(seed, number)
    sample = chance.choice(samples)
    content = bytearray(sample.read_bytes())
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        place = chance.randrange(len(content) + 1)
        kind = chance.random()
        if kind < 0.3 and place < len(content):
            content[place] = chance.randrange(256)
        elif kind < 0.55:
            new = chance.choice(_INTERESTING)
            content[place : place + len(new)] = new
        elif kind < 0.7:
            content[place:place] = chance.choice(_INTERESTING)
        elif kind < 0.8:
            del content[place : place + chance.randrange(1, 64)]
        elif kind < 0.95:
            other = chance.randrange(len(content) + 1)
            content[place:place] = content[other : other + chance.randrange(1, 64)]
        else:
            del content[place:]
    return sample, bytes(content)


def _read_on(to: Connection, samples: list[Path], seed: int, first: int) -> None:
    """Reads one damaged file after the other and tells how each ended; nobody returns from here."""
    warnings.simplefilter("ignore", InputWarning)
    with tempfile.TemporaryDirectory() as folder:
        number = first
        while True:
            sample, content = damaged(samples, seed, number)
            to.send(_outcome(Path(folder) / "files", sample, content))
            number += 1


def _outcome(folder: Path, sample: Path, content: bytes) -> str:
    """How reading a damaged sample ends, beside the files that it stands among."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for beside in sample.parent.iterdir():
        if beside.name != sample.name:
            os.symlink(beside.resolve(), folder / beside.name)
    path = folder / sample.name
    path.write_bytes(content)
    began = time.monotonic()
    try:
        _read(path)
    except InputError as error:
        if "\n" in str(error):
            return f"refused in several lines: {str(error)[:200]!r}"
        outcome = "refused"
    except Exception:
        return traceback.format_exc(limit=-4)
    else:
        outcome = "read"
    seconds = time.monotonic() - began
    return outcome if seconds < SLOW_SECONDS else f"took {seconds:.0f} s"


def _read(path: Path) -> None:
    """As whoever opens such a file does. Raises InputError."""
    row = registry.format_of(path, *FileKind)
    if path.name.endswith(_EDITS):
        edit_script.load_edits(path, Scene())
    elif path.suffix == ".mtl":
        from incpt.formats.obj.mtl import MaterialLibrary

        MaterialLibrary().read(path)
    elif row is None:
        bitmaps.load_bitmap(path)
    elif row.kind is FileKind.IMAGE:
        bitmaps.load_bitmap(path)
        row.read(path)
    else:
        registry.load_with_report(path, time=0.5)
