"""Programs: from the files of cl/ to the text that a device's compiler gets.

A program is one file of cl/ with its includes put in, behind the header of `layout` and the names of its
*features*: preprocessor names that choose a variant of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

from incpt.core import layout

# Relaxed arithmetic only where NaN and infinity keep their meaning: -cl-fast-relaxed-math loses rays.
BUILD_OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-cl-no-signed-zeros")
"""Options of every build."""

_INCLUDE = re.compile(r'^#include "([\w/]+)\.cl"$', re.MULTILINE)


def program_text(file: str, features: tuple[str, ...] = (), target: str | None = None) -> str:
    """The whole source of the program around cl/`file`.cl.

    The target is part of the text, so that a kernel cached for another processor is not taken.
    """
    defines = "".join(f"#define {name}\n" for name in features)
    return f"// target: {target}\n{defines}{layout.c_header()}\n{source(file)}"


def source(file: str, included: set[str] | None = None) -> str:
    """The text of cl/`file`.cl with its includes put in, each once. `file` is a path below cl/, such as
    "path/generate".

    Done here and not by -I, which a path with a space or a zipped package would defeat.
    """
    included = set() if included is None else included
    included.add(file)
    text = resources.files("incpt.cl").joinpath(f"{file}.cl").read_text("utf-8")

    def include(match: re.Match[str]) -> str:
        name = match.group(1)
        if name in included:
            return ""
        line = text.count("\n", 0, match.end()) + 2
        return f'{source(name, included)}\n#line {line} "{file}.cl"'

    return f'#line 1 "{file}.cl"\n' + _INCLUDE.sub(include, text)


@cache
def files() -> dict[str, str]:
    """Every file of cl/ by its name: "generate" is "path/generate". No two have the same name."""
    found: dict[str, str] = {}
    for file in _below(resources.files("incpt.cl"), ""):
        name = file.rpartition("/")[2]
        assert name not in found, f"cl/{file}.cl and cl/{found[name]}.cl have the same name"
        found[name] = file
    return found


def first_error(log: str) -> str:
    """The first error that a compiler tells of."""
    for line in log.splitlines():
        if "error:" in line:
            return line.strip()
    return log.strip().splitlines()[0]


def _below(folder: Traversable, prefix: str) -> Iterator[str]:
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir():
            yield from _below(item, f"{prefix}{item.name}/")
        elif item.name.endswith(".cl"):
            yield prefix + item.name.removesuffix(".cl")
